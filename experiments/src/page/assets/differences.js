// What differs between two logs: the first difference with what caused it, and whom it reached when. Each leads to
// its place in the chart.

class Differences {
  constructor(state, diff) {
    this.state = state;
    this.diff = diff;
    const parts = [this.counts()];
    if (diff.root) parts.push(this.root(diff.root));
    if (diff.first) parts.push(this.first(diff.first, "The first difference"));
    if (diff.consequence) parts.push(this.first(diff.consequence, "Its first consequence"));
    if (diff.spread?.length) parts.push(this.spread());
    if (diff.topics?.length) parts.push(this.topics());
    byId("difference").replaceChildren(...parts);
  }

  counts() {
    const { diff } = this;
    if (diff.identical) return element("p", {}, "Nothing that was compared differs.");
    const number = (name) => diff[name].toLocaleString("en");
    const text = `${number("changed")} messages changed, ${number("only_in_a")} only in A, ${number("only_in_b")} only in B, ${number("reordered")} in another order; `
      + `${number("records_a")} and ${number("records_b")} were compared.`;
    const notes = [...diff.beside, ...diff.notes].map((note) => element("li", {}, note));
    return element("div", {}, element("p", {}, text), notes.length ? element("ul", { class: "note" }, ...notes.slice(0, 12)) : null);
  }

  /** Selects a message on the side that has it. */
  go({ sender, receiver, ordinal, time_ns: time, kind }, sides) {
    const { state } = this;
    for (const index of sides) {
      const row = state.sides[index].find({ sender, receiver, ordinal, kind, time });
      if (row < 0) continue;
      state.setSide(index);
      state.select(index, row);
      return;
    }
    state.setTime(time, true);
  }

  /** What differences began with: an input, or what a link decided. */
  root(root) {
    const go = () => this.goTo(root);
    return element("div", { class: "first" }, element("h3", {}, `The root: ${exactTime(root.time_ns)}`), element("p", {}, root.what),
      root.draw ? element("p", { class: "note" }, root.draw) : null,
      element("button", { type: "button", onclick: go, "aria-label": "Show the root" }, "Show"));
  }

  /** To a message that is called as `fork` calls it; to a time, if there is none. */
  goTo({ message, time_ns: time }) {
    const parts = message ? message.split(",") : [];
    const ordinal = Number((parts[3] ?? "").split("+")[0]);
    if (parts.length !== 4 || !Number.isFinite(ordinal)) return this.state.setTime(time, true);
    return this.go({ sender: parts[0], receiver: parts[1], kind: parts[2], ordinal, time_ns: time }, [1, 0]);
  }

  first(first, title) {
    const { topic, sender, receiver, ordinal, field, a, b, time_ns: time } = first;
    const ids = [first.carried_a?.id, first.carried_b?.id];
    const row = (letter, value, index) => {
      const carried = index ? first.carried_b : first.carried_a;
      const fate = carried ? ` (${carried.fate}${carried.reason ? `: ${carried.reason}` : ""})` : "";
      const kind = ids[index]?.split(",").at(-2);
      const go = () => this.go({ sender, receiver, ordinal, kind, time_ns: carried?.at_ns ?? time }, [index]);
      return element("tr", {}, element("th", { scope: "row" }, letter), element("td", {}, value || "—", element("small", {}, fate)),
        element("td", {}, value === "absent" ? "" : element("button", { type: "button", onclick: go, "aria-label": `Show it in ${letter}` }, "Show")));
    };
    const causes = first.causes.slice(0, 12).map((cause) => {
      const what = `${timeText(cause.time_ns, this.state.until)} ${cause.topic}`;
      const go = () => this.go({ ...cause, kind: null }, [0, 1]);
      return element("li", {}, element("button", { type: "button", class: "row", onclick: go }, what, cause.repeats ? element("small", {}, ` and ${plural(cause.repeats, "time")} before`) : null));
    });
    return element("div", { class: "first" }, element("h3", {}, `${title}: ${exactTime(time)}`),
      element("p", {}, element("b", {}, topic), ` ${sender === receiver ? receiver : `${sender} → ${receiver}`}, number ${ordinal}: `, element("i", {}, field), " differs"),
      element("table", {}, element("tbody", {}, row("A", a, 0), row("B", b, 1))),
      causes.length ? element("details", {}, element("summary", {}, `What led to it in both: ${plural(causes.length, "step")}`), element("ol", {}, ...causes)) : null);
  }

  spread() {
    const { spread } = this.diff;
    const step = ({ actor, time_ns: time, topic, how, message }) => element("button", { type: "button", class: "row", onclick: () => this.goTo({ message, time_ns: time }) },
      element("time", {}, timeText(time, this.state.until)), element("b", {}, ` ${actor}`), element("small", {}, ` ${how || topic}`));
    const item = (reached) => {
      const { path } = reached;
      const way = path?.length > 1 ? element("details", {}, element("summary", {}, `the way there: ${plural(path.length, "step")}`),
        element("ol", {}, ...path.map((hop) => element("li", {}, step(hop)))),
        reached.path_omitted ? element("p", { class: "note" }, `${plural(reached.path_omitted, "step")} in the middle left out`) : null) : null;
      return element("li", {}, step(reached), way);
    };
    const rest = spread.length > 200 ? element("p", { class: "note" }, `and ${spread.length - 200} more`) : null;
    return element("details", { open: "" }, element("summary", {}, `Whom it reached: ${plural(spread.length, "actor")}, shaded in the chart from then on`),
      element("ol", { class: "rows spread", tabindex: "0" }, ...spread.slice(0, 200).map(item)), rest);
  }

  topics() {
    const head = ["topic", "changed", "only in A", "only in B", "reordered"].map((name) => element("th", { scope: "col" }, name));
    const row = (topic) => element("tr", {}, element("th", { scope: "row" }, topic.topic),
      ...["changed", "only_in_a", "only_in_b", "reordered"].map((name) => element("td", {}, topic[name].toLocaleString("en"))));
    const { topics } = this.diff;
    const rest = topics.length > 100 ? element("p", { class: "note" }, `and ${topics.length - 100} more topics`) : null;
    return element("details", {}, element("summary", {}, `${plural(topics.length, "topic")} that differ`),
      element("div", { class: "scroll", tabindex: "0" }, element("table", {}, element("thead", {}, element("tr", {}, ...head)), element("tbody", {}, ...topics.slice(0, 100).map(row)))), rest);
  }
}
