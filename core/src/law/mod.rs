//! The guidance law, equation (9): `T_h = K_1*(a1'*e_y' + a2'*de_y'/dt + a3'*e_theta' + a4'*de_theta'/dt)`.
//!
//! Lane errors arrive as samples with their own time stamps (120 Hz from a camera, every millisecond in a
//! study with exact sensors). A rate is the filtered difference of two samples, backward Euler of
//! `s/(1 + tau*s)`:
//!
//! `rate[k] = (tau*rate[k-1] + e[k] - e[k-1]) / (tau + dt)`,  `tau = 1/(2*pi*corner)`
//!
//! which has no division by `dt`, settles for any spacing of the samples, and delays a slowly changing rate
//! by `tau` (15.9 ms at the default corner of 10 Hz). Between samples the errors go on at their rates, so
//! that the torque does not climb in a camera's steps: `e(t) = e[k] + rate[k]*(t - t[k])`.
//!
//! Error: at most 0.2 mN.m from a float64 evaluation of the same discrete law over the whole input range
//! (`core/tests/law_oracle.rs` asserts it). Cost: see `cargo xtask bench`.
//!
//! The parameters may choose a [`Law`] that leaves only a share of it, by the driver's [`activity`].
//!
//! Not here: any limit. The law may ask for too much; the envelope has the last word.

pub mod activity;
pub mod probe;
pub mod schedule;
pub(crate) mod sine;

use fixed::types::extra::U20;
use fixed::types::{I8F24, I12F20, I40F24};

use crate::lane::LaneSample;
use crate::quantity::{
    Instant, Metres, Micros, Radians, Ratio, Speed, Torque, TorquePerAngle, TorquePerLength, TorquePerSpeed,
    TorquePerTurningRate, TurningRate, per_second, per_second_times, product, quotient, rounded, saturate,
};
use crate::safety::redundant::words;

/// The guidance law that the parameters choose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Law<'a> {
    /// Equation (9), the paper's law.
    Paper(&'a Coefficients),
    /// A share of equation (9): less to a driver who works against it ([`activity`]).
    DriverActivity {
        /// Equation (9).
        coefficients: &'a Coefficients,
        /// lambda_min, the share that is left in any case.
        least_share: Ratio,
    },
}

impl<'a> Law<'a> {
    /// Equation (9), of which each law gives all or a share.
    #[must_use]
    pub const fn coefficients(&self) -> &'a Coefficients {
        match self {
            Self::Paper(coefficients) | Self::DriverActivity { coefficients, .. } => coefficients,
        }
    }
}

words! {
    /// A [`Law`] as memory keeps it twice: an enum has bit patterns that no variant has, words have none.
    pub struct LawWords {
        /// [`PAPER`] or [`DRIVER_ACTIVITY`].
        variant: u32,
        coefficients: Coefficients,
        /// Zero for a law without it.
        least_share: Ratio,
    }
}

const PAPER: u32 = 0;
const DRIVER_ACTIVITY: u32 = 1;

impl LawWords {
    /// The words of a law.
    #[must_use]
    pub const fn new(law: Law<'_>) -> Self {
        let (variant, least_share) = match law {
            Law::Paper(_) => (PAPER, Ratio::ZERO),
            Law::DriverActivity { least_share, .. } => (DRIVER_ACTIVITY, least_share),
        };
        Self {
            variant,
            coefficients: *law.coefficients(),
            least_share,
        }
    }

    /// The law; `None` where the memory is damaged, as no law has this variant.
    #[must_use]
    pub const fn law(&self) -> Option<Law<'_>> {
        let coefficients = &self.coefficients;
        match self.variant {
            PAPER => Some(Law::Paper(coefficients)),
            DRIVER_ACTIVITY => Some(Law::DriverActivity {
                coefficients,
                least_share: self.least_share,
            }),
            _ => None,
        }
    }
}

words! {
    /// Equation (9) by its coefficients; immutable once validated by [`crate::controller::params`].
    pub struct Coefficients {
        /// K_1*a1'.
        pub(crate) e_y: TorquePerLength,
        /// K_1*a2'.
        pub(crate) e_y_rate: TorquePerSpeed,
        /// K_1*a3'.
        pub(crate) e_theta: TorquePerAngle,
        /// K_1*a4'.
        pub(crate) e_theta_rate: TorquePerTurningRate,
        /// tau of the rate filter in 2^-8 us: a whole microsecond would cost 0.2 mN.m at the default corner.
        pub(crate) tau: u32,
    }
}

words! {
    /// Memory of the law: the last sample and the filtered rates.
    pub struct LawState {
        /// 0 before the first sample.
        has_last: u32,
        last: LaneSample,
        /// de_y'/dt, m/s.
        e_y_rate: I12F20,
        /// de_theta'/dt, rad/s.
        e_theta_rate: I12F20,
    }
}

impl LawState {
    /// Before the first sample.
    pub const NEW: Self = Self {
        has_last: 0,
        last: LaneSample {
            e_y: Metres::ZERO,
            e_theta: Radians::ZERO,
            at: Instant::from_us(0),
        },
        e_y_rate: I12F20::ZERO,
        e_theta_rate: I12F20::ZERO,
    };
}

/// The vehicle's motion since a sample that was old when it arrived, as the difference from turning on at the rate that it had at
/// the instant of the sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EgoMotion {
    /// The angle turned beyond that.
    pub turned: Radians,
    /// The present rate of turn less the one then.
    pub faster: TurningRate,
    /// Speed.
    pub speed: Speed,
    /// Distance to the near point.
    pub near: Metres,
}

impl EgoMotion {
    /// No difference.
    pub const STEADY: Self = Self {
        turned: Radians::ZERO,
        faster: TurningRate::ZERO,
        speed: Speed::ZERO,
        near: Metres::ZERO,
    };

    /// Both are clamped to what a vehicle can turn in 200 ms beyond its rate: a flipped bit of the motion history, which is not kept
    /// twice, must not move the torque further.
    #[must_use]
    pub fn new(turned: Radians, faster: TurningRate, speed: Speed, near: Metres) -> Self {
        let (most, fastest) = (Radians::from_rad(0.04), TurningRate::from_rad_per_s(0.3));
        Self {
            turned: turned.within(most),
            faster: faster.within(fastest),
            speed,
            near,
        }
    }
}

impl LawState {
    /// The state from which [`Coefficients::torque`], which continues the errors at their rates, computes the present errors and rates.
    /// Both errors turn with the vehicle; the near point moves aside by the way that it is ahead, and drifts at the speed
    /// times the heading, of which a third of the age counts where the heading grew with the square of the time.
    fn moved_with(&self, age: Micros, ego: &EgoMotion) -> Self {
        let [turned, faster] = [ego.turned.fixed(), ego.faster.fixed()];
        let [speed, near] = [ego.speed.fixed(), ego.near.fixed()];
        let wide = |value: I8F24| I40F24::from(value);
        let aside = product(near, turned);
        // The lateral error drifts with the heading, of which the yaw error's own rate explains a part.
        let going = per_second_times(self.e_theta_rate.into(), age);
        let drift = product(speed, saturate(wide(turned).saturating_sub(going)));
        let drifted = per_second_times(product(speed, turned), age).wrapping_div_int(3);
        let bent = per_second_times(product(speed, saturate(going)), age).wrapping_div_int(2);
        let slower_y = drift.saturating_add(product(near, faster));
        let slower_theta = wide(faster);
        let error = |error: I8F24, away: I40F24, slower: I40F24| {
            // `torque` continues the error at the lower rate for the whole age; this cancels it.
            let ahead = per_second_times(slower, age);
            wide(error).saturating_sub(away).saturating_add(ahead)
        };
        let away_y = aside.saturating_add(drifted).saturating_sub(bent);
        let to_rate = |wide: I40F24| saturate(rounded::<_, U20>(wide));
        let mut late = *self;
        late.last.e_y = Metres::from_wide(error(self.last.e_y.fixed(), away_y, slower_y));
        late.last.e_theta = Radians::from_wide(error(self.last.e_theta.fixed(), wide(turned), slower_theta));
        late.e_y_rate = self.e_y_rate.saturating_sub(to_rate(slower_y));
        late.e_theta_rate = self.e_theta_rate.saturating_sub(to_rate(slower_theta));
        late
    }

    /// The errors continued at their rates: at most 128 and half of what a rate may be.
    fn continued(&self, age: Micros) -> [I12F20; 2] {
        let now = |error: I8F24, rate: I12F20| {
            let rounded = I12F20::wrapping_from_num(error.saturating_add(HALF));
            rounded.saturating_add(per_second(rate, age))
        };
        [
            now(self.last.e_y.fixed(), self.e_y_rate),
            now(self.last.e_theta.fixed(), self.e_theta_rate),
        ]
    }

    /// Whether the sample is the one taken last.
    pub(crate) fn is_latest(&self, sample: &LaneSample) -> bool {
        self.has_last != 0 && self.last == *sample
    }

    /// The sample taken last, if there is one.
    pub(crate) fn last(&self) -> Option<LaneSample> {
        (self.has_last != 0).then_some(self.last)
    }

    /// Takes the errors of a sample and keeps the rates.
    pub fn relocate(&mut self, sample: LaneSample) {
        self.last = sample;
    }
}

/// Two samples further apart than this share no rate: the filter starts anew from zero.
/// 100 ms is twelve lost samples at 120 Hz, past every time-out on the inputs.
const GAP: Micros = Micros::from_ms(100);

/// Largest rate the filter may hold, m/s or rad/s. No road or vehicle comes near it; the clamp keeps
/// every product of the step inside 64 bits whatever the samples are.
pub const MAX_RATE: u32 = 1000;

impl Coefficients {
    /// The torque that the law demands now, from the latest sample received and the vehicle's motion since.
    #[must_use]
    pub fn step(&self, state: &mut LawState, now: Instant, sample: LaneSample, ego: &EgoMotion) -> Torque {
        if !state.is_latest(&sample) {
            self.update(state, sample);
        }
        self.demanded(state, now, Some(ego))
    }

    /// Takes a sample: updates the filtered rates of the errors.
    pub(crate) fn update(&self, state: &mut LawState, sample: LaneSample) {
        let dt = sample.at.since(state.last.at);
        if state.has_last == 0 || dt > GAP {
            *state = LawState::NEW;
        } else if dt > Micros::from_us(0) {
            let (last, new) = (state.last.e_y.fixed(), sample.e_y.fixed());
            state.e_y_rate = self.filter(state.e_y_rate, last, new, dt);
            let (last, new) = (state.last.e_theta.fixed(), sample.e_theta.fixed());
            state.e_theta_rate = self.filter(state.e_theta_rate, last, new, dt);
        }
        (state.has_last, state.last) = (1, sample);
    }

    /// The torque now, from the sample taken last; with the vehicle's motion since where the sample was old when it arrived.
    pub(crate) fn demanded(&self, state: &LawState, now: Instant, ego: Option<&EgoMotion>) -> Torque {
        let age = now.since(state.last.at);
        match ego {
            None => self.torque(state, age),
            Some(ego) => self.torque(&state.moved_with(age, ego), age),
        }
    }

    /// One update of a rate. Magnitudes: `tau` < 2^27 and `rate` < 2^30 give 2^57, the difference of two
    /// `i32` times 10^6 times 2^4 gives 2^57 too: the sum cannot overflow.
    #[inline(always)]
    fn filter(&self, rate: I12F20, from: I8F24, to: I8F24, dt: Micros) -> I12F20 {
        const MOST: u32 = MAX_RATE << I12F20::FRAC_NBITS;
        let tau = i64::from(self.tau);
        // 2^8 for the format of tau, 2^-4 from the errors' 24 fractional bits to the rates' 20.
        let change = i64::from(to.to_bits())
            .wrapping_sub(i64::from(from.to_bits()))
            .wrapping_mul(1_000_000 << 4);
        let sum = tau.wrapping_mul(i64::from(rate.to_bits())).wrapping_add(change);
        // At most 100 ms and 320 ms, in 2^-8 us.
        let span = self.tau.wrapping_add(dt.us().wrapping_mul(1 << 8));
        // Rounded to nearest.
        let size = sum.unsigned_abs().wrapping_add(u64::from(span >> 1));
        let size = I12F20::from_bits(quotient(size, span).min(MOST).cast_signed());
        if sum < 0 { size.wrapping_neg() } else { size }
    }

    /// Exact wide products, one rounding. Gains have 24 fractional bits, errors are cut to 20 like the
    /// rates, so that every product has 44: an error's 2^-21 of rounding costs at most 0.02 mN.m at the
    /// largest gain of 32. With that gain a product has at most 2^60, and the sum of four 2^62.
    fn torque(&self, state: &LawState, age: Micros) -> Torque {
        let [e_y, e_theta] = state.continued(age);
        let sum = (self.e_y.fixed().wide_mul(e_y))
            .wrapping_add(self.e_y_rate.fixed().wide_mul(state.e_y_rate))
            .wrapping_add(self.e_theta.fixed().wide_mul(e_theta))
            .wrapping_add(self.e_theta_rate.fixed().wide_mul(state.e_theta_rate));
        Torque::from_wide(rounded(sum))
    }
}

/// Half a unit of a rate's format.
const HALF: I8F24 = I8F24::from_bits(1 << 3);
