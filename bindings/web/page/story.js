// The steps: which drives each wants, which lines of them it draws, what it lets the reader set, and what it says of them.

const STORY_S = [62, 106], DELAYS = [0.1, 0.3, 0.5], WHO = { 0.1: "quick", 0.3: "medium", 0.5: "slow" };
const LAW = `// The shipping law, equation (9).
// Asked 1000 times a second; returns
// a torque in N.m, to the left +.
function law(see) {
  const near = 2 * see.e_y
    + 0.05 * see.e_y_rate;
  const far = 40 * see.e_theta
    + 1 * see.e_theta_rate;
  return 0.25 * (near + far);
}`;
// A centimetre and a hundredth of a newton metre: a person, a road and a car differ by more than the next digit.
const f2 = value => value === null || value === undefined ? "?" : value.toFixed(2);
const LEAST = 0.005;
// A difference of two values as they are shown: what stands beside it adds up.
const shownBy = (more, less) => Number((f2(more) - f2(less)).toFixed(2));
// A value with the digits that its standard deviation leaves.
const sure = (value, deviation) => { const digits = deviation >= 0.095 ? 1 : 2; return `${value.toFixed(digits)} ± ${deviation.toFixed(digits)}`; };
const peak = result => result?.metrics?.peak_lateral_error_m;
const after = result => result?.metrics?.peak_lateral_error_after_failure_m;
// The largest of a channel in the measured bend; or to its end, from an instant on, as after a failure.
function most({ channels }, channel, at) {
  const { s, time } = channels, [from_m, to_m] = windowOf({});
  return channels[channel].reduce((largest, value, i) => s[i] <= to_m && (at === undefined ? s[i] >= from_m : time[i] >= at) ? Math.max(largest, Math.abs(value)) : largest, 0);
}
// By how much a channel is off the hands' torque, root mean square.
const offHands = ({ channels }, channel) => Math.sqrt(channels.driver.reduce((sum, hands, i) => sum + (channels[channel][i] - hands) ** 2, 0) / channels.driver.length);
const effort = result => result?.metrics?.mean_abs_driver_torque_nm;

const error = (drive, name, kind) => ({ drive, channel: "error", name, kind });
const panel = (title, unit, lines, more = {}) => ({ title: t(title), unit, lines, ...more });
const instantOf = (s, say) => ({ x: s.at, from: 64, to: 100, name: t("at"), moved: at => say({ at }) });
const slider = (key, min, max, step, unit = "", more = {}) => ({ key, kind: "slider", min, max, step, unit, ...more });
const choice = (key, options) => ({ key, kind: "choice", options });
const DELAY = slider("t_p", 0.1, 0.5, 0.01, "s"), INSTANT = slider("at", 64, 100, 0.5, "s", { help: "at_drag" });
const RESISTS = slider("k_hg", 0, 1, 0.05, "", { low: "k_hg_low", high: "k_hg_high" });
const THREE = choice("who", DELAYS.map(t_p => [t_p, WHO[t_p]]));

// Every instant of the bend: the largest error of the eight seconds after a failure there.
const sweepOf = (...kinds) => ({ from: 64, to: 100, every: 2, lasts: 8, kinds });
const everyInstant = (s, say, lines, words) => panel("c_instants", "m", lines.map(([peaks, of, name, kind]) => ({ peaks, of, name, kind })),
  { title: t("c_instants", words), x: [64, 100], xName: t("axis_instant"), fromZero: true, still: true, mine: true, handle: instantOf(s, say) });
// Where a handover saves most, and where it is no better than to let go at once.
function ofInstants({ at, torque, input }, who) {
  const saved = at.map((_, i) => torque[i] - input[i]), best = saved.indexOf(Math.max(...saved)), worst = saved.indexOf(Math.min(...saved)), stretches = [];
  at.forEach((instant, i) => {
    if (saved[i] >= LEAST) return;
    if (i && stretches.at(-1)?.[1] === at[i - 1]) stretches.at(-1)[1] = instant; else stretches.push([instant, instant]);
  });
  const where = stretches.map(([from, to]) => from === to ? t("instant", { from }) : t("instants", { from, to })).join(", ");
  return [t("instants_best", { who, at: at[best], sudden: f2(torque[best]), handed: f2(input[best]) }), where ? t("instants_no_better", { where }) : "",
    saved[worst] <= -LEAST ? t("instants_worse", { at: at[worst], by: f2(-saved[worst]) }) : ""].join(" ").trim();
}
// Which of two is nearer to the middle; within a tenth they are alike.
const nearer = (one, other, [first, alike, second]) => one < 0.9 * other ? first : other < 0.9 * one ? second : alike;
// What the ECU's reading excludes, two standard deviations to each side.
const tellsOf = ({ k_hg, deviation }) => k_hg + 2 * deviation < 0.5 ? "relies" : k_hg - 2 * deviation > 0.5 ? "resists" : "either";
const PHASES_S = [15, 30, 60];

const STEPS = {
  loop: s => ({
    drives: { now: { t_p: 0.3 } }, plays: "now", loop: true,
    panels: [{
      driver: panel("c_torque", "N.m", [{ drive: "now", channel: "driver", name: t("driver_torque"), kind: "driver" }]),
      ecu: panel("c_torque", "N.m", [{ drive: "now", channel: "guidance", name: t("guidance_torque"), kind: "guidance" }]),
      felt: panel("c_torque", "N.m", [{ drive: "now", channel: "driver", name: t("driver_torque"), kind: "driver" }, { drive: "now", channel: "guidance", name: t("guidance_torque"), kind: "guidance" }]),
      wheel: panel("c_wheel", "deg", [{ drive: "now", channel: "wheel", scale: 180 / Math.PI, kind: "now" }]),
      road: panel("c_eyes", "m", [{ drive: "now", channel: "e_y", kind: "now" }]),
    }[s.part] ?? panel("c_error", "m", [error("now", "", "now")])],
    controls: [],
    says: ({ now }) => {
      const guidance = now.metrics.mean_abs_guidance_torque_nm;
      return t(STRINGS.en[`said_loop_${s.part}`] ? `said_loop_${s.part}` : "said_loop", { driver: f2(effort(now)), guidance: f2(guidance), peak: f2(peak(now)),
        wheel: (180 / Math.PI * most(now, "wheel")).toFixed(0), e_y: f2(most(now, "e_y")), held: f2(0.5 * guidance) });
    },
  }),
  guidance: s => ({
    drives: { guided: { t_p: s.t_p }, alone: { t_p: s.t_p, guided: false } }, plays: "guided", asks: { t_p: f2(s.t_p) },
    panels: [panel("c_error", "m", [error("alone", t("alone"), "manual"), error("guided", t("guided_line"), "now")], { least: 0.15 }),
      panel("c_torque", "N.m", [{ drive: "guided", channel: "driver", name: t("driver_torque"), kind: "driver" }, { drive: "guided", channel: "guidance", name: t("guidance_torque"), kind: "guidance" }])],
    controls: [DELAY],
    right: ({ guided, alone }) => nearer(peak(guided), peak(alone), ["less", "same", "more"]),
    says: ({ guided, alone }) => t("said_guidance", { t_p: f2(s.t_p), alone: f2(peak(alone)), guided: f2(peak(guided)), effort: f2(effort(guided)), alone_effort: f2(effort(alone)) }),
  }),
  reliance: s => {
    const drives = {}, order = [s.who, ...DELAYS.filter(t_p => t_p !== s.who)];
    for (const t_p of order) {
      drives[`now${t_p}`] = { t_p, ...onLine(s.k_hg) };
      drives[`alone${t_p}`] = { t_p, guided: false };
    }
    for (const [name, k_hg] of [["relies", 0], ["resists", 1]]) drives[name] = { t_p: s.who, ...onLine(k_hg) };
    for (const t_p of order) s.tried.forEach((k_hg, i) => { drives[`tried${i}${t_p}`] = { t_p, ...onLine(k_hg) }; });
    return {
      drives, plays: `now${s.who}`, figure: true, asks: { who: t(WHO[s.who]) },
      panels: DELAYS.map(t_p => panel("c_error", "m", [
        ...s.tried.map((k_hg, i) => error(`tried${i}${t_p}`, i ? "" : t("before_line"), "faint")),
        error(`alone${t_p}`, t("alone"), "manual"), error(`now${t_p}`, t("now_line", { k_hg: s.k_hg.toFixed(2) }), "now")],
      { title: t("panel_driver", { who: t(WHO[t_p]), t_p: t_p.toFixed(1) }), least: 0.25, mine: t_p === s.who })),
      controls: [RESISTS, THREE],
      right: r => nearer(peak(r.relies), peak(r.resists), ["relies", "same", "resists"]),
      says: r => {
        const [now, alone] = [r[`now${s.who}`], r[`alone${s.who}`]], guidance = now.metrics.mean_abs_guidance_torque_nm;
        const said = { k_hg: s.k_hg.toFixed(2), who: t(WHO[s.who]), now: f2(peak(now)), alone: f2(peak(alone)), effort: f2(effort(now)), alone_effort: f2(effort(alone)), guidance: f2(guidance),
          through: f2(guidance * Math.max(0, 1 - s.k_hg)), percent: (100 * s.k_hg).toFixed(0), t_p: s.who.toFixed(1) };
        return `${t("said_reliance", said)} ${t(s.k_hg < 0.05 ? "why_relies" : s.k_hg > 0.95 ? "why_resists" : "why_between", said)}`;
      },
    };
  },
  failure: (s, say) => {
    const drives = {}, order = [s.who, ...DELAYS.filter(t_p => t_p !== s.who)], kinds = [["high", 0], ["mid", 0.5], ["low", 1]];
    for (const t_p of order) for (const [name, k_hg] of kinds) drives[name + t_p] = { t_p, ...onLine(k_hg), fail: "torque", at: s.at };
    drives[`none${s.who}`] = { t_p: s.who, ...onLine(0) };
    for (const [name, k_hg] of kinds) drives[`all_${name}`] = { t_p: s.who, ...onLine(k_hg), sweep: name === "high" ? sweepOf("torque", "input") : sweepOf("torque") };
    const swings = r => kinds.map(([name]) => [name, after(r[name + s.who])]).sort((a, b) => b[1] - a[1]);
    return {
      drives, plays: `high${s.who}`, figure: true, asks: { who: t(WHO[s.who]), at: s.at.toFixed(1) },
      panels: [...DELAYS.map(t_p => panel("c_error", "m", ["high", "mid", "low"].map(name => error(name + t_p, t(name), name)),
        { title: t("panel_driver", { who: t(WHO[t_p]), t_p: t_p.toFixed(1) }), least: 0.65, mine: t_p === s.who, handle: instantOf(s, say), marksOf: `high${t_p}` })),
      everyInstant(s, say, [...kinds.map(([name]) => [`all_${name}`, "torque", t(name), name]), ["all_high", "input", t("high_handed"), "handed"]], { who: t(WHO[s.who]) })],
      controls: [INSTANT, THREE],
      right: r => { const all = swings(r); return all[0][1] - all.at(-1)[1] < LEAST ? "same" : all[0][0]; },
      says: r => {
        const all = swings(r), none = most(r[`none${s.who}`], "error", s.at);
        return [t("said_failure", { at: s.at.toFixed(1), t_p: s.who.toFixed(1), high: f2(after(r[`high${s.who}`])), mid: f2(after(r[`mid${s.who}`])), low: f2(after(r[`low${s.who}`])), none: f2(none) }),
          t(all[0][1] - all.at(-1)[1] < LEAST ? "failure_alike" : `failure_${all[0][0]}`), r.all_high ? ofInstants(r.all_high.peaks, t("high_short")) : ""].join("\n").trim();
      },
    };
  },
  handover: (s, say) => {
    const driver = { t_p: s.who, ...onLine(s.k_hg) }, asks = { who: t(WHO[s.who]), at: s.at.toFixed(1), k_hg: s.k_hg.toFixed(2) };
    const none = r => most(r.none, "error", s.at);
    return {
      drives: { handed: { ...driver, fail: "input", at: s.at }, sudden: { ...driver, fail: "torque", at: s.at }, none: driver, all: { ...driver, sweep: sweepOf("torque", "input") } }, plays: "handed", asks,
      panels: [panel("c_error", "m", [error("none", t("no_failure"), "manual"), error("sudden", t("sudden"), "now"), error("handed", t("handed"), "handed")], { least: 0.25, handle: instantOf(s, say), marksOf: "handed" }),
        panel("c_guidance", "N.m", [{ drive: "none", channel: "guidance", name: t("no_failure"), kind: "manual" }, { drive: "sudden", channel: "guidance", name: t("sudden"), kind: "now" }, { drive: "handed", channel: "guidance", name: t("handed"), kind: "handed" }], { marksOf: "handed" }),
        everyInstant(s, say, [["all", "torque", t("sudden"), "now"], ["all", "input", t("handed"), "handed"]], { who: `${t(WHO[s.who])}, K_hg ${s.k_hg.toFixed(2)}` })],
      controls: [INSTANT, RESISTS, THREE],
      right: r => { const added = after(r.sudden) - none(r), saved = after(r.sudden) - after(r.handed); return added < LEAST || saved < 0.1 * added ? "nothing" : saved > 0.5 * added ? "most" : "some"; },
      says: r => {
        const by = shownBy(after(r.sudden), after(r.handed)), added = shownBy(after(r.sudden), none(r)), word = by === 0 ? "handover_same" : by > 0 ? "handover_better" : "handover_worse";
        return [t("said_handover", { at: s.at.toFixed(1), sudden: f2(after(r.sudden)), handed: f2(after(r.handed)), none: f2(none(r)) }), t(added > 0 ? "handover_adds" : "handover_adds_nothing", { added: f2(added) }), t(word, { by: f2(Math.abs(by)) }),
          r.all ? ofInstants(r.all.peaks, t("high_this")) : ""].join(" ").trim();
      },
    };
  },
  probe: s => ({
    drives: { now: { t_p: 0.3, ...onLine(s.k_hg), probe: true, remnant: 0.1, course: "bends" } }, plays: "now", whole: true, starts: 8, rate: 3, needle: s.k_hg, asks: { k_hg: s.k_hg.toFixed(2) },
    panels: [panel("c_k_hg", "0 to 1", [{ truth: s.k_hg, name: t("truth"), kind: "manual" }, { drive: "now", channel: "k_hg", name: t("told"), kind: "now", band: "deviation" }], { y: [-0.1, 1.6] }),
      panel("c_sure", "of K_hg", [{ drive: "now", channel: "deviation", name: t("sure_whole"), kind: "now" }], { y: [0, 0.2] }),
      panel("c_tremble", "N.m", [{ drive: "now", channel: "guidance", name: t("guidance_torque"), kind: "guidance" }, { drive: "now", channel: "driver", name: t("driver_torque"), kind: "driver" }], { x: [14, 18] })],
    controls: [{ ...RESISTS, label: "k_hg_true" }],
    right: ({ now }) => Number.isFinite(now.now.k_hg) ? tellsOf(now.now) : "either",
    says: ({ now: result }) => {
      const { now, channels } = result;
      if (!Number.isFinite(now.k_hg)) return t("said_probe_none");
      const heard = PHASES_S.map(at => [at, channels.k_hg[200 * at], channels.deviation[200 * at]]).filter(([, k_hg]) => Number.isFinite(k_hg));
      const phases = heard.map(([at, k_hg, deviation]) => t("said_phase", { at, told: sure(k_hg, deviation) })).join(", ");
      return [t("said_probe", { phases, told: sure(now.k_hg, now.deviation), truth: f2(s.k_hg) }), t(`tells_${tellsOf(now)}`)].join(" ");
    },
  }),
  compare: s => {
    const both = (channel, scale) => ["a", "b"].map(drive => ({ drive, channel, scale, name: drive.toUpperCase(), kind: drive }));
    const of = drive => COMPARED.map(control => ({ ...control, of: drive }));
    const bars = ["a", "b"].filter(drive => hasBar(s[drive]));
    const around = drive => ["assist", ...(s[drive].guided ? ["taken"] : []), "read", "driver"].map(channel => ({ drive, channel, name: t(`bar_${channel}`), kind: channel }));
    const probed = ["a", "b"].find(drive => s[drive].probe && s[drive].guided);
    return {
      drives: { a: s.a, b: s.b }, plays: s.shown, whole: true, starts: s.a.course === "paper-course" ? 66 : 20, needle: probed ? s[probed].k_hg : undefined,
      panels: [panel("c_error", "m", both("error")), panel("c_driver", "N.m", both("driver")), panel("c_guidance", "N.m", both("guidance")), panel("c_wheel", "deg", both("wheel", 180 / Math.PI)),
        ...bars.map(drive => panel("c_bar", "N.m", around(drive), { title: t("c_bar", { who: drive.toUpperCase() }), broad: true })),
        ...(probed ? [panel("c_k_hg", "0 to 1", [{ truth: s[probed].k_hg, name: t("truth"), kind: "manual" }, { drive: probed, channel: "k_hg", name: `${probed.toUpperCase()}, ${t("told")}`, kind: probed, band: "deviation" }], { y: [-0.1, 1.3] })] : [])],
      controls: [choice("shown", [["a", "A"], ["b", "B"]]), ...of("a"), ...of("b")], numbers: true,
      says: ({ a, b }) => {
        const far = { a: f2(peak(a)), b: f2(peak(b)) }, effort_by = effort(b) - effort(a);
        return [t(far.a === far.b ? "said_error_same" : "said_error", far),
          Math.abs(effort_by) < LEAST ? t("said_effort_same", { a: f2(effort(a)) }) : t("said_effort", { by: f2(Math.abs(effort_by)), word: t(effort_by > 0 ? "more_word" : "less_word") }),
          s.a.remnant || s.b.remnant ? t("said_one_draw") : ""].join(" ").trim() + (bars.length ? `\n${saysOfBars(s, bars, { a, b })}` : "");
      },
    };
  },
  law: s => ({
    drives: { own: { t_p: s.who, law: "own" }, ship: { t_p: s.who } }, plays: "own", editor: true,
    panels: [panel("c_error", "m", [error("ship", t("shipping"), "manual"), error("own", t("own"), "now")], { least: 0.15 }),
      panel("c_guidance", "N.m", [{ drive: "ship", channel: "guidance", name: t("shipping"), kind: "manual" }, { drive: "own", channel: "guidance", name: t("own"), kind: "guidance" }])],
    controls: [THREE],
    says: ({ own, ship }) => t("said_law", { own: f2(peak(own)), ship: f2(peak(ship)), limited: (100 * (own.metrics.limited_time_share ?? 0)).toFixed(0),
      limits: [...new Set(own.channels.limit)].filter(limit => limit && limit !== NO_LIMIT).map(limit => LIMITS[limit]).join(", ") || t("none") }),
  }),
};
// A mode that allows less than the law asks for is what was wanted.
const NO_LIMIT = 6;
// How well the hands are told through the bar of each drive that has one, and what such drives leave out.
const saysOfBars = (s, bars, results) => [...bars.map(drive => t(s[drive].guided ? "said_bar" : "said_bar_alone", { who: drive.toUpperCase(), read: f2(offHands(results[drive], "read")), taken: f2(offHands(results[drive], "taken")) })),
  bars.some(drive => s[drive].probe && s[drive].guided) ? t("bar_probe") : "", t("bar_left")].filter(Boolean).join(" ");
const COMPARED = [
  choice("column", [["hands", "hands"], ["bar", "bar"]]),
  { key: "driver", kind: "select", options: "drivers" },
  slider("t_p", 0.05, 0.8, 0.01, "s"), RESISTS, slider("k_d", 1, 6, 0.1, "N.m/rad"),
  choice("guided", [[true, "on"], [false, "off"]]), slider("k_1", 0.05, 0.5, 0.01, "N.m"),
  { key: "law", kind: "select", options: "laws" },
  { key: "fail", kind: "select", options: [["none", "none"], ["torque", "torque"], ["input", "input"]] }, slider("at", 2, 150, 0.5, "s"),
  slider("speed", 30, 110, 1, "km/h"), { key: "course", kind: "select", options: "courses" },
  choice("probe", [[true, "on"], [false, "off"]]), slider("remnant", 0, 0.3, 0.05, "N.m"),
];
