//! Logs as cars and simulators really record them: the participants' drives, each corrupted in a known way, and what the
//! identification makes of them.
//!
//! Terms: a *false identification* is a value that is called identified and is more than four of its own standard errors and more than
//! 10 % (15 ms of t_p, 0.05 of K_hg) from the truth. A value that is taken back is none; so the clean drives
//! beside it show what was given up.

use haptic_analysis::identify::{
    DriveLog, Identification, Options, Parameters, Traces, identify_with_noise_model,
};
use serde::Serialize;

use super::changing::driver_at;
use super::corruption::{Corruption, POPULATION, changing, corrupted_log};
use super::repetitions::bound_of;
use haptic_batch::StudyError;
use haptic_batch::engine::{Watch, each};
use haptic_batch::experiment::{COMPARED, Compared, ExperimentPlan, compared, driven_by, guided};
use haptic_batch::statistics::{mean, rms};
use haptic_sim::participants::PublishedDriver;

/// How many 95 % intervals of identified values hold the truth.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Held {
    /// Identified values.
    pub identified: usize,
    /// Values whose interval holds the truth.
    pub held: usize,
}

impl Held {
    /// Their share; none of none.
    pub fn share(self) -> Option<f64> {
        (self.identified > 0).then(|| self.held as f64 / self.identified as f64)
    }

    pub(super) fn new<'a>(values: impl Iterator<Item = &'a Compared>) -> Self {
        let known: Vec<&Compared> = values.filter(|v| v.1.identified).collect();
        let holds = |(_, p, truth): &Compared| {
            p.interval_95
                .is_some_and(|[low, high]| (low..=high).contains(truth))
        };
        Self {
            identified: known.len(),
            held: known.into_iter().filter(|v| holds(v)).count(),
        }
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

/// What was made of one corruption.
#[derive(Debug, Clone, Serialize)]
pub struct CorruptionLine {
    /// What was in the logs.
    pub corrupted_by: &'static str,
    /// Drives.
    pub drives: usize,
    /// Drives whose model was refuted.
    pub refuted: usize,
    /// The cause that was named most often, and how often.
    pub cause: Option<(String, usize)>,
    /// Values called identified, of [`Self::drives`] times five.
    pub identified: usize,
    /// False identifications among them.
    pub false_identifications: usize,
    /// Share of the 95 % intervals, of those that were identified, that hold the truth.
    pub coverage: Option<f64>,
    /// Intervals of gain_1, gain_2, gain_3, t_p and K_hg that hold the truth, counted.
    pub intervals: [Held; COMPARED],
    /// Root mean square error of gain_1, gain_2, gain_3, t_p and K_hg, refuted or not.
    pub rms: [f64; COMPARED],
    /// Drives in which K_hg was identified and within 0.05.
    pub k_hg_read: usize,
}

/// What was made of the inertia of a wheel that was sought.
#[derive(Debug, Clone, Serialize)]
pub struct SoughtWheel {
    /// How the drives were recorded.
    pub recorded: &'static str,
    /// Drives whose inertia was identified, and how many of their 95 % intervals hold it.
    pub intervals: Held,
    /// Root mean square of their errors, kg.m2.
    pub rms: Option<f64>,
    /// Mean of their standard errors, kg.m2.
    pub standard_error: Option<f64>,
}

impl SoughtWheel {
    pub(super) fn new(
        recorded: &'static str,
        truth: f64,
        fits: &[([Compared; COMPARED], Identification)],
    ) -> Self {
        let sought = fits.iter().flat_map(|(_, fit)| &fit.beyond);
        let found: Vec<Compared> = sought
            .filter(|(name, wheel)| *name == "wheel_inertia" && wheel.identified)
            .map(|&(name, wheel)| (name, wheel, truth))
            .collect();
        let errors = found
            .iter()
            .filter_map(|(_, wheel, _)| Some(wheel.estimate? - truth));
        Self {
            recorded,
            intervals: Held::new(found.iter()),
            rms: rms(errors),
            standard_error: mean(found.iter().filter_map(|(_, wheel, _)| wheel.standard_error)),
        }
    }
}

/// The whole population.
#[derive(Debug, Clone, Serialize)]
pub struct Corruptions {
    /// Who drove, with which probe; its seed is that of the first drive of each participant, from which the others count on.
    #[serde(flatten)]
    pub plan: ExperimentPlan,
    /// Drives of each participant and way.
    pub seeds: u32,
    /// By corruption.
    pub lines: Vec<CorruptionLine>,
    /// Values called identified in all.
    pub identified: usize,
    /// False identifications in all.
    pub false_identifications: usize,
    /// 95 % intervals in all, by parameter as in the lines, but of drivers who change: these have no one truth.
    pub intervals: [Held; COMPARED],
    /// Intervals of the drivers whose t_nms is what is assumed. Intervals hold arms of all kinds 95 times in 100, those
    /// at the edge of the range of arms less often.
    pub intervals_at_t_nms: [Held; COMPARED],
    /// What was made of wheels above a torsion bar whose inertia was sought; none of corrupted logs.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub wheels: Vec<SoughtWheel>,
    /// Least RMS errors of an unbiased estimator from the clean logs, in the order of the lines' own.
    pub bound: [f64; COMPARED],
    /// What was promised and is not kept.
    pub broken: Vec<String>,
}

/// Corrupts the guided drives of `plan` with `seeds` seeds from its own on in the ways of [`POPULATION`] whose name holds
/// `only`, and identifies each.
///
/// # Errors
/// An unknown participant; a probe that the controller refuses; a drive that differs from the shipping ECU's.
pub fn corruptions(
    plan: &ExperimentPlan,
    seeds: u32,
    only: &str,
    watch: &Watch<'_>,
) -> Result<Corruptions, StudyError> {
    let ways: Vec<(&'static str, &[Corruption])> = POPULATION
        .iter()
        .filter(|(name, _)| name.contains(only))
        .copied()
        .collect();
    let jobs = guided(plan, seeds)?;
    // What is driven differs by the driver's muscle alone: each muscle drives once, and its log is corrupted in all ways.
    let found = each(&jobs, watch, |&(number, truth, seed)| {
        let plan = plan.repetition(seed);
        let mut clean: Vec<(f64, DriveLog)> = Vec::new();
        let mut fits = Vec::with_capacity(ways.len());
        for (_, ways) in &ways {
            let changing = changing(ways, &truth, &plan, number);
            let mut driver = truth.parameters();
            for way in *ways {
                if let Corruption::OtherMuscle(t_nms) = way {
                    driver.t_nms = *t_nms;
                }
            }
            if !clean.iter().any(|c| c.0 == driver.t_nms) {
                clean.push((driver.t_nms, driven_by(&plan, number, &truth, driver)?.log));
            }
            let Some((_, log)) = clean.iter().find(|c| c.0 == driver.t_nms) else {
                unreachable!("it was driven")
            };
            let changed = changing
                .as_ref()
                .map(|drawn| drawn.log(&plan, number))
                .transpose()?;
            let log = corrupted_log(changed.as_ref().unwrap_or(log), ways, &plan, number);
            let options = Options {
                manual: ways.contains(&Corruption::CalledManual),
                ..Options::default()
            };
            let mut fit = identify_with_noise_model(&log, &options);
            fit.traces = Traces::default();
            let values = match &changing {
                None => compared(&truth, &fit.parameters),
                Some(drawn) => {
                    let last = driver_at(&drawn.first, &drawn.changes, f64::INFINITY);
                    compared_with_nearer([drawn.first, last], &fit.parameters)
                }
            };
            fits.push((values, fit));
        }
        let bound = clean.first().map(|(_, log)| bound_of(log, &truth));
        Ok((fits, bound.unwrap_or_default()))
    })?;
    let bound = std::array::from_fn(|i| rms(found.iter().map(|f| f.1[i])).unwrap_or(0.0));
    let mut fits: Vec<Vec<_>> = ways.iter().map(|_| Vec::new()).collect();
    for (each, _) in found {
        for (line, fit) in fits.iter_mut().zip(each) {
            line.push(fit);
        }
    }
    let lines = ways
        .iter()
        .zip(&fits)
        .map(|((name, _), found)| CorruptionLine::new(name, found))
        .collect();
    Ok(Corruptions::new(plan, seeds, lines, bound))
}

/// Nobody who changes has one value throughout: each is held against the first driver or the last, whichever is nearer.
fn compared_with_nearer(ends: [PublishedDriver; 2], found: &Parameters) -> [Compared; COMPARED] {
    let [before, after] = ends.map(|driver| compared(&driver, found));
    let miss = |v: &Compared| (v.1.optimum.unwrap_or(v.2) - v.2).abs();
    std::array::from_fn(|i| {
        if miss(&before[i]) < miss(&after[i]) {
            before[i]
        } else {
            after[i]
        }
    })
}

/// How far from the truth a value may be without being wrong.
pub(super) fn tolerance(parameter: &str, truth: f64) -> f64 {
    match parameter {
        "t_p" => 0.015,
        "k_hg" => 0.05,
        _ => 0.1 * truth,
    }
}

impl CorruptionLine {
    pub(super) fn new(name: &'static str, found: &[([Compared; COMPARED], Identification)]) -> Self {
        let values: Vec<&Compared> = found.iter().flat_map(|f| &f.0).collect();
        let known: Vec<&&Compared> = values.iter().filter(|v| v.1.identified).collect();
        let error = |v: &Compared| v.1.optimum.map_or(0.0, |x| x - v.2);
        let false_identifications = known.iter().filter(|v| {
            let e = error(v).abs();
            e > tolerance(v.0, v.2) && v.1.standard_error.is_some_and(|s| e > 4.0 * s)
        });
        let intervals: [Held; COMPARED] = std::array::from_fn(|i| Held::new(found.iter().map(|f| &f.0[i])));
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
        // Without a value there is no error; -0 is what a sum of no numbers gives.
        let rms = std::array::from_fn(|i| rms(found.iter().map(|f| error(&f.0[i]))).unwrap_or(-0.0));
        Self {
            corrupted_by: name,
            drives: found.len(),
            refuted: found.iter().filter(|f| !f.1.refuted.is_empty()).count(),
            cause: causes.into_iter().max_by_key(|c| c.1),
            identified: known.len(),
            false_identifications: false_identifications.count(),
            coverage: intervals.iter().fold(Held::default(), |sum, h| sum + *h).share(),
            intervals,
            rms,
            // K_hg is the last of the five.
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

impl Corruptions {
    pub(super) fn new(
        plan: &ExperimentPlan,
        seeds: u32,
        lines: Vec<CorruptionLine>,
        bound: [f64; COMPARED],
    ) -> Self {
        let identified: usize = lines.iter().map(|l| l.identified).sum();
        let false_identifications: usize = lines.iter().map(|l| l.false_identifications).sum();
        let mut broken = Vec::new();
        if false_identifications * 1000 > identified {
            broken.push(format!(
                "{false_identifications} false identifications among {identified} identified values: more than 1 of 1,000"
            ));
        }
        let together = |wanted: &dyn Fn(&CorruptionLine) -> bool| -> [Held; COMPARED] {
            let of = |i: usize| {
                let lines = lines.iter().filter(|l| wanted(l));
                lines.fold(Held::default(), |sum, l| sum + l.intervals[i])
            };
            std::array::from_fn(of)
        };
        let has = |l: &CorruptionLine, wanted: &dyn Fn(&Corruption) -> bool| {
            let way = POPULATION.iter().find(|(name, _)| *name == l.corrupted_by);
            way.is_some_and(|(_, ways)| ways.iter().any(wanted))
        };
        let other_muscle = |l: &CorruptionLine| has(l, &|w| matches!(w, Corruption::OtherMuscle(_)));
        let changes = |l: &CorruptionLine| has(l, &|w| matches!(w, Corruption::Driver(_)));
        let (intervals, intervals_at_t_nms) = (
            together(&|l| !changes(l)),
            together(&|l| !other_muscle(l) && !changes(l)),
        );
        let line = |name: &str| lines.iter().find(|l| l.corrupted_by == name);
        if let (Some(clean), Some(noisy)) = (line("clean"), line("lane noise 10 mm, 1 mrad")) {
            // Thirteen of the fourteen participants.
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
            plan: plan.clone(),
            seeds,
            lines,
            identified,
            false_identifications,
            intervals,
            intervals_at_t_nms,
            wheels: Vec::new(),
            bound,
            broken,
        }
    }
}
