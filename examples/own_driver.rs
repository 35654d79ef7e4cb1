//! A driver of one's own in the paper's vehicle, with the shipping ECU:
//! `cargo run --release -p haptic-guidance --example own_driver`.
//!
//! It is not of the published form: it decides five times a second, keeps to a line of its own, gives way to half of the
//! torque that it feels, and takes a firmer grip when the warning lamp is on.

use haptic_sim::guidance::OverBus;
use haptic_sim::parts::{Driver, DriverView, PaperVehicle};
use haptic_sim::simulation::Run;
use haptic_sim::{Scenario, Simulation};

/// Left of the middle of the lane, m.
pub(crate) const LINE_M: f64 = 0.2;
/// Steps of 1 ms from one decision to the next.
const DECIDES_EVERY: u32 = 200;

/// A driver who decides where to turn the wheel, and then turns it there.
#[derive(Debug, Clone, Default)]
pub(crate) struct Intermittent {
    target_rad: f64,
}

impl Driver for Intermittent {
    fn look_ahead_s(&self) -> [f64; 2] {
        [0.8, 1.0]
    }

    fn step(&mut self, view: &DriverView) -> f64 {
        if view.step.is_multiple_of(DECIDES_EVERY) {
            // The line lies to the left, so that its error is more positive.
            self.target_rad = 0.2 * (view.lane.e_y_m + LINE_M) + 5.5 * view.lane.e_theta_rad;
        }
        let stiffness_nm_per_rad = if view.warning { 12.0 } else { 8.0 };
        let turns_nm = stiffness_nm_per_rad * (self.target_rad - view.wheel_angle_rad);
        // Nobody holds quite still: twice a second the grip changes, and so the ECU feels hands.
        let grip_nm = if view.step % 1000 < 500 { 0.1 } else { -0.1 };
        turns_nm - 0.3 * view.wheel_rate_rad_per_s - 0.5 * view.guidance_torque_nm + grip_nm
    }
}

/// A drive on the paper's course.
pub(crate) fn drive() -> Run {
    let scenario = Scenario::default();
    let vehicle = PaperVehicle::new(&scenario);
    let ecu = OverBus::new(scenario.setup());
    Simulation::of_parts(&scenario, Intermittent::default(), vehicle, ecu).run()
}

pub(crate) fn main() {
    let run = drive();
    let errors = run.trace.samples.iter().map(|sample| sample.lateral_error_m);
    let largest_m = errors.map(f64::abs).fold(0.0, f64::max);
    println!("{:?}, largest lateral error {largest_m:.3} m", run.ending);
}
