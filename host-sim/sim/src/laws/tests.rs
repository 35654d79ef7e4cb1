//! Each law against figures that were worked out apart: a program in Python, float64, from the equations of the documents. Behind
//! the ECU they are in `tests/own_law.rs`; the driver limit against opendbc's C in `tests/driver_limit.rs`.

use super::*;
use crate::scenario::Scenario;

/// What the program in Python shows its laws.
fn view(step: u32) -> LawView {
    let t = f64::from(step) / 1000.0;
    LawView {
        step,
        e_y_m: 0.4 * (0.7 * t).sin(),
        e_y_rate_m_per_s: 0.28 * (0.7 * t).cos(),
        e_theta_rad: 0.03 * (0.5 * t + 1.0).sin(),
        e_theta_rate_rad_per_s: 0.015 * (0.5 * t + 1.0).cos(),
        driver_torque_nm: 0.5 * (1.3 * t).sin(),
        wheel_angle_rad: 0.1 * (0.9 * t).sin(),
        wheel_rate_rad_per_s: 0.09 * (0.9 * t).cos(),
        guidance_torque_nm: 0.6 * (0.8 * t + 0.3).sin(),
        speed_m_per_s: 50.0 / 3.0,
        yaw_rate_rad_per_s: 0.05 * (0.6 * t).cos(),
        k_hg: None,
    }
}

fn law(name: &str, changed: &[(&str, f64)]) -> Box<dyn Law> {
    let kind = LAWS.iter().find(|kind| kind.name == name).unwrap();
    let mut values = kind.defaults();
    for (name, value) in changed {
        let place = kind.parameters.iter().position(|p| p.name == *name).unwrap();
        values[place] = *value;
    }
    match kind.make {
        Make::Part(make) => make(&Scenario::default(), &values).unwrap(),
        Make::Given(make) => make(&Scenario::default(), &values).unwrap(),
        Make::Around(make) => make(&Scenario::default(), &values, Box::new(Gains::PAPER)),
    }
}

/// The kind of a law, what is changed of its defaults, and what it asks for after every second, N.m.
type Asked = (&'static str, &'static [(&'static str, f64)], &'static str);
const ASKED: [Asked; 7] = [
    (
        "paper",
        &[],
        "0.431034246 0.468913508 0.347412267 0.102323382 -0.182180925 -0.40552298 -0.489887249 -0.410152396 -0.202142301 0.053811967",
    ),
    (
        "fdca",
        &[],
        "1.163804918 0.719733349 0.013391222 -0.724783358 -1.240765795 -1.34830296 -1.000069321 -0.310098826 0.483438918 1.103105695",
    ),
    (
        "fdca",
        &[
            ("k_y_rad_per_m", 0.2),
            ("k_psi", 2.0),
            ("lohs", 0.5),
            ("sohf", 0.8),
            ("loha_nm_per_rad", 1.0),
        ],
        "0.895163622 0.593941876 0.101234499 -0.443619131 -0.880156328 -1.062106393 -0.901930967 -0.416199085 0.253097327 0.868299647",
    ),
    (
        "authority_by_tlc",
        &[],
        "1.365421826 0.719733349 0.013391222 -0.724783358 -1.453451685 -1.480301518 -1.000069321 -0.310098826 0.502469007 1.324750086",
    ),
    (
        "driver_activity",
        &[],
        "0.431034246 0.468913508 0.150846487 0.031681013 -0.072163085 -0.12405208 -0.147067146 -0.410152396 -0.202142301 0.053811967",
    ),
    (
        "running_wide",
        &[],
        "0.435657115 0.486641996 0.371156234 0.10986011 -0.19558926 -0.443477309 -0.550587631 -0.461236725 -0.2251365 0.060507222",
    ),
    (
        "band",
        &[("outer_m", 0.3)],
        "0.0 0.468913508 0.347412267 0.0 0.0 -0.40552298 -0.489887249 -0.410152396 0.0 0.0",
    ),
];

#[test]
fn laws_ask_as_a_program_from_their_equations_does() {
    for (name, changed, expected) in ASKED {
        let mut law = law(name, changed);
        let expected: Vec<f64> = expected.split(' ').map(|text| text.parse().unwrap()).collect();
        for step in 0..=10_000 {
            let asked = law.ask(&view(step));
            if step > 0 && step % 1000 == 0 {
                let wanted = expected[step as usize / 1000 - 1];
                assert!(
                    (asked - wanted).abs() < 1e-8,
                    "{name} at {step}: {asked} {wanted}"
                );
            }
        }
    }
}

/// A driver who works against what (9) asks for is left with lambda_min of it and one who works with it has all, whatever of it is
/// applied: nothing, all, or the opposite.
#[test]
fn driver_activity_goes_by_what_equation_9_asks_for() {
    for sign in [1.0, -1.0] {
        for guidance_torque_nm in [0.0, 0.25 * sign, -0.25 * sign] {
            for (driver_nm, least, share) in [(-0.4, 0.0, 0.0), (-0.4, 0.3, 0.3), (0.4, 0.0, 1.0)] {
                let mut law = law("driver_activity", &[("lambda_min", least)]);
                let seen = LawView {
                    e_y_m: 0.5 * sign,
                    driver_torque_nm: driver_nm * sign,
                    wheel_rate_rad_per_s: 0.1,
                    guidance_torque_nm,
                    ..LawView::default()
                };
                let asked = (0..2000).map(|_| law.ask(&seen)).last().unwrap();
                // K_1*a_1*e_y = 0.25*2*0.5 N.m.
                let expected = share * 0.25 * sign;
                assert!(
                    (asked - expected).abs() < 1e-9,
                    "{guidance_torque_nm} {driver_nm} {least}: {asked}"
                );
            }
        }
    }
}

/// By hand: 0.335 N.m at K_hg 0.25, reached from 0.25 with 0.05 N.m/s in 1.7 s; the published gain 60 s and 1.7 s after the last change.
#[test]
fn a_gain_by_reliance_goes_to_its_table_and_back() {
    let mut law = law("by_reliance", &[]);
    let mut gain = |steps: u32, k_hg: Option<f64>| {
        let seen = LawView {
            e_theta_rad: 0.025,
            k_hg,
            ..LawView::default()
        };
        (0..steps).map(|_| law.ask(&seen)).last().unwrap()
    };
    for (steps, k_hg, expected) in [
        (1000, None, 0.25),
        (1000, Some(0.25), 0.3),
        (1000, Some(0.25), 0.335),
        (57_000, Some(0.25), 0.335),
        (3000, Some(0.25), 0.25),
        (10_000, Some(0.9), 0.45),
        (10_000, Some(-0.2), 0.31),
    ] {
        assert!((gain(steps, k_hg) - expected).abs() < 1e-4, "{k_hg:?}");
    }
}

/// By hand: 0.19 N.m over 0.5, its bound at K_hg 0.8, and the other at -1; 0.36 - 0.4*0.25 and its bound at 1.4. Each is reached in 10 s.
#[test]
fn a_gain_over_k_hg_compensates_or_follows_a_line_within_its_bounds() {
    for (name, k_hg, expected) in [
        ("compensating", 0.5, 0.38),
        ("compensating", 0.8, 0.65),
        ("compensating", 1.0, 0.65),
        ("compensating", -1.0, 0.25),
        ("linear", 0.75, 0.26),
        ("linear", 1.4, 0.05),
    ] {
        let mut law = law(name, &[]);
        let seen = LawView {
            e_theta_rad: 0.025,
            k_hg: Some(k_hg),
            ..LawView::default()
        };
        let asked = (0..10_000).map(|_| law.ask(&seen)).last().unwrap();
        assert!((asked - expected).abs() < 1e-9, "{name} at {k_hg}: {asked}");
        assert_eq!(law.k_1(), Some(asked));
    }
}

/// By hand, with the defaults: 0.04 N.m more each 20 ms from the first step on, until 0.5 N.m; with 1.5 N.m against it the bound is
/// 3 - (1.5 - 0.8)*3 = 0.9, with 1.8 it is 0, to which it falls by 0.1 N.m each 20 ms once all six samples say so: the sixth comes after 50
/// ms, with 50 samples a second after 100 ms.
#[test]
fn a_limited_law_grows_and_falls_as_the_rule_has_it() {
    for (samples_per_s, falls) in [(100.0, 2060), (50.0, 2100)] {
        check_limited(samples_per_s, falls);
    }
}

fn check_limited(samples_per_s: f64, falls: u32) {
    let mut law = DriverLimit::new(
        Box::new(Gains {
            k_1: 0.25,
            a: [2.0, 0.0, 0.0, 0.0],
        }),
        Limits {
            max: 3.0,
            up: 0.04,
            down: 0.1,
            allowance: 0.8,
            factor: 3.0,
        },
        samples_per_s,
    );
    let mut at = |from: u32, to: u32, driver_torque_nm| {
        let asks = (from..to).map(|step| {
            law.ask(&LawView {
                step,
                e_y_m: 1.0,
                driver_torque_nm,
                ..LawView::default()
            })
        });
        asks.last().unwrap()
    };
    for (from, to, driver, expected) in [
        (0, 20, 0.0, 0.04),
        (20, 40, 0.0, 0.08),
        (40, 1000, 0.0, 0.5),
        (1000, 2000, -1.5, 0.5),
        (2000, falls, -1.8, 0.5),
        (falls, falls + 20, -1.8, 0.4),
        (falls + 20, falls + 100, -1.8, 0.0),
    ] {
        assert!((at(from, to, driver) - expected).abs() < 1e-9, "{to}");
    }
}
