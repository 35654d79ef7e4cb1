//! The torque of the hands, from the torque of a torsion bar and an angle.
//!
//! A torsion bar measures what passes through it. Between it and the hands lies the wheel:
//!
//! ```text
//! T_hand = T_tb + J_w phi_w'' + B_w phi_w' + friction,   phi_w = phi_c + T_tb/K_tb
//! ```
//!
//! [`Observer`] is that equation as an extended-state observer: angle, rate, and as a third state, that no equation drives, the torque of
//! the hands. Each step of 1 ms predicts them from T_tb, damping and friction; each sample of the angle corrects them. The gains are those
//! of a filter with fading memory, all three poles at `exp(-w T)` for a bandwidth w and samples every T, so that the estimate is the torque
//! behind three equal lags: [`crate::controller::config::hands_lag_s`] for a torque that changes slowly, and longer by a share of
//! B_w/(J_w w). Every other torque of the equation comes through the same lags, which is why a free wheel, however the motor turns it,
//! reads as no hand, and why the lags can be undone at a known frequency. A step that comes late predicts a millisecond all the same,
//! which the next sample corrects.
//!
//! Terms: *wheel* and *column* are the ends of the bar, with the angles phi_w and phi_c.
//!
//! # Formats, errors and costs
//!
//! Angle I8F24 rad, rate I0F32 rad/ms, torque I8F24 N.m. The memory of angle and torque has 32 bits more: what is cut off each
//! millisecond would look like a slow turn, by which the friction gives. Beside the same equations in f64 the estimate is off by at
//! most 6 mN.m (`core/tests/observer/oracle.rs`), for bandwidths of 10 to 300 rad/s, and after 300 s of rest too. A step has 9 products
//! of 32 bits, no division and no loop. Products that reach no end of their format for any parameters in range are cut there; the
//! others saturate.
//!
//! Not here: gains from SI values ([`crate::controller::config`]). `host-sim driver-torque` prints how good the estimate is with each
//! sensor.

use fixed::types::{I0F32, I2F30, I8F24, I8F56, I16F16};

use crate::quantity::{Radians, Torque};
use crate::safety::redundant::words;

/// What the sensor of the column measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sensor<'a> {
    /// The hands' torque, on a column of one piece.
    Hands,
    /// The torque of a bar, of which the observer makes the hands'.
    Bar(&'a Observer),
}

words! {
    /// A [`Sensor`] as memory keeps it twice, without the bit patterns that an enum lacks.
    pub struct SensorWords {
        /// [`HANDS`] or [`BAR`].
        variant: u32,
        /// It means nothing with a sensor of the hands.
        observer: Observer,
    }
}

const HANDS: u32 = 0;
const BAR: u32 = 1;

impl SensorWords {
    /// A sensor of the hands' torque.
    pub(crate) const HANDS: Self = Self {
        variant: HANDS,
        observer: Observer {
            to_wheel: I0F32::ZERO,
            to_column: I0F32::ZERO,
            by_torque: I0F32::ZERO,
            damping: I16F16::ZERO,
            gives: I16F16::ZERO,
            friction: I8F24::ZERO,
            to_angle: I2F30::ZERO,
            to_rate: I8F24::ZERO,
            to_torque: I16F16::ZERO,
        },
    };

    /// A bar.
    pub(crate) const fn bar(observer: Observer) -> Self {
        Self {
            variant: BAR,
            observer,
        }
    }

    /// The sensor; `None` where the memory is damaged, as no sensor has this variant.
    #[must_use]
    pub const fn sensor(&self) -> Option<Sensor<'_>> {
        match self.variant {
            HANDS => Some(Sensor::Hands),
            BAR => Some(Sensor::Bar(&self.observer)),
            _ => None,
        }
    }
}

words! {
    /// The wheel and its bar as gains; immutable.
    pub struct Observer {
        /// What T_tb adds to the angle measured, to make the wheel's of it: 1/K_tb, rad per N.m, for the column's, zero for the wheel's.
        pub(crate) to_wheel: I0F32,
        /// What T_tb takes from the angle measured, to make the column's of it, likewise.
        pub(crate) to_column: I0F32,
        /// Rate per torque and step, rad/ms per N.m.
        pub(crate) by_torque: I0F32,
        /// Damping, N.m per rad/ms.
        pub(crate) damping: I16F16,
        /// One over what the friction gives, 1/rad.
        pub(crate) gives: I16F16,
        /// Friction of a wheel that slides, N.m.
        pub(crate) friction: I8F24,
        /// What an error of the angle does to the angle.
        pub(crate) to_angle: I2F30,
        /// What it does to the rate, 1/ms.
        pub(crate) to_rate: I8F24,
        /// What it does to the torque, N.m/rad.
        pub(crate) to_torque: I16F16,
    }
}

words! {
    /// The observer's memory.
    pub struct State {
        /// phi_w, rad.
        angle: I8F56,
        /// T_hand, N.m.
        hands: I8F56,
        /// phi_w', rad/ms.
        rate: I0F32,
        /// T_tb of the last step, N.m.
        bar: I8F24,
        /// How far the wheel's friction has given, as a share of all that it can: -1 to 1.
        given: I2F30,
        /// 0 before the first sample.
        is_known: u32,
    }
}

impl State {
    /// Nothing seen.
    pub const NEW: Self = Self {
        angle: I8F56::ZERO,
        hands: I8F56::ZERO,
        rate: I0F32::ZERO,
        bar: I8F24::ZERO,
        given: I2F30::ZERO,
        is_known: 0,
    };
}

/// No driver turns a wheel harder by hand, as the bus has it.
const MOST_HANDS: I8F56 = I8F56::const_from_int(20);
/// 100 rad/s, per millisecond: no wheel turns faster.
const MOST_RATE: I0F32 = I0F32::from_bits(429_496_730);
/// An angle that is further than this from what was predicted is a jump of a sensor, and no wheel's.
const JUMP: I8F24 = I8F24::ONE;

impl Observer {
    /// One step of 1 ms: T_hand from T_tb of now, and the angle measured in the steps in which there is a new one.
    #[must_use]
    pub fn step(&self, state: &mut State, bar_torque: Torque, angle: Option<Radians>) -> Torque {
        let bar = bar_torque.fixed();
        let sampled = angle.map(|angle| self.wheel_angle(angle, bar_torque).fixed());
        if state.is_known == 0 {
            begin(state, sampled, bar);
        } else {
            self.predict(state, bar);
            if let Some(sampled) = sampled {
                self.correct(state, sampled, bar);
            }
        }
        state.bar = bar;
        // No flipped bit and no sensor may move a state to where its products leave their formats.
        state.rate = state.rate.min(MOST_RATE).max(MOST_RATE.saturating_neg());
        state.hands = state.hands.min(MOST_HANDS).max(MOST_HANDS.saturating_neg());
        Torque::from_fixed(I8F24::wrapping_from_num(state.hands))
    }

    /// phi_w by the angle measured.
    #[must_use]
    pub fn wheel_angle(&self, angle: Radians, bar_torque: Torque) -> Radians {
        angle.plus(twist(bar_torque, self.to_wheel))
    }

    /// phi_c by the angle measured.
    #[must_use]
    pub fn column_angle(&self, angle: Radians, bar_torque: Torque) -> Radians {
        angle.minus(twist(bar_torque, self.to_column))
    }

    /// Damping and friction of the wheel, N.m; friction after Dahl, by how far the wheel has given.
    fn resists(&self, state: &mut State) -> I8F24 {
        let damping = I8F24::saturating_from_num(state.rate.wide_mul(self.damping));
        // A wheel that turns by all that it can give has slid: more is no more.
        let turned = I2F30::saturating_from_num(state.rate.wide_mul(self.gives));
        let turned = turned.min(I2F30::ONE).max(I2F30::NEG_ONE);
        let back = I2F30::wrapping_from_num(turned.saturating_abs().wide_mul(state.given));
        state.given = state.given.saturating_add(turned).saturating_sub(back);
        let friction = I8F24::wrapping_from_num(state.given.wide_mul(self.friction));
        damping.saturating_add(friction)
    }

    /// A millisecond on: the rate moves with what is left of the torques, the angle with the mean of both rates.
    fn predict(&self, state: &mut State, bar: I8F24) {
        let mean = (bar.wrapping_shr(1)).saturating_add(state.bar.wrapping_shr(1));
        let against = self.resists(state).saturating_add(mean);
        let left = I8F24::wrapping_from_num(state.hands).saturating_sub(against);
        let before = state.rate;
        let change = I0F32::wrapping_from_num(left.wide_mul(self.by_torque));
        state.rate = before.saturating_add(change);
        // Twice the mean, with all of its bits.
        let rates = I8F56::from_num(before).saturating_add(I8F56::from_num(state.rate));
        state.angle = state.angle.saturating_add(rates.wrapping_shr(1));
    }

    fn correct(&self, state: &mut State, sampled: I8F24, bar: I8F24) {
        let off = sampled.saturating_sub(I8F24::wrapping_from_num(state.angle));
        if off.unsigned_abs() > JUMP.unsigned_abs() {
            begin(state, Some(sampled), bar);
            return;
        }
        let angle = I8F56::wrapping_from_num(off.wide_mul(self.to_angle));
        state.angle = state.angle.saturating_add(angle);
        let rate = I0F32::wrapping_from_num(off.wide_mul(self.to_rate));
        state.rate = state.rate.saturating_add(rate);
        let hands = I8F56::saturating_from_num(off.wide_mul(self.to_torque));
        state.hands = state.hands.saturating_add(hands);
    }
}

/// The bar's twist: at most 26 rad, as a bar has at least 5 N.m/rad.
fn twist(bar_torque: Torque, per_torque: I0F32) -> Radians {
    Radians::from_fixed(I8F24::wrapping_from_num(bar_torque.fixed().wide_mul(per_torque)))
}

/// Before the first sample nothing is known but the bar; from it on the wheel rests.
fn begin(state: &mut State, sampled: Option<I8F24>, bar: I8F24) {
    *state = State {
        is_known: u32::from(sampled.is_some()),
        angle: I8F56::from_num(sampled.unwrap_or(I8F24::ZERO)),
        hands: I8F56::from_num(bar),
        ..State::NEW
    };
}
