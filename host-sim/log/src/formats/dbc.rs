//! What frames mean: a DBC file's signals as channels, one group for each message of a bus.

use std::borrow::Cow;
use std::cmp::Ordering;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::ops::RangeInclusive;

use can_dbc::{
    ByteOrder, Dbc, Message, MessageId, MultiplexIndicator, Signal, SignalExtendedValueType, ValueType,
};

use super::{BusLog, Only, csv};
use crate::bus::{self, BusFrame};
use crate::notes::{Fate, Notes, Part};
use crate::recording::grid::{Grid, OnGrid, Seen};
use crate::recording::{Group, Line, Recording, RecordingError, Series, rate_hz, refuse};

/// Identifier of a message, and whether it has 29 bits.
#[must_use]
pub const fn identifier(id: MessageId) -> (u32, bool) {
    match id {
        MessageId::Standard(id) => (id as u32, false),
        MessageId::Extended(id) => (id, true),
    }
}

/// Words behind which an identifier stands.
const BEFORE_AN_IDENTIFIER: [&str; 7] = [
    "BO_",
    "SG_",
    "VAL_",
    "SIG_VALTYPE_",
    "SG_MUL_VAL_",
    "BO_TX_BU_",
    "SIG_GROUP_",
];
/// The bit of an identifier that says that it has 29 bits.
const IS_EXTENDED: u32 = 1 << 31;
/// The message of signals that are in none.
const NO_MESSAGE: &str = "VECTOR__INDEPENDENT_SIG_MSG";

/// Reads a DBC file, in UTF-8 or in the encoding of Windows. Identifiers above 7FF are taken as 29 bits even without their
/// bit 31.
///
/// # Errors
/// What cannot be read.
pub fn parse(bytes: &[u8]) -> Result<(Dbc, Notes), RecordingError> {
    let mut notes = Notes::default();
    let text = str::from_utf8(bytes).map(Cow::Borrowed).ok();
    let text = text.or_else(|| can_dbc::decode_cp1252(bytes)).unwrap_or_default();
    let (mut whole, mut before, mut named) = (String::with_capacity(text.len()), "", None);
    let mut beyond = HashSet::new();
    for word in text.split_inclusive(char::is_whitespace) {
        let bare = word.trim_end();
        let id = bare
            .parse::<u32>()
            .ok()
            .filter(|_| BEFORE_AN_IDENTIFIER.contains(&before));
        match id {
            // can-dbc cuts them to 16 bits.
            Some(id @ 0x800..IS_EXTENDED) => {
                whole += &(id | IS_EXTENDED).to_string();
                whole += &word[bare.len()..];
            }
            _ => whole += word,
        }
        if let Some(id) = id.filter(|_| before == "BO_") {
            named = Some(id);
        } else if let Some(id) = named.take_if(|_| !bare.is_empty()) {
            let name = bare.trim_end_matches(':');
            if id & !IS_EXTENDED > 0x1FFF_FFFF && name != NO_MESSAGE {
                notes.channel(Fate::LeftOut, name, "an identifier of more than 29 bits");
                beyond.insert(name.to_owned());
            } else if (0x800..IS_EXTENDED).contains(&id) {
                let why = "an identifier above 7FF without bit 31 has 29 bits";
                notes.channel(Fate::Guessed, name, why);
            }
        }
        before = if bare.is_empty() { before } else { bare };
    }
    let mut dbc = Dbc::try_from(whole.as_str())
        .map_err(|e| RecordingError(format!("the DBC file is not understood: {e}")))?;
    let mut known = HashSet::new();
    dbc.messages.retain(|message| {
        let why = match message.id {
            _ if message.name == NO_MESSAGE || beyond.contains(&message.name) => None,
            id if known.insert(identifier(id)) => return true,
            _ => Some("another message has its identifier"),
        };
        if let Some(why) = why {
            notes.channel(Fate::LeftOut, &message.name, why);
        }
        false
    });
    Ok((dbc, notes))
}

/// The bits of a signal with its sign; none if the frame is too short.
#[must_use]
pub fn raw(signal: &Signal, data: &[u8]) -> Option<i64> {
    let size = usize::try_from(signal.size)
        .ok()
        .filter(|size| (1..=64).contains(size))?;
    let start = usize::try_from(signal.start_bit)
        .ok()
        .filter(|start| *start < 8 * data.len())?;
    // Nine bytes hold 64 bits from any bit on.
    let mut bytes = [0; 16];
    let mut copy = |from: usize| {
        let part = &data[from..data.len().min(from + 9)];
        bytes[..part.len()].copy_from_slice(part);
        bytes
    };
    // To the top, and back down with or without the sign.
    let top = match signal.byte_order {
        ByteOrder::LittleEndian => {
            if start + size > 8 * data.len() {
                return None;
            }
            let bits = (u128::from_le_bytes(copy(start / 8)) >> (start % 8)) as u64;
            bits << (64 - size)
        }
        // The start is the highest bit: byte and place in it, counted from the top of the frame.
        ByteOrder::BigEndian => {
            let first = 7 - start % 8;
            if start / 8 * 8 + first + size > 8 * data.len() {
                return None;
            }
            ((u128::from_be_bytes(copy(start / 8)) << first) >> 64) as u64
        }
    };
    Some(match signal.value_type {
        ValueType::Signed => (top as i64) >> (64 - size),
        ValueType::Unsigned => (top >> (64 - size)) as i64,
    })
}

/// A signal with what decides its value.
struct Meaning<'a> {
    signal: &'a Signal,
    float: Option<&'a SignalExtendedValueType>,
    /// The signal that switches it on, by its place in the message, and the values with which it does.
    switch: Option<(usize, Vec<RangeInclusive<u64>>)>,
}

/// The signals of a message.
fn meanings<'a>(dbc: &'a Dbc, message: &'a Message) -> Vec<Meaning<'a>> {
    let place = |name: &str| message.signals.iter().position(|signal| signal.name == name);
    let plain = |s: &Signal| s.multiplexer_indicator == MultiplexIndicator::Multiplexor;
    let first = message.signals.iter().position(plain);
    let meaning = |signal: &'a Signal| {
        let of_signal = |id: MessageId, name: &str| id == message.id && name == signal.name;
        let mut kinds = dbc.signal_extended_value_type_list.iter();
        let kind = kinds.find(|entry| of_signal(entry.message_id, &entry.signal_name));
        let mut extended = dbc.extended_multiplex.iter();
        let extended = extended.find(|entry| of_signal(entry.message_id, &entry.signal_name));
        let switch = match (extended, signal.multiplexer_indicator) {
            (Some(entry), _) => place(&entry.multiplexor_signal_name).map(|switch| {
                let ranges = entry.mappings.iter();
                (
                    switch,
                    ranges.map(|range| range.min_value..=range.max_value).collect(),
                )
            }),
            (None, MultiplexIndicator::MultiplexedSignal(value))
            | (None, MultiplexIndicator::MultiplexorAndMultiplexedSignal(value)) => {
                first.map(|switch| (switch, vec![value..=value]))
            }
            _ => None,
        };
        Meaning {
            signal,
            float: kind.map(|entry| &entry.signal_extended_value_type),
            switch,
        }
    };
    message.signals.iter().map(meaning).collect()
}

/// Whether a frame carries a signal: its switch is there and has a value with which it is. A switch may be switched itself.
fn is_carried(meanings: &[Meaning<'_>], place: usize, data: &[u8]) -> bool {
    let mut place = place;
    // A file whose switches wait for each other carries nothing.
    for _ in 0..=meanings.len() {
        let Some((switch, values)) = &meanings[place].switch else {
            return true;
        };
        let now = raw(meanings[*switch].signal, data).map(|now| now as u64);
        if !now.is_some_and(|now| values.iter().any(|range| range.contains(&now))) {
            return false;
        }
        place = *switch;
    }
    false
}

impl Meaning<'_> {
    fn value(&self, bits: i64) -> f64 {
        let number = match self.float {
            Some(SignalExtendedValueType::IEEEfloat32Bit) => f64::from(f32::from_bits(bits as u32)),
            Some(SignalExtendedValueType::IEEEdouble64bit) => f64::from_bits(bits as u64),
            _ if self.signal.value_type == ValueType::Unsigned => bits as u64 as f64,
            _ => bits as f64,
        };
        number * self.signal.factor + self.signal.offset
    }
}

/// The frames of one message on one bus, as they are decoded.
struct Course {
    bus: String,
    message: usize,
    time_s: f64,
    values: Vec<f64>,
    frames: u64,
    /// Frames that had another value of a signal at the instant of the frame before.
    contradicted: u64,
}

/// A row of one message: its instant, its values, and those of the row that it replaces because it has its instant.
struct Row<'a> {
    course: usize,
    message: usize,
    time_s: f64,
    values: &'a [f64],
    instead_of: Option<&'a [f64]>,
}

/// Frames that differ at one instant are too many if they are so many times as rare: the clock stands still.
const MOST_CONTRADICTED: u64 = 3;

/// Decodes a log frame by frame. Every course is one message of one bus, in the order in which they were first heard.
fn decode(
    log: &BusLog,
    dbc: &Dbc,
    row: &mut dyn FnMut(Row<'_>) -> Result<(), RecordingError>,
) -> Result<(Vec<Course>, Notes), RecordingError> {
    let messages: Vec<Vec<Meaning<'_>>> = dbc
        .messages
        .iter()
        .map(|message| meanings(dbc, message))
        .collect();
    let places = dbc.messages.iter().enumerate();
    let by_id: HashMap<(u32, bool), usize> = places.map(|(i, m)| (identifier(m.id), i)).collect();
    let mut courses: Vec<Course> = Vec::new();
    let mut of_message: Vec<Vec<usize>> = vec![Vec::new(); messages.len()];
    let (mut notes, mut now, mut before, mut frames) = (Notes::default(), Vec::new(), Vec::new(), 0_u64);
    let read = log.each(&mut |frame: &BusFrame| {
        frames += 1;
        let place = format_args!("line {}", frame.line);
        let Some(&message) = by_id.get(&(frame.id, frame.extended)) else {
            notes.count(Fate::LeftOut, Part::Frame, "no message of the DBC file", place);
            return Ok(());
        };
        let meanings = &messages[message];
        now.clear();
        let mut missing = 0;
        for (i, meaning) in meanings.iter().enumerate() {
            let bits = raw(meaning.signal, &frame.data);
            let carried = is_carried(meanings, i, &frame.data);
            missing += u64::from(carried && bits.is_none());
            now.push(
                bits.filter(|_| carried)
                    .map_or(f64::NAN, |bits| meaning.value(bits)),
            );
        }
        notes.count_many(
            Fate::LeftOut,
            Part::Value,
            "the frame is too short for the signal",
            missing,
            place,
        );
        let own = &mut of_message[message];
        let course = own
            .iter()
            .copied()
            .find(|&course| courses[course].bus == frame.bus);
        let Some(course) = course else {
            own.push(courses.len());
            courses.push(Course {
                bus: frame.bus.clone(),
                message,
                time_s: frame.time_s,
                values: now.clone(),
                frames: 1,
                contradicted: 0,
            });
            return row(Row {
                course: courses.len() - 1,
                message,
                time_s: frame.time_s,
                values: &now,
                instead_of: None,
            });
        };
        let known = &mut courses[course];
        known.frames += 1;
        let again = frame.time_s <= known.time_s;
        if again {
            before.clone_from(&known.values);
            let pairs = || now.iter().zip(&before);
            known.contradicted += u64::from(pairs().any(|(a, b)| !a.is_nan() && !b.is_nan() && a != b));
            for (now, before) in now.iter_mut().zip(&before) {
                *now = if now.is_nan() { *before } else { *now };
            }
            notes.count(
                Fate::Merged,
                Part::Frame,
                "with the stamp of the frame before",
                place,
            );
        }
        known.time_s = frame.time_s;
        known.values.clone_from(&now);
        row(Row {
            course,
            message,
            time_s: frame.time_s,
            values: &now,
            instead_of: again.then_some(&before[..]),
        })
    })?;
    if courses.is_empty() {
        return Err(format!("none of the {frames} frames is a message of the DBC file").into());
    }
    for course in &courses {
        let (contradicted, frames, name) = (
            course.contradicted,
            course.frames,
            &dbc.messages[course.message].name,
        );
        if contradicted * MOST_CONTRADICTED > frames {
            return Err(format!(
                "message {name}: {contradicted} of {frames} frames have the time stamp of the frame before and other values: \
                 the time stands still, or the stamps are differences (candump -t d); record with candump -L"
            )
            .into());
        }
    }
    let mut all = read;
    all.append(notes);
    Ok((courses, all))
}

/// The names of courses as groups: of the message; with its identifier where another message has its name, and with its bus
/// where it came from several.
fn names(courses: &[Course], dbc: &Dbc) -> Vec<String> {
    let name = |course: &Course| {
        let message = &dbc.messages[course.message];
        let mut name = message.name.clone();
        if dbc.messages.iter().filter(|other| other.name == name).count() > 1 {
            let (id, extended) = identifier(message.id);
            name += &format!("_0x{id:0width$X}", width = if extended { 8 } else { 3 });
        }
        match courses
            .iter()
            .filter(|other| other.message == course.message)
            .count()
        {
            1 => name,
            _ => format!("{}.{name}", course.bus),
        }
    };
    courses.iter().map(name).collect()
}

fn heading(dbc: &Dbc, course: &Course, signal: &Signal) -> Series {
    let message = &dbc.messages[course.message];
    Series {
        name: signal.name.clone(),
        unit: signal.unit.clone(),
        source: message.transmitter.clone().unwrap_or_default(),
        values: Vec::new(),
    }
}

/// Every message of the DBC file that is among the frames, its signals in the file's units. A signal that a frame does not
/// carry (multiplexed, or beyond its end) is NaN there. Those that `only` does not want are named and not kept.
///
/// # Errors
/// A log that cannot be read; a clock that stands still; no message that is known.
pub fn channels(log: &BusLog, dbc: &[u8], only: Only<'_>) -> Result<Recording, RecordingError> {
    let (dbc, mut notes) = parse(dbc)?;
    let is_wanted = |signal: &&Signal| only.is_none_or(|only| only(&signal.name));
    let mut columns: Vec<(Vec<f64>, Vec<(usize, Vec<f64>)>)> = Vec::new();
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
        let mut write = |instant: Instant, cells: Vec<(usize, f64)>| {
            fields.iter_mut().for_each(String::clear);
            fields[0] = csv::text(instant.0);
            for (place, value) in cells {
                fields[place + 1] = csv::text(value);
            }
            table.row(&fields).map_err(refuse)
        };
        let mut waiting: BTreeMap<Instant, Vec<(usize, f64)>> = BTreeMap::new();
        let mut written = Instant(f64::NEG_INFINITY);
        decode(self.log, &self.dbc, &mut |row: Row<'_>| {
            // A negative zero is the instant of zero.
            let now = Instant(row.time_s + 0.0);
            if now <= written {
                return Err(
                    "the clocks of its buses are more than a second apart: choose one of them with --bus"
                        .into(),
                );
            }
            let from = self.places[row.course];
            let cells = waiting.entry(now).or_default();
            cells.retain(|(place, _)| !(from..from + row.values.len()).contains(place));
            let values = (from..).zip(row.values.iter().copied());
            cells.extend(values.filter(|(_, value)| !value.is_nan()));
            while let Some(first) = waiting.first_entry()
                && first.key().0 < row.time_s - bus::DISORDER_S
            {
                written = *first.key();
                write(written, first.remove())?;
            }
            Ok(())
        })?;
        waiting
            .into_iter()
            .try_for_each(|(instant, cells)| write(instant, cells))?;
        table.finish().map_err(refuse)
    }
}

/// An instant, in order.
#[derive(Clone, Copy)]
struct Instant(f64);

impl Ord for Instant {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl PartialOrd for Instant {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Instant {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Instant {}
