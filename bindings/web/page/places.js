// The two steps in which the reader acts: driving, and writing a law. And the start of the page.

function driveView() {
  return {
    drives: { now: live.settings ?? { course: S.course } }, plays: "now",
    panels: [panel("c_error", "m", [error("now", "", "now")], { least: 1 }),
      panel("c_torque", "N.m", [{ drive: "now", channel: "driver", name: t("driver_torque"), kind: "driver" }, { drive: "now", channel: "guidance", name: t("guidance_torque"), kind: "guidance" }], { least: 0.5 })],
    controls: [{ key: "course", kind: "select", options: "courses" }, choice("guided", [["on", "on"], ["off", "off"], ["surprise", "surprise"]]), slider("speed", 30, 110, 1, "km/h")],
  };
}

function drawLive() {
  $("start").textContent = t(live.going ? "stop" : "start");
  const asked = JSON.stringify([S.course, S.speed, S.guided]);
  if (live.going || live.asked === asked) return;
  live.asked = asked;
  resetLive();
  $("found").replaceChildren();
  $("told").textContent = [live.note, t(COURSES.get(S.course) ? "drive_bend" : ""), t("drive_ready")].join(" ").trim();
  live.note = "";
}
// The road before a start, so that there is something to see.
function resetLive() {
  try { live.begin({ course: S.course, speed: S.speed, guided: S.guided }); live.advance(6); live.end(); results.now = live.result(); }
  catch (error) { wrong(t("wrong_drive", { what: error.message })); }
}

function startLive(give = null) {
  if (live.going) { endLive(); return; }
  wrong("");
  try { live.begin({ course: S.course, speed: S.speed, guided: S.guided }, give); }
  catch (error) { wrong(t("wrong_drive", { what: error.message })); return; }
  live.told = t("drive_going");
  $("found").replaceChildren();
  $("canvas").focus({ preventScroll: true });
  soon();
}

// A hand on the wheel of any step is a drive of the reader's own.
function takeWheel() {
  if (S.step !== "drive") go("drive");
  // The step is drawn first: it shows the road that is driven.
  setTimeout(() => { if (!live.going) startLive(); });
}

async function endLive(why = "") {
  live.end();
  $("told").textContent = `${why} ${t("drive_look")}`.trim();
  soon();
  const guided = live.settings.guided, csv = live.csv();
  const answer = await drives.ask({ key: `identify ${performance.now()}`, identify: true, csv, manual: !guided });
  $("told").textContent = why;
  $("found").replaceChildren(el("h3", {}, t("who_drove")), ...(answer.wrong ? [el("p", {}, answer.wrong)] : foundList(answer.found, guided)));
  document.body.dataset.found = String(Number(document.body.dataset.found ?? 0) + 1);
}

let drawn = 0;
function liveFrame(time) {
  if (!live.settings) return;
  if (live.going && !live.frame(time)) endLive(t(live.now().diverged ? "drive_left" : "drive_end"));
  const now = live.now();
  now.alarm = now.warning && live.settings.guided ? t("alarm") : "";
  now.note = !live.settings.guided ? t("alone") : now.time_s >= live.failed_s ? t("failed") : "";
  scene.paint(now, live.road);
  if (!live.going) { felt.stop(); return; }
  felt.frame(time, -now.driver_torque_nm, live.target_rad);
  $("told").textContent = `${now.time_s.toFixed(0)} s. ${live.told}`;
  if (time - drawn > 500) {
    drawn = time;
    results.now = live.result();
    range();
    drawCharts();
  }
}

// The editor: a drive at every pause of writing; what is wrong stands at its line.
let waiting = null;
function listenLaw() {
  const area = $("lawtext"), numbers = () => { $("lawlines").textContent = area.value.split("\n").map((_, i) => i + 1).join("\n"); };
  area.value = S.law;
  numbers();
  area.addEventListener("input", () => { numbers(); clearTimeout(waiting); waiting = setTimeout(() => say({ law: area.value }), 500); });
  area.addEventListener("scroll", () => { $("lawlines").scrollTop = area.scrollTop; });
  $("lawreset").addEventListener("click", () => { area.value = LAW; numbers(); say({ law: LAW }); });
}
function drawLaw(result) {
  if (!result) return;
  const { fault, odd } = result, lines = S.law.split("\n").length;
  const line = fault?.line ? Math.min(lines, Math.max(1, fault.line)) : null;
  const at = fault?.time_s !== undefined ? ` ${t("law_at", { time: fault.time_s.toFixed(3) })}` : "";
  $("lawsaid").textContent = fault ? `${line ? t("law_line", { line, what: fault.what }) : fault.what}${at} ${t("law_stopped")}`
    : odd ? t("law_odd", { time: odd.time_s.toFixed(3), value: odd.value }) : t("law_good");
  $("lawsaid").className = fault || odd ? "bad" : "";
  const numbers = $("lawlines");
  numbers.replaceChildren(...Array.from({ length: lines }, (_, i) => el("span", { class: i + 1 === line ? "wrong" : "" }, `${i + 1}\n`)));
}

function listenFelt() {
  const hold = $("felthold"), part = $("feltpart"), show = () => { felt.part = Number(part.value); $("feltis").textContent = `${(100 * felt.part).toFixed(0)} %`; };
  felt = new FeltWheel(text => { $("feltsaid").textContent = text; hold.disabled = !felt.isThere; });
  live.isFelt = () => felt.isThere;
  show();
  part.addEventListener("input", show);
  $("feltconnect").addEventListener("click", () => felt.connect());
  const isKey = event => event.key === " " && live.going && felt.isThere && !event.target.matches?.("input, select, textarea, summary, button:not(#felthold)");
  hold.addEventListener("pointerdown", event => { hold.setPointerCapture(event.pointerId); felt.hold(true); });
  for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) hold.addEventListener(name, () => felt.hold(false));
  addEventListener("keydown", event => { if (isKey(event)) { event.preventDefault(); felt.hold(true); } });
  addEventListener("keyup", event => { if (event.key === " ") felt.hold(false); });
}

async function share(kind) {
  const note = text => { $("shared").textContent = text; };
  const isLive = S.step === "drive", settings = view.drives[view.plays], name = `haptic-${S.step}`;
  const keep = (file, type, content) => { save(file, type, content); note(t("shared_saved", { file })); };
  if (!results[view.plays]?.channels) { note(t("shared_not")); return; }
  if (kind === "link") {
    const link = location.href;
    try { await navigator.clipboard.writeText(link); note(t("shared_link")); } catch { note(t("shared_link_shown", { link })); }
  } else if (kind === "svg") keep(`${name}.svg`, "image/svg+xml", picture(charts.map(({ host }) => host), t(`${S.step}_head`)).text);
  else if (kind === "png") keep(`${name}.png`, "image/png", await png(picture(charts.map(({ host }) => host), t(`${S.step}_head`))));
  else if (kind === "csv") {
    const csv = isLive ? live.csv() : (await drives.ask(jobOf(settings, { csv: true, steps: 1e6 }))).csv;
    if (csv) keep(`${name}.csv`, "text/csv", csv); else note(t("shared_not"));
  } else {
    const road = dropped.has(settings.course) ? ` ${t("share_road_note", { name: settings.course })}` : "";
    const law = settings.law ?? "shipping", what = isLive ? "share_person_note" : law === "own" ? "share_own_note" : law === "shipping" ? "share_toml_note" : "share_law_note";
    note(t(what) + road);
    save(`${name}.toml`, "text/plain", scenario(settings) + (isLive ? "" : lawNote(settings)));
  }
}

async function take(file) {
  const name = file.name.replace(/[\r\n]/g, " "), text = await file.text();
  try {
    const length_m = lab.course(name, text);
    drives.course(name, text);
    live.end();
    [live.asked, live.note] = ["", t("road_took", { name, km: (length_m / 1000).toFixed(1) })];
    if (S.step === "compare") { S.a.course = S.b.course = name; soon(); } else say({ step: "drive", course: name });
  } catch (error) { notice(t("wrong_file", { what: error.message })); }
}

function listen() {
  $("steps").replaceChildren(...ORDER.map((step, i) => el("li", {}, el("button", { type: "button", "data-step": step, onclick: () => go(step) }, i < 6 ? `${i + 1} ` : "", t(`s_${step}`)))));
  for (const node of document.querySelectorAll("[data-name]")) node.setAttribute("aria-label", t(node.dataset.name));
  for (const node of document.querySelectorAll("[data-t]")) node.textContent = t(node.dataset.t);
  $("canvas").setAttribute("aria-label", t("scene_words"));
  $("needle").setAttribute("aria-label", t("needle_name"));
  $("time").setAttribute("aria-label", t("time"));
  $("lawtext").setAttribute("aria-label", t("law_edit"));
  $("steps").setAttribute("aria-label", t("steps_name"));
  $("play").addEventListener("click", () => { clock.playing = !clock.playing; });
  $("time").addEventListener("input", () => { clock.at = Number($("time").value); });
  $("start").addEventListener("click", () => startLive());
  $("take").addEventListener("click", () => takeWheel());
  $("canvas").addEventListener("pointermove", event => { $("canvas").classList.toggle("grab", !live.going && scene.isWheel(event)); });
  $("canvas").addEventListener("pointerdown", event => { if (!live.going && scene.isWheel(event)) takeWheel(); });
  $("read").addEventListener("click", () => notice(""));
  $("road").addEventListener("change", event => { if (event.target.files[0]) take(event.target.files[0]); });
  for (const button of document.querySelectorAll("[data-share]")) button.addEventListener("click", () => share(button.dataset.share));
  addEventListener("dragover", event => event.preventDefault());
  addEventListener("drop", event => { event.preventDefault(); if (event.dataTransfer.files[0]) take(event.dataTransfer.files[0]); });
  addEventListener("hashchange", () => arrive());
  addEventListener("resize", soon);
  listenLaw();
  listenFelt();
}
function arrive() {
  const { state, odd } = fromAddress(location.hash);
  S = state;
  if ($("lawtext").value !== S.law) $("lawtext").value = S.law;
  render();
  notice(odd.length ? t("wrong_link", { what: odd.join(", ") }) : "");
}

async function begin() {
  const packed = Uint8Array.from(atob(WASM), c => c.charCodeAt(0));
  const bytes = await new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
  S = fromAddress(location.hash).state;
  lab = await engine(bytes);
  drives = new Drives(bytes, soon);
  scene = new Scene($("canvas"));
  needle = new Needle($("needle"));
  live = new LiveDrive(lab, $("canvas"));
  clock.playing = isMoving();
  listen();
  arrive();
  requestAnimationFrame(frame);
  $("opening").hidden = true;
  window.page = { lab, drives, live, frames, go, say, render, startLive, endLive, share, take, scenario, picture, png, state: () => S, results: () => results, view: () => view, charts: () => charts };
  document.body.dataset.ready = "1";
}
begin().catch(error => { $("opening").textContent = t("wrong_page", { what: error.message }); console.error(error); });
