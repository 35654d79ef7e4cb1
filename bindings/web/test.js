// Run in the page by `cargo xtask web`; returns a line for each check. EXPECTED: probe.toml, its run.csv and results.json, the
// same of bar.toml, the results.json of an evaluation, all of the command line; and examples/torsion-bar.toml.
const report = [], [toml, csv, ran, bar_toml, bar_csv, bar_ran, evaluated, bar_example] = EXPECTED, evaluation = JSON.parse(evaluated);
const check = (name, good, what) => report.push(`${good ? "ok" : "FAILED"} ${name}: ${what}`);
const $ = id => document.getElementById(id), pause = ms => new Promise(done => setTimeout(done, ms));
async function until(what, good) {
  for (let k = 0; k < 1200 && !good(); k++) await pause(50);
  if (!good()) throw new Error(`waited in vain: ${what}; the page says: ${$("wrong").textContent} ${$("lawsaid").textContent}`);
}
// What a reader does: a step by its button, a slider by its input, a key.
const visit = async step => {
  document.querySelector(`[data-step=${step}]`).click();
  await settled(step);
  const show = document.querySelector("#ask:not([hidden]) [data-guess=shown]");
  if (show) { show.click(); await settled(step); }
};
const settled = async step => { await pause(60); await until(step, () => document.body.dataset.done === step); };
const slide = async (id, value) => { const input = $(id); input.value = value; input.dispatchEvent(new Event("input")); await settled(page.state().step); };
const said = () => $("said").textContent;

// Every number of the command line's record that the page shows. The sines of a browser and of a system may differ in the
// last bit, and so may a mean of thousands of samples; no digit of a log does.
const close = (ours, theirs) => Object.is(ours, theirs) || Math.abs(ours - theirs) <= 1e-12 * Math.abs(theirs);
let compared = 0, exact = 0;
const differ = (metrics, expected) => SHOWN.filter(key => {
  compared++;
  exact += Object.is(metrics[key], expected[key]);
  return !close(metrics[key], expected[key]);
});
const SHOWN = ["peak_lateral_error_m", "mean_abs_lateral_error_m", "peak_lateral_error_after_failure_m", "mean_abs_driver_torque_nm",
  "mean_abs_guidance_torque_nm", "conflict_time_share"];
const record = (t_p, condition, failure = "none") => evaluation.runs.find(run => run.t_p === t_p && run.condition === condition && run.failure === failure);
function same(name, pairs, word) {
  const wrong = pairs.flatMap(([drive, expected]) => differ(page.results()[drive].metrics, expected).map(key => `${drive}.${key}`));
  check(name, !wrong.length && (!word || said().includes(word.toFixed(2))), `${pairs.length} drives by ${SHOWN.length} numbers, differing: ${wrong.join(" ") || 0}; "${said()}"`);
}

async function story() {
  await settled("loop");
  const bend = page.results().now.channels, now_s = Number($("time").value);
  check("opens in a bend", now_s > 66 && bend.s[Math.round(200 * now_s)] > 1080, `at ${now_s} s; ${said()}`);
  same("step 1", [["now", record(0.3, "mid")]]);
  // A guess before any figure: slow drivers get less far from the middle with guidance, 0.157 m beside 0.225 m in the paper's bend.
  document.querySelector("[data-step=guidance]").click();
  await settled("guidance");
  const covered = getComputedStyle($("charts")).display === "none" && said() === "" && !$("ask").hidden;
  document.querySelector("[data-guess=more]").click();
  await settled("guidance");
  check("a guess first", covered && getComputedStyle($("charts")).display !== "none" && said().startsWith("Your guess, clearly further; here it is clearly less far."), said());
  await slide("c-t_p", 0.1);
  check("the guess follows", said().startsWith("Your guess, clearly further; here it is about as far"), said());
  await slide("c-t_p", 0.2);
  check("a later driver", said().includes("acts 0.20 s late"), said());
  await slide("c-t_p", 0.5);
  same("step 2", [["alone", record(0.5, "manual")], ["guided", record(0.5, "mid")]], record(0.5, "mid").peak_lateral_error_m);
  await visit("reliance");
  const figure8 = [];
  for (const [k_hg, condition] of [[0, "high"], [1, "low"], [0.5, "mid"]]) {
    await slide("c-k_hg", k_hg);
    for (const t_p of [0.1, 0.3, 0.5]) {
      for (const [drive, expected] of [[`now${t_p}`, record(t_p, condition)], [`alone${t_p}`, record(t_p, "manual")]])
        figure8.push(...differ(page.results()[drive].metrics, expected));
    }
  }
  check("step 3 is figure 8", figure8.length === 0 && document.querySelectorAll(".plot .line.faint").length >= 6, `18 drives, differing numbers: ${figure8.length}; ${document.querySelectorAll("svg .line.faint").length} faint lines; "${said()}"`);
  await visit("failure");
  for (const key of ["ArrowRight", "ArrowLeft"]) {
    document.querySelector(".handle").dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true }));
    await settled("failure");
    if (key === "ArrowRight") check("the instant moves", page.state().at === 70.5 && said().includes("70.5"), said());
  }
  const ends = [];
  for (const key of ["Home", "End"]) {
    document.querySelector(".handle").dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true }));
    await pause(60);
    ends.push(page.state().at);
  }
  check("Home and End", ends.join() === "64,100", ends.join());
  page.say({ at: 70 });
  await pause(60);
  await settled("failure");
  instantAt70();
  same("step 4 is figure 9", [0.1, 0.3, 0.5].flatMap(t_p => ["high", "mid", "low"].map(condition => [condition + t_p, record(t_p, condition, "torque")])),
    record(0.5, "high", "torque").peak_lateral_error_after_failure_m);
  await visit("handover");
  await slide("c-k_hg", 0);
  same("step 5", [["handed", record(0.5, "high", "input")], ["sudden", record(0.5, "high", "torque")], ["none", record(0.5, "high")]],
    record(0.5, "high", "input").peak_lateral_error_after_failure_m);
}

// The picture of all instants: at 70 s the command line's peaks, where these come within 8 s of the failure.
function instantAt70() {
  const of = name => page.results()[`all_${name}`].peaks, k = of("high").at.indexOf(70), want = (condition, failure) => record(0.5, condition, failure).peak_lateral_error_after_failure_m;
  const pairs = ["high", "mid"].map(name => [of(name).torque[k], want(name, "torque")]);
  check("every instant at 70 s", pairs.every(([ours, theirs]) => close(ours, theirs)) && of("high").at.at(-1) === 100, pairs.flat().map(peak => peak.toFixed(4)).join(" "));
}

// Another instant, from the samples of a drive that fails there; and what is said of a handover follows from the picture.
async function handovers() {
  await visit("handover");
  // What a sudden loss adds is beside a drive without one: of 0.23 m a handover saves 0.17 m.
  await slide("c-k_hg", 0.5);
  page.say({ at: 70, guess: ["handover.some"] });
  await settled("handover");
  const [sudden, handed] = ["torque", "input"].map(kind => record(0.5, "mid", kind).peak_lateral_error_after_failure_m), none = record(0.5, "mid").peak_lateral_error_m;
  check("what a handover saves", sudden - handed > 0.5 * (sudden - none) && said().includes("here it is more than half") && said().includes(`adds ${(sudden - none).toFixed(2)} m`), said());
  // At 96 s the bend is over: what was further off before is no part of it.
  await slide("c-at", 96);
  const calm = page.results().none.channels, largest = from => Math.max(...[...calm.error].filter((_, i) => calm.time[i] >= from && calm.s[i] <= 1740).map(Math.abs));
  check("after the bend", largest(96) < 0.5 * none && said().includes(`${largest(96).toFixed(2)} m from then on`), said());
  page.say({ at: 70 });
  await settled("handover");
  const { at, torque, input } = page.results().all.peaks, where = [];
  for (const [kind, peaks] of [["torque", torque], ["input", input]]) {
    for (const instant of [66, 90]) {
      const { channels } = await page.drives.ask(page.drives.job({ ...page.view().drives.none, fail: kind, at: instant }));
      const peak = Math.max(...[...channels.error].filter((_, i) => channels.time[i] > instant && channels.time[i] <= instant + 8).map(Math.abs));
      if (!close(peaks[at.indexOf(instant)], peak)) where.push(`${kind} at ${instant} s: ${peaks[at.indexOf(instant)]} for ${peak}`);
    }
  }
  check("every instant, from samples", !where.length, where.join("; "));
  const no_better = at.filter((_, i) => torque[i] - input[i] < 0.005), [, told] = /at once at (.*?)\./.exec(said());
  const said_at = told.split(", ").flatMap(part => { const [from, to = from] = part.match(/\d+/g).map(Number); return at.filter(instant => instant >= from && instant <= to); });
  check("where a handover is no better", no_better.join() === said_at.join() && no_better.includes(90) && !no_better.includes(84), told);
}

async function probe() {
  await visit("probe");
  await slide("c-k_hg", 0.8);
  const { now } = page.results().now, digits = now.deviation >= 0.095 ? 1 : 2;
  check("step 6", Math.abs(now.k_hg - 0.8) < 2 * now.deviation && said().includes(`${now.k_hg.toFixed(digits)} ± ${now.deviation.toFixed(digits)}`), said());
  const resists = said();
  await slide("c-k_hg", 0.5);
  const either = said();
  await slide("c-k_hg", 0);
  check("what the ECU can tell", resists.includes("resists the guidance more than not") && either.includes("cannot tell") && said().includes("relies on the guidance more than not") && /after 15 s, .* after 60 s/.test(said()), said());
  await slide("c-k_hg", 0.8);
  // The same scenario as the command line, by the page's own words.
  const settings = { t_p: 0.3, k_d: 2.4, k_hg: 0.2, remnant: 0.1, probe: true, fail: "input", at: 72.5 };
  check("scenario file", page.scenario(settings) === toml, "as probe.toml");
  const job = page.drives.job(settings, { steps: 1e6, csv: true }), drive = await page.drives.ask(job);
  const [ours, theirs] = [drive.csv.trimEnd().split("\n"), csv.trimEnd().split("\n")], expected = JSON.parse(ran);
  const differing = theirs.filter((line, i) => line !== ours[i]).length + Math.abs(ours.length - theirs.length);
  const numbers = differ(drive.metrics, expected);
  check("command line", differing === 0 && !numbers.length, `${theirs.length} lines of run.csv, ${differing} differ; ${SHOWN.length} metrics, ${numbers.length} differ`);
  check("bits", exact > 0.8 * compared, `${exact} of ${compared} numbers are the same to the bit, the others within 1e-12`);
  check("live K_hg", Object.is(drive.now.k_hg, expected.k_hg.k_hg) && Object.is(drive.now.deviation, expected.k_hg.deviation),
    `${drive.now.k_hg} and ${expected.k_hg.k_hg}, deviation ${drive.now.deviation}`);
}

async function compare() {
  await visit("compare");
  const { a, b } = page.results();
  const marks = document.querySelectorAll(".plot").length;
  check("two drives", [a, b].every(drive => said().includes(`${drive.metrics.peak_lateral_error_m.toFixed(2)} m`)) && [...document.querySelectorAll(".plot")].every(plot => plot.querySelector(".mark.failure")), `${said()} ${marks} plots with the failure marked`);
  const driver = $("c-adriver");
  driver.value = "8";
  driver.dispatchEvent(new Event("change"));
  await settled("compare");
  // Table 6, participant 5.
  const { a_1, a_3, t_p, k_d, k_hg } = page.state().a;
  check("a participant", JSON.stringify([a_1, a_3, t_p, k_d, k_hg]) === "[0.06,3.637,0.229,4.056,0.926]" && page.results().a !== a, said());
  const link = location.hash, before = said(), told = [];
  for (const kind of ["link", "svg", "png", "csv", "toml"]) { await page.share(kind); told.push($("shared").textContent); }
  check("taken along", told[0].includes("link") && told[4].includes("to the bit"), told.join(" | "));
  await visit("loop");
  location.hash = link;
  await settled("compare");
  check("a link shows the same", said() === before, link);
  location.hash = "#step=compare&a.k_hg=-7&b.at=soon&c.x=1&a.fail=fire";
  await pause(100);
  check("a broken link", ["a.k_hg", "b.at", "c.x", "a.fail"].every(name => $("noticed").textContent.includes(name)), $("noticed").textContent);
  await slide("c-ak_hg", 0.3);
  check("a notice stays", !$("notice").hidden, $("noticed").textContent);
  $("read").click();
  check("a notice that is read goes", $("notice").hidden, "");
  location.hash = "#step=compare&a.law=magic&b.course=nowhere.xodr";
  await until("a refusal", () => ["nowhere.xodr", "magic"].every(what => $("wrong").textContent.includes(what)));
  await settled("compare");
  check("a link to what is not here", said() === "" && !document.querySelector(".plot polyline:not([points=''])") && $("figures").hidden, $("wrong").textContent);
  location.hash = link;
  await settled("compare");
  const drawn = page.picture(page.charts().map(({ host }) => host), "A and B");
  const parsed = new DOMParser().parseFromString(drawn.text, "image/svg+xml"), pixels = await page.png(drawn);
  check("pictures", !parsed.querySelector("parsererror") && parsed.querySelectorAll("polyline").length === 8 && !drawn.text.includes("var(") && pixels.size > 5000,
    `SVG of ${drawn.text.length} bytes, PNG of ${pixels.size} bytes`);
}

// A drive through a torsion bar, beside the command line's; and A with one, chosen and left again.
async function bar() {
  const settings = { t_p: 0.3, k_d: 3, k_hg: 0.5, remnant: 0.1, probe: true, column: "bar" }, text = page.scenario(settings);
  const told = bar_example.split("\n").filter(line => / = /.test(line) && !line.startsWith("condition")).map(line => line.replace(/ #.*/, "").trim());
  check("a bar's scenario file", text === bar_toml && told.every(line => text.split("\n").includes(line)), `as bar.toml, with the ${told.length} values of examples/torsion-bar.toml`);
  const { csv: ours, channels, metrics, now } = await page.drives.ask(page.drives.job(settings, { steps: 1e6, csv: true })), expected = JSON.parse(bar_ran);
  const lines = bar_csv.trimEnd().split("\n"), names = lines[0].split(","), of = name => lines.slice(1).map(line => Number(line.split(",")[names.indexOf(name)]));
  const differing = ours.trimEnd().split("\n").filter((line, i) => line !== lines[i]).length;
  // Behind a bar the peak is held in roundings of a coordinate: of the road's 2 to 4 km one is 2^-41 m, a relative error of 7e-13 of this peak.
  const others = differ(metrics, expected).filter(key => key !== "peak_lateral_error_m" || !(Math.abs(metrics[key] - expected[key]) <= 4 * 2 ** -41));
  check("command line, bar", differing === 0 && names.includes("bar_torque_nm") && !others.length && Object.is(now.k_hg, expected.k_hg.k_hg), `${lines.length} lines of run.csv, ${differing} differ; K_hg ${now.k_hg}; ${others}`);
  // The page's lines beside the columns of the command line's log: a digit of rounding; noise and lag of the sensor; the ECU's delay and the steps of its angle.
  const far = (channel, column) => { const theirs = of(column); return [...channels[channel]].map((value, i) => value - theirs[i]); }, most = (channel, column) => Math.max(...far(channel, column).map(Math.abs));
  // Of each second the mean: without noise, steps and delay.
  const slow = channel => { const off = far(channel, "driver_torque_nm"), means = []; for (let i = 0; i + 200 <= off.length; i += 200) means.push(off.slice(i, i + 200).reduce((sum, value) => sum + value / 200, 0)); return Math.hypot(...means) / Math.sqrt(means.length); };
  check("lines of the bar", most("driver", "driver_torque_nm") < 1e-5 && most("assist", "assist_torque_nm") < 1e-5 && most("read", "bar_torque_nm") < 0.1 && slow("taken") < 0.5 * slow("read"),
    `sensor at most ${most("read", "bar_torque_nm").toFixed(3)} N.m from T_tb; off the hands, by means of a second, by ${slow("read").toFixed(3)} N.m, the ECU by ${slow("taken").toFixed(3)} N.m`);
  location.hash = "#step=compare";
  await pause(100);
  await settled("compare");
  const { a } = page.results(), plain = said(), press = async name => { [...document.querySelectorAll(".of-a .chip")].find(chip => chip.textContent === name).click(); await settled("compare"); };
  check("no bar at first", !page.scenario(page.state().a).includes("[column]") && !page.scenario(page.state().a).includes("torque_sensor") && document.querySelectorAll(".plot").length === 4 && !Number.isFinite(a.channels.assist[0]), plain);
  await press("torsion bar");
  const chip = document.querySelector(".of-a [aria-pressed=true]"), plots = [...document.querySelectorAll(".plot svg")].map(plot => plot.getAttribute("aria-label"));
  check("a bar is chosen", location.hash.includes("a.column=bar") && chip.textContent === "torsion bar" && chip.parentElement.parentElement.getAttribute("aria-label").includes("torsion bar") && plots.length === 5
    && ["assist", "hands, as the ECU takes them", "bar's sensor", "hands (truth)"].every(name => plots[4].includes(`${name}: at most`)) && /sensor is off the hands' torque by 0\.\d\d N\.m/.test(said()) && said().includes("Left out"), said());
  const link = location.hash, through = said();
  await press("sensor of the hands");
  check("no bar again", page.results().a === a && said() === plain && !location.hash.includes("column") && document.querySelectorAll(".plot").length === 4, location.hash);
  location.hash = link;
  await pause(100);
  await settled("compare");
  check("a link has the bar", said() === through && page.state().a.column === "bar" && page.state().b.column === "hands", link);
  location.hash = "#step=compare&a.column=bar&a.guided=false&b.column=steel";
  await pause(100);
  await settled("compare");
  check("a bar by hand", said().includes("no ECU listens") && !plots.at(-1).includes("NaN") && document.querySelectorAll(".plot:nth-child(5) polyline").length === 3 && $("noticed").textContent.includes("b.column"), said());
  $("read").click();
}

// Equations (7) and (8) at 1 kHz with a delay of whole milliseconds, and a hand that trembles: a driver whom nobody told the
// page of.
function synthetic({ t_p_ms, a_1, a_2, a_3, k_d, k_nms, t_nms, tremble_nm }) {
  const seen = [];
  let integral = 0, torque = 0, noise = 0, seed = 2463534242;
  // Xorshift of 32 bits.
  const uniform = () => {
    seed ^= seed << 13; seed ^= seed >>> 17; seed ^= seed << 5;
    return (seed >>> 0) / 4294967296;
  };
  const gauss = () => Math.sqrt(-2 * Math.log(uniform() + 1e-12)) * Math.cos(2 * Math.PI * uniform());
  const decay = Math.exp(-2 * Math.PI * 0.5 * 1e-3);
  return now => {
    integral += 1e-3 * now.e_y_m;
    seen.push(a_1 * now.e_y_m + a_2 * integral + a_3 * now.e_theta_rad);
    const target = seen[seen.length - 1 - t_p_ms] ?? 0;
    torque += 1e-3 / t_nms * (k_d * target + k_nms * (target - now.wheel_angle_rad) - torque);
    noise = decay * noise + tremble_nm * Math.sqrt(1 - decay * decay) * gauss();
    return torque + noise;
  };
}

async function drive() {
  const { live } = page, truth = { t_p_ms: 280, a_1: 0.1, a_2: 0.05, a_3: 3.7, k_d: 4, k_nms: 1, t_nms: 0.1, tremble_nm: 0.1 };
  const click = async id => { $(id).click(); await pause(30); };
  const found = async () => { const before = document.body.dataset.found; await until("an identification", () => document.body.dataset.found !== before); return $("found").textContent; };
  // A hand on the wheel of the first screen drives.
  await visit("loop");
  const screen = $("canvas").getBoundingClientRect(), on = (name, up) => $("canvas").dispatchEvent(new PointerEvent(name, { clientX: screen.left + 0.5 * screen.width, clientY: screen.bottom - up, bubbles: true }));
  on("pointerdown", screen.height - 20);
  await pause(100);
  const aside = page.state().step;
  on("pointerdown", 40);
  await pause(200);
  check("the wheel is grabbed", aside === "loop" && page.state().step === "drive" && live.going, `${aside}, ${page.state().step}`);
  $("start").click();
  await until("the end of it", () => document.body.dataset.found);
  document.querySelector("[data-step=drive]").click();
  await pause(100);
  // Pointer over the picture, in the page's own time.
  await click("start");
  const box = $("canvas").getBoundingClientRect();
  $("canvas").dispatchEvent(new PointerEvent("pointermove", { clientX: box.left + 0.4 * box.width, clientY: box.top + 50 }));
  await until("half a second", () => live.now().time_s > 0.5);
  check("pointer", live.now().wheel_angle_rad > 0.02, `after ${live.now().time_s.toFixed(1)} s the wheel is at ${live.now().wheel_angle_rad.toFixed(3)} rad`);
  let waits = found();
  await click("start");
  const short = await waits;
  check("too short a drive", short.includes("10 s"), short);
  // The road bends within 8 s.
  const channels = live.result().road, bend_m = 2 * [...channels].findIndex((value, i) => i % 4 === 3 && Math.abs(value) > 1e-4) / 4;
  check("the first bend", bend_m / (60 / 3.6) < 8, `${(bend_m / (60 / 3.6)).toFixed(1)} s from the start`);

  page.say({ course: "paper-course" });
  await pause(60);
  // A whole drive by a driver whose delay is known; then guided; then with a failure that nobody announced.
  const command_line = /--|\bline \d|_nm\b|_rad\b|_m\b|CSV|\blog\b/;
  const whole = async (guided, give, steps = 1e6) => {
    page.say({ guided });
    await pause(60);
    page.startLive(give);
    live.going = false;
    live.advance(steps);
    waits = found();
    page.endLive();
    return waits;
  };
  const own = await whole("off", synthetic(truth)), log = live.csv();
  const t_p = page.lab.identify(log, true).parameters.find(p => p.name === "t_p").found;
  check("synthetic driver", t_p.identified && Math.abs(t_p.estimate - 0.28) < 0.02 && own.includes(t_p.estimate.toFixed(2)), `t_p ${t_p.estimate?.toFixed(4)} s, truth 0.280 s; ${own}`);
  const left = await whole("off", now => now.time_s < 20 ? 0 : 4);
  check("off the road", /At \d+\.\d s .*beyond/.test(left) && !command_line.test(left), left);
  const nobody = await whole("on", () => 0, 60000);
  check("nobody's hands", /nobody held the wheel|cannot be told|does not fit/.test(nobody) && !command_line.test(nobody), nobody);
  await whole("surprise", synthetic(truth));
  const failed = live.failed_s, torques = live.result().channels;
  // A sample holds the torque of the millisecond before it, which may have begun before the failure.
  const after = torques.guidance.filter((_, i) => torques.time[i] > failed + 1e-3);
  check("a failure unannounced", failed >= 12 && failed <= 52 && after.every(nm => nm === 0), `at ${failed.toFixed(1)} s`);

  // A page in the background, and a machine at a quarter of real time.
  page.say({ guided: "on" });
  await pause(60);
  page.startLive(() => 0);
  live.frame(0); live.frame(16);
  const before = live.now().time_s;
  live.frame(3600000);
  check("an hour in the background", live.now().time_s === before && live.told.includes("Paused"), live.told);
  for (let k = 1; k < 12; k++) live.frame(3600000 + 480 * k);
  check("a slow machine", live.told.includes("% of real time"), live.told);
  live.end();
}

// A wheel that nobody built: inertia, friction of both kinds, a motor that answers late, and reports of seven bytes.
class FakeWheel {
  productName = "Fake wheel"; vendorId = 0x046d; opened = false; collections = [{ outputReports: [{ reportId: 0, items: [{ reportSize: 8, reportCount: 7 }] }] }];
  reports = []; time_ms = 0; angle = 0; rate = 0; #under_way = []; #level = 0;
  constructor({ inertia = 0.03, viscous = 0.1, coulomb = 0.05, motor_nm = 2.5, late_ms = 8, way = 1 } = {}) { Object.assign(this, { inertia, viscous, coulomb, motor_nm, late_ms, way }); }
  async open() { this.opened = true; }
  async close() { this.opened = false; }
  async sendReport(id, bytes) {
    this.reports.push({ id, bytes: [...bytes], time_ms: this.time_ms });
    this.#under_way.push([this.time_ms + this.late_ms, bytes[0] === 0x11 && bytes[1] === 0x08 ? (bytes[2] - 0x80) / 127 : 0]);
  }
  step() {
    this.time_ms++;
    while (this.#under_way.length && this.#under_way[0][0] <= this.time_ms) this.#level = this.#under_way.shift()[1];
    const turned = this.rate + 1e-3 / this.inertia * (this.way * this.motor_nm * this.#level - this.viscous * this.rate), rubbed = 1e-3 * this.coulomb / this.inertia;
    this.rate = Math.sign(turned) * Math.max(0, Math.abs(turned) - rubbed);
    this.angle += 1e-3 * this.rate;
  }
}
const levels = fake => fake.reports.filter(({ bytes }) => bytes[0] === 0x11).map(({ bytes }) => bytes[2] - 0x80);
// So many seconds of 60 pictures, nobody's hands on the wheel; the levels of each picture.
async function felt_drive(fake, seconds, hold = true) {
  const given = [];
  Object.defineProperty(navigator, "hid", { configurable: true, value: { requestDevice: async () => [fake], addEventListener: (_, heard) => { fake.unplug = () => heard({ device: fake }); } } });
  Object.defineProperty(navigator, "getGamepads", { configurable: true, value: () => [{ connected: true, id: "Fake racing wheel", axes: [-fake.angle / HAND.wheel_rad] }] });
  await felt.connect();
  page.startLive();
  for (let k = 0; k < 60 * seconds && page.live.going; k++) {
    if (k === 1 && hold) document.body.dispatchEvent(new KeyboardEvent("keydown", { key: " ", bubbles: true }));
    while (fake.time_ms < k * 1000 / 60) fake.step();
    liveFrame(k * 1000 / 60);
    given.push(felt.level);
    for (let n = 0; n < 8; n++) await null;
  }
  return given;
}
async function feltWheel() {
  page.go("drive");
  page.say({ course: "bends", guided: "on", speed: 60 });
  await pause(200);
  for (const way of [1, -1]) {
    const fake = new FakeWheel({ way });
    await felt_drive(fake, 12);
    const all = levels(fake), apart = Math.abs(fake.angle - page.live.now().wheel_angle_rad), steps = all.slice(1).map((level, i) => Math.abs(level - all[i]));
    check(`a wheel whose motor turns it ${way > 0 ? "left" : "right"}`, fake.reports[0].bytes[0] === 0xf5 && Math.max(...all.map(Math.abs)) <= 51 && Math.max(...all.map(Math.abs)) > 5 && Math.max(...steps) <= 6 && apart < 0.2
      && Math.abs(page.live.now().wheel_angle_rad) > 0.05, `${all.length} reports, largest level ${Math.max(...all.map(Math.abs))} of 127, largest step ${Math.max(...steps)}, ${apart.toFixed(3)} rad from the wheel of the model at ${page.live.now().wheel_angle_rad.toFixed(3)} rad`);
    document.body.dispatchEvent(new KeyboardEvent("keyup", { key: " ", bubbles: true }));
    for (let n = 0; n < 20; n++) await null;
    check("let go", fake.reports.at(-1).bytes[0] === 0x13, fake.reports.at(-1).bytes.join(" "));
    const count = fake.reports.length;
    fake.unplug();
    felt.hold(true);
    felt.frame(1e6, 1, 0);
    check("unplugged", fake.reports.length === count && !felt.isThere, $("feltsaid").textContent);
    felt.hold(false);
    page.live.end();
  }
  const untouched = new FakeWheel();
  await felt_drive(untouched, 3, false);
  check("no force without the key", levels(untouched).length === 0, `${untouched.reports.length} reports`);
  page.live.end();
  const stuck = new FakeWheel({ coulomb: 5 });
  await felt_drive(stuck, 4);
  check("a wheel that does not turn", stuck.reports.at(-1).bytes[0] === 0x13 && $("feltsaid").textContent.includes("no force"), $("feltsaid").textContent);
  page.live.end();
  // A page that hangs: no picture for longer than the watch allows.
  const hung = new FakeWheel(), alone = new FeltWheel(() => {});
  Object.defineProperty(navigator, "hid", { configurable: true, value: { requestDevice: async () => [hung], addEventListener: () => {} } });
  await alone.connect();
  alone.hold(true);
  for (let k = 0; k < 3; k++) { alone.frame(performance.now(), 1, 0); await pause(16); }
  await pause(600);
  check("a page that hangs", levels(hung).length > 0 && hung.reports.at(-1).bytes[0] === 0x13, hung.reports.at(-1).bytes.join(" "));
  await feltMap();
}

// Which part of the torque stays calm on which wheel, nobody's hands on it: the turns a second of a level of more than 0.05, in the last four
// of nine seconds, which are in a bend.
async function feltMap() {
  const rows = [];
  for (const inertia of [0.02, 0.06]) {
    for (const viscous of [0.03, 0.1, 0.3]) {
      const cells = [];
      for (const part of [0.2, 0.5, 1]) {
        felt.part = part;
        const given = (await felt_drive(new FakeWheel({ inertia, viscous }), 9)).slice(-240);
        page.live.end();
        felt.hold(false);
        const calm = given.length === 240 && !page.live.now().diverged;
        let turns = 0, side = 0;
        for (const level of given) if (Math.abs(level) > 0.05 && Math.sign(level) !== side) { turns += side !== 0; side = Math.sign(level); }
        cells.push(calm ? (turns / 4).toFixed(1) : "off");
      }
      rows.push(`${inertia} kg.m2 ${viscous} N.m.s: ${cells.join(" ")}`);
    }
  }
  felt.part = 0.5;
  check("calm wheels (turns a second at 20, 50 and 100 %)", rows.filter(row => row.includes("0.3 N.m.s: 0.0 0.0")).length === 2, rows.join("; "));
}

async function law() {
  const write = async text => { const area = $("lawtext"); area.value = text; area.dispatchEvent(new Event("input")); await pause(600); await settled("law"); return $("lawsaid").textContent; };
  await visit("law");
  const { own, ship } = page.results();
  check("the law as given", Math.abs(own.metrics.peak_lateral_error_m - ship.metrics.peak_lateral_error_m) < 1e-3 && own.metrics.peak_lateral_error_m > 0, said());
  const kept = said();
  const wrong = [
    ["returns NaN", "function law(see) {\n  return see.time > 70 ? NaN : 0;\n}", ["70.00", "NaN", "went on"]],
    ["returns text", "function law(see) {\n  return 'hard';\n}", ["hard", "went on"]],
    ["throws", "function law(see) {\n  const x = 1;\n  return see.road.far;\n}", ["Line 3", "undefined"]],
    ["is no JavaScript", "function law(see) {\n  return 1 +* 2;\n}", ["Line 2", "SyntaxError"]],
    ["has another name", "function guide(see) { return 0; }", ["law is not defined"]],
    ["loops for ever", "function law(see) {\n  while (true);\n}", ["loop for ever"]],
    ["asks for too much", "function law(see) {\n  return see.time > 66 ? 1e9 : 0;\n}", ["driven"]],
  ];
  let good = page.results().own;
  for (const [name, text, words] of wrong) {
    const answer = await write(text), limited = Math.max(...page.results().own.channels.guidance);
    check(`a law that ${name}`, words.every(word => answer.includes(word)) && page.results().own.channels.time.length > 0 && limited <= 5, answer);
    if (answer.includes("last good")) check(`after a law that ${name}`, page.results().own === good, "the last good drive is there");
    else good = page.results().own;
  }
  const kept_blob = await new Promise(done => {
    const url = URL.createObjectURL;
    URL.createObjectURL = blob => { URL.createObjectURL = url; done(blob); return url.call(URL, blob); };
    page.share("toml");
  });
  const file = await kept_blob.text();
  check("a law leaves with its drive", wrong.at(-1)[1].split("\n").every(line => file.includes(`# ${line}`)) && file.split("\n").every(line => !line.includes("function") || line.startsWith("# ")), $("shared").textContent);
  $("lawreset").click();
  await pause(100);
  await settled("law");
  check("the law again", said() === kept, said());
}

async function files() {
  const wrong = async (name, text) => { await page.take(new File([text], name)); return $("noticed").textContent; };
  const broken = await wrong("broken.xodr", "<OpenDRIVE><road id='1'>"), none = await wrong("hill.toml", "lane_width_m = 30\n[[segment]]\nlength_m = 400\n");
  check("broken roads", broken.includes("broken.xodr") && none.includes("lane_width_m") && none.includes("30"), `${broken} / ${none}`);
  await page.take(new File(["lane_width_m = 3.5\n[[segment]]\nlength_m = 100\n[[segment]]\nlength_m = 600\ncurvature_per_m = 0.003\n"], "mine.toml"));
  await pause(200);
  check("a road of one's own", page.state().course === "mine.toml" && page.live.road[4 * 100 + 3] === 0.003 && $("told").textContent.includes("0.7 km"), $("told").textContent);
  let fault = "";
  try { page.lab.begin("speed_m_per_s = 900"); } catch (error) { fault = error.message; }
  check("bad input", fault.includes("speed") && fault.includes("70 m/s"), fault);
}

// The state in the address: whatever it is, it comes back; whatever else is written there, the page goes on.
async function addresses() {
  let seed = 1;
  const uniform = () => { seed = (1664525 * seed + 1013904223) % 4294967296; return seed / 4294967296; };
  const one = list => list[Math.floor(uniform() * list.length)], between = (low, high) => low + (high - low) * uniform();
  // Ends as examples/every-field.toml has them for a scenario; a participant of table 6 has t_p 0.01 s.
  const drive = () => ({ driver: one(["own", "1", "9", "17"]), a_1: between(0, 10), a_2: between(0, 10), a_3: between(0, 100), t_p: one([0.001, 0.01, between(0.001, 2), 2]),
    k_hg: one([0, between(0, 10), 10]), k_d: between(0, 50), speed: between(20, 250), guided: one([true, false]), k_1: one([0, between(0, 4), 4]),
    law: one(["shipping", "own", "band"]), fail: one(["none", "torque", "input"]), at: between(0, 1e6), probe: one([true, false]), remnant: between(0, 5),
    column: one(["hands", "bar"]), course: one(["bends", "__proto__", "a road & = #%.xodr", "\u00e4 \u2192 \n"]) });
  let kept = 0;
  for (let k = 0; k < 1000; k++) {
    const state = { step: one(["loop", "reliance", "law", "compare"]), t_p: between(0.001, 2), k_hg: between(0, 10), at: between(0, 1e6), who: one([0.1, 0.3, 0.5]),
      tried: Array.from({ length: Math.floor(4 * uniform()) }, () => between(0, 10)), part: one(["", "driver", "car", "felt"]), guess: one([[], ["failure.high"], ["probe.either", "handover.shown"]]), shown: one(["a", "b"]),
      course: one(["bends", "constructor", "x+y z"]), guided: one(["on", "off", "surprise"]), speed: between(20, 250), law: one([LAW, "", "function law() {\n  return \"&#\u20ac\";\n}"]),
      a: drive(), b: drive() };
    const address = toAddress(state), back = fromAddress(address);
    const same = (a, b) => Object.keys(a).length === Object.keys(b).length && Object.keys(a).every(key => JSON.stringify(a[key]) === JSON.stringify(b[key]));
    kept += !back.odd.length && same({ ...state, a: 0, b: 0 }, { ...back.state, a: 0, b: 0 }) && same(state.a, back.state.a) && same(state.b, back.state.b) && toAddress(back.state) === address;
  }
  check("1000 states through the address", kept === 1000, `${kept} come back`);

  const names = ["__proto__", "constructor", "toString", "hasOwnProperty", "valueOf", "a", "b", "a.__proto__", "b.constructor", "a.b.c", "step", "part", "shown", "who",
    "tried", "guess", "course", "law", "a.driver", "a.law", "a.course", "b.fail", "a.t_p", "k_hg", "guided", "", "."];
  const values = ["__proto__", "constructor", "toString", "99", "-1", "NaN", "Infinity", "1e999", "", " ", "0x10", "null", "[object Object]", "%", "<img src=x onerror=throw>",
    "a".repeat(5000), "0 0 0 0", "{t}", "$&", "\u0000"];
  const faults = [], note = event => { faults.push(event.message ?? String(event.reason)); };
  addEventListener("error", note);
  addEventListener("unhandledrejection", note);
  for (let k = 0; k < 200; k++) {
    const step = one(["loop", "reliance", "failure", "compare", "drive", "law", "probe"]);
    const said = [...Array(3)].map(() => `${encodeURIComponent(one(names))}=${encodeURIComponent(one(values))}`);
    location.hash = `#step=${step}&${said.join("&")}`;
    await pause(15);
  }
  page.go("drive");
  await pause(100);
  for (const name of ["__proto__", "constructor", "toString"]) await page.take(new File(["lane_width_m = 3.5\n[[segment]]\nlength_m = 700\n"], name));
  await pause(100);
  check("a road by any name", page.state().course === "toString" && page.live.road[3] === 0, $("told").textContent);
  location.hash = "#step=guidance&guess=guidance.shown";
  await settled("guidance");
  removeEventListener("error", note);
  removeEventListener("unhandledrejection", note);
  check("200 hostile addresses", !faults.length && said().includes("0.50 s late"), faults.slice(0, 3).join(" | ") || said());
}

return (async () => {
  for (const part of [story, handovers, probe, compare, bar, drive, feltWheel, law, files, addresses]) {
    try { await part(); } catch (error) { check(part.name, false, `${error} ${error.stack}`); }
  }
  page.go("failure");
  await settled("failure");
  page.frames.length = 0;
  await pause(1500);
  const work = [...page.frames].sort((a, b) => a - b), median = work[work.length >> 1];
  check("frames", work.length > 3 && median < 50, `${work.length} pictures, ${median.toFixed(1)} ms of work at the median`);
  return report.join("\n");
})();
