//! The world: road, vehicle with steering column, driver, sensors.
//!
//! Every model is deterministic, in SI units and ISO 8855 signs (x forward, y left, yaw counter-clockwise),
//! and knows nothing of the controller, of studies or of the command line. Equation and table numbers are
//! those of Wang, Zheng, Nacpil and Nakano, DOI 10.1049/itr2.12163.

pub mod arm;
pub mod disturbances;
pub mod driver;
pub mod hands_answer;
pub mod nonlinear;
pub mod plant;
pub mod sensors;
pub mod tolerances;
pub mod torsion_bar;
pub mod vehicle;

use std::f64::consts::{PI, TAU};

pub use haptic_road as road;

/// One step of the simulation, s: the control period of the ECU, and the grid of every delay and hold.
pub const STEP_S: f64 = 1e-3;
/// Steps per second.
pub const STEPS_PER_SECOND: u32 = 1000;

/// The step at or next to a time.
pub fn step_of(time_s: f64) -> u32 {
    (time_s / STEP_S).round() as u32
}

/// A step of Runge and Kutta's: the oracle of plants. `rates` has the states and the share of the step that has passed.
#[cfg(test)]
fn runge_kutta(x: &[f64; 8], step_s: f64, rates: impl Fn(&[f64; 8], f64) -> [f64; 8]) -> [f64; 8] {
    let plus = |k: &[f64; 8], h: f64| std::array::from_fn(|j| x[j] + h * k[j]);
    let k1 = rates(x, 0.0);
    let k2 = rates(&plus(&k1, step_s / 2.0), 0.5);
    let k3 = rates(&plus(&k2, step_s / 2.0), 0.5);
    let k4 = rates(&plus(&k3, step_s), 1.0);
    std::array::from_fn(|j| x[j] + step_s / 6.0 * (k1[j] + 2.0 * k2[j] + 2.0 * k3[j] + k4[j]))
}

/// An angle in (-pi, pi].
#[inline]
pub fn wrapped(angle: f64) -> f64 {
    if angle > -PI && angle <= PI {
        return angle;
    }
    let positive = angle.rem_euclid(TAU);
    if positive > PI { positive - TAU } else { positive }
}
