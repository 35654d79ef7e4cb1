//! One drive of a study of two adaptations.

use haptic_sim::Action;
use haptic_sim::laws::Law as _;
use haptic_sim::models::STEPS_PER_SECOND;
use haptic_sim::parts::Driver as _;
use haptic_sim::scenario::{Failure, FailureKind};

use super::Adaptation;
use crate::engine::{StudyError, trunk};
use crate::places::seed_of;

/// So slowly trust follows where K_hg is held, s: by less than 0.001 in a drive.
const HELD_S: f64 = 1e6;

/// A drive to be done.
#[derive(Debug, Clone, Copy)]
pub(super) struct Job {
    pub(super) driver: usize,
    pub(super) seed: u32,
    pub(super) what: What,
}

/// What is free in a drive.
#[derive(Debug, Clone, Copy)]
pub(super) enum What {
    /// At a fixed gain, from a K_hg.
    Fixed { k_1: f64, begins: f64 },
    /// Under a law, at a K_hg that is held.
    Held { law: usize, k_hg: f64 },
    /// Under a law, with a loss.
    Free { law: usize },
}

/// What adapts, in the mean of a second.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Seen {
    /// The driver's true K_hg.
    pub k_hg: f64,
    /// The law's K_1, N.m.
    pub k_1: f64,
}

/// What came of a drive.
#[derive(Debug, Clone)]
pub(super) struct Driven {
    pub(super) series: Vec<Seen>,
    /// Whether it left the road, or the ECU ended guidance by itself.
    pub(super) ended: bool,
}

impl Driven {
    /// The values between two times, s.
    pub(super) fn within(&self, [from_s, to_s]: [f64; 2], value: fn(&Seen) -> f64) -> Vec<f64> {
        let seconds = self.series.iter().take(to_s as usize).skip(from_s as usize);
        seconds.map(value).collect()
    }

    /// Their mean; none if the drive ended before.
    pub(super) fn mean(&self, window: [f64; 2], value: fn(&Seen) -> f64) -> Option<f64> {
        let values = self.within(window, value);
        let whole = values.len() == window[1] as usize - window[0] as usize;
        whole.then(|| values.iter().sum::<f64>() / values.len() as f64)
    }
}

impl Adaptation<'_> {
    pub(super) fn driven(&self, job: &Job) -> Result<Driven, StudyError> {
        let (road, speed_kmh, scenario) = &self.place;
        let mut builder =
            scenario
                .to_builder()
                .seed(seed_of(self.seed, "adaptation", road, *speed_kmh, job.seed));
        let chosen = &self.drivers[job.driver];
        let (law, values, changed, lasts_s) = match job.what {
            What::Fixed { k_1, begins } => {
                let mut values = self.fixed.untuned();
                values[0] = k_1;
                (&self.fixed, values, vec![("k_hg", begins)], self.times.map_s())
            }
            What::Held { law, k_hg } => {
                let law = &self.laws[law];
                let held = vec![("k_hg", k_hg), ("tau_s", HELD_S)];
                (law, law.untuned(), held, self.times.map_s())
            }
            What::Free { law } => {
                builder = builder.failure(Failure {
                    kind: FailureKind::Torque,
                    time_s: self.times.lost_at_s,
                    duration_s: Some(self.times.lost_for_s),
                });
                let law = &self.laws[law];
                (law, law.untuned(), Vec::new(), self.times.loop_s())
            }
        };
        let scenario = builder.build()?;
        let driver = chosen.with_habit("trust", &changed);
        let driver = driver.untuned_part(&scenario)?;
        let law = law.make(&scenario, &values)?;
        let mut simulation = trunk(&scenario, law, driver);
        let mut left = false;
        let mut series = Vec::with_capacity(lasts_s as usize);
        let mut sum = Seen::default();
        let last = lasts_s as u32 * STEPS_PER_SECOND;
        let each = 1.0 / f64::from(STEPS_PER_SECOND);
        while simulation.steps() < last {
            let Some(outcome) = simulation.step(&Action::default()) else {
                break;
            };
            left |= outcome.unguided.is_some_and(|why| !why.is_asked_for());
            // The file was checked: both have one.
            sum.k_hg += each * simulation.driver_vehicle().driver.k_hg().unwrap_or(f64::NAN);
            sum.k_1 += each * simulation.guidance().law().k_1().unwrap_or(f64::NAN);
            if simulation.steps().is_multiple_of(STEPS_PER_SECOND) {
                series.push(std::mem::take(&mut sum));
            }
        }
        let ended = left || simulation.steps() < last;
        Ok(Driven { series, ended })
    }
}
