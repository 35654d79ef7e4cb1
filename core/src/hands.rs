//! Whether a hand is on the wheel, by what the column does.
//!
//! A hand that holds a wheel which the guidance turns answers with torque. Where the guidance acts and the driver
//! torque stays within 0.08 N.m of where it was, there is none: after 15 s of that the driver is warned, after 30 s the
//! guidance ends with a fade (class A), as UN R79 has it for hands-off warnings. What counts is the torque's change,
//! and a value beyond 0.35 N.m, so that the sensor's offset does not matter; and only the time in which the guidance
//! acts, so that a straight without a disturbance, where nobody has to do anything, is no proof.
//!
//! Not here: what the warning leads to ([`crate::controller`]).

use crate::quantity::{Micros, Torque};
use crate::redundant::words;

/// A change of the driver torque that only a hand makes: beyond the sensor's noise and the inertia of the wheel's rim.
const FELT: Torque = Torque::from_nm(0.08);
/// A torque that only a hand holds: beyond what the zero of a torque sensor may be off.
const HELD: Torque = Torque::from_nm(0.35);
/// A guidance torque that a hand would answer.
const ACTS: Torque = Torque::from_nm(0.05);
/// No hand for so long: the driver is warned.
pub const WARN: Micros = Micros::from_ms(15_000);
/// No hand for so long: the guidance ends.
pub const END: Micros = Micros::from_ms(30_000);

words! {
    /// What was felt, and for how long no more.
    pub struct HandsState {
        /// The driver torque that a change is counted from.
        felt: Torque,
        /// Time in which the guidance acted since.
        without: Micros,
    }
}

impl HandsState {
    /// A hand on the wheel.
    pub const NEW: Self = Self {
        felt: Torque::ZERO,
        without: Micros::from_us(0),
    };

    /// Takes a driver torque that came since the last step.
    pub fn feel(&mut self, driver: Torque) {
        if driver.plus(self.felt.opposite()).abs() > FELT || driver.abs() > HELD {
            (self.felt, self.without) = (driver, Micros::from_us(0));
        }
    }

    /// Another `elapsed` in which the guidance applied a torque.
    pub fn guided(&mut self, applied: Torque, elapsed: Micros) {
        if applied.abs() >= ACTS {
            self.without = Micros::from_us(self.without.us().saturating_add(elapsed.us()));
        }
    }

    /// Guidance begins: whoever asked for it is there.
    pub fn begin(&mut self) {
        self.without = Micros::from_us(0);
    }

    /// For how long no hand was felt.
    #[must_use]
    pub const fn without(&self) -> Micros {
        self.without
    }
}
