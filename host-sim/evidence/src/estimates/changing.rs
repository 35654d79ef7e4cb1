//! Drivers who change while they drive.

use haptic_analysis::identify::DriveLog;
use haptic_sim::Action;
use haptic_sim::models::STEP_S;
use haptic_sim::models::driver::DriverParameters;
use haptic_sim::participants::PublishedDriver;
use haptic_sim::scenario::{Scenario, ScenarioError};
use haptic_sim::simulation::Simulation;

use haptic_batch::experiment::Recorder;

/// Steps of 1 ms from one value of a drift to the next.
const DRIFT_STEPS: u32 = 100;

/// What of a driver changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Changed {
    /// K_hg.
    KHg,
    /// K_d, and with it all gains.
    KD,
    /// t_p.
    TP,
}

/// A change of the driver: a parameter goes to a value, on a straight line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriverChanges {
    /// What changes.
    pub what: Changed,
    /// To which value, in the parameter's unit.
    pub to: f64,
    /// From when on, s.
    pub at_s: f64,
    /// For how long, s: 0 is a step.
    pub over_s: f64,
}

impl Changed {
    /// Its value.
    pub fn value(self, driver: &PublishedDriver) -> f64 {
        match self {
            Self::KHg => driver.k_hg.unwrap_or(0.0),
            Self::KD => driver.k_d,
            Self::TP => driver.t_p,
        }
    }

    fn set(self, driver: &mut PublishedDriver, value: f64) {
        match self {
            Self::KHg => driver.k_hg = Some(value),
            Self::KD => driver.k_d = value,
            Self::TP => driver.t_p = value,
        }
    }
}

/// The driver at a time, s; `changes` are in the order of their times.
pub fn driver_at(first: &PublishedDriver, changes: &[DriverChanges], time_s: f64) -> PublishedDriver {
    let mut now = *first;
    for change in changes.iter().filter(|c| c.at_s <= time_s) {
        let share = if change.over_s > 0.0 {
            ((time_s - change.at_s) / change.over_s).min(1.0)
        } else {
            1.0
        };
        let from = change.what.value(&now);
        change.what.set(&mut now, from + share * (change.to - from));
    }
    now
}

/// The log of a drive of `scenario`, whose driver `first` changes; `host` asks at each time, s.
///
/// # Errors
/// A value that no scenario takes.
pub(super) fn driven_changing(
    scenario: &Scenario,
    first: &PublishedDriver,
    changes: &[DriverChanges],
    host: impl Fn(f64) -> Action,
) -> Result<DriveLog, ScenarioError> {
    let mut simulation = Simulation::new(scenario);
    let mut recorder = Recorder::new(true);
    loop {
        let step = simulation.steps();
        let time_s = STEP_S * f64::from(step);
        let due = changes.iter().any(|change| {
            let since = (change.at_s / STEP_S) as u32;
            // An interval more than it lasts, so that a drift reaches its last value.
            let until = since + (change.over_s / STEP_S) as u32 + DRIFT_STEPS;
            (since..=until).contains(&step) && (step - since).is_multiple_of(DRIFT_STEPS)
        });
        if due {
            let now = driver_at(first, changes, time_s);
            let driver = DriverParameters {
                t_p: now.t_p,
                ..*scenario.driver()
            };
            let to = scenario.to_builder().driver(driver).gains(now.gains());
            simulation.driver_vehicle_mut().change_driver(&to.build()?);
        }
        let Some(outcome) = simulation.step(&host(time_s)) else {
            return Ok(recorder.into_log());
        };
        recorder.observe(&outcome);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptic_batch::experiment::scenario_of_drive;
    use haptic_batch::experiment::{ExperimentPlan, chosen};

    /// A driver who changes to what he is leaves the log of one who does not; one who changes leaves the same log up to there.
    #[test]
    fn a_change_to_the_same_changes_nothing() {
        let plan = ExperimentPlan {
            participants: vec![2],
            probe_nm: 0.2,
            seed: 3,
        };
        let truth = chosen(&plan.participants).unwrap()[0].guided;
        let scenario = scenario_of_drive(&plan, 2, &truth, truth.parameters()).unwrap();
        let drive = |to: f64| {
            let change = DriverChanges {
                what: Changed::TP,
                to,
                at_s: 50.0,
                over_s: 10.0,
            };
            driven_changing(&scenario, &truth, &[change], |_| Action::default()).unwrap()
        };
        let (same, other) = (drive(truth.t_p), drive(0.1));
        let constant = driven_changing(&scenario, &truth, &[], |_| Action::default()).unwrap();
        assert_eq!(same, constant);
        assert_eq!(other.driver_torque_nm[..6000], constant.driver_torque_nm[..6000]);
        assert_ne!(
            other.driver_torque_nm[6000..6600],
            constant.driver_torque_nm[6000..6600]
        );
    }

    #[test]
    fn a_drift_is_half_way_at_half_its_time() {
        let first = chosen(&[2]).unwrap()[0].guided;
        let drift = DriverChanges {
            what: Changed::KHg,
            to: 0.8,
            at_s: 20.0,
            over_s: 60.0,
        };
        let k_hg = |t| driver_at(&first, &[drift], t).k_hg.unwrap();
        let before = first.k_hg.unwrap();
        assert_eq!([k_hg(19.9), k_hg(81.0)], [before, 0.8]);
        assert!((k_hg(50.0) - 0.5 * (before + 0.8)).abs() < 1e-12);
    }
}
