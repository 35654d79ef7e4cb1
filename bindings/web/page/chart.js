// Line charts as SVG: what a reader sees is what is saved. A line has x and y, a class for its colour, and a name.

const SVG = "http://www.w3.org/2000/svg";
function svg(name, attributes = {}, ...children) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.append(...children);
  return element;
}
// Round steps of an axis, four to seven of them.
function ticks(from, to, most) {
  const raw = (to - from) / most, size = 10 ** Math.floor(Math.log10(raw));
  const step = size * [1, 2, 5, 10].find(times => times * size >= raw);
  const all = [];
  for (let k = Math.ceil(from / step - 1e-9); k * step <= to + 1e-9 * step; k++) all.push(k * step);
  return { all, digits: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
}

class Chart {
  #host; #given = null; #cursor; #place;
  constructor(host) {
    this.#host = host;
    new ResizeObserver(() => { if (this.#given) this.set(this.#given); }).observe(host);
  }

  get given() { return this.#given; }

  // { title, unit, lines, bands, marks, spans, x: [from, to], least: half height, handle: { x, from, to, name, moved } }
  set(given) {
    this.#given = given;
    const width = Math.max(240, this.#host.clientWidth), height = Math.max(110, this.#host.clientHeight);
    const small = width < 420, [x_0, x_1] = given.x;
    const names = given.lines.filter(line => line.name);
    // The legend, in as many rows as it takes.
    const rows = [[]], letter = innerWidth >= 1700 ? 7.8 : 6.6;
    let used = 0;
    for (const line of names) {
      const needs = 30 + letter * line.name.length;
      if (used + needs > width - 20 && used) { rows.push([]); used = 0; }
      rows.at(-1).push({ line, at: used });
      used += needs;
    }
    const top = 22 + 16 * (names.length ? rows.length : 0) + (given.marks?.length ? 15 : 0), left = 44, right = 8, bottom = 32;
    const inX = given.lines.map(line => this.#within(line, x_0, x_1));
    let most = given.least ?? 0.1, least = -most;
    for (const { points } of inX) for (const [, y] of points) { if (y > most) most = y; if (y < least) least = y; }
    if (given.y) [least, most] = given.y;
    else { const room = 0.05 * (most - least); most += room; least -= room; }
    const X = x => left + (x - x_0) / (x_1 - x_0) * (width - left - right);
    const Y = y => top + (most - y) / (most - least) * (height - top - bottom);
    this.#place = { X, x_0, x_1, left, right, width, top, foot: height - bottom };
    const root = svg("svg", { viewBox: `0 0 ${width} ${height}`, width, height, role: given.handle ? "group" : "img", class: "chart", "aria-label": this.#words() });
    root.append(svg("text", { x: 4, y: 14, class: "title" }, `${given.title} (${given.unit})`));
    const xs = ticks(x_0, x_1, small ? 4 : 8), ys = ticks(least, most, Math.max(4, Math.min(6, (height - top - bottom) / 28)));
    for (const y of ys.all) {
      root.append(svg("line", { x1: left, x2: width - right, y1: Y(y), y2: Y(y), class: Math.abs(y) < 1e-9 ? "zero" : "grid" }));
      root.append(svg("text", { x: left - 5, y: Y(y) + 4, class: "tick end" }, y.toFixed(ys.digits)));
    }
    for (const x of xs.all) {
      root.append(svg("line", { x1: X(x), x2: X(x), y1: height - bottom, y2: height - bottom + 4, class: "zero" }));
      root.append(svg("text", { x: X(x), y: height - bottom + 15, class: X(x) > width - 20 ? "tick end" : "tick mid" }, x.toFixed(xs.digits)));
    }
    root.append(svg("text", { x: width - right, y: height - 3, class: "tick end" }, given.xName ?? t("axis_time")));
    const inside = (x, y = 0) => [Math.min(width - right, Math.max(left, X(x))), Math.min(height - bottom, Math.max(top, y))];
    for (const span of given.spans ?? []) {
      const [from] = inside(span.from), [to] = inside(span.to);
      if (to > from) root.append(svg("rect", { x: from, width: to - from, y: top, height: height - top - bottom, class: `span ${span.kind}` }));
    }
    for (const band of given.bands ?? []) {
      const shape = side => this.#within({ x: band.x, y: band[side] }, x_0, x_1).points.map(([x, y]) => inside(x, Y(y)).map(v => v.toFixed(1)).join());
      root.append(svg("polygon", { points: [...shape("high"), ...shape("low").reverse()].join(" "), class: `band ${band.kind}` }));
    }
    inX.forEach(({ points }, i) => {
      const line = given.lines[i];
      root.append(svg("polyline", { points: points.map(([x, y]) => `${X(x).toFixed(1)},${inside(0, Y(y))[1].toFixed(1)}`).join(" "), class: `line ${line.kind}` }));
    });
    rows.forEach((row, k) => row.forEach(({ line, at }) => {
      const y = 26 + 16 * k;
      root.append(svg("line", { x1: 6 + at, x2: 24 + at, y1: y, y2: y, class: `line ${line.kind}` }),
        svg("text", { x: 28 + at, y: y + 4, class: "legend" }, line.name));
    }));
    this.#marks(root, given.marks ?? [], X, top, height - bottom, width);
    this.#cursor = svg("line", { y1: top, y2: height - bottom, class: "cursor", visibility: "hidden" });
    root.append(this.#cursor);
    if (given.handle) root.append(this.#handle(given.handle));
    const hadFocus = this.#host.contains(document.activeElement);
    this.#host.replaceChildren(root);
    if (hadFocus) root.querySelector("[tabindex]")?.focus();
  }

  // Instants, named in a row above them as far as there is room; the words of the picture name them all.
  #marks(root, marks, X, top, foot, width) {
    const row = svg("text", { x: 6, y: top - 6, class: "note" }), { x_0, x_1 } = this.#place;
    let free = (width - 12) / (innerWidth >= 1700 ? 7.4 : 6);
    for (const { x, name, kind } of [...marks].sort((a, b) => a.x - b.x)) {
      if (x < x_0 || x > x_1) continue;
      root.append(svg("line", { x1: X(x), x2: X(x), y1: top - 3, y2: foot, class: `mark ${kind}` }));
      const words = `${row.childElementCount ? " · " : ""}${name} ${x.toFixed(1)} s`;
      free -= words.length;
      if (free >= 0) row.append(svg("tspan", { class: kind }, words));
    }
    root.append(row);
  }

  // An instant that can be dragged, and moved with the arrow keys.
  #handle({ x, from, to, name, moved, step = 0.5 }) {
    const { X, x_0, x_1, left, right, width, top, foot } = this.#place;
    const knob = svg("g", { class: "handle", tabindex: 0, role: "slider", "aria-label": name, "aria-valuemin": from, "aria-valuemax": to,
      "aria-valuenow": x, "aria-valuetext": `${x.toFixed(1)} s` },
    svg("rect", { x: X(x) - 16, y: top - 4, width: 32, height: foot - top + 8, class: "grip" }),
    svg("line", { x1: X(x), x2: X(x), y1: top, y2: foot, class: "mark failure" }),
    svg("path", { d: `M${X(x) - 9},${foot} h18 l-9,-14 z`, class: "knob" }));
    const to_ = value => moved(Math.min(to, Math.max(from, step * Math.round(value / step))));
    knob.addEventListener("keydown", event => {
      const by = { ArrowLeft: -step, ArrowRight: step, PageDown: -5, PageUp: 5, Home: from - x, End: to - x }[event.key];
      if (by !== undefined) { event.preventDefault(); to_(x + by); }
    });
    knob.addEventListener("pointerdown", event => {
      event.preventDefault();
      const box = this.#host.getBoundingClientRect();
      const move = event => to_(x_0 + (event.clientX - box.left - left) / (width - left - right) * (x_1 - x_0));
      const end = () => { removeEventListener("pointermove", move); removeEventListener("pointerup", end); removeEventListener("pointercancel", end); };
      addEventListener("pointermove", move); addEventListener("pointerup", end); addEventListener("pointercancel", end);
    });
    return knob;
  }

  // The points of a line within the axis: of each pixel the least and the largest.
  #within({ x, y }, from, to) {
    const points = [], columns = 500, width = (to - from) / columns;
    let column = null, low, high;
    const flush = () => { if (column !== null) points.push(...(low[0] <= high[0] ? [low, high] : [high, low]).slice(0, low === high ? 1 : 2)); };
    for (let i = 0; i < x.length; i++) {
      if (x[i] < from || x[i] > to || Number.isNaN(y[i])) continue;
      const at = Math.floor((x[i] - from) / width), point = [x[i], y[i]];
      if (at !== column) { flush(); column = at; low = high = point; }
      if (y[i] < low[1]) low = point;
      if (y[i] > high[1]) high = point;
    }
    flush();
    return { points };
  }

  #words() {
    const { title, unit, lines, x, marks } = this.#given;
    const most = ({ x: xs, y }) => { let peak = 0; for (let i = 0; i < xs.length; i++) if (xs[i] >= x[0] && xs[i] <= x[1] && Math.abs(y[i]) > peak) peak = Math.abs(y[i]); return peak; };
    const said = lines.filter(line => line.name).map(line => t("chart_line", { name: line.name, peak: most(line).toFixed(2), unit }));
    return [t("chart_words", { title, unit, from: x[0].toFixed(0), to: x[1].toFixed(0) }), ...said, ...(marks ?? []).map(m => `${m.name}: ${m.x.toFixed(1)} s`)].join(" ");
  }

  // Where the picture of the road is.
  cursor(x) {
    if (!this.#cursor) return;
    const { X, x_0, x_1 } = this.#place, there = x >= x_0 && x <= x_1;
    this.#cursor.setAttribute("visibility", there ? "visible" : "hidden");
    if (there) { this.#cursor.setAttribute("x1", X(x)); this.#cursor.setAttribute("x2", X(x)); }
  }

  // The time under a pointer.
  at(event) {
    if (!this.#place) return null;
    const { x_0, x_1, left, right, width } = this.#place, box = this.#host.getBoundingClientRect();
    const share = (event.clientX - box.left - left) / (width - left - right);
    return share < 0 || share > 1 ? null : x_0 + share * (x_1 - x_0);
  }
}
