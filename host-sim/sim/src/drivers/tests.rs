//! Each driver and habit against figures that were worked out apart: a program in Python, float64, from the equations of the
//! documents (the continuous ones by Runge and Kutta's method), or by hand; and each in the paper's car.

use super::*;
use crate::Simulation;
use crate::guidance::{LaneErrors, OwnLaw};
use crate::laws::{Gains, LAWS, Law};
use crate::parts::PaperVehicle;

/// What the program in Python shows its drivers.
fn view(step: u32) -> DriverView {
    let t = f64::from(step) / 1000.0;
    DriverView {
        step,
        lane: LaneErrors {
            e_y_m: 0.3 * (0.9 * t).sin(),
            e_theta_rad: 0.04 * (0.6 * t + 1.0).sin(),
        },
        points_m: [0.0; 2],
        wheel_angle_rad: 0.12 * (0.8 * t).sin(),
        wheel_rate_rad_per_s: 0.096 * (0.8 * t).cos(),
        speed_m_per_s: 50.0 / 3.0,
        yaw_rate_rad_per_s: 0.0,
        guidance_torque_nm: 0.5 * (0.7 * t + 0.3).sin(),
        warning: false,
        asks_for_hands: false,
        is_lost: (4000..6000).contains(&step),
    }
}

fn values(kind: &Kind<dyn AnyDriver>, changed: &[(&str, f64)]) -> Vec<f64> {
    let value = |p: &crate::kind::Parameter| {
        let found = changed.iter().find(|(name, _)| *name == p.name);
        found.map_or(p.default, |(_, value)| *value)
    };
    kind.parameters.iter().map(value).collect()
}

fn driver(scenario: &Scenario, name: &str, changed: &[(&str, f64)]) -> Box<dyn AnyDriver> {
    let kind = DRIVERS.iter().find(|kind| kind.name == name).unwrap();
    let Make::Part(make) = kind.make else {
        panic!("{name}")
    };
    make(scenario, &values(kind, changed)).unwrap()
}

fn with_habit(name: &str, changed: &[(&str, f64)], inner: Box<dyn AnyDriver>) -> Box<dyn AnyDriver> {
    let kind = HABITS.iter().find(|kind| kind.name == name).unwrap();
    let Make::Around(make) = kind.make else {
        panic!("{name}")
    };
    make(&Scenario::default(), &values(kind, changed), inner)
}

/// A driver whose torque is given by time, or who answers with what he sees.
#[derive(Clone)]
struct Given(fn(&DriverView) -> f64);

impl Driver for Given {
    fn look_ahead_s(&self) -> [f64; 2] {
        [0.3, 1.0]
    }

    fn step(&mut self, view: &DriverView) -> f64 {
        self.0(view)
    }
}

fn swings() -> Box<dyn AnyDriver> {
    Box::new(Given(|view| 0.3 * (1.1 * view.time_s()).sin()))
}

/// A driver, how near the torque has to be, N.m, and the torque after every second, N.m.
const TORQUES: [(&str, f64, &str); 5] = [
    (
        "cybernetic",
        5e-3,
        "1.32120382 0.67209636 -0.61153937 -1.52844393 -1.40301634 -0.3529943 0.79375955 1.12985315 0.39017091 -0.79983342",
    ),
    (
        "two_point",
        1e-3,
        "0.47894309 0.36677707 0.19197761 0.00242918 -0.14335572 -0.19941911 -0.15375515 -0.03164481 0.12206777 0.26777988",
    ),
    (
        "relay",
        1e-7,
        "0.0 0.0 0.0 -0.03171068 0.0 0.0 0.0 0.0 -0.62883041 0.0",
    ),
    (
        "trust",
        1e-7,
        "0.06739483 -0.00540234 -0.22680763 -0.31315352 0.03386317 0.51310081 0.69220709 0.36388125 -0.24176144 -0.64645253",
    ),
    (
        "stiffening",
        1e-7,
        "0.26736221 0.24254892 -0.04147697 -0.19040559 -0.13788573 0.11767122 0.21011009 -0.04426378 -0.36335223 -0.36083079",
    ),
];

#[test]
fn drivers_answer_as_a_program_from_their_equations_does() {
    let scenario = Scenario::default();
    for (name, near, expected) in TORQUES {
        let mut driver = match name {
            "cybernetic" => driver(&scenario, name, &[("k_hg", 0.25)]),
            "two_point" => driver(&scenario, name, &[("bias_rad", 0.02)]),
            "relay" => driver(&scenario, name, &[]),
            _ => with_habit(name, &[], swings()),
        };
        let expected: Vec<f64> = expected.split(' ').map(|text| text.parse().unwrap()).collect();
        for step in 0..=10_000 {
            let torque_nm = driver.step(&view(step));
            if step > 0 && step % 1000 == 0 {
                let wanted = expected[step as usize / 1000 - 1];
                assert!(
                    (torque_nm - wanted).abs() < near,
                    "{name} at {step}: {torque_nm} {wanted}"
                );
            }
        }
    }
}

/// The program's far angle is 15/300, that of an arc of 300 m to the left; on a straight it is 0, and what is left answers alike to both
/// sides.
#[test]
fn the_far_angle_may_be_that_of_the_curvature() {
    let scenario = Scenario::default();
    let road = scenario.course().centreline();
    let arc_m = (0..3000)
        .map(f64::from)
        .find(|s_m| (road.at(*s_m).1 - 1.0 / 300.0).abs() < 1e-12);
    let torques = |far_m: f64, side: f64| -> Vec<f64> {
        let mut driver = driver(&scenario, "cybernetic_curvature", &[("k_hg", 0.25)]);
        let answer = |step| {
            let mut seen = view(step);
            seen.points_m[1] = far_m;
            (seen.lane.e_y_m, seen.wheel_angle_rad) = (side * seen.lane.e_y_m, side * seen.wheel_angle_rad);
            seen.guidance_torque_nm *= side;
            driver.step(&seen)
        };
        (0..=10_000).map(answer).skip(1000).step_by(1000).collect()
    };
    let left = torques(arc_m.unwrap(), 1.0);
    let expected = "6.31042363 5.82208664 3.92043833 2.39282484 2.67372488 4.7683688 7.18420525 8.02987215 6.49329701 3.5615268";
    let expected = expected.split(' ').map(|text| text.parse::<f64>().unwrap());
    for (found, wanted) in left.iter().zip(expected) {
        assert!((found - wanted).abs() < 1e-2, "{found} {wanted}");
    }
    let [one, other] = [1.0, -1.0].map(|side| torques(0.0, side));
    assert!(one.iter().zip(&other).all(|(one, other)| *one == -other));
}

/// A driver of one's own who does nothing has the remnant of a scenario that asks for one, and no other torque.
#[test]
fn a_driver_of_ones_own_has_the_remnant_that_a_scenario_asks_for() {
    let nobody = || Given(|_| 0.0);
    let mut quiet = with_remnant(&Scenario::default(), nobody());
    assert!((0..1000).all(|step| quiet.step(&view(step)) == 0.0));
    let noisy = crate::models::driver::DriverParameters {
        remnant_sd_nm: 0.1,
        ..Default::default()
    };
    let scenario = Scenario::builder().driver(noisy).build().unwrap();
    let mut own = with_remnant(&scenario, nobody());
    // 1000 s hold some 1500 independent values: the variance is known to 4 %.
    let square: f64 = (0..1_000_000).map(|step| own.step(&view(step)).powi(2)).sum();
    assert!((square / 1e6 / 0.01 - 1.0).abs() < 0.15, "{square}");
}

/// The arc of the first curve has a radius of 300 m, to the left or right: 0.3 m beside the middle, and 60/300 m inside.
#[test]
fn an_own_line_lies_beside_the_middle_and_inside_of_curves() {
    let sees = Box::new(Given(|view| view.lane.e_y_m));
    let mut driver = with_habit("own_line", &[("cut_m2", 60.0)], sees);
    let arc = Scenario::default().course().centreline().at(1300.0).1;
    assert!((arc.abs() - 1.0 / 300.0).abs() < 1e-12);
    for (near_m, line_m) in [(500.0, 0.3), (1300.0, 0.3 + 0.2 * arc.signum())] {
        let seen = DriverView {
            points_m: [near_m, near_m + 12.0],
            ..view(0)
        };
        assert!((driver.step(&seen) - line_m).abs() < 1e-9, "{near_m}");
    }
}

/// Half-way through 10 s the delay is 150 of 300 ms, and what is seen counts 0.85: of e_y = t.
#[test]
fn who_tires_sees_less_and_later() {
    let sees = Box::new(Given(|view| view.lane.e_y_m));
    let mut driver = with_habit("tiring", &[("duration_s", 10.0)], sees);
    let mut seen = Vec::new();
    for step in 0..20_000 {
        let mut now = view(step);
        now.lane.e_y_m = now.time_s();
        seen.push(driver.step(&now));
    }
    for (step, expected) in [
        (0, 0.0),
        (5000, 0.85 * 4.85),
        (10_000, 0.7 * 9.7),
        (19_999, 0.7 * 19.699),
    ] {
        assert!((seen[step] - expected).abs() < 2e-3, "{step}: {}", seen[step]);
    }
}

/// Lapses of 2 s that begin every 30 s of attention: 2/32 of the time, known to a tenth of it after 20 hours; none under a warning.
#[test]
fn attention_lapses_as_often_as_asked_and_not_under_a_warning() {
    let sees = || Box::new(Given(|view| view.lane.e_y_m));
    let mut driver = with_habit("lapses", &[], sees());
    let away = |driver: &mut Box<dyn AnyDriver>, warning: bool| {
        let count = (0..7_200_000).filter(|step| {
            let mut now = view(*step);
            (now.lane.e_y_m, now.warning) = (f64::from(*step), warning);
            driver.step(&now) != f64::from(*step)
        });
        count.count() as f64 / 7_200_000.0
    };
    let share = away(&mut driver, false);
    assert!((share / 0.0625 - 1.0).abs() < 0.2, "{share}");
    assert_eq!(away(&mut with_habit("lapses", &[], sees()), true), 0.0);
}

#[test]
fn a_warning_is_the_only_word_of_a_loss_or_none() {
    for (answers, warning, is_lost, knows) in [
        (1.0, false, true, 0.0),
        (1.0, true, true, 1.0),
        (0.0, true, true, 0.0),
    ] {
        let tells = Box::new(Given(|view| f64::from(view.is_lost)));
        let mut driver = with_habit("warning", &[("answers", answers)], tells);
        let seen = DriverView {
            warning,
            is_lost,
            ..view(0)
        };
        assert_eq!(driver.step(&seen), knows);
    }
}

/// The paper's driver by name is the paper's driver; participant 13 is that of table 6.
#[test]
fn published_drivers_are_those_of_the_simulator() {
    let scenario = Scenario::default();
    let mut published = crate::parts::PaperDriver::new(&scenario);
    let mut named = driver(&scenario, "paper", &[]);
    for step in 0..3000 {
        let seen = DriverView {
            is_lost: false,
            ..view(step)
        };
        assert_eq!(named.step(&seen), published.step(&seen), "{step}");
    }
    let mut thirteen = driver(&scenario, "participant", &[("number", 13.0)]);
    let found = crate::participants::participants()[12].guided;
    let own = scenario
        .to_builder()
        .driver(found.parameters())
        .gains(found.gains())
        .build()
        .unwrap();
    let mut expected = crate::parts::PaperDriver::new(&own);
    for step in 0..3000 {
        assert_eq!(thirteen.step(&view(step)), expected.step(&view(step)));
    }
}

/// Participant 13 at his ends is the driver of table 6 and that of table 5, in the middle he has their means: written here.
#[test]
fn who_adapts_lies_between_the_tables() {
    let scenario = Scenario::default();
    for (share, same, values) in [
        (1.0, "participant", vec![("number", 13.0)]),
        (0.0, "paper", paper_of([0.074, 0.015, 3.523, 0.038, 3.719, 0.0])),
        (
            0.5,
            "paper",
            paper_of([0.080, 0.009, 3.4995, 0.042, 2.922, 0.0175]),
        ),
    ] {
        let mut own = driver(&scenario, "adapting", &[("number", 13.0), ("share", share)]);
        let mut same = driver(&scenario, same, &values);
        for step in 0..3000 {
            let apart_nm = own.step(&view(step)) - same.step(&view(step));
            assert!(apart_nm.abs() < 1e-12, "{share} {step} {apart_nm}");
        }
    }
}

fn paper_of(values: [f64; 6]) -> Vec<(&'static str, f64)> {
    let names = ["a_1", "a_2", "a_3", "t_p_s", "k_d_nm_per_rad", "k_hg"];
    names.into_iter().zip(values).collect()
}

/// All drivers with their defaults keep the lane of the paper's course, each habit around the paper's driver too. The
/// law is the paper's, but for the relay: a driver who yields wholly to a guidance on the side of the target leaves the
/// lane under one that cannot steer alone.
#[test]
fn every_driver_keeps_the_lane() {
    let scenario = Scenario::default();
    let mut all: Vec<(&str, Box<dyn AnyDriver>)> = DRIVERS
        .iter()
        .map(|kind| (kind.name, driver(&scenario, kind.name, &[])))
        .collect();
    all.extend(HABITS.iter().map(|kind| {
        (
            kind.name,
            with_habit(kind.name, &[], driver(&scenario, "paper", &[])),
        )
    }));
    let peak_m = |driver, law: Box<dyn Law>| {
        let guidance = OwnLaw::new(&scenario, law);
        let run = Simulation::of_parts(&scenario, driver, PaperVehicle::new(&scenario), guidance).run();
        run.trace
            .samples
            .iter()
            .map(|s| s.lateral_error_m.abs())
            .fold(0.0, f64::max)
    };
    for (name, driver) in all {
        let fdca = LAWS.iter().find(|kind| kind.name == "fdca").unwrap();
        let Make::Part(make) = fdca.make else { panic!() };
        let law: Box<dyn Law> = match name {
            "relay" => make(&scenario, &fdca.defaults()).unwrap(),
            _ => Box::new(Gains::PAPER),
        };
        let largest_m = peak_m(driver, law);
        assert!(largest_m < 1.0, "{name}: {largest_m} m");
    }
    assert!(peak_m(driver(&scenario, "relay", &[]), Box::new(Gains::PAPER)) > 5.0);
}
