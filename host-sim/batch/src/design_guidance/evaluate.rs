//! A set of gains with every driver: lane error, effort, conflict, sudden losses, noise of the torque, stability.

use haptic_core::controller::params::Params;
use haptic_metrics::zero_phase_low_pass;
use haptic_sim::models::driver::DriverParameters;
use haptic_sim::participants::participants;
use haptic_sim::scenario::{FailureKind, GuidanceParameters, Scenario, ScenarioError};
use haptic_sim::simulation::{DIVERGED_M, Run};
use serde::{Deserialize, Serialize};

use super::{DesignGuidance, Gains, Member, Stage, published};
use crate::engine::{Faults, StudyError, Watch, failures, runs};
use crate::metrics::measured;
use crate::places::seed_of;
use crate::record::{check_rigid, growth};
use crate::statistics::rms;

/// What a set does with a driver, means over places and seeds: peak lateral error to the middle of the lane (m), mean of the size of T_d
/// (N.m), the same where it is against the guidance and 0 elsewhere (N.m), worst peak of all sudden losses of a drive (m), root mean
/// square of the guidance torque above 10 Hz (N.m).
pub type Figures = [f64; 5];
pub(super) const PEAK: usize = 0;
pub(super) const EFFORT: usize = 1;
pub(super) const CONFLICT: usize = 2;
pub(super) const LOSS: usize = 3;
pub(super) const NOISE: usize = 4;

/// A set that was evaluated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Evaluated {
    /// Whether on the held-out drives.
    pub held_out: bool,
    /// a_1' to a_4'.
    pub gains: Gains,
    /// Driver by driver.
    pub drivers: Vec<Figures>,
    /// The figures of each seed, driver by driver; none of the drives of the search.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub draws: Vec<Vec<Figures>>,
    /// Drivers at speeds at which the loop is unstable and with the paper's gains is not.
    pub unstable: u32,
}

/// How long a drive counts after a loss, s.
const LASTS_S: f64 = 15.0;
/// Above which the torque is noise: a driver's arm does not follow, Hz.
const NOISE_HZ: f64 = 10.0;
/// Speeds at which the loop has to be stable, km/h.
const STABLE_KMH: [f64; 6] = [35.0, 50.0, 60.0, 80.0, 100.0, 120.0];

impl DesignGuidance {
    /// A driver with a set of gains.
    pub(super) fn scenario(
        &self,
        place: &Scenario,
        member: Member,
        gains: Gains,
        seed: u64,
    ) -> Result<Scenario, ScenarioError> {
        let all = participants();
        let of = &all[member.participant as usize - 1];
        let given = place.driver();
        let driver = DriverParameters {
            a_1: of.guided.a_1,
            a_2: of.guided.a_2,
            a_3: of.guided.a_3,
            t_p: of.guided.t_p,
            line_m: member.line_m,
            ..*given
        };
        let guidance = place.guidance();
        let [a_1, a_2, a_3, a_4] = gains;
        let controller = Params {
            a_1,
            a_2,
            a_3,
            a_4,
            ..guidance.controller
        };
        let guidance = GuidanceParameters {
            controller,
            ..*guidance
        };
        let builder = place
            .to_builder()
            .driver(driver)
            .gains(of.guided.gains())
            .manual_k_d(of.manual.k_d);
        builder.guidance(guidance).seed(seed).build()
    }

    /// Drives a set, with every driver at every place.
    ///
    /// # Errors
    /// A value that a scenario refuses; a drive that differs from the shipping ECU's.
    pub(super) fn evaluate(&self, gains: Gains, held_out: bool) -> Result<Evaluated, StudyError> {
        let stage = &self.stages[usize::from(held_out)];
        let faults = Faults {
            sudden_loss: stage.losses,
            silent_lane: 0,
            lasts_s: LASTS_S,
        };
        let mut scenarios = Vec::new();
        for member in &stage.drivers {
            for ((road, kmh), place) in stage.places.iter().zip(&stage.scenarios) {
                for number in 0..stage.seeds {
                    let seed = seed_of(self.seed, stage.stream, road, *kmh, number);
                    let nominal = self.scenario(place, *member, gains, seed)?;
                    let failed = failures(&nominal, faults).into_iter();
                    let failed = failed.map(|(_, failure)| nominal.to_builder().failure(failure).build());
                    let failed: Vec<Scenario> = failed.collect::<Result<_, _>>()?;
                    scenarios.push(nominal);
                    scenarios.extend(failed);
                }
            }
        }
        let own = |scenario: &Scenario| Ok(scenario.clone());
        let found = runs(
            &scenarios,
            self.seed,
            &Watch::nobody(),
            own,
            |_, scenario, run| Ok(figures(scenario, run)),
        )?;
        let each = found.len() / stage.drivers.len();
        let losses = stage.losses as usize;
        let draw = |number: usize| -> Vec<Figures> {
            let of_driver = |runs: &[Figures]| {
                let drives = runs.chunks(1 + losses).skip(number).step_by(stage.seeds as usize);
                mean(&drives.collect::<Vec<_>>().concat(), losses)
            };
            found.chunks(each).map(of_driver).collect()
        };
        let draws = if held_out { stage.seeds as usize } else { 0 };
        Ok(Evaluated {
            held_out,
            gains,
            drivers: found.chunks(each).map(|runs| mean(runs, losses)).collect(),
            draws: (0..draws).map(draw).collect(),
            unstable: self.unstable(gains, stage)?,
        })
    }

    fn unstable(&self, gains: Gains, stage: &Stage) -> Result<u32, StudyError> {
        let mut unstable = 0;
        for member in &stage.drivers {
            for kmh in STABLE_KMH {
                let growth = |gains: Gains| -> Result<f64, StudyError> {
                    let scenario = self.scenario(&stage.scenarios[0], *member, gains, 1)?;
                    let scenario = scenario.to_builder().speed_kmh(kmh).build()?;
                    check_rigid(&scenario)?;
                    Ok(growth(&scenario, Some(&scenario.guidance().controller)))
                };
                unstable += u32::from(growth(gains)? >= 0.0 && growth(published())? < 0.0);
            }
        }
        Ok(unstable)
    }
}

/// What a run tells: all but the loss of one without failure, the loss alone of one with it.
fn figures(scenario: &Scenario, run: &Run) -> Figures {
    let samples = &run.trace.samples;
    if scenario.failure().kind == FailureKind::None {
        let [peak, _, _, _, effort, _, conflict, ..] = measured(scenario, &run.trace, run.diverged(), &[]);
        let [peak, effort, conflict] = [peak, effort, conflict].map(|value| value.unwrap_or(0.0));
        return [peak, effort, conflict, 0.0, noise_nm(run)];
    }
    let from_s = scenario.failure().time_s;
    let counted = samples
        .iter()
        .filter(|s| s.time_s >= from_s && s.time_s < from_s + LASTS_S);
    let ends_s = samples.last().map_or(0.0, |s| s.time_s);
    let loss_m = if run.diverged() && ends_s < from_s + LASTS_S {
        DIVERGED_M
    } else {
        counted.map(|s| s.lateral_error_m.abs()).fold(0.0, f64::max)
    };
    [0.0, 0.0, 0.0, loss_m, 0.0]
}

fn noise_nm(run: &Run) -> f64 {
    let torque: Vec<f64> = run.trace.samples.iter().map(|s| s.guidance_torque_nm).collect();
    let slow = zero_phase_low_pass(&torque, run.trace.sample_rate_hz, NOISE_HZ);
    let slow = slow.unwrap_or_else(|| torque.clone());
    let fast = torque.iter().zip(&slow).map(|(all, slow)| all - slow);
    rms(fast).unwrap_or(0.0)
}

/// The mean of drives, each followed by its losses; a drive's loss is its worst.
fn mean(runs: &[Figures], losses: usize) -> Figures {
    let drives = runs.chunks(1 + losses);
    let count = drives.len() as f64;
    let mut mean = [0.0; 5];
    for drive in drives {
        let worst_m = drive.iter().map(|run| run[LOSS]).fold(0.0, f64::max);
        for (place, sum) in mean.iter_mut().enumerate() {
            *sum += if place == LOSS { worst_m } else { drive[0][place] } / count;
        }
    }
    mean
}
