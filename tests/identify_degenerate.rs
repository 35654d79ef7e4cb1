//! Records that are legal and hardly anything else: signals that are zero, constant or copies of each other, a torque
//! that is noise or one step. No estimator may panic on them or call known what such a record cannot hold.

use std::fmt::Write;

use haptic_analysis::identify::{DriveLog, Identification, Options};
use haptic_batch::identify::{Method, identify};

/// Noise between -0.5 and 0.5 from a linear congruential generator (Knuth's MMIX constants).
fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    }
}

/// A record whose row at time t is e_y, e_theta, wheel angle, T_h, T_d = `row(t)`.
fn record(duration_s: f64, rate_hz: f64, mut row: impl FnMut(f64) -> [f64; 5]) -> DriveLog {
    let mut text =
        "time_s,e_y_m,e_theta_rad,wheel_angle_rad,guidance_torque_nm,driver_torque_nm\n".to_owned();
    for k in 0..(duration_s * rate_hz) as u32 {
        let t = f64::from(k) / rate_hz;
        let [e_y, e_theta, phi, t_h, t_d] = row(t);
        writeln!(text, "{t:.6},{e_y},{e_theta},{phi},{t_h},{t_d}").unwrap();
    }
    DriveLog::read(text.as_bytes(), false).unwrap()
}

fn degenerate() -> Vec<(&'static str, DriveLog)> {
    let mut n = noise(1);
    let step = |t: f64| if t < 9.0 { 0.0 } else { 1.0 };
    vec![
        ("noise alone", record(20.0, 100.0, |_| [0.0, 0.0, 0.0, 0.0, n()])),
        (
            "a step alone",
            record(20.0, 100.0, |t| [0.0, 0.0, 0.0, 0.0, step(t)]),
        ),
        ("a step before the rows used", {
            record(20.0, 100.0, |t| [0.0, 0.0, 0.0, 0.0, f64::from(t > 0.5)])
        }),
        ("one sample", {
            record(20.0, 100.0, |t| {
                [0.0, 0.0, 0.0, 0.0, f64::from((t - 9.0).abs() < 1e-3)]
            })
        }),
        (
            "constant e_theta",
            record(20.0, 100.0, |_| [0.0, 0.1, 0.0, 0.0, n()]),
        ),
        (
            "constant everything",
            record(20.0, 100.0, |_| [0.3, 0.1, 0.2, 0.5, n()]),
        ),
        (
            "constant T_h",
            record(20.0, 100.0, |t| [t.sin(), 0.0, 0.0, 0.5, t.sin() + n()]),
        ),
        ("inputs that are one", {
            record(20.0, 100.0, |t| {
                [
                    0.1 * t.sin(),
                    0.1 * t.sin(),
                    0.1 * t.sin(),
                    0.1 * t.sin(),
                    t.sin(),
                ]
            })
        }),
        ("noise everywhere", {
            record(20.0, 100.0, |_| [n(), 0.1 * n(), 0.01 * n(), n(), n()])
        }),
        ("the wrong sign", {
            record(30.0, 100.0, |t| {
                [0.0, 0.1 * (0.3 * t).cos(), 0.0, 0.0, 0.1 * n() - (0.3 * t).cos()]
            })
        }),
        ("tiny signals", {
            record(20.0, 100.0, |t| {
                [1e-150 * t.sin(), 1e-150 * t.cos(), 0.0, 1e-150, 1e-150 * n()]
            })
        }),
        ("signals at their limits", {
            record(20.0, 100.0, |t| {
                [10.0 * t.sin(), 0.5, 3.1 * t.cos(), 50.0 * t.cos(), 50.0 * t.sin()]
            })
        }),
        (
            "the shortest and slowest",
            record(10.1, 20.0, |t| [t.sin(), 0.1 * t.cos(), 0.0, n(), n()]),
        ),
        (
            "the fastest",
            record(10.1, 2000.0, |t| [t.sin(), 0.1 * t.cos(), 0.0, 0.0, n()]),
        ),
    ]
}

fn known(fixes: &[&str], manual: bool) -> Options {
    let fixes: Vec<String> = fixes.iter().map(|&f| f.to_owned()).collect();
    Options::given(manual, &fixes).unwrap()
}

/// Numbers are numbers, an estimate is there exactly where it is identified, and lies in its own interval.
fn assert_sound(found: &Identification, what: &str) {
    assert!(found.fit_percent.is_finite(), "{what}");
    for (name, _, p) in found.parameters.list() {
        assert_eq!(p.identified, p.estimate.is_some(), "{what}: {name} {p:?}");
        if let (Some(estimate), Some([low, high])) = (p.estimate, p.interval_95) {
            let slack = 1e-9 * estimate.abs();
            assert!(
                low - slack <= estimate && estimate <= high + slack,
                "{what}: {name} {p:?}"
            );
        }
        for number in [p.estimate, p.standard_error, p.optimum].into_iter().flatten() {
            assert!(number.is_finite(), "{what}: {name} {p:?}");
        }
    }
}

#[test]
fn no_legal_record_is_too_degenerate_for_either_method() {
    for (what, log) in degenerate() {
        for manual in [false, true] {
            for method in [Method::NoiseModel, Method::Paper] {
                let what = format!("{what}, {method:?}, manual: {manual}");
                for fixes in [
                    &[][..],
                    &["k_d=3"],
                    &["a_3=3.7"],
                    &["t_p=0.1", "t_nms=0.5", "k_nms=0"],
                ] {
                    let drive = identify(&what, &log, &known(fixes, manual), method).unwrap();
                    assert_sound(&drive.results.identification, &format!("{what}, {fixes:?}"));
                }
            }
        }
    }
}

#[test]
fn a_record_without_inputs_identifies_no_driver() {
    for (what, log) in degenerate().into_iter().take(4) {
        for method in [Method::NoiseModel, Method::Paper] {
            let found = identify(what, &log, &Options::default(), method).unwrap().results;
            for (name, _, p) in found.identification.parameters.list() {
                assert!(!p.identified, "{what}, {method:?}: {name}");
            }
        }
    }
}

/// Steers away from the line: gain_3 would have to be negative. A phase of pi needs 10 s of delay at 0.3 rad/s.
#[test]
fn a_driver_who_steers_away_from_the_line_is_none() {
    let (what, log) = &degenerate()[9];
    assert_eq!(*what, "the wrong sign");
    let found = identify(what, log, &known(&[], true), Method::NoiseModel)
        .unwrap()
        .results
        .identification;
    let gain_3 = found.parameters.gain_3;
    assert!(!gain_3.identified && gain_3.interval_95.is_none() && gain_3.optimum == Some(0.0));
    let said = |n: &String| n.contains("gain_3 rests on a bound that the data contradict");
    assert!(found.notes.iter().any(said), "{:?}", found.notes);
}
