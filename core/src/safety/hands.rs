//! Decides from the driver torque whether a hand is on the wheel.
//!
//! A hand on a wheel that the guidance turns answers with a torque. So there is no hand if the guidance acts and the
//! driver torque stays within 0.08 N.m of a reference and is no larger than the offset of a sensor. After 15 s of
//! that the driver is warned, and after 30 s the guidance ends with a fade (class A), as UN R79 asks for hands-off
//! warnings. A hand is felt when the torque changes, or is larger than any offset. Only time in which the guidance
//! acts is counted: on a straight without disturbance nobody has to do anything. The probe does not count as acting,
//! as a hand that follows it fully answers with less than the sensor resolves.
//!
//! Not here: what the warning leads to ([`crate::controller`]).

use crate::quantity::{Micros, Torque};
use crate::safety::redundant::words;

/// A larger change of the driver torque comes from a hand: it is above the sensor's noise and the inertia torque of
/// the wheel's rim.
pub const FELT: Torque = Torque::from_nm(0.08);
/// A larger driver torque comes from a hand, whatever it was before: it is above the largest offset of a sensor.
pub const HELD: Torque = Torque::from_nm(0.35);
/// A guidance torque of at least this size counts as acting: a hand would answer it.
pub const ACTS: Torque = Torque::from_nm(0.05);
/// After this time without a hand the driver is warned.
pub const WARN: Micros = Micros::from_ms(15_000);
/// After this time without a hand the guidance ends.
pub const END: Micros = Micros::from_ms(30_000);

words! {
    /// The driver torque that was last felt, and the time since.
    pub struct HandsState {
        /// The reference: the driver torque at the last change.
        reference: Torque,
        /// Time since then in which the guidance acted.
        time_hands_off: Micros,
    }
}

impl HandsState {
    /// The state with a hand on the wheel.
    pub const NEW: Self = Self {
        reference: Torque::ZERO,
        time_hands_off: Micros::from_us(0),
    };

    /// Takes a new driver torque, and resets the time if a hand is felt in it, by more than the torque may be wrong beyond the offset and the
    /// noise of a sensor of the hands' torque.
    pub fn update(&mut self, driver: Torque, unsure: Torque) {
        let change = driver.plus(self.reference.opposite());
        if driver.abs() > HELD.plus(unsure) || change.abs() > FELT.plus(unsure) {
            (self.reference, self.time_hands_off) = (driver, Micros::from_us(0));
        }
    }

    /// Adds `elapsed` to the time if the applied torque without the probe is at least [`ACTS`].
    pub fn add_guided_time(&mut self, guidance: Torque, elapsed: Micros) {
        if guidance.abs() >= ACTS {
            self.time_hands_off = Micros::from_us(self.time_hands_off.us().saturating_add(elapsed.us()));
        }
    }

    /// Resets the time at the start of guidance: whoever requested it is there.
    pub fn reset(&mut self) {
        self.time_hands_off = Micros::from_us(0);
    }

    /// The guided time since a hand was last felt.
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
        state.update(felt, Torque::ZERO);
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
            state.update(signed(Torque::from_nm(0.2).plus(FELT)), Torque::ZERO);
            assert_eq!(hands_off_ms(&state), 500);
            state.update(signed(Torque::from_nm(0.2).plus(FELT).plus(bit)), Torque::ZERO);
            assert_eq!(hands_off_ms(&state), 0);
            // The same torque all the time.
            for (torque, left) in [(HELD, 500), (HELD.plus(bit), 0)] {
                let mut state = let_go(signed(torque));
                state.update(signed(torque), Torque::ZERO);
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
