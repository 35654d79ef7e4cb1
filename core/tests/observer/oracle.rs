//! The observer beside the same filter in f64, and beside a wheel whose hands are known.

use std::f64::consts::TAU;

use haptic_core::observer::{AngleAt, Limit, Observer, Parameters, Reading, Setup, State};
use haptic_core::quantity::{Radians, Torque};

/// Brookner, Tracking and Kalman Filtering Made Easy, 1.3: the critically damped g-h-k filter, with the equation of the wheel as its
/// prediction.
#[derive(Default)]
struct Oracle {
    angle: Option<f64>,
    rate: f64,
    beside: f64,
    bar: f64,
    given: f64,
}

impl Oracle {
    fn step(&mut self, of: &Parameters, bar_nm: f64, angle_rad: Option<f64>) -> f64 {
        let sampled = angle_rad.map(|angle| match of.angle_at {
            AngleAt::Wheel => angle,
            AngleAt::Column => angle + bar_nm / of.k_tb,
        });
        let bar = std::mem::replace(&mut self.bar, bar_nm);
        if let Some(angle) = self.angle {
            let before = self.rate;
            self.rate += 1e-3 / of.j_w * (self.beside - 0.5 * (bar + bar_nm));
            let predicted = angle + 0.5e-3 * (before + self.rate);
            self.angle = Some(predicted);
            if let Some(sampled) = sampled {
                let (t, b) = (1e-3 * of.sample_ms, (-1e-3 * of.bandwidth * of.sample_ms).exp());
                let off = sampled - predicted;
                self.angle = Some(predicted + (1.0 - b.powi(3)) * off);
                self.rate += 1.5 * (1.0 - b).powi(2) * (1.0 + b) / t * off;
                self.beside += of.j_w * (1.0 - b).powi(3) / (t * t) * off;
            }
        } else {
            (self.angle, self.beside) = (sampled, bar_nm);
        }
        // Dahl: z' = w - |w| z/give.
        let turned = (1e-3 * self.rate / of.friction_give_rad).clamp(-1.0, 1.0);
        self.given += turned - turned.abs() * self.given;
        self.beside + of.b_w * self.rate + of.friction_nm * self.given
    }
}

/// A wheel of those parameters whose bar is torn at, by tenths of a millisecond; its hands push as told.
struct Wheel {
    angle: f64,
    rate: f64,
}

impl Wheel {
    /// A millisecond under a torque of the hands at a column that is held at an angle; gives T_tb.
    fn step(&mut self, of: &Parameters, hands_nm: f64, column_rad: f64) -> f64 {
        for _ in 0..10 {
            let bar = of.k_tb * (self.angle - column_rad);
            let friction = of.friction_nm * (self.rate / 0.05).clamp(-1.0, 1.0);
            self.rate += 1e-4 / of.j_w * (hands_nm - bar - of.b_w * self.rate - friction);
            self.angle += 1e-4 * self.rate;
        }
        of.k_tb * (self.angle - column_rad)
    }
}

fn observer(of: &Parameters) -> Observer {
    Observer::new(Setup::new(of).unwrap())
}

fn reading(bar_nm: f64, angle_rad: Option<f64>) -> Reading {
    Reading {
        bar_torque: Torque::from_nm(bar_nm),
        angle: angle_rad.map(Radians::from_rad),
    }
}

#[test]
fn fixed_point_is_within_six_millinewton_metres_of_f64() {
    let mut worst: f64 = 0.0;
    for (sample_ms, bandwidth) in [(1.0, 10.0), (1.0, 100.0), (1.0, 300.0), (8.0, 30.0), (8.0, 100.0)] {
        for angle_at in [AngleAt::Wheel, AngleAt::Column] {
            for j_w in [0.02, 0.044, 0.08] {
                let of = Parameters {
                    j_w,
                    sample_ms,
                    bandwidth,
                    angle_at,
                    ..Parameters::default()
                };
                let (fixed, mut state, mut oracle) = (observer(&of), State::default(), Oracle::default());
                for k in 0..20_000_u32 {
                    let t = f64::from(k) * 1e-3;
                    let bar = 4.0 * (TAU * 0.4 * t).sin() + 0.5 * (TAU * 7.0 * t).cos();
                    let angle = -1.5 * (TAU * 0.25 * t).cos() + 0.02 * (TAU * 5.0 * t).sin();
                    let angle = k.is_multiple_of(sample_ms as u32).then_some(angle);
                    let estimate = fixed.step(&mut state, &reading(bar, angle));
                    let expected = oracle.step(&of, bar, angle);
                    assert!(
                        expected.abs() < 32.0 && estimate.limit == Limit::None,
                        "{of:?} {expected}"
                    );
                    worst = worst.max((estimate.hands.nm() - expected).abs());
                }
            }
        }
    }
    assert!(worst < 6e-3 && worst > 1e-7, "{worst}");
}

/// Hands that push with 3 N.m, to either side, against a column that is held.
#[test]
fn hands_are_seen_after_the_stated_lag() {
    for side in [1.0, -1.0] {
        // By a rate that is seen late itself, friction comes late; here it is none.
        for bandwidth in [30.0, 100.0, 214.0] {
            let of = Parameters {
                bandwidth,
                friction_nm: 0.0,
                ..Parameters::default()
            };
            let (observer, mut state) = (observer(&of), State::default());
            let mut wheel = Wheel {
                angle: 0.0,
                rate: 0.0,
            };
            // A ramp of 2 N.m/s: what is behind by a time is short by twice of it.
            let mut short = 0.0;
            for k in 0..4000 {
                let hands = side * 2e-3 * f64::from(k).min(1500.0);
                let bar = wheel.step(&of, hands, 0.0);
                let estimate = observer.step(&mut state, &reading(bar, Some(0.0)));
                if k == 1400 {
                    short = side * (hands - estimate.hands.nm());
                }
                if k == 3999 {
                    assert!((estimate.hands.nm() - side * 3.0).abs() < 0.01, "{estimate:?}");
                }
            }
            let lag_s = f64::from(observer.setup().lag_us()) * 1e-6;
            assert!(
                (short / 2.0 / lag_s - 1.0).abs() < 0.1,
                "{bandwidth}: {} {lag_s}",
                short / 2.0
            );
        }
    }
}

/// A motor shakes the column of a wheel that nobody holds: the bar feels newton metres, the observer no hand.
#[test]
fn a_free_wheel_reads_as_no_hand() {
    let [bar, hands] = free_wheel(0.0);
    assert!(bar > 1.5 && hands < 0.03 * bar, "{hands} of {bar}");
    // What damps the wheel comes by a rate that is less late than the rest.
    let [bar, hands] = free_wheel(0.05);
    assert!(bar > 1.5 && hands < 0.1 * bar, "{hands} of {bar}");
}

/// The most that bar and observer feel, N.m.
fn free_wheel(b_w: f64) -> [f64; 2] {
    let of = Parameters {
        bandwidth: 60.0,
        friction_nm: 0.0,
        b_w,
        ..Parameters::default()
    };
    let (observer, mut state) = (observer(&of), State::default());
    let mut wheel = Wheel {
        angle: 0.0,
        rate: 0.0,
    };
    let (mut bar_most, mut hands_most): (f64, f64) = (0.0, 0.0);
    for k in 0..8000 {
        let column = 0.15 * (TAU * 2.5 * f64::from(k) * 1e-3).sin();
        let bar = wheel.step(&of, 0.0, column);
        let estimate = observer.step(&mut state, &reading(bar, Some(column)));
        if k > 4000 {
            bar_most = bar_most.max(bar.abs());
            hands_most = hands_most.max(estimate.hands.nm().abs());
        }
    }
    [bar_most, hands_most]
}
