//! Runs that are the same until something fails: what they have in common is driven once.

use haptic_log::trace::{Sample, Trace};

use crate::action::Action;
use crate::guidance::{AnyGuidance, Guidance};
use crate::scenario::{Failure, FailureKind, Scenario, ScenarioError};
use crate::simulation::{Ending, Run, SAMPLE_RATE_HZ, Simulation};

/// The run of a scenario without its failure, and those with each of the failures, in their order: the same bits as
/// [`simulate`](crate::simulation::simulate) of each.
///
/// # Errors
/// As [`ScenarioBuilder::build`](crate::scenario::ScenarioBuilder::build): a failure where there is no guidance.
pub fn simulate_forked(scenario: &Scenario, failures: &[Failure]) -> Result<(Run, Vec<Run>), ScenarioError> {
    let with = |failure| scenario.to_builder().failure(failure).build();
    for failure in failures {
        with(*failure)?;
    }
    let trunk = with(Failure {
        kind: FailureKind::None,
        ..scenario.failure()
    })?;
    Ok(match AnyGuidance::new(&trunk) {
        AnyGuidance::None(guidance) => forked(Simulation::with(&trunk, guidance), failures),
        AnyGuidance::Direct(guidance) => forked(Simulation::with(&trunk, *guidance), failures),
        AnyGuidance::OverBus(guidance) => forked(Simulation::with(&trunk, *guidance), failures),
    })
}

fn forked<G: Guidance + Clone>(mut trunk: Simulation<G>, failures: &[Failure]) -> (Run, Vec<Run>) {
    let mut samples = Vec::new();
    let mut order: Vec<usize> = (0..failures.len()).collect();
    order.sort_by(|a, b| failures[*a].time_s.total_cmp(&failures[*b].time_s));
    let mut runs: Vec<Option<Run>> = vec![None; failures.len()];
    for place in order {
        let branch = loop {
            if let Some(branch) = trunk.fork_at(failures[place]) {
                break branch;
            }
            if !drive(&mut trunk, &mut samples) {
                break trunk.clone();
            }
        };
        runs[place] = Some(finish(branch, samples.clone()));
    }
    (finish(trunk, samples), runs.into_iter().flatten().collect())
}

/// One step; whether there was one.
fn drive<G: Guidance>(simulation: &mut Simulation<G>, samples: &mut Vec<Sample>) -> bool {
    let Some(outcome) = simulation.step(&Action::default()) else {
        return false;
    };
    samples.extend(outcome.sample);
    true
}

fn finish<G: Guidance>(mut simulation: Simulation<G>, mut samples: Vec<Sample>) -> Run {
    while drive(&mut simulation, &mut samples) {}
    Run {
        trace: Trace {
            sample_rate_hz: f64::from(SAMPLE_RATE_HZ),
            samples,
        },
        ending: simulation.ending().unwrap_or(Ending::CourseEnd),
        steps: simulation.steps(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::driver::DriverParameters;
    use crate::scenario::Condition;
    use crate::simulation::simulate;

    /// The engine that drives each by itself is the oracle: every sample, to the last bit.
    #[test]
    fn a_fork_is_the_run_that_was_driven_by_itself() {
        let driver = DriverParameters {
            t_p: 0.5,
            remnant_sd_nm: 0.05,
            ..Default::default()
        };
        let scenario = Scenario::builder()
            .condition(Condition::High)
            .driver(driver)
            .build()
            .unwrap();
        let failure = |kind, time_s| Failure {
            kind,
            time_s,
            duration_s: None,
        };
        let failures = [
            failure(FailureKind::Input, 75.003),
            failure(FailureKind::Torque, 70.0),
            failure(FailureKind::None, 3.0),
            failure(FailureKind::Torque, 0.0),
            failure(FailureKind::Torque, 1e6),
        ];
        let (nominal, runs) = simulate_forked(&scenario, &failures).unwrap();
        assert_eq!(nominal, simulate(&scenario));
        assert_eq!(runs.len(), failures.len());
        for (run, failure) in runs.iter().zip(failures) {
            let alone = simulate(&scenario.to_builder().failure(failure).build().unwrap());
            assert_eq!(*run, alone, "{failure:?}");
        }
        assert_ne!(runs[0].trace, runs[1].trace);
        let manual = Scenario::builder().condition(Condition::Manual).build().unwrap();
        assert!(simulate_forked(&manual, &failures).is_err());
        assert_eq!(simulate_forked(&manual, &[]).unwrap().0, simulate(&manual));
    }
}
