//! Recordings in the formats of other tools, told apart by the extension of the file's name.
//!
//! | extension | what | read | written |
//! |---|---|---|---|
//! | `.csv` | a table; units in the name or in brackets behind it | yes | yes |
//! | `.parquet` | a table; units in the file's metadata (feature `parquet`) | yes | yes |
//! | `.mat` | MATLAB level 5, vectors with a struct `units` | yes | yes |
//! | `.mf4` | ASAM MDF 4 (written with feature `mdf`) | yes | yes |
//! | `.mcap` | MCAP, JSON messages (feature `mcap`) | no | yes |
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
mod mdf_bus;
#[cfg(feature = "mdf")]
mod mdf_write;
#[cfg(feature = "parquet")]
mod parquet;
pub mod protection;
mod write;

use std::collections::HashSet;
use std::fs::File;
use std::io::Read;
use std::path::Path;

pub use bus_log::{BusLog, Watch, write_frames};
use write::replaced;
pub use write::{to_csv, write};

use crate::notes::{Fate, Notes};
use crate::recording::{Group, Lines, Recording, RecordingError, Series, Term, refuse};
use crate::units;

/// A format, by its extension.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Format {
    /// `.csv`
    Csv,
    /// `.parquet`
    #[cfg(feature = "parquet")]
    Parquet,
    /// `.mat`
    Mat,
    /// `.mf4`
    Mdf4,
    /// `.mcap`
    #[cfg(feature = "mcap")]
    Mcap,
    /// `.log`
    Candump,
    /// `.asc`
    Asc,
    /// `.blf`
    Blf,
}

/// Extensions and their formats; the first of a format is the usual one.
const EXTENSIONS: &[(&str, Format)] = &[
    ("csv", Format::Csv),
    #[cfg(feature = "parquet")]
    ("parquet", Format::Parquet),
    ("mat", Format::Mat),
    ("mf4", Format::Mdf4),
    ("mdf", Format::Mdf4),
    #[cfg(feature = "mcap")]
    ("mcap", Format::Mcap),
    ("log", Format::Candump),
    ("candump", Format::Candump),
    ("asc", Format::Asc),
    ("blf", Format::Blf),
];

/// How to have what the first command does not compile.
const LARGER: &str = "which would make the first build longer: build host-sim with `--features full`, as in \
                      cargo run --release -p host-sim --features full -- convert IN OUT";
/// Extensions that only a larger build knows.
const ELSEWHERE: &[&str] = &[
    #[cfg(not(feature = "parquet"))]
    "parquet",
    #[cfg(not(feature = "mcap"))]
    "mcap",
];

impl Format {
    /// The format of a file's name.
    ///
    /// # Errors
    /// No extension that is known, with those that are.
    pub fn from_path(path: &Path) -> Result<Self, RecordingError> {
        Self::if_named(path)?.ok_or_else(|| {
            let known: Vec<String> = EXTENSIONS.iter().map(|(known, _)| format!(".{known}")).collect();
            let what = match path.extension() {
                None => "no extension".into(),
                Some(extension) => format!("the extension .{}", extension.display()),
            };
            RecordingError(format!(
                "{}: {what} says which format it is; one of {} is wanted",
                path.display(),
                known.join(", ")
            ))
        })
    }

    /// The format of a file's name, if its extension is known.
    ///
    /// # Errors
    /// An extension that only a larger build knows.
    pub fn if_named(path: &Path) -> Result<Option<Self>, RecordingError> {
        let extension = path.extension().unwrap_or_default().to_string_lossy();
        let extension = extension.to_lowercase();
        if ELSEWHERE.contains(&extension.as_str()) {
            return Err(RecordingError(format!(
                "{}: this build knows no .{extension}, {LARGER}",
                path.display()
            )));
        }
        let found = EXTENSIONS.iter().find(|(known, _)| *known == extension);
        Ok(found.map(|(_, format)| *format))
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
        // Where none of the channels is wanted, whoever wants others names them.
        if let Self::Channels(recording) = &self
            && recording.unread.is_empty()
        {
            let mut channels = recording.groups.iter().flat_map(|group| &group.channels);
            if channels.all(|channel| channel.values.iter().all(|value| value.is_nan())) {
                let aside = recording.notes.aside();
                return Err(format!("there is no channel with a number in it{aside}").into());
            }
        }
        Ok(self)
    }
}

/// What is wanted of a file.
#[derive(Clone, Copy, Default)]
pub struct Reading<'a> {
    /// The channel that is the time, if it is not `time_s`; its own unit decides if neither unit nor factor is given.
    pub time: Option<&'a Term>,
    /// Whether a channel of this name is wanted; none: all are.
    pub only: Only<'a>,
}

/// Which channels are wanted.
pub type Only<'a> = Option<&'a dyn Fn(&str) -> bool>;

/// What a table holds.
#[derive(Default)]
struct Table {
    columns: Vec<Series>,
    lines: Lines,
    unread: Vec<String>,
    notes: Notes,
}

/// Reads the file at `path`; `watch` is told how far.
///
/// # Errors
/// What cannot be read, with the file, and the channel where one is the reason.
pub fn read(path: &Path, reading: Reading<'_>, watch: &Watch) -> Result<Contents, RecordingError> {
    let format = Format::from_path(path)?;
    let named = |e: RecordingError| RecordingError(format!("{}: {e}", path.display()));
    if format.holds_frames() {
        return Ok(Contents::Frames(BusLog::of_file(path, format).map_err(named)?));
    }
    let file = File::open(path).map_err(|e| named(e.to_string().into()))?;
    read_from(watch.over(file), format, reading).map_err(named)
}

/// Reads what a source has.
///
/// # Errors
/// As [`read`], without the file's name.
pub fn read_from(
    mut source: impl Read,
    format: Format,
    reading: Reading<'_>,
) -> Result<Contents, RecordingError> {
    if format == Format::Csv {
        let read = csv::read(source, reading.only).and_then(|table| with_time(table, reading.time));
        let read = read.map(Contents::Channels).and_then(Contents::not_empty);
        return read.map_err(RecordingError::printable);
    }
    let mut bytes = Vec::new();
    source.read_to_end(&mut bytes).map_err(refuse)?;
    read_bytes(bytes, format, reading)
}

/// Reads a file's bytes.
///
/// # Errors
/// As [`read`], without the file's name.
pub fn read_bytes(bytes: Vec<u8>, format: Format, reading: Reading<'_>) -> Result<Contents, RecordingError> {
    contents(bytes, format, reading)
        .and_then(Contents::not_empty)
        .map_err(RecordingError::printable)
}

fn contents(bytes: Vec<u8>, format: Format, reading: Reading<'_>) -> Result<Contents, RecordingError> {
    let table = match format {
        Format::Candump | Format::Asc | Format::Blf => {
            return Ok(Contents::Frames(BusLog::of_bytes(bytes, format)));
        }
        Format::Mdf4 => {
            let recording = mdf::read(&bytes, reading)?;
            return Ok(match mdf_bus::frames(&recording) {
                Some((frames, notes)) => Contents::Frames(BusLog::of_frames(frames, notes)),
                None => Contents::Channels(recording.described().settled()?),
            });
        }
        #[cfg(feature = "mcap")]
        Format::Mcap => {
            return Err("MCAP is written, not read: convert from what it was made of".into());
        }
        Format::Csv => csv::read(&bytes[..], reading.only)?,
        Format::Mat => mat::read(&bytes, reading.time)?,
        #[cfg(feature = "parquet")]
        Format::Parquet => parquet::read(bytes, reading.only)?,
    };
    Ok(Contents::Channels(with_time(table, reading.time)?))
}

/// A recording of columns in memory, by their names with or without units in brackets; the time is among them.
///
/// # Errors
/// No time; columns of different lengths.
pub fn table(columns: Vec<(String, Vec<f64>)>, time: Option<&Term>) -> Result<Recording, RecordingError> {
    let (names, values): (Vec<String>, Vec<Vec<f64>>) = columns.into_iter().unzip();
    let columns = csv::headings(&names).into_iter().zip(values);
    let columns = columns.map(|(heading, values)| Series { values, ..heading });
    let table = Table {
        columns: columns.collect(),
        ..Table::default()
    };
    with_time(table, time)
}

/// A name with a number behind it, and what else it takes to be no other's.
fn numbered(name: &str, number: usize, taken: &mut HashSet<String>) -> String {
    let mut own = format!("{name}_{number}");
    while !taken.insert(own.clone()) {
        own.push('_');
    }
    own
}

/// Columns of a table, the time among them, as a recording.
fn with_time(mut table: Table, time: Option<&Term>) -> Result<Recording, RecordingError> {
    let usual = Term {
        channel: "time_s".into(),
        factor: None,
    };
    let is_usual = time.is_none();
    let time = time.unwrap_or(&usual);
    let wanted = time.channel.as_str();
    let columns = &mut table.columns;
    let exact = columns.iter().position(|c| c.name.eq_ignore_ascii_case(wanted));
    let place = exact.or_else(|| {
        let is_it = |c: &Series| units::bare(&c.name).eq_ignore_ascii_case(units::bare(wanted));
        columns.iter().position(is_it)
    });
    let Some(place) = place else {
        let bare = units::bare(wanted);
        if let Some(error) = table.notes.left_out(bare) {
            return Err(error.into());
        }
        let names = columns.iter().map(|c| &c.name).chain(&table.unread);
        let names: Vec<&str> = names.take(8).map(String::as_str).collect();
        return Err(format!(
            "there is no channel {wanted}; if another one is the time, --time NAME says so (there are {}){}",
            if names.is_empty() {
                "none".into()
            } else {
                names.join(", ")
            },
            table.notes.aside()
        )
        .into());
    };
    let mut own = columns.remove(place);
    let before = columns.len();
    columns.retain(|c| c.name != own.name);
    // OpenLKA's tables have the time of the drive and, behind all others, that of the segment by one name.
    match before - columns.len() {
        0 => {}
        _ if is_usual => return Err(format!("channel {wanted} is there twice").into()),
        _ => table
            .notes
            .channel(Fate::LeftOut, &own.name, "the first of this name is the time"),
    }
    if own.unit.is_empty() {
        let said = units::in_brackets(&own.name).map(|(_, unit)| unit);
        own.unit = said
            .or_else(|| units::of_name(&own.name))
            .unwrap_or_default()
            .into();
    }
    let factor = time.factor(&own, "s")?;
    let rows = own.values.len();
    if let Some(other) = columns.iter().find(|c| c.values.len() != rows) {
        let (name, found) = (&other.name, other.values.len());
        return Err(format!("channel {name}: {found} rows where {} has {rows}", own.name).into());
    }
    // 1.0 changes no bit.
    let time_s = own.values.into_iter().map(|t| t * factor).collect();
    let mut group = Group::new(time_s, table.columns);
    group.lines = table.lines;
    Recording {
        groups: vec![group],
        unread: table.unread,
        notes: table.notes,
    }
    .described()
    .settled()
}
