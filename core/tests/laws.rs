//! The laws that ship beside equation (9), driver activity and FDCA, against float64 evaluations of the same discrete laws, and what the
//! monitor makes of each where it is wrong.

use haptic_core::controller::config::{Config, Setup};
use haptic_core::controller::inputs::{ColumnState, Input, Inputs, Motion, Request};
use haptic_core::controller::params::{FDCA, Params};
use haptic_core::controller::{Controller, ControllerState};
use haptic_core::ecu::Boot;
use haptic_core::ecu::injection::Region;
use haptic_core::law::activity::{Activity, LeastShare};
use haptic_core::law::fdca::{Car, Choices};
use haptic_core::law::{EgoMotion, LaneSample, LawState};
use haptic_core::quantity::{
    Instant, Metres, Micros, Radians, Ratio, Speed, Torque, TorquePerAcceleration, TurningRate,
    TurningRatePerAngle,
};
use haptic_core::safety::faults::{Fault, FaultSet};
use haptic_core::safety::modes::Mode;
use rand::rngs::SmallRng;
use rand::{RngExt, SeedableRng};

use crate::rig::{Rig, SPEED};

/// The filter of the rates in f64.
#[derive(Default)]
struct Rate {
    last: Option<(f64, f64)>,
    rate: f64,
}

impl Rate {
    fn take(&mut self, t_s: f64, value: f64, tau_s: f64) {
        self.rate = match self.last {
            Some((t, last)) if t_s - t <= 0.1 => (tau_s * self.rate + value - last) / (tau_s + t_s - t),
            _ => 0.0,
        };
        self.last = Some((t_s, value));
    }
}

const fn tau_s(p: &Params) -> f64 {
    1.0 / (2.0 * std::f64::consts::PI * p.rate_corner_hz)
}

#[test]
fn the_share_of_driver_activity_is_within_0_001_of_its_equation() {
    let mut rng = SmallRng::seed_from_u64(12);
    let law = Setup::PAPER.config.law;
    let (tau, weight) = (tau_s(&Params::PAPER), 0.01 / 0.5);
    for (scale, most) in [(1.0, 0.001), (0.1, 0.001), (0.01, 0.03)] {
        let (mut worst, mut least_seen) = (0.0_f64, 1.0_f64);
        let (mut activity, mut rate, mut sums) = (Activity::NEW, Rate::default(), [0.0_f64; 2]);
        let mut phase = 0.0_f64;
        let least = 0.3;
        for ms in (0..30_000_u32).step_by(10) {
            let t = f64::from(ms) * 1e-3;
            phase += rng.random_range(-0.04..0.04);
            // As the bus carries them.
            let count = |value: f64| (value * 4096.0).round() / 4096.0;
            let driver = count(scale * 2.0 * (1.3 * t + phase).sin());
            let guidance = count(scale * (0.8 * t).sin());
            let wheel = Radians::from_rad(scale * 0.3 * (0.9 * t).sin());
            rate.take(t, wheel.rad(), tau);
            let both = driver * guidance * rate.rate * rate.rate;
            sums[0] += weight * (both - sums[0]);
            sums[1] += weight * (both.abs() - sums[1]);
            let against = if sums[1] > 0.0 {
                (-sums[0] / sums[1]).max(0.0)
            } else {
                0.0
            };
            let expected = 1.0 - (1.0 - least) * against;
            let torques = [driver, guidance].map(Torque::from_nm);
            let now = Instant::from_us(1000 * ms);
            let least_share = LeastShare::from_si(least);
            activity.update(&law, least_share, now, wheel, torques);
            let share = activity.share(least_share).si();
            assert!((least - 1e-6..=1.0).contains(&share), "{share}");
            least_seen = least_seen.min(share);
            // Until something was felt, the first LSB decides.
            if ms > 200 {
                worst = worst.max((share - expected).abs());
            }
        }
        println!("share: at most {worst:.5} apart, least {least_seen:.3}");
        assert!(worst < most && least_seen < 0.35, "{scale}: {worst} {least_seen}");
    }
}

/// From the slowest speed that guides to the fastest that the bus carries; errors of all sizes.
#[test]
fn fdca_is_within_1_mnm_of_its_equation() {
    let mut rng = SmallRng::seed_from_u64(11);
    let mut worst = 0.0_f64;
    for drive in 0..300 {
        let p = Params {
            law: FDCA,
            fdca_k_y_rad_per_m: rng.random_range(0.0..2.0),
            fdca_k_psi: rng.random_range(0.0..10.0),
            fdca_lohs: rng.random_range(0.0..2.0),
            rate_corner_hz: [3.0, 10.0, 30.0][drive % 3],
            ..Params::PAPER
        };
        let law = Setup::new(&p).unwrap().config.law;
        let (mut state, mut rates) = (LawState::NEW, [Rate::default(), Rate::default()]);
        let v: f64 = rng.random_range(5.0..90.0);
        let g = v * p.vehicle.curvature_gain_per_m / (1.0 + p.vehicle.stability_factor_s2_per_m2 * v * v);
        let aligning = p.vehicle.aligning_gain_nm_s2_per_m;
        let (mut y, mut theta) = (0.0_f64, 0.0_f64);
        for k in 1..400_u32 {
            y = (y + rng.random_range(-0.05..0.05)).clamp(-4.0, 4.0);
            theta = (theta + rng.random_range(-0.005..0.005)).clamp(-0.5, 0.5);
            let at = Instant::from_us(8333 * k);
            let sample = LaneSample {
                e_y: Metres::from_m(y),
                e_theta: Radians::from_rad(theta),
                at,
            };
            let t_s = 8333e-6 * f64::from(k);
            rates[0].take(t_s, y, tau_s(&p));
            rates[1].take(t_s, theta, tau_s(&p));
            let turning = rng.random_range(-0.5..0.5);
            let car = Car {
                speed: Speed::from_m_per_s(v),
                turning_gain: TurningRatePerAngle::from_per_s(g),
                turning: TurningRate::from_rad_per_s(turning),
                aligning: TorquePerAcceleration::from_nm_s2_per_m(aligning),
            };
            let age_us = k * 7 % 31 * 1000;
            let now = at.after(Micros::from_us(age_us));
            // The filter of the rates is that of (9), which has its own oracle.
            let _ = law.step(&mut state, now, sample, &EgoMotion::STEADY);
            let asked = Choices::of(&law).demanded(&state, now, None, &car);
            let age_s = f64::from(age_us) * 1e-6;
            let [y_rate, theta_rate] = [rates[0].rate, rates[1].rate];
            let back =
                p.fdca_k_y_rad_per_m * (y + y_rate * age_s) + p.fdca_k_psi * (theta + theta_rate * age_s);
            let expected = aligning * v * (g * back + p.fdca_lohs * (turning + theta_rate));
            if expected.abs() < 100.0 {
                worst = worst.max((asked.nm() - expected).abs());
            }
        }
    }
    println!("FDCA: at most {:.4} mN.m apart", worst * 1e3);
    assert!(worst < 1e-3, "{worst} N.m");
}

/// The sample is old, and the vehicle has turned since: the kinematics that `law_oracle.rs` asks of (9), for FDCA.
#[test]
fn fdca_makes_up_for_what_the_vehicle_did_since_an_old_sample() {
    let mut rng = SmallRng::seed_from_u64(13);
    let p = Params {
        fdca_lohs: 1.5,
        ..BY_FDCA
    };
    let law = Setup::new(&p).unwrap().config.law;
    let (v, near, g, c) = (25.0, 7.5, 0.25, 0.9);
    let mut worst = 0.0_f64;
    for _ in 0..200 {
        let mut any = |most: f64| rng.random_range(-most..most);
        let (y, theta, y_rate, theta_rate) = (any(0.5), any(0.02), any(0.5), any(0.1));
        let (turned, faster, age_s, turning) = (any(0.03), any(0.2), 0.05 + any(0.05), any(0.3));
        let (mut state, mut sample) = (LawState::NEW, LaneSample::default());
        let mut rates = [Rate::default(), Rate::default()];
        for k in -30..=0 {
            let t_s = f64::from(k) * 0.008;
            sample = LaneSample {
                e_y: Metres::from_m(y + y_rate * t_s),
                e_theta: Radians::from_rad(theta + theta_rate * t_s),
                at: Instant::from_us((1_000_000 + 8000 * k) as u32),
            };
            let _ = law.step(&mut state, sample.at, sample, &EgoMotion::STEADY);
            rates[0].take(t_s, sample.e_y.m(), tau_s(&p));
            rates[1].take(t_s, sample.e_theta.rad(), tau_s(&p));
        }
        let ego = EgoMotion::new(
            Radians::from_rad(turned),
            TurningRate::from_rad_per_s(faster),
            Speed::from_m_per_s(v),
            Metres::from_m(near),
        );
        let car = Car {
            speed: Speed::from_m_per_s(v),
            turning_gain: TurningRatePerAngle::from_per_s(g),
            turning: TurningRate::from_rad_per_s(turning),
            aligning: TorquePerAcceleration::from_nm_s2_per_m(c),
        };
        let age = Micros::from_us((age_s * 1e6) as u32);
        let age_s = f64::from(age.us()) * 1e-6;
        let asked = Choices::of(&law).demanded(&state, sample.at.after(age), Some(&ego), &car);

        let [y_rate, theta_rate] = [rates[0].rate, rates[1].rate];
        let going = theta_rate * age_s;
        let aside = near * turned + v * turned * age_s / 3.0 - v * going * age_s / 2.0;
        let e_y = y + y_rate * age_s - aside;
        let e_theta = theta + going - turned;
        let back = p.fdca_k_y_rad_per_m * e_y + p.fdca_k_psi * e_theta;
        let expected = c * v * (g * back + p.fdca_lohs * (turning + theta_rate - faster));
        worst = worst.max((asked.nm() - expected).abs());
    }
    assert!(worst < 1e-3, "{worst} N.m");
}

/// A yaw error that jumps by 2 rad in a millisecond, at 90 m/s: more than any number holds, and never the other side.
#[test]
fn fdca_beyond_all_bounds_asks_for_the_most_on_its_side() {
    let p = Params {
        fdca_k_y_rad_per_m: 10.0,
        fdca_k_psi: 50.0,
        fdca_lohs: 2.0,
        rate_corner_hz: 60.0,
        ..BY_FDCA
    };
    let law = Setup::new(&p).unwrap().config.law;
    for sign in [1.0, -1.0] {
        for (jump, gain, aligning) in [(2.0, 0.0, 1.0), (100.0, 9.0, 20.0), (100.0, 0.1, 1.0)] {
            let mut state = LawState::NEW;
            let mut now = Instant::from_us(0);
            for (us, error) in [(0, 0.0), (1000, sign * jump)] {
                now = Instant::from_us(us);
                let sample = LaneSample {
                    e_y: Metres::from_m(error),
                    e_theta: Radians::from_rad(error),
                    at: now,
                };
                let _ = law.step(&mut state, now, sample, &EgoMotion::STEADY);
            }
            let car = Car {
                speed: Speed::from_m_per_s(90.0),
                turning_gain: TurningRatePerAngle::from_per_s(gain),
                turning: TurningRate::from_rad_per_s(sign * 0.5),
                aligning: TorquePerAcceleration::from_nm_s2_per_m(aligning),
            };
            let asked = sign * Choices::of(&law).demanded(&state, now, None, &car).nm();
            assert!(asked > 100.0, "{sign} {jump}: {asked}");
        }
    }
}

/// All of (9) is left to a driver who does nothing or helps; lambda_min to one who works against it all the time.
#[test]
fn who_helps_has_all_and_who_works_against_it_the_least_share() {
    let law = Setup::PAPER.config.law;
    for (driver, rad_per_s, expected) in [
        (0.0, 0.1, 1.0),
        (1.0, 0.1, 1.0),
        (-1.0, 0.1, 0.25),
        // Faster than any hand, and with a torque that no hand has: 45,000 (N.m.rad/s)^2.
        (100.0, 30.0, 1.0),
    ] {
        let mut activity = Activity::NEW;
        for ms in (0..2000_u32).step_by(10) {
            let wheel = Radians::from_rad(1e-3 * rad_per_s * f64::from(ms));
            let torques = [driver, 0.5].map(Torque::from_nm);
            let now = Instant::from_us(1000 * ms);
            activity.update(&law, LeastShare::from_si(0.25), now, wheel, torques);
        }
        let share = activity.share(LeastShare::from_si(0.25)).si();
        assert!((share - expected).abs() < 1e-5, "{driver}: {share}");
        // Whatever it was computed with, what is read bounds it.
        assert!(activity.share(LeastShare::from_si(0.6)).si() >= 0.6 - 1e-6);
    }
}

/// Two samples of the column, in which a driver works against the guidance; the wheel has turned between them.
fn share_after(apart_us: u32, least: f64) -> f64 {
    let (law, least) = (Setup::PAPER.config.law, LeastShare::from_si(least));
    let mut activity = Activity::NEW;
    for (us, wheel) in [(0, 0.0), (apart_us, 0.1)] {
        let torques = [-1.0, 0.5].map(Torque::from_nm);
        let wheel = Radians::from_rad(wheel);
        activity.update(&law, least, Instant::from_us(us), wheel, torques);
    }
    activity.share(least).si()
}

/// As for the errors: two samples further apart than 100 ms share no rate, and who moves nothing has no power.
#[test]
fn driver_activity_knows_no_rate_over_a_silence_of_the_column() {
    assert!((share_after(99_000, 0.25) - 0.25).abs() < 1e-5);
    assert!((share_after(101_000, 0.25) - 1.0).abs() < 1e-5);
}

/// lambda_min is kept within 0.0005, from none to all of it.
#[test]
fn the_least_share_is_the_nearest_thousandth() {
    for least in [0.0, 0.2567, 0.3334, 0.9996, 1.0] {
        let share = share_after(10_000, least);
        assert!((share - least).abs() < 0.0005 + 1e-6, "{least}: {share}");
    }
}

/// Active in a steady curve at 60 km/h with another law; what it asks for there, N.m.
fn in_curve(params: &Params, yaw_rate: f64) -> (Rig, f64) {
    let mut rig = Rig::new(Some(&Setup::new(params).unwrap()), Boot::default());
    let v = &params.vehicle;
    rig.turn(yaw_rate);
    let (e_y, e_theta) = (0.1, 0.7 * yaw_rate);
    rig.lane.e_y = Metres::from_m(e_y);
    rig.lane.e_theta = Radians::from_rad(e_theta);
    rig.aligning = v.aligning_gain_nm_s2_per_m * SPEED * yaw_rate;
    let turns = SPEED * v.curvature_gain_per_m / (1.0 + v.stability_factor_s2_per_m2 * SPEED * SPEED);
    let back = params.fdca_k_y_rad_per_m * e_y + params.fdca_k_psi * e_theta;
    let asked = if params.law == 2.0 {
        v.aligning_gain_nm_s2_per_m * SPEED * (turns * back + params.fdca_lohs * yaw_rate)
    } else {
        params.k_1 * (params.a_1 * e_y + params.a_3 * e_theta)
    };
    rig.run(600);
    rig.engage = true;
    let last = rig.run(1500);
    assert_eq!(last.command.mode, Mode::Active, "{:?}", last.command);
    (rig, asked)
}

/// The numbers are those of `docs/parameters.md`: 0 is equation (9), 1 is driver activity, 2 is FDCA.
const ACTIVITY: Params = Params {
    law: 1.0,
    ..Params::PAPER
};

const BY_FDCA: Params = Params {
    law: 2.0,
    fdca_lohs: 0.7,
    ..Params::PAPER
};

/// Equation (9) without the rate of the lateral error, whose place in memory says which law it is.
const WITHOUT_A_2: Params = Params {
    a_2: 0.0,
    ..Params::PAPER
};

#[test]
fn the_ecu_gives_what_the_chosen_law_asks_for() {
    for sign in [1.0, -1.0] {
        for params in [Params::PAPER, WITHOUT_A_2, ACTIVITY, BY_FDCA] {
            let (rig, asked) = in_curve(&params, sign * 0.05);
            // Nobody turns the wheel, so activity takes nothing.
            assert!((rig.applied - asked).abs() < 5e-3, "{} {asked}", rig.applied);
            assert!(asked.abs() > 0.29, "{asked}");
        }
    }
}

/// What the controller without its bus applies after 3 s beside a driver who holds against all of it, 0.6 m beside the line, while the
/// wheel trembles by 2 mrad; a vehicle frame comes every so many milliseconds.
fn applied_against_a_driver(params: &Params, speed: f64, vehicle_every_ms: u32) -> f64 {
    let controller = Controller::new(Config::new(params).unwrap());
    let mut state = ControllerState::engaged(Instant::from_us(0));
    let mut applied = Torque::ZERO;
    for ms in 1..=3000_u32 {
        let now = Instant::from_us(1000 * ms);
        let lane = LaneSample {
            e_y: Metres::from_m(0.6),
            e_theta: Radians::ZERO,
            at: now,
        };
        let column = ColumnState {
            driver_torque: applied.opposite(),
            wheel_angle: Radians::from_rad(0.002 * (f64::from(ms) * 0.0126).sin()),
        };
        let motion = Motion::new([Speed::from_m_per_s(speed); 2], None);
        let inputs = Inputs {
            lane: Input::New(lane),
            column: Input::New(column),
            motion: if ms % vehicle_every_ms == 1 % vehicle_every_ms {
                Input::New(motion)
            } else {
                Input::Held(motion)
            },
            request: Input::New(Request {
                engage: true,
                authority: Ratio::from_si(1.0),
                probe: false,
            }),
            faults: FaultSet::NONE,
        };
        let command = controller.step(&mut state, now, applied, &inputs);
        assert_eq!(command.mode, Mode::Active, "{ms} {command:?}");
        applied = command.torque;
    }
    applied.nm()
}

/// Driver activity leaves lambda_min of `K_1*a_1*e_y` to one who works against it all the time, (9) and FDCA all that they ask for;
/// beyond 130 km/h the schedule leaves half of each. FDCA has no other term than `c*v*g*k_y*e_y` here.
#[test]
fn what_a_driver_who_works_against_it_is_left_with() {
    for (speed, by_speed) in [(SPEED, 1.0), (36.2, 0.5)] {
        for every_ms in [1, 10] {
            for (law, least) in [(0.0, 0.3), (1.0, 0.3), (1.0, 0.0), (2.0, 0.3)] {
                let p = Params {
                    law,
                    activity_lambda_min: least,
                    high_speed_share: 0.5,
                    ..Params::PAPER
                };
                let v = &p.vehicle;
                let g = speed * v.curvature_gain_per_m / (1.0 + v.stability_factor_s2_per_m2 * speed * speed);
                let all = if law == 2.0 {
                    v.aligning_gain_nm_s2_per_m * speed * g * p.fdca_k_y_rad_per_m * 0.6
                } else {
                    p.k_1 * p.a_1 * 0.6
                };
                let left = if law == 1.0 { least } else { 1.0 };
                let applied = applied_against_a_driver(&p, speed, every_ms);
                // By the wheel the trembling turns the vehicle by 0.5 mrad/s, for which FDCA asks for 18 mN.m.
                let within = if law == 2.0 { 0.02 } else { 1e-3 };
                assert!(
                    (applied - by_speed * left * all).abs() < within,
                    "{law} {speed} {every_ms}: {applied}, not {by_speed} * {left} * {all}"
                );
            }
        }
    }
}

/// The camera is silent: 0.5 of the trust a second is lost, and the curve goes on.
#[test]
fn fdca_goes_on_without_pictures() {
    for sign in [1.0, -1.0] {
        let (mut rig, asked) = in_curve(&BY_FDCA, sign * 0.05);
        rig.silent[0] = true;
        for ms in 1..=500 {
            let command = rig.tick().command;
            assert_eq!(command.mode, Mode::Active, "{ms}");
            let (t, share) = (f64::from(ms) * 1e-3, rig.applied / asked);
            // A silence of the camera is noticed within 45 ms.
            let (least, most) = (1.0 - 0.5 * t, 1.0 - 0.5 * (t - 0.045).max(0.0));
            assert!((least - 0.01..most + 0.01).contains(&share), "{ms}: {share}");
        }
    }
}

/// The vehicle begins to turn by 20 mrad/s more, for which FDCA asks for 0.23 N.m at once. A picture of 60 ms before knows nothing of it:
/// by then its yaw error falls by as much, so that the path is the same.
#[test]
fn fdca_knows_that_an_old_picture_is_old() {
    for sign in [1.0, -1.0] {
        for (age_ms, grows) in [(0, true), (60, false)] {
            let (mut rig, asked) = in_curve(&BY_FDCA, sign * 0.05);
            rig.lane.age = Micros::from_ms(age_ms);
            rig.run(500);
            rig.turn(sign * 0.07);
            rig.run(40);
            let grown = sign * (rig.applied - asked);
            let (least, most) = if grows { (0.08, 0.17) } else { (-0.05, 0.03) };
            assert!((least..most).contains(&grown), "{age_ms}: {grown}");
        }
    }
}

/// How many steps pass until the monitor refuses a law that asks for something else; none within 2 s.
fn refused_after(rig: &Rig, lie: f64) -> Option<u32> {
    let mut rig = rig.clone();
    rig.ecu.force_law(Some(Torque::from_nm(lie)));
    (0..2000).find(|_| rig.tick().command.faults.contains(Fault::Monitor))
}

/// The band is 0.3 N.m around what the monitor computes itself, with zero in it, and may be left for 20 ms. The torque falls by 8 and
/// grows by 4 N.m/s, 1.2 N.m in 250 ms at most.
#[test]
fn the_monitor_knows_each_law() {
    for sign in [1.0, -1.0] {
        for params in [Params::PAPER, WITHOUT_A_2, ACTIVITY, BY_FDCA] {
            let (rig, asked) = in_curve(&params, sign * 0.05);
            for harmless in [asked, 0.5 * asked, 0.0, asked + sign * 0.28, -sign * 0.28] {
                assert_eq!(
                    refused_after(&rig, harmless),
                    None,
                    "{} {harmless} {asked}",
                    params.law
                );
            }
            // From the edge of the band on it takes 20 ms; the way there is 0.3 N.m with 4 N.m/s.
            let beyond = refused_after(&rig, asked + sign * 0.45).unwrap();
            assert!((93..=103).contains(&beyond), "{} {beyond}", params.law);
            // To zero with 8 N.m/s, then 0.3 N.m.
            let turned = refused_after(&rig, -asked - sign * 0.2).unwrap();
            let way = (1000.0 * (asked.abs() / 8.0 + 0.3 / 4.0)) as u32 + 20;
            assert!(turned.abs_diff(way) <= 6, "{} {turned} {way}", params.law);
        }
    }
}

/// A frame says what FDCA stands on, each without a word of the others: a monitor that took no notice would refuse the torque that
/// follows.
#[test]
fn the_monitor_follows_vehicle_and_picture() {
    let (rig, asked) = in_curve(&BY_FDCA, 0.03);
    type Turn = fn(&mut Rig);
    let turns: [(&str, Turn); 3] = [
        ("the yaw rate, and the wheel with it", |rig| rig.turn(0.07)),
        ("the speed", |rig| rig.speeds = [SPEED + 0.9; 2]),
        ("the picture", |rig| rig.lane.e_theta = Radians::from_rad(0.055)),
    ];
    for (what, turn) in turns {
        let mut rig = rig.clone();
        turn(&mut rig);
        for _ in 0..400 {
            let command = rig.tick().command;
            assert!(!command.faults.contains(Fault::Monitor), "{what}");
        }
        println!("{what}: from {asked:.3} to {:.3} N.m", rig.applied);
    }
}

/// What the monitor needs for FDCA is compared where it is read, with each picture.
#[test]
fn every_flip_in_what_the_monitor_needs_for_fdca_ends_guidance_with_the_next_picture() {
    let (rig, _) = in_curve(&BY_FDCA, 0.05);
    let bits = rig.ecu.redundant_bits(Region::Fdca);
    for bit in 0..bits {
        let mut rig = rig.clone();
        rig.ecu.flip_bit(Region::Fdca, bit);
        let command = rig.run(10).command;
        assert_eq!(
            (command.mode, command.torque),
            (Mode::Fault, Torque::ZERO),
            "bit {bit}"
        );
    }
    assert_eq!(bits, 2 * 12 * 32);
}
