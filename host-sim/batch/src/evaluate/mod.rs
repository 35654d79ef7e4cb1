//! Section 5 of the paper: three drivers (table 7) under four conditions, and again with a failure of the
//! guidance. A manual run has no failure run, so there are 21. Beyond the paper, 9 more in which the guidance's
//! input fails, and the ECU hands over.

pub mod claims;
mod results;

pub use crate::paper::DRIVERS_T_P;
pub use results::EvaluationResults;

use crate::RunRecord;
use crate::engine::{StudyError, Watch, runs};
use crate::record::{check_window, default_window, failure_notes, nominal_peak_m};
use haptic_metrics::Window;
use haptic_sim::models::driver::DriverParameters;
use haptic_sim::scenario::{Condition, Failure, FailureKind, Scenario, ScenarioError};
use haptic_sim::simulation::Run;

/// An evaluation with everything that was simulated.
#[derive(Debug, Clone)]
pub struct Evaluation {
    /// The runs of section 5, driver by driver: nominal ones first, then those with failure. Behind them the
    /// runs whose guidance input fails.
    pub runs: Vec<(Scenario, Run)>,
    /// What is handed on.
    pub results: EvaluationResults,
}

/// Runs the evaluation on all cores: 3 drivers x (4 conditions + 2 x 3 that can fail). `base` gives course, speed, sensors, vehicle,
/// guidance and the time of the failure; its driver's delay, condition and kind of failure are varied.
///
/// # Errors
/// A manual base that has what takes guidance; a window that does not lie where the runs drive.
pub fn evaluate(
    base: &Scenario,
    window: Option<Window>,
    watch: &Watch<'_>,
) -> Result<Evaluation, StudyError> {
    let window = window.unwrap_or_else(|| default_window(base.course()));
    check_window(window, base)?;
    let scenarios = scenarios(base)?;
    let own = |scenario: &Scenario| Ok(scenario.clone());
    let runs = runs(&scenarios, base.seed(), watch, own, |_, _, run| Ok(run.clone()))?;
    let runs: Vec<(Scenario, Run)> = scenarios.into_iter().zip(runs).collect();
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

/// Driver by driver without failure, then with the sudden loss; behind all of them the lost inputs.
fn scenarios(base: &Scenario) -> Result<Vec<Scenario>, ScenarioError> {
    let with = |t_p, kind| {
        let driver = DriverParameters {
            t_p,
            ..*base.driver()
        };
        let failure = Failure {
            kind,
            ..base.failure()
        };
        let scenario = base.to_builder().driver(driver).failure(failure);
        let of = move |condition: &Condition| scenario.clone().condition(*condition).build();
        // By hand there is no guidance to fail.
        let can_be = |condition: &&Condition| kind == FailureKind::None || **condition != Condition::Manual;
        Condition::ALL.iter().filter(can_be).map(of).collect::<Vec<_>>()
    };
    let first = DRIVERS_T_P.map(|t_p| [FailureKind::None, FailureKind::Torque].map(|kind| with(t_p, kind)));
    let lost_inputs = DRIVERS_T_P.map(|t_p| with(t_p, FailureKind::Input));
    first.into_iter().flatten().chain(lost_inputs).flatten().collect()
}
