//! A motor stage and the column's sensors, as a board's 12-bit converters see them: counts to quantities and back, in
//! integers, and when the stage is enabled.
//!
//! Converters run over 3.3 V, and 1.65 V is zero. The driver's torque comes twice, the second time mirrored: two
//! signals that do not add up to the supply mean a broken or missing sensor, and there is no column then.
//!
//! Not here: pins and registers (`boards`).

use haptic_core::bus::messages::Column;
use haptic_core::ecu::Step;
use haptic_core::quantity::{Radians, Torque};

/// Zero, counts.
pub const MID: u16 = 2048;
const COUNTS: i32 = 4096;
const COUNTS_PER_V: f64 = 4096.0 / 3.3;
/// A count of motor demand and motor torque: 0.3 V a N.m.
const MOTOR: Torque = Torque::from_nm(1.0 / (0.3 * COUNTS_PER_V));
/// A count of the difference between the two driver torques: 0.15 V a N.m each.
const DRIVER: Torque = Torque::from_nm(1.0 / (2.0 * 0.15 * COUNTS_PER_V));
/// A count of wheel angle: 0.15 V a rad.
const ANGLE: Radians = Radians::from_rad(1.0 / (0.15 * COUNTS_PER_V));
/// The two driver torques may miss their sum by 0.1 V.
const SUM_TOLERANCE: i32 = 124;

/// What the motor stage is told after a step; `None`: it is switched off, since the monitor withdrew its permission or
/// the mode has no torque.
#[must_use]
pub fn drive(step: &Step) -> Option<Torque> {
    (step.permitted && step.command.mode.may_have_torque()).then_some(step.command.torque)
}

/// A torque as motor demand, counts.
#[must_use]
pub fn demand(torque: Torque) -> u16 {
    (i32::from(MID) + torque.count_of(MOTOR)).clamp(0, COUNTS - 1) as u16
}

/// The column from the counts of driver torque, the same mirrored, wheel angle and motor torque.
#[must_use]
pub fn column(counts: [u16; 4]) -> Option<Column> {
    let [torque, mirrored, angle, motor] = counts.map(|count| i32::from(count) - i32::from(MID));
    ((torque + mirrored).abs() <= SUM_TOLERANCE).then(|| Column {
        driver_torque: DRIVER.times(torque - mirrored),
        wheel_angle: ANGLE.times(angle),
        motor_torque: MOTOR.times(motor),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptic_core::controller::config::Setup;
    use haptic_core::ecu::{Boot, Ecu};
    use haptic_core::quantity::Instant;
    use haptic_core::safety::modes::Mode;

    /// By hand: 0.3 V a N.m are 372.36 counts, from 1.65 V.
    #[test]
    fn demands() {
        for (nm, counts) in [
            (0.0, 2048),
            (1.0, 2420),
            (-1.0, 1676),
            (5.0, 3909),
            (-5.0, 187),
            (127.0, 4095),
            (-128.0, 0),
        ] {
            assert_eq!(demand(Torque::from_nm(nm)), counts, "{nm} N.m");
        }
    }

    /// By hand: 0.15 V a N.m or rad are 186.18 counts. 2 N.m: 1.95 V and 1.35 V.
    #[test]
    fn columns() {
        let read = column([2420, 1676, 2048 + 186, 2048 - 745]).unwrap();
        let near = |is: f64, wanted: f64| assert!((is - wanted).abs() < 2e-3, "{is} for {wanted}");
        near(read.driver_torque.nm(), 1.998);
        near(read.wheel_angle.rad(), 0.999);
        near(read.motor_torque.nm(), -2.0007);
        // 124 counts are 0.1 V.
        assert!(column([2048 + 124, 2048, 2048, 2048]).is_some());
        assert!(column([2048 + 125, 2048, 2048, 2048]).is_none());
        // Pins to ground, or to the supply.
        assert!(column([0; 4]).is_none() && column([4095; 4]).is_none());
    }

    #[test]
    fn the_stage_is_on_with_permission_in_a_mode_with_torque() {
        let now = Instant::from_us(1000);
        let start = Instant::from_us(0);
        // Without any input it hands over, from zero.
        let mut step = Ecu::engaged(&Setup::PAPER, start).step(now);
        assert_eq!(step.command.mode, Mode::Handover);
        assert_eq!(drive(&step), Some(Torque::ZERO));
        step.permitted = false;
        assert_eq!(drive(&step), None);
        let step = Ecu::new(Some(&Setup::PAPER), Boot::default(), start).step(now);
        assert_eq!((step.command.mode, step.permitted), (Mode::Standby, true));
        assert_eq!(drive(&step), None);
    }
}
