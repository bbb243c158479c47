// The map of a log from above: what its messages in Foxglove's schemas draw, actors where they are at the time of the
// slider, and the messages that are under way then.

/** As many messages under way as are drawn. */
const UNDER_WAY = 400;
/** How long a loss is shown, as a share of what the chart shows, and of these how many. */
const AFTERGLOW = 1 / 200;
const LOST = 40;

/** Sums of differences. */
function sums(differences) {
  let sum = 0;
  return Float64Array.from(differences, (since) => (sum += since));
}

/** The last place of a sorted list that is not above a number; -1 if there is none. */
function lastUpTo(list, value, of = (one) => one) {
  let low = 0;
  let high = list.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (of(list[middle]) <= value) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

/** What is where, at any time. Places are in metres. */
class Scene {
  constructor(map) {
    this.frames = new Map();
    for (const { name, parent, thing, t, x, y, a } of map.frames) {
      this.frames.set(name, { parent, thing, t: sums(t), x: sums(x), y: sums(y), a: sums(a) });
    }
    this.shapes = map.shapes;
    this.entities = map.entities;
    this.known = new Map();
    this.byName = new Map();
    for (const entity of this.entities) {
      const name = entity.id.slice(entity.id.lastIndexOf("/") + 1);
      const before = this.byName.get(name);
      // What is on a layer of rovers or nodes before what they believe or want.
      if (!before || /^(rovers|nodes|masts|hosts)\//.test(entity.id)) this.byName.set(name, entity);
    }
    this.bounds = this.measured();
  }

  /** Where a frame is in the map: x, y and angle; none if it is nowhere yet. */
  frame(name, time, depth = 0) {
    const frame = this.frames.get(name);
    if (!frame) return depth === 0 && this.frames.size && name.includes("/") ? null : [0, 0, 0];
    const at = lastUpTo(frame.t, time / 1e3);
    if (at < 0) return null;
    const own = [frame.x[at] / 100, frame.y[at] / 100, frame.a[at] / 1000];
    if (depth > 16 || !this.frames.has(frame.parent)) return own;
    const parent = this.frame(frame.parent, time, depth + 1);
    return parent && within(parent, own);
  }

  /** The shapes of an entity at a time; none if it is not there. */
  shape(entity, time) {
    const at = lastUpTo(entity.v, time / 1e3, (version) => version[0]);
    const shape = at < 0 ? null : entity.v[at][1];
    return shape === null ? null : this.shapes[shape];
  }

  /** Where an actor is: its frame, or the first shape of its entity; that of its host, if it has none. */
  actor(name, time) {
    const found = this.known.get(name) ?? this.look(name);
    this.known.set(name, found);
    if (found.frame) return this.frame(found.frame, time);
    if (!found.entity) return null;
    const shape = this.shape(found.entity, time);
    const first = shape?.a.find((one) => one.s !== "lines");
    const frame = first && this.frame(shape.f, time);
    return frame ? within(frame, [first.p[0] / 100, first.p[1] / 100, 0]) : null;
  }

  look(name) {
    for (let host = name; host; host = host.includes("/") ? host.slice(0, host.lastIndexOf("/")) : "") {
      const frame = [`${host}/base_link`, host].find((frame) => this.frames.has(frame));
      if (frame) return { frame };
      const entity = this.byName.get(host);
      if (entity) return { entity };
    }
    return {};
  }

  measured() {
    const bounds = [Infinity, Infinity, -Infinity, -Infinity];
    const take = (x, y) => {
      bounds[0] = Math.min(bounds[0], x); bounds[1] = Math.min(bounds[1], y);
      bounds[2] = Math.max(bounds[2], x); bounds[3] = Math.max(bounds[3], y);
    };
    for (const frame of this.frames.values()) {
      if (this.frames.has(frame.parent)) continue;
      for (let at = 0; at < frame.t.length; at++) take(frame.x[at] / 100, frame.y[at] / 100);
    }
    for (const shape of this.shapes) {
      if (this.frames.has(shape.f)) continue;
      for (const one of shape.a) {
        const step = one.s === "lines" ? 2 : one.p.length;
        for (let at = 0; at + 1 < one.p.length; at += step) take(one.p[at] / 100, one.p[at + 1] / 100);
      }
    }
    return bounds[0] <= bounds[2] ? bounds : [-1, -1, 1, 1];
  }
}

/** A place in a frame that is itself somewhere. */
function within([x, y, angle], [dx, dy, turn]) {
  const [sin, cos] = [Math.sin(angle), Math.cos(angle)];
  return [x + cos * dx - sin * dy, y + sin * dx + cos * dy, angle + turn];
}

class MapView {
  constructor(state, index) {
    this.state = state;
    this.index = index;
    this.side = state.sides[index];
    this.canvas = byId(`map-${this.side.letter}`);
    this.scene = this.side.map && new Scene(this.side.map);
    this.scale = 1;
    this.centre = [0, 0];
    if (!this.scene) {
      this.canvas.hidden = true;
      const what = "This log has nothing to draw a map of: no messages in Foxglove's schemas that say where things "
        + "are (foxglove.SceneUpdate, foxglove.FrameTransforms), and no transforms, odometry or poses of ROS.";
      this.canvas.after(element("p", { class: "note" }, what));
      return;
    }
    this.draw = onceAFrame(() => this.drawNow());
    this.reset();
    this.listen();
    for (const event of ["time", "select", "look", "filter", "view"]) state.on(event, this.draw);
    this.draw();
  }

  reset() {
    const [x0, y0, x1, y1] = this.scene.bounds;
    this.centre = [(x0 + x1) / 2, (y0 + y1) / 2];
    this.zoom = 1;
  }

  listen() {
    const { canvas } = this;
    const pointers = new Map();
    let spread = 0;
    const distance = () => {
      const [a, b] = [...pointers.values()];
      return Math.hypot(a[0] - b[0], a[1] - b[1]);
    };
    canvas.addEventListener("pointerdown", (event) => {
      pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
      canvas.setPointerCapture(event.pointerId);
      if (pointers.size === 2) spread = distance();
    });
    canvas.addEventListener("pointermove", (event) => {
      const before = pointers.get(event.pointerId);
      if (!before) return;
      pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
      if (pointers.size === 2) {
        const now = distance();
        this.zoomBy(now / Math.max(1, spread));
        spread = now;
      } else if (this.zoom > 1 || event.pointerType === "mouse") {
        this.centre[0] -= (event.offsetX - before[0]) / this.scale;
        this.centre[1] += (event.offsetY - before[1]) / this.scale;
        this.draw();
      }
    });
    for (const end of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(end, (event) => pointers.delete(event.pointerId));
    }
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoomBy(Math.exp(-event.deltaY / 400));
    }, { passive: false });
    canvas.addEventListener("dblclick", () => {
      this.reset();
      this.draw();
    });
  }

  zoomBy(factor) {
    this.zoom = Math.max(0.5, Math.min(60, this.zoom * factor));
    this.draw();
  }

  drawNow() {
    const { canvas, scene, state } = this;
    const width = canvas.clientWidth;
    const height = canvas.clientHeight;
    const pen = fresh(canvas, width, height);
    const [x0, y0, x1, y1] = scene.bounds;
    const margin = 26;
    const fit = Math.min((width - 2 * margin) / Math.max(1e-3, x1 - x0), (height - 2 * margin) / Math.max(1e-3, y1 - y0));
    this.scale = fit * this.zoom;
    const time = Math.min(state.time, this.side.until);
    this.labels = [];
    for (const kinds of [["lines"], ["disc", "box"], ["text"]]) this.drawShapes(pen, time, kinds);
    this.drawThings(pen, time);
    const said = this.drawMessages(pen, time);
    this.drawSelected(pen, time);
    this.write(pen, width, height);
    this.drawScale(pen, width, height);
    const name = this.state.sides.length > 1 ? `Map of ${this.side.letter.toUpperCase()}` : "Map";
    canvas.setAttribute("aria-label", `${name} at ${timeText(time, state.until)}. ${said}`);
    if (this.index === 0) byId("map-said").textContent = said;
  }

  /** From metres to the canvas. */
  to([x, y]) {
    const { canvas, centre, scale } = this;
    return [canvas.clientWidth / 2 + (x - centre[0]) * scale, canvas.clientHeight / 2 - (y - centre[1]) * scale];
  }

  drawShapes(pen, time, kinds) {
    for (const entity of this.scene.entities) {
      const shape = this.scene.shape(entity, time);
      const frame = shape && this.scene.frame(shape.f, time);
      if (!frame) continue;
      for (const one of shape.a) if (kinds.includes(one.s)) this.drawShape(pen, one, frame, entity);
    }
  }

  drawShape(pen, one, frame, entity) {
    const place = (x, y) => this.to(within(frame, [x / 100, y / 100, 0]));
    if (one.s === "text") {
      this.labels.push([...place(one.p[0], one.p[1]), one.t]);
      return;
    }
    const [red, green, blue, opacity] = one.c;
    pen.fillStyle = pen.strokeStyle = `rgba(${red},${green},${blue},${Math.max(0.25, opacity / 100)})`;
    pen.beginPath();
    if (one.s === "lines") {
      pen.lineWidth = 1;
      const pairs = one.k === 2;
      for (let at = 0; at + 1 < one.p.length; at += 2) {
        const [x, y] = place(one.p[at], one.p[at + 1]);
        if (pairs ? at % 4 === 0 : at === 0) pen.moveTo(x, y);
        else pen.lineTo(x, y);
      }
      if (one.k === 1) pen.closePath();
      pen.stroke();
    } else if (one.s === "disc") {
      pen.arc(...place(one.p[0], one.p[1]), Math.max(2.2, (one.p[2] / 200) * this.scale), 0, 7);
      pen.fill();
      this.rim(pen);
    } else {
      const [x, y, turn, w, h] = one.p;
      const least = /believed/.test(entity.id) ? 0 : 9;
      const [halfX, halfY] = [w, h].map((size) => Math.max(least / 2, (size / 200) * this.scale));
      const [cx, cy] = place(x, y);
      const angle = frame[2] + turn / 1000;
      const [sin, cos] = [Math.sin(angle), Math.cos(angle)];
      const corner = (a, b) => [cx + cos * a * halfX - sin * b * halfY, cy - sin * a * halfX - cos * b * halfY];
      // Pointed in front.
      for (const [a, b] of [[-1, -1], [0.5, -1], [1.25, 0], [0.5, 1], [-1, 1]]) pen.lineTo(...corner(a, b));
      pen.closePath();
      pen.fill();
      this.rim(pen);
    }
  }

  rim(pen) {
    pen.lineWidth = 0.8;
    pen.strokeStyle = colour("--ink");
    pen.globalAlpha = 0.6;
    pen.stroke();
    pen.globalAlpha = 1;
  }

  /** Frames of which nothing is drawn but where they are, and all frames where there are no entities. */
  drawThings(pen, time) {
    for (const [name, frame] of this.scene.frames) {
      if (!frame.thing && this.scene.entities.length) continue;
      const at = this.scene.frame(name, time);
      if (!at) continue;
      const [x, y] = this.to(at);
      pen.fillStyle = colour("--s4");
      pen.beginPath();
      const corner = (turn, size) => [x + Math.cos(at[2] + turn) * size, y - Math.sin(at[2] + turn) * size];
      pen.moveTo(...corner(0, 9)); pen.lineTo(...corner(2.4, 7)); pen.lineTo(...corner(-2.4, 7));
      pen.closePath();
      pen.fill();
      this.rim(pen);
      this.labels.push([x, y - 10, name]);
    }
  }

  /** Messages under way as dots between sender and receiver, and what was lost just now as crosses. */
  drawMessages(pen, time) {
    const { rows, flows } = this.side;
    const passes = this.state.passes[this.index];
    let under = 0;
    let lost = 0;
    const glow = (this.state.to - this.state.from) * AFTERGLOW;
    const last = rowFrom(rows, time + rows.longest + 1);
    const crosses = [];
    for (let row = rowFrom(rows, time - glow); row < last; row++) {
      const flow = flows[rows.flow[row]];
      if (!passes[rows.flow[row]] || flow.sender === flow.receiver) continue;
      const isLost = flow.cls === "lost" && rows.at[row] <= time;
      const isUnderWay = rows.sent[row] <= time && rows.at[row] > time && ["delivered", "lost", "in_flight"].includes(flow.cls);
      if (!isLost && !isUnderWay) continue;
      if (isLost) {
        lost += 1;
        crosses.push(row);
        continue;
      }
      under += 1;
      if (under <= UNDER_WAY) this.drawMessage(pen, row, time);
    }
    for (const row of crosses.slice(-LOST)) this.drawMessage(pen, row, time);
    const hidden = under > UNDER_WAY || lost > LOST ? `; ${Math.min(under, UNDER_WAY)} and ${Math.min(lost, LOST)} of these are drawn` : "";
    return `${plural(under, "message")} under way, ${lost} lost just now${hidden}.`;
  }

  drawMessage(pen, row, time) {
    const { rows } = this.side;
    const flow = this.side.flow(row);
    const isLost = flow.cls === "lost" && rows.at[row] <= time;
    const [from, to] = [this.scene.actor(flow.sender, time), this.scene.actor(flow.receiver, time)];
    if (!from || !to) return;
    const [a, b] = [this.to(from), this.to(to)];
    const delay = Math.max(1, rows.at[row] - rows.sent[row]);
    const share = isLost ? 0.5 : Math.min(1, (time - rows.sent[row]) / delay);
    const at = [a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share];
    pen.strokeStyle = pen.fillStyle = colour(isLost ? "--s1" : "--s0");
    pen.lineWidth = 1;
    pen.globalAlpha = 0.35;
    pen.beginPath(); pen.moveTo(...a); pen.lineTo(...b); pen.stroke();
    pen.globalAlpha = 1;
    if (isLost) drawSign(pen, "lost", ...at);
    else { pen.beginPath(); pen.arc(...at, 2.6, 0, 7); pen.fill(); }
  }

  /** The ends of the message that is selected, and of what led to it. */
  drawSelected(pen, time) {
    const { selected } = this.state;
    if (!selected || selected.side !== this.index) return;
    const ring = (name, radius) => {
      const at = this.scene.actor(name, time);
      if (!at) return null;
      const [x, y] = this.to(at);
      pen.strokeStyle = colour("--ink");
      pen.lineWidth = 2;
      pen.beginPath(); pen.arc(x, y, radius, 0, 7); pen.stroke();
      const label = this.labels.findIndex(([, , text]) => text === name);
      // Names of what is selected come first.
      if (label >= 0) this.labels.unshift(...this.labels.splice(label, 1));
      else this.labels.unshift([x, y - 12, name]);
      return [x, y];
    };
    const flow = this.side.flow(selected.row);
    const [from, to] = [ring(flow.sender, 9), flow.receiver === flow.sender ? null : ring(flow.receiver, 9)];
    if (!from || !to) return;
    pen.setLineDash(flow.cls === "lost" ? [5, 4] : []);
    pen.strokeStyle = colour(classOf(flow.cls).colour);
    pen.lineWidth = 2.5;
    pen.beginPath(); pen.moveTo(...from); pen.lineTo(...to); pen.stroke();
    pen.setLineDash([]);
  }

  write(pen, width, height) {
    const room = new Room();
    pen.font = font(11);
    pen.fillStyle = colour("--ink");
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    room.take(0, height - 24, 130, 24);
    for (const [x, y, name] of this.labels) {
      const text = shortened(pen, name, 90);
      const w = pen.measureText(text).width;
      if (x < -20 || y < -20 || x > width + 20 || y > height + 20) continue;
      const left = Math.min(Math.max(2, x - w / 2), width - w - 2);
      if (room.take(left - 1, y - 16, w + 2, 13)) writeOver(pen, text, left + w / 2, y - 9);
    }
  }

  drawScale(pen, width, height) {
    const most = 100 / this.scale;
    const power = 10 ** Math.floor(Math.log10(most));
    const metres = [5, 2, 1].find((factor) => factor * power <= most) * power;
    const long = metres * this.scale;
    pen.strokeStyle = pen.fillStyle = colour("--soft");
    pen.lineWidth = 1.5;
    pen.beginPath();
    pen.moveTo(8, height - 12); pen.lineTo(8, height - 8); pen.lineTo(8 + long, height - 8); pen.lineTo(8 + long, height - 12);
    pen.stroke();
    pen.font = font(11);
    pen.textAlign = "left";
    pen.textBaseline = "bottom";
    pen.fillText(`${numberText(metres)} m`, 12, height - 12);
  }
}
