//! What each study shows: a function of each module makes a report of its results, for a page and for a terminal.

pub mod adaptation;
pub mod availability;
pub mod bus;
mod changes;
pub mod compare;
pub mod course;
mod curves;
pub mod design;
pub mod design_guidance;
pub mod drivers;
pub mod evaluation;
pub mod experiment;
pub mod faults;
mod files;
pub mod handover;
pub mod identify;
mod pieces;
pub mod real_drives;
pub mod reliance;
pub mod run;
pub mod stability;
pub mod study;
pub mod sweep;
pub mod validation;

use crate::document::WriteError;
use crate::plot::{Mark, PlotError, Series};

pub use crate::document::SeriesFormat;
pub use files::write;

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
