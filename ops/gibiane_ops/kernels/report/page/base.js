"use strict";
// The report: tabs, texts, tables, pictures; charts and views are in files of their own.
// For tests and for the curious, everything is reachable from the console as `gibiane`.
const gibiane = { views: {}, charts: {}, errors: [], data: null };
window.addEventListener("error", (event) => gibiane.errors.push(String(event.message)));

const make = (tag, attributes = {}, ...children) => {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name === "class") node.className = value;
    else if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else node.setAttribute(name, value);
  }
  node.append(...children);
  return node;
};

// Arrays travel as base64 of their bytes: exactly the numbers that were computed.
const KINDS = { f8: Float64Array, f4: Float32Array, i4: Int32Array };
const decoded = (packed) => {
  const text = atob(packed.data);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return new KINDS[packed.kind](bytes.buffer);
};

const brief = (value, digits = 4) => {
  if (value === null || Number.isNaN(value)) return "–";
  if (!Number.isFinite(value)) return String(value);
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e5 || size < 1e-2) return Number(value.toPrecision(digits)).toExponential().replace("e+", "e");
  return String(Number(value.toPrecision(digits)));
};

const tip = {
  node: null,
  show(text, x, y) {
    this.node ??= document.body.appendChild(make("div", { class: "tip" }));
    this.node.textContent = text;
    this.node.hidden = false;
    const box = this.node.getBoundingClientRect();
    this.node.style.left = `${Math.max(4, Math.min(x + 14, innerWidth - box.width - 6))}px`;
    this.node.style.top = `${y + 18 + box.height > innerHeight ? y - box.height - 10 : y + 18}px`;
  },
  hide() {
    if (this.node) this.node.hidden = true;
  },
};

const VERDICTS = { OK: "good", VRAI: "good", STANDS: "good", FAIL: "bad", FAILED: "bad", ECHEC: "bad", FAUX: "bad" };

const BLOCKS = {
  text: (block) => make("p", {}, block.text),
  picture: (block) => make("img", { src: block.source, alt: block.title || block.caption || "" }),
  chart: (block) => new Chart(block).node,
  view: (block) => new View(block).node,
  table(block) {
    const numeric = block.head.map((_, j) => block.rows.every((row) => typeof row[j] !== "string"));
    const cell = (value, j) => {
      if (typeof value !== "string") return make("td", { class: "number", title: String(value) }, brief(value, 5));
      const kind = VERDICTS[value.trim().toUpperCase()];
      return make("td", numeric[j] ? { class: "number" } : {}, kind ? make("span", { class: kind }, value) : value);
    };
    const body = make("tbody");
    const fill = (rows) => body.replaceChildren(...rows.map((row) => make("tr", {}, ...row.map(cell))));
    fill(block.rows);
    const heads = block.head.map((name, j) =>
      make("th", {
        ...(numeric[j] ? { class: "number" } : {}), title: "sort",
        onclick: () => {
          const turn = heads[j].dataset.order === "1" ? -1 : 1;
          heads.forEach((head) => delete head.dataset.order);
          heads[j].dataset.order = turn;
          const compare = (a, b) => (typeof a === "string" || typeof b === "string" ? String(a).localeCompare(String(b)) : a - b);
          fill([...block.rows].sort((a, b) => turn * compare(a[j], b[j])));
        },
      }, name));
    return make("div", { class: "scroll" }, make("table", {}, make("thead", {}, make("tr", {}, ...heads)), body));
  },
};

const start = () => {
  const data = JSON.parse(document.getElementById("data").textContent);
  gibiane.data = data;
  const nav = document.querySelector("nav");
  const main = document.querySelector("main");
  const built = new Set();
  const open = (k) => {
    [...nav.children].forEach((button, i) => button.setAttribute("aria-selected", String(i === k)));
    [...main.children].forEach((section, i) => (section.hidden = i !== k));
    tip.hide();
    if (built.has(k)) return;
    built.add(k); // a page is built when it is first opened: a view needs its size
    for (const block of data.pages[k].blocks) {
      const parts = [];
      if (block.title) parts.push(make("h3", {}, block.title));
      const holder = make("div", { class: "block" }, ...parts);
      main.children[k].append(holder);
      holder.append(BLOCKS[block.kind](block));
      if (block.caption) holder.append(make("p", { class: "caption" }, block.caption));
    }
  };
  data.pages.forEach((page, k) => {
    nav.append(make("button", { role: "tab", "aria-selected": "false", onclick: () => { open(k); history.replaceState(null, "", `#${k + 1}`); } }, page.title));
    main.append(make("section", { role: "tabpanel" }, make("h2", {}, page.title)));
    main.children[k].hidden = true;
  });
  nav.addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    const k = [...nav.children].indexOf(document.activeElement);
    if (step && k >= 0) nav.children[(k + step + nav.children.length) % nav.children.length].focus();
  });
  gibiane.open = open;
  const wanted = Number(location.hash.slice(1)) - 1;
  open(data.pages[wanted] ? wanted : 0);
};
window.addEventListener("DOMContentLoaded", start);
