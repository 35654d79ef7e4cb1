// What a reader takes along: the state in the address, pictures, series, a scenario file.

const OWN_STATE = { step: "loop", t_p: 0.5, k_hg: 0.5, at: 70, who: 0.5, part: "", shown: "a", course: "bends", guided: "on", speed: 60, law: LAW };
const LEAST = { a_1: [0, 0.5], a_2: [0, 0.1], a_3: [0, 8], t_p: [0.05, 0.8], k_hg: [0, 1], at: [2, 150], who: [0.1, 0.5], k_d: [1, 6], k_1: [0.05, 0.5], speed: [30, 110], remnant: [0, 0.3] };

function toAddress(state) {
  const said = new URLSearchParams();
  for (const [key, plain] of Object.entries(OWN_STATE)) if (state[key] !== plain) said.set(key, state[key]);
  for (const drive of ["a", "b"])
    for (const [key, value] of Object.entries(state[drive])) if (value !== START[drive][key]) said.set(`${drive}.${key}`, value);
  return `#${said}`;
}

// What of an address is understood; the rest by name.
function fromAddress(hash) {
  const state = { ...OWN_STATE, a: { ...START.a }, b: { ...START.b }, tried: [] }, odd = [];
  for (const [name, text] of new URLSearchParams(hash.replace(/^#/, ""))) {
    const [drive, key] = name.includes(".") ? name.split(".") : [null, name];
    const place = drive ? START[drive] && key in PLAIN ? state[drive] : null : key in OWN_STATE ? state : null;
    const plain = drive ? PLAIN[key] : OWN_STATE[key];
    let value = text;
    if (typeof plain === "number") value = text.trim() === "" ? NaN : Number(text);
    if (typeof plain === "boolean") value = { true: true, false: false }[text];
    const [least, most] = LEAST[key] ?? [];
    const good = place && value !== undefined && !(typeof value === "number" && !(value >= least && value <= most))
      && !(key === "step" && !ORDER.includes(value)) && !(!drive && key === "who" && !DELAYS.includes(value)) && !(!drive && key === "guided" && !["on", "off", "surprise"].includes(value))
      && !(key === "shown" && !["a", "b"].includes(value)) && !(key === "fail" && !["none", "torque", "input"].includes(value));
    if (good) place[key] = value; else odd.push(name.slice(0, 30));
  }
  return { state, odd };
}

function save(name, type, content) {
  const url = URL.createObjectURL(content instanceof Blob ? content : new Blob([content], { type }));
  el("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10000);
}

// All charts of a step below each other, with their colours as they are on the page.
function picture(charts, heading) {
  const drawn = charts.map(host => host.querySelector("svg")).filter(Boolean);
  const width = Math.max(...drawn.map(chart => chart.width.baseVal.value));
  let height = 34;
  const css = document.getElementById("chart-css").textContent.replace(/var\(--([a-z-]+)\)/g, (_, name) => shade(name));
  const all = svg("svg", { xmlns: SVG }, svg("style", {}, css));
  all.append(svg("rect", { width: "100%", height: "100%", fill: shade("card") }), svg("text", { x: 6, y: 22, class: "heading" }, heading));
  for (const chart of drawn) {
    const copy = chart.cloneNode(true);
    copy.setAttribute("y", height);
    height += chart.height.baseVal.value + 8;
    all.append(copy);
  }
  all.setAttribute("viewBox", `0 0 ${width} ${height}`);
  all.setAttribute("width", width);
  all.setAttribute("height", height);
  return { text: new XMLSerializer().serializeToString(all), width, height };
}

async function png({ text, width, height }) {
  const image = new Image();
  image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(text)}`;
  await image.decode();
  const canvas = el("canvas", { width: 2 * width, height: 2 * height });
  canvas.getContext("2d").drawImage(image, 0, 0, 2 * width, 2 * height);
  return new Promise(done => canvas.toBlob(done, "image/png"));
}
