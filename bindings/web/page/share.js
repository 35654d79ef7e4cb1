// What a reader takes along: the state in the address, pictures, series, a scenario file.

// What a text of an address may be, and the value that it means; `undefined` if it is none of these. The ends of numbers are those of the
// scenario's fields (examples/every-field.toml): a slider offers less, and a driver of the paper lies beyond some.
const within = (least, most) => text => text.trim() !== "" && Number(text) >= least && Number(text) <= most ? Number(text) : undefined;
const oneOf = (...values) => text => values.find(value => String(value) === text);
const anyText = text => text;
const listOf = (is, most) => text => {
  const values = text === "" ? [] : text.split(" ").map(is);
  return values.length <= most && !values.includes(undefined) ? values : undefined;
};
const GAIN = within(0, 50), SHARE = within(0, 10), INSTANT_S = within(0, 1e6), SPEED_KMH = within(5.5 * 3.6, 70 * 3.6);
// Each field of the state with the value that it has at the start. They are maps, so that no word of the language is a field of them.
const OF_PAGE = new Map([
  ["step", ["loop", text => oneOf(...ORDER)(text)]],
  ["t_p", [0.5, within(0.001, 2)]], ["k_hg", [0.5, SHARE]], ["at", [70, INSTANT_S]], ["who", [0.5, oneOf(...DELAYS)]], ["tried", [[], listOf(SHARE, 3)]],
  ["guess", [[], listOf(isGuess, 5)]],
  ["part", ["", oneOf("", "road", "driver", "ecu", "wheel", "car", "felt")]], ["shown", ["a", oneOf("a", "b")]],
  ["course", ["bends", anyText]], ["guided", ["on", oneOf("on", "off", "surprise")]], ["speed", [60, SPEED_KMH]], ["law", [LAW, anyText]],
]);
const DRIVERS = ["own", ...Array.from({ length: DELAYS.length + 14 }, (_, i) => String(i + 1))];
const OF_DRIVE = new Map(Object.entries({
  driver: oneOf(...DRIVERS), a_1: within(0, 10), a_2: within(0, 10), a_3: within(0, 100), t_p: within(0.001, 2), k_hg: SHARE, k_d: GAIN, speed: SPEED_KMH,
  guided: oneOf(true, false), k_1: within(0, 4), law: anyText, fail: oneOf("none", "torque", "input"), at: INSTANT_S, probe: oneOf(true, false),
  remnant: within(0, 5), course: anyText, column: oneOf("hands", "bar"),
}));
const written = value => Array.isArray(value) ? value.join(" ") : String(value);

function toAddress(state) {
  const said = new URLSearchParams();
  for (const [key, [plain]] of OF_PAGE) if (written(state[key]) !== written(plain)) said.set(key, written(state[key]));
  for (const drive of ["a", "b"])
    for (const key of OF_DRIVE.keys()) if (state[drive][key] !== START[drive][key]) said.set(`${drive}.${key}`, written(state[drive][key]));
  return `#${said}`;
}

// The state of an address, and the names of what in it is not understood.
function fromAddress(hash) {
  const state = { a: { ...START.a }, b: { ...START.b } }, odd = [];
  for (const [key, [plain]] of OF_PAGE) state[key] = Array.isArray(plain) ? [...plain] : plain;
  for (const [name, text] of new URLSearchParams(hash.replace(/^#/, ""))) {
    const [, drive, key] = /^(?:(a|b)\.)?(.*)$/s.exec(name);
    const value = drive ? OF_DRIVE.get(key)?.(text) : OF_PAGE.get(key)?.[1](text);
    if (value === undefined) odd.push(name.slice(0, 30)); else (drive ? state[drive] : state)[key] = value;
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

// The law of a drive as comment behind its scenario: a scenario file has no law of the page's own or of the library.
function lawNote({ law = "shipping" }) {
  if (law === "shipping") return "";
  const words = law === "own" ? t("file_own_law").split("\n").concat(S.law.split(/\r\n|[\r\n]/)) : [t("file_law", { law: law.replace(/[\x00-\x1f\x7f]/g, " ") })];
  return `\n${words.map(line => `# ${line.replace(/[\x00-\x08\x0b-\x1f\x7f]/g, " ")}`.trimEnd()).join("\n")}\n`;
}
