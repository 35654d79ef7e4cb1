//! The world: road, vehicle with steering column, driver.
//!
//! Every model is deterministic, in SI units and ISO 8855 signs (x forward, y left, yaw counter-clockwise),
//! and knows nothing of the controller, of studies or of the command line. Equation and table numbers are
//! those of Wang, Zheng, Nacpil and Nakano, DOI 10.1049/itr2.12163.

pub mod road;

/// One step of the simulation, s. The control period of the ECU, and the grid of every delay and hold.
pub const STEP_S: f64 = 1e-3;
