//! What each study shows: a function of each module makes a report of its results, for a page and for a terminal.

pub mod adaptation;
pub mod bus;
pub mod compare;
pub mod course;
mod curves;
pub mod design;
pub mod design_guidance;
pub mod drivers;
pub mod evaluation;
pub mod experiment;
mod files;
pub mod identify;
mod pieces;
pub mod run;
pub mod stability;
pub mod study;
pub mod sweep;
pub mod torsion_bar;
pub mod vehicle;

use crate::document::WriteError;
use crate::plot::{Mark, Marker, PlotError, Series};
use haptic_batch::Mean;
use haptic_log::trace::Sample;
use haptic_sim::scenario::Scenario;

pub use crate::document::SeriesFormat;
pub use files::{Pictures, write};

/// Place of a row in a figure of rows.
pub fn place(row: usize) -> f64 {
    row as f64 + 1.0
}

/// Why a line ends when the vehicle did not stay on the road.
const LEFT_THE_ROAD: &str = "ends: left the road";

/// A line, and if it ends before its time a cross there, with the reason.
fn ended(line: Series, why: Option<&str>) -> impl Iterator<Item = Series> + use<> {
    let last = line.points.iter().rfind(|p| p.0.is_finite() && p.1.is_finite());
    let cross = why
        .zip(last)
        .map(|(why, last)| Series::with_mark(why, line.style, Mark::Ends, vec![*last]));
    [line].into_iter().chain(cross)
}

/// Where on the road the failure comes.
fn failure_marker(scenario: &Scenario, samples: &[Sample]) -> Option<Marker> {
    let time_s = (scenario.failure().at_s()).or(scenario.column().fault_at_s())?;
    let sample = samples.iter().find(|sample| sample.time_s >= time_s)?;
    Some(Marker::new("failure", sample.s_m))
}

/// A mean with half its interval; a dash if there is none.
fn with_interval(value: Option<&Mean>) -> String {
    value.map_or("\u{2013}".into(), Mean::to_string)
}

/// Roads with their speeds, as a sentence lists them.
fn listed(places: &[(String, f64)]) -> String {
    let name = |(road, kmh): &(String, f64)| format!("{road} at {kmh} km/h");
    places.iter().map(name).collect::<Vec<_>>().join(", ")
}

/// Why the files of a study could not be made.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// A file or directory cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// A figure cannot be drawn.
    #[error(transparent)]
    Plot(#[from] PlotError),
}
