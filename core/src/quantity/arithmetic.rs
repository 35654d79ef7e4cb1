//! What `fixed` lacks, or does in more instructions: rounded products, shares of a second, quotients. Nothing here takes a
//! product of 128 bits or a division of 64, which are a hundred instructions and more on a 32-bit core.

use fixed::types::extra::LeEqU64;
use fixed::types::{I0F32, I8F24, I32F0, I40F24};
use fixed::{FixedI32, FixedI64};

use super::Micros;

/// A value with fewer fractional bits, rounded to nearest (ties away from minus infinity). Half a unit of the result more than
/// `wide` fits its format too.
pub(crate) const fn rounded<From: LeEqU64, To: LeEqU64>(wide: FixedI64<From>) -> FixedI64<To> {
    let cut = From::U32.wrapping_sub(To::U32);
    let half = 1_i64.wrapping_shl(cut.wrapping_sub(1));
    FixedI64::from_bits(wide.to_bits().wrapping_add(half).wrapping_shr(cut))
}

/// The nearest of 32 bits: 7 instructions on a Cortex-M4, where `saturating_from_num` has 24.
pub(crate) const fn saturate<Frac>(wide: FixedI64<Frac>) -> FixedI32<Frac> {
    let near = wide.to_bits() as i32;
    if near as i64 == wide.to_bits() {
        FixedI32::from_bits(near)
    } else if wide.to_bits() < 0 {
        FixedI32::MIN
    } else {
        FixedI32::MAX
    }
}

/// `a * b`, rounded to nearest: within +-2^14.
pub(crate) const fn product(a: I8F24, b: I8F24) -> I40F24 {
    rounded(a.wide_mul(b))
}

/// A share of a value, rounded to nearest. `share` is 0 to 1, so that the result is no larger than the value.
pub(crate) fn share_of(share: I8F24, value: I8F24) -> I8F24 {
    I8F24::wrapping_from_num(product(share, value))
}

/// [`product`] rounded down, saturating: 17 instructions, where `saturating_mul` has 28.
pub(crate) fn product_below(a: I8F24, b: I8F24) -> I8F24 {
    saturate(I40F24::wrapping_from_num(a.wide_mul(b)))
}

/// A product rounded down and held within +-`most`.
pub(crate) fn product_within(a: I8F24, b: I8F24, most: I8F24) -> I8F24 {
    let (wide, most) = (I40F24::wrapping_from_num(a.wide_mul(b)), I40F24::from(most));
    I8F24::wrapping_from_num(wide.min(most).max(most.wrapping_neg()))
}

/// A [`product`] times a third factor, rounded down.
pub(crate) fn product_of_three(product: I40F24, factor: I8F24) -> I40F24 {
    // The product's whole part has 15 bits, so that neither term nor the sum wraps, and the first is exact.
    let whole = factor.wide_mul(I32F0::wrapping_from_num(product));
    let fraction = factor.wide_mul(I8F24::wrapping_from_num(product.frac()));
    whole.wrapping_add(I40F24::wrapping_from_num(fraction))
}

/// `value * span / 1 s`, rounded to nearest and saturated to what an I8F24 holds, for a span of at most [`LONGEST_US`]:
/// 2^32 / 10^6 as a multiplier, 8e-6 of relative error.
#[inline(always)]
pub(crate) fn per_second_times(value: I40F24, span: Micros) -> I40F24 {
    // The usual case first.
    let near = I8F24::wrapping_from_num(value);
    let share = if near == value {
        per_second(near, span)
    } else {
        wide_per_second(value.to_bits(), span)
    };
    I40F24::from(share)
}

fn wide_per_second(bits: i64, span: Micros) -> I8F24 {
    let share = share_of_second(span).to_bits();
    // Nothing wraps: a share has 31 bits, and the lower product no sign.
    let low = (bits as u32 as u64)
        .wrapping_mul(share as u64)
        .wrapping_add(1 << 31)
        >> 32;
    let high = (bits >> 32).wrapping_mul(share as i64);
    saturate(I40F24::from_bits(high.wrapping_add(low as i64)))
}

/// `value * span / 1 s`, rounded to nearest, of 32 bits in any format. It never saturates: at most half of the value is left.
pub(crate) const fn per_second<Frac>(value: FixedI32<Frac>, span: Micros) -> FixedI32<Frac> {
    let wide = I8F24::from_bits(value.to_bits()).wide_mul(share_of_second(span));
    let near: I40F24 = rounded(wide);
    FixedI32::from_bits(near.to_bits() as i32)
}

/// A leaking sum: `sum + change - sum*dt/(1 s)`.
pub(crate) const fn leak(sum: I8F24, change: I8F24, dt: Micros) -> I8F24 {
    // What leaks is at most half of the sum.
    sum.wrapping_sub(per_second(sum, dt)).saturating_add(change)
}

/// The longest span that counts: half a second, less what would make a share of it more than an I0F32 holds. So its
/// product with 32 bits is one instruction of a 32-bit core.
const LONGEST_US: u32 = 499_996;

/// A span as a share of a second, not quite half of one at most.
const fn share_of_second(span: Micros) -> I0F32 {
    let us = if span.us() > LONGEST_US {
        LONGEST_US
    } else {
        span.us()
    };
    I0F32::from_bits(us.wrapping_mul(4295) as i32)
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

#[cfg(test)]
mod tests {
    use super::*;
    use fixed::types::extra::{U20, U44};

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

    /// A value of so many 2^-24.
    fn narrow(bits: i32) -> I8F24 {
        I8F24::from_bits(bits)
    }

    /// Plain formulas in 128 bits, which no target computes with.
    #[test]
    fn products_are_those_of_128_bits() {
        let mut numbers = Numbers(1);
        for _ in 0..CASES {
            let (a, b) = (numbers.any() as i32, numbers.any() as i32);
            let exact = i128::from(a) * i128::from(b);
            let rounded = (exact + (1 << 23)).div_euclid(1 << 24);
            let product = product(narrow(a), narrow(b));
            assert_eq!(i128::from(product.to_bits()), rounded, "{a} {b}");
            let third = numbers.any() as i32;
            let expected = (rounded * i128::from(third)).div_euclid(1 << 24);
            let found = product_of_three(product, narrow(third));
            assert_eq!(i128::from(found.to_bits()), expected, "{a} {b} {third}");
            let share = a.clamp(0, 1 << 24);
            let rounded = (i128::from(share) * i128::from(b) + (1 << 23)).div_euclid(1 << 24);
            let found = share_of(narrow(share), narrow(b));
            assert_eq!(i128::from(found.to_bits()), rounded, "{share} {b}");
            let below = exact.div_euclid(1 << 24);
            let below = below.clamp(i32::MIN.into(), i32::MAX.into());
            let found = product_below(narrow(a), narrow(b));
            assert_eq!(i128::from(found.to_bits()), below, "{a} {b}");
            let most = numbers.any() as i32 & i32::MAX;
            let within = below.clamp(-i128::from(most), most.into());
            let found = product_within(narrow(a), narrow(b), narrow(most));
            assert_eq!(i128::from(found.to_bits()), within, "{a} {b}");
        }
    }

    #[test]
    fn what_is_rounded_or_saturated_is_that_of_128_bits() {
        let mut numbers = Numbers(4);
        for _ in 0..CASES {
            let bits = numbers.any() as i64;
            let expected = bits.clamp(i32::MIN.into(), i32::MAX.into());
            assert_eq!(
                i64::from(saturate(I40F24::from_bits(bits)).to_bits()),
                expected,
                "{bits}"
            );
            let wide = bits >> 1;
            let near: FixedI64<U20> = rounded(FixedI64::<U44>::from_bits(wide));
            let expected = (i128::from(wide) + (1 << 23)).div_euclid(1 << 24);
            assert_eq!(i128::from(near.to_bits()), expected, "{wide}");
        }
    }

    #[test]
    fn shares_of_a_second_are_those_of_128_bits() {
        let mut numbers = Numbers(2);
        for case in 0..CASES {
            // Most spans are of a few milliseconds; the longest that counts is half a second.
            let us = match case % 4 {
                0 => numbers.any() as u32,
                1 => LONGEST_US + 1 - (numbers.word() % 3) as u32,
                _ => (numbers.word() % 100_000) as u32,
            };
            let (bits, span) = (numbers.any() as i64, Micros::from_us(us));
            let share = 4295 * i128::from(us.min(LONGEST_US));
            let exact = |bits: i128| (bits * share + (1 << 31)).div_euclid(1 << 32);
            let expected = exact(bits.into()).clamp(i32::MIN.into(), i32::MAX.into());
            let found = per_second_times(I40F24::from_bits(bits), span).to_bits();
            assert_eq!(i128::from(found), expected, "{bits} {us}");
            let bits = bits as i32;
            let found = per_second(narrow(bits), span).to_bits();
            assert_eq!(i128::from(found), exact(bits.into()), "{bits} {us}");
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
