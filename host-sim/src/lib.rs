//! The world around the controller, and the workbench that studies it.

pub mod closed_loop;
pub mod ecu_events;
pub mod faults;
pub mod guidance;
pub mod identify;
pub mod input;
pub mod metrics;
pub mod models;
pub mod pil;
pub mod plot;
pub mod report;
pub mod scenario;
pub mod studies;
pub mod trace;
