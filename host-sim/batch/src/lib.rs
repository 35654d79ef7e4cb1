//! Studies: what to simulate, and what to make of it.
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
//!
//! Not here: options and exit codes (the command line), how a metric is computed, which files are left and how they look.

pub mod bus_load;
pub mod claims;
pub mod course;
pub mod evaluate;
pub mod experiment;
pub mod files;
pub mod handover;
pub mod identify;
mod record;
pub mod reliance;
pub mod run;

pub use record::{RunRecord, check_window};
