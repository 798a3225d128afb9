"use strict";
// Curves in SVG: drag a rectangle to zoom, or click and turn the wheel; double click to come back; hover or tap to read a point.
const COLOURS = ["#1f5fa8", "#d1662a", "#2e8b57", "#a8324a", "#6f55a5", "#8a6d1f", "#1b8a9a", "#5f6b7a", "#c2478f", "#4d7c0f"];
const DASHES = ["", "7 4", "2 3", "9 3 2 3"];
const ring = (n, turn, r = 5) => {
  const corner = (k) => { const a = turn + (2 * Math.PI * k) / n; return `${(r * Math.cos(a)).toFixed(2)} ${(r * Math.sin(a)).toFixed(2)}`; };
  return `M${Array.from({ length: n }, (_, k) => corner(k)).join("L")}Z`;
};
const STAR = `M${Array.from({ length: 10 }, (_, k) => { const r = k % 2 ? 2.4 : 5.8, a = -Math.PI / 2 + (Math.PI * k) / 5; return `${(r * Math.cos(a)).toFixed(2)} ${(r * Math.sin(a)).toFixed(2)}`; }).join("L")}Z`;
// colours come back after some curves and are not told apart by everybody, nor on paper: shapes and dashes tell curves too
const SHAPES = ["M4 0A4 4 0 1 1 -4 0A4 4 0 1 1 4 0Z", ring(4, Math.PI / 4), ring(3, -Math.PI / 2, 5.4), ring(4, 0, 5.4), ring(3, Math.PI / 2, 5.4), ring(6, 0, 4.8), STAR];

const svg = (tag, attributes = {}, ...children) => {
  const node = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.append(...children);
  return node;
};

class Chart {
  constructor(block) {
    this.block = block;
    this.off = new Set();
    this.style = this.styles();
    this.svg = svg("svg", { role: "img", tabindex: "0", "aria-label": `${said("chart")}: ${block.title || block.ytitle}` });
    this.legend = make("div", { class: "legend" });
    this.node = make("div", { class: "chart" }, this.svg, this.legend);
    gibiane.charts[block.id] = this;
    this.size(900);
    this.reset();
    this.listen();
    // in the next frame: drawing changes the height, which the observer would complain about
    new ResizeObserver(() => requestAnimationFrame(() => this.size(this.node.clientWidth) && this.draw())).observe(this.node);
  }
  // in pixels of the screen, so that letters keep their size on a phone
  size(width) {
    if (!width || width === this.width) return false;
    this.width = width;
    this.height = Math.round(Math.max(300, Math.min(0.5 * width, 480)));
    this.box = { left: width < 500 ? 58 : 74, right: width - 16, top: 14, bottom: this.height - 50 };
    this.svg.setAttribute("viewBox", `0 0 ${this.width} ${this.height}`);
    return true;
  }
  // colour, shape and dash of each curve: no two curves have all three in common
  styles() {
    const seen = new Map();
    return this.block.curves.map((curve, k) => {
      const color = curve.color || COLOURS[k % COLOURS.length], again = seen.get(color) ?? 0;
      seen.set(color, again + 1);
      const turn = k + again + Math.floor(k / SHAPES.length);
      return { color, shape: SHAPES[turn % SHAPES.length], hollow: again % 2 === 1, dash: curve.dash ? "6 4" : DASHES[again % DASHES.length] };
    });
  }
  mark(k, attributes) {
    const { color, shape, hollow } = this.style[k], own = theme.ink(color);
    return svg("path", { d: shape, fill: hollow ? theme.paper : own, stroke: hollow ? own : theme.paper, "stroke-width": hollow ? 1.8 : 1, ...attributes });
  }
  line(k, d) {
    const { color, dash } = this.style[k];
    return svg("path", { d, fill: "none", stroke: theme.ink(color), "stroke-width": 1.8, "stroke-linejoin": "round", ...(dash ? { "stroke-dasharray": dash } : {}) });
  }
  reset() {
    const seen = this.block.curves.filter((_, k) => !this.off.has(k));
    const ends = (name, log) => {
      const values = (seen.length ? seen : this.block.curves).flatMap((c) => c[name]).filter((v) => v !== null && (!log || v > 0));
      let low = Math.min(...values), high = Math.max(...values);
      if (log) return high > low ? [low / (high / low) ** 0.05, high * (high / low) ** 0.05] : [low / 2, high * 2];
      if (low === 0 && high === 0) return [0, 1];
      const spread = high - low || Math.abs(high);
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
    for (const [value, label] of x.ticks(46)) {
      const p = x.at(value);
      grid.append(svg("line", { x1: p, x2: p, y1: top, y2: bottom, class: label ? "" : "fine" }));
      if (label) marks.append(svg("text", { x: p, y: bottom + 17, "text-anchor": "middle" }, label));
    }
    for (const [value, label] of y.ticks(26)) {
      const p = y.at(value);
      grid.append(svg("line", { x1: left, x2: right, y1: p, y2: p, class: label ? "" : "fine" }));
      if (label) marks.append(svg("text", { x: left - 8, y: p + 4, "text-anchor": "end" }, label));
    }
    const curves = svg("g", { "clip-path": `url(#${clip})` });
    this.points = [];
    if (block.pareto) this.front(curves);
    block.curves.forEach((curve, k) => {
      if (this.off.has(k)) return;
      const shown = curve.x.map((v, i) => [v, curve.y[i], i]).filter(([a, b]) => a !== null && b !== null && (!block.xlog || a > 0) && (!block.ylog || b > 0));
      if (curve.line) curves.append(this.line(k, shown.map(([a, b], i) => `${i ? "L" : "M"}${x.at(a).toFixed(2)} ${y.at(b).toFixed(2)}`).join("")));
      for (const [a, b, i] of shown) {
        const point = { curve: k, index: i, px: x.at(a), py: y.at(b), x: a, y: b };
        if (shown.length <= 60) {
          point.mark = this.mark(k, { transform: `translate(${point.px.toFixed(2)} ${point.py.toFixed(2)})`, "data-curve": k, "data-point": i });
          curves.append(point.mark);
        }
        this.points.push(point);
      }
    });
    const titles = [
      svg("text", { x: (left + right) / 2, y: bottom + 38, "text-anchor": "middle" }, block.xtitle),
      svg("text", { x: 14, y: (top + bottom) / 2, "text-anchor": "middle", transform: `rotate(-90 14 ${(top + bottom) / 2})` }, block.ytitle),
    ];
    this.svg.replaceChildren(
      svg("defs", {}, svg("clipPath", { id: clip }, svg("rect", { x: left - 6, y: top - 6, width: right - left + 12, height: bottom - top + 12 }))),
      grid, marks, svg("path", { class: "frame", d: `M${left} ${top}V${bottom}H${right}` }), ...titles, curves);
    this.zone = this.svg.appendChild(svg("rect", { class: "zone", visibility: "hidden" }));
    this.drawLegend();
  }
  front(curves) {
    // between two points of the front nothing is proven: the line goes along the better of each, as a stair
    const corners = this.block.pareto.map(([k, i]) => [this.x.at(this.block.curves[k].x[i]), this.y.at(this.block.curves[k].y[i])]);
    if (!corners.length) return;
    const path = corners.map(([a, b], i) => (i ? `H${a.toFixed(2)}V${b.toFixed(2)}` : `M${a.toFixed(2)} ${b.toFixed(2)}`)).join("");
    curves.append(svg("path", { class: "pareto", d: path }));
  }
  drawLegend() {
    this.legend.replaceChildren(...this.block.curves.map((curve, k) => make("button", {
      type: "button", class: this.off.has(k) ? "entry off" : "entry", title: said("click: hide or show"), "aria-pressed": String(!this.off.has(k)), onclick: () => this.toggle(k),
    }, svg("svg", { width: 34, height: 14, viewBox: "-17 -7 34 14", "aria-hidden": "true" }, ...(curve.line ? [this.line(k, "M-17 0H17")] : []), this.mark(k, {})), curve.name)));
  }
  toggle(k) {
    this.off.has(k) ? this.off.delete(k) : this.off.add(k);
    this.reset();
    this.legend.children[k].focus();
  }
  // What is known of a point: its curve, its coordinates, the record that the script gave.
  record(k, i) {
    const curve = this.block.curves[k];
    const on = (this.block.pareto ?? []).some(([a, b]) => a === k && b === i);
    const lines = [curve.name, `${this.block.xtitle || "x"}: ${brief(curve.x[i], 6)}`, `${this.block.ytitle || "y"}: ${brief(curve.y[i], 6)}`];
    if (on) lines.push(said("on the Pareto front"));
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
  // the record of the nearest point, where one is near
  read(event) {
    const p = this.place(event);
    let best = null, far = (event.pointerType === "touch" ? 24 : 14) ** 2;
    for (const q of this.points) {
      const d = (q.px - p[0]) ** 2 + (q.py - p[1]) ** 2;
      if (d < far) [best, far] = [q, d];
    }
    this.svg.querySelectorAll("path.on").forEach((c) => c.classList.remove("on"));
    if (!best) return tip.hide();
    best.mark?.classList.add("on");
    tip.show(this.record(best.curve, best.index), event.clientX, event.clientY);
  }
  listen() {
    let from = null;
    const inside = ([a, b]) => a >= this.box.left - 3 && a <= this.box.right + 3 && b >= this.box.top - 3 && b <= this.box.bottom + 3;
    this.svg.addEventListener("pointerdown", (event) => {
      const p = this.place(event);
      if (event.pointerType === "touch") return this.read(event); // a finger scrolls the page
      if (!inside(p) || event.button !== 0) return;
      from = p;
      this.svg.setPointerCapture(event.pointerId);
    });
    this.svg.addEventListener("pointermove", (event) => {
      if (!from) return event.pointerType === "touch" ? undefined : this.read(event);
      const p = this.place(event), [a, b] = [Math.min(from[0], p[0]), Math.min(from[1], p[1])];
      const attributes = { x: a, y: b, width: Math.abs(p[0] - from[0]), height: Math.abs(p[1] - from[1]), visibility: "visible" };
      for (const [name, value] of Object.entries(attributes)) this.zone.setAttribute(name, value);
      tip.hide();
    });
    const release = (event) => {
      if (!from) return;
      const p = this.place(event), start = from;
      from = null;
      this.zone.setAttribute("visibility", "hidden");
      if (event.type === "pointercancel" || Math.abs(p[0] - start[0]) < 8 || Math.abs(p[1] - start[1]) < 8) return;
      const [x0, x1] = [start[0], p[0]].sort((a, b) => a - b), [y0, y1] = [start[1], p[1]].sort((a, b) => b - a);
      this.zoom(this.x.back(x0), this.x.back(x1), this.y.back(y0), this.y.back(y1));
    };
    this.svg.addEventListener("pointerup", release);
    this.svg.addEventListener("pointercancel", release);
    this.svg.addEventListener("pointerleave", (event) => event.pointerType !== "touch" && tip.hide());
    this.svg.addEventListener("dblclick", () => this.reset());
    this.svg.addEventListener("wheel", (event) => {
      const p = this.place(event);
      // only a chart that was clicked: else a reader who scrolls down a page would zoom each chart on the way
      if (!inside(p) || !(event.ctrlKey || document.activeElement === this.svg)) return;
      event.preventDefault();
      const f = event.deltaY > 0 ? 1.2 : 1 / 1.2, { left, right, top, bottom } = this.box;
      this.zoom(this.x.back(p[0] + (left - p[0]) * f), this.x.back(p[0] + (right - p[0]) * f), this.y.back(p[1] + (bottom - p[1]) * f), this.y.back(p[1] + (top - p[1]) * f));
    }, { passive: false });
  }
}
