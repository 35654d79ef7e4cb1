//! Checks whether the driver torque is alive, which means that it changes as a hand's torque does.
//!
//! A stuck sensor, or a task that sends its last value again, gives the same number whatever the hand does, so the
//! driver could no longer override the guidance. With a hand on it, a torque never stays the same to the last bit
//! while the wheel turns. So a torque that does not change while the wheel turns is a fault. How far the wheel has to
//! turn for that depends on the cost of a false alarm. Before guidance begins the cost is some more time in Standby,
//! and beside the probe, which turns the wheel to and fro, every hand answers: there a small turn is enough. During
//! guidance the cost is a handover: there the limit is above the turn that driver models without noise make in a
//! bend.
//!
//! Not here: a torque that changes and is wrong (the balance of torques in [`crate::safety::plausibility`]).

use crate::quantity::{Micros, Radians, Speed, Torque, product, product_of_three};

/// How long the torque has to stay the same.
pub const LASTS: Micros = Micros::from_ms(1000);
/// The wheel has to turn within this time; a slower turn is ordinary driving on a nearly straight road.
pub const WITHIN: Micros = Micros::from_ms(2000);
/// How far the wheel may turn meanwhile during guidance: 8 deg. Driver models without noise reach 6 deg at 40 km/h.
pub const MOST_TURN: Radians = Radians::from_rad(0.14);
/// Below 40 km/h a road asks for larger turns, and each changes the aligning torque less: the limit grows as the
/// square of the speed falls, so that it stays that of one lateral acceleration, 0.39 m/s2 for the paper's car.
pub const SLOW: Speed = Speed::from_m_per_s(40.0 / 3.6);
/// How far it may turn in Standby and beside the probe: 0.5 deg, five steps of an ordinary sensor.
pub const MOST_TURN_WHEN_TESTED: Radians = Radians::from_rad(0.0087);

/// How long the driver torque has been the same to the bit, and between which angles the wheel was meanwhile. This
/// state is not kept twice: a flipped bit can end guidance by a handover, or delay a finding by two seconds.
#[derive(Debug, Clone, Copy, Default)]
pub struct FrozenTorqueState {
    torque: Torque,
    least: Radians,
    most: Radians,
    lasted: Micros,
    is_tested: bool,
    /// It was found frozen, and has not changed since.
    is_found: bool,
}

impl FrozenTorqueState {
    /// Takes a driver torque and a wheel angle that arrive `passed` after the last ones, and returns whether the
    /// torque is alive. With `is_tested`, in Standby and beside the probe, the smaller turn counts, at any speed.
    #[must_use]
    pub fn is_alive(
        &mut self,
        torque: Torque,
        wheel: Radians,
        speed: Speed,
        passed: Micros,
        is_tested: bool,
    ) -> bool {
        if torque != self.torque {
            (self.torque, self.is_tested, self.is_found) = (torque, is_tested, false);
            self.restart(wheel);
            return true;
        }
        if self.is_found {
            return false;
        }
        // A turn from before the test does not count.
        if self.lasted >= WITHIN || is_tested != self.is_tested {
            self.is_tested = is_tested;
            self.restart(wheel);
        }
        self.lasted = Micros::from_us(self.lasted.us().saturating_add(passed.us()));
        (self.least, self.most) = (self.least.min(wheel), self.most.max(wheel));
        let (most_turn, speed) = if is_tested {
            (MOST_TURN_WHEN_TESTED, SLOW)
        } else {
            (MOST_TURN, speed.min(SLOW))
        };
        let at = |speed: Speed, turn: Radians| {
            product_of_three(product(speed.fixed(), speed.fixed()), turn.fixed())
        };
        let turn = self.most.minus(self.least);
        self.is_found = self.lasted >= LASTS && at(speed, turn) > at(SLOW, most_turn);
        !self.is_found
    }

    /// Starts to count from this angle.
    fn restart(&mut self, wheel: Radians) {
        (self.least, self.most, self.lasted) = (wheel, wheel, Micros::from_us(0));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// After how many ms of messages 2 ms apart the torque is found still; the wheel by ms, deg.
    fn found_ms(
        kmh: f64,
        wheel_deg: impl Fn(u32) -> f64,
        torque_nm: impl Fn(u32) -> f64,
        is_tested: bool,
    ) -> Option<u32> {
        let mut state = FrozenTorqueState::default();
        let speed = Speed::from_m_per_s(kmh / 3.6);
        (0..10_000).step_by(2).find(|ms| {
            let wheel = Radians::from_rad(wheel_deg(*ms).to_radians());
            let torque = Torque::from_nm(torque_nm(*ms));
            !state.is_alive(torque, wheel, speed, Micros::from_ms(2), is_tested)
        })
    }

    #[test]
    fn a_torque_that_is_still_while_the_wheel_turns_is_found_after_a_second() {
        for sign in [1.0, -1.0] {
            for (kmh, torque, deg_per_s, is_tested, found) in [
                (40.0, 0.0, 8.1, false, 1000),
                (130.0, 0.7, 20.0, false, 1000),
                // 8.02 deg within two seconds.
                (130.0, -0.7, 4.2, false, 1910),
                // Four times as much at half of 40 km/h: 32.1 deg.
                (20.0, 0.3, 33.0, false, 1000),
                (20.0, 0.3, 16.4, false, 1957),
                (20.0, 0.0, 0.4, true, 1250),
                (130.0, 0.0, 0.4, true, 1250),
            ] {
                let ms = found_ms(
                    kmh,
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
            assert_eq!(found_ms(40.0, slowly, |_| 0.3, false), None);
            let slowly_at_20 = |ms: u32| sign * 15.9e-3 * f64::from(ms);
            assert_eq!(found_ms(20.0, slowly_at_20, |_| 0.3, false), None);
            let bit = |ms: u32| f64::from(ms / 990 % 2) / f64::from(1 << 24);
            assert_eq!(found_ms(40.0, |ms| sign * 0.02 * f64::from(ms), bit, false), None);
        }
        // To and fro, as by the probe: 0.6 deg between the ends.
        let to_and_fro = |ms: u32| 0.3 * (f64::from(ms) * 0.015_7).sin();
        assert_eq!(found_ms(40.0, to_and_fro, |_| 0.1, true), Some(1000));
        assert_eq!(found_ms(40.0, |ms| 0.8 * to_and_fro(ms), |_| 0.1, true), None);
    }

    #[test]
    fn what_was_found_stays_until_the_torque_moves() {
        let mut state = FrozenTorqueState::default();
        let mut still = |torque: f64, deg: f64, ms: u32| {
            let (torque, wheel) = (Torque::from_nm(torque), Radians::from_rad(deg.to_radians()));
            state.is_alive(torque, wheel, SLOW, Micros::from_ms(ms), false)
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
                let (torque, passed) = (Torque::from_nm(0.1), Micros::from_ms(900));
                assert!(state.is_alive(torque, wheel(deg), SLOW, passed, was_tested));
            }
            let (torque, passed) = (Torque::from_nm(0.1), Micros::from_ms(200));
            let alive = state.is_alive(torque, wheel(2.0), SLOW, passed, true);
            assert_eq!(alive, !was_tested);
        }
    }

    /// The wheel has to turn within two seconds of the torque's last change, or of the last time that they passed: at two
    /// seconds themselves the turn begins anew.
    #[test]
    fn a_turn_counts_for_less_than_two_seconds() {
        for sign in [1.0, -1.0] {
            for (second_ms, alive) in [(999, false), (1000, true), (1001, true)] {
                let mut state = FrozenTorqueState::default();
                let mut still = |deg: f64, ms: u32| {
                    let wheel = Radians::from_rad((sign * deg).to_radians());
                    state.is_alive(Torque::from_nm(0.3), wheel, SLOW, Micros::from_ms(ms), false)
                };
                assert!(still(0.0, 0) && still(5.0, 1000) && still(5.0, second_ms));
                assert_eq!(still(9.0, 1), alive, "{sign} {second_ms}");
            }
        }
    }
}
