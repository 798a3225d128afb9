"use strict";
// A mesh with its fields: drag to turn, click and turn the wheel to zoom, right button or shift to move; the pointer reads values.
const TURBO = ["#4143a7", "#4669e0", "#458cfd", "#31aff5", "#1ccdd8", "#1ce6b4", "#3ff68a", "#75fe5c", "#a4fc3c", "#c6f034", "#e5d938", "#f9bc39", "#fe992c", "#f8721c", "#e84b0c", "#d02f05", "#af1801"];
const shade = (t) => {
  const s = t * (TURBO.length - 1), k = Math.min(Math.floor(s), TURBO.length - 2), [a, b] = [rgb(TURBO[k]), rgb(TURBO[k + 1])];
  return `#${a.map((v, i) => Math.round(255 * (v + (s - k) * (b[i] - v))).toString(16).padStart(2, "0")).join("")}`;
};

class Camera {
  constructor(radius, flat) {
    Object.assign(this, { radius, flat, shift: [0, 0], width: 1, height: 1, closeness: 1 });
    this.home();
  }
  home() {
    this.shift = [0, 0];
    this.closeness = 1;
    this.flat ? this.turn(-90, 90) : this.turn(-60.26, 26.39);
  }
  // yaw and pitch of the eye, in degrees
  turn(yaw, pitch) {
    this.yaw = yaw;
    this.pitch = Math.max(-90, Math.min(90, pitch));
    const a = (this.yaw * Math.PI) / 180, b = (this.pitch * Math.PI) / 180;
    this.axes = [
      [-Math.sin(a), Math.cos(a), 0],
      [-Math.sin(b) * Math.cos(a), -Math.sin(b) * Math.sin(a), Math.cos(b)],
      [Math.cos(b) * Math.cos(a), Math.cos(b) * Math.sin(a), Math.sin(b)],
    ];
  }
  get zoom() {
    return ((0.46 * Math.min(this.width, this.height)) / this.radius) * this.closeness;
  }
  // pixels from the upper left, and depth towards the eye
  see(x, y, z) {
    const [r, u, t] = this.axes;
    return [
      this.width / 2 + this.shift[0] + this.zoom * (r[0] * x + r[1] * y + r[2] * z),
      this.height / 2 - this.shift[1] - this.zoom * (u[0] * x + u[1] * y + u[2] * z),
      t[0] * x + t[1] * y + t[2] * z,
    ];
  }
}

class View {
  constructor(block) {
    this.block = block;
    this.points = decoded(block.points);
    this.nodes = decoded(block.nodes);
    this.triangles = decoded(block.triangles);
    this.owner = decoded(block.owner);
    this.elements = decoded(block.elements);
    this.edges = decoded(block.edges);
    this.lines = decoded(block.lines);
    this.moved = block.moved ? decoded(block.moved) : null;
    this.fields = block.fields.map((field) => ({ ...field, values: decoded(field.values) }));
    this.arrows = block.arrows.map((each) => ({ ...each, points: decoded(each.points), vectors: decoded(each.vectors), moved: each.moved && decoded(each.moved) }));
    this.factor = this.moved ? block.factor : 0;
    this.withEdges = true;
    this.glassy = false;
    this.shown = 0;
    this.measure();
    this.camera = new Camera(this.radius, block.flat);
    this.build();
    gibiane.views[block.id] = this;
    requestAnimationFrame(() => this.resize());
    new ResizeObserver(() => this.resize()).observe(this.stage);
  }
  measure() {
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    for (let i = 0; i < this.points.length; i++) {
      const p = this.points[i] + (this.moved ? this.factor * this.moved[i] : 0);
      low[i % 3] = Math.min(low[i % 3], p);
      high[i % 3] = Math.max(high[i % 3], p);
    }
    this.centre = low.map((v, k) => 0.5 * (v + high[k]));
    this.radius = 0.5 * Math.hypot(...low.map((v, k) => high[k] - v)) || 1;
  }
  // corners of facets one after the other, about the centre of the scene: single precision is enough then
  spread(indices, source, centred) {
    const out = new Float32Array(3 * indices.length);
    for (let i = 0; i < indices.length; i++)
      for (let k = 0; k < 3; k++) out[3 * i + k] = source[3 * indices[i] + k] - (centred ? this.centre[k] : 0);
    return out;
  }
  build() {
    const block = this.block;
    const canvas = () => make("canvas");
    this.bar = make("div", { class: "bar" });
    this.stage = make("div", { class: "stage", tabindex: "0" }, canvas());
    const plain = () => {
      this.stage.firstChild.replaceWith(canvas()); // a canvas keeps its first kind of context
      this.canvas = this.stage.firstChild;
      this.painter = new PlainPainter(this.canvas);
      this.drawnBy = "canvas";
    };
    this.canvas = this.stage.firstChild;
    try {
      this.painter = new GlPainter(this.canvas);
      this.drawnBy = "webgl2";
      // a browser takes contexts away from the oldest of many views
      this.canvas.addEventListener("webglcontextlost", () => {
        plain();
        this.painter.load(this.parts);
        this.show(this.shown);
        this.resize();
      });
    } catch (reason) {
      plain();
    }
    this.over = make("canvas", { class: "over" });
    this.stage.append(this.over, this.bar);
    if (this.arrows.length)
      this.stage.append(make("div", { class: "names" }, ...this.arrows.map((each) => make("span", { style: `--c:${each.color}` }, each.label))));
    const moved = (indices) => (this.moved ? this.spread(indices, this.moved, false) : null);
    const parts = [];
    let at = 0;
    for (const body of block.bodies) {
      const own = this.triangles.subarray(3 * at, 3 * (at + body.count));
      parts.push({ position: this.spread(own, this.points, true), moved: moved(own), color: body.color, banded: true, from: at, count: body.count });
      at += body.count;
    }
    this.surfaces = parts.length;
    parts.push({ position: this.spread(this.edges, this.points, true), moved: moved(this.edges), lines: true, edge: true, color: "#171c24", opacity: 0.55 });
    parts.push({ position: this.spread(this.lines, this.points, true), moved: moved(this.lines), lines: true, color: "#20324a" });
    for (const each of this.arrows) parts.push({ ...this.arrowSolids(each), arrows: true, color: each.color });
    this.parts = parts.filter((part) => part.position.length);
    this.painter.load(this.parts);
    this.node = make("div", { class: "frame" }, this.tools(), this.stage);
    this.show(0);
    this.listen();
  }
  tools() {
    const button = (text, title, action) => make("button", { type: "button", title, onclick: () => { action(); this.draw(); } }, text);
    const bar = make("div", { class: "tools" });
    if (this.fields.length > 1)
      bar.append(make("select", { title: said("field"), onchange: (event) => this.show(Number(event.target.value)) }, ...this.fields.map((f, k) => make("option", { value: k }, f.name))));
    bar.append(
      button(said("fit"), said("the whole object"), () => this.camera.home()),
      button("x", said("seen along x"), () => this.camera.turn(0, 0)),
      button("y", said("seen along -y"), () => this.camera.turn(-90, 0)),
      button("z", said("seen from above"), () => this.camera.turn(-90, 90)),
      button("-z", said("seen from below"), () => this.camera.turn(-90, -90)),
      make("label", {}, make("input", { type: "checkbox", checked: "", onchange: (event) => { this.withEdges = event.target.checked; this.draw(); } }), said("edges")),
      make("label", {}, make("input", { type: "checkbox", onchange: (event) => { this.glassy = event.target.checked; this.draw(); } }), said("see through")));
    if (this.moved) {
      const label = make("span", {}, `${said("displacements")} × ${brief(this.factor)}`);
      const slider = make("input", { type: "range", min: 0, max: 2, step: 0.05, value: 1, "aria-label": said("amplification") });
      slider.addEventListener("input", () => {
        this.factor = this.block.factor * Number(slider.value);
        label.textContent = `${said("displacements")} × ${brief(this.factor)}`;
        this.draw();
      });
      bar.append(make("label", {}, slider, label));
    }
    bar.append(make("span", {}, said("drag: turn · click, then wheel: zoom · right button: move · pointer: values")));
    return bar;
  }
  // a field by its number: new colours and a new legend
  show(k) {
    this.shown = k;
    const field = this.fields[k];
    this.bar.hidden = !field;
    if (!field) return this.painter.colours([]);
    const finite = field.values.filter(Number.isFinite);
    let low = finite.reduce((a, b) => Math.min(a, b), Infinity), high = finite.reduce((a, b) => Math.max(a, b), -Infinity);
    if (!finite.length) [low, high] = [0, 1];
    const ends = [low, high], size = Math.max(Math.abs(low), Math.abs(high));
    let limits;
    if (high - low <= 1e-9 * size || size === 0) limits = [low - (0.5 * size || 0.5), high + (0.5 * size || 0.5)];
    else {
      const raw = steps(low, high, 12), step = raw.length > 1 ? raw[1] - raw[0] : high - low;
      const first = Math.floor(low / step + 1e-9), last = Math.ceil(high / step - 1e-9);
      limits = Array.from({ length: last - first + 1 }, (_, i) => Number(((first + i) * step).toPrecision(12)));
    }
    this.limits = limits;
    const n = limits.length - 1, colours = Array.from({ length: n }, (_, i) => shade(n > 1 ? i / (n - 1) : 0.5));
    const span = limits[n] - limits[0];
    const unit = (v) => (Number.isFinite(v) ? (v - limits[0]) / span : -1e4);
    let s = 0;
    for (const part of this.parts) {
      if (!part.banded) continue;
      const out = new Float32Array(3 * part.count);
      for (let i = 0; i < out.length; i++) {
        const t = part.from + Math.floor(i / 3);
        out[i] = unit(field.values[field.where === "node" ? this.triangles[3 * t + (i % 3)] : this.owner[t]]);
      }
      this.painter.values(this.parts.indexOf(part), out);
      s++;
    }
    this.painter.colours(s ? colours : []);
    const tall = Math.min(18, 300 / n), cells = make("div", { class: "cells" });
    colours.toReversed().forEach((c) => cells.append(make("i", { style: `background:${c};height:${tall}px` })));
    const every = Math.ceil((n + 1) / 16);
    limits.forEach((v, i) => { if (i % every === 0) cells.append(make("span", { style: `top:${(n - i) * tall}px` }, brief(v, 6))); });
    this.bar.replaceChildren(make("b", {}, field.title), cells, make("div", { class: "ends" }, `max  ${brief(ends[1])}\nmin  ${brief(ends[0])}`));
    this.draw();
  }
  resize() {
    const box = this.stage.getBoundingClientRect(), ratio = Math.min(devicePixelRatio || 1, 2);
    if (!box.width) return;
    Object.assign(this.camera, { width: box.width, height: box.height });
    for (const canvas of [this.canvas, this.over]) [canvas.width, canvas.height] = [Math.round(box.width * ratio), Math.round(box.height * ratio)];
    this.draw();
  }
  draw() {
    if (this.camera.width <= 1) return;
    this.seen = null;
    this.painter.draw(this.camera, this.factor, this.withEdges, this.glassy);
    this.triad();
  }
  // printers see what WebGL drew only through a plain canvas
  forPaper() {
    this.resize();
    const pen = this.over.getContext("2d");
    pen.setTransform(1, 0, 0, 1, 0, 0);
    pen.globalCompositeOperation = "destination-over";
    pen.drawImage(this.canvas, 0, 0);
    pen.globalCompositeOperation = "source-over";
  }
  triad() {
    const pen = this.over.getContext("2d"), ratio = this.over.width / this.camera.width;
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, this.camera.width, this.camera.height);
    const origin = [46, this.camera.height - 46];
    pen.font = "12px sans-serif";
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    pen.lineWidth = 1.6;
    for (const k of [0, 1, 2].sort((a, b) => this.camera.axes[2][a] - this.camera.axes[2][b])) {
      const [a, b] = [this.camera.axes[0][k] * 28, -this.camera.axes[1][k] * 28];
      pen.strokeStyle = pen.fillStyle = ["#c0392b", "#2e8b57", "#2f5fb3"][k];
      if (Math.hypot(a, b) < 4) continue; // an axis that points at the eye
      pen.beginPath();
      pen.moveTo(...origin);
      pen.lineTo(origin[0] + a, origin[1] + b);
      pen.stroke();
      pen.fillText("xyz"[k], origin[0] + 1.32 * a, origin[1] + 1.32 * b);
    }
  }
  // arrows as solids, so that they turn and hide like the rest
  arrowSolids(each) {
    const out = [], moved = [], sides = 8;
    for (let i = 0; i < each.points.length; i += 3) {
      const base = [0, 1, 2].map((k) => each.points[i + k] - this.centre[k]);
      const v = [0, 1, 2].map((k) => each.scale * each.vectors[i + k]), size = Math.hypot(...v);
      if (!(size > 0)) continue;
      const d = v.map((c) => c / size), other = Math.abs(d[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0];
      const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
      let e = cross(d, other);
      const n = Math.hypot(...e);
      e = e.map((c) => c / n);
      const f = cross(d, e), thick = Math.min(0.008 * this.radius, 0.06 * size), head = Math.min(0.06 * this.radius, 0.4 * size);
      const ring = (along, r, k) => [0, 1, 2].map((c) => base[c] + along * d[c] + r * (Math.cos((2 * Math.PI * k) / sides) * e[c] + Math.sin((2 * Math.PI * k) / sides) * f[c]));
      const tipPoint = base.map((c, k) => c + v[k]);
      for (let k = 0; k < sides; k++) {
        const [a, b] = [ring(0, thick, k), ring(0, thick, k + 1)], [p, q] = [ring(size - head, thick, k), ring(size - head, thick, k + 1)];
        const [s, t] = [ring(size - head, 2.6 * thick, k), ring(size - head, 2.6 * thick, k + 1)];
        for (const corner of [a, b, q, a, q, p, s, t, tipPoint, s, base.map((c, m) => c + (size - head) * d[m]), t]) out.push(...corner);
      }
      if (each.moved) for (let k = 0; k < 12 * sides; k++) moved.push(...each.moved.subarray(i, i + 3));
    }
    return { position: new Float32Array(out), moved: each.moved ? new Float32Array(moved) : null };
  }
  // ---- reading values, also from the console: gibiane.views["name"].atNode(12, "UX")
  field(name) {
    return name === undefined ? this.fields[this.shown] : this.fields.find((f) => f.name === name);
  }
  atNode(number, name) {
    const i = this.nodes.indexOf(number), field = this.field(name);
    return i < 0 || !field || field.where !== "node" ? null : field.values[i];
  }
  atElement(number, name) {
    const i = this.elements.indexOf(number), field = this.field(name);
    return i < 0 || !field || field.where !== "element" ? null : field.values[i];
  }
  screen() {
    if (this.seen) return this.seen;
    const out = (this.seen = new Float64Array(this.points.length)), c = this.centre, p = this.points, u = this.moved, f = this.factor;
    for (let i = 0; i < p.length; i += 3) {
      const s = this.camera.see(p[i] - c[0] + (u ? f * u[i] : 0), p[i + 1] - c[1] + (u ? f * u[i + 1] : 0), p[i + 2] - c[2] + (u ? f * u[i + 2] : 0));
      [out[i], out[i + 1], out[i + 2]] = s;
    }
    return out;
  }
  // what is seen at a pixel of the stage: element, nearest corner, value of the field shown
  pick(px, py) {
    const s = this.screen(), tri = this.triangles;
    let best = null;
    for (let t = 0; t < tri.length / 3; t++) {
      const [a, b, c] = [3 * tri[3 * t], 3 * tri[3 * t + 1], 3 * tri[3 * t + 2]];
      const area = (s[b] - s[a]) * (s[c + 1] - s[a + 1]) - (s[c] - s[a]) * (s[b + 1] - s[a + 1]);
      if (!area) continue;
      const w1 = ((px - s[a]) * (s[c + 1] - s[a + 1]) - (s[c] - s[a]) * (py - s[a + 1])) / area;
      const w2 = ((s[b] - s[a]) * (py - s[a + 1]) - (px - s[a]) * (s[b + 1] - s[a + 1])) / area;
      const w0 = 1 - w1 - w2;
      if (w0 < -1e-9 || w1 < -1e-9 || w2 < -1e-9) continue;
      const depth = w0 * s[a + 2] + w1 * s[b + 2] + w2 * s[c + 2];
      if (!best || depth > best.depth) best = { depth, t, w: [w0, w1, w2] };
    }
    if (!best) return null;
    const corners = [0, 1, 2].map((k) => tri[3 * best.t + k]), near = corners[best.w.indexOf(Math.max(...best.w))];
    const field = this.fields[this.shown];
    const result = { element: this.elements[this.owner[best.t]], node: this.nodes[near], position: [...this.points.subarray(3 * near, 3 * near + 3)] };
    if (field) {
      result.field = field.name;
      result.value = field.where === "node" ? best.w.reduce((sum, w, k) => sum + w * field.values[corners[k]], 0) : field.values[this.owner[best.t]];
      if (field.where === "node") result.atNode = field.values[near];
    }
    return result;
  }
  arrowNear(px, py) {
    for (const each of this.arrows)
      for (let i = 0; i < each.points.length; i += 3) {
        const [a, b, c] = [0, 1, 2].map((k) => each.points[i + k] - this.centre[k] + each.scale * each.vectors[i + k] + (each.moved ? this.factor * each.moved[i + k] : 0));
        const s = this.camera.see(a, b, c);
        if (Math.hypot(s[0] - px, s[1] - py) < 7) return { label: each.label, vector: [...each.vectors.subarray(i, i + 3)] };
      }
    return null;
  }
  report(px, py) {
    const arrow = this.arrowNear(px, py), found = this.pick(px, py), lines = [];
    if (arrow) lines.push(`${arrow.label}: (${arrow.vector.map((v) => brief(v)).join("  ")}), ${said("length")} ${brief(Math.hypot(...arrow.vector))}`);
    if (found) {
      lines.push(`${said("element")} ${found.element} · ${said("nearest corner: node")} ${found.node} (${found.position.map((v) => brief(v, 5)).join("  ")})`);
      if (found.field !== undefined) lines.push(`${found.field} = ${brief(found.value, 6)}${found.atNode === undefined ? ` ${said("in the element")}` : ` ${said("here")}, ${brief(found.atNode, 6)} ${said("at the node")}`}`);
    }
    return lines.join("\n");
  }
  listen() {
    let held = null;
    const stage = this.stage;
    stage.addEventListener("contextmenu", (event) => event.preventDefault());
    stage.addEventListener("pointerdown", (event) => {
      held = { x: event.clientX, y: event.clientY, move: event.button !== 0 || event.shiftKey };
      stage.setPointerCapture(event.pointerId);
      tip.hide();
    });
    stage.addEventListener("pointerup", () => (held = null));
    stage.addEventListener("pointercancel", () => (held = null));
    stage.addEventListener("pointermove", (event) => {
      if (held) {
        const [a, b] = [event.clientX - held.x, event.clientY - held.y];
        [held.x, held.y] = [event.clientX, event.clientY];
        if (held.move) this.camera.shift = [this.camera.shift[0] + a, this.camera.shift[1] - b];
        else this.camera.turn(this.camera.yaw - 0.4 * a, this.camera.pitch + 0.4 * b);
        return this.draw();
      }
      const box = stage.getBoundingClientRect(), text = this.report(event.clientX - box.left, event.clientY - box.top);
      text ? tip.show(text, event.clientX, event.clientY) : tip.hide();
    });
    stage.addEventListener("pointerleave", () => tip.hide());
    stage.addEventListener("wheel", (event) => {
      if (!(event.ctrlKey || document.activeElement === stage)) return; // a reader who scrolls down the page
      event.preventDefault();
      const box = stage.getBoundingClientRect(), f = event.deltaY > 0 ? 1 / 1.15 : 1.15;
      const at = [event.clientX - box.left - box.width / 2, box.height / 2 - (event.clientY - box.top)];
      this.camera.closeness *= f;
      this.camera.shift = this.camera.shift.map((s, k) => at[k] + f * (s - at[k])); // what is under the pointer stays there
      this.draw();
    }, { passive: false });
    stage.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: [-8, 0], ArrowRight: [8, 0], ArrowUp: [0, 8], ArrowDown: [0, -8] }[event.key];
      if (!step) return;
      event.preventDefault();
      this.camera.turn(this.camera.yaw + step[0], this.camera.pitch + step[1]);
      this.draw();
    });
  }
}
