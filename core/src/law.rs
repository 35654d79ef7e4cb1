//! The guidance law, equation (9): `T_h = K_1*(a1'*e_y' + a2'*de_y'/dt + a3'*e_theta' + a4'*de_theta'/dt)`.
//!
//! Lane errors arrive as samples with their own time stamps (120 Hz from a camera, every millisecond in a
//! study with exact sensors). Between samples the last one is held. A rate is the filtered difference of two
//! samples, backward Euler of `s/(1 + tau*s)`:
//!
//! `rate[k] = (tau*rate[k-1] + e[k] - e[k-1]) / (tau + dt)`,  `tau = 1/(2*pi*corner)`
//!
//! which has no division by `dt`, settles for any spacing of the samples, and delays a slowly changing rate
//! by `tau` (15.9 ms at the default corner of 10 Hz).
//!
//! Error: at most 0.1 mN.m from a float64 evaluation of the same discrete law over the whole input range
//! (`tests/law_oracle.rs` asserts it). Cost: see `cargo xtask bench`.
//!
//! Not here: any limit. The law may ask for too much; the envelope has the last word.

use crate::quantity::{FRAC_BITS, Gain, Instant, Metres, Micros, Radians, Torque, saturate, shift_round};

/// Lane errors at the guidance's own points (t'_n = 0.3 s, t'_f = 0.7 s), ISO 8855: positive asks for a
/// positive (left) torque.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct LaneSample {
    /// Lateral error e_y' at the near point.
    pub e_y: Metres,
    /// Yaw error e_theta' at the far point.
    pub e_theta: Radians,
    /// When it was true.
    pub at: Instant,
}

/// Coefficients of the law; immutable once validated by [`crate::params`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Law {
    /// K_1*a1', N.m/m.
    pub(crate) e_y: Gain,
    /// K_1*a2', N.m.s/m.
    pub(crate) e_y_rate: Gain,
    /// K_1*a3', N.m/rad.
    pub(crate) e_theta: Gain,
    /// K_1*a4', N.m.s/rad.
    pub(crate) e_theta_rate: Gain,
    /// tau of the rate filter in 2^-8 us: a whole microsecond would cost 0.2 mN.m at the default corner.
    pub(crate) tau: u32,
}

/// What the law remembers: the last sample and the filtered rates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LawState {
    last: Option<LaneSample>,
    /// de_y'/dt in 2^-24 m/s.
    e_y_rate: i64,
    /// de_theta'/dt in 2^-24 rad/s.
    e_theta_rate: i64,
}

impl LawState {
    /// No sample yet.
    pub const NEW: Self = Self {
        last: None,
        e_y_rate: 0,
        e_theta_rate: 0,
    };
}

/// Two samples further apart than this share no rate: the filter starts anew from zero.
/// 100 ms is twelve lost samples at 120 Hz, past every time-out on the inputs.
const GAP: Micros = Micros::from_ms(100);

/// Largest rate the filter may hold, 1000 m/s or rad/s in 2^-24. No road or vehicle comes near it; the
/// clamp keeps every product of the step inside an `i64` whatever the samples are.
const MAX_RATE: i64 = 1000 << FRAC_BITS;

impl Law {
    /// The torque that the law asks for at a sample: the latest one received, again and again until the next.
    #[must_use]
    pub fn step(&self, state: &mut LawState, sample: LaneSample) -> Torque {
        match state.last {
            Some(last) if last.at == sample.at => {}
            Some(last) if sample.at.since(last.at) <= GAP => {
                let dt = sample.at.since(last.at);
                state.e_y_rate = self.filter(state.e_y_rate, last.e_y.bits(), sample.e_y.bits(), dt);
                state.e_theta_rate =
                    self.filter(state.e_theta_rate, last.e_theta.bits(), sample.e_theta.bits(), dt);
            }
            _ => *state = LawState::NEW,
        }
        state.last = Some(sample);
        self.torque(sample, state)
    }

    /// One update of a rate. Magnitudes: `tau` < 2^27 and `rate` < 2^34 give 2^61, the difference of two
    /// `i32` times 10^6 times 2^8 gives 2^61 too: the sum cannot overflow.
    fn filter(&self, rate: i64, from: i32, to: i32, dt: Micros) -> i64 {
        let tau = i64::from(self.tau);
        let change = i64::from(to)
            .saturating_sub(i64::from(from))
            .saturating_mul(1_000_000 << 8);
        let sum = tau.saturating_mul(rate).saturating_add(change);
        let span = tau.saturating_add(i64::from(dt.us()) << 8);
        // Half the divisor is added for rounding, with the sign of the sum since `/` truncates. The divisor
        // is never zero (tau is at least 2.6 ms, params.rs); `checked_div` says so without a panic path.
        let half = if sum < 0 {
            span.wrapping_neg() >> 1
        } else {
            span >> 1
        };
        sum.saturating_add(half)
            .checked_div(span)
            .unwrap_or(0)
            .clamp(-MAX_RATE, MAX_RATE)
    }

    /// Exact wide products, one rounding. Gains and errors have 24 fractional bits, rates are cut to 16, so
    /// that every product has 40 or 48: a rate's 2^-17 s^-1 of rounding costs at most 0.25 mN.m at the largest
    /// gain of 32 and 2 uN.m at the paper's.
    fn torque(&self, sample: LaneSample, state: &LawState) -> Torque {
        let error = |gain: Gain, bits: i32| i64::from(gain.bits()).saturating_mul(i64::from(bits)) >> 8;
        let rate = |gain: Gain, rate: i64| i64::from(gain.bits()).saturating_mul(shift_round(rate, 8));
        let sum = error(self.e_y, sample.e_y.bits())
            .saturating_add(rate(self.e_y_rate, state.e_y_rate))
            .saturating_add(error(self.e_theta, sample.e_theta.bits()))
            .saturating_add(rate(self.e_theta_rate, state.e_theta_rate));
        Torque::from_bits(saturate(shift_round(sum, 16)))
    }
}
