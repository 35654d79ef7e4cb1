//! What an observer is set up with: SI values become gains here, once, and nowhere else.

#![expect(
    clippy::float_arithmetic,
    clippy::arithmetic_side_effects,
    clippy::as_conversions,
    reason = "the one file where SI values become bits, once, before the first step"
)]

use fixed::types::{I0F32, I8F24, I16F16};

use super::ToAngle;

/// Which end of the bar an angle is measured at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum AngleAt {
    /// The steering wheel.
    Wheel,
    /// The column, by the motor: K_tb makes the wheel's of it.
    #[default]
    Column,
}

/// The wheel, its bar, and how quickly the observer follows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameters {
    /// J_w, kg.m2: 0.005 to 0.5.
    pub j_w: f64,
    /// B_w, N.m.s/rad: 0 to 5.
    pub b_w: f64,
    /// Dry friction of the wheel, N.m: 0 to 5.
    pub friction_nm: f64,
    /// How far the wheel gives before it slides, rad: 0.0005 to 0.1.
    pub friction_give_rad: f64,
    /// K_tb, N.m/rad: 5 to 1000.
    pub k_tb: f64,
    /// Where the angle is measured.
    pub angle_at: AngleAt,
    /// Time between two samples of the angle, ms: 1 to 20.
    pub sample_ms: f64,
    /// Bandwidth w, rad/s: 5 to 400, and at most 1 over a sample.
    pub bandwidth: f64,
    /// Most torque of hands, N.m: 1 to 100.
    pub most_nm: f64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            j_w: 0.044,
            b_w: 0.05,
            friction_nm: 0.2,
            friction_give_rad: 0.0035,
            k_tb: 143.24,
            angle_at: AngleAt::Column,
            sample_ms: 1.0,
            bandwidth: 100.0,
            most_nm: 32.0,
        }
    }
}

/// A parameter out of its range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SetupError {
    /// Its name.
    pub field: &'static str,
    /// Its value.
    pub value: f64,
    /// What it may be, from and to.
    pub range: [f64; 2],
}

impl core::fmt::Display for SetupError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let [from, to] = self.range;
        write!(f, "{} = {} is outside {from} to {to}", self.field, self.value)
    }
}

/// Parameters as gains.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Setup {
    pub(super) angle_at: AngleAt,
    /// 1/K_tb, rad per N.m.
    pub(super) twist: I0F32,
    /// Rate per torque and step, rad/ms per N.m.
    pub(super) by_torque: I0F32,
    /// Damping, N.m per rad/ms.
    pub(super) damping: I16F16,
    /// One over what the friction gives, 1/rad.
    pub(super) gives: I16F16,
    /// Friction of a wheel that slides, N.m.
    pub(super) friction: I8F24,
    /// What an error of the angle does to angle, rate (1/ms) and torque (N.m/rad).
    pub(super) to_angle: ToAngle,
    pub(super) to_rate: I8F24,
    pub(super) to_torque: I16F16,
    /// Most torque of hands, N.m.
    pub(super) most: I8F24,
    lag_us: u32,
}

/// e^-x for 0 to 1, by its series: the error is below 1e-12. `core` has no exponential.
const fn decay(x: f64) -> f64 {
    let (mut sum, mut term, mut n) = (1.0, 1.0, 1);
    while n < 16 {
        term *= -x / n as f64;
        sum += term;
        n += 1;
    }
    sum
}

/// `value * 2^bits`, to the nearest; saturates.
const fn scaled(value: f64, bits: u32) -> i32 {
    (value * (1_u64 << bits) as f64 + 0.5) as i32
}

impl Setup {
    /// Gains for parameters.
    ///
    /// # Errors
    /// The first parameter out of its range.
    pub const fn new(of: &Parameters) -> Result<Self, SetupError> {
        let fastest = 1000.0 / of.sample_ms;
        let most = if fastest < 400.0 { fastest } else { 400.0 };
        let ranges = [
            ("j_w", of.j_w, [0.005, 0.5]),
            ("b_w", of.b_w, [0.0, 5.0]),
            ("friction_nm", of.friction_nm, [0.0, 5.0]),
            ("friction_give_rad", of.friction_give_rad, [0.0005, 0.1]),
            ("k_tb", of.k_tb, [5.0, 1000.0]),
            ("sample_ms", of.sample_ms, [1.0, 20.0]),
            ("bandwidth", of.bandwidth, [5.0, most]),
            ("most_nm", of.most_nm, [1.0, 100.0]),
        ];
        let mut rest: &[(&'static str, f64, [f64; 2])] = &ranges;
        while let [(field, value, [from, to]), behind @ ..] = rest {
            // NaN is in no range.
            if !(*value >= *from && *value <= *to) {
                return Err(SetupError {
                    field,
                    value: *value,
                    range: [*from, *to],
                });
            }
            rest = behind;
        }
        let sample_s = of.sample_ms / 1000.0;
        let pole = decay(of.bandwidth * sample_s);
        let left = 1.0 - pole;
        Ok(Self {
            angle_at: of.angle_at,
            twist: I0F32::from_bits(scaled(1.0 / of.k_tb, 32)),
            by_torque: I0F32::from_bits(scaled(1e-6 / of.j_w, 32)),
            damping: I16F16::from_bits(scaled(of.b_w * 1000.0, 16)),
            gives: I16F16::from_bits(scaled(1.0 / of.friction_give_rad, 16)),
            friction: I8F24::from_bits(scaled(of.friction_nm, 24)),
            to_angle: ToAngle::from_bits(scaled(1.0 - pole * pole * pole, 30)),
            to_rate: I8F24::from_bits(scaled(1.5 * left * left * (1.0 + pole) / of.sample_ms, 24)),
            to_torque: I16F16::from_bits(scaled(of.j_w * left * left * left / (sample_s * sample_s), 16)),
            most: I8F24::from_bits(scaled(of.most_nm, 24)),
            lag_us: (3e6 / of.bandwidth + 500.0 * (of.sample_ms - 1.0)) as u32,
        })
    }

    /// How far the estimate is behind a torque that changes slowly, us: three lags of 1/w, and half of what a sample of the angle is
    /// old on average beyond the millisecond.
    #[must_use]
    pub const fn lag_us(&self) -> u32 {
        self.lag_us
    }

    /// Most torque of hands, N.m.
    #[must_use]
    pub fn most(&self) -> f64 {
        self.most.to_bits() as f64 / (1 << 24) as f64
    }
}
