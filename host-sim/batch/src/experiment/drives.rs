//! The drives of published drivers, logged: side by side where that can be, every step reported.

use haptic_analysis::identify::DriveLog;
use haptic_sim::models::driver::DriverParameters;
use haptic_sim::models::road::Course;
use haptic_sim::participants::{Participant, PublishedDriver};
use haptic_sim::scenario::{Condition, GuidanceParameters, Scenario};
use haptic_sim::simulation;
use haptic_vectorised::{Event, Options};

use super::{ExperimentPlan, Probe, REMNANT_GUIDED_NM, REMNANT_MANUAL_NM, Recorder, chosen, path_of};
use crate::Away;
use crate::error::StudyError;
use crate::vectorised::{Checked, Group, in_groups};

/// A drive with what is needed to judge it.
pub struct Driven {
    /// What was driven.
    pub scenario: Scenario,
    /// As it was recorded.
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

/// [`driven`] by a driver who differs from the published one in what the log does not name.
///
/// # Errors
/// A probe that the controller refuses.
pub fn driven_by(
    plan: &ExperimentPlan,
    number: u32,
    truth: &PublishedDriver,
    driver: DriverParameters,
) -> Result<Driven, StudyError> {
    Ok(driven_alone(&scenario_of_drive(plan, number, truth, driver)?))
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
    let scenario = scenario_of(plan, truth, seed)?;
    let remnant_sd_nm = if guided {
        REMNANT_GUIDED_NM
    } else {
        REMNANT_MANUAL_NM
    };
    let driver = DriverParameters {
        remnant_sd_nm,
        ..driver
    };
    Ok(scenario.to_builder().driver(driver).build()?)
}

pub(super) fn driven_alone(scenario: &Scenario) -> Driven {
    let mut recorder = Recorder::new(true);
    let run = simulation::observe(scenario, |outcome| recorder.observe(outcome));
    Driven {
        scenario: scenario.clone(),
        log: recorder.into_log(),
        path: path_of(&run.trace),
        away: Away::new(scenario, &run.trace),
    }
}

/// Drives a scenario for each job on all cores, side by side where that can be, and gives what `judge` makes of its log. Group by
/// group: the logs of all drives at once may be too many.
///
/// # Errors
/// What `scenario` says; a drive that differs from the shipping ECU's.
pub fn log_each<J: Sync, T: Send>(
    jobs: &[J],
    seed: u64,
    scenario: impl Fn(&J) -> Result<Scenario, StudyError> + Sync,
    judge: impl Fn(Driven, &J) -> T + Sync,
) -> Result<Vec<T>, StudyError> {
    let checked = Checked::new(seed, jobs.len() as u64);
    in_groups(jobs, |first, jobs| {
        let scenarios: Vec<Scenario> = jobs.iter().map(&scenario).collect::<Result<_, _>>()?;
        let driven = log_group(Group {
            scenarios: &scenarios,
            first: first as u64,
            checked,
        })?;
        Ok(driven
            .into_iter()
            .zip(jobs)
            .map(|(driven, job)| judge(driven, job))
            .collect())
    })
}

/// The drives of a group, logged.
fn log_group(group: Group) -> Result<Vec<Driven>, StudyError> {
    let scenarios = group.scenarios;
    let options = Options {
        every_step: true,
        ..Options::default()
    };
    let mut recorders = vec![Recorder::new(true); scenarios.len()];
    let mut all: Vec<Option<Driven>> = scenarios.iter().map(|_| None).collect();
    let alone = |place: usize| simulation::simulate(&scenarios[place]);
    let rejected = group.run_batch(options, alone, |place, event| {
        match event {
            Event::Steps(steps) => steps.iter().for_each(|step| recorders[place].take(*step)),
            Event::Ended(run) => {
                all[place] = Some(Driven {
                    scenario: scenarios[place].clone(),
                    log: std::mem::replace(&mut recorders[place], Recorder::new(true)).into_log(),
                    path: path_of(&run.trace),
                    away: Away::new(&scenarios[place], &run.trace),
                });
            }
            Event::Rejected(_) => (),
        }
        Ok(())
    })?;
    for place in rejected {
        all[place] = Some(driven_alone(&scenarios[place]));
    }
    Ok(all.into_iter().flatten().collect())
}

/// A guided drive of a published driver with the remnant and the paper's sensors, on any course (the built-in one if
/// none), as it is logged.
///
/// # Errors
/// A course that is too short; a probe that the controller refuses.
pub fn recorded(
    driver: &PublishedDriver,
    course: Option<&Course>,
    probe: Option<Probe>,
    seed: u64,
) -> Result<DriveLog, StudyError> {
    Ok(driven_alone(&guided_drive(driver, course, probe, seed)?).log)
}

/// The scenario of that drive.
///
/// # Errors
/// A course that is too short; a probe that the controller refuses.
pub(crate) fn guided_drive(
    driver: &PublishedDriver,
    course: Option<&Course>,
    probe: Option<Probe>,
    seed: u64,
) -> Result<Scenario, StudyError> {
    let mut scenario = Scenario::builder()
        .driver(DriverParameters {
            remnant_sd_nm: REMNANT_GUIDED_NM,
            ..driver.parameters()
        })
        .condition(Condition::Custom)
        .gains(driver.gains())
        .guidance(probe.map_or_else(GuidanceParameters::default, Probe::guidance))
        .seed(seed);
    if let Some(course) = course {
        scenario = scenario.course(course.clone());
    }
    Ok(scenario.build()?)
}

/// The drive of a published driver, without remnant.
fn scenario_of(plan: &ExperimentPlan, driver: &PublishedDriver, seed: u64) -> Result<Scenario, StudyError> {
    let condition = match driver.k_hg {
        Some(_) => Condition::Custom,
        None => Condition::Manual,
    };
    let mut guidance = GuidanceParameters::default();
    if plan.probe_nm != 0.0 && condition != Condition::Manual {
        guidance.probe = true;
        guidance.controller.probe_amplitude_nm = plan.probe_nm;
    }
    let scenario = Scenario::builder()
        .driver(driver.parameters())
        .condition(condition)
        .gains(driver.gains())
        .guidance(guidance)
        .seed(seed);
    Ok(scenario.build()?)
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let found = log_each(&scenarios, 1, clone, |driven, _| driven).unwrap();
        assert_eq!(found.len(), scenarios.len());
        for (driven, scenario) in found.iter().zip(&scenarios) {
            let alone = driven_alone(scenario);
            assert!(driven.log.len() > 20_000);
            assert_eq!(bits(driven), bits(&alone));
            assert_eq!((&driven.path, &driven.scenario), (&alone.path, scenario));
        }
    }
}
