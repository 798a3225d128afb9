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

// buttons and hints in the language of the report
const said = (text) => gibiane.data.words[text] ?? text;

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

// Colours of the screen: dark where the reader's system is, light on paper.
const theme = {
  dark: matchMedia("(prefers-color-scheme: dark)").matches,
  get paper() {
    return this.dark ? "#15191f" : "#ffffff";
  },
  // a colour that is seen on this paper: dark ones are made lighter on dark paper
  ink(hex) {
    const parts = [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16));
    const light = 0.3 * parts[0] + 0.59 * parts[1] + 0.11 * parts[2], wanted = 135;
    if (!this.dark || light >= wanted) return hex;
    const t = (wanted - light) / (255 - light);
    return `#${parts.map((v) => Math.round(v + t * (255 - v)).toString(16).padStart(2, "0")).join("")}`;
  },
  set(dark) {
    this.dark = dark;
    for (const each of [...Object.values(gibiane.charts), ...Object.values(gibiane.views)]) each.draw();
  },
};
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", (event) => theme.set(event.matches));

// How the numbers of a column are written: with as many decimals for all, four digits of the largest.
const columnStyle = (values) => {
  const sizes = values.filter((v) => typeof v === "number" && v !== 0).map(Math.abs);
  const high = Math.max(...sizes, 0), low = Math.min(...sizes, Infinity);
  if (sizes.every(Number.isInteger) && high < 1e9) return String;
  const middle = sizes.toSorted((a, b) => a - b)[sizes.length >> 1];
  if (high >= 1e6 || high / middle > 1e3 || (high < 0.1 && high / low > 100)) return (v) => brief(v, 3);
  const wanted = Math.max(0, 3 - Math.floor(Math.log10(high)));
  const used = Math.max(...sizes.map((v) => (String(Number(v.toPrecision(10))).split(".")[1] ?? "").length));
  const decimals = Math.min(wanted, used);
  return (v) => (v !== 0 && Math.abs(v) < 0.995 * 10 ** -decimals ? brief(v, 2) : v.toFixed(decimals));
};
const NUMBER = /^[+-]?\d*\.?\d+(?:e[+-]?\d+)?$/i;
// the value of a cell for sorting: words that spell a number (its digits were chosen by the script) are numbers
const worth = (cell) => (typeof cell === "string" ? (NUMBER.test(cell.trim()) ? Number(cell) : NaN) : (cell ?? NaN));

const VERDICTS = { OK: "good", VRAI: "good", STANDS: "good", FAIL: "bad", FAILED: "bad", ECHEC: "bad", "ÉCHEC": "bad", FAUX: "bad" };

const BLOCKS = {
  text: (block) => make("p", {}, block.text),
  picture: (block) => make("img", { src: block.source, alt: block.title || block.caption || "" }),
  chart: (block) => new Chart(block).node,
  view: (block) => new View(block).node,
  table(block) {
    const columns = block.head.map((_, j) => block.rows.map((row) => row[j]));
    const numeric = columns.map((cells) => {
      const filled = cells.filter((c) => c !== "" && c !== null);
      return 2 * filled.filter((c) => Number.isFinite(worth(c))).length >= filled.length && filled.length > 0;
    });
    const styles = columns.map(columnStyle);
    const cell = (value, j) => {
      if (value === null) return make("td", { class: "number" }, "–");
      if (typeof value !== "string") return make("td", { class: "number", title: String(value) }, styles[j](value));
      const kind = VERDICTS[value.trim().toUpperCase()];
      const style = numeric[j] ? "number" : value.length < 56 ? "short" : "";
      return make("td", style ? { class: style } : {}, kind ? make("span", { class: kind }, value) : value.trim());
    };
    const body = make("tbody");
    const fill = (rows) => body.replaceChildren(...rows.map((row) => make("tr", {}, ...row.map(cell))));
    fill(block.rows);
    const compare = (a, b) => {
      const [p, q] = [worth(a), worth(b)];
      if (Number.isNaN(p) && Number.isNaN(q)) return String(a ?? "").localeCompare(String(b ?? ""));
      return Number.isNaN(p) ? 1 : Number.isNaN(q) ? -1 : p - q;
    };
    const sort = (j) => {
      const turn = heads[j].dataset.order === "1" ? -1 : 1;
      heads.forEach((head) => delete head.dataset.order);
      heads[j].dataset.order = turn;
      fill([...block.rows].sort((a, b) => turn * compare(a[j], b[j])));
    };
    const heads = block.head.map((name, j) => make("th", {
      ...(numeric[j] ? { class: "number" } : {}), title: said("sort"), tabindex: "0", onclick: () => sort(j), onkeydown: (event) => event.key === "Enter" && sort(j),
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
    nav.scrollLeft = nav.children[k].offsetLeft - nav.offsetLeft - 40; // a phone has the tabs in one row
    tip.hide();
    build(k);
  };
  // a page is built when it is first opened: a view needs its size
  const build = (k) => {
    if (built.has(k)) return;
    built.add(k);
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
  // on paper every page is there, light
  let before = null;
  window.addEventListener("beforeprint", () => {
    before ??= { dark: theme.dark, hidden: [...main.children].map((section) => section.hidden) };
    [...main.children].forEach((section, k) => {
      section.hidden = false;
      build(k);
    });
    theme.set(false);
    Object.values(gibiane.views).forEach((view) => view.forPaper());
  });
  window.addEventListener("afterprint", () => {
    if (!before) return;
    [...main.children].forEach((section, k) => (section.hidden = before.hidden[k]));
    theme.set(before.dark);
    before = null;
  });
  const wanted = Number(location.hash.slice(1)) - 1;
  open(data.pages[wanted] ? wanted : 0);
};
window.addEventListener("DOMContentLoaded", start);
