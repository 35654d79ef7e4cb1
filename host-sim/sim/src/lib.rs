//! The world around the steering controller, and the closed loop with it.
//!
//! No file, no thread, no clock: what a person wrote is text, and time is the number of a step.

pub mod action;
pub mod ecu_events;
pub mod guidance;
pub mod input;
pub mod models;
pub mod participants;
mod preview;
pub mod scenario;
pub mod seeds;
pub mod simulation;

pub use action::Action;
pub use scenario::Scenario;
pub use simulation::{Outcome, Run, Simulation, simulate};
