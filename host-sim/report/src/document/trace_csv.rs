//! A run's time series as CSV (RFC 4180, one heading row, a point as decimal sign).
//!
//! The first seven columns are those of a driver log, so that a simulated run can be read wherever a log can.
//! Values are rounded far below any sensor: 1 us, 1 um, 0.1 urad, 10 uN.m. One that is not finite is an empty
//! field.

use super::{WriteError, write_file};
use haptic_log::trace::{Sample, Trace};
use std::path::Path;

/// Name with unit, digits after the point, value.
type Column = (&'static str, usize, fn(&Sample) -> f64);

const COLUMNS: [Column; 16] = [
    ("time_s", 6, |s| s.time_s),
    ("e_y_m", 6, |s| s.e_y_m),
    ("e_theta_rad", 7, |s| s.e_theta_rad),
    ("wheel_angle_rad", 7, |s| s.wheel_angle_rad),
    ("guidance_torque_nm", 5, |s| s.guidance_torque_nm),
    ("driver_torque_nm", 5, |s| s.driver_torque_nm),
    ("lateral_error_m", 6, |s| s.lateral_error_m),
    ("s_m", 4, |s| s.s_m),
    ("heading_error_rad", 7, |s| s.heading_error_rad),
    ("curvature_1pm", 8, |s| s.curvature_1pm),
    ("guidance_e_y_m", 6, |s| s.guidance_e_y_m),
    ("guidance_e_theta_rad", 7, |s| s.guidance_e_theta_rad),
    ("wheel_rate_rad_s", 6, |s| s.wheel_rate_rad_s),
    ("yaw_rate_rad_s", 7, |s| s.yaw_rate_rad_s),
    ("sideslip_rad", 7, |s| s.sideslip_rad),
    ("guidance_limited", 0, |s| f64::from(s.guidance_limited)),
];

/// Writes every sample of `trace` to `path`.
///
/// # Errors
/// As [`write_file`].
pub fn write_trace_csv(path: &Path, trace: &Trace) -> Result<(), WriteError> {
    write_file(path, |file| {
        let mut csv = csv::Writer::from_writer(file);
        csv.write_record(COLUMNS.map(|(name, ..)| name))?;
        for sample in &trace.samples {
            csv.write_record(COLUMNS.map(|(_, decimals, value)| field(value(sample), decimals)))?;
        }
        csv.flush()
    })
}

fn field(value: f64, decimals: usize) -> String {
    if value.is_finite() {
        super::html::number(Some(value), decimals)
    } else {
        String::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_quantity_of_a_sample_has_its_column() {
        let sample = serde_json::to_value(Sample::default()).unwrap();
        let mut fields: Vec<_> = sample.as_object().unwrap().keys().cloned().collect();
        let mut columns = COLUMNS.map(|(name, ..)| name.to_string());
        fields.sort();
        columns.sort();
        assert_eq!(fields, columns);
    }

    #[test]
    fn a_trace_is_written_as_the_heading_says() {
        let sample = Sample {
            time_s: 1.0 / 120.0,
            s_m: 12.5,
            lateral_error_m: -0.25,
            e_y_m: 0.125,
            wheel_angle_rad: f64::NAN,
            driver_torque_nm: -1e-9,
            guidance_torque_nm: -0.47,
            guidance_limited: true,
            ..Sample::default()
        };
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("run.csv");
        write_trace_csv(
            &path,
            &Trace {
                sample_rate_hz: 120.0,
                samples: vec![sample],
            },
        )
        .unwrap();
        assert_eq!(
            std::fs::read_to_string(&path).unwrap(),
            "time_s,e_y_m,e_theta_rad,wheel_angle_rad,guidance_torque_nm,driver_torque_nm,lateral_error_m,s_m,\
             heading_error_rad,curvature_1pm,guidance_e_y_m,guidance_e_theta_rad,wheel_rate_rad_s,\
             yaw_rate_rad_s,sideslip_rad,guidance_limited\n\
             0.008333,0.125000,0.0000000,,-0.47000,0.00000,-0.250000,12.5000,\
             0.0000000,0.00000000,0.000000,0.0000000,0.000000,0.0000000,0.0000000,1\n"
        );
    }
}
