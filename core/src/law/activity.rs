//! Driver activity: the share of equation (9) that is left to a driver who works against it.
//!
//! `share = 1 - (1 - lambda_min)*max(0, -c)`, `c = L[P_d*P_h]/L[abs(P_d*P_h)]`, with the pseudo-powers `P_d = T_d*dphi/dt` and
//! `P_h = T_h*dphi/dt` of driver and guidance (Saito et al.; Nguyen et al. 2021) and L a low-pass of 0.5 s. It follows from the
//! torques of the last second and takes only away, so that every bound on (9) holds for it too.
//!
//! State that is not kept twice: whatever a flipped bit makes of it, the share is one from lambda_min to 1, and is right again
//! when the low-pass has forgotten.
//!
//! It looks at the column in the steps that check a lane sample, unless a vehicle frame came too; those have the most to do.
//!
//! Products of pseudo-powers are in 2^-48 (N.m.rad/s)^2: what an LSB of the bus in each torque makes with 0.25 mrad/s is one.
//! Error: c is a quotient of 16 bits, which makes 3*2^-15 of it; an LSB of the rate's square, 2^-24 (rad/s)^2, makes twice its share of
//! the mean square of the last second. Together at most 0.001 of the share from a float64 evaluation of the same samples, 0.03 where
//! the wheel never moves by more than 3 mrad/s (`core/tests/laws.rs` asserts it). lambda_min is kept in thousandths.

use fixed::types::{I8F24, I12F20};

use super::{GAP, Law};
use crate::quantity::{Instant, Micros, Radians, Ratio, Torque, product, saturate, share_of};
use crate::safety::redundant::words;

/// The square of a wheel's rate that counts: a hand turns no wheel faster than 8 rad/s.
const MOST_SQUARE: i64 = (64 << I8F24::FRAC_NBITS) - 1;

/// What driver activity leaves of (9) at least, in thousandths.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LeastShare(u32);

impl LeastShare {
    /// A share from 0 to 1, within 0.0005 of it.
    #[must_use]
    #[expect(
        clippy::as_conversions,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::float_arithmetic,
        reason = "a parameter is an SI value in f64"
    )]
    pub const fn from_si(share: f64) -> Self {
        Self((share * 1000.0 + 0.5) as u32)
    }

    /// At most 1, from any bits: ten of them, shifted by 21, have 31.
    fn ratio(self) -> Ratio {
        let share = (self.0.wrapping_shl(21) / 125).cast_signed();
        Ratio::from_fixed(I8F24::from_bits(share)).min(Ratio::ONE)
    }
}

words! {
    /// A time and a [`LeastShare`] in one word, as each word more costs every step: the time in its lower 22 bits, up to 4.1 s; above
    /// it a share plus one, or zero where there is none, as the law is (9).
    pub struct TimeAndShare {
        bits: u32,
    }
}

const TIME_BITS: u32 = 22;

impl TimeAndShare {
    pub(crate) const fn new(time: Micros, share: Option<LeastShare>) -> Self {
        let share = match share {
            Some(LeastShare(share)) => share.saturating_add(1),
            None => 0,
        };
        Self {
            bits: share << TIME_BITS | time.us() & ((1 << TIME_BITS) - 1),
        }
    }

    pub(crate) const fn time(self) -> Micros {
        Micros::from_us(self.bits & ((1 << TIME_BITS) - 1))
    }

    pub(crate) fn least_share(self) -> Option<LeastShare> {
        (self.bits >> TIME_BITS).checked_sub(1).map(LeastShare)
    }
}

/// What it remembers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
// Aligned as everything else of the ECU: with 8 bytes its fields would lie elsewhere, and each step would cost more.
#[repr(C, packed(4))]
pub struct Activity {
    /// phi when it came last, and when that was.
    wheel: Radians,
    at: Instant,
    /// dphi/dt, filtered as the rates of the errors, rad/s.
    rate: I12F20,
    /// L[P_d*P_h] and L[abs(P_d*P_h)].
    agreement: i64,
    size: i64,
    share: Ratio,
}

impl Activity {
    /// Nothing felt yet.
    pub const NEW: Self = Self {
        wheel: Radians::ZERO,
        at: Instant::from_us(0),
        rate: I12F20::ZERO,
        agreement: 0,
        size: 0,
        share: Ratio::ONE,
    };

    /// Takes a sample of the column, which came at an instant, beside the guidance torque that was applied; `law` has the filter of
    /// the rate, `least` is lambda_min. Not inlined, so that it costs (9) nothing.
    #[inline(never)]
    pub fn update(
        &mut self,
        law: &Law,
        least: LeastShare,
        at: Instant,
        wheel: Radians,
        [driver, guidance]: [Torque; 2],
    ) {
        let passed = at.since(self.at).min(GAP);
        self.rate = if passed == GAP {
            I12F20::ZERO
        } else {
            law.filter(self.rate, self.wheel.fixed(), wheel.fixed(), passed)
        };
        (self.wheel, self.at) = (wheel, at);
        let rate = i64::from(self.rate.to_bits());
        // 62 bits, cut to 24 fractional ones: a flipped bit must not make it wrap.
        let square =
            (rate.wrapping_mul(rate) >> (2 * I12F20::FRAC_NBITS - I8F24::FRAC_NBITS)).min(MOST_SQUARE);
        let torques = saturate(product(driver.fixed(), guidance.fixed()));
        let torques = i64::from(torques.to_bits());
        // At most 31 bits times 30.
        let both = torques.wrapping_mul(square);
        let weight = passed.us().saturating_mul(PER_US);
        self.agreement = low_pass(self.agreement, both, weight);
        self.size = low_pass(self.size, both.saturating_abs(), weight);
        let taken = share_of(Ratio::ONE.minus(least.ratio()).fixed(), self.against());
        self.share = Ratio::ONE.minus(Ratio::from_fixed(taken));
    }

    pub(crate) const fn looked_at(&self) -> Instant {
        self.at
    }

    /// The share of (9) that is left, of which `least` is always.
    #[must_use]
    pub fn share(&self, least: LeastShare) -> Ratio {
        self.share.max(least.ratio()).min(Ratio::ONE)
    }

    /// `max(0, -c)`, in 2^-15.
    #[expect(clippy::as_conversions, reason = "the upper 16 bits")]
    fn against(&self) -> I8F24 {
        let size = self.size.max(0).cast_unsigned();
        let against = self.agreement.min(0).unsigned_abs().min(size);
        // The upper 16 bits of both from the first that is set, so that the processor divides by itself; by zero is zero.
        let up = size.leading_zeros();
        let upper = |bits: u64| u32::from((bits.wrapping_shl(up) >> 48) as u16);
        let share = (upper(against) << 15).checked_div(upper(size)).unwrap_or(0);
        I8F24::from_bits((share << (I8F24::FRAC_NBITS - 15)).cast_signed())
    }
}

/// What a microsecond weighs in a low-pass of 0.5 s, 2^-32.
const PER_US: u32 = 8590;

/// A first-order low-pass; both are 62 bits, the weight of what is new at most 0.2 in 2^-32.
#[expect(clippy::as_conversions, reason = "the lower half")]
fn low_pass(sum: i64, new: i64, weight: u32) -> i64 {
    let away = new.saturating_sub(sum);
    let upper = (away >> 32).wrapping_mul(i64::from(weight));
    let lower = u64::from(away as u32).wrapping_mul(u64::from(weight)) >> 32;
    sum.saturating_add(upper.wrapping_add(lower.cast_signed()))
}
