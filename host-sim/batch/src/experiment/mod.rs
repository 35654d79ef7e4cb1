//! The paper's experiment over again, with drivers whose truth is known (sections 3 and 4).
//!
//! Each participant of tables 5 and 6 becomes a driver model with a remnant, drives the course without and with
//! guidance, is logged as the paper's apparatus logs, and is identified by both methods. The identified driver,
//! without remnant, then drives the course again (4.3), and its path is held against the one logged.
//!
//! Terms: *truth*, the published parameters that the synthetic driver was given; *trajectory error*, the mean
//! over the course of the distance between the path logged and the path driven again, at the same arc length.
//!
//! The remnant's size is ours: [`REMNANT_MANUAL_NM`] and [`REMNANT_GUIDED_NM`] bring the mean fit of the
//! published method near the paper's 76 % and 69 %. All drive the built-in course, as the paper's is not known.
//!
//! Not here: the estimators (`identify`), tables and figures (`experiment_files`), options (the command line).

mod drives;

use std::collections::BTreeMap;

use serde::Serialize;

pub use crate::engine::Recorder;
pub use crate::paper::{REMNANT_GUIDED_NM, REMNANT_MANUAL_NM};
pub use drives::{Driven, driven, driven_by, guided, scenario_of_drive};

use haptic_analysis::identify::{
    DriveLog, Identification, Options, identify_as_published, identify_with_noise_model,
};
use haptic_log::trace::Trace;
use haptic_sim::models::road::Course;
use haptic_sim::participants::{Participant, PublishedDriver, participant};
use haptic_sim::scenario::Scenario;

use crate::Away;
pub use crate::drivers::{COMPARED, Compared, Probe, compared, truth_of};
use crate::drivers::{Intervals, identified_driver, intervals};
use crate::engine::{StudyError, Watch, logs, runs};
use crate::statistics::Confidence;

/// The paper's trajectory errors with guidance over its participants: smallest, mean, largest, m (4.4).
pub const PUBLISHED_TRAJECTORY_ERROR_M: [f64; 3] = [0.154, 0.218, 0.366];

/// What to do.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ExperimentPlan {
    /// Numbers of the participants, 1 to 14.
    pub participants: Vec<u32>,
    /// Amplitude of the probe in the guided drives, N.m; zero for none.
    pub probe_nm: f64,
    /// Seed of the remnants.
    pub seed: u64,
}

impl ExperimentPlan {
    /// The drives of a repetition, from 0: other remnants.
    #[must_use]
    pub fn repetition(&self, number: u64) -> Self {
        Self {
            seed: self.seed.wrapping_add(number),
            ..self.clone()
        }
    }
}

/// What a study of drivers with a known truth found.
#[derive(Debug, Clone, Serialize)]
pub struct Experiment {
    /// Name of the course.
    pub course: String,
    /// Amplitude of the probe, N.m.
    pub probe_nm: f64,
    /// Seed.
    pub seed: u64,
    /// The paper's smallest, mean and largest trajectory error with guidance, m.
    pub published_trajectory_error_m: [f64; 3],
    /// By participant: manual, then guided.
    pub drives: Vec<Drive>,
    /// How often the intervals of the report hold.
    #[serde(skip_serializing_if = "Confidence::is_usual")]
    pub level: Confidence,
}

impl Experiment {
    /// Takes intervals of another level. What is called identified stays so: that is a matter of 95 %.
    pub fn hold_at(&mut self, level: Confidence) {
        self.level = level;
        for drive in &mut self.drives {
            for found in [&mut drive.noise_model, &mut drive.paper] {
                found.intervals = intervals(&found.identification, level);
            }
        }
    }
}

/// One drive and what was made of it.
#[derive(Debug, Clone, Serialize)]
pub struct Drive {
    /// Number of the participant.
    pub participant: u32,
    /// Whether there was guidance.
    pub guided: bool,
    /// What the driver was.
    pub truth: PublishedDriver,
    /// Standard deviation of the remnant, N.m.
    pub remnant_sd_nm: f64,
    /// When the guidance was away.
    #[serde(flatten)]
    pub away: Away,
    /// By the default method.
    pub noise_model: Finding,
    /// By the published method.
    pub paper: Finding,
    /// Path of the drive: arc length and lateral error, m.
    #[serde(skip)]
    pub path: Vec<(f64, f64)>,
    /// What was recorded.
    #[serde(skip)]
    pub log: DriveLog,
}

/// A driver as identified, and how it drives.
#[derive(Debug, Clone, Serialize)]
pub struct Finding {
    /// The identification.
    #[serde(flatten)]
    pub identification: Identification,
    /// Intervals of the experiment's level, where it is not 95 %: those stand beside each parameter.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub intervals: Intervals,
    /// Trajectory error of the identified driver, m; none if it leaves the road.
    pub trajectory_error_m: Option<f64>,
    /// When the guidance was away while the identified driver drove.
    #[serde(flatten)]
    pub away: Away,
    /// Path of the identified driver.
    #[serde(skip)]
    pub path: Vec<(f64, f64)>,
}

/// Drives, identifies and validates.
///
/// # Errors
/// An unknown participant; a probe that the controller refuses; a drive that differs from the shipping ECU's.
pub fn experiment(plan: &ExperimentPlan, watch: &Watch<'_>) -> Result<Experiment, StudyError> {
    let drives: Vec<_> = chosen(&plan.participants)?
        .into_iter()
        .flat_map(|p| [(p.number, p.manual), (p.number, p.guided)])
        .collect();
    let course = Course::paper();
    let scenario = |(number, truth): &(u32, PublishedDriver)| {
        scenario_of_drive(plan, *number, truth, truth.parameters())
    };
    let found = logs(
        &drives,
        plan.seed,
        watch,
        scenario,
        |(_, truth), scenario, run, log| {
            let driven = Driven::new(scenario, run, log);
            let found = identified(&driven, truth)?;
            Ok((driven, found))
        },
    )?;
    let (driven, found): (Vec<Driven>, Vec<[Identified; 2]>) = found.into_iter().unzip();
    let again: Vec<Scenario> = found.iter().flatten().map(|f| f.driver.clone()).collect();
    let own = |scenario: &Scenario| Ok(scenario.clone());
    let paths = runs(&again, plan.seed, &Watch::nobody(), own, |_, scenario, run| {
        let away = Away::new(scenario, &run.trace);
        Ok((path_of(&run.trace), run.diverged(), away))
    })?;
    let mut findings = found.into_iter().flatten().zip(paths);
    let drives = drives.into_iter().zip(driven).map(|((number, truth), driven)| {
        let Driven {
            scenario,
            log,
            path,
            away,
        } = driven;
        let mut finding = || {
            let (found, (again, diverged, away)) = findings.next()?;
            Some(Finding {
                trajectory_error_m: (!diverged).then(|| mean_distance(&path, &again)),
                away,
                path: again,
                identification: found.identification,
                intervals: Intervals::new(),
            })
        };
        let (noise_model, paper) = finding().zip(finding())?;
        Some(Drive {
            participant: number,
            guided: truth.k_hg.is_some(),
            truth,
            remnant_sd_nm: scenario.driver().remnant_sd_nm,
            away,
            noise_model,
            paper,
            path,
            log,
        })
    });
    let drives = drives.flatten().collect();
    Ok(Experiment {
        course: course.name().into(),
        probe_nm: plan.probe_nm,
        seed: plan.seed,
        published_trajectory_error_m: PUBLISHED_TRAJECTORY_ERROR_M,
        drives,
        level: Confidence::USUAL,
    })
}

/// The participants of these numbers.
///
/// # Errors
/// A number that none has.
pub fn chosen(numbers: &[u32]) -> Result<Vec<Participant>, StudyError> {
    let found = |&number| Ok(participant("participant", number)?);
    numbers.iter().map(found).collect()
}

/// What a method makes of a log, and the driver that it found.
struct Identified {
    identification: Identification,
    driver: Scenario,
}

/// By the default method, and by the published one.
fn identified(driven: &Driven, truth: &PublishedDriver) -> Result<[Identified; 2], StudyError> {
    let options = Options {
        manual: truth.k_hg.is_none(),
        ..Options::default()
    };
    let found = |identification: Identification| -> Result<Identified, StudyError> {
        let muscle = identification.muscle(options.muscle);
        Ok(Identified {
            driver: identified_driver(&driven.scenario, &identification, muscle)?,
            identification,
        })
    };
    Ok([
        found(identify_with_noise_model(&driven.log, &options))?,
        found(identify_as_published(&driven.log, &options)?)?,
    ])
}

fn path_of(trace: &Trace) -> Vec<(f64, f64)> {
    trace.samples.iter().map(|s| (s.s_m, s.lateral_error_m)).collect()
}

/// Mean of |lateral difference| of two paths over the arc length that both cover, at the first path's samples.
fn mean_distance(measured: &[(f64, f64)], again: &[(f64, f64)]) -> f64 {
    let mut k = 0;
    let (mut sum, mut count) = (0.0, 0);
    for &(s, lateral) in measured {
        while k + 1 < again.len() && again[k + 1].0 <= s {
            k += 1;
        }
        if k + 1 < again.len() && again[k].0 <= s {
            let (from, to) = (again[k], again[k + 1]);
            let there = from.1 + (s - from.0) / (to.0 - from.0) * (to.1 - from.1);
            sum += (lateral - there).abs();
            count += 1;
        }
    }
    sum / f64::from(count.max(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A path on the centreline against one that moves from 0 to 2 m to the right over 10 m: 1 m on average, and
    /// what lies beyond the second path's end does not count.
    #[test]
    fn the_distance_of_two_paths_is_taken_at_equal_arc_length() {
        let straight: Vec<(f64, f64)> = (0..=2000).map(|k| (f64::from(k) * 0.01, 0.0)).collect();
        let drifting = [(0.0, 0.0), (4.0, -0.8), (10.0, -2.0), (10.001, -2.0)];
        assert!((mean_distance(&straight, &drifting) - 1.0).abs() < 1e-3);
        assert_eq!(mean_distance(&straight, &straight[..1]), 0.0);
    }
}
