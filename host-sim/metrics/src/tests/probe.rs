//! The probe is no driver.

use super::*;

/// A driver who turns the wheel by 1 deg twice in 10 s and pushes with the guidance; a probe makes both go to and fro.
#[test]
fn the_probe_is_no_reversal_and_no_conflict() {
    let make = |probe: f64| {
        drive(60.0, move |t| {
            let sine = probe * (TAU * 2.5 * t).sin();
            Sample {
                wheel_angle_rad: ((TAU * 0.1 * t).sin() + 0.3 * sine).to_radians(),
                driver_torque_nm: 0.1 - 0.05 * sine,
                guidance_torque_nm: 0.1 + 0.2 * sine,
                ..Sample::default()
            }
        })
    };
    let told = |trace: &Trace, probe_hz| {
        let metrics = measure(trace, &Circumstances { probe_hz, ..ROAD });
        (metrics.reversals_0p1deg_per_min, metrics.conflict_time_share)
    };
    let without = told(&make(0.0), None);
    // Six extrema up and six down; the first sample is the lowest point before the first.
    assert_eq!(without, (Some(12.0), Some(0.0)));
    let (reversals, conflict) = told(&make(1.0), None);
    assert!(
        reversals > Some(200.0) && conflict > Some(0.2),
        "{reversals:?} {conflict:?}"
    );
    assert_eq!(told(&make(1.0), Some(2.5)), without);
}
