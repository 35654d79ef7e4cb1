//! `--series`: whether and how the full time series are written.

use clap::ValueEnum;
use haptic_report::studies::SeriesFormat;

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum SeriesArgument {
    /// No time series
    None,
    /// CSV with units in the column names
    Csv,
    /// CSV compressed with gzip
    CsvGz,
}

impl From<SeriesArgument> for SeriesFormat {
    fn from(argument: SeriesArgument) -> Self {
        match argument {
            SeriesArgument::None => Self::None,
            SeriesArgument::Csv => Self::Csv,
            SeriesArgument::CsvGz => Self::CsvGz,
        }
    }
}
