//! Physical quantities in fixed point, one type each; the one file where SI values become bits.
//!
//! All signed quantities share one format, I8F24: 24 fractional bits, LSB 2^-24 (6e-8), range
//! -128..+127.99999994 in the SI unit. That holds +-4 m of lateral error, +-20 rad of wheel angle and
//! +-32 N.m of driver torque with a resolution far below any sensor's, and a product of two of them fits
//! an `i64`. Conversions from SI round to nearest and saturate at the ends of the range (NaN becomes 0):
//! an extreme input must stay extreme, never wrap.
//!
//! Not here: ranges that make sense for a signal. Those belong to the bus messages and the parameters.

#![expect(
    clippy::as_conversions,
    clippy::arithmetic_side_effects,
    clippy::float_arithmetic,
    reason = "the one file where SI values become bits: `as` saturates from floats, and widens integers"
)]

use core::fmt;

use crate::redundant::Words;

macro_rules! quantity {
    ($(#[$doc:meta])* $name:ident, $from:ident, $get:ident, $unit:literal) => {
        $(#[$doc])*
        /// Format I8F24: LSB 2^-24, range -128 to 128 (exclusive).
        #[derive(Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
        pub struct $name(i32);

        impl $name {
            /// Zero.
            pub const ZERO: Self = Self(0);
            /// The least value, -128.
            pub const MIN: Self = Self(i32::MIN);
            /// The largest value, 128 - 2^-24.
            pub const MAX: Self = Self(i32::MAX);

            #[doc = concat!("From ", $unit, ": rounds to nearest, saturates at the ends of the range.")]
            #[must_use]
            pub const fn $from(si: f64) -> Self {
                Self::from_bits(round_to_bits(si))
            }

            #[doc = concat!("The value in ", $unit, " (exact).")]
            #[must_use]
            pub const fn $get(self) -> f64 {
                self.0 as f64 / ONE as f64
            }

            /// As f32, rounded to nearest: for what is advisory only.
            #[must_use]
            pub const fn to_f32(self) -> f32 {
                self.0 as f32 * (1.0 / ONE as f32)
            }

            /// So many times itself, saturating: from counts of a converter, itself being one of them.
            #[must_use]
            pub const fn times(self, count: i32) -> Self {
                Self::from_wide((self.bits() as i64).saturating_mul(count as i64))
            }

            /// How many times it holds `part`, which is above zero; toward zero. To counts of a converter.
            #[must_use]
            pub fn count_of(self, part: Self) -> i32 {
                self.bits().saturating_div(part.bits().max(1))
            }

            pub(crate) const fn from_bits(bits: i32) -> Self {
                Self(bits)
            }

            /// From a count of 2^-24, saturating.
            pub(crate) const fn from_wide(bits: i64) -> Self {
                Self::from_bits(saturate(bits))
            }

            pub(crate) const fn bits(self) -> i32 {
                self.0
            }
        }

        impl fmt::Debug for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.debug_tuple(stringify!($name)).field(&self.$get()).finish()
            }
        }

        impl Words for $name {
            fn map_words(self, change: &mut impl FnMut(u32) -> u32) -> Self {
                Self::from_bits(self.bits().map_words(change))
            }

            fn is_inverse_of(&self, other: &Self) -> bool {
                self.bits().is_inverse_of(&other.bits())
            }
        }
    };
}

/// Fractional bits of every signed quantity.
pub(crate) const FRAC_BITS: u32 = 24;
const ONE: i64 = 1 << FRAC_BITS;

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

impl Torque {
    /// The magnitude. The most negative value saturates.
    #[must_use]
    pub const fn abs(self) -> Self {
        Self(self.0.saturating_abs())
    }

    /// The sum, saturating.
    #[must_use]
    pub const fn plus(self, other: Self) -> Self {
        Self(self.0.saturating_add(other.0))
    }

    /// The torque of opposite direction. The most negative value saturates.
    #[must_use]
    pub const fn opposite(self) -> Self {
        Self(self.0.saturating_neg())
    }
}

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
    pub const ONE: Self = Self::from_bits(1 << FRAC_BITS);

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

    fn is_inverse_of(&self, other: &Self) -> bool {
        self.0.is_inverse_of(&other.0)
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

    fn is_inverse_of(&self, other: &Self) -> bool {
        self.0.is_inverse_of(&other.0)
    }
}

/// `a * b` of two I8F24 values as I8F24 bits, rounded to nearest: within +-2^38.
pub(crate) const fn product(a: i32, b: i32) -> i64 {
    // At most 2^62 and half an LSB: nothing wraps.
    (a as i64)
        .wrapping_mul(b as i64)
        .wrapping_add(1 << (FRAC_BITS - 1))
        >> FRAC_BITS
}

/// `wide * factor`, saturating. `i64::saturating_mul` takes a product of 128 bits, which is a hundred instructions on a
/// 32-bit core.
pub(crate) const fn wide_product(wide: i64, factor: i32) -> i64 {
    let factor = factor as i64;
    // Nothing wraps: 32 bits times 31, then 31 times 31 and as much as 31 more.
    let low = (wide as u32 as i64).wrapping_mul(factor);
    let high = (wide >> 32).wrapping_mul(factor).wrapping_add(low >> 32);
    if high as i32 as i64 == high {
        (high << 32) | (low & 0xFFFF_FFFF)
    } else if high < 0 {
        i64::MIN
    } else {
        i64::MAX
    }
}

/// `bits * span / 1 s`, rounded to nearest and saturated to an `i32`, for a span of at most 0.5 s: 2^32 / 10^6 as a
/// multiplier, 8e-6 of relative error.
#[inline(always)]
pub(crate) const fn per_second_times(bits: i64, span: Micros) -> i64 {
    wide_per_second(bits, span) as i64
}

const fn wide_per_second(bits: i64, span: Micros) -> i32 {
    let share = share_of_second(span);
    // Nothing wraps: a share has less than 31.1 bits, and the lower product no sign.
    let low = (bits as u32 as u64)
        .wrapping_mul(share as u64)
        .wrapping_add(1 << 31)
        >> 32;
    saturate((bits >> 32).wrapping_mul(share as i64).wrapping_add(low as i64))
}

/// The same of 32 bits, which never saturates: at most half of them is left.
pub(crate) const fn per_second(bits: i32, span: Micros) -> i32 {
    let wide = (bits as i64).wrapping_mul(share_of_second(span) as i64);
    (wide.wrapping_add(1 << 31) >> 32) as i32
}

/// A span as a share of a second in 2^-32, half of one at most.
const fn share_of_second(span: Micros) -> u32 {
    let us = if span.us() > 500_000 { 500_000 } else { span.us() };
    us.wrapping_mul(4295)
}

/// `dividend / divisor`, rounded down, saturating; 0 for a divisor of zero. A long division with two digits of 16 bits:
/// that of two `u64` takes a hundred instructions and more on a 32-bit core.
pub(crate) const fn quotient(dividend: u64, divisor: u32) -> u32 {
    if divisor == 0 {
        return 0;
    }
    if (dividend >> 32) as u32 >= divisor {
        return u32::MAX;
    }
    let up = divisor.leading_zeros();
    let divisor = divisor.wrapping_shl(up);
    let dividend = dividend.wrapping_shl(up);
    let (high, rest) = digit((dividend >> 32) as u32, (dividend as u32) >> 16, divisor);
    let (low, _) = digit(rest, dividend as u32 & 0xFFFF, divisor);
    (high << 16) | low
}

/// One digit of 16 bits of a quotient, and what is left: of `rest`, which is less than the divisor, with the next digit
/// of the dividend behind it. The divisor has its highest bit set, so that its upper half names the digit, or one or two
/// more than it (Knuth, The Art of Computer Programming, 4.3.1, theorem B).
const fn digit(rest: u32, next: u32, divisor: u32) -> (u32, u32) {
    // The bit is set already: here the compiler sees that this is no division by zero.
    let upper = (divisor >> 16) | 0x8000;
    let guess = rest / upper;
    let guess = if guess > 0xFFFF { 0xFFFF } else { guess };
    let rest = ((rest as u64) << 16) | next as u64;
    let (mut digit, mut product) = (guess, (guess as u64).wrapping_mul(divisor as u64));
    if product > rest {
        (digit, product) = (digit.wrapping_sub(1), product.wrapping_sub(divisor as u64));
        if product > rest {
            (digit, product) = (digit.wrapping_sub(1), product.wrapping_sub(divisor as u64));
        }
    }
    (digit, rest.wrapping_sub(product) as u32)
}

/// [`quotient`] toward zero with the dividend's sign, saturating.
pub(crate) const fn signed_quotient(dividend: i64, divisor: u32) -> i32 {
    let size = quotient(dividend.unsigned_abs(), divisor);
    let size = if size > i32::MAX as u32 {
        i32::MAX
    } else {
        size as i32
    };
    if dividend < 0 { size.wrapping_neg() } else { size }
}

/// Nearest `i32`, saturating.
pub(crate) const fn saturate(wide: i64) -> i32 {
    if wide as i32 as i64 == wide {
        wide as i32
    } else if wide < 0 {
        i32::MIN
    } else {
        i32::MAX
    }
}

/// `value / 2^shift`, rounded to nearest (ties away from minus infinity). `shift` is 1 to 62.
pub(crate) const fn shift_round(value: i64, shift: u32) -> i64 {
    value
        .saturating_add(1_i64.wrapping_shl(shift.wrapping_sub(1)))
        .wrapping_shr(shift)
}

const fn round_to_bits(si: f64) -> i32 {
    let scaled = si * ONE as f64;
    // `f64::round` is not in `core`; `as` truncates and saturates, and turns NaN into 0.
    (if scaled >= 0.0 { scaled + 0.5 } else { scaled - 0.5 }) as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// xorshift64*, seeded: words whose sizes are spread evenly over the powers of two, of both signs, and their edges.
    struct Numbers(u64);

    impl Numbers {
        fn word(&mut self) -> u64 {
            self.0 ^= self.0 >> 12;
            self.0 ^= self.0 << 25;
            self.0 ^= self.0 >> 27;
            self.0.wrapping_mul(0x2545_F491_4F6C_DD1D)
        }

        fn any(&mut self) -> u64 {
            let (size, word, kind) = (self.word() >> 58, self.word() >> 1, self.word() >> 61);
            match kind {
                0 => 1_u64.rotate_left(size as u32),
                1 => 1_u64.rotate_left(size as u32).wrapping_sub(1),
                2 => !(1_u64.rotate_left(size as u32)),
                3 => !(word >> size),
                _ => word >> size,
            }
        }
    }

    const CASES: u32 = 1_000_000;

    /// Plain formulas in 128 bits, which no target computes with.
    #[test]
    fn products_are_those_of_128_bits() {
        let mut numbers = Numbers(1);
        for _ in 0..CASES {
            let (wide, factor) = (numbers.any() as i64, numbers.any() as i32);
            let exact = i128::from(wide) * i128::from(factor);
            let expected = exact.clamp(i64::MIN.into(), i64::MAX.into());
            assert_eq!(
                i128::from(wide_product(wide, factor)),
                expected,
                "{wide} {factor}"
            );
            let narrow = wide as i32;
            let exact = i128::from(narrow) * i128::from(factor);
            let rounded = (exact + (1 << 23)).div_euclid(1 << 24);
            assert_eq!(i128::from(product(narrow, factor)), rounded, "{narrow} {factor}");
        }
    }

    #[test]
    fn shares_of_a_second_are_those_of_128_bits() {
        let mut numbers = Numbers(2);
        for case in 0..CASES {
            // Most spans are of a few milliseconds; the longest that counts is half a second.
            let us = match case % 4 {
                0 => numbers.any() as u32,
                1 => 500_000 - (numbers.word() % 3) as u32,
                _ => (numbers.word() % 100_000) as u32,
            };
            let (bits, span) = (numbers.any() as i64, Micros::from_us(us));
            let share = 4295 * i128::from(us.min(500_000));
            let exact = |bits: i128| (bits * share + (1 << 31)).div_euclid(1 << 32);
            let expected = exact(bits.into()).clamp(i32::MIN.into(), i32::MAX.into());
            assert_eq!(i128::from(per_second_times(bits, span)), expected, "{bits} {us}");
            let narrow = bits as i32;
            assert_eq!(
                i128::from(per_second(narrow, span)),
                exact(narrow.into()),
                "{narrow} {us}"
            );
        }
    }

    #[test]
    fn quotients_are_those_of_the_processor() {
        let mut numbers = Numbers(3);
        let mut corrections = [0_u32; 3];
        for case in 0..2 * CASES {
            let divisor = numbers.any() as u32;
            // Half of the dividends lie next to a multiple of the divisor, where a digit is guessed wrong.
            let dividend = if case % 2 == 0 {
                numbers.any()
            } else {
                let times = u64::from(numbers.any() as u32);
                (times.wrapping_mul(divisor.into()))
                    .wrapping_add(numbers.word() % 3)
                    .wrapping_sub(1)
            };
            let exact = dividend.checked_div(divisor.into()).unwrap_or(0);
            let expected = u32::try_from(exact).unwrap_or(u32::MAX);
            assert_eq!(quotient(dividend, divisor), expected, "{dividend} / {divisor}");

            let signed = dividend as i64;
            let exact = i128::from(signed).checked_div(divisor.into()).unwrap_or(0);
            let expected = exact.clamp(-i128::from(i32::MAX), i32::MAX.into());
            assert_eq!(
                i128::from(signed_quotient(signed, divisor)),
                expected,
                "{signed} / {divisor}"
            );

            if divisor != 0 && exact < 1 << 32 {
                let upper = u64::from(divisor << divisor.leading_zeros()) >> 16;
                let high = ((dividend << divisor.leading_zeros()) >> 32) / upper;
                let digit = (dividend / u64::from(divisor)) >> 16;
                if let Some(count) = corrections.get_mut(high.min(0xFFFF).abs_diff(digit) as usize) {
                    *count += 1;
                }
            }
        }
        // Every correction of a digit came often.
        assert!(corrections.iter().all(|count| *count > 100), "{corrections:?}");
    }
}
