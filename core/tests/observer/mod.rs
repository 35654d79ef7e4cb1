//! The observer of the hands' torque: its limits, beside f64 and a simulated wheel, and the ECU that uses it.

mod ecu;
mod limits;
mod oracle;

use haptic_core::controller::config::Config;
use haptic_core::controller::params::Params;
use haptic_core::observer::{Observer, Sensor};

/// A bar whose angle is the column's, sampled in every step.
const AT_COLUMN: Params = Params {
    torque_sensor: 1.0,
    column_period_s: 0.001,
    ..Params::PAPER
};

/// One whose angle is the wheel's, which nothing holds.
const AT_WHEEL: Params = Params {
    torque_sensor: 2.0,
    wheel_friction_nm: 0.0,
    wheel_damping_nm_s: 0.0,
    ..AT_COLUMN
};

fn observer(of: &Params) -> Observer {
    match Config::new(of).unwrap().sensor() {
        Some(Sensor::Bar(observer)) => *observer,
        other => panic!("{other:?} is no bar"),
    }
}
