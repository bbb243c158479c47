// The one slider: the time of the whole page, with an outline of what happened when behind it.

class Timeline {
  /** `state` is the page's; sides have counts from the start, rows once they are read. */
  constructor(state) {
    this.state = state;
    this.slider = byId("slider");
    this.canvas = byId("outline");
    this.playing = false;
    this.draw = onceAFrame(() => this.drawNow());
    this.slider.max = String(state.until);
    // As it was is too slow or too fast to see anything.
    if (state.until > 300e9 || state.until < 2e9) byId("speed").value = "fit";
    this.slider.addEventListener("input", () => state.setTime(Number(this.slider.value)));
    // The page's keys step by what the chart shows, wherever the focus is.
    this.slider.addEventListener("keydown", (event) => {
      if (event.key.startsWith("Arrow")) event.preventDefault();
    });
    byId("play").addEventListener("click", () => this.toggle());
    byId("before").addEventListener("click", () => this.toEvent(-1));
    byId("after").addEventListener("click", () => this.toEvent(1));
    state.on("time", () => this.show());
    state.on("view", this.draw);
    state.on("look", this.draw);
    this.show();
    this.draw();
  }

  show() {
    const { state } = this;
    this.slider.value = String(state.time);
    const text = timeText(state.time, state.until);
    this.slider.setAttribute("aria-valuetext", text);
    byId("now").textContent = text;
  }

  toggle(on = !this.playing) {
    this.playing = on;
    byId("play").setAttribute("aria-pressed", String(on));
    byId("play").textContent = on ? "Pause" : "Play";
    if (!on) return;
    if (this.state.time >= this.state.until) this.state.setTime(0);
    let last = performance.now();
    const frame = (now) => {
      if (!this.playing) return;
      const chosen = byId("speed").value;
      const speed = chosen === "fit" ? this.state.until / 30e9 : Number(chosen);
      const time = this.state.time + (now - last) * 1e6 * speed;
      last = now;
      this.state.setTime(Math.min(time, this.state.until));
      if (this.state.time >= this.state.until) this.toggle(false);
      else requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  /** To the next event that the chart shows, before or after. */
  toEvent(direction) {
    this.toggle(false);
    const row = this.state.nextRow(this.state.time, direction, () => true);
    if (row >= 0) this.state.setTime(this.state.side.rows.at[row], true);
  }

  /** Where a time is: the middle of the slider's thumb. */
  x(time, width) {
    return 8 + (time / this.state.until) * (width - 16);
  }

  drawNow() {
    const { canvas, state } = this;
    const { width, height } = canvas.parentElement.getBoundingClientRect();
    const pen = fresh(canvas, width, height);
    // What the chart shows of it.
    const [from, until] = [this.x(state.from, width), this.x(state.to, width)];
    pen.fillStyle = colour("--rule");
    pen.fillRect(from, 0, Math.max(2, until - from), height);
    const sides = state.sides.length;
    state.sides.forEach((side, index) => {
      const [top, room] = [(index * height) / sides, height / sides - 2];
      this.outline(pen, side, width, top + 1, room);
    });
  }

  /** What arrived as bars that grow up, what was lost as bars that hang down: by the root of the counts. */
  outline(pen, side, width, top, height) {
    const { width_ns: binWidth, all } = side.told.bins;
    const most = all.reduce((most, bin) => Math.max(most, bin[0] + bin[1], bin[2]), 1);
    const base = top + height * 0.66;
    all.forEach(([arrived, lost, other], bin) => {
      const x = this.x(bin * binWidth, width);
      const w = Math.max(1, this.x((bin + 1) * binWidth, width) - x - (binWidth * width / this.state.until > 4 ? 1 : 0));
      const bar = (count, name, room, sign) => {
        if (!count) return;
        const h = Math.max(1.5, Math.sqrt(count / most) * room);
        pen.fillStyle = colour(name);
        pen.fillRect(x, sign > 0 ? base - h : base + 1, w, h);
      };
      if (!arrived) bar(other, "--soft", height * 0.3, 1);
      bar(arrived, "--s0", height * 0.64, 1);
      bar(lost, "--s1", height * 0.32, -1);
    });
  }
}
