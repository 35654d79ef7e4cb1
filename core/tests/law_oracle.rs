//! The fixed-point law against a float64 oracle of the same discrete law, over the whole input range.

use haptic_core::controller::config::Config;
use haptic_core::controller::inputs::{ColumnState, Input, Inputs, Motion, Request};
use haptic_core::controller::params::Params;
use haptic_core::controller::{Controller, ControllerState};
use haptic_core::lane::LaneSample;
use haptic_core::law::{Coefficients, EgoMotion, LawState};
use haptic_core::quantity::{Instant, Metres, Micros, Radians, Ratio, Speed, Torque, TurningRate};
use haptic_core::safety::faults::FaultSet;
use haptic_core::safety::modes::Mode;
use rand::rngs::SmallRng;
use rand::{RngExt, SeedableRng};

/// Largest difference that `law.rs` states, N.m. The requirement is five times wider.
const BOUND_NM: f64 = 2e-4;

/// Equation (9) with the filter of `law.rs`, in f64.
struct Oracle {
    p: Params,
    last: Option<(f64, f64, f64)>,
    rates: (f64, f64),
}

impl Oracle {
    fn new(p: Params) -> Self {
        Self {
            p,
            last: None,
            rates: (0.0, 0.0),
        }
    }

    fn step(&mut self, t_s: f64, age_s: f64, e_y: f64, e_theta: f64) -> f64 {
        let tau = 1.0 / (2.0 * std::f64::consts::PI * self.p.rate_corner_hz);
        self.rates = match self.last {
            Some((t, y, theta)) if t_s - t <= 0.1 => {
                let dt = t_s - t;
                let rate = |r: f64, change: f64| ((tau * r + change) / (tau + dt)).clamp(-1000.0, 1000.0);
                (rate(self.rates.0, e_y - y), rate(self.rates.1, e_theta - theta))
            }
            _ => (0.0, 0.0),
        };
        self.last = Some((t_s, e_y, e_theta));
        let p = &self.p;
        let e_y = e_y + self.rates.0 * age_s;
        let e_theta = e_theta + self.rates.1 * age_s;
        let wanted = p.k_1 * (p.a_1 * e_y + p.a_2 * self.rates.0 + p.a_3 * e_theta + p.a_4 * self.rates.1);
        wanted.clamp(-p.torque_limit_nm, p.torque_limit_nm)
    }
}

fn paper() -> Coefficients {
    *Config::PAPER.law().unwrap().coefficients()
}

/// Both, fed with the same samples.
struct Pair {
    law: Coefficients,
    state: LawState,
    oracle: Oracle,
    t_us: u64,
    worst_nm: f64,
}

impl Pair {
    fn new(p: Params) -> Self {
        Self {
            law: *Config::new(&p).unwrap().law().unwrap().coefficients(),
            state: LawState::NEW,
            oracle: Oracle::new(p),
            t_us: 0,
            worst_nm: 0.0,
        }
    }

    fn step(&mut self, dt_us: u64, e_y: f64, e_theta: f64) -> f64 {
        self.t_us += dt_us;
        // The clock wraps under the controller, not under the oracle.
        let now = Instant::from_us(self.t_us as u32);
        let lane = LaneSample {
            e_y: Metres::from_m(e_y),
            e_theta: Radians::from_rad(e_theta),
            at: now,
        };
        // The errors are read `age` after they were true, as between two camera samples.
        let age_us = (self.t_us / 7 % 31) as u32 * 1000;
        let read_at = now.after(Micros::from_us(age_us));
        let torque = self
            .law
            .step(&mut self.state, read_at, lane, &EgoMotion::STEADY)
            .nm()
            .clamp(-5.0, 5.0);
        let t_s = self.t_us as f64 * 1e-6;
        let expected = self
            .oracle
            .step(t_s, f64::from(age_us) * 1e-6, lane.e_y.m(), lane.e_theta.rad());
        self.worst_nm = self.worst_nm.max((torque - expected).abs());
        torque
    }
}

#[test]
fn every_pair_of_samples_on_a_dense_grid() {
    let e_y = || (-8..=8).map(|i| f64::from(i) * 0.5);
    let e_theta = || (-10..=10).map(|i| f64::from(i) * 0.05);
    let mut worst: f64 = 0.0;
    for dt_us in [100, 1000, 8333, 25_000] {
        for y0 in e_y() {
            for theta0 in e_theta() {
                for y1 in e_y() {
                    for theta1 in e_theta() {
                        let mut pair = Pair::new(Params::PAPER);
                        pair.step(0, y0, theta0);
                        pair.step(dt_us, y1, theta1);
                        worst = worst.max(pair.worst_nm);
                    }
                }
            }
        }
    }
    println!("grid: worst difference {:.6} mN.m", worst * 1e3);
    assert!(worst <= BOUND_NM, "worst difference {worst} N.m");
}

#[test]
fn random_walks_with_jumps_and_uneven_samples() {
    let mut rng = SmallRng::seed_from_u64(9);
    let mut worst: f64 = 0.0;
    let mut limited = 0;
    for walk in 0..200 {
        // Small steps near zero, where nothing is limited, to steps across the whole range.
        let scale = 10f64.powf(rng.random_range(-5.0..0.5));
        let mut pair = Pair::new(Params {
            rate_corner_hz: [0.5, 3.0, 10.0, 30.0, 60.0][walk % 5],
            k_1: rng.random_range(0.0..0.8),
            a_4: rng.random_range(0.0..2.0),
            ..Params::PAPER
        });
        // Start just before the microsecond clock wraps.
        pair.t_us = u64::from(u32::MAX) - 1_000_000;
        let (mut y, mut theta) = (0.0_f64, 0.0_f64);
        for _ in 0..10_000 {
            y = (y + scale * rng.random_range(-1.0..1.0)).clamp(-4.0, 4.0);
            theta = (theta + 0.125 * scale * rng.random_range(-1.0..1.0)).clamp(-0.5, 0.5);
            let torque = pair.step(rng.random_range(100..12_000), y, theta);
            limited += usize::from(torque.abs() == 5.0);
        }
        worst = worst.max(pair.worst_nm);
    }
    println!(
        "walks: worst difference {:.6} mN.m, {limited} of 2000000 steps at the limit",
        worst * 1e3
    );
    assert!(worst <= BOUND_NM, "worst difference {worst} N.m");
    assert!(
        limited < 1_600_000,
        "the walks must leave the limit to say anything: {limited}"
    );
}

#[test]
fn a_ramp_gives_its_slope_and_a_step_decays_with_tau() {
    // By hand: de_theta/dt = 0.1 rad/s settles to K_1*a4'*0.1 = 0.025 N.m on top of the proportional part.
    let only_rate = Params {
        a_1: 0.0,
        a_2: 0.0,
        a_3: 0.0,
        ..Params::PAPER
    };
    let mut pair = Pair::new(only_rate);
    let mut torque = 0.0;
    for k in 0..60 {
        torque = pair.step(8333, 0.0, 0.1 * f64::from(k) * 8333e-6);
    }
    assert!((torque - 0.025).abs() < 1e-5, "{torque}");
    // A step of 0.1 rad has an area of K_1*a4'*0.1 N.m.s under its rate, whatever the corner.
    let mut pair = Pair::new(only_rate);
    pair.step(0, 0.0, 0.0);
    let area: f64 = (0..200).map(|_| pair.step(1000, 0.0, 0.1) * 1e-3).sum();
    assert!((area - 0.025).abs() < 1e-5, "{area}");
}

/// To the bit: a rate that is rounded away from nothing would turn the wheel.
#[test]
fn held_errors_have_no_rate() {
    for (e_y, e_theta) in [(0.3, -0.02), (-1.7, 0.4), (0.0, 0.0)] {
        let mut pair = Pair::new(Params::PAPER);
        let first = pair.step(1000, e_y, e_theta);
        for dt_us in [100, 1000, 8333, 25_000, 99_999] {
            assert_eq!(pair.step(dt_us, e_y, e_theta), first, "{e_y} {e_theta} {dt_us}");
        }
    }
}

/// From 1.75 m on one side to as much on the other, at an angle and not: equation (9) as if the line had always been there. After
/// 0.8 s the filter of the rates has settled.
#[test]
fn a_line_chosen_anew_goes_on_at_the_rates_of_the_old_one() {
    let law = paper();
    for (y_rate, theta_rate) in [(0.0, 0.0), (0.5, 0.02), (-0.5, -0.02), (0.5, -0.02)] {
        let mut state = LawState::NEW;
        let at = |ms: u32, e_y: f64| {
            let t = f64::from(ms) * 1e-3 - 0.8;
            LaneSample {
                e_y: Metres::from_m(e_y + y_rate * t),
                e_theta: Radians::from_rad(theta_rate * t),
                at: Instant::from_us(1000 * ms),
            }
        };
        let expected = |e_y: f64| 0.25 * (2.0 * e_y + 0.05 * y_rate + theta_rate);
        let mut torque = f64::NAN;
        for ms in (0..=800).step_by(8) {
            let sample = at(ms, 1.75);
            torque = law.step(&mut state, sample.at, sample, &EgoMotion::STEADY).nm();
        }
        assert!((torque - expected(1.75)).abs() < 1e-4, "{torque}");
        let anew = at(800, -1.75);
        state.relocate(anew);
        let torque = law.step(&mut state, anew.at, anew, &EgoMotion::STEADY).nm();
        assert!((torque - expected(-1.75)).abs() < 1e-4, "{torque}");
    }
}

#[test]
fn extremes_saturate() {
    let mut pair = Pair::new(Params {
        k_1: 4.0,
        a_1: 8.0,
        a_3: 8.0,
        a_2: 8.0,
        a_4: 8.0,
        ..Params::PAPER
    });
    let extremes = [f64::INFINITY, f64::NEG_INFINITY, 127.9, -128.0, 0.0];
    for y in extremes {
        for theta in extremes {
            let torque = pair.step(1, y, theta);
            assert!(torque.abs() <= 5.0);
            if y > 0.0 && theta > 0.0 {
                assert_eq!(pair.step(99_000, y, theta), 5.0);
            }
        }
    }
}

#[test]
fn errors_go_on_at_their_rates_for_half_a_second_at_most() {
    // 0.1 rad/s for long enough that the filter has settled; then one sample is read later and later.
    let law = paper();
    let mut state = LawState::NEW;
    let mut sample = LaneSample::default();
    for k in 0..100_u32 {
        let at = Instant::from_us(k * 10_000);
        let e_theta = Radians::from_rad(1e-3 * f64::from(k));
        sample = LaneSample {
            e_theta,
            at,
            ..LaneSample::default()
        };
        let _ = law.step(&mut state, at, sample, &EgoMotion::STEADY);
    }
    let mut read = |ms: u32| {
        let now = sample.at.after(Micros::from_ms(ms));
        law.step(&mut state, now, sample, &EgoMotion::STEADY).nm()
    };
    // K_1*a3' = 10 N.m/rad times 0.1 rad/s times the age.
    for (ms, grown) in [(30, 0.03), (500, 0.5), (501, 0.5), (5_000, 0.5)] {
        let difference = read(ms) - read(0);
        assert!((difference - grown).abs() < 1e-3, "{ms} ms: {difference}");
    }
}

/// The controller without its bus, active from the start, on lane errors that stand still and a driver who holds against
/// the torque: `K_1*a_1*e_y` once it has wound up, times the authority, of which what is beyond 0 to 1 does not count.
#[test]
fn the_controller_alone_gives_the_law() {
    let controller = Controller::new(Config::new(&Params::PAPER).unwrap());
    for (e_y, authority, share) in [
        (-0.6, 1.0, 1.0),
        (0.4, 1.0, 1.0),
        (0.4, 0.5, 0.5),
        (0.4, 1.5, 1.0),
        (-0.6, 1.5, 1.0),
        (0.4, -0.5, 0.0),
        (-0.6, -0.5, 0.0),
    ] {
        let mut state = ControllerState::engaged(Instant::from_us(0));
        let mut applied = Torque::ZERO;
        for ms in 1..=3000 {
            let now = Instant::from_us(1000 * ms);
            let inputs = Inputs {
                lane: Input::New(LaneSample {
                    e_y: Metres::from_m(e_y),
                    e_theta: Radians::ZERO,
                    at: now,
                }),
                column: Input::New(ColumnState {
                    driver_torque: Torque::from_nm(-applied.nm()),
                    wheel_angle: Radians::ZERO,
                }),
                motion: Input::New(Motion::new([Speed::from_m_per_s(20.0); 2], None)),
                request: Input::New(Request {
                    engage: true,
                    authority: Ratio::from_si(authority),
                    probe: false,
                }),
                faults: FaultSet::NONE,
            };
            let command = controller.step(&mut state, now, applied, &inputs);
            assert_eq!(command.mode, Mode::Active, "{ms} {command:?}");
            applied = command.torque;
        }
        let wanted = Params::PAPER.k_1 * Params::PAPER.a_1 * e_y * share;
        assert!((applied.nm() - wanted).abs() < 1e-3, "{} {wanted}", applied.nm());
    }
}

/// A sample that was old when it came, and what the vehicle did since, against the kinematics in f64: both errors go on at
/// their rates; the heading is `turned` beyond that, grown as the square of the time, so that a third of its age counts for
/// the way aside, beside what the near point is moved by.
#[test]
fn what_the_vehicle_did_since_an_old_sample_is_made_up_for() {
    let law = paper();
    let p = Params::PAPER;
    let mut rng = SmallRng::seed_from_u64(7);
    let mut furthest = 0.0_f64;
    for _ in 0..2000 {
        let mut any = |most: f64| rng.random_range(-most..most);
        let (mut state, mut oracle) = (LawState::NEW, Oracle::new(p));
        // Rates from a few samples; at the last one the oracle's are those of the sample.
        let (y, theta, y_rate, theta_rate) = (any(0.5), any(0.02), any(0.5), any(0.1));
        let mut sample = LaneSample::default();
        for k in -30..=0 {
            let t_s = f64::from(k) * 0.008;
            sample = LaneSample {
                e_y: Metres::from_m(y + y_rate * t_s),
                e_theta: Radians::from_rad(theta + theta_rate * t_s),
                at: Instant::from_us((1_000_000 + 8000 * k) as u32),
            };
            let _ = law.step(&mut state, sample.at, sample, &EgoMotion::STEADY);
            oracle.step(t_s, 0.0, sample.e_y.m(), sample.e_theta.rad());
        }
        let (turned, faster) = (any(0.03), any(0.2));
        let (speed, near, age_s) = (20.0 + any(15.0), 6.0 + any(4.0), 0.05 + any(0.05));
        let since = EgoMotion::new(
            Radians::from_rad(turned),
            TurningRate::from_rad_per_s(faster),
            Speed::from_m_per_s(speed),
            Metres::from_m(near),
        );
        let age = Micros::from_us((age_s * 1e6) as u32);
        let age_s = f64::from(age.us()) * 1e-6;
        let torque = law.step(&mut state, sample.at.after(age), sample, &since).nm();

        let (y_rate, theta_rate) = oracle.rates;
        let going = theta_rate * age_s;
        let aside = near * turned + speed * turned * age_s / 3.0 - speed * going * age_s / 2.0;
        let e_y = sample.e_y.m() + y_rate * age_s - aside;
        let e_theta = sample.e_theta.rad() + going - turned;
        let y_rate = y_rate - speed * (turned - going) - near * faster;
        let theta_rate = theta_rate - faster;
        let expected = p.k_1 * (p.a_1 * e_y + p.a_2 * y_rate + p.a_3 * e_theta + p.a_4 * theta_rate);
        furthest = furthest.max((torque - expected).abs());
    }
    assert!(furthest < BOUND_NM, "{furthest}");
}

/// Rates are shared over 100 ms and not a microsecond more, and there are none with the first sample.
#[test]
fn two_samples_share_a_rate_over_100_ms() {
    let p = Params::PAPER;
    let tau = 1.0 / (2.0 * std::f64::consts::PI * p.rate_corner_hz);
    let position = p.k_1 * p.a_1 * 0.5;
    let torque = |samples: &[(u32, f64)]| {
        let (law, mut state, mut last) = (paper(), LawState::NEW, 0.0);
        for &(us, e_y) in samples {
            let at = Instant::from_us(us);
            let sample = LaneSample {
                e_y: Metres::from_m(e_y),
                e_theta: Radians::ZERO,
                at,
            };
            last = law.step(&mut state, at, sample, &EgoMotion::STEADY).nm();
        }
        last
    };
    let rated = position + p.k_1 * p.a_2 * 0.5 / (tau + 0.1);
    for (samples, expected) in [
        (&[(0, 0.0), (100_000, 0.5)][..], rated),
        (&[(0, 0.0), (100_001, 0.5)][..], position),
        // What was a rate before a gap is none behind it.
        (
            &[(0, 0.0), (8000, 0.2), (16_000, 0.4), (116_001, 0.5)][..],
            position,
        ),
        // The clock starts from zero, and so does what there is of a last sample.
        (&[(50_000, 0.5)][..], position),
        // Two at one instant have no time for a rate between them.
        (&[(50_000, 0.0), (50_000, 0.5)][..], position),
    ] {
        let torque = torque(samples);
        assert!(
            (torque - expected).abs() < BOUND_NM,
            "{samples:?}: {torque} {expected}"
        );
    }
}

/// What a flipped bit of the past may ask for: 0.04 rad and 0.3 rad/s, to either side.
#[test]
fn what_the_vehicle_did_is_bounded_on_both_sides() {
    for sign in [1.0, -1.0] {
        for (turned, faster) in [(0.03, 0.2), (0.04, 0.3), (0.05, 0.4), (100.0, 100.0)] {
            let since = EgoMotion::new(
                Radians::from_rad(sign * turned),
                TurningRate::from_rad_per_s(sign * faster),
                Speed::from_m_per_s(20.0),
                Metres::from_m(6.0),
            );
            let bounded = (turned.min(0.04) * sign, faster.min(0.3) * sign);
            assert_eq!(since.turned, Radians::from_rad(bounded.0));
            assert_eq!(since.faster, TurningRate::from_rad_per_s(bounded.1));
        }
    }
}
