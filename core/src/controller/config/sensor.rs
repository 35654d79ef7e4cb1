//! The sensor of the column: which one, and for a bar the gains of the observer that makes the hands' torque of it.

use fixed::types::{I0F32, I2F30, I8F24, I16F16};

use super::first_error;
use crate::controller::params::{BAR_AND_COLUMN_ANGLE, ParamError, Params, in_range};
use crate::observer::{Observer, SensorWords};
use crate::quantity::Torque;

/// How far the wheel gives before it slides, rad: usual practice, as in the plant of `host-sim/column`.
const GIVE_RAD: f64 = 0.0035;
/// [`Estimator::quiet`](crate::estimator::Estimator) with a bar: what the observer says of a free wheel beside the probe.
pub(super) const QUIET: Torque = Torque::from_nm(0.1);
const SAMPLES: &str = "observer_bandwidth_rad_per_s * column_period_s";
const LOWER_DAMPING: &str = "vehicle.column_damping_nm_s - wheel_damping_nm_s";

/// Refuses, for a bar, an observer that is quicker than its samples and a wheel that damps more than wheel and column together.
pub(super) const fn check(p: &Params) -> Result<(), ParamError> {
    if !p.has_bar() {
        return Ok(());
    }
    let per_sample = p.observer_bandwidth_rad_per_s * p.column_period_s;
    first_error(&[
        in_range(SAMPLES, per_sample, [0.0, 1.0], "rad"),
        in_range(LOWER_DAMPING, lower_damping(p), [0.0, 10.0], "N.m.s/rad"),
    ])
}

/// B_c of a column whose wheel is apart, and otherwise B_s.
pub(super) const fn lower_damping(p: &Params) -> f64 {
    let above = if p.has_bar() { p.wheel_damping_nm_s } else { 0.0 };
    p.vehicle.column_damping_nm_s - above
}

/// The sensor of parameters that are in range.
pub(super) const fn sensor(p: &Params) -> SensorWords {
    if !p.has_bar() {
        return SensorWords::HANDS;
    }
    let twist = I0F32::from_bits(scaled(1.0 / p.bar_stiffness_nm_per_rad, 32));
    let (to_wheel, to_column) = if p.torque_sensor == BAR_AND_COLUMN_ANGLE {
        (twist, I0F32::ZERO)
    } else {
        (I0F32::ZERO, twist)
    };
    let (inertia, period_s) = (p.wheel_inertia_kg_m2, p.column_period_s);
    let pole = decay(p.observer_bandwidth_rad_per_s * period_s);
    let left = 1.0 - pole;
    let to_rate = 1.5e-3 * left * left * (1.0 + pole) / period_s;
    let to_torque = inertia * left * left * left / (period_s * period_s);
    SensorWords::bar(Observer {
        to_wheel,
        to_column,
        by_torque: I0F32::from_bits(scaled(1e-6 / inertia, 32)),
        damping: I16F16::from_bits(scaled(p.wheel_damping_nm_s * 1000.0, 16)),
        gives: I16F16::from_bits(scaled(1.0 / GIVE_RAD, 16)),
        friction: I8F24::from_bits(scaled(p.wheel_friction_nm, 24)),
        to_angle: I2F30::from_bits(scaled(1.0 - pole * pole * pole, 30)),
        to_rate: I8F24::from_bits(scaled(to_rate, 24)),
        to_torque: I16F16::from_bits(scaled(to_torque, 16)),
    })
}

/// `1 + j*turns*t_nms` at an angular frequency, and with a bar its product with what undoes the lags of the observer there.
pub(super) const fn arm(p: &Params, turns: f64, t_nms_s: f64) -> [f64; 2] {
    let [each, half_sample] = if p.has_bar() {
        [
            turns / p.observer_bandwidth_rad_per_s,
            0.5 * turns * (p.column_period_s - 1e-3),
        ]
    } else {
        [0.0; 2]
    };
    let lags = [turns * t_nms_s, each, each, each, half_sample];
    let (mut arm, mut i) = ([1.0, 0.0], 0);
    while i < lags.len() {
        let [re, im] = arm;
        arm = [re - im * lags[i], im + re * lags[i]];
        i += 1;
    }
    arm
}

/// Variance of K_hg through a bar for 1 N.m of T_h that turns the wheel by 1 rad. J_w and friction are known to 15 %; a wheel that slides
/// has about half of the friction that it has for a turn so small that it gives.
pub(super) const fn unsure(p: &Params, turns: f64, [re, im]: [f64; 2]) -> f64 {
    let share = if p.has_bar() { 0.15 } else { 0.0 };
    let inertia = share * p.wheel_inertia_kg_m2 * turns * turns;
    let friction = share * p.wheel_friction_nm / (2.0 * GIVE_RAD);
    (re * re + im * im) * (inertia * inertia + friction * friction)
}

/// How far what is known of the hands is behind a torque that changes slowly, s: nothing with a sensor of theirs; with a bar three lags
/// of the observer, and half of what a sample of the angle is old on average beyond the millisecond.
#[must_use]
pub const fn hands_lag_s(p: &Params) -> f64 {
    if p.has_bar() {
        3.0 / p.observer_bandwidth_rad_per_s + 0.5 * (p.column_period_s - 1e-3)
    } else {
        0.0
    }
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

#[cfg(test)]
mod tests {
    use super::{Params, arm};

    /// Its angle is the sum of those of the muscle, the three lags, and how old a sample is on average beyond the millisecond.
    #[test]
    fn the_arm_is_turned_by_each_lag_and_half_a_sample() {
        let (turns, t_nms_s) = (15.7_f64, 0.1);
        for (column_period_s, observer_bandwidth_rad_per_s, old_s) in [
            (0.001, 60.0, 0.0),
            (0.002, 200.0, 0.0005),
            (0.008, 60.0, 0.0035),
            (0.02, 30.0, 0.0095),
        ] {
            let bar = Params {
                torque_sensor: 1.0,
                column_period_s,
                observer_bandwidth_rad_per_s,
                ..Params::PAPER
            };
            let muscle = (turns * t_nms_s).atan();
            let lags = 3.0 * (turns / observer_bandwidth_rad_per_s).atan();
            let old = (turns * old_s).atan();
            let [re, im] = arm(&bar, turns, t_nms_s);
            assert!((im.atan2(re) - (muscle + lags + old)).abs() < 1e-9, "{bar:?}");
            let hands = Params {
                torque_sensor: 0.0,
                ..bar
            };
            let [re, im] = arm(&hands, turns, t_nms_s);
            assert!((im.atan2(re) - muscle).abs() < 1e-9, "{hands:?}");
        }
    }
}
