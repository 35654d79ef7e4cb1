// A worker: drives what it is asked for, one drive after the other, and tells how far it is. A worker for a law of the page's own
// has that law's text before this one, as `makeLaw`.

const CHUNK = 2000, SEEN = ["time", "e_y", "e_y_rate", "e_theta", "e_theta_rate", "driver_torque", "wheel", "wheel_rate", "speed", "k_hg"];
let lab, jobs = [], busy = false, odd = null, fault = null;

// The line of a law in which it failed: its text begins in the worker's second line.
const lineOf = error => { const at = /:(\d+):\d+/.exec(error.stack ?? ""); return at ? Number(at[1]) - 1 : null; };

function guarded(law) {
  return numbers => {
    if (fault) return 0;
    const see = {};
    SEEN.forEach((name, i) => { see[name] = numbers[i]; });
    if (Number.isNaN(see.k_hg)) see.k_hg = null;
    try {
      const asked = law(see);
      if (typeof asked === "number" && Number.isFinite(asked)) return asked;
      odd ??= { time_s: see.time, value: typeof asked === "string" ? JSON.stringify(asked.slice(0, 40)) : String(asked) };
    } catch (error) { fault = { what: String(error), line: lineOf(error), time_s: see.time }; }
    return 0;
  };
}

function begin(job) {
  odd = fault = null;
  const names = lab.laws();
  if (!["shipping", "own", ...names].includes(job.law)) throw new Error(`no law is called ${job.law}`);
  lab.begin(job.toml, { law: job.law === "own" ? names.length : names.indexOf(job.law) });
}

// What a failure costs at each of the instants, from one drive without any. Other drives go first: what was found is kept.
async function sweep(job) {
  begin(job);
  const { from, to, every, lasts, kinds } = job.sweep;
  job.peaks ??= { at: [], ...Object.fromEntries(kinds.map(kind => [kind, []])) };
  let made = 0;
  for (let at = from + every * job.peaks.at.length; at <= to; at += every) {
    const wanted = Math.round(1000 * at) - made;
    if (lab.play(wanted) < wanted) break;
    made += wanted;
    job.peaks.at.push(at);
    for (const kind of kinds) job.peaks[kind].push(lab.peakIfLost(kind, lasts));
    await new Promise(done => setTimeout(done));
    if (jobs[0] !== job) return null;
  }
  return { key: job.key, peaks: job.peaks };
}

async function run(job) {
  begin(job);
  for (let made = 0; made < job.steps && !fault;) {
    const wanted = Math.min(CHUNK, job.steps - made), did = lab.play(wanted);
    made += did;
    postMessage({ alive: job.key });
    if (did < wanted) break;
    if (made % 20000 === 0) await new Promise(done => setTimeout(done));
    if (!jobs.includes(job)) return null;
  }
  const result = { key: job.key, channels: {}, road: lab.road(2), now: lab.now(), metrics: lab.metrics(...job.window), odd, fault };
  for (const name of Object.keys(CHANNEL)) result.channels[name] = lab.channel(name);
  if (job.csv) result.csv = lab.csv();
  return result;
}

async function work() {
  if (busy || !lab) return;
  busy = true;
  while (jobs.length) {
    const job = jobs[0];
    let result;
    try { result = job.identify ? { key: job.key, found: lab.identify(job.csv, job.manual) } : job.sweep ? await sweep(job) : await run(job); }
    catch (error) { result = { key: job.key, wrong: error.message }; }
    if (result) postMessage(result, Object.values(result.channels ?? {}).map(values => values.buffer));
    if (result) jobs = jobs.filter(other => other !== job);
  }
  busy = false;
}

onmessage = async ({ data }) => {
  if (data.bytes) {
    try {
      lab = await engine(data.bytes, guarded(self.makeLaw ? makeLaw() : () => 0));
      for (const [name, text] of data.courses) lab.course(name, text);
      if (data.askLaws) postMessage({ laws: lab.laws() });
    } catch (error) { postMessage({ broken: String(error), line: lineOf(error) }); return; }
  }
  if (data.course) lab?.course(...data.course);
  // What is under way and still wanted goes on.
  if (data.jobs) jobs = data.jobs.map(job => jobs.find(other => other.key === job.key) ?? job);
  work();
};
