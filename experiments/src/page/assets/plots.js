// Metrics and resources over time: how many messages arrive and are lost, and numbers that actors recorded. A click
// goes to that time.

/** What is shown first, by words in the name of a field. */
const FIRST = [/stored_j|battery|charge|energy/, /load/, /memory|queue|bytes/, /temp|_c$|power|_w$/];
const PANELS = 5;
/** Into how many times the whole is divided for rates: more would show how often somebody sends, and not how much. */
const RATES = 100;

class Plots {
  constructor(state) {
    this.state = state;
    this.panels = [];
    this.draw = onceAFrame(() => this.drawNow());
    this.fields = this.merged();
    this.add({ title: "Messages a second", unit: "1/s", curves: this.rates(), legend: true });
    const ranked = [...this.fields].sort((a, b) => a.rank - b.rank);
    const some = [];
    for (const field of ranked) {
      // Of fields that say alike, as many parts of an energy, one is enough at first.
      if (some.length < PANELS && !some.some((one) => one.kind === field.kind && one.rank === field.rank && field.rank < 9)) some.push(field);
    }
    for (const field of some) this.addField(field);
    this.fill();
    for (const event of ["time", "view", "look", "select"]) state.on(event, this.draw);
    this.draw();
  }

  fill() {
    const select = byId("fields");
    const option = (field, at) => element("option", { value: String(at) }, `${field.kind}: ${field.field}`);
    select.append(...this.fields.map(option));
    select.closest("label").hidden = !this.fields.length;
    select.addEventListener("change", () => {
      if (select.value !== "") this.addField(this.fields[Number(select.value)]);
      select.value = "";
      this.draw();
    });
    const said = [];
    const sum = (name) => this.state.sides.reduce((sum, side) => sum + side.series[name], 0);
    if (!this.fields.length) said.push("No actor recorded a number that changes.");
    if (sum("constant")) said.push(`${plural(sum("constant"), "field")} with one value all the time ${sum("constant") === 1 ? "is" : "are"} not listed.`);
    if (sum("left_out")) said.push(`${sum("left_out").toLocaleString("en")} values of further curves are left out: farside plot has them.`);
    if (this.fields.some((field) => field.curves.some((curve) => curve.values > curve.t.length))) said.push("Long curves are thinned: of each short time the first, the least, the greatest and the last value are kept.");
    byId("plots-said").textContent = said.join(" ");
  }

  /** The fields of all sides, those of one name together. */
  merged() {
    const all = new Map();
    this.state.sides.forEach((side, index) => {
      for (const { kind, field, curves } of side.series.fields) {
        const key = `${kind}\n${field}`;
        const rank = FIRST.findIndex((words) => words.test(field));
        if (!all.has(key)) all.set(key, { kind, field, rank: rank < 0 ? 9 : rank, curves: [] });
        for (const { actor, values, t, v } of curves) {
          all.get(key).curves.push({ name: actor, side: index, values, t: sums(t).map((us) => us * 1e3), v });
        }
      }
    });
    return [...all.values()];
  }

  rates() {
    const several = this.state.sides.length > 1;
    return this.state.sides.flatMap((side, index) => {
      const { width_ns: binWidth, all: bins } = side.told.bins;
      const together = Math.max(1, Math.round(bins.length / RATES));
      const width = binWidth * together;
      const all = Array.from({ length: Math.ceil(bins.length / together) }, (_, at) => {
        const some = bins.slice(at * together, (at + 1) * together);
        return some.reduce(([arrived, lost], bin) => [arrived + bin[0], lost + bin[1]], [0, 0]);
      });
      // The last may be cut off by the end of the log: much shorter than the others, it is a part of the one before.
      let rest = side.until - (all.length - 1) * width;
      if (all.length > 1 && rest < width / 2) {
        const [arrived, lost] = all.pop();
        all[all.length - 1] = [all.at(-1)[0] + arrived, all.at(-1)[1] + lost];
        rest += width;
      }
      const seconds = (at) => Math.max(1, at === all.length - 1 ? rest : width) / 1e9;
      const name = (what) => (several ? `${side.letter.toUpperCase()} ${what}` : what);
      const t = Float64Array.from(all, (_, bin) => bin * width);
      return [
        { name: name(side.head.farside ? "delivered" : "logged"), side: index, t, v: all.map((bin, at) => bin[0] / seconds(at)), steps: true, colour: "--s0", dash: several ? [[], [6, 3]][index] : [] },
        { name: name("lost"), side: index, t, v: all.map((bin, at) => bin[1] / seconds(at)), steps: true, colour: "--s1", dash: several ? [[2, 2], [1, 4]][index] : [3, 2] },
      ].filter((curve) => curve.v.some((value) => value > 0));
    });
  }

  addField(field) {
    if (this.panels.some((panel) => panel.field === field)) return;
    const several = this.state.sides.length > 1;
    const few = field.curves.length <= 7;
    const curves = field.curves.map((curve, at) => {
      if (several && !few) return { ...curve, colour: curve.side ? "--s1" : "--s0", dash: curve.side ? [5, 3] : [] };
      return { ...curve, name: several ? `${curve.side ? "B" : "A"} ${curve.name}` : curve.name, actor: curve.name, colour: few ? `--s${at}` : "--s0", dash: few ? DASHES[at] : [] };
    });
    this.add({ title: `${field.field} (${field.kind})`, curves, legend: few, field });
  }

  add(panel) {
    const canvas = element("canvas", { tabindex: "0", role: "img" });
    const legend = element("figcaption", {});
    const figure = element("figure", {}, element("h3", {}, panel.title), canvas, legend);
    canvas.addEventListener("click", (event) => this.state.setTime(this.time(event.offsetX, canvas.clientWidth), true));
    byId("panels").append(figure);
    const values = panel.curves.flatMap((curve) => curve.v.filter((value) => value !== null));
    let [low, high] = values.reduce(([low, high], value) => [Math.min(low, value), Math.max(high, value)], [Infinity, -Infinity]);
    if (!(low <= high)) [low, high] = [0, 1];
    if (low > 0 && low < high * 0.6) low = 0;
    if (low === high) high = low + 1;
    this.panels.push({ ...panel, canvas, caption: legend, low, high });
  }

  x(time, width) {
    return 52 + (time / this.state.until) * (width - 60);
  }

  time(x, width) {
    return Math.min(this.state.until, Math.max(0, ((x - 52) / (width - 60)) * this.state.until));
  }

  drawNow() {
    for (const panel of this.panels) this.drawPanel(panel);
  }

  drawPanel(panel) {
    const { state } = this;
    const { canvas, low, high } = panel;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    const pen = fresh(canvas, width, height);
    const [top, bottom] = [8, height - 20];
    const y = (value) => bottom - ((value - low) / (high - low)) * (bottom - top);
    pen.fillStyle = colour("--rule");
    pen.globalAlpha = 0.45;
    const [from, until] = [this.x(state.from, width), this.x(state.to, width)];
    if (state.to - state.from < state.until * 0.999) pen.fillRect(from, top, Math.max(2, until - from), bottom - top);
    pen.globalAlpha = 1;
    this.drawGrid(pen, panel, { width, top, bottom, y });
    const selected = state.selected && state.sides[state.selected.side].flow(state.selected.row);
    const isChosen = (curve) => selected && [selected.sender, selected.receiver].some((name) => name === curve.name || curve.name.endsWith(` ${name}`) || curve.name.startsWith(`${name}/`));
    const crowd = panel.curves.length > 7;
    for (const chosen of [false, true]) {
      for (const curve of panel.curves) {
        if (Boolean(crowd && isChosen(curve)) !== chosen) continue;
        pen.globalAlpha = crowd && !chosen ? 0.35 : 1;
        pen.strokeStyle = colour(chosen ? "--ink" : curve.colour);
        pen.lineWidth = chosen ? 2.4 : crowd ? 1 : 1.6;
        pen.setLineDash(curve.dash ?? []);
        this.drawCurve(pen, curve, width, y);
      }
    }
    pen.setLineDash([]);
    pen.globalAlpha = 1;
    const x = this.x(state.time, width);
    pen.strokeStyle = colour("--ink");
    pen.lineWidth = 1.5;
    pen.beginPath(); pen.moveTo(x, top); pen.lineTo(x, bottom); pen.stroke();
    this.caption(panel, crowd && panel.curves.filter(isChosen));
  }

  drawGrid(pen, panel, { width, top, bottom, y }) {
    pen.font = font(11);
    pen.strokeStyle = colour("--rule");
    pen.fillStyle = colour("--soft");
    pen.lineWidth = 1;
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    for (const value of ticks(panel.low, panel.high, (bottom - top) / 30)) {
      pen.beginPath(); pen.moveTo(52, y(value)); pen.lineTo(width - 8, y(value)); pen.stroke();
      pen.fillText(numberText(value), 47, y(value));
    }
    pen.textAlign = "center";
    const room = new Room();
    for (const { at, text } of timeTicks(0, this.state.until, (width - 60) / 90)) {
      const w = pen.measureText(text).width;
      const x = Math.min(Math.max(this.x(at, width), 52), width - w / 2 - 2);
      if (room.take(x - w / 2 - 5, bottom, w + 10, 10)) pen.fillText(text, x, bottom + 11);
    }
  }

  drawCurve(pen, curve, width, y) {
    pen.beginPath();
    let open = false;
    for (let at = 0; at < curve.t.length; at++) {
      const value = curve.v[at];
      if (value === null) { open = false; continue; }
      const [x, place] = [this.x(curve.t[at], width), y(value)];
      if (!open) pen.moveTo(x, place);
      else if (curve.steps) { pen.lineTo(x, y(curve.v[at - 1])); pen.lineTo(x, place); }
      else pen.lineTo(x, place);
      open = true;
    }
    pen.stroke();
  }

  /** Names of few curves with their values at the time of the slider; of many, how many there are. */
  caption(panel, chosen) {
    const { state } = this;
    const value = (curve) => {
      const at = lastUpTo(curve.t, state.time);
      return at < 0 || curve.v[at] === null ? "–" : numberText(curve.v[at]);
    };
    const entry = (curve) => element("span", { class: "curve" }, this.swatch(curve), `${curve.name} `, element("b", {}, value(curve)));
    const some = panel.curves.length <= 7 ? panel.curves : chosen || [];
    const parts = some.slice(0, 6).map((curve) => entry(panel.curves.length <= 7 ? curve : { ...curve, colour: "--ink", dash: [] }));
    if (panel.curves.length > 7) {
      const sides = state.sides.length > 1 ? ", A as full and B as dashed lines" : "";
      parts.push(element("span", { class: "note" }, `${panel.curves.length} actors${sides}${some.length ? "" : "; those of a selected message stand out"}`));
    }
    const text = parts.map((part) => part.textContent).join("|");
    if (panel.said === text) return;
    panel.said = text;
    panel.caption.replaceChildren(...parts);
    panel.canvas.setAttribute("aria-label", `${panel.title} from ${numberText(panel.low)} to ${numberText(panel.high)}`);
  }

  swatch(curve) {
    const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
    svg.setAttribute("width", "26");
    svg.setAttribute("height", "8");
    svg.setAttribute("aria-hidden", "true");
    const line = document.createElementNS("http://www.w3.org/2000/svg", "path");
    line.setAttribute("d", "M0 4H26");
    line.setAttribute("stroke-width", "2");
    line.setAttribute("stroke-dasharray", (curve.dash ?? []).join(" "));
    line.style.stroke = `var(${curve.colour})`;
    svg.append(line);
    return svg;
  }
}
