//! Sine of a 32-bit phase: the one waveform of the probe and of the window and phasor of its estimator, the
//! same bits on every machine.
//!
//! A phase is a `u32` whose full range is one turn, so that it wraps by itself. The sine is an odd minimax
//! polynomial of degree 7 on the quarter wave. Error: at most 7e-7 of full scale, a twentieth of an LSB of
//! the bus for the largest probe (the test below asserts it against f64). Cost: about 30 instructions.

use fixed::types::{I0F32, I2F30};

/// Coefficients of x, x^3, x^5, x^7, for x = 1 at a quarter turn.
const C: [I2F30; 4] = [
    I2F30::from_bits(1_686_623_910),
    I2F30::from_bits(-693_521_754),
    I2F30::from_bits(85_290_965),
    I2F30::from_bits(-4_651_906),
];

/// The phase a quarter turn ahead of another: `sine(phase + QUARTER)` is the cosine.
pub(crate) const QUARTER: u32 = 1 << 30;

/// `sin(2*pi*phase/2^32)`.
#[must_use]
pub(crate) fn sine(phase: u32) -> I2F30 {
    // Half turns, folded to the quarter wave on each side of zero; -2 is the half turn itself.
    let turn = I2F30::from_bits(phase.cast_signed());
    let x = if turn.unsigned_abs() > I2F30::ONE.unsigned_abs() {
        I2F30::MIN.wrapping_sub(turn)
    } else {
        turn
    };
    let square = times(x, x);
    let tail = C[2].wrapping_add(times_small(square, C[3]));
    let tail = C[1].wrapping_add(times_small(square, tail));
    let sine = times(x, C[0].wrapping_add(times(square, tail)));
    // The polynomial may pass one by its error.
    sine.min(I2F30::ONE).max(I2F30::NEG_ONE)
}

/// A product. None here reaches 2, the end of the format, nor does a sum: `abs(x)` is at most 1, and each
/// partial sum of the polynomial at most 1.6.
fn times(a: I2F30, b: I2F30) -> I2F30 {
    I2F30::wrapping_from_num(a.wide_mul(b))
}

/// `a*b` for a `b` below a half, which fits an I0F32: then the product is the upper half of one of 64 bits,
/// which a 32-bit core has in one instruction.
fn times_small(a: I2F30, b: I2F30) -> I2F30 {
    I2F30::wrapping_from_num(a.wide_mul(I0F32::wrapping_from_num(b)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_of_what_is_small_are_those_of_all() {
        // Both sums that it is used for: the last coefficient, and what it and the one before add up to.
        let one = I2F30::ONE.to_bits();
        for square in (0..=one).step_by(997).chain([0, 1, one - 1, one]) {
            let square = I2F30::from_bits(square);
            for b in [C[3], C[2].wrapping_add(times(square, C[3])), C[2]] {
                assert!(b.abs() < 0.5, "{b}");
                assert_eq!(times_small(square, b), times(square, b), "{square} {b}");
            }
        }
    }

    #[test]
    fn agrees_with_f64_to_7e_7() {
        let mut worst = 0.0_f64;
        for phase in (0..=u32::MAX)
            .step_by(9973)
            .chain([0, 1 << 30, 1 << 31, 3 << 30, u32::MAX])
        {
            let exact = (f64::from(phase) * core::f64::consts::TAU / 4_294_967_296.0).sin();
            worst = worst.max((sine(phase).to_num::<f64>() - exact).abs());
        }
        assert!(worst < 7e-7, "{worst:e}");
    }

    #[test]
    fn quarter_turns() {
        assert_eq!(sine(0), 0);
        assert_eq!(sine(1 << 31), 0);
        for phase in [123_u32, 1 << 29, 0x3FFF_FFFF, 0x5555_5555] {
            // A shift rounds down on both sides of zero.
            assert!(
                (sine(phase.wrapping_neg()) + sine(phase)).to_bits().abs() <= 4,
                "{phase:#x}"
            );
            assert_eq!(sine(phase), sine((1_u32 << 31).wrapping_sub(phase)), "{phase:#x}");
        }
    }
}
