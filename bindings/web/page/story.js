// The steps: which drives each wants, which lines of them it draws, what it lets the reader set, and what it says of them.

const STORY_S = [62, 106], DELAYS = [0.1, 0.3, 0.5], WHO = { 0.1: "quick", 0.3: "middle", 0.5: "slow" };
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
const f2 = value => value === null || value === undefined ? "?" : value.toFixed(2);
const f3 = value => value === null || value === undefined ? "?" : value.toFixed(3);
const peak = result => result?.metrics?.peak_lateral_error_m;
const after = result => result?.metrics?.peak_lateral_error_after_failure_m;
const effort = result => result?.metrics?.mean_abs_driver_torque_nm;

const error = (drive, name, kind) => ({ drive, channel: "error", name, kind });
const panel = (title, unit, lines, more = {}) => ({ title: t(title), unit, lines, ...more });
const instantOf = (s, say) => ({ x: s.at, from: 64, to: 100, name: t("at"), moved: at => say({ at }) });
const slider = (key, min, max, step, unit = "", more = {}) => ({ key, kind: "slider", min, max, step, unit, ...more });
const choice = (key, options) => ({ key, kind: "choice", options });
const DELAY = slider("t_p", 0.1, 0.5, 0.01, "s"), INSTANT = slider("at", 64, 100, 0.5, "s");
const RESISTS = slider("k_hg", 0, 1, 0.05, "", { low: "k_hg_low", high: "k_hg_high" });
const THREE = choice("who", DELAYS.map(t_p => [t_p, WHO[t_p]]));

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
    says: ({ now }) => t("said_loop", { driver: f2(effort(now)), guidance: f2(now.metrics.mean_abs_guidance_torque_nm), peak: f2(peak(now)) }),
  }),
  guidance: s => ({
    drives: { guided: { t_p: s.t_p }, alone: { t_p: s.t_p, guided: false } }, plays: "guided",
    panels: [panel("c_error", "m", [error("alone", t("alone"), "manual"), error("guided", t("guided_line"), "now")], { least: 0.15 }),
      panel("c_torque", "N.m", [{ drive: "guided", channel: "driver", name: t("driver_torque"), kind: "driver" }, { drive: "guided", channel: "guidance", name: t("guidance_torque"), kind: "guidance" }])],
    controls: [DELAY],
    says: ({ guided, alone }) => t("said_guidance", { t_p: f2(s.t_p), alone: f3(peak(alone)), guided: f3(peak(guided)),
      less: f3(Math.abs(peak(alone) - peak(guided))), word: t(peak(alone) >= peak(guided) ? "less_word" : "more_word") }),
  }),
  reliance: s => {
    const drives = {}, order = [s.who, ...DELAYS.filter(t_p => t_p !== s.who)];
    for (const t_p of order) {
      drives[`now${t_p}`] = { t_p, ...onLine(s.k_hg) };
      drives[`alone${t_p}`] = { t_p, guided: false };
    }
    for (const t_p of order) s.tried.forEach((k_hg, i) => { drives[`tried${i}${t_p}`] = { t_p, ...onLine(k_hg) }; });
    return {
      drives, plays: `now${s.who}`, figure: true,
      panels: DELAYS.map(t_p => panel("c_error", "m", [
        ...s.tried.map((k_hg, i) => error(`tried${i}${t_p}`, i ? "" : t("before_line"), "faint")),
        error(`alone${t_p}`, t("alone"), "manual"), error(`now${t_p}`, t("now_line", { k_hg: s.k_hg.toFixed(2) }), "now")],
      { title: t("panel_driver", { who: t(WHO[t_p]), t_p: t_p.toFixed(1) }), least: 0.25, mine: t_p === s.who })),
      controls: [RESISTS, THREE],
      says: r => {
        const [now, alone] = [r[`now${s.who}`], r[`alone${s.who}`]];
        return t("said_reliance", { k_hg: s.k_hg.toFixed(2), who: t(WHO[s.who]), now: f3(peak(now)), alone: f3(peak(alone)), effort: f3(effort(now)), alone_effort: f3(effort(alone)) });
      },
    };
  },
  failure: (s, say) => {
    const drives = {}, order = [s.who, ...DELAYS.filter(t_p => t_p !== s.who)];
    for (const t_p of order) for (const [name, k_hg] of [["high", 0], ["mid", 0.5], ["low", 1]]) drives[name + t_p] = { t_p, ...onLine(k_hg), fail: "torque", at: s.at };
    drives[`none${s.who}`] = { t_p: s.who, ...onLine(0) };
    return {
      drives, plays: `high${s.who}`, figure: true,
      panels: DELAYS.map(t_p => panel("c_error", "m", ["high", "mid", "low"].map(name => error(name + t_p, t(name), name)),
        { title: t("panel_driver", { who: t(WHO[t_p]), t_p: t_p.toFixed(1) }), least: 0.65, mine: t_p === s.who, handle: instantOf(s, say), marksOf: `high${t_p}` })),
      controls: [INSTANT, THREE],
      says: r => t("said_failure", { at: s.at.toFixed(1), t_p: s.who.toFixed(1), high: f3(after(r[`high${s.who}`])), mid: f3(after(r[`mid${s.who}`])),
        low: f3(after(r[`low${s.who}`])), none: f3(peak(r[`none${s.who}`])) }),
    };
  },
  handover: (s, say) => {
    const driver = { t_p: s.who, ...onLine(s.k_hg) };
    return {
      drives: { handed: { ...driver, fail: "input", at: s.at }, sudden: { ...driver, fail: "torque", at: s.at }, none: driver }, plays: "handed",
      panels: [panel("c_error", "m", [error("none", t("no_failure"), "manual"), error("sudden", t("sudden"), "high"), error("handed", t("handed"), "low")], { least: 0.25, handle: instantOf(s, say), marksOf: "handed" }),
        panel("c_guidance", "N.m", [{ drive: "none", channel: "guidance", name: t("no_failure"), kind: "manual" }, { drive: "sudden", channel: "guidance", name: t("sudden"), kind: "high" }, { drive: "handed", channel: "guidance", name: t("handed"), kind: "low" }], { marksOf: "handed" })],
      controls: [INSTANT, RESISTS, THREE],
      says: r => t("said_handover", { at: s.at.toFixed(1), sudden: f3(after(r.sudden)), handed: f3(after(r.handed)), none: f3(peak(r.none)) }),
    };
  },
  probe: s => ({
    drives: { now: { t_p: 0.3, ...onLine(s.k_hg), probe: true, remnant: 0.1, course: "bends" } }, plays: "now", whole: true, starts: 8, rate: 3, needle: s.k_hg,
    panels: [panel("c_k_hg", "0 to 1", [{ truth: s.k_hg, name: t("truth"), kind: "manual" }, { drive: "now", channel: "k_hg", name: t("told"), kind: "now", band: "deviation" }], { y: [-0.1, 1.3] }),
      panel("c_tremble", "N.m", [{ drive: "now", channel: "guidance", name: t("guidance_torque"), kind: "guidance" }, { drive: "now", channel: "driver", name: t("driver_torque"), kind: "driver" }], { x: [14, 18] })],
    controls: [{ ...RESISTS, label: "k_hg_true" }],
    says: ({ now }) => Number.isFinite(now.now.k_hg) ? t("said_probe", { told: f2(now.now.k_hg), deviation: f2(now.now.deviation), truth: f2(s.k_hg) }) : t("said_probe_none"),
  }),
  compare: s => {
    const both = (channel, scale) => ["a", "b"].map(drive => ({ drive, channel, scale, name: drive.toUpperCase(), kind: drive }));
    const of = drive => COMPARED.map(control => ({ ...control, of: drive }));
    const probed = ["a", "b"].find(drive => s[drive].probe && s[drive].guided);
    return {
      drives: { a: s.a, b: s.b }, plays: s.shown, whole: true, starts: s.a.course === "paper-course" ? 66 : 20, needle: probed ? s[probed].k_hg : undefined,
      panels: [panel("c_error", "m", both("error")), panel("c_driver", "N.m", both("driver")), panel("c_guidance", "N.m", both("guidance")), panel("c_wheel", "deg", both("wheel", 180 / Math.PI)),
        ...(probed ? [panel("c_k_hg", "0 to 1", [{ truth: s[probed].k_hg, name: t("truth"), kind: "manual" }, { drive: probed, channel: "k_hg", name: `${probed.toUpperCase()}, ${t("told")}`, kind: probed, band: "deviation" }], { y: [-0.1, 1.3] })] : [])],
      controls: [choice("shown", [["a", "A"], ["b", "B"]]), ...of("a"), ...of("b")], numbers: true,
      says: ({ a, b }) => {
        const by = peak(b) - peak(a), effort_by = effort(b) - effort(a), word = x => t(x > 0 ? "more_word" : "less_word");
        return Math.abs(by) < 0.0005 && Math.abs(effort_by) < 0.0005 ? t("said_compare_same", { a: f3(peak(a)) })
          : t("said_compare", { a: f3(peak(a)), b: f3(peak(b)), error: f3(Math.abs(by)), error_word: word(by), effort: f3(Math.abs(effort_by)), effort_word: word(effort_by) });
      },
    };
  },
  law: s => ({
    drives: { own: { t_p: s.who, law: "own" }, ship: { t_p: s.who } }, plays: "own", editor: true,
    panels: [panel("c_error", "m", [error("ship", t("shipping"), "manual"), error("own", t("own"), "now")], { least: 0.15 }),
      panel("c_guidance", "N.m", [{ drive: "ship", channel: "guidance", name: t("shipping"), kind: "manual" }, { drive: "own", channel: "guidance", name: t("own"), kind: "guidance" }])],
    controls: [THREE],
    says: ({ own, ship }) => t("said_law", { own: f3(peak(own)), ship: f3(peak(ship)), limited: (100 * (own.metrics.limited_time_share ?? 0)).toFixed(0),
      limits: [...new Set(own.channels.limit)].filter(limit => limit && limit !== NO_LIMIT).map(limit => LIMITS[limit]).join(", ") || t("none") }),
  }),
};
// A mode that allows less than the law asks for is what was wanted.
const NO_LIMIT = 6;
const COMPARED = [
  { key: "driver", kind: "select", options: "drivers" },
  slider("t_p", 0.05, 0.8, 0.01, "s"), RESISTS, slider("k_d", 1, 6, 0.1, "N.m/rad"),
  choice("guided", [[true, "on"], [false, "off"]]), slider("k_1", 0.05, 0.5, 0.01, "N.m"),
  { key: "law", kind: "select", options: "laws" },
  { key: "fail", kind: "select", options: [["none", "none"], ["torque", "torque"], ["input", "input"]] }, slider("at", 2, 150, 0.5, "s"),
  slider("speed", 30, 110, 1, "km/h"), { key: "course", kind: "select", options: "courses" },
  choice("probe", [[true, "on"], [false, "off"]]), slider("remnant", 0, 0.3, 0.05, "N.m"),
];
