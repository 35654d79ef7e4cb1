//! Signals whose metrics are known by hand.

mod probe;

use super::*;
use std::f64::consts::{FRAC_1_SQRT_2, FRAC_2_PI, TAU};

const RATE_HZ: f64 = 100.0;
const ROAD: Circumstances = Circumstances {
    speed_m_s: 20.0,
    lane_width_m: 3.6,
    window: None,
    failure: None,
    probe_hz: None,
};

fn window(from_m: f64, to_m: f64) -> Option<Window> {
    Some(Window { from_m, to_m })
}

/// `seconds` of driving at 20 m/s with each sample made by `make(t)`.
fn drive(seconds: f64, make: impl Fn(f64) -> Sample) -> Trace {
    let samples = (0..(seconds * RATE_HZ).round() as usize)
        .map(|i| {
            let time_s = i as f64 / RATE_HZ;
            Sample {
                time_s,
                s_m: 20.0 * time_s,
                ..make(time_s)
            }
        })
        .collect();
    Trace {
        sample_rate_hz: RATE_HZ,
        samples,
    }
}

#[track_caller]
fn assert_near(got: Option<f64>, want: f64, tolerance: f64) {
    let got = got.expect("a value");
    assert!((got - want).abs() <= tolerance, "{got} instead of {want}");
}

fn sine(amplitude: f64, frequency_hz: f64, t: f64) -> f64 {
    amplitude * (TAU * frequency_hz * t).sin()
}

/// What is not asked for has no value, and nothing else another one.
#[test]
fn what_is_not_asked_for_has_no_value() {
    let trace = drive(20.0, |t| Sample {
        lateral_error_m: sine(0.5, 0.2, t),
        heading_error_rad: sine(0.01, 0.2, t),
        wheel_angle_rad: sine(0.2, 0.3, t),
        ..Sample::default()
    });
    let circumstances = Circumstances {
        speed_m_s: 20.0,
        lane_width_m: 3.6,
        window: None,
        failure: None,
        probe_hz: None,
    };
    let named = |names: &[&str]| -> Vec<&Definition> {
        DEFINITIONS.iter().filter(|d| names.contains(&d.name)).collect()
    };
    assert_eq!(Asked::among(&DEFINITIONS.iter().collect::<Vec<_>>()), Asked::ALL);
    for name in [
        "sdlp_m",
        "min_time_to_lane_crossing_s",
        "p15_time_to_lane_crossing_s",
        "reversals_3deg_per_min",
    ] {
        let asked = Asked::among(&named(&[name]));
        let (all, some) = (
            measure(&trace, &circumstances),
            measure_asked(&trace, &circumstances, asked),
        );
        for d in DEFINITIONS {
            let is_left_out = d.name.contains("crossing") && !asked.crossings
                || d.name.contains("reversals") && !asked.reversals;
            let expected = (d.value)(&all).filter(|_| !is_left_out);
            assert_eq!((d.value)(&some), expected, "{name}: {}", d.name);
        }
        assert!((named(&[name])[0].value)(&some).is_some(), "{name}");
    }
}

/// Whole periods of a sine of amplitude A about a mean: SD and RMS A/sqrt(2), mean magnitude 2A/pi.
#[test]
fn lane_keeping_and_effort_of_sines() {
    let trace = drive(60.0, |t| Sample {
        lateral_error_m: 0.1 + sine(0.3, 0.25, t),
        wheel_angle_rad: -0.02 + sine(0.05, 0.25, t),
        driver_torque_nm: sine(2.0, 0.25, t),
        guidance_torque_nm: sine(0.5, 0.25, t),
        ..Sample::default()
    });
    let metrics = measure(&trace, &ROAD);
    assert_near(metrics.duration_s, 60.0, 1e-9);
    assert_near(metrics.peak_lateral_error_m, 0.4, 1e-9);
    assert_near(metrics.sdlp_m, 0.3 * FRAC_1_SQRT_2, 1e-9);
    assert_near(metrics.sd_wheel_angle_rad, 0.05 * FRAC_1_SQRT_2, 1e-9);
    assert_near(metrics.mean_abs_driver_torque_nm, 2.0 * FRAC_2_PI, 1e-4);
    assert_near(metrics.rms_driver_torque_nm, 2.0 * FRAC_1_SQRT_2, 1e-9);
    assert_near(metrics.peak_driver_torque_nm, 2.0, 1e-9);
    assert_near(metrics.integral_squared_driver_torque_nm2s, 2.0 * 60.0, 1e-7);
    assert_near(metrics.mean_abs_guidance_torque_nm, 0.5 * FRAC_2_PI, 1e-4);
    assert_near(metrics.rms_guidance_torque_nm, 0.5 * FRAC_1_SQRT_2, 1e-9);
    assert_near(metrics.peak_guidance_torque_nm, 0.5, 1e-9);
    // In phase: no conflict, and a fifth of the effort is the guidance's.
    assert_eq!(metrics.conflict_time_share, Some(0.0));
    assert_eq!(metrics.mean_abs_driver_torque_in_conflict_nm, None);
    assert_near(metrics.guidance_authority, 0.2, 1e-12);
    assert_eq!(metrics.time_out_of_lane_s, Some(0.0));
}

#[test]
fn mean_lateral_error_takes_magnitudes() {
    let trace = drive(10.0, |t| Sample {
        lateral_error_m: if t < 5.0 { 0.2 } else { -0.4 },
        ..Sample::default()
    });
    assert_near(measure(&trace, &ROAD).mean_abs_lateral_error_m, 0.3, 1e-12);
}

/// The side of a 1.7 m vehicle leaves a 3.6 m lane beyond an offset of 0.95 m.
#[test]
fn time_out_of_lane_is_beyond_the_half_room() {
    let offset = |t: f64| match t {
        t if t < 3.0 => 0.949,
        t if t < 5.0 => -0.951,
        _ => 0.0,
    };
    let trace = drive(10.0, |t| Sample {
        lateral_error_m: offset(t),
        ..Sample::default()
    });
    let metrics = measure(&trace, &ROAD);
    assert_near(metrics.time_out_of_lane_s, 2.0, 1e-9);
    assert_eq!(metrics.min_time_to_lane_crossing_s, Some(0.0));
}

/// Straight road and a turn of radius 250 m (0.08 rad/s at 20 m/s) from the centreline: R acos(1 - d/R) / v.
#[test]
fn time_to_lane_crossing_of_a_turn() {
    let trace = drive(2.0, |_| Sample {
        yaw_rate_rad_per_s: 0.08,
        ..Sample::default()
    });
    let want = 250.0 * (1.0_f64 - 0.95 / 250.0).acos() / 20.0;
    let metrics = measure(&trace, &ROAD);
    assert_near(metrics.min_time_to_lane_crossing_s, want, 1e-9);
    assert_near(metrics.p15_time_to_lane_crossing_s, want, 1e-9);
}

/// From 20 m/s on 2 m/s2 less, 500 samples: 10.02 m/s in the last, 15.01 m/s in the mean; R = v/r, and R acos(1 - d/R)/v.
#[test]
fn a_speed_that_changes_counts_sample_by_sample() {
    let trace = drive(5.0, |t| Sample {
        speed_m_per_s: 20.0 - 2.0 * t,
        yaw_rate_rad_per_s: 0.08,
        ..Sample::default()
    });
    let metrics = measure(&trace, &ROAD);
    assert_near(metrics.mean_speed_m_per_s, 15.01, 1e-9);
    assert_near(metrics.min_speed_m_per_s, 10.02, 1e-9);
    assert_near(metrics.max_speed_m_per_s, 20.0, 1e-9);
    let crossing_s = |v: f64| (1.0 - 0.95 / (v / 0.08)).acos() / 0.08;
    assert_near(metrics.min_time_to_lane_crossing_s, crossing_s(20.0), 1e-9);
    // Rank 0.15*499 = 74.85 of times that rise.
    let at = |n: f64| crossing_s(20.0 - 0.02 * n);
    let p15 = 0.15 * at(74.0) + 0.85 * at(75.0);
    assert_near(metrics.p15_time_to_lane_crossing_s, p15, 1e-9);
    let old = drive(5.0, |_| Sample::default());
    assert_near(measure(&old, &ROAD).mean_speed_m_per_s, 20.0, 1e-9);
}

/// 101 samples that drift at 0.1 m/s from 0 m: TLC falls from 9.5 s to 8.5 s, 15 % of the way up at 8.65 s.
#[test]
fn fifteenth_percentile_of_a_drift() {
    let heading = (0.1_f64 / 20.0).asin();
    let trace = drive(1.01, |t| Sample {
        lateral_error_m: 0.1 * t,
        heading_error_rad: heading,
        ..Sample::default()
    });
    let metrics = measure(&trace, &ROAD);
    assert_near(metrics.min_time_to_lane_crossing_s, 8.5, 1e-9);
    assert_near(metrics.p15_time_to_lane_crossing_s, 8.65, 1e-9);
}

#[test]
fn a_vehicle_that_heads_for_no_boundary_has_no_time_to_crossing() {
    let metrics = measure(&drive(2.0, |_| Sample::default()), &ROAD);
    assert_eq!(metrics.min_time_to_lane_crossing_s, None);
    assert_eq!(metrics.p15_time_to_lane_crossing_s, None);
}

/// A sine of 0.1 Hz turns 12 times a minute; its swing is twice its amplitude.
#[test]
fn reversal_rates_of_sines() {
    let rates = |amplitude_deg: f64, frequency_hz: f64| {
        let trace = drive(600.0, |t| Sample {
            wheel_angle_rad: sine(amplitude_deg, frequency_hz, t).to_radians(),
            ..Sample::default()
        });
        let metrics = measure(&trace, &ROAD);
        (
            metrics.reversals_3deg_per_min.unwrap(),
            metrics.reversals_0p1deg_per_min.unwrap(),
        )
    };
    assert_eq!(rates(5.0, 0.1), (12.0, 12.0));
    // 2.8 deg of swing is below the gap of 3 deg. 3.2 deg is above it, but not the first half swing.
    assert_eq!(rates(1.4, 0.1), (0.0, 12.0));
    let (visual, cognitive) = rates(1.6, 0.1);
    assert!(
        (visual - 119.0 / 10.0).abs() < 1e-9 && cognitive == 12.0,
        "{visual}, {cognitive}"
    );
    // At the cut-off of 0.6 Hz two passes halve the swing: 5.8 deg become 2.9, 6.2 become 3.1.
    assert!(rates(2.9, 0.6).0 < 1.0);
    assert!((rates(3.1, 0.6).0 - 72.0).abs() < 0.5);
    // A tremor of 10 Hz and 1 deg is out of both bands: 2 Hz leaves 1/626 of it, but for the record's ends.
    let (visual, cognitive) = rates(1.0, 10.0);
    assert!(visual == 0.0 && cognitive < 1.0, "{visual}, {cognitive}");
}

#[test]
fn conflict_needs_opposite_signs_above_the_dead_band() {
    // Thirds: with each other; against each other at 0.8 N.m; against, but too small to have a sign.
    let trace = drive(3.0, |t| {
        let (driver_torque_nm, guidance_torque_nm) = match t {
            t if t < 1.0 => (1.0, 0.2),
            t if t < 2.0 => (-0.8, 0.2),
            _ => (0.9, -0.005),
        };
        Sample {
            driver_torque_nm,
            guidance_torque_nm,
            ..Sample::default()
        }
    });
    let metrics = measure(&trace, &ROAD);
    assert_near(metrics.conflict_time_share, 1.0 / 3.0, 1e-12);
    assert_near(metrics.mean_abs_driver_torque_in_conflict_nm, 0.8, 1e-12);
    assert_near(metrics.guidance_authority, 0.405 / (0.405 + 2.7), 1e-12);
}

#[test]
fn authority_is_zero_by_hand_one_by_machine_and_nothing_at_rest() {
    let authority = |t_d, t_h| {
        let trace = drive(1.0, |_| Sample {
            driver_torque_nm: t_d,
            guidance_torque_nm: t_h,
            ..Sample::default()
        });
        measure(&trace, &ROAD).guidance_authority
    };
    assert_eq!(authority(1.0, 0.0), Some(0.0));
    assert_eq!(authority(0.0, -1.0), Some(1.0));
    assert_eq!(authority(0.0, 0.0), None);
}

#[test]
fn share_of_time_at_a_limit() {
    let limited = |guidance_torque_nm| {
        let trace = drive(4.0, |t| Sample {
            guidance_limited: t < 1.0,
            guidance_torque_nm,
            ..Sample::default()
        });
        measure(&trace, &ROAD)
    };
    assert_near(limited(-0.1).limited_time_share, 0.25, 1e-12);
    let without = limited(0.0);
    assert_eq!(
        (without.limited_time_share, without.conflict_time_share),
        (None, None)
    );
}

/// After a failure at 2 s: 0.5 m until 4 s, 0.1 m until 6 s, 0.3 m until 7 s, then 0.1 m.
#[test]
fn recovery_lasts_to_the_end_of_the_window() {
    let error = |t: f64| match t {
        t if t < 2.0 => 0.9,
        t if t < 4.0 => -0.5,
        t if t < 6.0 => 0.1,
        t if t < 7.0 => 0.3,
        _ => 0.1,
    };
    let trace = drive(10.0, |t| Sample {
        lateral_error_m: error(t),
        ..Sample::default()
    });
    let within = |threshold, from_m, to_m| {
        let failure = Failure {
            time_s: 2.0,
            nominal_peak_lateral_error_m: threshold,
        };
        let window = Some(Window { from_m, to_m });
        let metrics = measure(
            &trace,
            &Circumstances {
                window,
                failure: Some(failure),
                ..ROAD
            },
        );
        (
            metrics.peak_lateral_error_after_failure_m,
            metrics.time_to_recover_s,
        )
    };
    let with = |threshold, to_m| within(threshold, 0.0, to_m);
    assert_eq!(with(Some(0.2), 200.0), (Some(0.5), Some(5.0)));
    assert_eq!(
        within(Some(0.4), 90.0, 200.0),
        (Some(0.5), Some(2.0)),
        "the window begins at 4.5 s, after the recovery"
    );
    assert_eq!(with(Some(0.4), 200.0), (Some(0.5), Some(2.0)));
    assert_eq!(with(Some(0.5), 200.0), (Some(0.5), Some(0.0)));
    assert_eq!(
        with(Some(0.05), 200.0),
        (Some(0.5), None),
        "still above at the end"
    );
    assert_eq!(
        with(Some(0.2), 110.0),
        (Some(0.5), Some(2.0)),
        "the window ends before the second rise"
    );
    assert_eq!(
        with(Some(0.2), 20.0),
        (None, None),
        "the window ends before the failure"
    );
    assert_eq!(with(None, 200.0), (Some(0.5), None));
}

#[test]
fn a_window_takes_its_stretch_of_road_and_no_more() {
    // 20 m/s: 60 m to 80 m is 3 s to 4 s, 101 samples with both ends.
    let trace = drive(10.0, |t| Sample {
        lateral_error_m: t,
        ..Sample::default()
    });
    let window = window(60.0, 80.0);
    let metrics = measure(&trace, &Circumstances { window, ..ROAD });
    assert_near(metrics.duration_s, 1.01, 1e-9);
    assert_near(metrics.peak_lateral_error_m, 4.0, 1e-9);
    assert_near(metrics.mean_abs_lateral_error_m, 3.5, 1e-9);
}

#[test]
fn nothing_is_measured_where_there_is_nothing() {
    let trace = drive(1.0, |_| Sample::default());
    let window = window(1e4, 2e4);
    let beyond = measure(&trace, &Circumstances { window, ..ROAD });
    assert_eq!(beyond, Metrics::default());
    assert_eq!(measure(&Trace::default(), &ROAD), Metrics::default());
}

#[test]
fn a_diverged_run_gives_no_value_instead_of_nan() {
    let trace = drive(2.0, |t| Sample {
        wheel_angle_rad: if t < 1.0 { 0.1 } else { f64::NAN },
        ..Sample::default()
    });
    assert_eq!(measure(&trace, &ROAD), Metrics::default());
    // Up to the divergence there are values, but a filter that looks ahead has none.
    let window = window(0.0, 10.0);
    let metrics = measure(&trace, &Circumstances { window, ..ROAD });
    assert_eq!(metrics.peak_lateral_error_m, Some(0.0));
    assert_eq!(metrics.reversals_3deg_per_min, None);
    // Finite, but too large to square.
    let trace = drive(1.0, |_| Sample {
        driver_torque_nm: 1e200,
        ..Sample::default()
    });
    let metrics = measure(&trace, &ROAD);
    assert_eq!(
        (metrics.rms_driver_torque_nm, metrics.peak_driver_torque_nm),
        (None, Some(1e200))
    );
}
