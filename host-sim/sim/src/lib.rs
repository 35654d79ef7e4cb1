//! The world around the steering controller, and the closed loop with it.

pub mod closed_loop;
pub mod ecu_events;
pub mod guidance;
pub mod input;
pub mod models;
pub mod scenario;
