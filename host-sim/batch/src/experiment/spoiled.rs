//! Logs as cars and simulators really record them: the participants' drives, each spoiled in a known way, and what the
//! identification makes of them.
//!
//! Terms: a *lie* is a value that is called identified and is more than four of its own standard errors and more than
//! 10 % (15 ms of t_p, 0.05 of K_hg) from the truth. A value that is taken back is no lie; so the clean drives
//! beside it show what was given up.

use haptic_analysis::identify::{DriveLog, Identification, Options, Traces, identify_with_noise_model};
use rand::rngs::Xoshiro256PlusPlus;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Normal};
use rayon::prelude::*;
use serde::Serialize;

use super::drives::driven_by;
use super::repetitions::{COMPARED, Compared, bound_of, compared};
use super::{Plan, PublishedDriver, chosen};

/// One way to spoil a log.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Spoiling {
    /// One sample of e_theta is off by 0.05 rad.
    Outlier,
    /// White noise on e_y, m, and e_theta, rad; a value stays for so many rows.
    LaneNoise(f64, f64, usize),
    /// e_theta in steps, rad.
    Steps(f64),
    /// So many single samples of e_y and e_theta are zero.
    ZeroSamples(usize),
    /// e_y and e_theta are zero for so long, s.
    ZeroFor(f64),
    /// T_d is nothing but noise, N.m.
    TorqueNoise(f64),
    /// T_d is zero for so long, s.
    HandsOff(f64),
    /// For so long, s, the car stands with the wheel askew.
    Parked(f64),
    /// T_d times a factor.
    TorqueScale(f64),
    /// T_d is late, s.
    TorqueLate(f64),
    /// T_h is late, s.
    GuidanceLate(f64),
    /// The sign of T_d is swapped.
    TorqueSign,
    /// The sign of T_h is swapped.
    GuidanceSign,
    /// The sign of the wheel angle is swapped.
    WheelSign,
    /// The signs of e_y and e_theta are swapped.
    LaneSign,
    /// The drive is said to be a manual one.
    CalledManual,
    /// T_d holds T_h.
    SumOfTorques,
    /// The driver's t_nms, s, where 0.1 is assumed.
    OtherMuscle(f64),
}

/// The ways of the population with their names: each alone, then mixtures.
pub const POPULATION: [(&str, &[Spoiling]); 29] = [
    ("clean", &[]),
    ("one e_theta sample off by 0.05 rad", &[Spoiling::Outlier]),
    ("lane noise 5 mm, 0.5 mrad", &[Spoiling::LaneNoise(5e-3, 5e-4, 1)]),
    ("lane noise 10 mm, 1 mrad", &[Spoiling::LaneNoise(1e-2, 1e-3, 1)]),
    (
        "lane noise 30 mm, 5 mrad at 30 Hz",
        &[Spoiling::LaneNoise(3e-2, 5e-3, 4)],
    ),
    ("e_theta in steps of 2 mrad", &[Spoiling::Steps(2e-3)]),
    ("five lane samples zero", &[Spoiling::ZeroSamples(5)]),
    ("lane zero for 0.1 s", &[Spoiling::ZeroFor(0.1)]),
    ("lane zero for 2 s", &[Spoiling::ZeroFor(2.0)]),
    ("T_d is noise", &[Spoiling::TorqueNoise(0.2)]),
    ("hands off for 30 s", &[Spoiling::HandsOff(30.0)]),
    ("parked for 20 s, wheel askew", &[Spoiling::Parked(20.0)]),
    ("T_d at half scale", &[Spoiling::TorqueScale(0.5)]),
    ("T_d 50 ms late", &[Spoiling::TorqueLate(0.05)]),
    ("T_h 8 ms late", &[Spoiling::GuidanceLate(0.008)]),
    ("sign of T_d", &[Spoiling::TorqueSign]),
    ("sign of T_h", &[Spoiling::GuidanceSign]),
    ("sign of the wheel angle", &[Spoiling::WheelSign]),
    ("signs of the lane", &[Spoiling::LaneSign]),
    ("guided, called manual", &[Spoiling::CalledManual]),
    ("T_d is T_d + T_h", &[Spoiling::SumOfTorques]),
    ("t_nms 0.15 s", &[Spoiling::OtherMuscle(0.15)]),
    ("t_nms 0.06 s", &[Spoiling::OtherMuscle(0.06)]),
    (
        "noise 10 mm, outlier, five zeros",
        &[
            Spoiling::LaneNoise(1e-2, 1e-3, 1),
            Spoiling::Outlier,
            Spoiling::ZeroSamples(5),
        ],
    ),
    (
        "noise 10 mm, hands off, zero for 2 s",
        &[
            Spoiling::LaneNoise(1e-2, 1e-3, 1),
            Spoiling::HandsOff(30.0),
            Spoiling::ZeroFor(2.0),
        ],
    ),
    (
        "noise 5 mm, parked",
        &[Spoiling::LaneNoise(5e-3, 5e-4, 1), Spoiling::Parked(20.0)],
    ),
    (
        "noise 30 mm at 30 Hz, T_h 8 ms late",
        &[Spoiling::LaneNoise(3e-2, 5e-3, 4), Spoiling::GuidanceLate(0.008)],
    ),
    (
        "steps, outlier, hands off",
        &[Spoiling::Steps(2e-3), Spoiling::Outlier, Spoiling::HandsOff(30.0)],
    ),
    (
        "noise 10 mm, t_nms 0.15 s",
        &[Spoiling::LaneNoise(1e-2, 1e-3, 1), Spoiling::OtherMuscle(0.15)],
    ),
];

/// How many 95 % intervals of identified values hold the truth.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Held {
    /// Identified values.
    pub identified: usize,
    /// Those whose interval holds the truth.
    pub held: usize,
}

impl Held {
    /// Their share; none of none.
    pub fn share(self) -> Option<f64> {
        (self.identified > 0).then(|| self.held as f64 / self.identified as f64)
    }

    fn of<'a>(values: impl Iterator<Item = &'a Compared>) -> Self {
        values
            .filter(|v| v.1.identified)
            .fold(Self::default(), |sum, v| Self {
                identified: sum.identified + 1,
                held: sum.held
                    + usize::from(
                        v.1.interval_95
                            .is_some_and(|[low, high]| low <= v.2 && v.2 <= high),
                    ),
            })
    }
}

impl std::ops::Add for Held {
    type Output = Self;

    fn add(self, more: Self) -> Self {
        Self {
            identified: self.identified + more.identified,
            held: self.held + more.held,
        }
    }
}

/// What was made of one way of spoiling.
#[derive(Debug, Clone, Serialize)]
pub struct SpoiledLine {
    /// What was in the logs.
    pub spoiled_by: &'static str,
    /// Drives.
    pub drives: usize,
    /// Drives whose model was refuted.
    pub refuted: usize,
    /// The cause that was named most often, and how often.
    pub cause: Option<(String, usize)>,
    /// Values called identified, of [`Self::drives`] times five.
    pub identified: usize,
    /// Lies among them.
    pub lies: usize,
    /// Share of the 95 % intervals, of those that were identified, that hold the truth.
    pub coverage: Option<f64>,
    /// The same of gain_1, gain_2, gain_3, t_p and K_hg, counted.
    pub intervals: [Held; COMPARED],
    /// Root mean square error of gain_1, gain_2, gain_3, t_p and K_hg, refuted or not.
    pub rms: [f64; COMPARED],
    /// Drives in which K_hg was identified and within 0.05.
    pub k_hg_read: usize,
}

/// The whole population.
#[derive(Debug, Clone, Serialize)]
pub struct Spoiled {
    /// Drives of each participant and way.
    pub seeds: u32,
    /// By way of spoiling.
    pub lines: Vec<SpoiledLine>,
    /// Values called identified in all.
    pub identified: usize,
    /// Lies in all.
    pub lies: usize,
    /// 95 % intervals in all, by parameter as in the lines.
    pub intervals: [Held; COMPARED],
    /// The same of the drivers whose t_nms is what is assumed. Intervals hold arms of all kinds 95 times in 100, those at
    /// the edge of the range of arms less often.
    pub intervals_at_t_nms: [Held; COMPARED],
    /// Least RMS errors of an unbiased estimator from the clean logs, in the order of the lines' own.
    pub bound: [f64; COMPARED],
    /// What was promised and is not kept.
    pub broken: Vec<String>,
}

/// Spoils the guided drives of `plan` with `seeds` seeds from its own on in the ways of [`POPULATION`] whose name holds
/// `only`, and identifies each; `done` is called after each, from any thread.
///
/// # Errors
/// As [`super::experiment`].
pub fn spoiled(plan: &Plan, seeds: u32, only: &str, done: impl Fn() + Sync) -> Result<Spoiled, String> {
    let ways: Vec<(&'static str, &[Spoiling])> = POPULATION
        .iter()
        .filter(|(name, _)| name.contains(only))
        .copied()
        .collect();
    let jobs: Vec<(u32, PublishedDriver, u64)> = chosen(&plan.participants)?
        .iter()
        .flat_map(|p| (0..u64::from(seeds)).map(move |s| (p.number, p.guided, s)))
        .collect();
    // What is driven differs by the driver's muscle alone: each muscle drives once, and its log is spoiled in all ways.
    let found = jobs
        .into_par_iter()
        .map(|(number, truth, seed)| {
            let plan = Plan {
                seed: plan.seed.wrapping_add(seed),
                ..plan.clone()
            };
            let mut clean: Vec<(f64, DriveLog)> = Vec::new();
            let mut fits = Vec::with_capacity(ways.len());
            for (_, ways) in &ways {
                let mut driver = truth.parameters();
                for way in *ways {
                    if let Spoiling::OtherMuscle(t_nms) = way {
                        driver.t_nms = *t_nms;
                    }
                }
                if !clean.iter().any(|c| c.0 == driver.t_nms) {
                    clean.push((driver.t_nms, driven_by(&plan, number, &truth, driver)?.log));
                }
                let Some((_, log)) = clean.iter().find(|c| c.0 == driver.t_nms) else {
                    unreachable!("it was driven")
                };
                let log = spoiled_log(log, ways, &plan, number);
                let options = Options {
                    manual: ways.contains(&Spoiling::CalledManual),
                    ..Options::default()
                };
                let mut fit = identify_with_noise_model(&log, &options);
                fit.traces = Traces::default();
                fits.push((compared(&truth, &fit.parameters), fit));
                done();
            }
            let bound = clean.first().map(|(_, log)| bound_of(log, &truth));
            Ok((fits, bound.unwrap_or_default()))
        })
        .collect::<Result<Vec<_>, String>>()?;
    let count = found.len().max(1) as f64;
    let bound = std::array::from_fn(|i| (found.iter().map(|f| f.1[i].powi(2)).sum::<f64>() / count).sqrt());
    let mut fits: Vec<Vec<_>> = ways.iter().map(|_| Vec::new()).collect();
    for (each, _) in found {
        for (line, fit) in fits.iter_mut().zip(each) {
            line.push(fit);
        }
    }
    let lines = ways
        .iter()
        .zip(&fits)
        .map(|((name, _), found)| SpoiledLine::new(name, found))
        .collect();
    Ok(Spoiled::new(seeds, lines, bound))
}

/// `log` as these ways leave it; the same for the same plan and participant.
pub(super) fn spoiled_log(log: &DriveLog, ways: &[Spoiling], plan: &Plan, number: u32) -> DriveLog {
    let mut random =
        Xoshiro256PlusPlus::seed_from_u64(plan.seed.wrapping_mul(100).wrapping_add(u64::from(number)));
    let mut log = log.clone();
    for way in ways {
        spoil(&mut log, *way, &mut random);
    }
    log
}

/// How far from the truth a value may be without being wrong.
fn tolerance(parameter: &str, truth: f64) -> f64 {
    match parameter {
        "t_p" => 0.015,
        "k_hg" => 0.05,
        _ => 0.1 * truth,
    }
}

impl SpoiledLine {
    fn new(name: &'static str, found: &[([Compared; COMPARED], Identification)]) -> Self {
        let values: Vec<&Compared> = found.iter().flat_map(|f| &f.0).collect();
        let known: Vec<&&Compared> = values.iter().filter(|v| v.1.identified).collect();
        let error = |v: &Compared| v.1.optimum.map_or(0.0, |x| x - v.2);
        let lies = known.iter().filter(|v| {
            let e = error(v).abs();
            e > tolerance(v.0, v.2) && v.1.standard_error.is_some_and(|s| e > 4.0 * s)
        });
        let intervals: [Held; COMPARED] = std::array::from_fn(|i| Held::of(found.iter().map(|f| &f.0[i])));
        let mut causes: Vec<(String, usize)> = Vec::new();
        for cause in found
            .iter()
            .filter_map(|f| Some(in_words(&f.1.refuted.first()?.cause)))
        {
            match causes.iter_mut().find(|c| c.0 == cause) {
                Some(c) => c.1 += 1,
                None => causes.push((cause, 1)),
            }
        }
        let rms = std::array::from_fn(|i| {
            let sum: f64 = found.iter().map(|f| error(&f.0[i]).powi(2)).sum();
            (sum / found.len().max(1) as f64).sqrt()
        });
        Self {
            spoiled_by: name,
            drives: found.len(),
            refuted: found.iter().filter(|f| !f.1.refuted.is_empty()).count(),
            cause: causes.into_iter().max_by_key(|c| c.1),
            identified: known.len(),
            lies: lies.count(),
            coverage: intervals.iter().fold(Held::default(), |sum, h| sum + *h).share(),
            intervals,
            rms,
            k_hg_read: found
                .iter()
                .filter(|f| f.0[4].1.estimate.is_some_and(|x| (x - f.0[4].2).abs() < 0.05))
                .count(),
        }
    }
}

/// A cause without its figures, to count alike ones together.
fn in_words(cause: &str) -> String {
    cause
        .split_whitespace()
        .filter(|w| {
            w.trim_matches(|c: char| "(),-+".contains(c))
                .parse::<f64>()
                .is_err()
        })
        .collect::<Vec<_>>()
        .join(" ")
}

impl Spoiled {
    fn new(seeds: u32, lines: Vec<SpoiledLine>, bound: [f64; COMPARED]) -> Self {
        let identified: usize = lines.iter().map(|l| l.identified).sum();
        let lies: usize = lines.iter().map(|l| l.lies).sum();
        let mut broken = Vec::new();
        if lies * 1000 > identified {
            broken.push(format!(
                "{lies} lies among {identified} identified values: more than 1 of 1,000"
            ));
        }
        let together = |wanted: &dyn Fn(&SpoiledLine) -> bool| -> [Held; COMPARED] {
            let of = |i: usize| {
                let lines = lines.iter().filter(|l| wanted(l));
                lines.fold(Held::default(), |sum, l| sum + l.intervals[i])
            };
            std::array::from_fn(of)
        };
        let other_muscle = |l: &SpoiledLine| {
            let way = POPULATION.iter().find(|(name, _)| *name == l.spoiled_by);
            way.is_some_and(|(_, ways)| ways.iter().any(|w| matches!(w, Spoiling::OtherMuscle(_))))
        };
        let (intervals, intervals_at_t_nms) = (together(&|_| true), together(&|l| !other_muscle(l)));
        let line = |name: &str| lines.iter().find(|l| l.spoiled_by == name);
        if let (Some(clean), Some(noisy)) = (line("clean"), line("lane noise 10 mm, 1 mrad")) {
            if noisy.k_hg_read * 14 < 13 * noisy.drives {
                broken.push(format!(
                    "lane noise 10 mm: K_hg read in {} of {}",
                    noisy.k_hg_read, noisy.drives
                ));
            }
            for (i, name) in ["gain_1", "gain_2", "gain_3", "t_p"].into_iter().enumerate() {
                if noisy.rms[i] > 1.5 * clean.rms[i] {
                    broken.push(format!(
                        "lane noise 10 mm: RMS error of {name} {:.4}, on clean logs {:.4}",
                        noisy.rms[i], clean.rms[i]
                    ));
                }
            }
        }
        Self {
            seeds,
            lines,
            identified,
            lies,
            intervals,
            intervals_at_t_nms,
            bound,
            broken,
        }
    }
}

/// Rows at either end that are never spoiled by what happens once: 8 s.
const MARGIN: usize = 1000;

fn spoil(log: &mut DriveLog, way: Spoiling, random: &mut Xoshiro256PlusPlus) {
    let n = log.len();
    let rows = |s: f64| (s / log.dt_s).round() as usize;
    match way {
        Spoiling::Outlier => log.e_theta_rad[random.random_range(MARGIN..n - MARGIN)] += 0.05,
        Spoiling::LaneNoise(e_y, e_theta, hold) => {
            noise(&mut log.e_y_m, e_y, hold, random);
            noise(&mut log.e_theta_rad, e_theta, hold, random);
        }
        Spoiling::Steps(step) => log
            .e_theta_rad
            .iter_mut()
            .for_each(|x| *x = (*x / step).round() * step),
        Spoiling::ZeroSamples(count) => {
            for _ in 0..count {
                let k = random.random_range(MARGIN..n - MARGIN);
                (log.e_y_m[k], log.e_theta_rad[k]) = (0.0, 0.0);
            }
        }
        Spoiling::ZeroFor(s) => {
            let k = random.random_range(MARGIN..n - MARGIN - rows(s));
            let end = k + rows(s);
            log.e_y_m[k..end].fill(0.0);
            log.e_theta_rad[k..end].fill(0.0);
        }
        Spoiling::TorqueNoise(sd) => {
            log.driver_torque_nm.fill(0.0);
            noise(&mut log.driver_torque_nm, sd, 1, random);
        }
        Spoiling::HandsOff(s) => {
            let k = random.random_range(MARGIN..n - MARGIN - rows(s));
            for x in &mut log.driver_torque_nm[k..k + (s / log.dt_s) as usize] {
                *x = 0.005 * f64::from(random.random_range(-1..2));
            }
        }
        Spoiling::Parked(s) => {
            let k = random.random_range(MARGIN..n - MARGIN);
            let rows = rows(s);
            let insert =
                |u: &mut Vec<f64>, value: f64| drop(u.splice(k..k, std::iter::repeat_n(value, rows)));
            let (e_y, e_theta) = (log.e_y_m[k], log.e_theta_rad[k]);
            insert(&mut log.e_y_m, e_y);
            insert(&mut log.e_theta_rad, e_theta);
            insert(&mut log.wheel_angle_rad, 0.3);
            insert(&mut log.guidance_torque_nm, 0.0);
            insert(&mut log.driver_torque_nm, 0.0);
        }
        Spoiling::TorqueScale(factor) => log.driver_torque_nm.iter_mut().for_each(|x| *x *= factor),
        Spoiling::TorqueLate(s) => delay(&mut log.driver_torque_nm, s / log.dt_s),
        Spoiling::GuidanceLate(s) => delay(&mut log.guidance_torque_nm, s / log.dt_s),
        Spoiling::TorqueSign => log.driver_torque_nm.iter_mut().for_each(|x| *x = -*x),
        Spoiling::GuidanceSign => log.guidance_torque_nm.iter_mut().for_each(|x| *x = -*x),
        Spoiling::WheelSign => log.wheel_angle_rad.iter_mut().for_each(|x| *x = -*x),
        Spoiling::LaneSign => {
            let lane = log.e_y_m.iter_mut().chain(&mut log.e_theta_rad);
            lane.for_each(|x| *x = -*x);
        }
        Spoiling::SumOfTorques => {
            for (x, h) in log.driver_torque_nm.iter_mut().zip(&log.guidance_torque_nm) {
                *x += h;
            }
        }
        // Not in the log: in what is said of it, or in the driver.
        Spoiling::CalledManual | Spoiling::OtherMuscle(_) => {}
    }
}

fn noise(signal: &mut [f64], sd: f64, hold: usize, random: &mut Xoshiro256PlusPlus) {
    let Ok(normal) = Normal::new(0.0, sd) else { return };
    let mut held = 0.0;
    for (k, x) in signal.iter_mut().enumerate() {
        if k % hold == 0 {
            held = *x + normal.sample(random);
        }
        *x = held;
    }
}

fn delay(signal: &mut [f64], rows: f64) {
    let original = signal.to_vec();
    for (k, x) in signal.iter_mut().enumerate() {
        let place = (k as f64 - rows).max(0.0);
        let whole = place as usize;
        *x = original[whole]
            + place.fract() * (original[(whole + 1).min(original.len() - 1)] - original[whole]);
    }
}
