//! Physical quantities in fixed point, one type each; the one file where SI values become bits.
//!
//! All signed quantities share one format, `fixed`'s I8F24: 24 fractional bits, LSB 2^-24 (6e-8), range
//! -128..+127.99999994 in the SI unit. That holds +-4 m of lateral error, +-20 rad of wheel angle and
//! +-32 N.m of driver torque with a resolution far below any sensor's, and a product of two of them fits
//! 64 bits. Conversions from SI round to nearest and saturate at the ends of the range (NaN becomes 0):
//! an extreme input must stay extreme, never wrap.
//!
//! Products, sums and changes of the format are those of the package `fixed`, on the bare value
//! (`Metres::fixed`). What it lacks, or does in more instructions on a 32-bit core, is in `arithmetic.rs`.
//!
//! Not here: ranges that make sense for a signal. Those belong to the bus messages and the parameters.

#![expect(
    clippy::as_conversions,
    clippy::arithmetic_side_effects,
    clippy::float_arithmetic,
    reason = "the one file where SI values become bits: `as` saturates from floats, and widens integers"
)]

mod arithmetic;

use core::fmt;

use fixed::types::{I8F24, I32F0, I40F24};

use crate::safety::redundant::Words;
pub(crate) use arithmetic::{
    leak, per_second, per_second_times, product, product_below, product_of_three, product_within, quotient,
    rounded, saturate, share_of, signed_quotient,
};

macro_rules! quantity {
    ($(#[$doc:meta])* $name:ident, $from:ident, $get:ident, $unit:literal) => {
        $(#[$doc])*
        /// Format I8F24: LSB 2^-24, range -128 to 128 (exclusive).
        #[derive(Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
        pub struct $name(I8F24);

        #[allow(dead_code, reason = "not every quantity is computed with in every way")]
        impl $name {
            /// Zero.
            pub const ZERO: Self = Self(I8F24::ZERO);
            /// The least value, -128.
            pub const MIN: Self = Self(I8F24::MIN);
            /// The largest value, 128 - 2^-24.
            pub const MAX: Self = Self(I8F24::MAX);

            #[doc = concat!("From ", $unit, ": rounds to nearest, saturates at the ends of the range.")]
            #[must_use]
            pub const fn $from(si: f64) -> Self {
                Self::from_bits(round_to_bits(si))
            }

            #[doc = concat!("The value in ", $unit, " (exact).")]
            #[must_use]
            pub const fn $get(self) -> f64 {
                self.bits() as f64 / ONE as f64
            }

            /// The value in f32, rounded to nearest: for what is advisory only.
            #[must_use]
            pub const fn to_f32(self) -> f32 {
                self.bits() as f32 * (1.0 / ONE as f32)
            }

            /// So many times itself, saturating: from counts of a converter, itself being one of them.
            #[must_use]
            pub const fn times(self, count: i32) -> Self {
                // 8 instructions of a Cortex-M4; `saturating_mul_int` has 14.
                Self(saturate(self.0.wide_mul(I32F0::from_bits(count))))
            }

            /// How many times it holds `part`, which is above zero; toward zero. To counts of a converter.
            #[must_use]
            pub fn count_of(self, part: Self) -> i32 {
                self.bits().saturating_div(part.bits().max(1))
            }

            /// The magnitude. The least value saturates.
            #[must_use]
            pub const fn abs(self) -> Self {
                if self.0.is_negative() {
                    self.opposite()
                } else {
                    self
                }
            }

            /// The sum, saturating.
            #[must_use]
            pub const fn plus(self, other: Self) -> Self {
                Self(self.0.saturating_add(other.0))
            }

            /// The difference, saturating.
            #[must_use]
            pub const fn minus(self, other: Self) -> Self {
                Self(self.0.saturating_sub(other.0))
            }

            /// The value with the other sign. The least one saturates.
            #[must_use]
            pub const fn opposite(self) -> Self {
                // One instruction of a Cortex-M4; `saturating_neg` has five.
                Self::ZERO.minus(self)
            }

            /// Whether it is no further than `most` from another.
            #[must_use]
            pub(crate) fn is_near(self, other: Self, most: Self) -> bool {
                self.0.unsigned_dist(other.0) <= most.0.unsigned_abs()
            }

            /// The nearest within +-`most`, which is not negative.
            #[must_use]
            pub(crate) fn within(self, most: Self) -> Self {
                self.min(most).max(most.opposite())
            }

            pub(crate) const fn from_fixed(value: I8F24) -> Self {
                Self(value)
            }

            /// Saturating.
            pub(crate) fn from_wide(value: I40F24) -> Self {
                Self(saturate(value))
            }

            pub(crate) const fn fixed(self) -> I8F24 {
                self.0
            }

            pub(crate) const fn from_bits(bits: i32) -> Self {
                Self(I8F24::from_bits(bits))
            }

            pub(crate) const fn bits(self) -> i32 {
                self.0.to_bits()
            }
        }

        impl fmt::Debug for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.debug_tuple(stringify!($name)).field(&self.$get()).finish()
            }
        }

        impl Words for $name {
            fn map_words(self, change: &mut impl FnMut(u32) -> u32) -> Self {
                Self(self.0.map_words(change))
            }

            fn agreement(&self, other: &Self) -> u32 {
                self.0.agreement(&other.0)
            }
        }
    };
}

const ONE: i32 = I8F24::ONE.to_bits();

quantity!(
    /// A length, m.
    Metres, from_m, m, "metres"
);
quantity!(
    /// An angle, rad.
    Radians, from_rad, rad, "radians"
);
quantity!(
    /// A speed along the road, m/s, forward positive.
    Speed, from_m_per_s, m_per_s, "metres per second"
);
quantity!(
    /// A torque on the steering column, N.m, positive turns left.
    Torque, from_nm, nm, "newton metres"
);

quantity!(
    /// A rate of a torque, N.m/s.
    TorqueRate, from_nm_per_s, nm_per_s, "newton metres per second"
);
quantity!(
    /// A torque summed over time, N.m.s.
    AngularImpulse, from_nm_s, nm_s, "newton metre seconds"
);
quantity!(
    /// A torque per length, N.m/m.
    TorquePerLength, from_nm_per_m, nm_per_m, "newton metres per metre"
);
quantity!(
    /// A torque per speed, N.m.s/m.
    TorquePerSpeed, from_nm_s_per_m, nm_s_per_m, "newton metre seconds per metre"
);
quantity!(
    /// A torque per angle, N.m/rad.
    TorquePerAngle, from_nm_per_rad, nm_per_rad, "newton metres per radian"
);
quantity!(
    /// A torque per turning rate, N.m.s/rad.
    TorquePerTurningRate, from_nm_s_per_rad, nm_s_per_rad, "newton metre seconds per radian"
);
quantity!(
    /// A torque per acceleration, N.m.s2/m.
    TorquePerAcceleration, from_nm_s2_per_m, nm_s2_per_m, "newton metre seconds squared per metre"
);
quantity!(
    /// An angle per length and angle, 1/m: how much a vehicle's path bends for an angle of the wheel.
    CurvaturePerAngle, from_per_m, per_m, "one per metre"
);
quantity!(
    /// A rate of turn, rad/s, positive turns left.
    TurningRate, from_rad_per_s, rad_per_s, "radians per second"
);
quantity!(
    /// A turning rate per angle, 1/s.
    TurningRatePerAngle, from_per_s, per_s, "one per second"
);
quantity!(
    /// A stability factor, s2/m2.
    StabilityFactor, from_s2_per_m2, s2_per_m2, "seconds squared per metre squared"
);
quantity!(
    /// A time as a factor, s. Spans of the clock are [`Micros`].
    Seconds, from_s, s, "seconds"
);
quantity!(
    /// A share, a slope between like quantities, or K_hg: no unit.
    Ratio, from_si, si, "ones"
);

impl Ratio {
    /// One.
    pub const ONE: Self = Self(I8F24::ONE);

    /// From f32: truncates, saturates, NaN becomes 0.
    pub(crate) const fn from_f32(si: f32) -> Self {
        Self::from_bits((si * ONE as f32) as i32)
    }
}

/// A time span in microseconds, up to 71.6 minutes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Micros(u32);

impl Micros {
    /// From microseconds.
    #[must_use]
    pub const fn from_us(us: u32) -> Self {
        Self(us)
    }

    /// From milliseconds, saturating.
    #[must_use]
    pub const fn from_ms(ms: u32) -> Self {
        Self(ms.saturating_mul(1000))
    }

    /// In microseconds.
    #[must_use]
    pub const fn us(self) -> u32 {
        self.0
    }
}

impl Words for Micros {
    fn map_words(self, change: &mut impl FnMut(u32) -> u32) -> Self {
        Self(change(self.0))
    }

    fn agreement(&self, other: &Self) -> u32 {
        self.0.agreement(&other.0)
    }
}

/// An instant on the ECU's free-running microsecond clock, which wraps every 71.6 minutes.
///
/// Only the span between two instants has a meaning, and only if they are less than one wrap apart: whoever
/// keeps an instant must drop it before that (the ECU drops an input as soon as it is stale).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Instant(u32);

impl Instant {
    /// From the clock's count.
    #[must_use]
    pub const fn from_us(us: u32) -> Self {
        Self(us)
    }

    /// The clock's count.
    #[must_use]
    pub const fn us(self) -> u32 {
        self.0
    }

    /// Time from `earlier` to `self`, across at most one wrap.
    #[must_use]
    pub const fn since(self, earlier: Self) -> Micros {
        Micros(self.0.wrapping_sub(earlier.0))
    }

    /// The instant `span` before this one.
    #[must_use]
    pub const fn before(self, span: Micros) -> Self {
        Self(self.0.wrapping_sub(span.0))
    }

    /// The instant `span` after this one.
    #[must_use]
    pub const fn after(self, span: Micros) -> Self {
        Self(self.0.wrapping_add(span.0))
    }
}

impl Words for Instant {
    fn map_words(self, change: &mut impl FnMut(u32) -> u32) -> Self {
        Self(change(self.0))
    }

    fn agreement(&self, other: &Self) -> u32 {
        self.0.agreement(&other.0)
    }
}

const fn round_to_bits(si: f64) -> i32 {
    let scaled = si * ONE as f64;
    // `f64::round` is not in `core`; `as` truncates and saturates, and turns NaN into 0.
    (if scaled >= 0.0 { scaled + 0.5 } else { scaled - 0.5 }) as i32
}
