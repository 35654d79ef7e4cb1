//! The observer beside the same filter in f64, and beside a wheel whose hands are known.

use std::f64::consts::TAU;

use haptic_core::controller::config::hands_lag_s;
use haptic_core::controller::params::Params;
use haptic_core::observer::{Observer, State};
use haptic_core::quantity::{Radians, Torque};

use super::{AT_COLUMN, observer};

/// How far the wheel gives before it slides, rad.
const GIVE_RAD: f64 = 0.0035;

/// Brookner, Tracking and Kalman Filtering Made Easy, 1.3: the critically damped g-h-k filter, with the equation of the wheel as its
/// prediction.
#[derive(Default)]
struct Oracle {
    angle: Option<f64>,
    rate: f64,
    hands: f64,
    bar: f64,
    given: f64,
}

impl Oracle {
    fn step(&mut self, of: &Params, bar_nm: f64, angle_rad: Option<f64>) -> f64 {
        let sampled = angle_rad.map(|angle| {
            if of.torque_sensor == 2.0 {
                angle
            } else {
                angle + bar_nm / of.bar_stiffness_nm_per_rad
            }
        });
        let bar = std::mem::replace(&mut self.bar, bar_nm);
        if let Some(angle) = self.angle {
            let before = self.rate;
            // Dahl: z' = w - |w| z/give.
            let turned = (1e-3 * before / GIVE_RAD).clamp(-1.0, 1.0);
            self.given += turned - turned.abs() * self.given;
            let resists = of.wheel_damping_nm_s * before + of.wheel_friction_nm * self.given;
            self.rate += 1e-3 / of.wheel_inertia_kg_m2 * (self.hands - 0.5 * (bar + bar_nm) - resists);
            let predicted = angle + 0.5e-3 * (before + self.rate);
            self.angle = Some(predicted);
            if let Some(sampled) = sampled {
                let (t, b) = (
                    of.column_period_s,
                    (-of.observer_bandwidth_rad_per_s * of.column_period_s).exp(),
                );
                let off = sampled - predicted;
                self.angle = Some(predicted + (1.0 - b.powi(3)) * off);
                self.rate += 1.5 * (1.0 - b).powi(2) * (1.0 + b) / t * off;
                self.hands += of.wheel_inertia_kg_m2 * (1.0 - b).powi(3) / (t * t) * off;
            }
        } else {
            (self.angle, self.hands) = (sampled, bar_nm);
        }
        self.hands
    }
}

/// A wheel of those parameters whose bar is torn at, by tenths of a millisecond; its hands push as told.
struct Wheel {
    angle: f64,
    rate: f64,
}

impl Wheel {
    /// A millisecond under a torque of the hands at a column that is held at an angle; gives T_tb.
    fn step(&mut self, of: &Params, hands_nm: f64, column_rad: f64) -> f64 {
        for _ in 0..10 {
            let bar = of.bar_stiffness_nm_per_rad * (self.angle - column_rad);
            let friction = of.wheel_friction_nm * (self.rate / 0.05).clamp(-1.0, 1.0);
            self.rate += 1e-4 / of.wheel_inertia_kg_m2
                * (hands_nm - bar - of.wheel_damping_nm_s * self.rate - friction);
            self.angle += 1e-4 * self.rate;
        }
        of.bar_stiffness_nm_per_rad * (self.angle - column_rad)
    }
}

fn feel(observer: &Observer, state: &mut State, bar_nm: f64, angle_rad: Option<f64>) -> f64 {
    observer
        .step(state, Torque::from_nm(bar_nm), angle_rad.map(Radians::from_rad))
        .nm()
}

#[test]
fn fixed_point_is_within_six_millinewton_metres_of_f64() {
    let mut worst: f64 = 0.0;
    for (sample_ms, observer_bandwidth_rad_per_s) in [
        (1, 10.0),
        (1, 100.0),
        (1, 300.0),
        (2, 100.0),
        (8, 30.0),
        (8, 100.0),
    ] {
        for torque_sensor in [1.0, 2.0] {
            for wheel_inertia_kg_m2 in [0.02, 0.044, 0.08] {
                let of = Params {
                    wheel_inertia_kg_m2,
                    column_period_s: 1e-3 * f64::from(sample_ms),
                    observer_bandwidth_rad_per_s,
                    torque_sensor,
                    ..AT_COLUMN
                };
                let (fixed, mut state, mut oracle) = (observer(&of), State::NEW, Oracle::default());
                for k in 0..20_000_u32 {
                    let t = f64::from(k) * 1e-3;
                    let bar = 4.0 * (TAU * 0.4 * t).sin() + 0.5 * (TAU * 7.0 * t).cos();
                    let angle = -1.5 * (TAU * 0.25 * t).cos() + 0.02 * (TAU * 5.0 * t).sin();
                    let angle = k.is_multiple_of(sample_ms).then_some(angle);
                    let found = feel(&fixed, &mut state, bar, angle);
                    let expected = oracle.step(&of, bar, angle);
                    assert!(expected.abs() < 20.0, "{of:?} {expected}");
                    worst = worst.max((found - expected).abs());
                }
            }
        }
    }
    assert!(worst < 6e-3 && worst > 1e-7, "{worst}");
}

/// A wheel at rest, to either side of zero, whose angle is told as a bit of the sensor more and less in turn: what each step cuts off must
/// not add up to a friction that gives.
#[test]
fn a_wheel_at_rest_is_within_six_millinewton_metres_of_f64_for_300_s() {
    let bit = 1.0 / 65_536.0;
    for side in [1.0, -1.0] {
        for (sample_ms, observer_bandwidth_rad_per_s) in
            [(1, 10.0), (1, 100.0), (1, 300.0), (2, 50.0), (8, 30.0)]
        {
            for bar in [0.0, side * 0.3] {
                let of = Params {
                    column_period_s: 1e-3 * f64::from(sample_ms),
                    observer_bandwidth_rad_per_s,
                    ..AT_COLUMN
                };
                let (fixed, mut state, mut oracle) = (observer(&of), State::NEW, Oracle::default());
                let mut worst: f64 = 0.0;
                for k in 0..300_000_u32 {
                    let is_more = (k / sample_ms).is_multiple_of(2);
                    let angle = side * (0.125 + if is_more { bit } else { -bit });
                    let angle = k.is_multiple_of(sample_ms).then_some(angle);
                    let found = feel(&fixed, &mut state, bar, angle);
                    worst = worst.max((found - oracle.step(&of, bar, angle)).abs());
                }
                assert!(worst < 6e-3 && worst > 1e-7, "{of:?} {bar}: {worst}");
            }
        }
    }
}

/// Hands that push with 3 N.m, to either side, against a column that is held.
#[test]
fn hands_are_seen_after_the_stated_lag() {
    for side in [1.0, -1.0] {
        // The friction of this wheel ends where it rests, and the observer's does not; here it is none.
        for observer_bandwidth_rad_per_s in [30.0, 100.0, 214.0] {
            let of = Params {
                observer_bandwidth_rad_per_s,
                wheel_friction_nm: 0.0,
                ..AT_COLUMN
            };
            let (observer, mut state) = (observer(&of), State::NEW);
            let mut wheel = Wheel {
                angle: 0.0,
                rate: 0.0,
            };
            // A ramp of 2 N.m/s: what is behind by a time is short by twice of it.
            let mut short = 0.0;
            for k in 0..4000 {
                let hands = side * 2e-3 * f64::from(k).min(1500.0);
                let bar = wheel.step(&of, hands, 0.0);
                let found = feel(&observer, &mut state, bar, Some(0.0));
                if k == 1400 {
                    short = side * (hands - found);
                }
                if k == 3999 {
                    assert!((found - side * 3.0).abs() < 0.01, "{found}");
                }
            }
            let lag_s = hands_lag_s(&of);
            assert!(
                (short / 2.0 / lag_s - 1.0).abs() < 0.1,
                "{observer_bandwidth_rad_per_s}: {} {lag_s}",
                short / 2.0
            );
        }
    }
}

/// A motor shakes the column of a wheel that nobody holds: the bar feels newton metres, the observer no hand.
#[test]
fn a_free_wheel_reads_as_no_hand() {
    for (b_w, friction_nm, most) in [(0.0, 0.0, 0.03), (0.05, 0.0, 0.1), (0.05, 0.2, 0.1)] {
        let [bar, hands] = free_wheel(b_w, friction_nm);
        assert!(
            bar > 1.5 && hands < most * bar,
            "{b_w} {friction_nm}: {hands} of {bar}"
        );
    }
}

/// The most that bar and observer feel, N.m.
fn free_wheel(b_w: f64, wheel_friction_nm: f64) -> [f64; 2] {
    let of = Params {
        observer_bandwidth_rad_per_s: 60.0,
        wheel_friction_nm,
        wheel_damping_nm_s: b_w,
        ..AT_COLUMN
    };
    let (observer, mut state) = (observer(&of), State::NEW);
    let mut wheel = Wheel {
        angle: 0.0,
        rate: 0.0,
    };
    let (mut bar_most, mut hands_most): (f64, f64) = (0.0, 0.0);
    for k in 0..8000 {
        let column = 0.15 * (TAU * 2.5 * f64::from(k) * 1e-3).sin();
        let bar = wheel.step(&of, 0.0, column);
        let found = feel(&observer, &mut state, bar, Some(column));
        if k > 4000 {
            bar_most = bar_most.max(bar.abs());
            hands_most = hands_most.max(found.abs());
        }
    }
    [bar_most, hands_most]
}
