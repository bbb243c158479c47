// The page as a whole: what all parts share (the time, the span that is looked at, the side, what is selected), keys,
// and in which order things are read and drawn.

/** About so many rows are in sight where one is to be seen by itself. */
const SEEN = 600;

class State {
  constructor(sides) {
    this.sides = sides;
    this.index = 0;
    this.until = Math.max(...sides.map((side) => side.until));
    this.time = 0;
    [this.from, this.to] = [0, this.until];
    this.selected = null;
    this.causes = { chain: [], unknown: false };
    this.passes = sides.map((side) => new Uint8Array(side.flows.length).fill(1));
    /** Nothing but what differs between two logs is shown. */
    this.onlyDiffering = false;
    /** By actor, from when on what it says or does differs; empty for one log. */
    this.reached = new Map();
    this.listeners = new Map();
  }

  get side() {
    return this.sides[this.index];
  }

  get chain() {
    return this.causes.chain;
  }

  on(event, listener) {
    if (!this.listeners.has(event)) this.listeners.set(event, []);
    this.listeners.get(event).push(listener);
  }

  tell(event) {
    for (const listener of this.listeners.get(event) ?? []) listener();
  }

  /** Goes to a time; if it is wanted in view, the chart follows. */
  setTime(time, inView = false) {
    this.time = Math.min(this.until, Math.max(0, time));
    if (inView) this.bringIntoView(this.time);
    this.tell("time");
  }

  bringIntoView(time) {
    const span = this.to - this.from;
    const margin = span * 0.05;
    if (time >= this.from + margin && time <= this.to - margin) return;
    this.setView(time - span / 2, time + span / 2);
  }

  setView(from, to) {
    const span = Math.min(this.until, Math.max(Math.min(100, this.until), to - from));
    this.from = Math.min(Math.max(0, from), this.until - span);
    this.to = this.from + span;
    this.tell("view");
  }

  pan(by) {
    this.setView(this.from + by, this.to + by);
  }

  /** Zooms about a time: by less than 1 to come nearer. */
  zoom(factor, about = this.time) {
    const span = Math.max(100, (this.to - this.from) * factor);
    const middle = Math.min(this.to, Math.max(this.from, about));
    const share = (middle - this.from) / (this.to - this.from);
    this.setView(middle - share * span, middle + (1 - share) * span);
  }

  setSide(index) {
    if (index === this.index) return;
    this.index = index;
    for (const input of document.getElementsByName("side")) input.checked = Number(input.value) === index;
    this.tell("side");
  }

  select(index, row) {
    this.setSide(index);
    const side = this.sides[index];
    this.selected = { side: index, row };
    this.causes = side.chain(row);
    this.setTime(side.rows.at[row], true);
    this.tell("select");
  }

  /** The next row before or after a time, or a row, that the chart shows and that fits. */
  nextRow(from, direction, fits, fromRow = false) {
    const { rows } = this.side;
    const passes = this.passes[this.index];
    let row = fromRow ? from + direction : direction > 0 ? rowFrom(rows, from + 1e-6) : rowFrom(rows, from) - 1;
    // At the time of the slider itself a row counts as passed.
    while (!fromRow && direction > 0 && row < rows.n && rows.at[row] <= from) row += 1;
    for (; row >= 0 && row < rows.n; row += direction) {
      if (passes[rows.flow[row]] && fits(row) && (!this.onlyDiffering || rows.differs[row])) return row;
    }
    return -1;
  }

  /** The next loss, whether or not the chart shows losses. */
  toLoss(direction) {
    const { side } = this;
    this.toNext(direction, (row) => side.flow(row).cls === "lost");
  }

  /** The next message that the other log has otherwise. */
  toDifference(direction) {
    const { rows } = this.side;
    this.toNext(direction, (row) => rows.differs[row] === 1);
  }

  toNext(direction, fits) {
    const { side } = this;
    const chosen = this.selected?.side === this.index && this.selected.row;
    const start = typeof chosen === "number" ? chosen : null;
    const row = this.nextRow(start ?? this.time, direction, fits, start !== null);
    if (row < 0) return;
    // Near enough that it is seen by itself.
    const wanted = this.until * Math.min(0.02, SEEN / Math.max(1, side.rows.n));
    if (this.to - this.from > 6 * wanted) this.zoom(wanted / (this.to - this.from), side.rows.at[row]);
    this.select(this.index, row);
  }
}

function keys(state, timeline) {
  const actions = {
    " ": () => timeline.toggle(),
    ArrowLeft: () => state.setTime(state.time - (state.to - state.from) / 100, true),
    ArrowRight: () => state.setTime(state.time + (state.to - state.from) / 100, true),
    Home: () => state.setTime(0, true),
    End: () => state.setTime(state.until, true),
    ",": () => timeline.toEvent(-1),
    ".": () => timeline.toEvent(1),
    l: () => state.toLoss(1),
    L: () => state.toLoss(-1),
    d: () => state.toDifference(1),
    D: () => state.toDifference(-1),
    "+": () => state.zoom(0.5),
    "-": () => state.zoom(2),
    0: () => state.setView(0, state.until),
  };
  document.addEventListener("keydown", (event) => {
    const writes = event.target.matches("input[type=search], select");
    const presses = event.key === " " && event.target.matches("button, summary, input[type=checkbox], input[type=radio]");
    const chooses = event.key.startsWith("Arrow") && event.target.matches("input[type=radio]");
    if (event.ctrlKey || event.metaKey || event.altKey || writes || presses || chooses || !actions[event.key]) return;
    event.preventDefault();
    actions[event.key]();
  });
}

function buttons(state) {
  const click = (id, action) => byId(id).addEventListener("click", action);
  click("nearer", () => state.zoom(0.4));
  click("farther", () => state.zoom(2.5));
  click("whole", () => state.setView(0, state.until));
  click("loss-before", () => state.toLoss(-1));
  click("loss-after", () => state.toLoss(1));
  if (state.sides.length > 1) {
    click("difference-before", () => state.toDifference(-1));
    click("difference-after", () => state.toDifference(1));
    byId("differing").addEventListener("change", () => {
      state.onlyDiffering = byId("differing").checked;
      state.tell("view");
    });
  }
  const lost = state.sides.some((side) => side.told.counts.lost);
  for (const id of ["loss-before", "loss-after"]) byId(id).hidden = !lost;
  for (const input of document.getElementsByName("side")) {
    input.addEventListener("change", () => state.setSide(Number(input.value)));
  }
}

/** What is said at the top: of each log its facts, and what the page does not have. */
function introduce(sides) {
  const several = sides.length > 1;
  const lines = sides.map((side) => {
    const facts = side.head.facts.flatMap(([name, value]) => [element("span", { class: "fact" }, `${name} `, element("b", {}, value)), " "]);
    return element("span", { class: "log" }, several ? element("b", {}, `${side.letter.toUpperCase()} ${side.head.file} `) : null, ...facts);
  });
  byId("facts").replaceChildren(...lines);
  for (const name of document.querySelectorAll("[data-side]")) {
    name.textContent = ` ${sides.find((side) => side.letter === name.dataset.side).head.file}`;
  }
  const notes = sides.flatMap((side) => side.head.notes.map((note) => (several ? `${side.head.file}: ${note}` : note)));
  for (const side of sides) {
    const { rows, left_out: out, first_left_out_ns: first, details, details_left_out: without } = side.told;
    const name = several ? `${side.head.file}: ` : "";
    if (!rows) notes.push(`${name}There is no message or event in this log.`);
    if (out) notes.push(`${name}${out.toLocaleString("en")} messages and timers from ${exactTime(first)} on are only counted, by actor and time.`);
    if (without) notes.push(`${name}What messages say is on the page for the first ${details.toLocaleString("en")} of them.`);
  }
  byId("notes").replaceChildren(...notes.map((note) => element("li", {}, note)));
}

/** Says on the page what went wrong: a page that stays empty tells nobody anything. */
function complain(error) {
  byId("facts").replaceChildren(element("span", { class: "bad" }, `This page cannot be shown: ${error.message ?? error}. It needs a browser of 2023 or later.`));
  document.documentElement.dataset.ready = "failed";
  throw error;
}

async function start() {
  const { sides: heads, diff } = await jsonOf("head");
  beginAt(heads[0].from_ns);
  const sides = heads.map((head, index) => new Side("ab"[index], head));
  introduce(sides);
  const state = new State(sides);
  const timeline = new Timeline(state);
  if (diff) state.reached = new Map(diff.spread.map(({ actor, time_ns: time }) => [actor, time]));
  await Promise.all(sides.map((side) => side.read()));
  const sequence = new Sequence(state);
  sides.forEach((_, index) => new MapView(state, index));
  new Causes(state);
  new Plots(state);
  if (diff) new Differences(state, diff);
  buttons(state);
  keys(state, timeline);
  const again = () => {
    forgetColours();
    state.tell("look");
  };
  window.addEventListener("resize", again);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", again);
  matchMedia("print").addEventListener("change", () => {
    again();
    for (const draw of drawings) draw();
  });
  // Whoever drives the page, as a test, finds here what is drawn where.
  window.farside = { state, sequence };
  requestAnimationFrame(() => { document.documentElement.dataset.ready = "yes"; });
}

start().catch(complain);
