// The page: a state, the step that it shows, and the drives that this wants.

const $ = id => document.getElementById(id);
function el(name, attributes = {}, ...children) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
    else if (value !== false && value !== null) element.setAttribute(key, value === true ? "" : value);
  }
  element.append(...children);
  return element;
}
const ORDER = ["loop", "guidance", "reliance", "failure", "handover", "probe", "compare", "drive", "law"];
const START = { a: { ...PLAIN, t_p: 0.5, ...onLine(0), course: "bends" }, b: { ...PLAIN, t_p: 0.5, ...onLine(0), course: "bends", fail: "torque", at: 30 } };

let S, lab, drives, live, felt, scene, needle, view, results = {}, last = {}, charts = [], loopPicture = null;
// Where the paper's first bend begins to turn the car, s.
const BEFORE_S = 67;
const clock = { at: 0, from: 0, to: 1, playing: true, before: null, key: "" };
const frames = [];

function say(changes) {
  // What a reader leaves behind with the slider of reliance stays as a faint line.
  if (S.step === "reliance" && "k_hg" in changes && changes.k_hg !== S.k_hg) S.tried = [...new Set([S.k_hg, ...S.tried])].filter(k => k !== changes.k_hg).slice(0, 3);
  Object.assign(S, changes);
  soon();
}
let asked = false;
function soon() {
  if (asked) return;
  asked = true;
  setTimeout(() => { asked = false; render(); });
}
// A parser shows the whole line that it did not understand: its place and its reason are enough.
const reason = text => text.split("\n").filter(line => !/^\s*\d*\s*\|/.test(line)).join(" ").slice(0, 400);
// What is wrong with what is shown: gone as soon as something else is.
function wrong(text) { $("wrong").textContent = reason(text); }
// What became of something that the reader brought, a link or a file: it stays until it is read.
function notice(text) {
  $("noticed").textContent = reason(text);
  $("notice").hidden = text === "";
}

const isMoving = () => !matchMedia("(prefers-reduced-motion: reduce)").matches;
function go(step) {
  if (live.going && step !== "drive") live.end();
  say({ step });
  clock.playing = isMoving();
  scrollTo({ top: 0 });
}

// The instants and stretches of a drive that belong in every plot of it.
function instants(settings, { channels, failed_s }) {
  const marks = [], spans = [], { time, mode, warning } = channels;
  const lost = settings.fail === "torque" ? settings.at : failed_s < time.at(-1) ? failed_s : null;
  if (settings.guided !== false) {
    if (lost !== null) marks.push({ x: lost, name: t("mark_torque"), kind: "failure" });
    if (settings.fail === "input") marks.push({ x: settings.at, name: t("mark_input"), kind: "failure" });
    if (settings.fail && settings.fail !== "none") marks.push({ x: settings.at + 1, name: t("mark_notice"), kind: "mode" });
    for (let i = 1, from = 0; i < mode.length; i++) {
      // A torque that is lost is gone, whatever mode the ECU takes afterwards.
      if (lost !== null && time[i] > lost) break;
      const words = [];
      if (mode[i] !== mode[i - 1]) words.push(t("mark_mode", { mode: MODES[mode[i]] ?? mode[i] }));
      if (warning[i] && !warning[i - 1]) words.push(t("mark_warning"));
      if (words.length) marks.push({ x: time[i], name: words.join(", "), kind: warning[i] ? "warning" : "mode" });
      if (mode[i] !== mode[i - 1]) from = time[i];
      if ((mode[i] === 3 || mode[i] === 4) && (mode[i + 1] !== mode[i])) spans.push({ from: settings.fail === "input" ? Math.min(from, settings.at) : from, to: time[i], kind: "handover" });
    }
  }
  return { marks, spans };
}

function lineOf({ drive, channel, name, kind, scale = 1, truth, peaks, of }, x) {
  if (truth !== undefined) return { x, y: [truth, truth], name, kind };
  if (peaks) return results[peaks]?.peaks ? { x: results[peaks].peaks.at, y: results[peaks].peaks[of], name, kind } : null;
  const found = results[drive]?.channels;
  if (!found) return null;
  return { x: found.time, y: scale === 1 ? found[channel] : found[channel].map(value => value * scale), name, kind };
}
function bandOf({ drive, channel, band, kind }) {
  const found = results[drive]?.channels;
  if (!band || !found) return null;
  const by = sign => found[channel].map((value, i) => value + sign * 2 * found[band][i]);
  return { x: found.time, low: by(-1), high: by(1), kind };
}

function drawCharts() {
  const width = $("stage").clientWidth, wide = width > 480, panels = view.figure && !wide ? view.panels.filter(panel => panel.mine) : view.panels;
  const shape = `${S.step} ${panels.map(({ broad }) => +!!broad).join("")} ${width > 780}`;
  if ($("charts").dataset.shape !== shape) {
    $("charts").dataset.shape = shape;
    $("charts").className = view.figure && wide ? `charts beside${width > 780 ? "" : " two"}` : `charts of${Math.min(5, panels.length)}`;
    charts = panels.map(({ still, broad }) => {
      const host = el("div", { class: still ? "plot instants" : broad ? "plot broad" : "plot" }), chart = new Chart(host);
      host.addEventListener("pointerdown", event => { const at = chart.given?.still ? null : chart.at(event); if (at !== null && !live.going && !event.target.closest(".handle")) clock.at = at; });
      return { host, chart };
    });
    $("charts").replaceChildren(...charts.map(({ host }) => host));
  }
  panels.forEach((panel, i) => {
    const x = [clock.from, clock.to], lines = panel.lines.map(line => lineOf(line, x)).filter(Boolean);
    // What was never driven has no picture yet; what is refused has one without lines.
    if (!lines.length && !panel.still && !charts[i].chart.given) return;
    const marks = [], spans = [];
    for (const drive of panel.still ? [] : panel.marksOf ? [panel.marksOf] : [...new Set(panel.lines.map(line => line.drive))]) {
      if (!results[drive]?.channels) continue;
      const found = instants(view.drives[drive], results[drive]);
      for (const mark of found.marks) if (!marks.some(other => other.name === mark.name && Math.abs(other.x - mark.x) < 0.1)) marks.push(mark);
      spans.push(...found.spans);
    }
    const y = panel.fromZero ? [0, 1.05 * Math.max(0.1, ...lines.flatMap(line => line.y))] : panel.y;
    charts[i].chart.set({ ...panel, x: panel.x ?? x, y, lines, marks, spans, bands: panel.lines.map(bandOf).filter(Boolean) });
  });
}

// Controls: made anew for a step, told their values at every change.
const placeOf = control => control.of ? S[control.of] : S;
function chosen(control, value) {
  if (!control.of) { say({ [control.key]: value }); return; }
  const s = S[control.of];
  s[control.key] = value;
  if (control.key === "driver" && value !== "own") {
    const { t_p, k_hg, k_d, a_1, a_2, a_3 } = value > 3 ? lab.fourteen()[value - 4] : { ...EYES, ...onLine(s.k_hg), t_p: DELAYS[value - 1] };
    Object.assign(s, { t_p, k_hg, k_d, a_1, a_2, a_3 });
  } else if (["t_p", "k_hg", "k_d"].includes(control.key)) s.driver = "own";
  if (control.key === "k_hg") Object.assign(s, onLine(value));
  soon();
}
function options(control) {
  if (control.options === "laws") return [["shipping", t("shipping")], ...drives.names.map(name => [name, name]), ["own", t("own")]];
  if (control.options === "courses") return [...[...COURSES.keys()].map(name => [name, t(name.replace("-", "_"))]), ...[...dropped.keys()].map(name => [name, name])];
  if (control.key === "driver") return [["own", t("driver_own")], ...DELAYS.map((_, i) => [String(i + 1), t(`driver_${i + 1}`)]), ...lab.fourteen().map((_, i) => [String(i + 4), t("driver_of", { number: i + 1 })])];
  return control.options.map(([value, name]) => [value, /^[AB]$/.test(name) ? name : t(name)]);
}
function made(control) {
  const id = `c-${control.of ?? ""}${control.key}`;
  const label = t(control.label ?? (control.key === "shown" ? "who" : control.key === "who" ? "driver" : control.key));
  const words = control.help ?? `${control.key}_help`, help = STRINGS.en[words] ? el("small", {}, t(words)) : "";
  if (control.kind === "slider") {
    const value = el("output", { for: id }), input = el("input", { type: "range", id, min: control.min, max: control.max, step: control.step, oninput: event => chosen(control, Number(event.target.value)) });
    const ends = control.low ? el("span", { class: "ends" }, el("span", {}, t(control.low)), el("span", {}, t(control.high))) : "";
    const digits = control.step < 0.1 ? 2 : control.step < 1 ? 1 : 0;
    control.told = now => { input.value = now; value.textContent = `${now.toFixed(digits)} ${control.unit}`.trim(); input.setAttribute("aria-valuetext", value.textContent); };
    return el("div", { class: "control" }, el("label", { for: id }, label, " ", help), value, input, ends);
  }
  if (control.kind === "select") {
    const select = el("select", { id, onchange: event => chosen(control, event.target.value) });
    control.told = now => {
      const list = options(control);
      if (select.childElementCount !== list.length) select.replaceChildren(...list.map(([value, name]) => el("option", { value }, name)));
      select.value = now ?? "own";
    };
    return el("div", { class: "control line" }, el("label", { for: id }, label), select);
  }
  const buttons = options(control).map(([value, name]) => el("button", { type: "button", class: "chip", onclick: () => chosen(control, value) }, name));
  control.told = now => buttons.forEach((button, i) => button.setAttribute("aria-pressed", control.options[i][0] === now));
  return el("div", { class: "control line", role: "group", "aria-label": help ? `${label}: ${t(words)}` : label }, el("span", { class: "label" }, label, " ", help), el("span", { class: "chips" }, ...buttons));
}
let controls = [];
function drawControls() {
  const shape = `${S.step} ${drives.names.length} ${dropped.size}`, place = $("controls");
  if (place.dataset.shape !== shape) {
    place.dataset.shape = shape;
    controls = view.controls.map(control => ({ ...control }));
    const groups = new Map();
    for (const control of controls) { const key = control.of ?? ""; groups.set(key, [...groups.get(key) ?? [], made(control)]); }
    place.replaceChildren(...[...groups].map(([key, list]) => key ? el("fieldset", { class: `of-${key}` }, el("legend", {}, key.toUpperCase()), ...list) : el("div", {}, ...list)));
  }
  // Two columns of settings want the width of the pictures.
  const isWide = view.numbers && innerWidth > 900, home = isWide ? $("stage") : $("panel");
  if (place.parentElement !== home) home.insertBefore(place, isWide ? null : $("editor"));
  for (const control of controls) control.told(placeOf(control)[control.key]);
}

function drawNumbers() {
  $("figures").hidden = !view.numbers || !results.a?.metrics || !results.b?.metrics;
  if ($("figures").hidden) return;
  const rows = [["n_peak", "peak_lateral_error_m", "m"], ["n_mean", "mean_abs_lateral_error_m", "m"], ["n_after", "peak_lateral_error_after_failure_m", "m"], ["n_effort", "mean_abs_driver_torque_nm", "N.m"], ["n_guidance", "mean_abs_guidance_torque_nm", "N.m"], ["n_conflict", "conflict_time_share", "%"]];
  const cell = (value, unit) => value === null || value === undefined ? "-" : (unit === "%" ? (100 * value).toFixed(0) : value.toFixed(2)).replace(/^-(0(\.0*)?)$/, "$1");
  $("numbers").replaceChildren(el("caption", {}, t("n_what")), el("tr", {}, ...["", "A", "B", t("n_difference")].map(text => el(text ? "th" : "td", text ? { scope: "col", class: /^[AB]$/.test(text) ? `name-${text.toLowerCase()}` : "" } : {}, text))),
    ...rows.map(([name, key, unit]) => {
      const [a, b] = [results.a.metrics[key], results.b.metrics[key]], both = a !== null && b !== null;
      return el("tr", {}, el("th", { scope: "row" }, `${t(name)} (${unit})`), el("td", {}, cell(a, unit)), el("td", {}, cell(b, unit)), el("td", {}, both ? cell(b - a, unit) : "-"));
    }));
}

function jobOf(settings, more = {}) { return drives.job(settings, { law: S.law, steps: view.whole ? 1e6 : 107000, ...more }); }

function render() {
  view = S.step === "drive" ? driveView() : STEPS[S.step](S, say);
  history.replaceState(null, "", toAddress(S));
  const keys = Object.keys(view.drives), isLive = S.step === "drive";
  const found = isLive ? [] : drives.want(keys.map(key => jobOf(view.drives[key])));
  const before = last[S.step] ?? {};
  results = {};
  let missing = 0;
  const refused = [...new Set(found.map(drive => drive?.wrong).filter(Boolean))];
  wrong(refused.length ? t("wrong_drive", { what: refused.join("; ") }) : "");
  keys.forEach((key, i) => {
    if (!found[i] && !isLive) missing++;
    results[key] = (found[i]?.channels || found[i]?.peaks) && !found[i].fault ? found[i] : before[key];
    // A drive that is refused leaves nothing, and peaks of other settings say nothing of these.
    if (found[i]?.wrong || (view.drives[key].sweep && !found[i]?.peaks)) delete results[key];
  });
  if (isLive && live.settings) results.now = live.result();
  if (!missing) last[S.step] = { ...results };
  for (const node of document.querySelectorAll("#steps button")) node.removeAttribute("aria-current");
  const here = document.querySelector(`#steps [data-step=${S.step}]`);
  here.setAttribute("aria-current", "step");
  const nav = here.closest("nav");
  nav.scrollLeft += here.getBoundingClientRect().left - nav.getBoundingClientRect().left - 60;
  $("head").textContent = t(`${S.step}_head`);
  $("text").textContent = t(`${S.step}_text`);
  $("do").textContent = STRINGS.en[`${S.step}_do`] ? t(`${S.step}_do`) : "";
  $("busy").hidden = !missing;
  drawControls();
  range();
  drawCharts();
  drawNumbers();
  drawLoop();
  drawGuess(S, view);
  needle.show(view.needle !== undefined && !isAsked(S));
  $("editor").hidden = !view.editor;
  $("live").hidden = $("found").hidden = $("felt").hidden = !isLive;
  $("player").hidden = isLive;
  drawPlay();
  $("play").disabled = $("time").disabled = isAsked(S);
  if (view.editor) drawLaw(found[0]);
  if (isLive) drawLive();
  const drawn = keys.filter(key => !view.drives[key].sweep), all = drawn.every(key => results[key]?.metrics), left = keys.filter(key => results[key]?.now?.diverged);
  const asked = isAsked(S), isDriven = drawn.every(key => found[keys.indexOf(key)]);
  if (all && isDriven && !isLive && !asked) $("said").textContent = [guessed(S, view.right?.(results)), view.says(results), ...left.map(name => t("not_finished", { name: view.numbers ? name.toUpperCase() : name, time: results[name].now.time_s.toFixed(1) }))].join(" ").trim();
  else if (isLive || asked || !missing) $("said").textContent = "";
  if (!missing) document.body.dataset.done = S.step;
  else delete document.body.dataset.done;
}

// The stretch of time that is shown and played.
function range() {
  const end = Math.max(1, ...Object.values(results).map(result => result?.channels?.time.at(-1) ?? 0));
  const paper = Object.values(view.drives).every(settings => isPaper(settings)) && S.step !== "drive";
  [clock.from, clock.to] = paper && !view.whole ? STORY_S : paper ? [60, Math.max(61, end)] : [0, Math.max(10, end)];
  const key = `${S.step} ${clock.from}`;
  if (clock.key !== key) { clock.key = key; clock.at = view.starts ?? (paper && !view.whole ? BEFORE_S : clock.from); }
  $("time").min = clock.from;
  $("time").max = clock.to;
}

function drawLoop() {
  $("loop").hidden = !view.loop;
  if (!view.loop) return;
  loopPicture ??= new LoopPicture($("loop"), part => say({ part }));
  loopPicture.choose(S.part);
  $("do").textContent = S.part ? t(`loop_i_${S.part}`) : t("loop_do");
}

const instantAt = ({ channels }, time) => {
  const i = Math.max(0, Math.min(channels.time.length - 1, Math.round(time * 200)));
  const of = name => channels[name][i];
  return { of, time_s: of("time"), s_m: of("s"), lateral_error_m: of("error"), heading_error_rad: of("heading"), wheel_angle_rad: of("wheel"), driver_torque_nm: of("driver"), guidance_torque_nm: of("guidance"), warning: of("warning"), mode: of("mode") };
};

function frame(time) {
  requestAnimationFrame(frame);
  const began = performance.now(), gone = Math.min(200, time - (clock.before ?? time));
  clock.before = time;
  if (S.step === "drive") liveFrame(time);
  else {
    const result = results[view?.plays];
    if (result?.channels?.time.length) {
      // What comes is not shown before it is guessed.
      if (isAsked(S)) clock.at = view.starts ?? BEFORE_S;
      else if (clock.playing) clock.at += gone * 1e-3 * (view.rate ?? 1);
      if (clock.at > clock.to || clock.at < clock.from) clock.at = clock.from;
      paint(instantAt(result, clock.at), result.road, view.drives[view.plays]);
    } else if (document.body.dataset.done) {
      // What was to be shown is refused.
      scene.clear();
      $("at").textContent = "";
    }
  }
  frames.push(performance.now() - began);
  if (frames.length > 600) frames.shift();
}

function paint(now, road, settings) {
  const guided = settings.guided !== false, lost = settings.fail === "torque" && now.time_s >= settings.at;
  now.alarm = now.warning && guided ? t("alarm") : "";
  now.name = view.numbers ? S.shown : "";
  now.note = !guided ? t("alone") : lost ? t("failed") : MODES[now.mode] && now.mode !== 2 ? MODES[now.mode] : "";
  scene.paint(now, road);
  for (const { chart } of charts) if (!chart.given?.still) chart.cursor(clock.at);
  if (view.loop) loopPicture?.light(now.of);
  if (view.needle !== undefined) needle.set(now.of("k_hg"), now.of("deviation"), view.needle);
  if (document.activeElement !== $("time")) $("time").value = clock.at;
  $("time").setAttribute("aria-valuetext", `${now.time_s.toFixed(1)} s`);
  $("at").textContent = `${now.time_s.toFixed(1)} s${(view.rate ?? 1) === 1 ? "" : ` (${view.rate}${t("rate")})`}`;
  drawPlay();
}
function drawPlay() { $("play").textContent = t(clock.playing ? "pause" : "play"); }
