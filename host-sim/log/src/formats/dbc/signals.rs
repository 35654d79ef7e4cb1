//! The signals of a log as channels: all at once, or as they are needed.

use std::collections::BTreeMap;

use can_dbc::{Dbc, Signal};

use super::decode::{Row, decode, heading, names};
use super::parse;
use crate::bus;
use crate::formats::{BusLog, Only, csv};
use crate::notes::Notes;
use crate::recording::grid::{Grid, OnGrid, Seen};
use crate::recording::{Group, Line, Recording, RecordingError, Series, rate_hz, refuse};

/// Every message of the DBC file that is among the frames, its signals in the file's units. A signal that a frame does not
/// carry (multiplexed, or beyond its end) is NaN there. Those that `only` does not want are named and not kept.
///
/// # Errors
/// A log that cannot be read; a clock that stands still; no message that is known.
pub fn channels(log: &BusLog, dbc: &[u8], only: Only<'_>) -> Result<Recording, RecordingError> {
    let (dbc, mut notes) = parse(dbc)?;
    let is_wanted = |signal: &&Signal| only.is_none_or(|only| only(&signal.name));
    // The instants of a course, and the values of each signal by its place in the message.
    type Columns = (Vec<f64>, Vec<(usize, Vec<f64>)>);
    let mut columns: Vec<Columns> = Vec::new();
    let (courses, read) = decode(log, &dbc, &mut |row: Row<'_>| {
        if row.course == columns.len() {
            let signals = dbc.messages[row.message].signals.iter().enumerate();
            let wanted = signals.filter(|(_, signal)| is_wanted(signal));
            columns.push((Vec::new(), wanted.map(|(i, _)| (i, Vec::new())).collect()));
        }
        let (time_s, values) = &mut columns[row.course];
        if values.is_empty() {
            return Ok(());
        }
        if row.instead_of.is_some() {
            time_s.pop();
        }
        time_s.push(row.time_s);
        for (i, column) in values {
            column.truncate(time_s.len() - 1);
            column.push(row.values[*i]);
        }
        Ok(())
    })?;
    notes.append(read);
    let mut recording = Recording {
        notes,
        ..Recording::default()
    };
    let mut columns: Vec<_> = courses.iter().zip(names(&courses, &dbc)).zip(columns).collect();
    columns.sort_by_key(|((course, _), _)| course.message);
    for ((course, name), (time_s, values)) in columns {
        let signals = &dbc.messages[course.message].signals;
        let unread = signals.iter().filter(|signal| !is_wanted(signal));
        recording.unread.extend(unread.map(|signal| signal.name.clone()));
        let channels = values.into_iter().map(|(i, values)| Series {
            values,
            ..heading(&dbc, course, &signals[i])
        });
        let group = Group::new(time_s, channels.collect());
        if !group.channels.is_empty() {
            recording.groups.push(Group { name, ..group });
        }
    }
    Ok(recording)
}

/// A channel of a log: in which group, and what there is of it.
struct Found {
    group: String,
    heading: Series,
    seen: Seen,
}

/// The channels of a log, whose values are read anew each time that they are needed: a night of them fills a memory.
pub struct Signals<'a> {
    log: &'a BusLog,
    dbc: Dbc,
    /// In the order of the file that says what frames mean.
    channels: Vec<Found>,
    /// Where the channels of each course begin.
    places: Vec<usize>,
    /// What was left out, merged or cut.
    pub notes: Notes,
}

impl<'a> Signals<'a> {
    /// Reads the log to see which channels it has.
    ///
    /// # Errors
    /// As of [`channels`].
    pub fn of(log: &'a BusLog, dbc: &[u8]) -> Result<Self, RecordingError> {
        let (dbc, mut notes) = parse(dbc)?;
        let mut seen: Vec<Vec<Seen>> = Vec::new();
        let (courses, read) = decode(log, &dbc, &mut |row: Row<'_>| {
            if row.course == seen.len() {
                seen.push(vec![Seen::default(); row.values.len()]);
            }
            for (i, (seen, value)) in seen[row.course].iter_mut().zip(row.values).enumerate() {
                let is_new = row.instead_of.is_none_or(|before| before[i].is_nan());
                if is_new && !value.is_nan() {
                    seen.take(row.time_s, *value);
                }
                seen.is_whole &= value.is_nan() || value.fract() == 0.0;
            }
            Ok(())
        })?;
        notes.append(read);
        let mut order: Vec<usize> = (0..courses.len()).collect();
        order.sort_by_key(|course| courses[*course].message);
        let names = names(&courses, &dbc);
        let (mut channels, mut places) = (Vec::new(), vec![0; courses.len()]);
        for course in order {
            places[course] = channels.len();
            let signals = dbc.messages[courses[course].message].signals.iter();
            channels.extend(signals.zip(&seen[course]).map(|(signal, seen)| Found {
                group: names[course].clone(),
                heading: heading(&dbc, &courses[course], signal),
                seen: seen.clone(),
            }));
        }
        Ok(Self {
            log,
            dbc,
            channels,
            places,
            notes,
        })
    }

    /// The table of channels.
    #[must_use]
    pub fn table(&self) -> Vec<Line> {
        let line = |channel: &Found| {
            let Seen { span_s, samples, .. } = channel.seen;
            Line {
                name: self.name(channel),
                unit: channel.heading.unit.clone(),
                source: channel.heading.source.clone(),
                sample_rate_hz: rate_hz(samples, span_s[1] - span_s[0]),
                samples,
            }
        };
        self.channels.iter().map(line).collect()
    }

    /// Its name, with that of its group where another channel has it too.
    fn name(&self, channel: &Found) -> String {
        let name = &channel.heading.name;
        match self
            .channels
            .iter()
            .filter(|other| other.heading.name == *name)
            .count()
        {
            1 => name.clone(),
            _ => format!("{}.{name}", channel.group),
        }
    }

    /// All channels on an even grid, as [`Recording::resampled`] makes it.
    ///
    /// # Errors
    /// As there; as of [`channels`].
    pub fn resampled(&self, rate_hz: f64, longest_s: Option<f64>) -> Result<Group, RecordingError> {
        let names: Vec<String> = self.channels.iter().map(|channel| self.name(channel)).collect();
        let found = || {
            names
                .iter()
                .zip(&self.channels)
                .filter(|(_, channel)| channel.seen.samples > 0)
        };
        let grid = Grid::over(
            found().map(|(name, channel)| (&name[..], &channel.seen)),
            rate_hz,
            longest_s,
        )?;
        let course = |channel: &Found| {
            let name = &channel.heading.name;
            let mut same = self.channels.iter().filter(|other| other.heading.name == *name);
            OnGrid::new(same.all(|other| other.seen.is_whole))
        };
        let mut courses: Vec<OnGrid> = self.channels.iter().map(course).collect();
        decode(self.log, &self.dbc, &mut |row: Row<'_>| {
            let own = courses[self.places[row.course]..].iter_mut().zip(row.values);
            for (course, value) in own.filter(|(_, value)| !value.is_nan()) {
                course.take(&grid, row.time_s, *value);
            }
            Ok(())
        })?;
        let channels = names.iter().zip(&self.channels).zip(courses);
        let channels = channels.filter(|((_, channel), _)| channel.seen.samples > 0);
        let channels = channels.map(|((name, channel), course)| Series {
            name: name.clone(),
            values: course.finish(&grid),
            ..channel.heading.clone()
        });
        Ok(Group::new(grid.instants(), channels.collect()))
    }

    /// Writes all channels as a CSV file, a row an instant. Rows wait until no earlier one can come.
    ///
    /// # Errors
    /// What the disk says; buses whose clocks are further apart than rows wait.
    pub fn write_csv(&self, out: impl std::io::Write) -> Result<(), RecordingError> {
        let headings = self.channels.iter().map(|channel| Series {
            name: self.name(channel),
            ..channel.heading.clone()
        });
        let headings: Vec<Series> = headings.collect();
        let mut table = csv::begin(out, &headings)?;
        let mut fields = vec![String::new(); headings.len() + 1];
        let mut write = |time_s: f64, cells: Vec<(usize, f64)>| {
            fields.iter_mut().for_each(String::clear);
            fields[0] = csv::text(time_s);
            for (place, value) in cells {
                fields[place + 1] = csv::text(value);
            }
            table.row(&fields).map_err(refuse)
        };
        let mut waiting: BTreeMap<i64, (f64, Vec<(usize, f64)>)> = BTreeMap::new();
        let mut written = i64::MIN;
        decode(self.log, &self.dbc, &mut |row: Row<'_>| {
            // A negative zero is the instant of zero.
            let time_s = row.time_s + 0.0;
            if order(time_s) <= written {
                let why =
                    "the clocks of its buses are more than a second apart: choose one of them with --bus";
                return Err(why.into());
            }
            let from = self.places[row.course];
            let (_, cells) = waiting
                .entry(order(time_s))
                .or_insert_with(|| (time_s, Vec::new()));
            cells.retain(|(place, _)| !(from..from + row.values.len()).contains(place));
            let values = (from..).zip(row.values.iter().copied());
            cells.extend(values.filter(|(_, value)| !value.is_nan()));
            while let Some(first) = waiting.first_entry()
                && first.get().0 < row.time_s - bus::DISORDER_S
            {
                written = *first.key();
                let (time_s, cells) = first.remove();
                write(time_s, cells)?;
            }
            Ok(())
        })?;
        let mut rest = waiting.into_values();
        rest.try_for_each(|(time_s, cells)| write(time_s, cells))?;
        table.finish().map_err(refuse)
    }
}

/// A number that is in order as the instant is.
const fn order(time_s: f64) -> i64 {
    let bits = time_s.to_bits() as i64;
    bits ^ (((bits >> 63) as u64) >> 1) as i64
}
