//! How much of the law's torque acts at a speed.
//!
//! A vehicle answers the wheel more the faster it goes, and a driver's own delay lets the loop with a guidance of one
//! gain swing at the ends of the speeds. So the law is right at 60 km/h, where the paper has it, and its share falls
//! linearly to one parameter at 20 km/h and to another at 130 km/h. Both are at most 1: a schedule only takes away, so
//! that every bound on the law holds for it too, the monitor's among them.

use crate::quantity::{Ratio, Speed, product};
use crate::safety::redundant::words;

words! {
    /// Shares at the ends, as lines from the middle.
    pub struct Schedule {
        /// What a m/s below the middle takes away, and a m/s above it.
        per_slower: Ratio,
        per_faster: Ratio,
        /// Least shares.
        slow: Ratio,
        fast: Ratio,
    }
}

/// Where the low share is reached: 20 km/h.
pub const SLOW_M_PER_S: f64 = 20.0 / 3.6;
/// Where all of the torque is there: 60 km/h.
pub const MIDDLE: Speed = Speed::from_m_per_s(60.0 / 3.6);
/// Where the high share is reached: 130 km/h.
pub const FAST_M_PER_S: f64 = 130.0 / 3.6;

impl Schedule {
    /// From the shares at the ends.
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
