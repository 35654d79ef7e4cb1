//! Products, shares and quotients of fixed-point values for a 32-bit core: nothing here takes a product of 128 bits or a
//! division of 64.

use super::{FRAC_BITS, Micros};

/// `a * b` of two I8F24 values as I8F24 bits, rounded to nearest: within +-2^38.
pub(crate) const fn product(a: i32, b: i32) -> i64 {
    // At most 2^62 and half an LSB: nothing wraps.
    (a as i64)
        .wrapping_mul(b as i64)
        .wrapping_add(1 << (FRAC_BITS - 1))
        >> FRAC_BITS
}

/// A share of a value, rounded to nearest. `share` is 0 to 1, so that the result is no larger than the value.
pub(crate) const fn share_of(share: i32, value: i32) -> i32 {
    product(share, value) as i32
}

/// [`product`] rounded down, saturating.
pub(crate) const fn product_below(a: i32, b: i32) -> i32 {
    saturate((a as i64).wrapping_mul(b as i64) >> FRAC_BITS)
}

/// The same, held within +-`most`.
pub(crate) const fn product_within(a: i32, b: i32, most: i32) -> i32 {
    let (wide, most) = ((a as i64).wrapping_mul(b as i64) >> FRAC_BITS, most as i64);
    if wide > most {
        most as i32
    } else if wide < most.wrapping_neg() {
        most.wrapping_neg() as i32
    } else {
        wide as i32
    }
}

/// The upper half of `a * b`, which a 32-bit core has in one instruction.
pub(crate) const fn upper_product(a: i32, b: i32) -> i32 {
    ((a as i64).wrapping_mul(b as i64) >> 32) as i32
}

/// `wide * factor`, saturating. `i64::saturating_mul` takes a product of 128 bits, which is a hundred instructions on a
/// 32-bit core.
pub(crate) const fn wide_product(wide: i64, factor: i32) -> i64 {
    let factor = factor as i64;
    // The usual case first.
    if wide as i32 as i64 == wide {
        return wide.wrapping_mul(factor);
    }
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

/// `bits * span / 1 s`, rounded to nearest and saturated to an `i32`, for a span of at most [`LONGEST_US`]: 2^32 / 10^6 as
/// a multiplier, 8e-6 of relative error.
#[inline(always)]
pub(crate) const fn per_second_times(bits: i64, span: Micros) -> i64 {
    // The usual case first.
    if bits as i32 as i64 == bits {
        per_second(bits as i32, span) as i64
    } else {
        wide_per_second(bits, span) as i64
    }
}

const fn wide_per_second(bits: i64, span: Micros) -> i32 {
    let share = share_of_second(span);
    // Nothing wraps: a share has 31 bits, and the lower product no sign.
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

/// A leaking sum in 2^-24: `sum + change - sum*dt/(1 s)`.
pub(crate) const fn leak(sum: i32, change: i32, dt: Micros) -> i32 {
    // What leaks is at most half of the sum.
    sum.wrapping_sub(per_second(sum, dt)).saturating_add(change)
}

/// The longest span that counts: half a second, less what would make a share of it more than an `i32` holds. So its
/// product with 32 bits is one instruction of a 32-bit core.
const LONGEST_US: u32 = 499_996;

/// A span as a share of a second in 2^-32, not quite half of one at most.
const fn share_of_second(span: Micros) -> i32 {
    let us = if span.us() > LONGEST_US {
        LONGEST_US
    } else {
        span.us()
    };
    us.wrapping_mul(4295) as i32
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

/// `value / 2^shift`, rounded to nearest (ties away from minus infinity). `shift` is 1 to 62, and half of its unit more
/// than `value` is an `i64` too.
pub(crate) const fn shift_round(value: i64, shift: u32) -> i64 {
    value
        .wrapping_add(1_i64.wrapping_shl(shift.wrapping_sub(1)))
        .wrapping_shr(shift)
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
            let share = narrow.clamp(0, 1 << 24);
            let exact_share = i128::from(share) * i128::from(factor);
            let rounded = (exact_share + (1 << 23)).div_euclid(1 << 24);
            assert_eq!(i128::from(share_of(share, factor)), rounded, "{share} {factor}");
            let below = exact.div_euclid(1 << 24);
            let below = below.clamp(i32::MIN.into(), i32::MAX.into());
            assert_eq!(
                i128::from(product_below(narrow, factor)),
                below,
                "{narrow} {factor}"
            );
            let most = numbers.any() as i32 & i32::MAX;
            let within = below.clamp(-i128::from(most), most.into());
            assert_eq!(
                i128::from(product_within(narrow, factor, most)),
                within,
                "{narrow} {factor}"
            );
            let upper = exact.div_euclid(1 << 32);
            assert_eq!(
                i128::from(upper_product(narrow, factor)),
                upper,
                "{narrow} {factor}"
            );
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
