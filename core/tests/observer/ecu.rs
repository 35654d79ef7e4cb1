//! The ECU with a bar: K_hg read through it beside the truth, and the two ends of the bar at which an angle may be measured. The wheel on its
//! bar is stepped here in f64.

use std::f64::consts::TAU;

use haptic_core::controller::config::Setup;
use haptic_core::controller::params::Params;
use haptic_core::ecu::Boot;
use haptic_core::safety::faults::Fault;
use haptic_core::safety::modes::Mode;

use crate::rig::Rig;

/// J_c, B_c and what the tyres hold against, SI.
const COLUMN: [f64; 3] = [0.066, 0.52, 2.0];

/// A bar without friction.
const BAR: Params = Params {
    torque_sensor: 1.0,
    wheel_friction_nm: 0.0,
    ..Params::PAPER
};

/// How far the wheel gives before it slides, rad.
const GIVE_RAD: f64 = 0.0035;

/// Wheel and column, as they differ from a bend that they have settled in, and the hands of equation (8).
#[derive(Default)]
struct Car {
    wheel: [f64; 2],
    column: [f64; 2],
    /// What the hands do beyond what they did when the probe began; none of it without hands.
    hands_nm: f64,
    k_hg: Option<f64>,
    /// Friction of the wheel after Dahl, N.m, and the share of it that the wheel has given.
    friction_nm: f64,
    given: f64,
}

impl Car {
    /// A millisecond under a change of the guidance's torque; gives the change of T_tb.
    fn step(&mut self, guidance_nm: f64) -> f64 {
        let (k_tb, j_w, b_w) = (143.24, 0.044, 0.05);
        let [j_c, b_c, k_c] = COLUMN;
        for _ in 0..20 {
            let bar = k_tb * (self.wheel[0] - self.column[0]);
            let turned = 5e-5 * self.wheel[1] / GIVE_RAD;
            self.given += turned - turned.abs() * self.given;
            let resists = b_w * self.wheel[1] + self.friction_nm * self.given;
            let wheel = (self.hands_nm - bar - resists) / j_w;
            let column = (bar + guidance_nm - b_c * self.column[1] - k_c * self.column[0]) / j_c;
            for (body, acceleration) in [(&mut self.wheel, wheel), (&mut self.column, column)] {
                body[1] += 5e-5 * acceleration;
                body[0] += 5e-5 * body[1];
            }
            if let Some(k_hg) = self.k_hg {
                let towards = -k_hg * guidance_nm - self.wheel[0];
                self.hands_nm += 5e-5 / 0.1 * (towards - self.hands_nm);
            }
        }
        k_tb * (self.wheel[0] - self.column[0])
    }
}

/// An ECU that believes something of its sensor, in a bend, and then 14 s with the probe, less than it warns after; what its hands do, and the last K_hg with its deviation.
fn with_probe(believed: &Params, k_hg: Option<f64>, friction_nm: f64) -> (Vec<[f64; 2]>, Option<[f64; 2]>) {
    let mut rig = Rig::new(Some(&Setup::new(believed).unwrap()), Boot::default());
    rig.curve(0.6);
    rig.run(600);
    rig.engage = true;
    rig.run(3000);
    let (steady, straight) = (rig.applied, rig.wheel);
    let hands_before = 0.6 - steady + 0.002 * straight;
    rig.probe = true;
    let mut car = Car {
        k_hg,
        friction_nm,
        ..Car::default()
    };
    let mut seen = Vec::new();
    for _ in 0..14_000 {
        let bar = hands_before + car.step(rig.applied - steady);
        rig.driver = Some(bar);
        let twist = if believed.torque_sensor == 2.0 {
            (bar - hands_before) / 143.24
        } else {
            0.0
        };
        rig.wheel = straight + car.column[0] + twist;
        let step = rig.tick();
        assert_eq!(step.command.mode, Mode::Active, "{:?}", step.command.faults);
        seen.push([step.command.hands.unwrap().nm(), hands_before + car.hands_nm]);
    }
    let reading = rig.telemetry.unwrap().k_hg;
    (
        seen,
        reading.map(|reading| [reading.k_hg, reading.deviation].map(|ratio| ratio.si())),
    )
}

#[test]
fn k_hg_is_read_through_the_bar() {
    for k_hg in [0.6, 1.0] {
        for torque_sensor in [1.0, 2.0] {
            let believed = Params { torque_sensor, ..BAR };
            let (seen, reading) = with_probe(&believed, Some(k_hg), 0.0);
            let [found, deviation] = reading.unwrap();
            assert!(
                (found - k_hg).abs() < 0.05 && deviation < 0.5,
                "{k_hg}: {found} +- {deviation}"
            );
            // Three lags of 10 ms and half a millisecond at 2.5 Hz: 0.1 N.m turned by 27 degrees is off by 47 mN.m.
            let most = seen[5000..]
                .iter()
                .map(|[told, truth]| (told - truth).abs())
                .fold(0.0, f64::max);
            assert!(most < 0.6 * k_hg * 0.2 + 0.02, "{k_hg}: {most}");
        }
    }
}

/// Friction of the wheel, its inertia and the bar are told right, or not.
#[test]
fn what_is_read_behind_friction_is_right_within_its_deviation() {
    for k_hg in [0.6, 1.0] {
        for (friction_nm, [friction_is, inertia_is, bar_is], off) in [
            (0.05, [1.0; 3], 0.1),
            (0.2, [1.0; 3], 0.1),
            (0.2, [0.7, 1.0, 1.0], 1.0),
            (0.2, [1.3, 1.0, 1.0], 1.0),
            (0.2, [1.0, 0.7, 1.0], 1.0),
            (0.2, [1.0, 1.3, 1.0], 1.0),
            (0.2, [1.0, 1.0, 0.9], 0.1),
            (0.2, [1.0, 1.0, 1.1], 0.1),
        ] {
            let believed = Params {
                wheel_friction_nm: friction_is * friction_nm,
                wheel_inertia_kg_m2: inertia_is * 0.044,
                bar_stiffness_nm_per_rad: bar_is * 143.24,
                ..BAR
            };
            let (_, reading) = with_probe(&believed, Some(k_hg), friction_nm);
            // A hand that seems to do next to nothing is none, and has no reading.
            let Some([found, deviation]) = reading else {
                assert!(friction_is > 1.0, "{believed:?} {k_hg}");
                continue;
            };
            let error = (found - k_hg).abs();
            assert!(
                error < off && error < 2.0 * deviation && deviation < 0.5,
                "{believed:?} {k_hg}: {found} +- {deviation}"
            );
        }
    }
}

#[test]
fn a_free_wheel_has_no_k_hg() {
    let (seen, reading) = with_probe(&BAR, None, 0.0);
    assert_eq!(reading, None);
    let most = seen[5000..]
        .iter()
        .map(|[told, truth]| (told - truth).abs())
        .fold(0.0, f64::max);
    assert!(most < 0.05, "{most}");
    // Its bar moves, so that it is taken for hands where the parameters say so.
    assert!(with_probe(&Params::PAPER, None, 0.0).1.is_some());
}

/// What the observer says of a wheel that nobody holds varies by 0.1 N.m at most. Here bar and hands are the same but for lags too short to
/// count.
#[test]
fn a_torque_behind_a_bar_that_varies_by_less_than_0_1_nm_is_no_hand() {
    for (varies_nm, is_read) in [(0.095, false), (0.105, true)] {
        let believed = Params {
            torque_sensor: 2.0,
            wheel_damping_nm_s: 0.0,
            observer_bandwidth_rad_per_s: 400.0,
            ..BAR
        };
        let mut rig = Rig::new(Some(&Setup::new(&believed).unwrap()), Boot::default());
        rig.curve(0.6);
        rig.run(600);
        rig.engage = true;
        rig.run(3000);
        rig.probe = true;
        let before = 0.6 - rig.applied + 0.002 * rig.wheel;
        for ms in 0..14_000_u32 {
            let turns = 2.5e-3 * f64::from(ms);
            rig.driver = Some(before + 0.5 * varies_nm * (TAU * turns).sin());
            rig.tick();
        }
        assert_eq!(rig.telemetry.unwrap().k_hg.is_some(), is_read, "{varies_nm}");
    }
}

/// What the observer knew of the wheel ends with the column: the next frame is its first sample, where a wheel at rest passes on what its
/// bar says.
#[test]
fn the_observer_begins_anew_after_a_lost_column() {
    for side in [1.0, -1.0] {
        let mut rig = Rig::new(Some(&Setup::new(&BAR).unwrap()), Boot::default());
        rig.driver = Some(side * 3.0);
        let told = rig.run(1000).command.hands.unwrap().nm();
        assert!((told - side * 3.0).abs() < 0.01, "{told}");
        rig.silent[1] = true;
        assert_eq!(rig.run(200).command.hands, None);
        rig.silent[1] = false;
        rig.driver = Some(side * 0.5);
        let (_, step) = rig.run_until(100, |step| step.command.hands.is_some());
        assert_eq!(step.command.hands.unwrap().nm(), side * 0.5);
    }
}

/// A wheel on a soft bar that hands turn by 0.16 rad within a tenth of a second, with less torque than the column's friction: the column
/// stands still, and its large damping has nothing to say.
#[test]
fn the_check_of_the_column_goes_by_the_end_that_the_tyres_hold() {
    for side in [1.0, -1.0] {
        let mut of = Params {
            torque_sensor: 2.0,
            bar_stiffness_nm_per_rad: 5.0,
            ..BAR
        };
        of.vehicle.column_damping_nm_s = 9.0;
        let mut rig = Rig::new(Some(&Setup::new(&of).unwrap()), Boot::default());
        rig.run(600);
        let column_moves = |rig: &mut Rig, column_rad: f64| {
            let mut is_implausible = false;
            for ms in 0..400_i32 {
                let share = f64::from((ms - 100).clamp(-50, 50)) / 50.0;
                let torque = side * 0.4 * share;
                rig.driver = Some(torque);
                rig.wheel = side * column_rad * share + torque / 5.0;
                is_implausible |= rig.tick().command.faults.contains(Fault::ColumnImplausible);
            }
            is_implausible
        };
        assert!(!column_moves(&mut rig.clone(), 0.0), "{side}");
        // Where the column goes with it, nobody pays for its damping.
        assert!(column_moves(&mut rig, 0.16), "{side}");
    }
}
