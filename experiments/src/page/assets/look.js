// What all parts draw with: colours of the style sheet, canvases as sharp as the screen, texts that do not overlap,
// times and numbers in words. Whatever a log says becomes text of an element or of a canvas, never markup.

/** How classes of rows are shown: colour, sign and name. Each has a shape of its own beside its colour. */
const CLASSES = {
  delivered: { colour: "--s0", sign: "→", name: "delivered" },
  message: { colour: "--s0", sign: "•", name: "message" },
  lost: { colour: "--s1", sign: "×", name: "lost" },
  in_flight: { colour: "--s4", sign: "○", name: "in flight at the end" },
  hand_over: { colour: "--s5", sign: "◇", name: "at a shared link" },
  timer: { colour: "--soft", sign: "|", name: "timer" },
  start: { colour: "--soft", sign: "▷", name: "start" },
  crash: { colour: "--bad", sign: "▼", name: "crash" },
  restart: { colour: "--good", sign: "▲", name: "restart" },
  change: { colour: "--s3", sign: "◆", name: "change of a link" },
  stop: { colour: "--ink", sign: "■", name: "stop" },
  told: { colour: "--s2", sign: "●", name: "told" },
};
const classOf = (name) => CLASSES[name] ?? CLASSES.message;

/** How curves are dashed, so that none needs its colour. */
const DASHES = [[], [7, 3], [2, 3], [9, 3, 2, 3], [12, 4], [5, 2, 1, 2], [1, 2]];

let styles = null;
/** A colour of the style sheet. */
function colour(name) {
  styles ??= getComputedStyle(document.documentElement);
  return styles.getPropertyValue(name).trim() || "#888";
}
/** Called when light and dark, or screen and paper, change. */
function forgetColours() {
  styles = null;
}

const FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', sans-serif";
const font = (size, weight = 400) => `${weight} ${size}px ${FONT}`;

/** An element with text and attributes. */
function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (value !== null) made.setAttribute(name, value);
  }
  made.append(...children.filter((child) => child !== null));
  return made;
}

const byId = (id) => document.getElementById(id);

/** A canvas of this size in pixels of the style sheet, cleared; all that is drawn is in these. */
function fresh(canvas, width, height) {
  const ratio = Math.min(3, Math.max(1, window.devicePixelRatio || 1));
  const [w, h] = [Math.max(1, Math.round(width * ratio)), Math.max(1, Math.round(height * ratio))];
  if (canvas.width !== w || canvas.height !== h) {
    canvas.width = w;
    canvas.height = h;
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  return pen;
}

/** Places that are taken by texts. */
class Room {
  constructor() {
    this.taken = [];
  }

  /** Takes a place if it is free. */
  take(x, y, width, height) {
    const free = this.taken.every((r) => x > r[2] || x + width < r[0] || y > r[3] || y + height < r[1]);
    if (free) this.taken.push([x, y, x + width, y + height]);
    return free;
  }
}

/** Writes with a rim of paper, so that it can be read over lines. */
function writeOver(pen, text, x, y) {
  pen.save();
  pen.lineWidth = 3;
  pen.lineJoin = "round";
  pen.strokeStyle = colour("--paper");
  pen.strokeText(text, x, y);
  pen.restore();
  pen.fillText(text, x, y);
}

/** A text as long as there is room, its middle left out: ends of names tell them apart. */
function shortened(pen, text, width) {
  if (pen.measureText(text).width <= width) return text;
  let low = 1;
  let high = text.length;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    const part = `${text.slice(0, Math.ceil(middle / 2))}…${text.slice(text.length - Math.floor(middle / 2))}`;
    if (pen.measureText(part).width <= width) low = middle;
    else high = middle - 1;
  }
  return `${text.slice(0, Math.ceil(low / 2))}…${text.slice(text.length - Math.floor(low / 2))}`;
}

/** The sign of a class, drawn about a point. */
function drawSign(pen, cls, x, y, size = 4) {
  pen.beginPath();
  switch (cls) {
    case "lost":
      pen.lineWidth = 2;
      pen.moveTo(x - size, y - size); pen.lineTo(x + size, y + size);
      pen.moveTo(x + size, y - size); pen.lineTo(x - size, y + size);
      pen.stroke();
      return;
    case "timer":
      pen.lineWidth = 1.5;
      pen.moveTo(x, y - size); pen.lineTo(x, y + size);
      pen.stroke();
      return;
    case "in_flight":
      pen.lineWidth = 1.5;
      pen.arc(x, y, size, 0, 7);
      pen.stroke();
      return;
    case "hand_over": case "change":
      pen.moveTo(x, y - size - 1); pen.lineTo(x + size + 1, y); pen.lineTo(x, y + size + 1); pen.lineTo(x - size - 1, y);
      pen.closePath();
      if (cls === "change") pen.fill(); else { pen.lineWidth = 1.2; pen.stroke(); }
      return;
    case "crash":
      pen.moveTo(x - size - 1, y - size); pen.lineTo(x + size + 1, y - size); pen.lineTo(x, y + size + 1);
      break;
    case "restart":
      pen.moveTo(x - size - 1, y + size); pen.lineTo(x + size + 1, y + size); pen.lineTo(x, y - size - 1);
      break;
    case "start":
      pen.moveTo(x - size, y - size); pen.lineTo(x + size, y); pen.lineTo(x - size, y + size);
      break;
    case "stop":
      pen.rect(x - size, y - size, 2 * size, 2 * size);
      break;
    default:
      pen.arc(x, y, Math.max(2, size - 1), 0, 7);
  }
  pen.fill();
}

const plural = (count, word) => `${count.toLocaleString("en")} ${word}${count === 1 ? "" : "s"}`;

/** The unit in which times of a span of so many nanoseconds are told. */
function unitOf(span) {
  for (const [name, ns] of [["s", 1e9], ["ms", 1e6], ["µs", 1e3]]) if (span >= ns / 50) return [name, ns];
  return ["ns", 1];
}

/** When the page begins, in nanoseconds since the run's start: times count from there, and are told as of the run. */
let begins = 0;

function beginAt(ns) {
  begins = ns;
}

/** A time with about three digits more than the span that is looked at. */
function timeText(sinceBegin, span) {
  const ns = sinceBegin + begins;
  const [name, unit] = unitOf(span);
  const digits = Math.max(0, Math.min(9, Math.round(Math.log10(unit)), 4 - Math.ceil(Math.log10(span / unit))));
  if (name === "s" && span >= 7200e9) {
    const s = ns / 1e9;
    const two = (part) => String(Math.floor(part)).padStart(2, "0");
    return `${Math.floor(s / 3600)}:${two((s / 60) % 60)}:${two(s % 60)}.${Math.floor((s % 1) * 10)}`;
  }
  return `${(ns / unit).toFixed(digits)} ${name}`;
}

/** A time to the nanosecond, without zeros at its end. */
function exactTime(sinceBegin) {
  const ns = sinceBegin + begins;
  const whole = Math.floor(ns / 1e9);
  const rest = String(Math.round(ns - whole * 1e9)).padStart(9, "0").replace(/0+$/, "");
  return `${whole}${rest ? `.${rest}` : ""} s`;
}

function durationText(ns) {
  if (ns === 0) return "no time";
  const [name, unit] = unitOf(ns * 2);
  return `${Number((ns / unit).toPrecision(4))} ${name}`;
}

function numberText(value) {
  const size = Math.abs(value);
  for (const [unit, sign] of [[1e12, "T"], [1e9, "G"], [1e6, "M"]]) {
    if (size >= unit && size < unit * 1e6) return `${Number((value / unit).toPrecision(4)).toLocaleString("en")} ${sign}`;
  }
  if (size >= 1e6 || (size > 0 && size < 1e-3)) return String(Number(value.toExponential(2))).replace("e+", "e");
  return Number(value.toPrecision(4)).toLocaleString("en", { maximumFractionDigits: 6 });
}

/** Round numbers between two, about so many. */
function ticks(from, until, about) {
  const rough = (until - from) / Math.max(1, about);
  if (!(rough > 0)) return [];
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((one) => one >= rough * 0.999);
  const all = [];
  for (let at = Math.ceil(from / step); at * step <= until + step * 1e-9; at++) all.push(at * step);
  return all;
}

/** Ticks of times, with their texts: whole units of the span. */
function timeTicks(from, until, about) {
  const span = until - from;
  const [name, unit] = span >= 20 * 86400e9 ? ["d", 86400e9] : span >= 7200e9 ? ["h", 3600e9] : unitOf(span);
  const all = ticks((from + begins) / unit, (until + begins) / unit, about);
  const step = all.length > 1 ? all[1] - all[0] : 1;
  const digits = Math.max(0, Math.min(9, -Math.floor(Math.log10(step) + 1e-9)));
  return all.map((at) => ({ at: at * unit - begins, text: `${at.toFixed(digits)} ${name}` }));
}

/** All that draws, for when there is no next frame: on paper. */
const drawings = [];

/** Calls once at the next frame, however often it is asked before. */
function onceAFrame(draw) {
  let asked = false;
  drawings.push(draw);
  return () => {
    if (asked) return;
    asked = true;
    requestAnimationFrame(() => {
      asked = false;
      draw();
    });
  };
}
