"use strict";
// Axes of charts: places of values, and ticks that are round numbers, at least three where there is room for them.
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
  // [value, label or ""] with labels at least `gap` pixels apart
  ticks(gap) {
    const room = Math.max(3, Math.floor(Math.abs(this.to - this.from) / gap));
    if (!this.log) return labelled(steps(this.low, this.high, room));
    const inside = (mantissas) => {
      const found = [];
      for (let e = Math.floor(this.low); e <= Math.ceil(this.high); e++)
        for (const m of mantissas) {
          const t = e + Math.log10(m);
          if (t >= this.low - 1e-9 && t <= this.high + 1e-9) found.push(Number(`${m}e${e}`));
        }
      return found;
    };
    const apart = (list) => list.every((v, i) => !i || Math.abs(this.at(v) - this.at(list[i - 1])) >= gap);
    const whole = inside([1]), all = inside([1, 2, 3, 4, 5, 6, 7, 8, 9]);
    let shown = [whole, inside([1, 2, 5]), inside([1, 3]), inside([1, 2, 3, 5]), inside([1, 2, 3, 4, 6, 8]), all].find((list, i) => list.length > (i ? 2 : 3) && apart(list));
    if (!shown && whole.length > 3) shown = whole.filter((_, i) => i % Math.ceil(whole.length / room) === 0);
    if (!shown) {
      // less than a factor of three: the logarithm is nearly straight, round steps are read best
      const list = steps(10 ** this.low, 10 ** this.high, Math.min(room, 6));
      shown = apart(list) ? list : list.filter((_, i) => i % 2 === 0);
      return labelled(shown);
    }
    const fine = whole.length > 5 ? whole : all;
    return [...shown.map((v) => [v, brief(v, 6)]), ...fine.filter((v) => !shown.includes(v)).map((v) => [v, ""])];
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

// as many decimals for all: 2.5 5.0 7.5
const labelled = (values) => {
  const texts = values.map((v) => brief(v, 6));
  if (texts.some((t) => t.includes("e"))) return values.map((v, i) => [v, texts[i]]);
  const decimals = Math.max(0, ...texts.map((t) => (t.split(".")[1] ?? "").length));
  return values.map((v) => [v, v.toFixed(decimals)]);
};
