// The loop as a picture whose parts light up with their signals, and the needle of the live K_hg.

// Each part: its box, or the way of its arrow, and the signal that lights it up (a channel and what is much of it).
const PARTS = {
  road: { box: [6, 92, 86, 44] }, driver: { box: [138, 8, 112, 46], lit: ["driver", 0.6] }, ecu: { box: [138, 176, 112, 46], lit: ["guidance", 0.5] },
  wheel: { box: [306, 62, 104, 44], lit: ["wheel", 0.2] }, car: { box: [306, 146, 104, 44], lit: ["error", 0.15] },
};
const WAYS = [
  { way: "M49,92 V31 H138", lit: ["e_y", 0.15], part: "driver" },
  { way: "M49,136 V199 H138", lit: ["e_y", 0.15], part: "ecu" },
  { way: "M250,31 H358 V62", lit: ["driver", 0.6], kind: "driver", text: [264, 24], symbol: "T_d", part: "driver" },
  { way: "M250,199 H264 V92 H306", lit: ["guidance", 0.5], kind: "guidance", text: [254, 152], anchor: "end", symbol: "T_h", part: "ecu" },
  { way: "M358,106 V146", lit: ["wheel", 0.2], text: [350, 131], anchor: "end", symbol: "phi", part: "wheel", degrees: true },
  { way: "M358,190 V240 H20 V136", lit: ["error", 0.15], text: [186, 256], symbol: "error", part: "car" },
  { way: "M160,176 V54", lit: ["guidance", 0.5], kind: "guidance dashed", text: [154, 120], anchor: "end", part: "felt", word: "loop_felt" },
];

// Where an arrow ends, and how it points there.
function endOf(way) {
  let [x, y] = way.slice(1).split(" ")[0].split(",").map(Number), turn = 0;
  for (const part of way.split(" ").slice(1)) {
    const to = Number(part.slice(1));
    if (part[0] === "H") { turn = to > x ? 0 : 180; x = to; } else { turn = to > y ? 90 : -90; y = to; }
  }
  return `${x},${y}) rotate(${turn}`;
}

class LoopPicture {
  #ways = []; #boxes = {};
  constructor(host, chosen) {
    const root = svg("svg", { viewBox: "0 0 420 262", class: "loop", role: "group", "aria-label": t("loop_head") });
    for (const given of WAYS) {
      const path = svg("path", { d: given.way, class: `way ${given.kind ?? ""}` });
      const head = svg("path", { d: "M-11,-7 L0,0 L-11,7 z", class: `head ${given.kind ?? ""}`, transform: `translate(${endOf(given.way)})` });
      const text = given.text ? svg("text", { x: given.text[0], y: given.text[1], class: `value ${given.kind ?? ""}`, "text-anchor": given.anchor ?? "start" }, given.word ? t(given.word) : "") : null;
      const touch = svg("path", { d: given.way, class: "touch" });
      touch.addEventListener("click", () => chosen(given.part));
      root.append(path, head, touch, ...(text ? [text] : []));
      this.#ways.push({ ...given, path, label: text });
    }
    for (const [name, { box: [x, y, width, height] }] of Object.entries(PARTS)) {
      const group = svg("g", { class: `part ${name}`, role: "button", tabindex: 0, "aria-label": t(`loop_p_${name}`) },
        svg("rect", { x, y, width, height, rx: 7 }), svg("text", { x: x + width / 2, y: y + height / 2 + 5, "text-anchor": "middle" }, t(`loop_p_${name}`)));
      group.addEventListener("click", () => chosen(name));
      group.addEventListener("keydown", event => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); chosen(name); } });
      this.#boxes[name] = group;
      root.append(group);
    }
    host.replaceChildren(root);
  }

  choose(part) { for (const [name, group] of Object.entries(this.#boxes)) group.setAttribute("aria-pressed", name === part); }

  // value: channel => number at this instant.
  light(value) {
    const share = lit => Math.min(1, Math.abs(value(lit[0])) / lit[1]);
    for (const { lit, path, label, symbol, degrees, word } of this.#ways) {
      path.style.strokeWidth = 2 + 5 * share(lit);
      if (!label || word) continue;
      const v = value(lit[0]);
      label.textContent = degrees ? `phi ${(v * 180 / Math.PI).toFixed(1)} deg` : symbol === "error" ? t("loop_off", { far: Math.abs(v).toFixed(2) }) : `${symbol} ${v.toFixed(2)} N.m`;
    }
    for (const [name, { lit }] of Object.entries(PARTS)) if (lit) this.#boxes[name].style.setProperty("--lit", share(lit).toFixed(2));
  }
}

// A dial from 0 to 1.2: what the ECU tells, how sure it is (two standard deviations to each side), and the truth.
class Needle {
  #root; #hand; #fan; #truth; #text; #host;
  constructor(host) {
    this.#host = host;
    this.#fan = svg("path", { class: "fan" });
    this.#hand = svg("line", { x1: 110, y1: 100, x2: 110, y2: 38, class: "hand" });
    this.#truth = svg("path", { d: "M110,6 l7,-12 h-14 z", class: "truth" });
    this.#text = svg("text", { x: 110, y: 128, "text-anchor": "middle", class: "value" });
    this.#root = svg("svg", { viewBox: "0 -10 220 146", class: "needle", role: "img" }, this.#fan, svg("path", { d: "M20,100 A90,90 0 0 1 200,100", class: "rim" }));
    for (const k of [0, 0.2, 0.4, 0.6, 0.8, 1]) {
      const [x, y] = this.#at(k, 74);
      this.#root.append(svg("text", { x, y: y + 4, "text-anchor": "middle", class: "tick" }, k.toFixed(1)));
    }
    this.#root.append(this.#truth, this.#hand, this.#text);
    host.replaceChildren(this.#root, el("small", {}, t("needle_key")));
  }

  #angle(k_hg) { return Math.PI * Math.min(1.2, Math.max(0, k_hg)) / 1.2; }
  #at(k_hg, radius) { const a = this.#angle(k_hg); return [110 - radius * Math.cos(a), 100 - radius * Math.sin(a)]; }

  set(told, deviation, truth) {
    const turn = k_hg => `rotate(${(this.#angle(k_hg) * 180 / Math.PI - 90).toFixed(2)} 110 100)`;
    const known = Number.isFinite(told);
    this.#truth.setAttribute("transform", turn(truth ?? 0));
    this.#truth.setAttribute("visibility", truth === null ? "hidden" : "visible");
    this.#hand.setAttribute("visibility", known ? "visible" : "hidden");
    this.#fan.setAttribute("visibility", known ? "visible" : "hidden");
    const words = known ? t("needle_words", { told: sure(told, deviation), truth: truth?.toFixed(2) ?? "?" }) : t("needle_none");
    if (this.#root.getAttribute("aria-label") !== words) this.#root.setAttribute("aria-label", words);
    this.#text.textContent = known ? `K_hg ${sure(told, deviation)}` : "K_hg ?";
    if (!known) return;
    this.#hand.setAttribute("transform", turn(told));
    const [a, b] = [this.#at(told - 2 * deviation, 88), this.#at(told + 2 * deviation, 88)];
    this.#fan.setAttribute("d", `M110,100 L${a} A88,88 0 0 1 ${b} z`);
  }

  show(shown) { this.#host.hidden = !shown; }
}
