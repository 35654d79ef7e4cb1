//! Driver activity: the share of equation (9) that is left to a driver who works against it.
//!
//! `share = 1 - (1 - lambda_min)*min(1, max(0, -A/(B + b)))` follows from the pseudo-powers `P_d = T_d*dphi/dt` of the driver and
//! `P_h = T_9*dphi/dt` of what equation (9) asks for (Saito et al.; Nguyen et al. 2021):
//!
//! - A is `P_d*P_h` behind a low-pass of 0.5 s, the *agreement*, kept within -B and B: below zero while the driver works against
//!   the guidance.
//! - B is `abs(P_d*P_h)` behind a low-pass of 1 s, the *size*. It forgets half as fast as A. So, where nothing is felt any more
//!   because the hands let go or the wheel stands still, A/B falls with a time constant of 1 s, however strong the driver
//!   was: what was taken away is back by half after 0.7 s and by 95 % after 3 s.
//! - b, 2^-20 (N.m.rad/s)^2, is what 0.1 N.m each make beside 10 mrad/s: less than that is no driver, but the offset of a sensor.
//!
//! `T_9` is what (9) asks for, before any share of it is taken: the torque applied would fall with the share, and with it the power
//! that the share is computed from. The share only takes away, so that every bound on (9) holds for it too.
//!
//! A sample of the column is felt in the step after it, with the `T_9` of the step in which it came.
//!
//! Its memory is not kept twice: whatever a flipped bit makes of it, the share is one from lambda_min to 1, and is right again
//! when the low-passes have forgotten.
//!
//! Products of pseudo-powers are in 2^-48 (N.m.rad/s)^2: what an LSB of the bus in each torque makes with 0.25 mrad/s is one.
//! Error: the quotient has 16 bits, which makes 3*2^-15 of it; an LSB of the rate's square is 2^-24 (rad/s)^2. Together at most
//! 0.001 of the share from a float64 evaluation of the same samples (`core/tests/laws.rs` asserts it).

use fixed::types::{I8F24, I12F20};

use super::{Coefficients, GAP};
use crate::quantity::{Instant, Radians, Ratio, Torque, product, saturate, share_of};

/// The largest square of a wheel's rate that counts: no hand turns a wheel faster than 8 rad/s.
const MOST_SQUARE: i64 = (64 << I8F24::FRAC_NBITS) - 1;
/// b, in 2^-48.
const NOBODY: u64 = 1 << (48 - 20);
/// What a microsecond weighs in a low-pass of 0.5 s and in one of 1 s, 2^-32.
const AGREEMENT_PER_US: u32 = 8590;
const SIZE_PER_US: u32 = 4295;

/// A sample of the column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sample {
    /// When it came.
    pub at: Instant,
    /// phi.
    pub wheel: Radians,
    /// The driver's torque, and what (9) asked for when the sample came.
    pub torques: [Torque; 2],
}

/// What it remembers since guidance began.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Activity {
    /// phi when it came last, and when that was.
    wheel: Radians,
    at: Instant,
    /// dphi/dt, filtered as the rates of the errors, rad/s.
    rate: I12F20,
    /// A and B.
    agreement: i64,
    size: i64,
    /// `min(1, max(0, -A/(B + b)))`.
    against: Ratio,
    /// What came in the step before and is felt in this one.
    pending: Option<Sample>,
}

impl Activity {
    /// Nothing felt yet.
    pub const NEW: Self = Self {
        wheel: Radians::ZERO,
        at: Instant::from_us(0),
        rate: I12F20::ZERO,
        agreement: 0,
        size: 0,
        against: Ratio::ZERO,
        pending: None,
    };

    /// Takes what a step brings. A sample is felt in the step after it, because the step with its frame has work enough; where
    /// every step brings one, every second sample is felt.
    pub fn step(&mut self, filter: &Coefficients, new: Option<Sample>) {
        match self.pending.take() {
            Some(sample) => self.feel(filter, &sample),
            None => self.pending = new,
        }
    }

    /// Feels a sample; `filter` has the low-pass of the rate.
    pub fn feel(&mut self, filter: &Coefficients, sample: &Sample) {
        let Sample {
            at,
            wheel,
            torques: [driver, asked],
        } = *sample;
        let passed = at.since(self.at).min(GAP);
        self.rate = if passed == GAP {
            I12F20::ZERO
        } else {
            filter.filter(self.rate, self.wheel.fixed(), wheel.fixed(), passed)
        };
        (self.wheel, self.at) = (wheel, at);
        let rate = i64::from(self.rate.to_bits());
        // 62 bits, cut to 24 fractional ones: a flipped bit must not make it wrap.
        let square =
            (rate.wrapping_mul(rate) >> (2 * I12F20::FRAC_NBITS - I8F24::FRAC_NBITS)).min(MOST_SQUARE);
        let torques = saturate(product(driver.fixed(), asked.fixed()));
        let torques = i64::from(torques.to_bits());
        // At most 31 bits times 30.
        let both = torques.wrapping_mul(square);
        let weight = |per_us: u32| passed.us().saturating_mul(per_us);
        self.size = low_pass(self.size, both.saturating_abs(), weight(SIZE_PER_US));
        // What has just begun fills the faster low-pass first: beyond the size it would only be forgotten later.
        self.agreement = low_pass(self.agreement, both, weight(AGREEMENT_PER_US))
            .max(self.size.saturating_neg())
            .min(self.size);
        self.against = against(self.agreement, self.size);
    }

    /// The share of (9) that is left, of which `least` is always: from there to 1, whatever is remembered.
    #[must_use]
    pub fn share(&self, least: Ratio) -> Ratio {
        let against = self.against.max(Ratio::ZERO).min(Ratio::ONE);
        let taken = share_of(Ratio::ONE.minus(least).fixed(), against.fixed());
        Ratio::ONE.minus(Ratio::from_fixed(taken))
    }
}

/// `min(1, max(0, -A/(B + b)))`, in 2^-15.
#[expect(clippy::as_conversions, reason = "the upper 16 bits")]
fn against(agreement: i64, size: i64) -> Ratio {
    let size = size.max(0).cast_unsigned().saturating_add(NOBODY);
    let against = agreement.min(0).unsigned_abs().min(size);
    // The upper 16 bits of both from the first that is set, so that a 32-bit processor divides by itself. The size has that bit.
    let up = size.leading_zeros();
    let upper = |bits: u64| u32::from((bits.wrapping_shl(up) >> 48) as u16);
    let share = (upper(against) << 15).checked_div(upper(size)).unwrap_or(0);
    Ratio::from_bits((share << (I8F24::FRAC_NBITS - 15)).cast_signed())
}

/// A first-order low-pass; both are 62 bits, the weight of what is new at most 0.2 in 2^-32.
#[expect(clippy::as_conversions, reason = "the lower half")]
fn low_pass(sum: i64, new: i64, weight: u32) -> i64 {
    let away = new.saturating_sub(sum);
    let upper = (away >> 32).wrapping_mul(i64::from(weight));
    let lower = u64::from(away as u32).wrapping_mul(u64::from(weight)) >> 32;
    sum.saturating_add(upper.wrapping_add(lower.cast_signed()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::controller::config::Config;

    /// A flipped bit may make anything of what is kept once.
    #[test]
    fn whatever_is_remembered_the_share_is_within_its_bounds() {
        let least = Ratio::from_si(0.05);
        for against in [i32::MIN, -1, 0, 1, 1 << 23, 1 << 24, (1 << 24) + 1, i32::MAX] {
            let activity = Activity {
                against: Ratio::from_bits(against),
                ..Activity::NEW
            };
            let share = activity.share(least);
            // 1 - 0.95*against between 0 and 1, by hand.
            let expected = 1.0 - 0.95 * (f64::from(against) / 16_777_216.0).clamp(0.0, 1.0);
            assert!((share.si() - expected).abs() < 1e-6, "{against}: {}", share.si());
        }
        for (agreement, size) in [
            (i64::MIN, i64::MIN),
            (i64::MIN, 0),
            (i64::MIN, i64::MAX),
            (-1, -1),
        ] {
            let against = against(agreement, size);
            assert!(
                against >= Ratio::ZERO && against <= Ratio::ONE,
                "{agreement} {size}"
            );
        }
    }

    /// A sample of a wheel that turns at 1 rad/s is felt in the step after it; where there is one in every step, every second
    /// is, over the time of both.
    #[test]
    fn a_sample_is_felt_in_the_step_after_it() {
        let Some(law) = Config::PAPER.law() else {
            panic!("the paper's law");
        };
        for sign in [1.0, -1.0] {
            let mut activity = Activity::NEW;
            let comes = [0, 1, 0, 0, 1, 1, 1, 1, 1, 0, 0];
            // The instant of the sample felt last, ms.
            let felt = [0, 0, 2, 2, 2, 5, 5, 7, 7, 9, 9];
            for (ms, (comes, felt)) in (1_u32..).zip(comes.into_iter().zip(felt)) {
                let sample = Sample {
                    at: Instant::from_us(1000 * ms),
                    wheel: Radians::from_rad(sign * 1e-3 * f64::from(ms)),
                    torques: [Torque::from_nm(2.0), Torque::from_nm(-2.0)],
                };
                activity.step(law.coefficients(), (comes != 0).then_some(sample));
                assert_eq!(activity.at, Instant::from_us(1000 * felt), "{ms}");
                let turned = sign * 1e-3 * f64::from(felt);
                assert!((activity.wheel.rad() - turned).abs() < 1e-6, "{ms}");
            }
        }
    }

    /// The wheel goes on at 1 rad/s, but how fast it turned over a gap of 0.1 s or more nobody knows: then nothing is added to
    /// what was felt, and it is forgotten as where the wheel stands.
    #[test]
    fn a_gap_between_two_samples_adds_nothing() {
        let Some(law) = Config::PAPER.law() else {
            panic!("the paper's law");
        };
        for sign in [1.0, -1.0] {
            for (gap_ms, adds) in [(10, true), (99, true), (100, false), (500, false)] {
                let mut activity = Activity::NEW;
                let mut feel = |ms: u32| {
                    let sample = Sample {
                        at: Instant::from_us(1_000_000 + 1000 * ms),
                        wheel: Radians::from_rad(sign * 1e-3 * f64::from(ms)),
                        torques: [Torque::from_nm(2.0), Torque::from_nm(-2.0)],
                    };
                    activity.feel(law.coefficients(), &sample);
                    activity.size
                };
                let before = (0..=100).map(|step| feel(10 * step)).last();
                assert_eq!(Some(feel(1000 + gap_ms)) > before, adds, "{sign} {gap_ms} ms");
            }
        }
    }
}
