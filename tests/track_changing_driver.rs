//! A driver who changes in mid-drive, followed through a recording.
//!
//! The inputs are a drive recorded by another program; the torque is computed here from equation (8) by plain
//! forward Euler at a tenth of the sample period, with K_hg stepping in the middle, and a remnant from a plain
//! linear congruential generator.

use std::path::PathBuf;

use haptic_analysis::identify::{DriveLog, Options, identify_with_noise_model, track};

const GAIN: [f64; 3] = [0.3, 0.08, 14.0];
const T_P: f64 = 0.15;
/// K_hg before and after row `STEP`.
const K_HG: [f64; 2] = [0.1, 0.8];
const STEP: usize = 8000;

struct Noise(u64);

impl Noise {
    /// Sum of twelve uniform numbers less six: mean 0, variance 1.
    fn next(&mut self) -> f64 {
        (0..12)
            .map(|_| {
                self.0 = self
                    .0
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1_442_695_040_888_963_407);
                (self.0 >> 11) as f64 / (1_u64 << 53) as f64
            })
            .sum::<f64>()
            - 6.0
    }
}

fn changing_driver() -> DriveLog {
    driver_of(K_HG)
}

fn driver_of(k_hg_before_and_after: [f64; 2]) -> DriveLog {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data/driver-logs/guided-probe.csv");
    let mut log = DriveLog::open(&path, false).unwrap();
    let dt = log.dt_s / 10.0;
    let at = |u: &[f64], t: f64| {
        let (k, rest) = ((t / log.dt_s).max(0.0) as usize, (t / log.dt_s).max(0.0).fract());
        u[k] + rest * (u[(k + 1).min(u.len() - 1)] - u[k])
    };
    let mut integral = vec![0.0];
    for k in 1..log.len() {
        integral.push(integral[k - 1] + 0.5 * log.dt_s * (log.e_y_m[k] + log.e_y_m[k - 1]));
    }
    let (mut arm, mut remnant, mut noise) = (0.0, 0.0, Noise(7));
    // Low-pass of 0.5 Hz, standard deviation 0.1 N.m.
    let rho = (-std::f64::consts::PI * log.dt_s).exp();
    let mut torque = Vec::new();
    for k in 0..log.len() {
        torque.push(((arm + remnant) / 0.005_f64).round() * 0.005);
        remnant = rho * remnant + 0.1 * (1.0 - rho * rho).sqrt() * noise.next();
        for i in 0..10 {
            let t = (k * 10 + i) as f64 * dt;
            let seen = t - T_P;
            let target = GAIN[0] * at(&log.e_y_m, seen)
                + GAIN[1] * at(&integral, seen)
                + GAIN[2] * at(&log.e_theta_rad, seen)
                - at(&log.wheel_angle_rad, t);
            let k_hg = k_hg_before_and_after[usize::from(k >= STEP)];
            arm += dt / 0.1 * (target - k_hg * log.guidance_torque_nm[k] - arm);
        }
    }
    log.driver_torque_nm = torque;
    log
}

#[test]
fn a_step_in_reliance_is_followed_and_its_uncertainty_told() {
    let log = changing_driver();
    let found = track(&log, &Options::default());
    let first = log.len() - found.time_s.len();
    let at = |row: usize| row - first;
    let k_hg = &found.k_hg;
    // 60 s in, and 15 s after the step, within 0.15 and within three of its own standard deviations.
    for (row, truth) in [
        (7200, K_HG[0]),
        (STEP - 1, K_HG[0]),
        (STEP + 1800, K_HG[1]),
        (log.len() - 1, K_HG[1]),
    ] {
        let (estimate, sd) = (k_hg.estimate[at(row)], k_hg.standard_deviation[at(row)]);
        assert!(
            (estimate - truth).abs() < 0.15,
            "row {row}: {estimate} against {truth}"
        );
        assert!(
            (estimate - truth).abs() < 3.0 * sd && sd < 0.12,
            "row {row}: {estimate} +- {sd}"
        );
    }
    // The constant parameters stay near their truth meanwhile.
    for (i, (course, tolerance)) in found.gain.iter().zip([0.15, 0.05, 2.0]).enumerate() {
        let estimate = course.estimate[course.estimate.len() - 1];
        assert!(
            (estimate - GAIN[i]).abs() < tolerance,
            "gain_{} {estimate}",
            i + 1
        );
    }
    assert!(k_hg.estimate.iter().all(|k| (0.0..=1.0).contains(k)));
    assert!(found.t_p.estimate.iter().all(|t| (0.0..=0.6).contains(t)));
}

#[test]
fn a_fixed_parameter_stays_fixed() {
    let log = changing_driver();
    let mut options = Options::default();
    options.fix("t_p=0.15").unwrap();
    let found = track(&log, &options);
    assert!(found.t_p.estimate.iter().all(|&t| (t - T_P).abs() < 1e-9));
}

/// Over the whole drive the constant-driver estimator answers with a mean of both halves: this is what the filter
/// is for.
#[test]
fn the_constant_driver_of_a_changing_one_is_in_between() {
    let k_hg = identify_with_noise_model(&changing_driver(), &Options::default())
        .parameters
        .k_hg
        .optimum
        .unwrap();
    assert!(K_HG[0] + 0.1 < k_hg && k_hg < K_HG[1] - 0.1, "{k_hg}");
}

/// A driver who changed is refuted with the instant and the size of the change; one who did not is not.
#[test]
fn a_changed_driver_is_refuted_with_the_instant() {
    let log = changing_driver();
    let found = identify_with_noise_model(&log, &Options::default());
    let change = found.constancy.unwrap().change.unwrap();
    let truth_s = log.time_s(STEP);
    assert_eq!(change.parameter, "k_hg");
    assert!((change.at_s[0] - truth_s).abs() < 5.0, "{change}");
    assert!(
        change.within_s()[0] < truth_s && truth_s < change.within_s()[1],
        "{change}"
    );
    assert!((change.by - 0.7).abs() < 0.1, "{change}");
    let [only] = &found.refuted[..] else {
        panic!("{:?}", found.refuted)
    };
    assert!(only.cause.starts_with("the driver changed at 11"), "{only:?}");
    assert!(only.cure.contains("--pieces"), "{only:?}");
    assert!(found.parameters.list().iter().all(|p| !p.2.identified));
    let constant = identify_with_noise_model(&driver_of([0.8; 2]), &Options::default());
    assert!(constant.refuted.is_empty(), "{:?}", constant.refuted);
    assert!(constant.parameters.k_hg.identified);
}

/// A driver of this kind whose torque sensor loses half of its scale is no driver who changed.
#[test]
fn a_torque_sensor_that_changes_is_named_as_one() {
    let mut log = driver_of([0.8; 2]);
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data/driver-logs/guided-probe.csv");
    let whole = DriveLog::open(&path, false).unwrap();
    // The recorded driver's own torque, for it moved the column.
    log.driver_torque_nm = whole.driver_torque_nm;
    for torque in &mut log.driver_torque_nm[STEP..] {
        *torque *= 0.5;
    }
    let found = identify_with_noise_model(&log, &Options::default());
    assert!(!found.refuted.is_empty());
    for refutation in &found.refuted {
        assert!(!refutation.cause.contains("driver changed"), "{refutation:?}");
    }
    assert!(
        found.refuted[0].cause.contains("driver_torque_nm"),
        "{:?}",
        found.refuted
    );
}

/// A camera that is mounted 0.1 m to the side looks like a driver whose line is 0.1 m to the other side. It is told as that line, and
/// the gains are within a standard error of those of the log without it.
#[test]
fn an_offset_of_e_y_is_told_as_the_line_of_the_driver() {
    let right = driver_of([0.8; 2]);
    let fit = |log: &DriveLog| identify_with_noise_model(log, &Options::default());
    let without = fit(&right);
    for aside in [-0.1, 0.1] {
        let mut log = right.clone();
        for e_y in &mut log.e_y_m {
            *e_y += aside;
        }
        let found = fit(&log);
        assert!(found.refuted.is_empty(), "{:?}", found.refuted);
        let line = found.line.unwrap().offset;
        assert!((line.estimate.unwrap() + aside).abs() < 0.02, "{line:?}");
        for (a, b) in found.parameters.list().iter().zip(without.parameters.list()) {
            assert_eq!(a.2.identified, b.2.identified, "{}", a.0);
            if let (Some(a), Some(b), Some(error)) = (a.2.optimum, b.2.optimum, b.2.standard_error) {
                // A line that is free costs the other parameters up to a standard error.
                assert!((a - b).abs() < error.max(1e-3), "{a} {b} {error}");
            }
        }
    }
}
