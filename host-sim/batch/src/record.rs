//! One run as results hold it: what tells it apart, how it ended, and its metrics over a window of road.

use serde::Serialize;

use super::Away;
use crate::engine::{StudyError, refuse};
use haptic_core::controller::params::Params;
use haptic_log::trace::Sample;
use haptic_metrics::{self as metrics, Asked, Circumstances, Metrics, Window};
use haptic_sim::input::in_range;
use haptic_sim::models::road::Course;
use haptic_sim::scenario::{Condition, FailureKind, Scenario};
use haptic_sim::simulation::{DIVERGED_M, Run};
use haptic_sim::stability::{Guided, growth_per_s};

/// A run's line in the results. A metric without a value is `null` in JSON.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RunRecord {
    /// Processing delay of the driver, s.
    pub t_p: f64,
    /// How the driver drives.
    pub condition: Condition,
    /// What failed.
    pub failure: FailureKind,
    /// Arc length at which it failed, m: none without a failure, or if the run ended before it.
    pub failure_s_m: Option<f64>,
    /// Whether the run was stopped because it diverged. Its metrics end there.
    pub diverged: bool,
    /// Arc length of the last sample, m.
    pub end_m: f64,
    /// When the guidance was away.
    #[serde(flatten)]
    pub away: Away,
    /// Every metric, over the window.
    #[serde(flatten)]
    pub metrics: Metrics,
}

impl RunRecord {
    /// Measures a run over a window. `nominal_peak_m` is the peak of the same run without its failure.
    pub fn new(scenario: &Scenario, run: &Run, window: Window, nominal_peak_m: Option<f64>) -> Self {
        Self::asked(scenario, run, window, nominal_peak_m, Asked::ALL)
    }

    /// Measures of a run what is asked for.
    pub(super) fn asked(
        scenario: &Scenario,
        run: &Run,
        window: Window,
        nominal_peak_m: Option<f64>,
        asked: Asked,
    ) -> Self {
        let failure = scenario.failure().at_s().map(|time_s| metrics::Failure {
            time_s,
            nominal_peak_lateral_error_m: nominal_peak_m,
        });
        let samples = &run.trace.samples;
        let first_failed = |time_s| samples.get(samples.partition_point(|sample| sample.time_s < time_s));
        let circumstances = Circumstances {
            speed_m_s: scenario.speed_m_per_s(),
            lane_width_m: scenario.course().lane_width_m(),
            window: Some(window),
            failure,
            probe_hz: probe_hz(scenario),
        };
        Self {
            t_p: scenario.driver().t_p,
            condition: scenario.condition(),
            failure: scenario.failure().kind,
            failure_s_m: scenario
                .failure()
                .at_s()
                .and_then(first_failed)
                .map(|sample| sample.s_m),
            diverged: run.diverged(),
            end_m: run.trace.samples.last().map_or(0.0, |sample| sample.s_m),
            away: Away::new(scenario, &run.trace),
            metrics: metrics::measure_asked(&run.trace, &circumstances, asked),
        }
    }
}

/// Frequency of the probe, if it is on, Hz.
pub(crate) fn probe_hz(scenario: &Scenario) -> Option<f64> {
    let guidance = scenario.guidance();
    (guidance.probe && scenario.condition() != Condition::Manual)
        .then_some(guidance.controller.probe_frequency_hz)
}

/// The stretch that a study measures unless told otherwise: the first curve of the paper's course, or all of
/// another course.
pub(super) fn default_window(course: &Course) -> Window {
    if *course == Course::paper() {
        Window {
            from_m: 1080.0,
            to_m: 1740.0,
        }
    } else {
        Window {
            from_m: 0.0,
            to_m: course.length_m(),
        }
    }
}

/// Peak |e| of a run without failure, m, as the measure of recovery from a failure at a time: over the window,
/// and from the failure on if that comes before the window.
pub(super) fn nominal_peak_m(run: &Run, window: Window, failure_time_s: f64) -> Option<f64> {
    let judged = |s: &&Sample| (s.s_m >= window.from_m || s.time_s >= failure_time_s) && s.s_m <= window.to_m;
    let judged = run.trace.samples.iter().filter(judged);
    judged.map(|s| s.lateral_error_m.abs()).reduce(f64::max)
}

/// Largest lateral error in a time of a drive, m; of one that left the road 10 m, where runs end.
pub fn peak_m(run: &Run, [from_s, to_s]: [f64; 2]) -> f64 {
    if run.diverged() {
        return DIVERGED_M;
    }
    let samples = run.trace.samples.iter();
    let within = samples.filter(|sample| (from_s..=to_s).contains(&sample.time_s));
    within
        .map(|sample| sample.lateral_error_m.abs())
        .fold(0.0, f64::max)
}

/// Whether a scenario's column is the rigid one, which the growth of a motion is known for.
pub(crate) fn check_rigid(scenario: &Scenario) -> Result<(), StudyError> {
    match scenario.column().has_bar() {
        true => refuse(
            "column.kind = \"torsion-bar\": whether its loop is stable is not judged here; leave [column] out",
        ),
        false => Ok(()),
    }
}

/// Growth of the slowest motion of a scenario's loop on a straight, 1/s, with a law or by hand: below zero an error dies down.
pub(crate) fn growth(scenario: &Scenario, law: Option<&Params>) -> f64 {
    let t_n = scenario.guidance().t_n;
    growth_per_s(
        scenario.speed_m_per_s(),
        &scenario.car().vehicle,
        scenario.driver(),
        scenario.gains(),
        law.map(|law| Guided { law, t_n }),
    )
}

/// What a reader of the records has to know of the place of the failure, if the window does not hold it.
pub(super) fn failure_notes(time_s: f64, records: &[RunRecord], window: Window) -> Vec<String> {
    let failing = records.iter().filter(|r| r.failure != FailureKind::None);
    let places: Vec<_> = failing.map(|r| r.failure_s_m).collect();
    if places.is_empty() {
        return Vec::new();
    }
    let Window { from_m, to_m } = window;
    // All runs have one speed, or one profile: those that last until the failure are at the same place.
    let note = match places.into_iter().flatten().next() {
        None => format!("no run lasts until the failure at {time_s} s: the runs with failure have none"),
        Some(s_m) if s_m > to_m => format!(
            "the failure at {time_s} s comes at {s_m:.0} m, behind the window of {from_m} to {to_m} m: no metric \
             sees it"
        ),
        Some(s_m) if s_m < from_m => format!(
            "the failure at {time_s} s comes at {s_m:.0} m, before the window of {from_m} to {to_m} m: only the \
             peak after failure and the time to recover count from the failure on"
        ),
        Some(_) => return Vec::new(),
    };
    vec![note]
}

/// Shortest window that holds samples at any speed, m.
const LEAST_WINDOW_M: f64 = 1.0;

/// Whether a window lies on a scenario's course, and where its runs drive. Its end may be the course's, though
/// a run ends where its farthest point ahead gets there.
///
/// # Errors
/// Which end is wrong, with its value and range.
pub fn check_window(window: Window, scenario: &Scenario) -> Result<(), StudyError> {
    let Window { from_m, to_m } = window;
    let (length_m, reach_m) = (scenario.course().length_m(), scenario.reach_m());
    // Whole tenths, for people to read.
    let last_start_m = (10.0 * (reach_m - LEAST_WINDOW_M)).floor() / 10.0;
    in_range("window from", from_m, 0.0..=last_start_m, "m").map_err(|e| {
        format!(
            "{e}: runs end at {reach_m:.1} m, {:.1} m before the course does",
            scenario.look_ahead_m()
        )
    })?;
    in_range("window to", to_m, 0.0..=length_m, "m")?;
    if from_m + LEAST_WINDOW_M <= to_m {
        return Ok(());
    }
    refuse(format!(
        "window from {from_m} m to {to_m} m: the end must lie at least {LEAST_WINDOW_M} m behind the start"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptic_log::trace::Trace;
    use haptic_sim::simulation::Ending;

    /// 1 m a second; |e| falls from 0.9 m by 0.1 m a sample.
    fn run() -> Run {
        let samples = (0..8).map(|i| Sample {
            time_s: f64::from(i),
            s_m: f64::from(i),
            lateral_error_m: 0.1 * f64::from(i) - 0.9,
            ..Sample::default()
        });
        let trace = Trace {
            sample_rate_hz: 1.0,
            samples: samples.collect(),
        };
        Run {
            trace,
            ending: Ending::CourseEnd,
            steps: 8000,
        }
    }

    #[test]
    fn recovery_is_measured_against_the_stretch_that_it_is_judged_on() {
        let window = Window {
            from_m: 4.0,
            to_m: 6.0,
        };
        let peak = |failure_s| (10.0 * nominal_peak_m(&run(), window, failure_s).unwrap()).round();
        // |e| at 4 s is 0.5 m, at 2 s 0.7 m.
        assert_eq!(peak(5.0), 5.0, "a failure in the window: all of the window");
        assert_eq!(peak(9.0), 5.0);
        assert_eq!(peak(2.0), 7.0, "a failure before it: from there on");
    }

    #[test]
    fn a_failure_that_the_window_does_not_hold_is_noted() {
        let scenario = |time_s| {
            let failure = haptic_sim::scenario::Failure {
                kind: FailureKind::Torque,
                time_s,
                duration_s: None,
            };
            Scenario::builder().failure(failure).build().unwrap()
        };
        let window = Window {
            from_m: 2.0,
            to_m: 5.0,
        };
        let notes = |time_s| {
            let record = RunRecord::new(&scenario(time_s), &run(), window, None);
            (record.failure_s_m, failure_notes(time_s, &[record], window))
        };
        assert_eq!(notes(3.0), (Some(3.0), vec![]));
        let (place, before) = notes(1.0);
        assert!(place == Some(1.0) && before[0].contains("at 1 m, before the window of 2 to 5 m"));
        let (place, behind) = notes(6.0);
        assert!(place == Some(6.0) && behind[0].contains("at 6 m, behind the window"));
        let (place, never) = notes(9.0);
        assert!(place.is_none() && never[0].contains("no run lasts until the failure at 9 s"));
    }

    /// 3350 m at 60 km/h: the runs end 16.7 m before the course.
    #[test]
    fn a_window_lies_where_runs_drive() {
        let check = |from_m, to_m| check_window(Window { from_m, to_m }, &Scenario::default());
        assert_eq!(check(0.0, 3350.0), Ok(()));
        assert_eq!(check(3332.3, 3350.0), Ok(()));
        assert_eq!(
            check(3340.0, 3350.0),
            Err(
                "window from = 3340 m is outside 0 to 3332.3 m: runs end at 3333.3 m, 16.7 m before the course does"
                    .into()
            )
        );
        assert_eq!(
            check(0.0, 9000.0).map_err(|e| e.to_string()),
            Err("window to = 9000 m is outside 0 to 3350 m".into())
        );
        for (from_m, to_m) in [(500.0, 100.0), (500.0, 500.0), (500.0, 500.5)] {
            let error = check(from_m, to_m).unwrap_err().to_string();
            assert!(error.contains("at least 1 m behind the start"), "{error}");
        }
        assert!(
            check(f64::NAN, 100.0).is_err() && check(0.0, f64::NAN).is_err() && check(-1.0, 9.0).is_err()
        );
    }
}
