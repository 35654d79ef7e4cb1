//! The torque of the hands, from the torque of a torsion bar and an angle.
//!
//! A torsion bar measures what passes through it. Between it and the hands lies the wheel:
//!
//! ```text
//! T_hand = T_tb + J_w phi_w'' + B_w phi_w' + friction,   phi_w = phi_c + T_tb/K_tb
//! ```
//!
//! [`Observer`] is that equation as an extended-state observer: angle, rate, and as a third state, that no equation drives, the torque on
//! the wheel beside the bar's, which is the hands' without damping and friction. Each step of 1 ms predicts them from T_tb; each sample of
//! the angle corrects them. The gains are those of a filter with fading memory, all three poles at `exp(-w T)` for a bandwidth w and
//! samples every T, so that the estimate is the torque behind three equal lags: [`Setup::lag_us`] for a torque that changes slowly. Torque
//! of the bar and inertia of the wheel come through the same lags, which is why a free wheel, however the motor turns it, reads as no
//! hand. Damping and friction are added behind, by the estimated rate: in the prediction they would make the lags longer.
//!
//! Terms: *wheel* and *column* are the ends of the bar, with the angles phi_w and phi_c.
//!
//! # Formats, errors and costs
//!
//! Angle I32F32 rad, rate I0F32 rad/ms, torque I8F24 N.m. Beside the same equations in f64 the estimate is off by at most 6 mN.m
//! (`core/tests/observer/oracle.rs`), for bandwidths of 10 to 300 rad/s. A step has 9 products of 32 bits, no division and no loop.
//!
//! Not here: who asks for the estimate. The ECU does not use it yet; `host-sim driver-torque` prints how good it is with each sensor.

mod setup;

use crate::quantity::{Radians, Torque, TurningRate};
use fixed::types::{I0F32, I2F30, I4F28, I8F24, I16F16, I32F32, I40F24};

pub use setup::{AngleAt, Parameters, Setup, SetupError};

/// One LSB of a quantity of core: with it a value crosses into its bits and back, exactly.
const TORQUE_LSB: Torque = Torque::from_nm(1.0 / 16_777_216.0);
const ANGLE_LSB: Radians = Radians::from_rad(1.0 / 16_777_216.0);
const RATE_LSB: TurningRate = TurningRate::from_rad_per_s(1.0 / 16_777_216.0);

/// What held an estimate back.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Limit {
    /// Nothing.
    #[default]
    None,
    /// The angle is more than 1 rad from what was predicted: a jump of a sensor, not a wheel. The observer begins anew from it.
    AngleJump,
    /// The rate is held within +-100 rad/s, which no wheel reaches.
    Rate,
    /// The torque is held within +-[`Setup::most`], what hands can do.
    Torque,
}

/// What is known in a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// T_tb, the torque of the bar: that of now, in every step.
    pub bar_torque: Torque,
    /// The angle of the wheel or of the column, as [`Parameters::angle_at`] says, in the steps in which it is sampled.
    pub angle: Option<Radians>,
}

/// What the observer says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Estimate {
    /// The torque of the hands.
    pub hands: Torque,
    /// phi_w'.
    pub rate: TurningRate,
    /// What held it back.
    pub limit: Limit,
}

/// The observer's memory.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct State {
    /// phi_w, rad; none before the first sample.
    angle: Option<I32F32>,
    /// phi_w', rad/ms.
    rate: I0F32,
    /// Torque on the wheel beside the bar's: T_hand less damping and friction, N.m.
    beside: I8F24,
    /// T_tb of the last step, N.m.
    bar: I8F24,
    /// How far the wheel's friction has given, as a share of all that it can: -1 to 1.
    given: I8F24,
}

/// The observer; its memory is apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Observer {
    setup: Setup,
}

impl Observer {
    /// An observer.
    #[must_use]
    pub const fn new(setup: Setup) -> Self {
        Self { setup }
    }

    /// How it was set up.
    #[must_use]
    pub const fn setup(&self) -> &Setup {
        &self.setup
    }

    /// One step of 1 ms.
    #[must_use]
    pub fn step(&self, state: &mut State, reading: &Reading) -> Estimate {
        let bar = I8F24::from_bits(reading.bar_torque.count_of(TORQUE_LSB));
        let sampled = reading.angle.map(|angle| self.wheel_angle(angle, bar));
        let limit = match state.angle {
            None => self.begin(state, sampled, bar),
            Some(angle) => {
                let predicted = self.predict(state, angle, bar);
                state.angle = Some(predicted);
                match sampled {
                    Some(sampled) => self.correct(state, sampled, predicted, bar),
                    None => Limit::None,
                }
            }
        };
        state.bar = bar;
        let (hands, limit) = self.held(state, limit);
        Estimate {
            hands: TORQUE_LSB.times(hands.to_bits()),
            rate: rate_of(state.rate),
            limit,
        }
    }

    /// phi_w of a sample.
    fn wheel_angle(&self, angle: Radians, bar: I8F24) -> I32F32 {
        let angle = I32F32::from(I8F24::from_bits(angle.count_of(ANGLE_LSB)));
        match self.setup.angle_at {
            AngleAt::Wheel => angle,
            // At most 26 rad: a bar has at least 5 N.m/rad.
            AngleAt::Column => {
                let twist = bar.wide_mul(self.setup.twist);
                angle.saturating_add(I32F32::saturating_from_num(twist))
            }
        }
    }

    /// Before the first sample nothing is known but the bar; from it on the wheel rests.
    fn begin(&self, state: &mut State, sampled: Option<I32F32>, bar: I8F24) -> Limit {
        state.angle = sampled;
        (state.rate, state.given) = (I0F32::ZERO, I8F24::ZERO);
        state.beside = bar;
        Limit::None
    }

    /// Damping and friction of the wheel, N.m; friction after Dahl, by how far the wheel has given.
    fn resists(&self, state: &mut State) -> I8F24 {
        let damping = I8F24::saturating_from_num(state.rate.wide_mul(self.setup.damping));
        // A wheel that turns by all that it can give has slid: more is no more.
        let turned = I8F24::saturating_from_num(state.rate.wide_mul(self.setup.gives));
        let turned = turned.min(I8F24::ONE).max(I8F24::NEG_ONE);
        let back = I8F24::saturating_from_num(turned.saturating_abs().wide_mul(state.given));
        state.given = state.given.saturating_add(turned).saturating_sub(back);
        let friction = I8F24::saturating_from_num(state.given.wide_mul(self.setup.friction));
        damping.saturating_add(friction)
    }

    /// A millisecond on: the new angle; the rate moves with what is left of the torques.
    fn predict(&self, state: &mut State, angle: I32F32, bar: I8F24) -> I32F32 {
        // The mean of the bar's torque over the step.
        let sum = I40F24::from(bar).saturating_add(I40F24::from(state.bar));
        let mean = I8F24::saturating_from_num(I40F24::from_bits(sum.to_bits() >> 1));
        let left = state.beside.saturating_sub(mean);
        let change = rounded(left.wide_mul(self.setup.by_torque).to_bits(), 24);
        let before = state.rate;
        state.rate = before.saturating_add(I0F32::from_bits(change));
        // The angle goes on at the mean of both rates.
        let mean = I32F32::from(before).saturating_add(I32F32::from(state.rate));
        angle.saturating_add(I32F32::from_bits(mean.to_bits() >> 1))
    }

    fn correct(&self, state: &mut State, sampled: I32F32, predicted: I32F32, bar: I8F24) -> Limit {
        let off = sampled.saturating_sub(predicted);
        if off.unsigned_abs() > I32F32::ONE.unsigned_abs() {
            let _ = self.begin(state, Some(sampled), bar);
            return Limit::AngleJump;
        }
        // Within +-1, as was asked above.
        let off = I4F28::saturating_from_num(off);
        let angle = I32F32::saturating_from_num(off.wide_mul(self.setup.to_angle));
        state.angle = Some(predicted.saturating_add(angle));
        let rate = rounded(off.wide_mul(self.setup.to_rate).to_bits(), 20);
        state.rate = state.rate.saturating_add(I0F32::from_bits(rate));
        let beside = rounded(off.wide_mul(self.setup.to_torque).to_bits(), 20);
        state.beside = state.beside.saturating_add(I8F24::from_bits(beside));
        Limit::None
    }

    /// The torque of the hands; keeps it and the states where they can be, and says why.
    fn held(&self, state: &mut State, before: Limit) -> (I8F24, Limit) {
        let most = self.setup.most;
        let within = |torque: I8F24| torque.min(most).max(most.saturating_neg());
        let rate = state.rate.min(MOST_RATE).max(MOST_RATE.saturating_neg());
        let asked = state.beside.saturating_add(self.resists(state));
        let hands = within(asked);
        let limit = match before {
            Limit::None if hands != asked || within(state.beside) != state.beside => Limit::Torque,
            Limit::None if rate != state.rate => Limit::Rate,
            other => other,
        };
        (state.beside, state.rate) = (within(state.beside), rate);
        (hands, limit)
    }
}

/// 100 rad/s, per millisecond.
const MOST_RATE: I0F32 = I0F32::from_bits(429_496_730);

/// The nearest of so many bits fewer, saturated: a product of two formats in the format of a state.
fn rounded(wide: i64, cut: u32) -> i32 {
    let half = 1_i64.wrapping_shl(cut.saturating_sub(1));
    let near = wide.saturating_add(half).wrapping_shr(cut);
    let edge = if near < 0 { i32::MIN } else { i32::MAX };
    i32::try_from(near).unwrap_or(edge)
}

/// A rate per millisecond as one per second: within +-100.
fn rate_of(per_ms: I0F32) -> TurningRate {
    let per_s = per_ms.wide_mul(I16F16::from_bits(1000 << 16));
    RATE_LSB.times(I8F24::saturating_from_num(per_s).to_bits())
}

/// A gain on an angle's error.
type ToAngle = I2F30;
