//! A run's time series in a file, plain or compressed. The columns are the channels of [`haptic_log::trace`].

use super::{WriteError, write_file};
use flate2::Compression;
use flate2::write::GzEncoder;
use haptic_log::trace::Trace;
use std::path::Path;

/// Whether and how the full time series are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SeriesFormat {
    /// Not at all.
    None,
    /// Plain CSV, 200 bytes a sample.
    Csv,
    /// CSV compressed with gzip, a fifth of it; pandas, R and MATLAB read it as it is.
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
            trace.write_csv(file)
        }),
        SeriesFormat::CsvGz => write_file(&directory.join(format!("{name}.csv.gz")), |file| {
            let mut packed = GzEncoder::new(file, Compression::fast());
            trace.write_csv(&mut packed)?;
            packed.finish().map(|_| ())
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptic_log::trace::Sample;

    #[test]
    fn plain_and_compressed_hold_the_same() {
        let directory = tempfile::tempdir().unwrap();
        let trace = Trace {
            sample_rate_hz: 120.0,
            samples: vec![Sample::default(); 3],
        };
        for series in [SeriesFormat::None, SeriesFormat::Csv, SeriesFormat::CsvGz] {
            write_trace(directory.path(), "run", &trace, series).unwrap();
        }
        let read = |name: &str| std::fs::read(directory.path().join(name)).unwrap();
        let mut unpacked = String::new();
        let packed = read("run.csv.gz");
        std::io::Read::read_to_string(&mut flate2::read::GzDecoder::new(&packed[..]), &mut unpacked).unwrap();
        assert_eq!(read("run.csv"), unpacked.as_bytes());
        assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 2);
        assert_eq!(
            Trace::read_csv(unpacked.as_bytes()).unwrap().samples,
            trace.samples
        );
    }
}
