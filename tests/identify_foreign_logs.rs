//! Drives recorded by another program, with the truth beside them: the identification must work on data that the
//! workbench did not make. In them T_h is what the ECU held at the sample instant (the probe switches on sample
//! instants); the other signals are continuous. Cut to the second half of the drive or to some curves, so the
//! integral of e_y is not zero where they begin.

use std::path::PathBuf;

use haptic_analysis::identify::{
    DriveLog, Identification, Options, Parameter, identify_as_published, identify_together,
    identify_with_noise_model,
};
use serde_json::Value;

fn load(name: &str) -> (DriveLog, Value) {
    let stem = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("tests/data/driver-logs")
        .join(name);
    let truth = std::fs::read_to_string(stem.with_extension("json")).unwrap();
    (
        DriveLog::open(&stem.with_extension("csv"), false).unwrap(),
        serde_json::from_str(&truth).unwrap(),
    )
}

fn number(truth: &Value, key: &str) -> f64 {
    truth[key].as_f64().unwrap()
}

/// Each identified combination with its truth: three gains and the delay.
fn with_truth(found: &Identification, truth: &Value) -> [(Parameter, f64); 4] {
    let sum = number(truth, "K_d") + number(truth, "K_nms");
    let p = &found.parameters;
    [
        (p.gain_1, sum * number(truth, "a1")),
        (p.gain_2, sum * number(truth, "a2")),
        (p.gain_3, sum * number(truth, "a3")),
        (p.t_p, number(truth, "t_p")),
    ]
}

fn assert_covers(parameter: &Parameter, truth: f64) {
    // Four standard errors: a seed that is drawn once may lie outside 95 %, hardly outside 99.99 %.
    let (centre, error) = (parameter.optimum.unwrap(), parameter.standard_error.unwrap());
    assert!(
        (centre - truth).abs() < 4.0 * error,
        "{centre} +- {error} against {truth}"
    );
}

#[test]
fn without_noise_every_identifiable_parameter_is_within_one_percent() {
    let (log, truth) = load("guided-probe-clean");
    let found = identify_with_noise_model(&log, &Options::default());
    let mut gains = with_truth(&found, &truth).to_vec();
    let (t_p, true_t_p) = gains.pop().unwrap();
    assert!((t_p.estimate.unwrap() - true_t_p).abs() < 0.002);
    gains.push((found.parameters.k_hg, number(&truth, "K_hg")));
    for (parameter, value) in gains {
        let estimate = parameter.estimate.unwrap();
        assert!(
            (estimate / value - 1.0).abs() < 0.01,
            "{estimate} against {value}"
        );
    }
    assert!(found.fit_percent > 99.0);
}

/// Even without a probe: so little noise leaves room for no second explanation, and the standard errors say so.
#[test]
fn without_noise_and_probe_too_every_parameter_is_within_one_percent() {
    let (log, truth) = load("guided-clean");
    let found = identify_with_noise_model(&log, &Options::default());
    let k_hg = (found.parameters.k_hg, number(&truth, "K_hg"));
    let [gains @ .., (t_p, true_t_p)] = with_truth(&found, &truth);
    assert!((t_p.estimate.unwrap() - true_t_p).abs() < 0.002);
    for (parameter, value) in gains.into_iter().chain([k_hg]) {
        assert!(
            (parameter.estimate.unwrap() / value - 1.0).abs() < 0.01,
            "{parameter:?}"
        );
        assert_covers(&parameter, value);
    }
}

#[test]
fn the_published_way_refuses_what_is_outside_table_4() {
    let (log, _) = load("guided-probe");
    let mut options = Options::default();
    options.fix("k_d=7").unwrap();
    let error = identify_as_published(&log, &options).unwrap_err().to_string();
    assert!(error.starts_with("--fix k_d: 7 is outside 1 to 5"), "{error}");
}

/// Every parameter given: there is nothing to search, and the fit is that of the truth, whose torque explains more
/// than half of a drive with this remnant.
#[test]
fn a_driver_who_is_known_altogether_is_simulated() {
    let (log, truth) = load("guided-probe");
    let mut options = Options::default();
    for (name, key) in [
        ("a_1", "a1"),
        ("a_2", "a2"),
        ("a_3", "a3"),
        ("t_p", "t_p"),
        ("k_d", "K_d"),
        ("k_hg", "K_hg"),
    ] {
        options.fix(&format!("{name}={}", number(&truth, key))).unwrap();
    }
    for found in [
        identify_as_published(&log, &options).unwrap(),
        identify_with_noise_model(&log, &options),
    ] {
        let p = &found.parameters;
        assert!(p.t_p.fixed && p.k_hg.fixed && p.k_d.fixed && p.a_1.fixed);
        assert!((p.a_1.estimate.unwrap() - 0.09).abs() < 1e-12);
        assert!(found.correlation.names.is_empty());
        assert!((50.0..80.0).contains(&found.fit_percent), "{}", found.fit_percent);
    }
}

#[test]
fn with_a_probe_k_hg_is_read_through_the_remnant() {
    let (log, truth) = load("guided-probe");
    // Of an arm whose stiffness is not known, one drive does not tell gain_3.
    let mut options = Options::default();
    options.fix("k_nms=1").unwrap();
    let found = identify_with_noise_model(&log, &options);
    let k_hg = found.parameters.k_hg;
    assert!(k_hg.identified && (k_hg.estimate.unwrap() - number(&truth, "K_hg")).abs() < 0.05);
    for (parameter, value) in with_truth(&found, &truth) {
        assert!(parameter.identified);
        assert_covers(&parameter, value);
    }
    let remnant = found.remnant.unwrap();
    assert!((remnant.sd_nm.unwrap() / number(&truth, "remnant_sd_nm") - 1.0).abs() < 0.15);
    assert!((remnant.corner_hz.unwrap() - number(&truth, "remnant_corner_hz")).abs() < 0.1);
    assert!(found.whiteness.white && found.input_correlation.iter().all(|i| i.independent));
}

#[test]
fn without_a_probe_k_hg_is_declared_unknown_where_the_published_way_names_a_bound() {
    let (log, truth) = load("guided-passive");
    let found = identify_with_noise_model(&log, &Options::default());
    let k_hg = found.parameters.k_hg;
    assert!(!k_hg.identified && k_hg.estimate.is_none());
    let [low, high] = k_hg.interval_95.unwrap();
    assert!(high - low > 0.5 && low <= number(&truth, "K_hg") && number(&truth, "K_hg") <= high);
    // The truth lies on the ridge that is reported instead.
    let gain_3 = found
        .combinations
        .iter()
        .find(|c| c.name.starts_with("gain_3 - "))
        .unwrap();
    let slope: f64 = gain_3.name["gain_3 - ".len()..]
        .trim_end_matches("*k_hg")
        .parse()
        .unwrap();
    let on_ridge = with_truth(&found, &truth)[2].1 - slope * number(&truth, "K_hg");
    assert!((gain_3.estimate - on_ridge).abs() < 4.0 * gain_3.standard_error);

    let published = identify_as_published(&log, &Options::default()).unwrap();
    assert!(published.parameters.k_hg.on_bound && published.parameters.k_hg.optimum == Some(1.0));
    assert!(!published.whiteness.white);
    // It fits no worse for all that: the fit does not show it.
    assert!(published.fit_percent > found.fit_percent - 1.0);
}

#[test]
fn a_manual_drive_has_no_k_hg_and_a_known_k_d_splits_the_gains() {
    let (log, truth) = load("manual");
    let mut options = Options {
        manual: true,
        ..Options::default()
    };
    let found = identify_with_noise_model(&log, &options);
    assert_eq!(found.parameters.k_hg.optimum, None);
    for (parameter, value) in with_truth(&found, &truth) {
        assert_covers(&parameter, value);
    }
    let p = &found.parameters;
    assert!(
        [p.k_d, p.a_1, p.a_2, p.a_3]
            .iter()
            .all(|p| !p.identified && p.estimate.is_none())
    );

    options.fix("k_d=3.8").unwrap();
    options.fix("k_nms=1").unwrap();
    let p = identify_with_noise_model(&log, &options).parameters;
    assert!(p.a_3.identified);
    for (parameter, key) in [(p.a_1, "a1"), (p.a_2, "a2"), (p.a_3, "a3")] {
        assert_covers(&parameter, number(&truth, key));
    }
    // The other way round: a_3 known gives K_d.
    let mut options = Options {
        manual: true,
        ..Options::default()
    };
    options.fix("a_3=3.55").unwrap();
    let p = identify_with_noise_model(&log, &options).parameters;
    assert!(p.k_d.identified && p.a_3.fixed);
    assert_covers(&p.k_d, number(&truth, "K_d"));
    assert_covers(&p.a_1, number(&truth, "a1"));
}

#[test]
fn a_guided_log_without_guidance_torque_says_so() {
    let (log, _) = load("manual");
    let found = identify_with_noise_model(&log, &Options::default());
    assert!(!found.parameters.k_hg.identified && found.parameters.k_hg.standard_error.is_none());
    assert!(
        found
            .notes
            .iter()
            .any(|n| n.contains("guidance_torque_nm is zero throughout"))
    );
}

/// Vehicles that we did not write, the single-track and the multi-body model of CommonRoad, driven by a known driver with a
/// remnant (`examples/python/identify_commonroad.py`): every truth lies inside its interval, and K_hg is identified; on the
/// single-track one, which was driven for two minutes, all are. The multi-body one was driven for a minute and a half.
#[test]
fn every_truth_of_a_drive_on_a_foreign_vehicle_is_inside_its_interval() {
    for (name, all) in [
        ("commonroad-single-track", true),
        ("commonroad-multi-body", false),
    ] {
        let (log, truth) = load(name);
        let found = identify_with_noise_model(&log, &Options::default());
        assert!(found.refuted.is_empty(), "{name}: {:?}", found.refuted);
        let k_hg = found.parameters.k_hg;
        assert!(k_hg.identified, "{name}: {k_hg:?}");
        let with_k_hg = [(k_hg, number(&truth, "K_hg"))];
        for (parameter, truth) in with_truth(&found, &truth).into_iter().chain(with_k_hg) {
            let [low, high] = parameter.interval_95.unwrap();
            assert!(
                low <= truth && truth <= high && (parameter.identified || !all),
                "{name}: {parameter:?} against {truth}"
            );
        }
    }
}

/// A log as a recorder might have left it: every 50th row lost and empty fields, or 2 s lost. What is missing is bridged or
/// cut, and the driver is the same.
#[test]
fn a_log_with_holes_tells_the_same_driver() {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data/driver-logs/guided-probe.csv");
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let header = lines.next().unwrap().to_owned();
    let rows: Vec<Vec<f64>> = lines
        .map(|l| l.split(',').map(|f| f.parse().unwrap()).collect())
        .collect();
    let whole = DriveLog::read(text.as_bytes(), false).unwrap();
    let with_holes = |lost: &dyn Fn(usize) -> bool, empty: bool| {
        let mut holes = header.clone();
        for (k, row) in rows.iter().enumerate().filter(|(k, _)| !lost(*k)) {
            let field = |(c, x): (usize, &f64)| match empty && c == 2 && k % 77 == 0 {
                true => String::new(),
                false => x.to_string(),
            };
            let fields: Vec<String> = row.iter().enumerate().map(field).collect();
            holes.push_str(&format!("\n{}", fields.join(",")));
        }
        let log = DriveLog::read(holes.as_bytes(), false).unwrap();
        assert_eq!(log.len(), whole.len());
        log
    };
    let holes = with_holes(&|k| k % 50 == 25, true);
    let cut = with_holes(&|k| (3000..3240).contains(&k), false);
    let identify = |log: &DriveLog| identify_with_noise_model(log, &Options::default());
    let usual = identify(&whole);
    // Bridged it is nearly the same record; a cut takes 3 s away and needs a constant more.
    for (what, log, close) in [("holes", &holes, 0.3), ("cut", &cut, 1.5)] {
        let found = identify(log);
        assert!(found.refuted.is_empty(), "{:?}", found.refuted);
        for ((name, _, a), (_, _, b)) in usual.parameters.list().into_iter().zip(found.parameters.list()) {
            let (Some(x), Some(y), Some(error)) = (a.estimate, b.estimate, a.standard_error) else {
                continue;
            };
            assert!(
                (x - y).abs() < close * error.max(1e-12),
                "{what}: {name} {x} and {y}, +- {error}"
            );
        }
    }
    let left_out = &identify(&cut).preflight.unwrap().left_out;
    assert!(
        left_out.len() == 1 && (left_out[0].to_s - left_out[0].from_s - 2.0).abs() < 0.05,
        "{left_out:?}"
    );
}

/// Two halves of one drive in one fit say what the whole says, and more than either half.
#[test]
fn two_drives_of_one_driver_are_one_fit() {
    let (log, truth) = load("guided-probe");
    let n = log.len() / 2;
    let part = |from: usize, to: usize| DriveLog {
        start_s: log.time_s(from),
        e_y_m: log.e_y_m[from..to].to_vec(),
        e_theta_rad: log.e_theta_rad[from..to].to_vec(),
        wheel_angle_rad: log.wheel_angle_rad[from..to].to_vec(),
        guidance_torque_nm: log.guidance_torque_nm[from..to].to_vec(),
        driver_torque_nm: log.driver_torque_nm[from..to].to_vec(),
        ..log.clone()
    };
    let (first, second) = (part(0, n), part(n, log.len()));
    let options = Options::default();
    let both = identify_together(&[first.clone(), second], &options).unwrap();
    let (whole, half) = (
        identify_with_noise_model(&log, &options),
        identify_with_noise_model(&first, &options),
    );
    let of = |f: &Identification| (f.parameters.k_hg.optimum.unwrap(), f.at_t_nms.clone().unwrap());
    let width = |f: &Identification| {
        let at = of(f).1;
        let [low, high] = at.intervals_95.iter().find(|i| i.0 == "k_hg").unwrap().1;
        high - low
    };
    assert!((of(&both).0 - of(&whole).0).abs() < 0.25 * width(&whole));
    assert!(width(&both) < 0.85 * width(&half));
    assert!((of(&both).0 - number(&truth, "K_hg")).abs() < width(&both));
    let other_rate = DriveLog {
        dt_s: 0.01,
        ..first.clone()
    };
    let error = identify_together(&[first, other_rate], &options)
        .unwrap_err()
        .to_string();
    assert!(error.contains("one rate is wanted"), "{error}");
}
