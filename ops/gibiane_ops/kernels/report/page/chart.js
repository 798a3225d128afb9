"use strict";
// Curves in SVG: drag a rectangle or turn the wheel to zoom, double click to come back, hover to read a point.
const COLOURS = ["#1f5fa8", "#d1662a", "#2e8b57", "#a8324a", "#6f55a5", "#8a6d1f", "#1b8a9a", "#5f6b7a"];
const svg = (tag, attributes = {}, ...children) => {
  const node = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.append(...children);
  return node;
};

class Axis {
  constructor(log, low, high, from, to) {
    Object.assign(this, { log, from, to });
    this.low = log ? Math.log10(low) : low;
    this.high = log ? Math.log10(high) : high;
  }
  at(value) {
    const t = ((this.log ? Math.log10(value) : value) - this.low) / (this.high - this.low);
    return this.from + t * (this.to - this.from);
  }
  back(pixel) {
    const t = this.low + ((pixel - this.from) / (this.to - this.from)) * (this.high - this.low);
    return this.log ? 10 ** t : t;
  }
  ticks() {
    const span = this.high - this.low;
    if (!this.log || span < 0.35) return steps(this.log ? 10 ** this.low : this.low, this.log ? 10 ** this.high : this.high, 7).map((v) => [v, true]);
    const found = [];
    for (let e = Math.floor(this.low); e <= Math.ceil(this.high); e++)
      for (const m of [1, 2, 3, 4, 5, 6, 7, 8, 9]) {
        const t = e + Math.log10(m);
        if (t < this.low - 1e-9 || t > this.high + 1e-9) continue;
        found.push([Number(`${m}e${e}`), m === 1 ? span <= 8 || e % 2 === 0 : span <= 3 && (m === 2 || m === 5)]);
      }
    return found;
  }
}

const steps = (low, high, count) => {
  const raw = (high - low) / count || 1;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 2.5, 5, 10].map((m) => m * power).find((s) => s >= raw * 0.999) ?? 10 * power;
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(Number((k * step).toPrecision(12)));
  return found;
};

class Chart {
  constructor(block) {
    this.block = block;
    this.off = new Set();
    this.width = 900;
    const rows = Math.ceil(block.curves.length / 4);
    this.box = { left: 78, right: 880, top: 16, bottom: 420 };
    this.height = this.box.bottom + 52 + (block.curves.length ? 22 * rows + 4 : 0);
    this.svg = svg("svg", { viewBox: `0 0 ${this.width} ${this.height}`, role: "img" });
    this.node = make("div", { class: "chart" }, this.svg);
    gibiane.charts[block.id] = this;
    this.reset();
    this.listen();
  }
  reset() {
    const seen = this.block.curves.filter((_, k) => !this.off.has(k));
    const ends = (name, log) => {
      const values = (seen.length ? seen : this.block.curves).flatMap((c) => c[name]).filter((v) => v !== null && (!log || v > 0));
      let low = Math.min(...values), high = Math.max(...values);
      if (log) return high > low ? [low / (high / low) ** 0.05, high * (high / low) ** 0.05] : [low / 2, high * 2];
      const spread = high - low || Math.abs(high) || 1;
      return [low - 0.05 * spread, high + 0.05 * spread];
    };
    this.range = { x: this.block.xbounds ?? ends("x", this.block.xlog), y: this.block.ybounds ?? ends("y", this.block.ylog) };
    this.draw();
  }
  draw() {
    const { left, right, top, bottom } = this.box, block = this.block;
    const x = (this.x = new Axis(block.xlog, ...this.range.x, left, right));
    const y = (this.y = new Axis(block.ylog, ...this.range.y, bottom, top));
    const clip = `clip-${block.id}`;
    const grid = svg("g", { class: "grid" }), marks = svg("g", { class: "ticks" });
    for (const [value, main] of x.ticks()) {
      const p = x.at(value);
      grid.append(svg("line", { x1: p, x2: p, y1: top, y2: bottom, class: main ? "" : "fine" }));
      if (main) marks.append(svg("text", { x: p, y: bottom + 17, "text-anchor": "middle" }, brief(value, 6)));
    }
    for (const [value, main] of y.ticks()) {
      const p = y.at(value);
      grid.append(svg("line", { x1: left, x2: right, y1: p, y2: p, class: main ? "" : "fine" }));
      if (main) marks.append(svg("text", { x: left - 8, y: p + 4, "text-anchor": "end" }, brief(value, 6)));
    }
    const curves = svg("g", { "clip-path": `url(#${clip})` });
    this.points = [];
    if (block.pareto) this.front(curves);
    block.curves.forEach((curve, k) => {
      if (this.off.has(k)) return;
      const color = this.colour(k);
      const shown = curve.x.map((v, i) => [v, curve.y[i], i]).filter(([a, b]) => a !== null && b !== null && (!block.xlog || a > 0) && (!block.ylog || b > 0));
      const path = shown.map(([a, b], i) => `${i ? "L" : "M"}${x.at(a).toFixed(2)} ${y.at(b).toFixed(2)}`).join("");
      if (curve.line) curves.append(svg("path", { d: path, fill: "none", stroke: color, "stroke-width": 1.8, "stroke-linejoin": "round", ...(curve.dash ? { "stroke-dasharray": "6 4" } : {}) }));
      for (const [a, b, i] of shown) {
        const point = { curve: k, index: i, px: x.at(a), py: y.at(b), x: a, y: b };
        if (shown.length <= 60) {
          point.circle = svg("circle", { cx: point.px.toFixed(2), cy: point.py.toFixed(2), r: 4, fill: color, stroke: "#fff", "data-curve": k, "data-point": i });
          curves.append(point.circle);
        }
        this.points.push(point);
      }
    });
    const frame = svg("path", { d: `M${left} ${top}V${bottom}H${right}`, fill: "none", stroke: "#5f6b7a" });
    const titles = [
      svg("text", { x: (left + right) / 2, y: bottom + 38, "text-anchor": "middle" }, block.xtitle),
      svg("text", { x: 16, y: (top + bottom) / 2, "text-anchor": "middle", transform: `rotate(-90 16 ${(top + bottom) / 2})` }, block.ytitle),
    ];
    this.svg.replaceChildren(
      svg("defs", {}, svg("clipPath", { id: clip }, svg("rect", { x: left, y: top - 6, width: right - left + 6, height: bottom - top + 6 }))),
      grid, marks, frame, ...titles, curves, this.legend());
    this.zone = this.svg.appendChild(svg("rect", { class: "zone", visibility: "hidden" }));
  }
  colour(k) {
    return this.block.curves[k].color || COLOURS[k % COLOURS.length];
  }
  front(curves) {
    // between two points of the front nothing is proven: the line goes along the better of each, as a stair
    const corners = this.block.pareto.map(([k, i]) => [this.x.at(this.block.curves[k].x[i]), this.y.at(this.block.curves[k].y[i])]);
    if (!corners.length) return;
    const path = corners.map(([a, b], i) => (i ? `H${a.toFixed(2)}V${b.toFixed(2)}` : `M${a.toFixed(2)} ${b.toFixed(2)}`)).join("");
    curves.append(svg("path", { class: "pareto", d: path }));
  }
  legend() {
    const group = svg("g", { class: "legend" });
    this.block.curves.forEach((curve, k) => {
      const a = this.box.left + (k % 4) * 205, b = this.box.bottom + 62 + 22 * Math.floor(k / 4);
      const name = curve.name.length > 27 ? `${curve.name.slice(0, 26)}…` : curve.name;
      const entry = svg("g", { class: this.off.has(k) ? "entry off" : "entry" },
        svg("title", {}, `${curve.name} – click to hide or show`),
        svg("rect", { x: a - 2, y: b - 14, width: 200, height: 20, fill: "transparent" }),
        svg("line", { x1: a, x2: a + 18, y1: b - 4, y2: b - 4, stroke: this.colour(k), "stroke-width": 2, ...(curve.dash ? { "stroke-dasharray": "6 4" } : {}) }),
        svg("circle", { cx: a + 9, cy: b - 4, r: 3.5, fill: this.colour(k) }),
        svg("text", { x: a + 24, y: b }, name));
      entry.addEventListener("click", () => this.toggle(k));
      group.append(entry);
    });
    return group;
  }
  toggle(k) {
    this.off.has(k) ? this.off.delete(k) : this.off.add(k);
    this.reset();
  }
  // What is known of a point: its curve, its coordinates, the record that the script gave.
  record(k, i) {
    const curve = this.block.curves[k];
    const on = (this.block.pareto ?? []).some(([a, b]) => a === k && b === i);
    const lines = [curve.name, `${this.block.xtitle || "x"}: ${brief(curve.x[i], 6)}`, `${this.block.ytitle || "y"}: ${brief(curve.y[i], 6)}`];
    if (on) lines.push("on the Pareto front");
    for (const [name, value] of curve.notes[i] ?? []) lines.push(name ? `${name}: ${value}` : value);
    return lines.join("\n");
  }
  place(event) {
    const box = this.svg.getBoundingClientRect();
    return [((event.clientX - box.left) / box.width) * this.width, ((event.clientY - box.top) / box.height) * this.height];
  }
  zoom(x0, x1, y0, y1) {
    this.range = { x: [x0, x1], y: [y0, y1] };
    this.draw();
  }
  listen() {
    let from = null;
    const inside = ([a, b]) => a >= this.box.left - 3 && a <= this.box.right + 3 && b >= this.box.top - 3 && b <= this.box.bottom + 3;
    this.svg.addEventListener("pointerdown", (event) => {
      const p = this.place(event);
      if (!inside(p) || event.button !== 0) return;
      from = p;
      this.svg.setPointerCapture(event.pointerId);
    });
    this.svg.addEventListener("pointermove", (event) => {
      const p = this.place(event);
      if (from) {
        const [a, b] = [Math.min(from[0], p[0]), Math.min(from[1], p[1])];
        const attributes = { x: a, y: b, width: Math.abs(p[0] - from[0]), height: Math.abs(p[1] - from[1]), visibility: "visible" };
        for (const [name, value] of Object.entries(attributes)) this.zone.setAttribute(name, value);
        return tip.hide();
      }
      let best = null, far = 14 ** 2;
      for (const q of this.points) {
        const d = (q.px - p[0]) ** 2 + (q.py - p[1]) ** 2;
        if (d < far) [best, far] = [q, d];
      }
      this.svg.querySelectorAll("circle.on").forEach((c) => c.classList.remove("on"));
      if (!best) return tip.hide();
      best.circle?.classList.add("on");
      tip.show(this.record(best.curve, best.index), event.clientX, event.clientY);
    });
    const release = (event) => {
      if (!from) return;
      const p = this.place(event), start = from;
      from = null;
      this.zone.setAttribute("visibility", "hidden");
      if (Math.abs(p[0] - start[0]) < 8 || Math.abs(p[1] - start[1]) < 8) return;
      const [x0, x1] = [start[0], p[0]].sort((a, b) => a - b), [y0, y1] = [start[1], p[1]].sort((a, b) => b - a);
      this.zoom(this.x.back(x0), this.x.back(x1), this.y.back(y0), this.y.back(y1));
    };
    this.svg.addEventListener("pointerup", release);
    this.svg.addEventListener("pointerleave", () => tip.hide());
    this.svg.addEventListener("dblclick", () => this.reset());
    this.svg.addEventListener("wheel", (event) => {
      const p = this.place(event);
      if (!inside(p)) return;
      event.preventDefault();
      const f = event.deltaY > 0 ? 1.2 : 1 / 1.2, { left, right, top, bottom } = this.box;
      this.zoom(this.x.back(p[0] + (left - p[0]) * f), this.x.back(p[0] + (right - p[0]) * f), this.y.back(p[1] + (bottom - p[1]) * f), this.y.back(p[1] + (top - p[1]) * f));
    }, { passive: false });
  }
}
