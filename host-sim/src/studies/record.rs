//! One run as results hold it: what tells it apart, how it ended, and its metrics over a window of road.

use serde::Serialize;

use crate::closed_loop::Run;
use crate::input::in_range;
use crate::metrics::{self, Circumstances, Metrics, Window};
use crate::models::road::Course;
use crate::scenario::{Condition, FailureKind, Scenario};

/// A run's line in the results. A metric without a value is `null` in JSON.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RunRecord {
    /// Processing delay of the driver, s.
    pub t_p: f64,
    /// How the driver drives.
    pub condition: Condition,
    /// What failed.
    pub failure: FailureKind,
    /// Whether the run was stopped because it diverged. Its metrics end there.
    pub diverged: bool,
    /// Arc length of the last sample, m.
    pub end_m: f64,
    /// Every metric, over the window.
    #[serde(flatten)]
    pub metrics: Metrics,
}

impl RunRecord {
    /// Measures a run over a window. `nominal_peak_m` is the peak of the same run without its failure.
    pub fn new(scenario: &Scenario, run: &Run, window: Window, nominal_peak_m: Option<f64>) -> Self {
        let failure = scenario.failure.at_s().map(|time_s| metrics::Failure {
            time_s,
            nominal_peak_lateral_error_m: nominal_peak_m,
        });
        let circumstances = Circumstances {
            speed_m_s: scenario.speed_mps(),
            lane_width_m: scenario.course.lane_width_m(),
            window: Some(window),
            failure,
        };
        Self {
            t_p: scenario.driver.t_p,
            condition: scenario.condition,
            failure: scenario.failure.kind,
            diverged: run.diverged(),
            end_m: run.trace.samples.last().map_or(0.0, |sample| sample.s_m),
            metrics: metrics::measure(&run.trace, &circumstances),
        }
    }
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

/// Whether a window lies on a course and has a length.
///
/// # Errors
/// Which end is wrong, with its value and range.
pub fn check_window(window: Window, course: &Course) -> Result<(), String> {
    in_range("window from", window.from_m, 0.0..=course.length_m(), "m")?;
    in_range("window to", window.to_m, 0.0..=course.length_m(), "m")?;
    if window.from_m < window.to_m {
        return Ok(());
    }
    Err(format!(
        "window from {} m to {} m: the start must lie before the end",
        window.from_m, window.to_m
    ))
}
