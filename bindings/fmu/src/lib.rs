//! The FMU's binary: FMI 2.0 co-simulation around [`controller::Controller`].
//!
//! The model's variables are one list, from which its description follows. `unsafe` is here alone: pointers come from the
//! importing tool, as the standard says.

pub mod controller;
pub mod fmi2;

/// Identifies model and variables; another list of variables is another GUID.
pub const GUID: &str = "{6a0d2f9e-6f0c-4f0b-9c53-3e0c3b2f7a01}";
/// Name of the model and of its binary.
pub const MODEL: &str = "HapticController";
/// Longest communication step, ms: an hour.
pub(crate) const MOST_STEPS: f64 = 3_600_000.0;
