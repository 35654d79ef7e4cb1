//! A recorded drive from any format: which channel of a file is which column of a log, and in which unit.
//!
//! A column is the channel of its own name unless a [`Mapping`] names another. A channel's unit is converted where the file
//! says it, or taken as said by a scale; what cannot be converted is refused. Channels of one table are taken row by
//! row and checked as a CSV file's are. Channels with instants of their own are taken at those of the driver torque, whose
//! noise must stay as it is: T_h as held, and lane signals that are slower than the torque too, for a line between two
//! pictures would hide the camera's noise; the others on the line between their neighbours.

mod instants;
mod layout;
mod mapping;

use std::io::Read;
use std::path::Path;

use haptic_log::candump;
use haptic_log::formats::{self, BusLog, Contents, Format, TimeColumn};
use haptic_log::notes::Note;
use haptic_log::recording::{Group, Recording, RecordingError, Series};
use haptic_log::table::TableReader;
use haptic_log::units;

use super::bus_trace;
use super::log::{COLUMNS, DriveLog, LogError, SPEED_COLUMN, refuse};
use instants::at_the_torque;
pub use layout::{Layout, Table};
pub use mapping::Mapping;

/// What can be mapped: the columns that a log must have, and the speed.
const NAMES: [&str; 7] = {
    let [a, b, c, d, e, f] = COLUMNS;
    [a, b, c, d, e, f, SPEED_COLUMN]
};
const UNITS: [&str; 7] = ["s", "m", "rad", "rad", "N.m", "N.m", "m/s"];
const GUIDANCE: usize = 4;
const DRIVER: usize = 5;
const SPEED: usize = 6;

/// Reads the log at `path`: a CSV file, a recording of the bus, or a file of another tool by its extension; `layout` says what
/// the columns of a table are, if they are not those of a log. The sentences say what was converted or computed.
///
/// # Errors
/// As [`DriveLog::open`], with the channel; a column that is mapped twice.
pub fn open(
    path: &Path,
    layout: Option<&Layout>,
    maps: &[Mapping],
    how: &bus_trace::Recording<'_>,
) -> Result<(DriveLog, Vec<String>), LogError> {
    let named = |e: LogError| LogError::in_file(path.display(), e);
    let format = Format::from_path(path).ok();
    let mut head = Vec::new();
    let opened = std::fs::File::open(path).and_then(|file| file.take(HEAD).read_to_end(&mut head));
    opened.map_err(|e| LogError::in_file(path.display(), e))?;
    if let Some(format) = bus_format(format, &head).filter(|_| layout.is_none()) {
        let log = BusLog::of_file(path, format).map_err(LogError::from);
        let read = log.and_then(|log| once(maps).and_then(|()| of_bus(log, maps, how)));
        return read.map_err(named);
    }
    let bytes = std::fs::read(path).map_err(|e| LogError::in_file(path.display(), e))?;
    of_bytes(bytes, format, layout, maps, how).map_err(named)
}

/// How much of a text shows whether it is a table or a trace.
const HEAD: u64 = 1 << 16;

/// The format of frames that a file has; a text is told by its looks.
fn bus_format(format: Option<Format>, head: &[u8]) -> Option<Format> {
    match format {
        None | Some(Format::Csv | Format::Candump) => {
            candump::looks_like_one(head).then_some(Format::Candump)
        }
        Some(format) => format.holds_frames().then_some(format),
    }
}

fn of_bus(
    log: BusLog,
    maps: &[Mapping],
    how: &bus_trace::Recording<'_>,
) -> Result<(DriveLog, Vec<String>), LogError> {
    if maps.is_empty() {
        let (log, note) = bus_trace::of_bus(log, how)?;
        return Ok((log, vec![note.into()]));
    }
    let dbc = bus_trace::dbc_file(how.dbc)?;
    of_channels(&formats::dbc::channels(&log.of_bus(how.bus), &dbc)?, maps, how)
}

/// Reads a log's bytes; without a format they are text, a table or a trace by their looks.
///
/// # Errors
/// As [`open`], without the file's name.
pub fn of_bytes(
    bytes: Vec<u8>,
    format: Option<Format>,
    layout: Option<&Layout>,
    maps: &[Mapping],
    how: &bus_trace::Recording<'_>,
) -> Result<(DriveLog, Vec<String>), LogError> {
    once(maps)?;
    if let Some(layout) = layout {
        return layout.read(&bytes, format, maps, how);
    }
    if let Some(format) = bus_format(format, &bytes) {
        return of_bus(BusLog::of_bytes(bytes, format), maps, how);
    }
    // A CSV file keeps its own reader, which names lines.
    let is_text = matches!(format, None | Some(Format::Csv | Format::Candump));
    if maps.is_empty() && is_text && !has_units(&bytes) {
        let log = DriveLog::read_within(&bytes[..], how.manual, how.stretches)?;
        return Ok((log, Vec::new()));
    }
    let contents = formats::read_bytes(bytes, format.unwrap_or(Format::Csv), time_of(maps).as_ref());
    match contents? {
        Contents::Frames(log) => of_bus(log, maps, how),
        Contents::Channels(recording) => of_channels(&recording, maps, how),
    }
}

/// The log of a table's columns in memory, by their names with or without units in brackets. What is not asked for may have
/// another length than the time.
///
/// # Errors
/// As [`open`], without a file's name.
pub fn of_table(
    mut columns: Vec<(String, Vec<f64>)>,
    maps: &[Mapping],
    how: &bus_trace::Recording<'_>,
) -> Result<(DriveLog, Vec<String>), LogError> {
    once(maps)?;
    let is_there = |map: &Mapping| {
        columns
            .iter()
            .any(|(name, _)| units::bare(name) == units::bare(&map.channel))
    };
    if let Some(map) = maps.iter().find(|map| !is_there(map)) {
        let names: Vec<&str> = columns.iter().take(8).map(|(name, _)| name.as_str()).collect();
        let there = if names.is_empty() {
            "none".into()
        } else {
            names.join(", ")
        };
        return refuse(format!("there is no channel {}; there are {there}", map.channel));
    }
    let asked = NAMES
        .into_iter()
        .chain(maps.iter().map(|map| map.channel.as_str()));
    let asked: Vec<&str> = asked.map(units::bare).collect();
    columns.retain(|(name, _)| asked.contains(&units::bare(name)));
    let recording = formats::table(columns, time_of(maps).as_ref());
    let recording = recording?;
    of_channels(&recording, maps, how)
}

fn once(maps: &[Mapping]) -> Result<(), LogError> {
    let again = (1..maps.len()).find(|&i| maps[..i].iter().any(|other| other.column == maps[i].column));
    again.map_or(Ok(()), |i| {
        refuse(format!("{} is mapped twice", NAMES[maps[i].column]))
    })
}

fn time_of(maps: &[Mapping]) -> Option<TimeColumn> {
    maps.iter().find(|map| map.column == 0).map(|map| TimeColumn {
        name: map.channel.clone(),
        scale: map.scale,
    })
}

/// Whether a table has columns of a log with their units in brackets.
fn has_units(bytes: &[u8]) -> bool {
    let is_column = |name: &str| NAMES.iter().any(|column| column.eq_ignore_ascii_case(name));
    let with_unit = |text: &String| units::in_brackets(text).is_some_and(|(name, _)| is_column(name));
    let heading = bytes
        .split(|byte| *byte == b'\n')
        .find(|line| !line.starts_with(b"#") && !line.trim_ascii().is_empty());
    TableReader::new(heading.unwrap_or_default()).is_ok_and(|table| table.header().iter().any(with_unit))
}

/// A column's channel with what makes it SI.
struct Column<'a> {
    group: &'a Group,
    series: &'a Series,
    scale: f64,
}

fn of_channels(
    recording: &Recording,
    maps: &[Mapping],
    how: &bus_trace::Recording<'_>,
) -> Result<(DriveLog, Vec<String>), LogError> {
    let manual = how.manual;
    let mut notes = Vec::new();
    let mut columns: [Option<Column<'_>>; 6] = Default::default();
    for (i, column) in columns.iter_mut().enumerate().skip(1) {
        let map = maps.iter().find(|map| map.column == i);
        let (group, series) = match wanted(recording, i, map) {
            Ok(found) => found,
            Err(_) if manual && i == GUIDANCE && map.is_none() => continue,
            Err(error) if map.is_none() => {
                let wanted = COLUMNS[i];
                return refuse(format!(
                    "{error}; --map {wanted}=CHANNEL[*SCALE] names another one"
                ));
            }
            Err(error) => return Err(error.into()),
        };
        let scale = scale(series, i, map)?;
        if scale != 1.0 {
            notes.push(converted(series, i, scale));
        }
        *column = Some(Column { group, series, scale });
    }
    let one = columns
        .iter()
        .flatten()
        .all(|c| std::ptr::eq(c.group, columns[DRIVER].as_ref().map_or(c.group, |d| d.group)));
    let (time_s, values) = if one {
        rows(&columns)
    } else {
        at_the_torque(&columns, &mut notes)?
    };
    let mut log = DriveLog::from_rows(time_s, values, manual, how.stretches)?;
    log.findings.extend(recording.notes.iter().map(Note::finding));
    tell_speed(&mut log, recording, maps, &mut notes)?;
    Ok((log, notes))
}

/// The channel of a column.
fn wanted<'a>(
    recording: &'a Recording,
    column: usize,
    map: Option<&Mapping>,
) -> Result<(&'a Group, &'a Series), RecordingError> {
    recording.find(map.map_or(NAMES[column], |map| map.channel.as_str()))
}

/// What a channel's values are multiplied by to be a column's.
fn scale(series: &Series, column: usize, map: Option<&Mapping>) -> Result<f64, LogError> {
    let (wanted, name) = (UNITS[column], &series.name);
    match (map.and_then(|map| map.scale), series.unit.as_str()) {
        (Some(scale), _) => Ok(scale),
        (None, "") => Ok(1.0),
        (None, unit) => units::factor(unit, wanted).ok_or_else(|| {
            format!(
                "channel {name}: its unit {unit:?} is not known as one of {wanted}; --map {}={name}*SCALE says how \
                 many {wanted} it is",
                NAMES[column]
            )
            .into()
        }),
    }
}

fn converted(series: &Series, column: usize, scale: f64) -> String {
    format!(
        "{} is {} ({:?}) times {scale}",
        NAMES[column], series.name, series.unit
    )
}

/// What the recording says of the speed, if it does. It is not needed: without a mapping another unit or name tells nothing.
fn tell_speed(
    log: &mut DriveLog,
    recording: &Recording,
    maps: &[Mapping],
    notes: &mut Vec<String>,
) -> Result<(), LogError> {
    let map = maps.iter().find(|map| map.column == SPEED);
    let found = wanted(recording, SPEED, map).map_err(LogError::from);
    let found = found.and_then(|(_, series)| Ok((series, scale(series, SPEED, map)?)));
    let (series, scale) = match found {
        Ok(found) => found,
        Err(_) if map.is_none() => return Ok(()),
        Err(error) => return Err(error),
    };
    if scale != 1.0 {
        notes.push(converted(series, SPEED, scale));
    }
    let speeds: Vec<f64> = series.values.iter().map(|v| v * scale).collect();
    log.tell_speed(&speeds);
    Ok(())
}

type Values = [Option<Vec<f64>>; 6];

/// The columns as the table has them.
fn rows(columns: &[Option<Column<'_>>; 6]) -> (Vec<f64>, Values) {
    let values = std::array::from_fn(|i| {
        let column = columns[i].as_ref()?;
        Some(column.series.values.iter().map(|v| v * column.scale).collect())
    });
    (
        columns
            .iter()
            .flatten()
            .next()
            .map_or(Vec::new(), |c| c.group.time_s.clone()),
        values,
    )
}
