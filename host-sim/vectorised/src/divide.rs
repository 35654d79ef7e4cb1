//! Divisions by a constant, to the same bits, without a division: a processor makes several products in the time of one.

/// A number to divide by, of which a power of two is three or five times as large.
pub(super) struct Divisor {
    by: f64,
    inverse: f64,
    /// What the inverse lacks of the true one.
    rest: f64,
}

/// Twice three, eight times three, eight times five. A third of 2^-54 of a double's inverse is missing for three, a fifth of
/// it too much for five: the same share of the inverse.
pub(super) const SIX: Divisor = Divisor::new(6.0, 1.0);
pub(super) const TWENTY_FOUR: Divisor = Divisor::new(24.0, 1.0);
pub(super) const FORTY: Divisor = Divisor::new(40.0, -1.0);

impl Divisor {
    const fn new(by: f64, sign: f64) -> Self {
        let inverse = 1.0 / by;
        Self {
            by,
            inverse,
            rest: sign * inverse * (f64::EPSILON / 4.0),
        }
    }

    /// `value / self`. A quotient by three is a sixth of its last bit or more from where rounding turns, one by five a tenth:
    /// the product with the inverse to twice the digits, rounded once, is the same. But for a negative zero over forty,
    /// which becomes a positive one, and for quotients of less than 1e-290, which are added to what is much larger.
    ///
    /// Fused where the machine multiplies and adds in one instruction; elsewhere that would be a call.
    #[inline(always)]
    pub(super) fn divide<const FUSED: bool>(&self, value: f64) -> f64 {
        if FUSED {
            value.mul_add(self.inverse, value * self.rest)
        } else {
            value / self.by
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::rngs::Xoshiro256PlusPlus;
    use rand::{RngExt, SeedableRng};

    use super::*;

    #[test]
    fn a_product_is_the_quotient_to_the_bit() {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(1);
        let any = std::iter::repeat_with(|| f64::from_bits(random.random())).take(400_000);
        let is_ordinary = |value: &f64| value.abs() > 1e-289 && value.is_finite();
        let small = (1..20_000).map(|i| f64::from(i) * 0.25);
        // The last bits of a significand, where rounding is closest to turn.
        let edges = (0..2000).flat_map(|i| {
            [
                1.0 + f64::from(i) * f64::EPSILON,
                2.0 - f64::from(i) * f64::EPSILON,
            ]
        });
        for value in any.filter(is_ordinary).chain(small).chain(edges) {
            for divisor in [SIX, TWENTY_FOUR, FORTY] {
                let (fused, plain) = (divisor.divide::<true>(value), value / divisor.by);
                assert_eq!(fused.to_bits(), plain.to_bits(), "{value:e} / {}", divisor.by);
            }
        }
        for zero in [0.0, -0.0_f64] {
            assert_eq!(SIX.divide::<true>(zero).to_bits(), zero.to_bits());
            assert_eq!(TWENTY_FOUR.divide::<true>(zero).to_bits(), zero.to_bits());
            assert_eq!(FORTY.divide::<true>(zero), 0.0);
        }
    }
}
