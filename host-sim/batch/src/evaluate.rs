//! Section 5 of the paper: three drivers (table 7) under four conditions, and again with a failure of the
//! guidance. A manual run has no failure run, so there are 21. Beyond the paper, 9 more in which the guidance's
//! input fails, and the ECU hands over.

use rayon::prelude::*;

use super::RunRecord;
use super::claims;
pub use super::evaluation_results::{DRIVERS_T_P, EvaluationResults};
use super::record::{default_window, failure_notes, nominal_peak_m};
use super::vectorised::run_batched;
use crate::error::StudyError;
use haptic_analysis::metrics::Window;
use haptic_sim::fork::simulate_forked;
use haptic_sim::models::driver::DriverParameters;
use haptic_sim::scenario::{Condition, Failure, FailureKind, Scenario, ScenarioError};
use haptic_sim::simulation::Run;

/// Runs of an evaluation: 3 drivers x (4 conditions + 2 x 3 that can fail).
pub const RUNS: usize = 30;

/// An evaluation with everything that was simulated.
#[derive(Debug, Clone)]
pub struct Evaluation {
    /// The runs of section 5, driver by driver: nominal ones first, then those with failure. Behind them the
    /// runs whose guidance input fails.
    pub runs: Vec<(Scenario, Run)>,
    /// What is handed on.
    pub results: EvaluationResults,
}

/// Runs the evaluation on all cores. `base` gives course, speed, sensors, vehicle, guidance and the time of the
/// failure; its driver's delay, condition and kind of failure are varied. `progress` is called after each run.
///
/// # Errors
/// A manual base that has what takes guidance; a window that does not lie where the runs drive.
pub fn evaluate(
    base: &Scenario,
    window: Option<Window>,
    progress: impl Fn() + Sync,
) -> Result<Evaluation, StudyError> {
    let window = window.unwrap_or_else(|| default_window(base.course()));
    super::check_window(window, base)?;
    let mut runs = drive(families(base)?, base.seed(), &progress)?;
    // Driver by driver: without failure, with the sudden loss; behind all of them the lost inputs. Stable.
    let place = |scenario: &Scenario| match scenario.failure().kind {
        FailureKind::Input => usize::MAX,
        kind => {
            let driver = DRIVERS_T_P
                .iter()
                .position(|t_p| *t_p == scenario.driver().t_p)
                .unwrap_or(0);
            2 * driver + usize::from(kind == FailureKind::Torque)
        }
    };
    runs.sort_by_key(|(scenario, _)| place(scenario));

    let peak_without_failure = |failed: &Scenario| {
        let failure_time_s = failed.failure().at_s()?;
        let (_, run) = runs.iter().find(|(scenario, _)| {
            let same = scenario.driver() == failed.driver() && scenario.condition() == failed.condition();
            same && scenario.failure().kind == FailureKind::None
        })?;
        nominal_peak_m(run, window, failure_time_s)
    };
    let records: Vec<_> = runs
        .iter()
        .map(|(scenario, run)| RunRecord::new(scenario, run, window, peak_without_failure(scenario)))
        .collect();
    let notes = failure_notes(base.failure().time_s, &records, window);
    let mut results = EvaluationResults {
        course: base.course().name().into(),
        course_length_m: base.course().length_m(),
        speed_kmh: base.speed_kmh(),
        failure_time_s: base.failure().time_s,
        sensors: base.sensors(),
        window_m: [window.from_m, window.to_m],
        runs: records,
        claims: Vec::new(),
        notes,
    };
    if claims::apply_to(base, window) {
        results.claims = claims::check(&results, &runs);
    } else {
        results.notes.push(claims::NONE_APPLIES.into());
    }
    results.claims.extend(claims::guided_throughout(&results));
    Ok(Evaluation { runs, results })
}

/// A driver under a condition, and what fails: driven together until it does.
struct Family {
    nominal: Scenario,
    failing: Vec<Scenario>,
}

fn families(base: &Scenario) -> Result<Vec<Family>, ScenarioError> {
    let mut families = Vec::with_capacity(RUNS);
    for t_p in DRIVERS_T_P {
        for condition in Condition::ALL {
            let driver = DriverParameters {
                t_p,
                ..*base.driver()
            };
            let with = |kind| {
                let failure = Failure {
                    kind,
                    ..base.failure()
                };
                let scenario = base.to_builder().condition(condition).driver(driver);
                scenario.failure(failure).build()
            };
            let failing = match condition {
                // There is no guidance to fail.
                Condition::Manual => Vec::new(),
                _ => vec![with(FailureKind::Torque)?, with(FailureKind::Input)?],
            };
            families.push(Family {
                nominal: with(FailureKind::None)?,
                failing,
            });
        }
    }
    Ok(families)
}

/// All runs, family by family: side by side, and a family of which one is rejected as a fork with the shipping ECU.
fn drive(
    families: Vec<Family>,
    seed: u64,
    progress: &(impl Fn() + Sync),
) -> Result<Vec<(Scenario, Run)>, StudyError> {
    let all = families
        .iter()
        .flat_map(|family| std::iter::once(&family.nominal).chain(&family.failing));
    let scenarios: Vec<Scenario> = all.cloned().collect();
    let mut runs = run_batched(&scenarios, seed, |_, run| Ok(run.clone()))?.into_iter();
    let with_runs: Vec<(Family, Vec<Option<Run>>)> = families
        .into_iter()
        .map(|family| {
            let of_family = runs.by_ref().take(1 + family.failing.len()).collect();
            (family, of_family)
        })
        .collect();
    let driven: Vec<Vec<(Scenario, Run)>> = with_runs
        .into_par_iter()
        .map(|(family, runs)| {
            let Family { nominal, failing } = family;
            let runs = match runs.into_iter().collect::<Option<Vec<Run>>>() {
                Some(runs) => runs,
                None => {
                    let failures: Vec<Failure> = failing.iter().map(Scenario::failure).collect();
                    let (run, failed) = simulate_forked(&nominal, &failures)?;
                    std::iter::once(run).chain(failed).collect()
                }
            };
            let scenarios = std::iter::once(nominal).chain(failing);
            Ok(scenarios.zip(runs).inspect(|_| progress()).collect())
        })
        .collect::<Result<_, ScenarioError>>()?;
    Ok(driven.into_iter().flatten().collect())
}
