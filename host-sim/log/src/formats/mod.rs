//! Recordings in the formats of other tools, told apart by the extension of the file's name.
//!
//! | extension | what | read | written |
//! |---|---|---|---|
//! | `.csv` | a table; units in the name or in brackets behind it | yes | yes |
//! | `.parquet` | a table; units in the file's metadata (feature `parquet`) | yes | yes |
//! | `.mat` | MATLAB level 5, vectors with a struct `units` | yes | yes |
//! | `.mf4` | ASAM MDF 4 | yes | yes |
//! | `.mcap` | MCAP, JSON messages | no | yes |
//! | `.log` | candump | frames | frames |
//! | `.asc`, `.blf` | Vector's logs | frames | frames |
//!
//! What holds frames needs a DBC file to become channels. A file that is damaged is refused in one sentence: nothing here
//! indexes or allocates by what a file says without a look at how much there is. `tests/fuzz_readers/` holds that.

mod asc;
mod blf;
mod bus_log;
mod bytes;
mod calendar;
mod csv;
pub mod dbc;
mod mat;
#[cfg(feature = "mcap")]
mod mcap;
mod mdf;
#[cfg(feature = "parquet")]
mod parquet;

use std::path::Path;

pub use bus_log::{BusLog, write_frames};

use crate::recording::{Group, Recording, RecordingError, Series};
use crate::units;

/// A format, by its extension.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Format {
    /// `.csv`
    Csv,
    /// `.parquet`
    Parquet,
    /// `.mat`
    Mat,
    /// `.mf4`
    Mdf4,
    /// `.mcap`
    Mcap,
    /// `.log`
    Candump,
    /// `.asc`
    Asc,
    /// `.blf`
    Blf,
}

/// Extensions and their formats; the first of a format is the usual one.
const EXTENSIONS: [(&str, Format); 10] = [
    ("csv", Format::Csv),
    ("parquet", Format::Parquet),
    ("mat", Format::Mat),
    ("mf4", Format::Mdf4),
    ("mdf", Format::Mdf4),
    ("mcap", Format::Mcap),
    ("log", Format::Candump),
    ("candump", Format::Candump),
    ("asc", Format::Asc),
    ("blf", Format::Blf),
];

impl Format {
    /// The format of a file's name.
    ///
    /// # Errors
    /// No extension that is known, with those that are.
    pub fn from_path(path: &Path) -> Result<Self, RecordingError> {
        let extension = path.extension().unwrap_or_default().to_string_lossy();
        let extension = extension.to_lowercase();
        let found = EXTENSIONS.iter().find(|(known, _)| *known == extension);
        found.map(|(_, format)| *format).ok_or_else(|| {
            let known: Vec<String> = EXTENSIONS.iter().map(|(known, _)| format!(".{known}")).collect();
            let what = if extension.is_empty() {
                "no extension".into()
            } else {
                format!("the extension .{extension}")
            };
            RecordingError(format!(
                "{}: {what} says which format it is; one of {} is wanted",
                path.display(),
                known.join(", ")
            ))
        })
    }

    /// Whether it holds frames of a bus.
    #[must_use]
    pub const fn holds_frames(self) -> bool {
        matches!(self, Self::Candump | Self::Asc | Self::Blf)
    }
}

/// What a file holds.
#[derive(Debug, Clone)]
pub enum Contents {
    /// Channels.
    Channels(Recording),
    /// Frames of a bus, which are read when they are needed.
    Frames(BusLog),
}

impl Contents {
    /// # Errors
    /// No value of any channel, with what there is otherwise.
    fn not_empty(self) -> Result<Self, RecordingError> {
        if let Self::Channels(recording) = &self {
            let mut channels = recording.groups.iter().flat_map(|group| &group.channels);
            if channels.all(|channel| channel.values.iter().all(|value| value.is_nan())) {
                let aside = recording.notes.aside();
                return Err(format!("there is no channel with a number in it{aside}").into());
            }
        }
        Ok(self)
    }
}

/// The column that is the time where it has another name than `time_s`, and what makes it seconds.
#[derive(Debug, Clone, PartialEq)]
pub struct TimeColumn {
    /// Its name.
    pub name: String,
    /// What its values are multiplied by; its own unit decides if none is given.
    pub scale: Option<f64>,
}

/// Reads the file at `path`.
///
/// # Errors
/// What cannot be read, with the file, and the channel where one is the reason.
pub fn read(path: &Path, time: Option<&TimeColumn>) -> Result<Contents, RecordingError> {
    let format = Format::from_path(path)?;
    let named = |e: RecordingError| RecordingError(format!("{}: {e}", path.display()));
    if format.holds_frames() {
        return Ok(Contents::Frames(BusLog::of_file(path, format).map_err(named)?));
    }
    let bytes = std::fs::read(path).map_err(|e| named(e.to_string().into()))?;
    read_bytes(bytes, format, time).map_err(named)
}

/// Reads a file's bytes.
///
/// # Errors
/// As [`read`], without the file's name.
pub fn read_bytes(
    bytes: Vec<u8>,
    format: Format,
    time: Option<&TimeColumn>,
) -> Result<Contents, RecordingError> {
    contents(bytes, format, time)
        .and_then(Contents::not_empty)
        .map_err(RecordingError::printable)
}

fn contents(bytes: Vec<u8>, format: Format, time: Option<&TimeColumn>) -> Result<Contents, RecordingError> {
    let table = match format {
        Format::Candump | Format::Asc | Format::Blf => {
            return Ok(Contents::Frames(BusLog::of_bytes(bytes, format)));
        }
        Format::Mdf4 => return Ok(Contents::Channels(mdf::read(&bytes)?.described().settled()?)),
        Format::Mcap => {
            return Err("MCAP is written, not read: convert from what it was made of".into());
        }
        Format::Csv => csv::read(&bytes)?,
        Format::Mat => mat::read(&bytes)?,
        #[cfg(feature = "parquet")]
        Format::Parquet => parquet::read(bytes)?,
        #[cfg(not(feature = "parquet"))]
        Format::Parquet => return Err(NO_PARQUET.to_owned().into()),
    };
    Ok(Contents::Channels(with_time(table, time)?))
}

/// A recording of columns in memory, by their names with or without units in brackets; the time is among them.
///
/// # Errors
/// No time; columns of different lengths.
pub fn table(
    columns: Vec<(String, Vec<f64>)>,
    time: Option<&TimeColumn>,
) -> Result<Recording, RecordingError> {
    let (names, values): (Vec<String>, Vec<Vec<f64>>) = columns.into_iter().unzip();
    let columns = csv::headings(&names).into_iter().zip(values);
    let columns = columns.map(|(heading, values)| Series { values, ..heading });
    with_time(columns.collect(), time)
}

#[cfg(not(feature = "parquet"))]
const NO_PARQUET: &str = "this build reads and writes no Parquet: pyarrow or the command line host-sim does";

/// Columns of a table, the time among them, as a recording.
fn with_time(mut columns: Vec<Series>, time: Option<&TimeColumn>) -> Result<Recording, RecordingError> {
    let (wanted, scale) = time.map_or(("time_s", None), |t| (t.name.as_str(), t.scale));
    let exact = columns.iter().position(|c| c.name.eq_ignore_ascii_case(wanted));
    let place = exact.or_else(|| {
        let is_it = |c: &Series| units::bare(&c.name).eq_ignore_ascii_case(units::bare(wanted));
        columns.iter().position(is_it)
    });
    let Some(place) = place else {
        let names: Vec<&str> = columns.iter().take(8).map(|c| c.name.as_str()).collect();
        return Err(format!(
            "there is no channel {wanted}; if another one is the time, --map time_s=NAME says so (there are {})",
            if names.is_empty() { "none".into() } else { names.join(", ") }
        )
        .into());
    };
    let time = columns.remove(place);
    let unit = match (time.unit.as_str(), units::in_brackets(&time.name)) {
        ("", Some((_, unit))) => unit,
        ("", None) => units::of_name(&time.name).unwrap_or("s"),
        (unit, _) => unit,
    };
    let factor = scale.or_else(|| units::factor(unit, "s"));
    let factor =
        factor.ok_or_else(|| format!("channel {}: its unit {unit:?} is no unit of time", time.name))?;
    if let Some(other) = columns.iter().find(|c| c.values.len() != time.values.len()) {
        let (found, rows) = (other.values.len(), time.values.len());
        return Err(format!(
            "channel {}: {found} rows where {} has {rows}",
            other.name, time.name
        )
        .into());
    }
    // 1.0 changes no bit.
    let time_s = time.values.iter().map(|t| t * factor).collect();
    Recording::of(Group::new(time_s, columns)).described().settled()
}

/// Writes channels into the file at `path`.
///
/// # Errors
/// A format of frames, channels that it cannot hold, what the disk says; with the file.
pub fn write(path: &Path, recording: Recording) -> Result<(), RecordingError> {
    let named = |e: RecordingError| RecordingError(format!("{}: {e}", path.display()));
    let bytes = match Format::from_path(path)? {
        Format::Csv => csv::write(&recording.into_one_group().map_err(named)?),
        Format::Mat => mat::write(&recording.into_one_group().map_err(named)?),
        Format::Mdf4 => mdf::write(&recording),
        #[cfg(feature = "mcap")]
        Format::Mcap => mcap::write(&recording),
        #[cfg(not(feature = "mcap"))]
        Format::Mcap => Err("this build writes no MCAP, which would make the first build longer: build host-sim with `--features mcap`, as in cargo run --release -p host-sim --features mcap -- convert IN OUT.mcap".into()),
        #[cfg(feature = "parquet")]
        Format::Parquet => parquet::write(&recording.into_one_group().map_err(named)?),
        #[cfg(not(feature = "parquet"))]
        Format::Parquet => Err(NO_PARQUET.to_owned().into()),
        Format::Candump | Format::Asc | Format::Blf => Err(
            "a table of channels has no frames, and a bus log nothing else; `host-sim run --bus-log` records the bus".into(),
        ),
    };
    std::fs::write(path, bytes.map_err(named)?).map_err(|e| named(e.to_string().into()))
}
