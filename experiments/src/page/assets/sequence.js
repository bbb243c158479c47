// Who sent what to whom: a lane for each actor, messages from the time at which they were sent to that of their fate.
// Where there are too many to be told apart they are counted by actor and time; nearer, each is there by itself.

/** As many rows as are drawn one by one. */
const SINGLE = 1500;
/** How high a lane is at least, and where there is room at most. */
const LANES = [18, 40];
const AXIS = 26;
/** How wide a time is for which rows are counted together. */
const CELL = 4;

/** The colour of what differs between two logs. */
const DIFFERS = "--s3";

/** What can be shown or not, and which classes that is. */
const FATES = [
  ["delivered", ["delivered", "message"], true],
  ["lost", ["lost"], true],
  ["in flight", ["in_flight"], true],
  ["timers", ["timer"], false],
  ["at shared links", ["hand_over"], false],
  ["events", ["start", "crash", "restart", "change", "stop", "told"], true],
];
const EVENTS = FATES[5][1];

/** Names in the order in which people count: rover_2 before rover_10. */
const inOrderOfNames = new Intl.Collator("en", { numeric: true }).compare;

/** Whether one of some globs, parted by commas or spaces, matches a name; a word without stars may be a part of it. */
function matcher(text) {
  const words = text.split(/[\s,]+/).filter(Boolean);
  const patterns = words.map((word) => {
    const parts = word.split("*").map((part) => part.replace(/[.+?^${}()|[\]\\]/g, "\\$&"));
    return new RegExp(word.includes("*") ? `^${parts.join(".*")}$` : parts[0], "i");
  });
  return (name) => patterns.length === 0 || patterns.some((pattern) => pattern.test(name));
}

class Sequence {
  constructor(state) {
    this.state = state;
    this.canvas = byId("sequence");
    this.box = byId("lanes");
    this.marks = [];
    this.draw = onceAFrame(() => this.drawNow());
    this.fill();
    this.filter();
    this.listen();
    for (const event of ["time", "view", "select", "look"]) state.on(event, this.draw);
    state.on("side", () => { this.fillChoices(); this.filter(); });
    state.on("select", () => this.reveal());
    this.box.addEventListener("scroll", this.draw);
    this.legend();
    this.draw();
  }

  // --- What is shown -------------------------------------------------------------------------------------------

  fill() {
    const fates = byId("fates");
    const used = new Set(this.state.sides.flatMap((side) => Object.keys(side.told.counts)));
    FATES.forEach(([name, classes, on], index) => {
      if (!classes.some((cls) => used.has(cls))) return;
      const box = element("input", { type: "checkbox", "data-fate": index, onchange: () => this.filter() });
      box.checked = on;
      fates.append(element("label", {}, box, index === 0 && !used.has("delivered") ? "messages" : name));
    });
    for (const id of ["actors", "kinds", "reasons"]) byId(id).addEventListener("input", () => this.filter());
    this.fillChoices();
  }

  fillChoices() {
    const { flows } = this.state.side;
    for (const [id, field] of [["kinds", "kind"], ["reasons", "reason"]]) {
      const select = byId(id);
      const chosen = select.value;
      const values = [...new Set(flows.map((flow) => flow[field]))].filter(Boolean).sort(inOrderOfNames);
      select.replaceChildren(element("option", { value: "" }, "all"), ...values.map((one) => element("option", { value: one }, one)));
      select.value = values.includes(chosen) ? chosen : "";
      select.closest("label").hidden = values.length < 1;
    }
  }

  /** Which flows are shown, on all sides, and which actors have a lane. */
  filter() {
    const actors = matcher(byId("actors").value);
    const [kind, reason] = [byId("kinds").value, byId("reasons").value];
    const classes = new Set();
    for (const box of byId("fates").querySelectorAll("input")) {
      if (box.checked) for (const cls of FATES[box.dataset.fate][1]) classes.add(cls);
    }
    const isShown = (flow) => classes.has(flow.cls) && (!kind || flow.kind === kind)
      && (!reason || flow.reason === reason) && (actors(flow.sender) || actors(flow.receiver));
    this.state.passes = this.state.sides.map((side) => Uint8Array.from(side.flows, (flow) => (isShown(flow) ? 1 : 0)));
    this.layLanes(byId("actors").value.trim() !== "");
    this.state.tell("filter");
    this.draw();
  }

  layLanes(onlyShown) {
    const { side, passes, index } = this.state;
    const names = new Set();
    side.flows.forEach((flow, at) => {
      if (onlyShown && !passes[index][at]) return;
      // Links have no lanes: what changes them is marked on the axis.
      if (flow.cls !== "change" && flow.receiver !== "@control") names.add(flow.receiver);
      if (flow.sender !== "@control" && flow.cls !== "change") names.add(flow.sender);
    });
    this.lanes = [...names].sort(inOrderOfNames);
    const places = new Map(this.lanes.map((name, lane) => [name, lane]));
    this.laneOf = side.flows.map((flow) => [places.get(flow.sender) ?? -1, places.get(flow.receiver) ?? -1]);
    this.laneOfName = places;
  }

  legend() {
    const used = new Set(this.state.sides.flatMap((side) => Object.keys(side.told.counts)));
    const entry = ([cls, { sign, name, colour: its }]) => {
      const mark = element("span", { class: "sign", style: `color: var(${its})`, "aria-hidden": "true" }, sign);
      const count = this.state.sides.map((side) => (side.told.counts[cls] ?? 0).toLocaleString("en")).join(" / ");
      return element("li", {}, mark, ` ${name}: ${count}`);
    };
    const entries = Object.entries(CLASSES).filter(([cls]) => used.has(cls)).map(entry);
    if (this.state.sides.length > 1) {
      const mark = element("span", { class: "sign", style: `color: var(${DIFFERS})`, "aria-hidden": "true" }, "○");
      const count = this.state.sides.map((side) => side.told.differing.toLocaleString("en")).join(" / ");
      entries.push(element("li", { id: "differing-count" }, mark, ` differs: ${count}`));
    }
    byId("legend").replaceChildren(...entries);
  }

  // --- Where it is ---------------------------------------------------------------------------------------------

  measure() {
    this.width = this.box.clientWidth;
    this.left = Math.min(130, Math.max(74, this.width * 0.16));
    const most = Math.min(620, Math.max(300, window.innerHeight * 0.62));
    this.lane = Math.max(LANES[0], Math.min(LANES[1], Math.floor((most - AXIS - 10) / Math.max(1, this.lanes.length))));
    this.height = Math.min(most, AXIS + this.lanes.length * this.lane + 10);
    // Its border is a part of it.
    this.box.style.height = `${this.height + 2}px`;
    byId("room").style.height = `${Math.max(0, AXIS + this.lanes.length * this.lane + 10 - this.height)}px`;
    this.canvas.style.height = `${this.height}px`;
    this.top = this.box.scrollTop;
  }

  x(time) {
    const { from, to } = this.state;
    return this.left + ((time - from) / (to - from)) * (this.width - this.left - 8);
  }

  time(x) {
    const { from, to } = this.state;
    return from + ((x - this.left) / (this.width - this.left - 8)) * (to - from);
  }

  y(lane) {
    return lane < 0 ? AXIS - 5 : AXIS + lane * this.lane + this.lane / 2 - this.top;
  }

  // --- Drawing -------------------------------------------------------------------------------------------------

  /** Whether a row is shown, as far as differences decide. */
  isWanted(row) {
    return !this.state.onlyDiffering || this.state.side.rows.differs[row] === 1;
  }

  /** The rows that are shown in a span of time: how many, and with a list as long as there are few. */
  shown() {
    const { rows } = this.state.side;
    const passes = this.state.passes[this.state.index];
    const { from, to } = this.state;
    const list = [];
    let count = 0;
    const last = rowAfter(rows, to);
    for (let row = rowFrom(rows, from); row < last; row++) {
      if (!passes[rows.flow[row]] || !this.isWanted(row)) continue;
      if (count < SINGLE) list.push(row);
      count += 1;
    }
    // Sent within, and not there before its end.
    const end = Math.min(rows.n, rowFrom(rows, to + rows.longest) + 1);
    for (let row = last; row < end; row++) {
      if (!passes[rows.flow[row]] || !this.isWanted(row) || rows.sent[row] > to || count >= SINGLE) continue;
      list.push(row);
    }
    return { list, count };
  }

  drawNow() {
    this.measure();
    const { width, height, state } = this;
    const pen = fresh(this.canvas, width, height);
    this.marks = [];
    const shown = this.shown();
    pen.save();
    pen.beginPath(); pen.rect(0, AXIS, width, height - AXIS); pen.clip();
    this.drawLanes(pen);
    pen.beginPath(); pen.rect(this.left, AXIS, width - this.left, height - AXIS); pen.clip();
    if (shown.count <= SINGLE) for (const row of shown.list) this.drawRow(pen, row);
    else this.drawCounts(pen);
    this.drawChain(pen);
    pen.restore();
    this.drawAxis(pen);
    const x = this.x(state.time);
    if (x >= this.left && x <= width) {
      pen.strokeStyle = colour("--ink");
      pen.lineWidth = 1.5;
      pen.beginPath(); pen.moveTo(x, AXIS - 6); pen.lineTo(x, height); pen.stroke();
    }
    this.say(shown.count);
  }

  say(count) {
    const { state } = this;
    const { told } = state.side;
    const span = `${timeText(state.from, state.to - state.from)} to ${timeText(state.to, state.to - state.from)}`;
    const many = count > SINGLE ? `${plural(count, "message")}, counted by actor and time; nearer, each is shown` : `${count.toLocaleString("en")} ${count === 1 ? "message or event" : "messages and events"}`;
    const out = told.left_out && state.to > told.first_left_out_ns
      ? ` From ${exactTime(told.first_left_out_ns)} on ${told.left_out.toLocaleString("en")} deliveries and timers are only counted: they cannot be chosen.` : "";
    const text = `${span}: ${many}.${out}`;
    const said = byId("chart-said");
    if (said.dataset.span !== text) {
      said.dataset.span = text;
      said.textContent = text;
    }
  }

  drawLanes(pen) {
    const { state, width, height } = this;
    pen.font = font(12);
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    const { selected } = state;
    const ends = selected?.side === state.index ? [state.side.flow(selected.row).sender, state.side.flow(selected.row).receiver] : [];
    this.lanes.forEach((name, lane) => {
      const y = this.y(lane);
      if (y < AXIS - this.lane || y > height + this.lane) return;
      const differs = state.reached.get(name);
      if (differs !== undefined) {
        // From here on what this actor says or does is another.
        const x = Math.max(this.left, this.x(differs));
        pen.fillStyle = colour("--s3");
        pen.globalAlpha = 0.16;
        if (x < width) pen.fillRect(x, y - this.lane / 2, width - x, this.lane);
        pen.globalAlpha = 1;
        if (x < width && x > this.left) pen.fillRect(x, y - this.lane / 2, 2, this.lane);
      }
      pen.strokeStyle = colour("--rule");
      pen.lineWidth = 1;
      pen.beginPath(); pen.moveTo(this.left, y); pen.lineTo(width, y); pen.stroke();
      pen.fillStyle = colour(ends.includes(name) ? "--ink" : "--soft");
      pen.font = font(12, ends.includes(name) ? 700 : 400);
      pen.fillText(shortened(pen, name, this.left - 12), this.left - 8, y);
    });
  }

  drawRow(pen, row) {
    const { side } = this.state;
    const { rows } = side;
    const flow = side.flow(row);
    const [from, to] = this.laneOf[rows.flow[row]];
    const { colour: its } = classOf(flow.cls);
    pen.strokeStyle = pen.fillStyle = colour(its);
    const [x0, x1] = [this.x(rows.sent[row]), this.x(rows.at[row])];
    const [y0, y1] = [this.y(from), this.y(to)];
    const isMessage = ["delivered", "lost", "in_flight"].includes(flow.cls) && from >= 0 && from !== to;
    if (!isMessage) {
      if (to < 0 && EVENTS.includes(flow.cls)) return;
      if (rows.differs[row]) this.markDiffering(pen, x1, y1, x1, y1);
      drawSign(pen, flow.cls, x1, y1);
      this.marks.push({ row, x: x1, y: y1 });
      return;
    }
    pen.lineWidth = flow.cls === "lost" ? 1.4 : 1;
    pen.setLineDash(flow.cls === "lost" ? [4, 3] : flow.cls === "in_flight" ? [1, 3] : []);
    // A loss ends before its receiver.
    const share = flow.cls === "lost" ? 0.6 : 1;
    const y = y0 + (y1 - y0) * share;
    if (rows.differs[row]) this.markDiffering(pen, x0, y0, x1, y);
    pen.beginPath(); pen.moveTo(x0, y0); pen.lineTo(x1, y); pen.stroke();
    pen.setLineDash([]);
    if (flow.cls === "delivered") {
      // The last step is seldom steep enough on screen to show where it goes: heads point at the lane.
      const angle = Math.atan2(y - y0, x1 - x0);
      const head = (turn) => [x1 - 6 * Math.cos(angle + turn), y - 6 * Math.sin(angle + turn)];
      pen.beginPath(); pen.moveTo(x1, y); pen.lineTo(...head(0.45)); pen.lineTo(...head(-0.45)); pen.fill();
    } else {
      drawSign(pen, flow.cls, x1, y);
    }
    this.marks.push({ row, x: x1, y });
  }

  /** What the other log has otherwise stands out: a band behind its arrow, and a ring about its end. */
  markDiffering(pen, x0, y0, x1, y1) {
    pen.save();
    pen.setLineDash([]);
    pen.strokeStyle = colour(DIFFERS);
    pen.lineCap = "round";
    pen.globalAlpha = 0.35;
    pen.lineWidth = 6;
    pen.beginPath(); pen.moveTo(x0, y0); pen.lineTo(x1, y1); pen.stroke();
    pen.globalAlpha = 1;
    pen.lineWidth = 1.6;
    pen.beginPath(); pen.arc(x1, y1, 7, 0, 7); pen.stroke();
    pen.restore();
  }

  /** Counts by lane and time: the darker the more, and a cross where something was lost. */
  drawCounts(pen) {
    const { side, from, to } = this.state;
    const { rows } = side;
    const passes = this.state.passes[this.state.index];
    const columns = Math.max(1, Math.ceil((this.width - this.left) / CELL));
    const lanes = this.lanes.length;
    const [arrived, lost] = [new Uint32Array(columns * lanes), new Uint32Array(columns * lanes)];
    const differs = new Uint8Array(columns * lanes);
    const scale = (this.width - this.left - 8) / (to - from) / CELL;
    const last = rowAfter(rows, to);
    const signs = [];
    for (let row = rowFrom(rows, from); row < last; row++) {
      const flow = rows.flow[row];
      if (!passes[flow] || !this.isWanted(row)) continue;
      const column = Math.min(columns - 1, Math.floor((rows.at[row] - from) * scale));
      const { cls } = side.flows[flow];
      const [sender, receiver] = this.laneOf[flow];
      if (rows.differs[row] && receiver >= 0) differs[receiver * columns + column] = 1;
      if (cls === "lost") { if (sender >= 0) lost[sender * columns + column] += 1; }
      else if (EVENTS.includes(cls) && cls !== "start") signs.push(row);
      else if (receiver >= 0) arrived[receiver * columns + column] += 1;
    }
    this.addCounted(arrived, lost, columns, scale);
    const most = arrived.reduce((most, count) => Math.max(most, count), 1);
    const lanesSeen = this.lanes.map((_, lane) => lane).filter((lane) => this.y(lane) > AXIS - this.lane && this.y(lane) < this.height + this.lane);
    pen.fillStyle = colour("--s0");
    for (const lane of lanesSeen) {
      for (let column = 0; column < columns; column++) {
        const count = arrived[lane * columns + column];
        if (!count) continue;
        pen.globalAlpha = 0.2 + 0.75 * (Math.log(1 + count) / Math.log(1 + most));
        pen.fillRect(this.left + column * CELL, this.y(lane) - this.lane / 2 + 3, CELL - 0.6, this.lane - 6);
      }
    }
    pen.globalAlpha = 1;
    // What differs between two logs has a line beneath it.
    pen.fillStyle = colour(DIFFERS);
    for (const lane of lanesSeen) {
      for (let column = 0; column < columns; column++) {
        if (differs[lane * columns + column]) pen.fillRect(this.left + column * CELL, this.y(lane) + this.lane / 2 - 3, CELL, 3);
      }
    }
    pen.strokeStyle = colour("--s1");
    for (const lane of lanesSeen) {
      for (let column = 0; column < columns; column++) {
        if (!lost[lane * columns + column]) continue;
        // Beside its neighbours it would be a blur: of three columns one has the cross.
        const first = column - (column % 3);
        const before = lost[lane * columns + first] || (column > first + 1 && lost[lane * columns + first + 1]);
        if (column > first && before) continue;
        const [x, y] = [this.left + (column + 0.5) * CELL, this.y(lane)];
        pen.strokeStyle = colour("--paper");
        pen.lineWidth = 4;
        pen.beginPath(); pen.moveTo(x - 3, y - 3); pen.lineTo(x + 3, y + 3); pen.moveTo(x + 3, y - 3); pen.lineTo(x - 3, y + 3); pen.stroke();
        pen.strokeStyle = colour("--s1");
        drawSign(pen, "lost", x, y, 3);
      }
    }
    for (const row of signs.slice(0, SINGLE)) this.drawRow(pen, row);
  }

  /** Adds what has no row of its own but is counted, where nothing is left out by a filter. */
  addCounted(arrived, lost, columns, scale) {
    const { side, from, to } = this.state;
    const { told } = side;
    if (this.state.onlyDiffering || !told.left_out || to < told.first_left_out_ns || byId("kinds").value || byId("reasons").value) return;
    const { width_ns: width, lanes } = told.bins;
    for (const [name, bins] of Object.entries(lanes)) {
      const lane = this.laneOfName.get(told.names[name]);
      if (lane === undefined) continue;
      bins.forEach(([count], bin) => {
        const [start, end] = [Math.max(bin * width, told.first_left_out_ns, from), Math.min((bin + 1) * width, to)];
        if (start >= end) return;
        const [first, last] = [Math.floor((start - from) * scale), Math.min(columns - 1, Math.floor((end - from) * scale))];
        const each = Math.round((count * (end - start)) / width / (last - first + 1));
        for (let column = first; column <= last; column++) arrived[lane * columns + column] = Math.max(arrived[lane * columns + column], each);
      });
    }
  }

  /** The message that is selected and what led to it, whatever the filter is. */
  drawChain(pen) {
    const { selected } = this.state;
    if (!selected || selected.side !== this.state.index) return;
    const chain = [selected.row, ...this.state.chain.map((step) => step.row)].slice(0, 400);
    const { rows } = this.state.side;
    for (const row of chain.reverse()) {
      const [sender, receiver] = this.laneOf[rows.flow[row]];
      const flow = this.state.side.flow(row);
      const share = flow.cls === "lost" ? 0.6 : 1;
      const [y0, y1] = [this.y(sender), this.y(receiver)];
      const [x0, x1] = [this.x(rows.sent[row]), this.x(rows.at[row])];
      const isTimer = sender < 0 || sender === receiver;
      const y = isTimer ? y1 : y0 + (y1 - y0) * share;
      pen.strokeStyle = colour("--ink");
      pen.fillStyle = colour(row === selected.row ? "--s4" : "--paper");
      pen.lineWidth = row === selected.row ? 3 : 2;
      pen.setLineDash(isTimer ? [2, 2] : []);
      pen.beginPath(); pen.moveTo(x0, isTimer ? y1 : y0); pen.lineTo(x1, y); pen.stroke();
      pen.setLineDash([]);
      pen.lineWidth = 2;
      pen.beginPath(); pen.arc(x1, y, row === selected.row ? 6 : 4, 0, 7); pen.fill(); pen.stroke();
      if (flow.cls === "lost") { pen.strokeStyle = colour("--s1"); drawSign(pen, "lost", x1, y, 4); }
      if (row === selected.row && flow.reason) {
        pen.font = font(12, 700);
        pen.fillStyle = colour("--s1");
        const right = x1 + 90 < this.width;
        pen.textAlign = right ? "left" : "right";
        pen.textBaseline = "middle";
        writeOver(pen, flow.reason, x1 + (right ? 10 : -10), y - 10);
      }
    }
  }

  drawAxis(pen) {
    const { state, width, left } = this;
    pen.fillStyle = colour("--paper");
    pen.fillRect(0, 0, width, AXIS);
    pen.font = font(11);
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    const room = new Room();
    for (const { at, text } of timeTicks(state.from, state.to, (width - left) / 95)) {
      const x = this.x(at);
      pen.strokeStyle = colour("--rule");
      pen.lineWidth = 1;
      pen.beginPath(); pen.moveTo(x, AXIS - 5); pen.lineTo(x, this.height); pen.stroke();
      const w = pen.measureText(text).width;
      const middle = Math.min(Math.max(x, left + w / 2 - 6), width - w / 2 - 2);
      pen.fillStyle = colour("--soft");
      if (room.take(middle - w / 2 - 4, 0, w + 8, 12)) pen.fillText(text, middle, 9);
    }
    // What happens to no actor, as changes of links.
    const { rows } = state.side;
    const passes = state.passes[state.index];
    let count = 0;
    state.side.flows.forEach((flow, at) => { if (passes[at] && this.laneOf[at][1] < 0 && EVENTS.includes(flow.cls)) count += 1; });
    if (!count) return;
    const last = rowAfter(rows, state.to);
    for (let row = rowFrom(rows, state.from); row < last; row++) {
      const flow = rows.flow[row];
      if (!passes[flow] || this.laneOf[flow][1] >= 0 || !EVENTS.includes(state.side.flows[flow].cls)) continue;
      const { cls } = state.side.flows[flow];
      pen.fillStyle = pen.strokeStyle = colour(classOf(cls).colour);
      const x = this.x(rows.at[row]);
      drawSign(pen, cls, x, AXIS - 6, 4);
      if (this.marks.length < 4 * SINGLE) this.marks.push({ row, x, y: AXIS - 6 });
    }
  }

  // --- Choosing and moving -------------------------------------------------------------------------------------

  /** The row at a place: a mark that is drawn near it, or the nearest in time on that lane, losses before others. */
  at(x, y) {
    let best = null;
    for (const mark of this.marks) {
      const distance = Math.hypot(mark.x - x, mark.y - y);
      if (distance < 12 && (!best || distance <= best.distance)) best = { row: mark.row, distance };
    }
    if (best) return best.row;
    const lane = Math.floor((y - AXIS + this.top) / this.lane);
    if (lane < 0 || lane >= this.lanes.length || x < this.left) return -1;
    const time = this.time(x);
    const reach = this.time(x + 8) - time;
    const isOn = (flow) => this.laneOf[flow].includes(lane);
    const lost = this.nearest(time, reach, (flow) => isOn(flow) && this.state.side.flows[flow].cls === "lost");
    return lost >= 0 ? lost : this.nearest(time, (this.state.to - this.state.from) / 8, isOn);
  }

  nearest(time, reach, fits) {
    const { rows } = this.state.side;
    const passes = this.state.passes[this.state.index];
    let best = -1;
    const last = rowAfter(rows, time + reach);
    for (let row = rowFrom(rows, time - reach); row < last; row++) {
      if (!passes[rows.flow[row]] || !fits(rows.flow[row]) || !this.isWanted(row)) continue;
      if (best < 0 || Math.abs(rows.at[row] - time) < Math.abs(rows.at[best] - time)) best = row;
    }
    return best;
  }

  listen() {
    const { box, state } = this;
    const pointers = new Map();
    let moved = 0;
    let spread = 0;
    const place = (event) => {
      const rect = this.canvas.getBoundingClientRect();
      return [event.clientX - rect.left, event.clientY - rect.top];
    };
    box.addEventListener("pointerdown", (event) => {
      pointers.set(event.pointerId, place(event));
      if (pointers.size === 1) moved = 0;
      if (pointers.size === 2) spread = Math.abs([...pointers.values()][0][0] - [...pointers.values()][1][0]);
    });
    box.addEventListener("pointermove", (event) => {
      const before = pointers.get(event.pointerId);
      if (!before) return;
      const now = place(event);
      pointers.set(event.pointerId, now);
      moved += Math.abs(now[0] - before[0]) + Math.abs(now[1] - before[1]);
      if (pointers.size === 2) {
        const [a, b] = [...pointers.values()];
        const wide = Math.max(20, Math.abs(a[0] - b[0]));
        state.zoom(Math.max(20, spread) / wide, this.time((a[0] + b[0]) / 2));
        spread = wide;
      } else if (moved > 5) {
        if (!box.hasPointerCapture(event.pointerId)) box.setPointerCapture(event.pointerId);
        state.pan(this.time(before[0]) - this.time(now[0]));
      }
    });
    const end = (event) => {
      const was = pointers.delete(event.pointerId);
      if (!was || moved > 5 || event.type === "pointercancel") return;
      const [x, y] = place(event);
      const row = this.at(x, y);
      if (row >= 0) state.select(state.index, row);
      else if (x >= this.left) state.setTime(this.time(x));
    };
    box.addEventListener("pointerup", end);
    box.addEventListener("pointercancel", end);
    box.addEventListener("wheel", (event) => {
      if (event.ctrlKey || event.metaKey) {
        event.preventDefault();
        state.zoom(Math.exp(event.deltaY / 300), this.time(place(event)[0]));
      } else if (Math.abs(event.deltaX) > Math.abs(event.deltaY)) {
        event.preventDefault();
        state.pan((event.deltaX / (this.width - this.left)) * (state.to - state.from));
      }
    }, { passive: false });
    box.addEventListener("keydown", (event) => this.key(event));
  }

  /** Arrow keys within the chart: the row before or after on a lane, and lanes. */
  key(event) {
    const { state } = this;
    const { rows } = state.side;
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    const turn = { ArrowUp: -1, ArrowDown: 1 }[event.key];
    if (step === undefined && turn === undefined && event.key !== "Enter") return;
    event.preventDefault();
    event.stopPropagation();
    if (event.key === "Enter") {
      const row = this.nearest(state.time, (state.to - state.from) / 2, () => true);
      if (row >= 0) state.select(state.index, row);
      return;
    }
    const chosen = state.selected?.side === state.index ? state.selected.row : -1;
    if (turn !== undefined) {
      const at = chosen < 0 ? -1 : this.laneOf[rows.flow[chosen]][1];
      for (let lane = at + turn; lane >= 0 && lane < this.lanes.length; lane += turn) {
        const row = this.nearest(state.time, state.until, (flow) => this.laneOf[flow][1] === lane);
        if (row >= 0) return state.select(state.index, row);
      }
      return;
    }
    const lane = chosen < 0 ? -1 : this.laneOf[rows.flow[chosen]][1];
    const row = state.nextRow(chosen < 0 ? state.time : chosen, step, (row) => lane < 0 || this.laneOf[rows.flow[row]].includes(lane), chosen >= 0);
    if (row >= 0) state.select(state.index, row);
  }

  /** Brings the lanes of what is selected into view. */
  reveal() {
    const { selected } = this.state;
    if (!selected || selected.side !== this.state.index) return;
    const lanes = this.laneOf[this.state.side.rows.flow[selected.row]].filter((lane) => lane >= 0);
    if (!lanes.length) return;
    const [first, last] = [Math.min(...lanes) * this.lane, (Math.max(...lanes) + 1) * this.lane];
    const room = this.height - AXIS - 10;
    let top = this.box.scrollTop;
    if (last > top + room) top = last - room;
    if (first < top) top = first;
    this.box.scrollTop = top;
  }
}
