//! Whether the driver torque is alive.
//!
//! A sensor that is stuck, or a task that sends its last value again, gives the same number whatever the hand does, and so
//! takes the override away. No hand leaves a torque the same to the last bit while the wheel turns: that is asked for here.
//! How far the wheel has to turn depends on what a false alarm costs. Before guidance begins it costs some
//! more time in Standby; beside the probe, which moves the wheel to and fro, even a small turn has to be answered; and beside
//! a guidance that acts it costs a handover, so that what a driver model without noise does in a bend has to stay below.
//!
//! Not here: a torque that is wrong and moves (the sum of torques in [`crate::safety::plausibility`]).

use crate::quantity::{Micros, Radians, Torque};

/// The torque has to be still for so long.
pub const LASTS: Micros = Micros::from_ms(1000);
/// A turn counts within this time: a slower one is what a driver does who hardly turns.
pub const WITHIN: Micros = Micros::from_ms(2000);
/// So far the wheel turns meanwhile, beside a guidance that acts: 8 deg. Models of drivers without noise come to 6 deg.
pub const MOST_TURN: Radians = Radians::from_rad(0.14);
/// The same in Standby and beside the probe: 0.5 deg, five steps of an ordinary sensor.
pub const MOST_TURN_WHEN_TESTED: Radians = Radians::from_rad(0.0087);
/// Found, until the torque moves.
const FOUND: Micros = Micros::from_us(u32::MAX);

/// For how long the driver torque has been the same to the bit, and between which angles the wheel was meanwhile. Not kept twice: a
/// flipped bit can end guidance by a handover, or delay what is found by two seconds.
#[derive(Debug, Clone, Copy, Default)]
pub struct FrozenTorqueState {
    torque: Torque,
    least: Radians,
    most: Radians,
    lasted: Micros,
    is_tested: bool,
}

impl FrozenTorqueState {
    /// Takes a driver torque and a wheel angle that come so long after the last. Whether the torque is alive; while it is tested,
    /// in Standby and beside the probe, it has to move for a small turn.
    #[must_use]
    pub fn is_alive(&mut self, torque: Torque, wheel: Radians, passed: Micros, is_tested: bool) -> bool {
        if torque != self.torque {
            (self.torque, self.is_tested) = (torque, is_tested);
            self.restart(wheel);
            return true;
        }
        if self.lasted == FOUND {
            return false;
        }
        // What the wheel turned before the test does not count.
        if self.lasted >= WITHIN || is_tested != self.is_tested {
            self.is_tested = is_tested;
            self.restart(wheel);
        }
        self.lasted = Micros::from_us(self.lasted.us().saturating_add(passed.us()));
        (self.least, self.most) = (self.least.min(wheel), self.most.max(wheel));
        let turn = self.most.bits().saturating_sub(self.least.bits());
        let most_turn = if is_tested {
            MOST_TURN_WHEN_TESTED
        } else {
            MOST_TURN
        };
        let is_found = self.lasted >= LASTS && turn > most_turn.bits();
        if is_found {
            self.lasted = FOUND;
        }
        !is_found
    }

    /// Counts from here on.
    fn restart(&mut self, wheel: Radians) {
        (self.least, self.most, self.lasted) = (wheel, wheel, Micros::from_us(0));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// After how many ms of messages 2 ms apart the torque is found still; the wheel by ms, deg.
    fn found_ms(
        wheel_deg: impl Fn(u32) -> f64,
        torque_nm: impl Fn(u32) -> f64,
        is_tested: bool,
    ) -> Option<u32> {
        let mut state = FrozenTorqueState::default();
        (0..10_000).step_by(2).find(|ms| {
            let wheel = Radians::from_rad(wheel_deg(*ms).to_radians());
            let torque = Torque::from_nm(torque_nm(*ms));
            !state.is_alive(torque, wheel, Micros::from_ms(2), is_tested)
        })
    }

    #[test]
    fn a_torque_that_is_still_while_the_wheel_turns_is_found_after_a_second() {
        for sign in [1.0, -1.0] {
            for (torque, deg_per_s, is_tested, found) in [
                (0.0, 8.1, false, 1000),
                (0.7, 20.0, false, 1000),
                // 8 deg within two seconds.
                (-0.7, 4.2, false, 1910),
                (0.0, 0.4, true, 1250),
            ] {
                let ms = found_ms(
                    |ms| sign * deg_per_s * 1e-3 * f64::from(ms),
                    |_| torque,
                    is_tested,
                );
                assert!(
                    ms.is_some_and(|ms| ms.abs_diff(found) <= 10),
                    "{deg_per_s}: {ms:?}"
                );
            }
            // Slower than that, and as fast but with a torque that moves by its last bit every second.
            let slowly = |ms: u32| sign * 3.9e-3 * f64::from(ms);
            assert_eq!(found_ms(slowly, |_| 0.3, false), None);
            let bit = |ms: u32| f64::from(ms / 990 % 2) / f64::from(1 << 24);
            assert_eq!(found_ms(|ms| sign * 0.02 * f64::from(ms), bit, false), None);
        }
        // To and fro, as by the probe: 0.6 deg between the ends.
        let to_and_fro = |ms: u32| 0.3 * (f64::from(ms) * 0.015_7).sin();
        assert_eq!(found_ms(to_and_fro, |_| 0.1, true), Some(1000));
        assert_eq!(found_ms(|ms| 0.8 * to_and_fro(ms), |_| 0.1, true), None);
    }

    #[test]
    fn what_was_found_stays_until_the_torque_moves() {
        let mut state = FrozenTorqueState::default();
        let mut still = |torque: f64, deg: f64, ms: u32| {
            let (torque, wheel) = (Torque::from_nm(torque), Radians::from_rad(deg.to_radians()));
            state.is_alive(torque, wheel, Micros::from_ms(ms), false)
        };
        assert!(still(0.2, 0.0, 0) && still(0.2, 9.0, 999));
        assert!(!still(0.2, 9.0, 1) && !still(0.2, 9.0, 5000) && !still(0.2, 0.0, 5000));
        assert!(still(0.201, 0.0, 2) && still(0.201, 0.0, 5000));
    }

    #[test]
    fn a_turn_before_the_test_does_not_count() {
        let wheel = |deg: f64| Radians::from_rad(deg.to_radians());
        for was_tested in [false, true] {
            let mut state = FrozenTorqueState::default();
            for deg in [0.0, 2.0] {
                assert!(state.is_alive(Torque::from_nm(0.1), wheel(deg), Micros::from_ms(900), was_tested));
            }
            let alive = state.is_alive(Torque::from_nm(0.1), wheel(2.0), Micros::from_ms(200), true);
            assert_eq!(alive, !was_tested);
        }
    }
}
