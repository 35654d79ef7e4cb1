// A drive's settings, as a scenario for the loop and the command line; and the drives that were made of them, in workers.

const EYES = { a_1: 0.1, a_2: 0.05, a_3: 3.7 }, FIELDS = { a_1: "a_1_rad_per_m", a_2: "a_2_rad_per_m_s", a_3: "a_3" };
const PLAIN = { driver: "own", ...EYES, t_p: 0.3, k_hg: 0.5, k_d: 3, speed: 60, guided: true, k_1: 0.25, law: "shipping", fail: "none", at: 70, probe: false,
  remnant: 0, course: "paper-course", column: "hands" };
// The bar and the assist of examples/torsion-bar.toml, and what the ECU is told of them.
const BAR = `[column]
kind = "torsion-bar"
j_w_kg_m2 = 0.044
k_tb_nm_per_rad = 143.24
upper_friction_nm = 0.1
lower_friction_nm = 0.3
angle = "column"
[assist]
curve = "medium"
inject = "overlay"
`, TOLD = `torque_sensor = 1
wheel_inertia_kg_m2 = 0.044
wheel_friction_nm = 0.1
bar_stiffness_nm_per_rad = 143.24
`;
// Roads of the page's own: the first bend within 8 s at 60 km/h.
const ramp = (length, from, to) => `{length_m = ${length}, curvature_start_per_m = ${from}, curvature_end_per_m = ${to}}`;
const bend = (length, curvature) => ramp(length, curvature, curvature);
const inline = (name, segments) => `{name = "${name}", lane_width_m = 3.6, segment = [${segments.join(", ")}]}`;
const round = (radius, arc, ease) => { const c = 1 / radius; return [ramp(ease, 0, c), bend(arc, c), ramp(ease, c, 0)]; };
const COURSES = new Map([
  ["paper-course", null],
  ["bends", inline("bends", [bend(70, 0), ...round(300, 220, 80), bend(60, 0), ...round(-350, 240, 80), bend(60, 0), ...round(450, 300, 90),
    bend(60, 0), ...round(-300, 220, 80), bend(300, 0)])],
  ["winding", inline("winding", [bend(60, 0), ...[200, -250, 180, -220, 260, -180].flatMap(radius => [...round(radius, 70, 60), bend(20, 0)]), bend(200, 0)])],
]);
const dropped = new Map();

// The paper's drivers lie on this line: who relies on the guidance looks less at the road.
const onLine = k_hg => ({ k_hg, k_d: 2 + 2 * k_hg });

const hasBar = settings => settings.column === "bar";

function scenario(given, { person = false } = {}) {
  const s = { ...PLAIN, ...given };
  const course = COURSES.get(s.course) ?? JSON.stringify(s.course);
  let text = `course = ${course}\nspeed_m_per_s = ${s.speed / 3.6}\ncondition = "${s.guided ? "mid" : "manual"}"\n`;
  if (!person) {
    text += `[driver]\nt_p_s = ${s.t_p}\nremnant_sd_nm = ${s.remnant}\n`;
    for (const [gain, plain] of Object.entries(EYES)) if (s[gain] !== plain) text += `${FIELDS[gain]} = ${s[gain]}\n`;
    text += s.guided ? `k_d_nm_per_rad = ${s.k_d}\nk_hg = ${s.k_hg}\n` : `k_d_nm_per_rad = 4\n`;
  }
  if (s.guided) {
    text += `[guidance]\nk_1_nm = ${s.k_1}\nprobe = ${s.probe}\n${hasBar(s) ? TOLD : ""}`;
    if (s.fail !== "none" && !person) text += `[failure]\nkind = "${s.fail}"\ntime_s = ${s.at}\n`;
  }
  return hasBar(s) ? text + BAR : text;
}
const isPaper = settings => (settings.course ?? PLAIN.course) === "paper-course";
// What the command line measures: the first curve of the paper's course, or all of another one.
const windowOf = settings => isPaper(settings) ? [1080, 1740] : [0, 1e6];

class Drives {
  #workers = new Map(); #done = new Map(); #bytes; #changed; #waiting = new Map();
  names = [];

  constructor(bytes, changed) {
    this.#bytes = bytes;
    this.#changed = changed;
    this.#worker("");
  }

  #worker(law) {
    if (this.#workers.has(law)) return this.#workers.get(law);
    const text = (law ? `self.makeLaw = function () { "use strict";\n${law}\nreturn law; };\n` : "") + WORKER;
    const url = URL.createObjectURL(new Blob([text], { type: "text/javascript" }));
    const worker = new Worker(url), state = { worker, alive: performance.now(), jobs: [], law };
    worker.onmessage = ({ data }) => this.#hear(state, data);
    // A law that is no JavaScript: the whole text is refused.
    worker.onerror = event => {
      event.preventDefault();
      this.#drop(state, { what: (event.message ?? "").replace(/^Uncaught /, ""), line: event.lineno ? event.lineno - 1 : null });
    };
    worker.postMessage({ bytes: this.#bytes, courses: [...dropped], askLaws: !law });
    // One law at a time: the last one's worker goes.
    if (law) for (const [other, old] of this.#workers) if (other) { old.worker.terminate(); this.#workers.delete(other); }
    this.#workers.set(law, state);
    return state;
  }

  #hear(state, data) {
    state.alive = performance.now();
    if (data.alive) return;
    if (data.laws) { this.names = data.laws; this.#changed(); return; }
    if (data.broken) { this.#drop(state, { what: data.broken, line: data.line }); return; }
    state.jobs = state.jobs.filter(job => job.key !== data.key);
    const waiting = this.#waiting.get(data.key);
    if (waiting) { this.#waiting.delete(data.key); waiting(data); return; }
    this.#done.set(data.key, data);
    // The oldest go: a drive has some megabytes.
    while (this.#done.size > 30) this.#done.delete(this.#done.keys().next().value);
    this.#changed();
  }

  // A worker that cannot go on: its drives end with the reason.
  #drop(state, fault) {
    state.worker.terminate();
    this.#workers.delete(state.law);
    for (const job of state.jobs) this.#done.set(job.key, { key: job.key, fault });
    state.jobs = [];
    this.#changed();
  }

  // A law that does not come back is ended; a worker that merely has not been heard for the page's own sleep is not.
  #watch(state) {
    const silent = () => state.law && state.jobs.length && performance.now() - state.alive > 3000;
    const look = () => {
      if (!this.#workers.has(state.law) || this.#workers.get(state.law) !== state || !state.jobs.length) { state.watched = false; return; }
      if (!silent()) { setTimeout(look, 500); return; }
      setTimeout(() => silent() ? this.#drop(state, { what: t("law_endless"), line: null }) : look(), 1000);
    };
    if (!state.watched) { state.watched = true; setTimeout(look, 500); }
  }

  job(settings, { law = "", steps = 107000, csv = false } = {}) {
    const toml = scenario(settings), text = settings.law === "own" ? law : "";
    const { law: name = "shipping", sweep } = settings;
    return { key: JSON.stringify([toml, name, text, steps, csv, sweep]), toml, law: name, text, steps, csv, sweep, window: windowOf(settings) };
  }

  // These drives are wanted, in this order, and no others any more; those that are there.
  want(jobs) {
    const byLaw = new Map([...this.#workers.keys()].map(law => [law, []]));
    for (const job of jobs) {
      if (this.#done.has(job.key)) { const kept = this.#done.get(job.key); this.#done.delete(job.key); this.#done.set(job.key, kept); continue; }
      if (!byLaw.has(job.text)) byLaw.set(job.text, []);
      byLaw.get(job.text).push(job);
    }
    for (const [law, list] of byLaw) {
      if (!list.length && !this.#workers.get(law)?.jobs.length) continue;
      const state = this.#worker(law);
      const asked = state.jobs.filter(job => this.#waiting.has(job.key));
      state.jobs = [...asked, ...list];
      state.alive = performance.now();
      state.worker.postMessage({ jobs: state.jobs });
      this.#watch(state);
    }
    return jobs.map(job => this.#done.get(job.key) ?? null);
  }

  // One thing, whatever else is wanted.
  ask(job) {
    const state = this.#worker(job.text ?? "");
    state.jobs = [...state.jobs, job];
    state.worker.postMessage({ jobs: state.jobs });
    return new Promise(done => this.#waiting.set(job.key, done));
  }

  course(name, text) {
    dropped.set(name, text);
    for (const { worker } of this.#workers.values()) worker.postMessage({ course: [name, text] });
  }
}
