//! Sine of a 32-bit phase: the one waveform of the probe and of the window and phasor of its estimator, the
//! same bits on every machine.
//!
//! A phase is a `u32` whose full range is one turn, so that it wraps by itself. The sine is an odd minimax
//! polynomial of degree 7 on the quarter wave. Error: at most 7e-7 of full scale, a twentieth of an LSB of
//! the bus for the largest probe (the test below asserts it against f64). Cost: about 30 instructions.

#![expect(
    clippy::as_conversions,
    reason = "a phase is any 32 bits, and a product of two fits an i64"
)]

/// One, in the sine's format.
pub(crate) const ONE: i32 = 1 << 30;

/// Coefficients of x, x^3, x^5, x^7 in 2^-30, for x = 1 at a quarter turn.
const C: [i32; 4] = [1_686_623_910, -693_521_754, 85_290_965, -4_651_906];

/// The phase a quarter turn ahead of another: `sine(phase + QUARTER)` is the cosine.
pub(crate) const QUARTER: u32 = 1 << 30;

/// `sin(2*pi*phase/2^32)` in 2^-30.
#[must_use]
pub(crate) fn sine(phase: u32) -> i32 {
    // Half turns as an i32, folded to the quarter wave on each side of zero.
    let turn = phase as i32;
    let x = if turn.unsigned_abs() > QUARTER {
        i32::MIN.wrapping_sub(turn)
    } else {
        turn
    };
    let square = times(x, x);
    let tail = C[2].wrapping_add(times_small(square, C[3]));
    let tail = C[1].wrapping_add(times_small(square, tail));
    let sine = times(x, C[0].wrapping_add(times(square, tail)));
    // The polynomial may pass one by its error.
    sine.clamp(-ONE, ONE)
}

/// A product in 2^-30. No product or sum here reaches 2, the end of an `i32`: `abs(x)` is at most 1, and each
/// partial sum of the polynomial at most 1.6.
fn times(a: i32, b: i32) -> i32 {
    ((a as i64).wrapping_mul(b as i64) >> 30) as i32
}

/// The same for a `b` below a half, whose quarter-fold has room: then the product is the upper half of one of 64 bits,
/// which a 32-bit core has in one instruction.
fn times_small(a: i32, b: i32) -> i32 {
    ((a as i64).wrapping_mul(b.wrapping_shl(2) as i64) >> 32) as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_of_what_is_small_are_those_of_all() {
        // Both sums that it is used for: the last coefficient, and what it and the one before add up to.
        for square in (0..=ONE).step_by(997).chain([0, 1, ONE - 1, ONE]) {
            for b in [C[3], C[2].wrapping_add(times(square, C[3])), C[2]] {
                assert!(b.unsigned_abs() < 1 << 29, "{b}");
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
            worst = worst.max((f64::from(sine(phase)) / f64::from(ONE) - exact).abs());
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
                (sine(phase.wrapping_neg()) + sine(phase)).abs() <= 4,
                "{phase:#x}"
            );
            assert_eq!(sine(phase), sine((1_u32 << 31).wrapping_sub(phase)), "{phase:#x}");
        }
    }
}
