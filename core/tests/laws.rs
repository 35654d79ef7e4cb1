//! The law that ships beside equation (9), driver activity, against a float64 evaluation of the same discrete law and in drives in
//! which the hands stop and start; and what the monitor makes of each law where it is wrong.

use haptic_core::controller::config::{Config, Setup};
use haptic_core::controller::inputs::{ColumnState, Input, Inputs, Motion, Request};
use haptic_core::controller::params::{DRIVER_ACTIVITY, Params, VehicleParams};
use haptic_core::controller::{Command, Controller, ControllerState};
use haptic_core::ecu::Boot;
use haptic_core::ecu::injection::Region;
use haptic_core::lane::LaneSample;
use haptic_core::law::Coefficients;
use haptic_core::law::activity::{Activity, Sample};
use haptic_core::quantity::{Instant, Metres, Radians, Ratio, Speed, Torque};
use haptic_core::safety::faults::{Fault, FaultSet};
use haptic_core::safety::modes::Mode;
use rand::rngs::SmallRng;
use rand::{RngExt, SeedableRng};

use crate::rig::{Rig, SPEED};

/// The number is that of `docs/parameters.md`: 0 is equation (9), 1 is driver activity.
const ACTIVITY: Params = Params {
    law: 1.0,
    ..Params::PAPER
};

/// What 0.1 N.m each make beside 10 mrad/s, to the nearest power of two.
const NOBODY: f64 = 1.0 / 1_048_576.0;

/// No hand turns a wheel faster than 8 rad/s: more counts as that.
const FASTEST: f64 = 8.0;

fn coefficients(rate_corner_hz: f64) -> Coefficients {
    let params = Params {
        rate_corner_hz,
        ..Params::PAPER
    };
    *Config::new(&params).unwrap().law().unwrap().coefficients()
}

/// A sample that came at so many microseconds, beside the torques of the driver and of (9).
fn sample(us: u32, wheel: Radians, torques_nm: [f64; 2]) -> Sample {
    Sample {
        at: Instant::from_us(us),
        wheel,
        torques: torques_nm.map(Torque::from_nm),
    }
}

/// Driver activity in f64.
#[derive(Default)]
struct Expected {
    last: Option<(f64, f64)>,
    rate: f64,
    agreement: f64,
    size: f64,
}

impl Expected {
    fn share(&mut self, at_s: f64, wheel: f64, torques: f64, least: f64, corner_hz: f64) -> f64 {
        let tau_s = 1.0 / (2.0 * std::f64::consts::PI * corner_hz);
        let passed_s = self.last.map_or(0.1, |(at, _)| f64::min(at_s - at, 0.1));
        self.rate = match self.last {
            Some((_, last)) if passed_s < 0.1 => (tau_s * self.rate + wheel - last) / (tau_s + passed_s),
            _ => 0.0,
        };
        self.last = Some((at_s, wheel));
        let both = torques * self.rate.abs().min(FASTEST).powi(2);
        self.size += passed_s / 1.0 * (both.abs() - self.size);
        let agreement = self.agreement + passed_s / 0.5 * (both - self.agreement);
        self.agreement = agreement.clamp(-self.size, self.size);
        1.0 - (1.0 - least) * (-self.agreement / (self.size + NOBODY)).clamp(0.0, 1.0)
    }
}

/// Hands of all strengths, at the corners of the filter of the rates and of the range of lambda_min.
#[test]
fn the_share_of_driver_activity_is_within_0_001_of_its_equation() {
    let mut rng = SmallRng::seed_from_u64(12);
    let mut worst = 0.0_f64;
    for (scale, corner_hz, least) in [
        (3.0, 10.0, 0.3),
        (1.0, 10.0, 0.05),
        (1.0, 0.5, 0.3),
        (1.0, 60.0, 0.05),
        (0.1, 10.0, 0.3),
        (0.03, 10.0, 0.05),
        (0.01, 10.0, 1.0),
    ] {
        let (filter, mut activity, mut expected) =
            (coefficients(corner_hz), Activity::NEW, Expected::default());
        let (mut phase, mut least_seen) = (0.0_f64, 1.0_f64);
        for ms in (0..30_000_u32).step_by(2) {
            let t = f64::from(ms) * 1e-3;
            phase += rng.random_range(-0.02..0.02);
            // As the bus carries them.
            let count = |value: f64| (value * 4096.0).round() / 4096.0;
            let driver = count(scale * 2.0 * (1.3 * t + phase).sin());
            let asked = count(scale * (0.8 * t).sin());
            let wheel = Radians::from_rad(scale * 0.3 * (0.9 * t).sin());
            activity.feel(&filter, &sample(1000 * ms, wheel, [driver, asked]));
            let share = activity.share(Ratio::from_si(least)).si();
            let in_f64 = expected.share(t, wheel.rad(), driver * asked, least, corner_hz);
            assert!((least - 1e-6..=1.0).contains(&share), "{share}");
            least_seen = least_seen.min(share);
            worst = worst.max((share - in_f64).abs());
        }
        println!("{scale}, {corner_hz} Hz: at most {worst:.5} apart, least {least_seen:.3}");
        let is_felt = scale > 0.2;
        assert!(!is_felt || least_seen < least + 0.05, "{scale}: {least_seen}");
    }
    assert!(worst < 0.001, "{worst}");
}

/// All of (9) is left to a driver who does nothing or helps; lambda_min to one who works against it all the time.
#[test]
fn who_helps_has_all_and_who_works_against_it_the_least_share() {
    for (driver, rad_per_s, expected) in [
        (0.0, 0.1, 1.0),
        (1.0, 0.1, 1.0),
        (-1.0, 0.1, 0.25),
        // Faster than any hand, and with a torque that no hand has: 45,000 (N.m.rad/s)^2.
        (100.0, 30.0, 1.0),
        (-100.0, 30.0, 0.25),
    ] {
        for sign in [1.0, -1.0] {
            let mut activity = Activity::NEW;
            for ms in (0..2000_u32).step_by(2) {
                let wheel = Radians::from_rad(1e-3 * rad_per_s * f64::from(ms));
                let felt = sample(1000 * ms, wheel, [sign * driver, sign * 0.5]);
                activity.feel(&coefficients(10.0), &felt);
            }
            let share = activity.share(Ratio::from_si(0.25)).si();
            assert!((share - expected).abs() < 1e-3, "{driver}: {share}");
            // Whatever it was computed with, what is read bounds it.
            assert!(activity.share(Ratio::from_si(0.6)).si() >= 0.6 - 1e-6);
        }
    }
}

/// Help at 4 rad/s, and then work against it at more than a hand's 8 rad/s, which counts as 8: how much of the help that outweighs
/// depends on where the rate is cut.
#[test]
fn a_rate_that_no_hand_has_counts_as_the_fastest_hand() {
    for (turns, helps) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
        for fast in [9.5, 20.0] {
            let (mut activity, mut expected) = (Activity::NEW, Expected::default());
            let mut wheel = 0.0;
            for ms in (0..1200_u32).step_by(2) {
                let is_fast = ms >= 1000;
                wheel += turns * 2e-3 * if is_fast { fast } else { 4.0 };
                let torques = [if is_fast { -helps } else { helps }, helps];
                let at = sample(1000 * ms, Radians::from_rad(wheel), torques);
                activity.feel(&coefficients(10.0), &at);
                let share = activity.share(Ratio::from_si(0.05)).si();
                let product = torques[0] * torques[1];
                let in_f64 = expected.share(1e-3 * f64::from(ms), wheel, product, 0.05, 10.0);
                assert!(
                    (share - in_f64).abs() < 2e-3,
                    "{fast} rad/s, {ms} ms: {share}, not {in_f64}"
                );
            }
            // By the equations of the low-passes: A is 10.1*e^(-2t) - 64*(1 - e^(-2t)) and B 10.1*e^(-t) + 64*(1 - e^(-t)) after
            // t = 0.2 s, less the time constant of 16 ms in which the rate settles.
            let share = activity.share(Ratio::from_si(0.05)).si();
            assert!((0.30..0.42).contains(&share), "{fast} rad/s: {share}");
        }
    }
}

/// Two samples of the column so far apart share a rate up to 100 ms, and none beyond: who moves nothing has no power.
#[test]
fn driver_activity_knows_no_rate_over_a_silence_of_the_column() {
    let share_after = |apart_us: u32| {
        let mut activity = Activity::NEW;
        for (us, wheel) in [(0, 0.0), (apart_us, 0.1)] {
            let wheel = Radians::from_rad(wheel);
            activity.feel(&coefficients(10.0), &sample(us, wheel, [-1.0, 0.5]));
        }
        activity.share(Ratio::from_si(0.25)).si()
    };
    assert!((share_after(99_000) - 0.25).abs() < 1e-4);
    assert_eq!(share_after(101_000), 1.0);
}

/// Active in a steady curve at 60 km/h; what (9) asks for there, N.m.
fn in_curve(params: &Params, yaw_rate: f64) -> (Rig, f64) {
    let mut rig = Rig::new(Some(&Setup::new(params).unwrap()), Boot::default());
    rig.turn(yaw_rate);
    let (e_y, e_theta) = (0.1, 0.7 * yaw_rate);
    rig.lane.e_y = Metres::from_m(e_y);
    rig.lane.e_theta = Radians::from_rad(e_theta);
    rig.aligning = params.vehicle.aligning_gain_nm_s2_per_m * SPEED * yaw_rate;
    let asked = params.k_1 * (params.a_1 * e_y + params.a_3 * e_theta);
    rig.run(600);
    rig.engage = true;
    let last = rig.run(1500);
    assert_eq!(last.command.mode, Mode::Active, "{:?}", last.command);
    (rig, asked)
}

#[test]
fn the_ecu_gives_what_the_chosen_law_asks_for() {
    for sign in [1.0, -1.0] {
        for params in [Params::PAPER, ACTIVITY] {
            let (rig, asked) = in_curve(&params, sign * 0.05);
            // Nobody turns the wheel, so activity takes nothing.
            assert!((rig.applied - asked).abs() < 5e-3, "{} {asked}", rig.applied);
            assert!(asked.abs() > 0.29, "{asked}");
        }
    }
}

/// How a driver treats the wheel.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Hands {
    /// Works against 0.3 N.m of guidance with 0.4 N.m, and moves the wheel by 3 mrad at 8 Hz.
    Against,
    /// Works in the direction of the guidance.
    With,
    /// Holds against it, and the wheel stands.
    Holding,
    /// Lets go; the wheel trembles.
    Off,
}

/// A controller without its bus 0.6 m beside the line, at so many m/s; a vehicle frame comes every so many milliseconds.
struct Drive {
    controller: Controller,
    state: ControllerState,
    ms: u32,
    applied: Torque,
    speed: f64,
    vehicle_every_ms: u32,
    sign: f64,
    engage: bool,
    authority: f64,
}

impl Drive {
    fn new(params: &Params, sign: f64) -> Self {
        Self {
            controller: Controller::new(Config::new(params).unwrap()),
            state: ControllerState::engaged(Instant::from_us(0)),
            ms: 0,
            applied: Torque::ZERO,
            speed: SPEED,
            vehicle_every_ms: 10,
            sign,
            engage: true,
            authority: 1.0,
        }
    }

    fn step(&mut self, hands: Hands) -> Command {
        self.ms += 1;
        let ms = f64::from(self.ms);
        let now = Instant::from_us(1000 * self.ms);
        let motion = Motion::new([Speed::from_m_per_s(self.speed); 2], None);
        // A hand is never still to the bit.
        let driver = match hands {
            Hands::Against | Hands::Holding => -0.4 + 1e-3 * (0.1 * ms).sin(),
            Hands::With => 0.2 + 1e-3 * (0.1 * ms).sin(),
            Hands::Off => 0.0,
        };
        let wheel = match hands {
            Hands::Holding => 0.0,
            _ => 0.003 * (std::f64::consts::TAU * 8e-3 * ms).sin(),
        };
        let column = ColumnState {
            driver_torque: Torque::from_nm(self.sign * driver),
            wheel_angle: Radians::from_rad(wheel),
        };
        let inputs = Inputs {
            lane: Input::New(LaneSample {
                e_y: Metres::from_m(self.sign * 0.6),
                e_theta: Radians::ZERO,
                at: now,
            }),
            column: if self.ms.is_multiple_of(2) {
                Input::New(column)
            } else {
                Input::Held(column)
            },
            motion: if self.ms % self.vehicle_every_ms == 1 % self.vehicle_every_ms {
                Input::New(motion)
            } else {
                Input::Held(motion)
            },
            request: Input::New(Request {
                engage: self.engage,
                authority: Ratio::from_si(self.authority),
                probe: false,
            }),
            faults: FaultSet::NONE,
        };
        let command = self.controller.step(&mut self.state, now, self.applied, &inputs);
        self.applied = command.torque;
        command
    }

    /// So long with these hands; what share of the 0.3 N.m that (9) asks for is applied at the end.
    fn share_after(&mut self, ms: u32, hands: Hands) -> f64 {
        for _ in 0..ms {
            let command = self.step(hands);
            assert_eq!(command.mode, Mode::Active, "{} ms: {command:?}", self.ms);
        }
        self.sign * self.applied.nm() / 0.3
    }
}

/// Another steering ratio, tyres and trail: a light car and a van.
const VEHICLES: [VehicleParams; 3] = [
    Params::PAPER.vehicle,
    VehicleParams {
        curvature_gain_per_m: 0.03,
        stability_factor_s2_per_m2: 0.0005,
        aligning_gain_nm_s2_per_m: 0.4,
        column_damping_nm_s: 0.2,
        ..Params::PAPER.vehicle
    },
    VehicleParams {
        curvature_gain_per_m: 0.014,
        stability_factor_s2_per_m2: 0.004,
        aligning_gain_nm_s2_per_m: 2.5,
        column_damping_nm_s: 1.5,
        ..Params::PAPER.vehicle
    },
];

/// Driver activity leaves lambda_min of `K_1*a_1*e_y` to one who works against it all the time, (9) all; beyond 130 km/h the schedule
/// leaves half of each. The products of `K_1` and a are at both ends of what is legal beside the one that acts here.
#[test]
fn what_a_driver_who_works_against_it_is_left_with() {
    for (vehicle, (a_2, a_3, a_4)) in
        VEHICLES
            .into_iter()
            .zip([(0.05, 40.0, 1.0), (0.0, 0.0, 0.0), (3.0, 100.0, 3.0)])
    {
        for (speed, by_speed) in [(SPEED, 1.0), (36.2, 0.5)] {
            for (vehicle_every_ms, sign) in [(1, 1.0), (10, -1.0)] {
                for (law, least) in [(0.0, 0.3), (1.0, 0.3), (1.0, 0.05), (1.0, 1.0)] {
                    let params = Params {
                        law,
                        a_2,
                        a_3,
                        a_4,
                        activity_lambda_min: least,
                        high_speed_share: 0.5,
                        vehicle,
                        ..Params::PAPER
                    };
                    let mut drive = Drive::new(&params, sign);
                    (drive.speed, drive.vehicle_every_ms) = (speed, vehicle_every_ms);
                    let share = drive.share_after(3000, Hands::Against);
                    let left = by_speed * if law == 1.0 { least } else { 1.0 };
                    // The power falls and rises at 16 Hz, which the low-passes leave 1.5 % of.
                    assert!(
                        (left - 1e-3..left + 0.03).contains(&share),
                        "{law} {speed} {vehicle_every_ms}: {share}, not {left}"
                    );
                }
            }
        }
    }
}

/// What was taken away comes back by half within 0.7 s and by 95 % within 3 s, whether the hands let go, the wheel stands, or they
/// help; and is taken again where they start anew. With the least share that may be chosen too, which once latched.
#[test]
fn what_was_taken_comes_back_when_the_hands_stop() {
    for (least, sign) in [(0.05, 1.0), (0.05, -1.0), (0.3, 1.0)] {
        for hands in [Hands::Off, Hands::Holding, Hands::With] {
            let params = Params {
                activity_lambda_min: least,
                ..ACTIVITY
            };
            let mut drive = Drive::new(&params, sign);
            for again in 0..3 {
                let against = drive.share_after(2000, Hands::Against);
                assert!(
                    (least - 1e-3..least + 0.03).contains(&against),
                    "{again}: {against}"
                );
                // By e^(-t/1 s), after 0.06 s in which the filter forgets the rate; who helps is answered sooner.
                let half = drive.share_after(750, hands);
                let expected = 1.0 - (1.0 - least) * f64::exp(-0.75);
                assert!(half > expected - 0.03, "{hands:?} {again}: {half}");
                assert!(
                    hands == Hands::With || half < expected + 0.03,
                    "{hands:?} {again}: {half}"
                );
                let back = drive.share_after(2250, hands);
                assert!(back > 0.95, "{hands:?} {again}: {back}");
            }
        }
    }
}

/// P_h is what (9) asks for: a driver is felt while the host leaves nothing of it, and the share does not feed back on itself.
#[test]
fn a_driver_is_felt_whatever_of_the_torque_is_applied() {
    let mut drive = Drive::new(&ACTIVITY, 1.0);
    drive.authority = 0.0;
    assert_eq!(drive.share_after(2000, Hands::Against), 0.0);
    // Nothing new is felt from here on: 0.1 s later a tenth of what was taken is back.
    drive.authority = 1.0;
    let share = drive.share_after(100, Hands::Holding);
    let expected = 1.0 - 0.7 * f64::exp(-0.1);
    assert!((share - expected).abs() < 0.04, "{share}, not {expected}");
}

/// What was felt in one drive is forgotten where guidance begins anew.
#[test]
fn guidance_begins_with_all_of_it() {
    let mut drive = Drive::new(&ACTIVITY, -1.0);
    let before = drive.share_after(2000, Hands::Against);
    assert!(before < 0.33, "{before}");
    drive.engage = false;
    // Off, through Fade into Standby, and ready again after 0.5 s. The wheel stands, so that nothing is felt meanwhile.
    for _ in 0..600 {
        drive.step(Hands::Holding);
    }
    drive.engage = true;
    assert_eq!(drive.step(Hands::Holding).mode, Mode::Active);
    let share = drive.share_after(100, Hands::Holding);
    assert!(share > 0.999, "{share}");
}

/// Both copies may agree on a law that there is not: a memory fault, as any other damage. Bit 0 makes the other law of it.
#[test]
fn a_law_that_there_is_not_is_a_memory_fault() {
    let (rig, _) = in_curve(&Params::PAPER, 0.05);
    let half = rig.ecu.redundant_bits(Region::Config) / 2;
    for bit in 0..32 {
        let mut rig = rig.clone();
        rig.ecu.flip_bit(Region::Config, bit);
        rig.ecu.flip_bit(Region::Config, half + bit);
        let command = rig.tick().command;
        let is_lost = command.mode == Mode::Fault && command.faults.contains(Fault::Memory);
        assert_eq!(is_lost, bit > 0, "{bit}: {command:?}");
        assert!(!is_lost || command.torque == Torque::ZERO);
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
fn the_monitor_knows_equation_9_of_which_each_law_is_a_share() {
    for sign in [1.0, -1.0] {
        for params in [Params::PAPER, ACTIVITY] {
            assert!(params.law == 0.0 || params.law == DRIVER_ACTIVITY);
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
