//! Studies: what to simulate, what to make of it, and which files to leave.
//!
//! - [`evaluate`]: section 5 of the paper, three drivers under four conditions, with and without failure.
//! - [`claims`]: what that evaluation must show.
//! - [`experiment`]: sections 3 and 4, the participants driven, identified and driven again.
//! - [`handover`]: what a failed input costs, by speed, delay and reliance.
//! - [`identify`]: one recorded drive.
//! - [`run`]: one scenario.
//! - [`course`]: a road looked at.
//! - [`bus_load`]: how full the CAN bus is at worst.
//! - [`reliance`]: the ECU's live estimate of the driver's reliance, against the truth.
//! - [`processor`]: one scenario with the ECU's image in QEMU beside the host's.
//!
//! Not here: options and exit codes (the command line), how a metric is computed, how a figure is drawn.

pub mod bus_load;
pub mod claims;
pub mod course;
mod curves;
pub mod evaluate;
mod evaluation_files;
pub mod experiment;
mod experiment_files;
mod files;
pub mod handover;
pub mod identify;
mod identify_files;
pub mod processor;
mod record;
pub mod reliance;
pub mod run;
mod run_files;

pub use record::{RunRecord, check_window};

use crate::plot::PlotError;
use crate::report::WriteError;

/// Notes as the end of a report's summary.
fn notes(notes: &[String]) -> String {
    notes.iter().map(|note| format!("Note: {note}. ")).collect()
}

/// Why the files of a study could not be made.
#[derive(Debug)]
pub enum OutputError {
    /// A file or directory cannot be written.
    Write(WriteError),
    /// A figure cannot be drawn.
    Plot(PlotError),
}

impl From<WriteError> for OutputError {
    fn from(error: WriteError) -> Self {
        Self::Write(error)
    }
}

impl From<PlotError> for OutputError {
    fn from(error: PlotError) -> Self {
        Self::Plot(error)
    }
}

impl std::fmt::Display for OutputError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Write(error) => error.fmt(f),
            Self::Plot(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for OutputError {}
