// The page around the loop: sliders to a scenario, steps to pictures, a hand to a torque. Every number comes from WebAssembly.

const $ = id => document.getElementById(id);
const PLACES = ["time_s", "s_m", "lateral_error_m", "heading_error_rad", "wheel_angle_rad", "driver_torque_nm",
  "guidance_torque_nm", "mode", "limit", "warning", "e_y_m", "e_theta_rad", "speed_m_per_s", "wheel_rate_rad_per_s",
  "steps", "diverged"];
// Columns of the log by their places.
const TIME = 0, WHEEL = 3, GUIDANCE = 4, DRIVER = 5, ERROR = 6;
// A hand holds the wheel like a spring towards where the pointer is.
const HAND = { stiffness_nm_per_rad: 8, damping_nm_s_per_rad: 0.6, most_nm: 8, range_rad: 0.6 };
let wasm;

async function load() {
  const packed = Uint8Array.from(atob(WASM), c => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const bytes = await new Response(stream).arrayBuffer();
  wasm = (await WebAssembly.instantiate(bytes, {})).instance.exports;
}

const numbers = (at, count) => Array.from(new Float64Array(wasm.memory.buffer, at, count));
const answer = () => {
  // The place first: the length is another call.
  const at = wasm.text(), length = wasm.text_length();
  return new TextDecoder().decode(new Uint8Array(wasm.memory.buffer, at, length));
};

// What a test and the page itself use.
function give(text) {
  const bytes = new TextEncoder().encode(text);
  const at = wasm.take(bytes.length);
  new Uint8Array(wasm.memory.buffer, at, bytes.length).set(bytes);
}
const lab = {
  begin(toml) { give(toml); if (!wasm.begin()) throw new Error(answer()); },
  replay(bus) { give(bus); if (!wasm.replay()) throw new Error(answer()); return answer(); },
  play: steps => wasm.play(steps),
  step: (hand_nm, { steps = 1, engage = true, authority = 1, torque_lost = false, lane_lost = false } = {}) =>
    wasm.step(steps, hand_nm, +engage, authority, +torque_lost, +lane_lost),
  now: () => Object.fromEntries(numbers(wasm.now(), PLACES.length).map((value, i) => [PLACES[i], value])),
  road: (every_m, count) => numbers(wasm.road(every_m, count), 2 * count),
  channel: place => numbers(wasm.channel(place), wasm.samples()),
  csv() { if (!wasm.csv()) throw new Error(answer()); return answer(); },
  identify(manual) { if (!wasm.identify(+manual)) throw new Error(answer()); return JSON.parse(answer()); },
};

function scenario(person) {
  const guided = $("guided").value === "on";
  let text = `speed = ${$("speed").value}\n`;
  text += `condition = "${guided ? "mid" : "manual"}"\nsensors = "${$("sensors").value}"\n[driver]\n`;
  for (const slider of document.querySelectorAll("#driver input")) {
    const name = slider.dataset.field;
    // A person drives: the model's arm is slack.
    const slack = person && ["a_1", "a_2", "a_3", "K_d", "K_hg"].includes(name);
    if (!(name === "K_hg" && !guided)) text += `${name} = ${Number(slack ? 0 : slider.value).toFixed(3)}\n`;
  }
  if (person) text += "K_nms = 0.0\n";
  text += `[guidance]\nK_1 = ${Number($("K_1").value).toFixed(3)}\n`;
  const kind = $("kind").value;
  if (!person && guided && kind !== "none") text += `[failure]\nkind = "${kind}"\ntime = ${Number($("time").value).toFixed(1)}\n`;
  return text;
}

// Pictures.
const charts = {};
function chart(place, series) {
  const style = ["#1f5fa8", "#c2571a"];
  charts[place] = new uPlot({
    width: Math.max(320, $(place).clientWidth), height: 190, scales: { x: { time: false } }, cursor: { drag: { x: true, y: false } },
    axes: [{ label: "time (s)", labelSize: 16, size: 40 }, { size: 50, space: 22 }],
    series: [{ label: "s" }, ...series.map((label, i) => ({ label, stroke: style[i], width: 1.2 }))],
  }, [[0], ...series.map(() => [0])], $(place));
}
function draw() {
  const time = lab.channel(TIME);
  if (!time.length) return;
  charts["c-error"].setData([time, lab.channel(ERROR)]);
  charts["c-torque"].setData([time, lab.channel(DRIVER), lab.channel(GUIDANCE)]);
  charts["c-wheel"].setData([time, lab.channel(WHEEL).map(angle => angle * 180 / Math.PI)]);
}
function facts() {
  const now = lab.now(), guided = $("guided").value === "on";
  $("f-time").textContent = now.time_s.toFixed(1) + " s";
  $("f-s").textContent = now.s_m.toFixed(0) + " m";
  $("f-e").textContent = now.lateral_error_m.toFixed(2) + " m";
  const told = guided && $("sensors").value === "paper";
  $("f-mode").textContent = told ? MODES[now.mode] ?? now.mode : "-";
  $("f-limit").textContent = told ? LIMITS[now.limit] ?? now.limit : "-";
  $("f-warning").textContent = now.diverged ? "Off the road" : now.warning && told ? "Take over" : "";
  return now;
}
function paint(now) {
  const canvas = $("road"), pen = canvas.getContext("2d"), w = canvas.width, h = canvas.height;
  const horizon = 0.36 * h, eye_m = 1.2, focal = 0.9 * w;
  pen.fillStyle = "#cfe3f2"; pen.fillRect(0, 0, w, horizon);
  pen.fillStyle = "#9bb58a"; pen.fillRect(0, horizon, w, h - horizon);
  const points = lab.road(2, 90), centre = [];
  for (let i = 0; i < points.length; i += 2) if (points[i] > 2.2) centre.push([points[i], points[i + 1]]);
  const at = ([x, y]) => [w / 2 - focal * y / x, horizon + focal * eye_m / x];
  // Sideways of the centre: along the normal of the stretch.
  const side = (i, by) => {
    const [a, b] = [centre[Math.max(0, i - 1)], centre[Math.min(centre.length - 1, i + 1)]];
    const length = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1;
    return at([centre[i][0] - by * (b[1] - a[1]) / length, centre[i][1] + by * (b[0] - a[0]) / length]);
  };
  const band = (left, right, color) => {
    pen.fillStyle = color; pen.beginPath();
    centre.forEach((_, i) => pen.lineTo(...side(i, left)));
    for (let i = centre.length - 1; i >= 0; i--) pen.lineTo(...side(i, right));
    pen.fill();
  };
  if (centre.length > 2) {
    band(5.6, -2.0, "#5c6570"); band(1.86, 1.74, "#fff"); band(-1.74, -1.86, "#fff"); band(5.46, 5.34, "#fff");
    band(0.06, -0.06, "rgba(255,255,255,.22)");
  }
  // The wheel, as it stands.
  pen.save(); pen.translate(w / 2, h - 6); pen.rotate(-now.wheel_angle_rad);
  pen.strokeStyle = "#1d2733"; pen.lineWidth = 12; pen.beginPath(); pen.arc(0, 0, 74, 0, 2 * Math.PI); pen.stroke();
  pen.lineWidth = 8; pen.beginPath(); pen.moveTo(-70, 0); pen.lineTo(70, 0); pen.moveTo(0, 0); pen.lineTo(0, 70); pen.stroke();
  pen.restore();
}

// A hand: where it wants the wheel, and with what torque it gets it there.
const hand = { target_rad: 0, keys: 0 };
function torque(now) {
  const wanted = HAND.stiffness_nm_per_rad * (hand.target_rad - now.wheel_angle_rad)
    - HAND.damping_nm_s_per_rad * now.wheel_rate_rad_per_s;
  return Math.max(-HAND.most_nm, Math.min(HAND.most_nm, wanted));
}
function listen() {
  $("road").addEventListener("pointermove", event => {
    const box = $("road").getBoundingClientRect();
    hand.target_rad = HAND.range_rad * (1 - 2 * (event.clientX - box.left) / box.width);
  });
  const key = (event, on) => {
    const way = { ArrowLeft: 1, ArrowRight: -1 }[event.key];
    if (way && running) { hand.keys = on ? way : hand.keys === way ? 0 : hand.keys; event.preventDefault(); }
  };
  addEventListener("keydown", event => key(event, true));
  addEventListener("keyup", event => key(event, false));
}
function hands(dt_s) {
  const pad = navigator.getGamepads?.().find(p => p);
  if (pad && Math.abs(pad.axes[0]) > 0.05) hand.target_rad = -HAND.range_rad * pad.axes[0];
  if (hand.keys) hand.target_rad += hand.keys * 0.5 * dt_s;
  hand.target_rad = Math.max(-HAND.range_rad, Math.min(HAND.range_rad, hand.target_rad));
}

let running = null;
function fail(error) { $("wrong").textContent = error ? error.message : ""; }

// The driver model: as fast as the page can, in pieces that leave it alive.
function watch() {
  const turn = () => {
    if (running !== turn) return;
    const made = lab.play(4000);
    facts();
    if (made < 4000) { running = null; draw(); facts(); document.body.dataset.done = "1"; } else { draw(); setTimeout(turn, 0); }
  };
  running = turn; turn();
}

// The next picture; a page that draws none goes on all the same.
function soon(turn) {
  let done = false;
  const once = () => { if (!done) { done = true; turn(performance.now()); } };
  requestAnimationFrame(once);
  setTimeout(once, 100);
}

// A person, or whoever gives a torque for an instant: in real time, one step a millisecond.
function drive(give = torque, action = () => ({})) {
  let last = performance.now(), drawn = 0;
  const fails_s = $("surprise").checked ? 20 + 60 * Math.random() : Infinity;
  const turn = time => {
    if (running !== turn) return;
    // Who was away for long does not drive blindly meanwhile.
    const steps = Math.max(0, Math.min(120, Math.round(time - last)));
    last = steps === 120 ? time : last + steps;
    hands(steps * 1e-3);
    let now = lab.now();
    for (let k = 0; k < steps; k++) {
      if (!lab.step(give(now), { torque_lost: now.time_s > fails_s, ...action(now) })) return end();
      now = lab.now();
    }
    paint(facts());
    if (time - drawn > 500) { draw(); drawn = time; }
    soon(turn);
  };
  running = turn; soon(turn);
}
function end() {
  if (!running) return;
  running = null;
  draw(); facts();
  if ($("person").hidden) return;
  $("found").hidden = false;
  $("result").textContent = "Looking at your drive …";
  setTimeout(() => show($("guided").value !== "on"), 30);
}
const LABELS = { t_p: "Delay from seeing to acting", gain_1: "Torque per lateral error", gain_2: "Torque per its integral",
  gain_3: "Torque per yaw error", k_hg: "Weight on the guidance (0: relies on it)" };
function show(manual) {
  const place = $("result");
  place.replaceChildren();
  const say = text => { const p = document.createElement("p"); p.textContent = text; place.append(p); };
  let found;
  try { found = lab.identify(manual); } catch (error) { say(error.message); return; }
  const table = document.createElement("table");
  const row = (cells, kind = "td") => {
    const line = table.insertRow();
    for (const text of cells) { const cell = document.createElement(kind); cell.textContent = text; line.append(cell); }
  };
  row(["Yours", "Estimate", "95 % interval", "Unit"], "th");
  for (const { name, unit, found: p } of found.parameters) {
    if (!(name in LABELS) || (manual && name === "k_hg")) continue;
    const interval = p.interval_95 ? `${p.interval_95[0].toFixed(3)} to ${p.interval_95[1].toFixed(3)}` : "-";
    row([`${LABELS[name]} (${name})`, p.identified ? p.estimate.toFixed(3) : "not identified", interval, unit]);
  }
  place.append(table);
  say(`The model explains ${found.fit_percent.toFixed(0)} % of your torque.`);
  found.notes.forEach(say);
}

function begin() {
  fail();
  const person = !$("person").hidden;
  $("found").hidden = true;
  delete document.body.dataset.done;
  try { lab.begin(scenario(person)); } catch (error) { fail(error); return; }
  hand.target_rad = 0;
  if (person) drive(); else watch();
}
function choose(person) {
  running = null;
  $("person").hidden = $("view").hidden = !person;
  $("driver").hidden = $("failure").hidden = person;
  $("tab-watch").setAttribute("aria-pressed", !person);
  $("tab-drive").setAttribute("aria-pressed", person);
  if (person) { lab.begin(scenario(true)); paint(facts()); }
}
function save() {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([lab.csv()], { type: "text/csv" }));
  link.download = "drive.csv";
  link.click();
}
window.lab = lab;
window.page = { scenario, begin, choose, drive, end, show, draw, facts, paint };
load().then(() => {
  for (const slider of document.querySelectorAll("input[type=range]")) {
    const tell = () => { slider.previousElementSibling.textContent = slider.value; };
    slider.addEventListener("input", tell); tell();
  }
  chart("c-error", ["lateral error"]); chart("c-torque", ["driver", "guidance"]); chart("c-wheel", ["wheel"]);
  // A model drives again at every change; a person says when.
  for (const control of document.querySelectorAll("main input, main select"))
    control.addEventListener("input", () => { if ($("person").hidden) begin(); });
  $("start").onclick = begin;
  $("stop").onclick = end;
  $("log").onclick = () => { try { save(); } catch (error) { fail(error); } };
  $("tab-watch").onclick = () => choose(false);
  $("tab-drive").onclick = () => choose(true);
  listen();
  begin();
  document.body.dataset.ready = "1";
}, error => fail(error));
