//! The share of the law's torque that acts at a speed.
//!
//! The faster a vehicle drives, the more it reacts to the wheel; with one gain for all speeds, and the delay of the
//! driver, the loop oscillates at very low and at high speeds. So the whole torque acts at 60 km/h, the speed of the
//! paper. Its share falls linearly to one parameter at 20 km/h and to another at 130 km/h. Both are at most 1, so
//! that every bound on the law's torque, the monitor's among them, also holds with a schedule.

use crate::quantity::{Ratio, Speed, product};
use crate::safety::redundant::words;

words! {
    /// The shares as two straight lines from the middle speed.
    pub struct Schedule {
        /// Decrease of the share for each m/s below the middle speed, and above it.
        per_slower: Ratio,
        per_faster: Ratio,
        /// Least shares.
        slow: Ratio,
        fast: Ratio,
    }
}

/// The speed at and below which the low share acts: 20 km/h.
pub const SLOW_M_PER_S: f64 = 20.0 / 3.6;
/// The speed at which the whole torque acts: 60 km/h.
pub const MIDDLE: Speed = Speed::from_m_per_s(60.0 / 3.6);
/// The speed at and above which the high share acts: 130 km/h.
pub const FAST_M_PER_S: f64 = 130.0 / 3.6;

impl Schedule {
    /// The schedule with these shares at its ends.
    #[expect(clippy::float_arithmetic, reason = "parameters are SI values in f64")]
    pub(crate) const fn new(slow: f64, fast: f64) -> Self {
        let middle = 60.0 / 3.6;
        Self {
            per_slower: Ratio::from_si((1.0 - slow) / (middle - SLOW_M_PER_S)),
            per_faster: Ratio::from_si((1.0 - fast) / (FAST_M_PER_S - middle)),
            slow: Ratio::from_si(slow),
            fast: Ratio::from_si(fast),
        }
    }

    /// The share at a speed.
    #[must_use]
    pub fn share(&self, speed: Speed) -> Ratio {
        let faster = speed.minus(MIDDLE);
        let (per, least, apart) = if faster < Speed::ZERO {
            (self.per_slower, self.slow, faster.opposite())
        } else {
            (self.per_faster, self.fast, faster)
        };
        let taken = product(per.fixed(), apart.fixed());
        Ratio::ONE.minus(Ratio::from_wide(taken)).max(least)
    }
}
