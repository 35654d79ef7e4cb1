//! The drives of published drivers, logged: side by side where that can be, every step reported.

use haptic_analysis::identify::DriveLog;
use haptic_sim::models::driver::DriverParameters;
use haptic_sim::participants::{Participant, PublishedDriver};
use haptic_sim::scenario::{Condition, GuidanceParameters, Scenario};
use haptic_sim::simulation::Run;

use super::{ExperimentPlan, REMNANT_GUIDED_NM, REMNANT_MANUAL_NM, chosen, path_of};
use crate::Away;
use crate::engine::{StudyError, recorded};

/// A drive with what is needed to judge it.
pub struct Driven {
    /// What was driven.
    pub scenario: Scenario,
    /// How it was recorded.
    pub log: DriveLog,
    pub(super) path: Vec<(f64, f64)>,
    /// When the guidance was away.
    pub away: Away,
}

/// The guided drives of a plan, each participant so often: number, driver, and what counts on from the plan's seed.
///
/// # Errors
/// An unknown participant.
pub fn guided(plan: &ExperimentPlan, drives: u32) -> Result<Vec<(u32, PublishedDriver, u64)>, StudyError> {
    let chosen = chosen(&plan.participants)?;
    let of = |p: &Participant| {
        let (number, driver) = (p.number, p.guided);
        (0..u64::from(drives)).map(move |drive| (number, driver, drive))
    };
    Ok(chosen.iter().flat_map(of).collect())
}

/// Lets a published driver drive alone, with a remnant and the paper's sensors.
///
/// # Errors
/// A probe that the controller refuses.
pub fn driven(plan: &ExperimentPlan, number: u32, truth: &PublishedDriver) -> Result<Driven, StudyError> {
    driven_by(plan, number, truth, truth.parameters())
}

/// Lets a driver drive who differs from the published one in what the log does not name.
///
/// # Errors
/// A probe that the controller refuses.
pub fn driven_by(
    plan: &ExperimentPlan,
    number: u32,
    truth: &PublishedDriver,
    driver: DriverParameters,
) -> Result<Driven, StudyError> {
    Ok(Driven::alone(&scenario_of_drive(plan, number, truth, driver)?))
}

/// What a published driver drives with a remnant and the paper's sensors.
///
/// # Errors
/// A probe that the controller refuses.
pub fn scenario_of_drive(
    plan: &ExperimentPlan,
    number: u32,
    truth: &PublishedDriver,
    driver: DriverParameters,
) -> Result<Scenario, StudyError> {
    let guided = truth.k_hg.is_some();
    let seed = plan
        .seed
        .wrapping_mul(1000)
        .wrapping_add(u64::from(2 * number) + u64::from(guided));
    let (condition, remnant_sd_nm) = match truth.k_hg {
        Some(_) => (Condition::Custom, REMNANT_GUIDED_NM),
        None => (Condition::Manual, REMNANT_MANUAL_NM),
    };
    let mut guidance = GuidanceParameters::default();
    if plan.probe_nm != 0.0 && guided {
        guidance.probe = true;
        guidance.controller.probe_amplitude_nm = plan.probe_nm;
    }
    let driver = DriverParameters {
        remnant_sd_nm,
        ..driver
    };
    let scenario = Scenario::builder()
        .driver(driver)
        .condition(condition)
        .gains(truth.gains())
        .guidance(guidance)
        .seed(seed);
    Ok(scenario.build()?)
}

impl Driven {
    pub(super) fn new(scenario: &Scenario, run: &Run, log: DriveLog) -> Self {
        Self {
            scenario: scenario.clone(),
            log,
            path: path_of(&run.trace),
            away: Away::new(scenario, &run.trace),
        }
    }

    fn alone(scenario: &Scenario) -> Self {
        let (run, log) = recorded(scenario);
        Self::new(scenario, &run, log)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::{Watch, logs};

    /// Every value of every row: from the steps of vectorised runs as from those of the shipping ECU, with and without guidance
    /// and probe, and where a run is rejected.
    #[test]
    fn a_log_does_not_depend_on_lanes() {
        let plan = |probe_nm| ExperimentPlan {
            participants: vec![2, 9],
            probe_nm,
            seed: 3,
        };
        let mut scenarios = Vec::new();
        for participant in chosen(&plan(0.0).participants).unwrap() {
            for truth in [participant.manual, participant.guided] {
                for probe_nm in [0.0, 0.2] {
                    let plan = plan(probe_nm);
                    let scenario = scenario_of_drive(&plan, participant.number, &truth, truth.parameters());
                    scenarios.push(scenario.unwrap());
                }
            }
        }
        let exact = scenarios[2]
            .to_builder()
            .sensors(haptic_sim::scenario::Sensors::Exact);
        scenarios.push(exact.build().unwrap());
        let out = |scenario: &&Scenario| haptic_vectorised::unsupported_reason(scenario).is_some();
        assert_eq!(scenarios.iter().filter(out).count(), 1);
        let bits = |driven: &Driven| {
            let columns = driven.log.signals();
            columns.map(|column| column.iter().map(|value| value.to_bits()).collect::<Vec<_>>())
        };
        let clone = |scenario: &Scenario| Ok(scenario.clone());
        let measure = |_: &_, scenario: &_, run: &_, log| Ok(Driven::new(scenario, run, log));
        let found = logs(&scenarios, 1, &Watch::nobody(), clone, measure).unwrap();
        assert_eq!(found.len(), scenarios.len());
        for (driven, scenario) in found.iter().zip(&scenarios) {
            let alone = Driven::alone(scenario);
            assert!(driven.log.len() > 20_000);
            assert_eq!(bits(driven), bits(&alone));
            assert_eq!((&driven.path, &driven.scenario), (&alone.path, scenario));
        }
    }
}
