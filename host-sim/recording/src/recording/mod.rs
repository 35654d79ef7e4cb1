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
mod speed;

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use haptic_log::candump;
use haptic_log::formats::{self, BusLog, Contents, Format};
use haptic_log::notes::Note;
use haptic_log::recording::{Group, Lines, Recording, RecordingError, Series, Term};
use haptic_log::units;

use super::bus_trace;
use super::log::{COLUMNS, DriveLog, LogError, SPEED_COLUMN, refuse};
use instants::at_the_torque;
pub use layout::{Layout, Signals, Table};
pub use mapping::Mapping;
use speed::{fast, speeds};

/// What can be mapped: the columns that a log must have, and the speed, in one of two units.
const NAMES: [&str; 8] = {
    let [a, b, c, d, e, f] = COLUMNS;
    [a, b, c, d, e, f, SPEED_COLUMN, "speed_kmh"]
};
const UNITS: [&str; 8] = ["s", "m", "rad", "rad", "N.m", "N.m", "m/s", "km/h"];
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
    let format = Format::if_named(path)?;
    let mut head = Vec::new();
    let opened = File::open(path).and_then(|file| file.take(HEAD).read_to_end(&mut head));
    opened.map_err(|e| LogError::in_file(path.display(), e))?;
    if let Some(format) = bus_format(format, &head).filter(|_| layout.is_none()) {
        let watch = how.watch.cloned().unwrap_or_default();
        let log = BusLog::of_file(path, format)
            .map(|log| log.watched(watch))
            .map_err(LogError::from);
        let read = log.and_then(|log| once(maps).and_then(|()| of_bus(log, maps, how)));
        return read.map_err(named);
    }
    if layout.is_none() && matches!(format, None | Some(Format::Csv | Format::Candump)) {
        // As it comes: a table of many hours fills a memory.
        let file = File::open(path).map_err(|e| LogError::in_file(path.display(), e))?;
        let watch = how.watch.cloned().unwrap_or_default();
        let read = once(maps).and_then(|()| of_csv(watch.over(file), maps, how));
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
    let only = &|name: &str| is_wanted(maps, name);
    let recording = formats::dbc::channels(&log.of_bus(how.bus), &dbc, Some(only))?;
    of_channels(recording, maps, how)
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
    let format = bus_format(format, &bytes).unwrap_or(match format {
        None | Some(Format::Candump) => Format::Csv,
        Some(format) => format,
    });
    of_contents(
        formats::read_bytes(bytes, format, reading(maps, &|name| is_wanted(maps, name)))?,
        maps,
        how,
    )
}

/// A log of a CSV file's text, of which only the columns that are needed are kept.
fn of_csv(
    source: impl Read,
    maps: &[Mapping],
    how: &bus_trace::Recording<'_>,
) -> Result<(DriveLog, Vec<String>), LogError> {
    let reading = &|name: &str| is_wanted(maps, name);
    of_contents(
        formats::read_from(source, Format::Csv, self::reading(maps, reading))?,
        maps,
        how,
    )
}

fn of_contents(
    contents: Contents,
    maps: &[Mapping],
    how: &bus_trace::Recording<'_>,
) -> Result<(DriveLog, Vec<String>), LogError> {
    match contents {
        Contents::Frames(log) => of_bus(log, maps, how),
        Contents::Channels(recording) => of_channels(recording, maps, how),
    }
}

impl DriveLog {
    /// Reads and checks the file at `path`. Lines that begin with `#` are skipped; upper and lower case are one in
    /// the header. Of a `manual` drive the guidance may be missing, as a column or as a number: it is then zero.
    ///
    /// # Errors
    /// The file cannot be read, or what it holds is refused; the text begins with the path.
    pub fn open(path: &Path, manual: bool) -> Result<Self, LogError> {
        let file = File::open(path).map_err(|e| LogError::in_file(path.display(), e))?;
        Self::read(BufReader::new(file), manual).map_err(|e| LogError::in_file(path.display(), e))
    }

    /// Reads and checks a log from `source`; see [`DriveLog::open`].
    ///
    /// # Errors
    /// A missing or doubled column, a field that is neither a number nor empty, a value beyond its column's range, time
    /// stamps that run backwards or repeat, or a record that is too short.
    pub fn read(source: impl Read, manual: bool) -> Result<Self, LogError> {
        Self::read_within(source, manual, &[])
    }

    /// Reads and checks a log of which these stretches of the log's time, s, will be used: of a log whose clock was set, the side of the jump
    /// that they lie on is read.
    ///
    /// # Errors
    /// What [`DriveLog::read`] refuses.
    pub fn read_within(source: impl Read, manual: bool, stretches: &[(f64, f64)]) -> Result<Self, LogError> {
        let how = bus_trace::Recording {
            manual,
            stretches,
            ..bus_trace::Recording::default()
        };
        Ok(of_csv(source, &[], &how)?.0)
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
            .any(|(name, _)| units::bare(name) == units::bare(&map.term.channel))
    };
    if let Some(map) = maps.iter().find(|map| !is_there(map)) {
        let names: Vec<&str> = columns.iter().take(8).map(|(name, _)| name.as_str()).collect();
        let there = if names.is_empty() {
            "none".into()
        } else {
            names.join(", ")
        };
        return refuse(format!(
            "there is no channel {}; there are {there}",
            map.term.channel
        ));
    }
    columns.retain(|(name, _)| is_wanted(maps, name));
    let recording = formats::table(columns, reading(maps, &|_| true).time)?;
    of_channels(recording, maps, how)
}

fn once(maps: &[Mapping]) -> Result<(), LogError> {
    let again = (1..maps.len()).find(|&i| maps[..i].iter().any(|other| other.column == maps[i].column));
    again.map_or(Ok(()), |i| {
        refuse(format!("{} is mapped twice", NAMES[maps[i].column]))
    })
}

/// What is to be read of a file: the time by its mapping, and the channels that are wanted.
fn reading<'a>(maps: &'a [Mapping], only: &'a dyn Fn(&str) -> bool) -> formats::Reading<'a> {
    formats::Reading {
        time: maps.iter().find(|map| map.column == 0).map(|map| &map.term),
        only: Some(only),
    }
}

/// Whether a log is made of a channel of this name.
fn is_wanted(maps: &[Mapping], name: &str) -> bool {
    let is_it = |wanted: &str| {
        let same =
            |own: &str| own.eq_ignore_ascii_case(wanted) || own.eq_ignore_ascii_case(units::bare(wanted));
        same(name) || same(units::bare(name)) || wanted.ends_with(&format!(".{name}"))
    };
    NAMES.into_iter().any(is_it) || maps.iter().any(|map| is_it(&map.term.channel))
}

/// A column's channel with what makes it SI.
struct Column<'a> {
    group: &'a Group,
    series: &'a Series,
    scale: f64,
}

fn of_channels(
    mut recording: Recording,
    maps: &[Mapping],
    how: &bus_trace::Recording<'_>,
) -> Result<(DriveLog, Vec<String>), LogError> {
    let manual = how.manual;
    let (mut notes, mut missing) = (Vec::new(), Vec::new());
    let mut columns: [Option<Column<'_>>; 6] = Default::default();
    // The time is the group's own, found by the reader.
    for (i, column) in columns.iter_mut().enumerate().skip(1) {
        let map = maps.iter().find(|map| map.column == i);
        let (group, series) = match recording.find(map.map_or(NAMES[i], |map| &map.term.channel)) {
            Ok(found) => found,
            // It is there, but not once.
            Err(error)
                if recording
                    .groups
                    .iter()
                    .flat_map(|group| &group.channels)
                    .any(|own| own.name == NAMES[i]) =>
            {
                return Err(error.into());
            }
            Err(_) if manual && i == GUIDANCE && map.is_none() => continue,
            Err(_) if map.is_none() => {
                missing.push(NAMES[i]);
                continue;
            }
            Err(error) => return Err(error.into()),
        };
        let scale = factor(series, i, map)?;
        if scale != 1.0 {
            notes.push(converted(series, i, map, scale));
        }
        *column = Some(Column { group, series, scale });
    }
    if let Some(error) = missing.iter().find_map(|name| recording.notes.left_out(name)) {
        return Err(error.into());
    }
    if !missing.is_empty() {
        return refuse(are_missing(&recording, &missing));
    }
    let one = columns
        .iter()
        .flatten()
        .all(|c| std::ptr::eq(c.group, columns[DRIVER].as_ref().map_or(c.group, |d| d.group)));
    let speeds = speeds(&recording, maps, &mut notes)?;
    let (time_s, values, lines) = if one {
        let places = columns.map(|column| column.map(|column| column.place(&recording)));
        rows(&mut recording, &places)
    } else {
        let (time_s, values) = at_the_torque(&columns, &mut notes)?;
        (time_s, values, Lines::default())
    };
    let mut log = DriveLog::from_rows(time_s, values, manual, (&lines, how.stretches))?;
    log.findings.extend(recording.notes.iter().map(Note::finding));
    if let Some(ends) = speeds {
        log.tell_speed(&ends);
        notes.extend(fast(&log));
    }
    Ok((log.thinned(), notes))
}

/// Which columns a recording lacks, with what is like them.
fn are_missing(recording: &Recording, names: &[&str]) -> String {
    if let [name] = names
        && let Err(error) = recording.find(name)
    {
        return format!("{error}; --map {name}=CHANNEL names another one");
    }
    let with_near = |name: &&str| match recording.like(name).first() {
        Some(near) => format!("{name} (there is {near})"),
        None => (*name).to_owned(),
    };
    let names: Vec<String> = names.iter().map(with_near).collect();
    let names = names.join(", ");
    format!("there are no channels {names}; --map NAME=CHANNEL names others")
}

/// What a channel's values are multiplied by to be a column's.
fn factor(series: &Series, column: usize, map: Option<&Mapping>) -> Result<f64, RecordingError> {
    let own = || Term {
        channel: series.name.clone(),
        factor: None,
    };
    let term = map.map_or_else(own, |map| map.term.clone());
    term.factor(series, UNITS[column])
}

fn converted(series: &Series, column: usize, map: Option<&Mapping>, scale: f64) -> String {
    let said = map.map(|map| map.term.channel.as_str());
    let said = said.filter(|said| units::in_brackets(said).is_some());
    let own = || format!("{} ({:?})", series.name, series.unit);
    let channel = said.map_or_else(own, str::to_owned);
    format!("{} is {channel} times {scale}", NAMES[column])
}

type Values = [Option<Vec<f64>>; 6];

/// Where a column stands: its group, its channel there, and what makes it SI.
type Place = (usize, usize, f64);

impl Column<'_> {
    fn place(&self, recording: &Recording) -> Place {
        let is_group = |group: &Group| std::ptr::eq(group, self.group);
        let is_series = |series: &Series| std::ptr::eq(series, self.series);
        let group = recording.groups.iter().position(is_group);
        let series = self.group.channels.iter().position(is_series);
        (group.unwrap_or(0), series.unwrap_or(0), self.scale)
    }
}

/// The columns as the table has them, taken out of it: of a drive of many hours two copies are too many.
fn rows(recording: &mut Recording, places: &[Option<Place>; 6]) -> (Vec<f64>, Values, Lines) {
    let values = std::array::from_fn(|i| {
        let (group, channel, scale) = places[i]?;
        let is_same = |other: &Place| (other.0, other.1) == (group, channel);
        let is_wanted_again = places[i + 1..].iter().flatten().any(is_same);
        let series = &mut recording.groups[group].channels[channel];
        let mut values = match is_wanted_again {
            true => series.values.clone(),
            false => std::mem::take(&mut series.values),
        };
        if scale != 1.0 {
            values.iter_mut().for_each(|value| *value *= scale);
        }
        Some(values)
    });
    let first = places.iter().flatten().next().map_or(0, |place| place.0);
    match recording.groups.get_mut(first) {
        Some(group) => (
            std::mem::take(&mut group.time_s),
            values,
            std::mem::take(&mut group.lines),
        ),
        None => (Vec::new(), values, Lines::default()),
    }
}
