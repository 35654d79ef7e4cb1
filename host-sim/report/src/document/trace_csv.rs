//! A run's time series as CSV, plain or compressed (RFC 4180, one heading row, a point as decimal sign).
//!
//! The first seven columns are those of a driver log, so that a simulated run can be read wherever a log can.
//! Values are rounded far below any sensor: 1 us, 1 um, 0.1 urad, 10 uN.m. One that is not finite is an empty
//! field.

use super::{WriteError, write_file};
use flate2::Compression;
use flate2::write::GzEncoder;
use haptic_log::trace::{Sample, Trace};
use std::io::{self, Write};
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

/// Whether and how the full time series are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SeriesFormat {
    /// Not at all.
    None,
    /// As CSV, 200 bytes a sample.
    Csv,
    /// As CSV compressed with gzip, a fifth of it; pandas, R and MATLAB read it as it is.
    CsvGz,
}

/// Writes every sample of `trace` to `directory/name.csv` or `.csv.gz`, or not at all.
///
/// # Errors
/// As [`write_file`].
pub fn write_trace(
    directory: &Path,
    name: &str,
    trace: &Trace,
    series: SeriesFormat,
) -> Result<(), WriteError> {
    match series {
        SeriesFormat::None => Ok(()),
        SeriesFormat::Csv => write_file(&directory.join(format!("{name}.csv")), |file| {
            write_csv(file, trace)
        }),
        SeriesFormat::CsvGz => write_file(&directory.join(format!("{name}.csv.gz")), |file| {
            let mut packed = GzEncoder::new(file, Compression::fast());
            write_csv(&mut packed, trace)?;
            packed.finish().map(|_| ())
        }),
    }
}

fn write_csv(file: &mut dyn Write, trace: &Trace) -> io::Result<()> {
    let mut csv = csv::Writer::from_writer(file);
    csv.write_record(COLUMNS.map(|(name, ..)| name))?;
    for sample in &trace.samples {
        csv.write_record(COLUMNS.map(|(_, decimals, value)| field(value(sample), decimals)))?;
    }
    csv.flush()
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
        let trace = Trace {
            sample_rate_hz: 120.0,
            samples: vec![sample],
        };
        for series in [SeriesFormat::None, SeriesFormat::Csv, SeriesFormat::CsvGz] {
            write_trace(directory.path(), "run", &trace, series).unwrap();
        }
        let read = |name: &str| std::fs::read(directory.path().join(name)).unwrap();
        let mut unpacked = String::new();
        let packed = read("run.csv.gz");
        io::Read::read_to_string(&mut flate2::read::GzDecoder::new(&packed[..]), &mut unpacked).unwrap();
        assert_eq!(read("run.csv"), unpacked.as_bytes());
        assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 2);
        assert_eq!(
            unpacked,
            "time_s,e_y_m,e_theta_rad,wheel_angle_rad,guidance_torque_nm,driver_torque_nm,lateral_error_m,s_m,\
             heading_error_rad,curvature_1pm,guidance_e_y_m,guidance_e_theta_rad,wheel_rate_rad_s,\
             yaw_rate_rad_s,sideslip_rad,guidance_limited\n\
             0.008333,0.125000,0.0000000,,-0.47000,0.00000,-0.250000,12.5000,\
             0.0000000,0.00000000,0.000000,0.0000000,0.000000,0.0000000,0.0000000,1\n"
        );
    }
}
