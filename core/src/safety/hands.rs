//! Whether a hand is on the wheel, by what the column does.
//!
//! A hand that holds a wheel which the guidance turns answers with torque. Where the guidance acts, the driver torque
//! stays within 0.08 N.m of where it was, and it is no more than a sensor's offset, there is none: after 15 s of that the
//! driver is warned, after 30 s the guidance ends with a fade (class A), as UN R79 has it for hands-off warnings. What
//! counts is the torque's change, or a torque that no offset is; and only the time in which the guidance acts, so that
//! a straight without a disturbance, where nobody has to do anything, is no proof. The probe is not counted: a hand that
//! follows it fully answers with less than the sensor resolves.
//!
//! Not here: what the warning leads to ([`crate::controller`]).

use crate::quantity::{Micros, Torque};
use crate::safety::redundant::words;

/// A change of the driver torque that only a hand makes: beyond the sensor's noise and the inertia of the wheel's rim.
pub const FELT: Torque = Torque::from_nm(0.08);
/// A driver torque that only a hand makes, whatever it was before: above the largest offset of a sensor.
pub const HELD: Torque = Torque::from_nm(0.35);
/// A guidance torque that a hand would answer.
pub const ACTS: Torque = Torque::from_nm(0.05);
/// No hand for so long: the driver is warned.
pub const WARN: Micros = Micros::from_ms(15_000);
/// No hand for so long: the guidance ends.
pub const END: Micros = Micros::from_ms(30_000);

words! {
    /// What was felt, and for how long no more.
    pub struct HandsState {
        /// The driver torque that a change is counted from.
        reference: Torque,
        /// Time in which the guidance acted since.
        time_hands_off: Micros,
    }
}

impl HandsState {
    /// A hand on the wheel.
    pub const NEW: Self = Self {
        reference: Torque::ZERO,
        time_hands_off: Micros::from_us(0),
    };

    /// Takes a driver torque that came since the last step.
    pub fn update(&mut self, driver: Torque) {
        if driver.abs() > HELD || driver.plus(self.reference.opposite()).abs() > FELT {
            (self.reference, self.time_hands_off) = (driver, Micros::from_us(0));
        }
    }

    /// Another `elapsed` in which the guidance applied a torque, the probe not counted.
    pub fn add_guided_time(&mut self, guidance: Torque, elapsed: Micros) {
        if guidance.abs() >= ACTS {
            self.time_hands_off = Micros::from_us(self.time_hands_off.us().saturating_add(elapsed.us()));
        }
    }

    /// Guidance begins: whoever asked for it is there.
    pub fn reset(&mut self) {
        self.time_hands_off = Micros::from_us(0);
    }

    /// For how long no hand was felt.
    #[must_use]
    pub const fn time_hands_off(&self) -> Micros {
        self.time_hands_off
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hands_off_ms(state: &HandsState) -> u32 {
        state.time_hands_off().us() / 1000
    }

    fn let_go(felt: Torque) -> HandsState {
        let mut state = HandsState::NEW;
        state.update(felt);
        state.add_guided_time(ACTS, Micros::from_ms(500));
        state
    }

    #[test]
    fn a_hand_is_a_change_or_a_torque_that_no_offset_is() {
        let bit = Torque::from_bits(1);
        for sign in [1, -1] {
            let signed = |torque: Torque| if sign < 0 { torque.opposite() } else { torque };
            // From an offset on: as much as FELT beside it is none, a bit more is one.
            let mut state = let_go(signed(Torque::from_nm(0.2)));
            state.update(signed(Torque::from_nm(0.2).plus(FELT)));
            assert_eq!(hands_off_ms(&state), 500);
            state.update(signed(Torque::from_nm(0.2).plus(FELT).plus(bit)));
            assert_eq!(hands_off_ms(&state), 0);
            // The same torque all the time.
            for (torque, left) in [(HELD, 500), (HELD.plus(bit), 0)] {
                let mut state = let_go(signed(torque));
                state.update(signed(torque));
                assert_eq!(hands_off_ms(&state), left, "{torque:?}");
            }
        }
    }

    #[test]
    fn only_a_guidance_that_acts_counts_and_each_begins_anew() {
        let mut state = let_go(Torque::ZERO);
        state.add_guided_time(ACTS.plus(Torque::from_bits(-1)), Micros::from_ms(500));
        assert_eq!(hands_off_ms(&state), 500);
        state.add_guided_time(ACTS.opposite(), Micros::from_ms(500));
        assert_eq!(hands_off_ms(&state), 1000);
        state.reset();
        assert_eq!(hands_off_ms(&state), 0);
    }
}
