// The message that is selected: what it says, what became of it, and what led to it, back to the root. Each of these
// can be chosen in turn, and the slider, the map and the chart follow.

/** As many causes as are listed before the rest is asked for. */
const LISTED = 60;
const EFFECTS = 30;
const PROPOSED = 12;

class Causes {
  constructor(state) {
    this.state = state;
    this.box = byId("message");
    state.on("select", () => this.show());
    state.on("side", () => { if (!state.selected) this.propose(); });
    this.propose();
  }

  /** Before anything is chosen: what happened to actors, and the first losses. */
  propose() {
    const { state } = this;
    const { rows, flows } = state.side;
    const found = { events: [], lost: [] };
    for (let row = 0; row < rows.n; row++) {
      const { cls } = flows[rows.flow[row]];
      if (cls === "lost") found.lost.push(row);
      else if (EVENTS.includes(cls) && cls !== "start" && cls !== "stop") found.events.push(row);
    }
    const list = (title, its) => {
      if (!its.length) return [];
      const some = its.slice(0, PROPOSED).map((row) => element("li", {}, this.button(state.index, row)));
      const heading = its.length > PROPOSED ? `${title}: the first ${PROPOSED} of ${its.length.toLocaleString("en")}` : title;
      return [element("h4", {}, heading), element("ul", { class: "rows" }, ...some)];
    };
    this.box.replaceChildren(
      element("p", { class: "note" }, "Choose a message in the chart, or here: what led to it is listed, back to its root."),
      ...list("Crashes, changes and what actors were told", found.events), ...list("Losses", found.lost),
    );
  }

  /** A row in a line: what, from whom to whom, and what became of it. */
  line(row) {
    const { side } = this.state;
    const { cls, sender, receiver, kind, reason } = side.flow(row);
    const sign = element("span", { class: "sign", style: `color: var(${classOf(cls).colour})`, "aria-hidden": "true" }, classOf(cls).sign);
    const ends = sender === receiver || sender === "@control" ? receiver : `${sender} → ${receiver}`;
    const numbered = ["delivered", "lost", "in_flight", "hand_over"].includes(cls);
    const what = [kind || classOf(cls).name, numbered ? side.rows.ordinal[row] : ""].filter((part) => part !== "").join(" ");
    const fate = cls === "delivered" || (kind === "" && cls !== "lost") ? "" : ` ${classOf(cls).name}${reason ? `: ${reason}` : ""}`;
    return element("span", {}, sign, " ", element("b", {}, what), ` ${ends}`, element("small", {}, fate));
  }

  button(index, row, ...more) {
    const { side } = this.state;
    const time = element("time", {}, timeText(side.rows.at[row], side.until));
    return element("button", { type: "button", class: "row", onclick: () => this.state.select(index, row) }, time, this.line(row), ...more);
  }

  async show() {
    const { state } = this;
    const { selected } = state;
    if (!selected) return;
    const side = state.sides[selected.side];
    const { row } = selected;
    const flow = side.flow(row);
    const { rows } = side;
    const title = element("h3", { id: "selected" }, this.line(row));
    const facts = [
      ["fate", `${classOf(flow.cls).name}${flow.reason ? `: ${flow.reason}` : ""}`],
      ["at", exactTime(rows.at[row])],
    ];
    if (rows.at[row] > rows.sent[row]) facts.push([flow.cls === "timer" ? "set" : "sent", `${exactTime(rows.sent[row])}, ${durationText(rows.at[row] - rows.sent[row])} before`]);
    if (flow.link) facts.push(["link", flow.link]);
    if (side.told.unit_ns > 1) facts.push(["times", "rounded down to the microsecond, as the log is large"]);
    const list = element("dl", {}, ...facts.flatMap(([name, value]) => [element("dt", {}, name), element("dd", {}, value)]));
    const says = element("div", {});
    const shown = [title, list, says, ...this.whatIf(side, row, flow), ...this.led(selected.side, row), ...this.caused(selected.side, row)];
    this.box.replaceChildren(...shown);
    byId("selected-said").textContent = `${title.textContent}, at ${exactTime(rows.at[row])}`;
    const detail = await side.detail(row);
    if (state.selected !== selected) return;
    if (detail?.carried) list.append(element("dt", {}, "carried"), element("dd", {}, detail.carried));
    if (detail?.says) {
      let text = detail.says;
      try { text = JSON.stringify(JSON.parse(text), null, 1); } catch { /* Cut, or no JSON: as it is. */ }
      says.replaceChildren(element("details", { open: text.length < 400 ? "" : null }, element("summary", {}, "What it says"), element("pre", { tabindex: "0" }, text)));
    } else if (!detail) {
      says.replaceChildren(element("p", { class: "note" }, "What it says is not on the page, which has room for some: farside cat prints it."));
    }
  }

  /** The command that tells what would have been. */
  whatIf(side, row, { cls, link }) {
    if (!side.head.farside || !link || !["lost", "delivered"].includes(cls)) return [];
    const quoted = (text) => (/^[\w./,@+-]+$/.test(text) ? text : `'${text.replaceAll("'", "'\\''")}'`);
    const at = ((side.rows.sent[row] + begins) / 1e9).toFixed(9).replace(/\.?0+$/, "") || "0";
    const verb = cls === "lost" ? "--deliver" : "--lose";
    const command = `farside fork ${quoted(side.head.path)} --at ${at}s ${verb} ${quoted(side.id(row))} --out fork.mcap`;
    const question = cls === "lost" ? "What if it had arrived?" : "What if it had been lost?";
    return [element("details", {}, element("summary", {}, question), element("pre", { class: "command", tabindex: "0" }, command))];
  }

  led(index, row) {
    const { state } = this;
    const side = state.sides[index];
    const { chain, unknown } = state.causes;
    const heading = chain.length ? element("h4", {}, `What led to it: ${plural(chain.length, "step")} back`) : element("h4", {}, "What led to it");
    if (!side.head.farside) return [element("p", { class: "note" }, "Logs of other programs do not say what caused a message.")];
    const item = ({ row: cause, repeats, since }) => {
      const more = repeats ? element("small", {}, ` and ${plural(repeats, "time")} before, since ${timeText(side.rows.at[since], side.until)}`) : null;
      return element("li", {}, this.button(index, cause, more));
    };
    const list = element("ol", { id: "chain" }, ...chain.slice(0, LISTED).map(item));
    const rest = chain.slice(LISTED);
    const end = unknown ? "What caused the last of these is not on the page: its topic was not written, or it is only counted."
      : chain.length ? "Here it begins: the last of these has no cause." : "It has no cause: it was there from the start, or planned before the run.";
    const more = element("button", { type: "button", onclick: () => { list.append(...rest.map(item)); more.remove(); } }, `Show ${plural(rest.length, "earlier step")}`);
    return [heading, list, ...(rest.length ? [more] : []), element("p", { class: "note" }, end)];
  }

  caused(index, row) {
    const side = this.state.sides[index];
    if (!side.head.farside) return [];
    const { effects, count } = side.effects(row, EFFECTS);
    if (!count) return [element("p", { class: "note" }, "It caused nothing that was logged.")];
    const list = element("ul", { class: "rows" }, ...effects.map((effect) => element("li", {}, this.button(index, effect))));
    const rest = count > effects.length ? [element("p", { class: "note" }, `and ${count - effects.length} more`)] : [];
    return [element("h4", {}, `What it caused: ${plural(count, "event")}`), list, ...rest];
  }
}
