//! Frames as they become values: one pass, in which nothing but the latest row of each message is kept.

use std::collections::HashMap;

use can_dbc::{Dbc, Signal};

use super::{Meaning, identifier, is_carried, meanings, raw};
use crate::bus::BusFrame;
use crate::formats::BusLog;
use crate::notes::{Fate, Notes, Part};
use crate::recording::{RecordingError, Series};

/// The frames of one message on one bus, as they are decoded.
pub(super) struct Course {
    bus: String,
    pub(super) message: usize,
    time_s: f64,
    values: Vec<f64>,
    frames: u64,
    /// Frames that had another value of a signal at the instant of the frame before.
    contradicted: u64,
}

/// A row of one message: its instant, its values, and those of the row that it replaces because it has its instant.
pub(super) struct Row<'a> {
    pub(super) course: usize,
    pub(super) message: usize,
    pub(super) time_s: f64,
    pub(super) values: &'a [f64],
    pub(super) instead_of: Option<&'a [f64]>,
}

/// Frames that differ at one instant are too many if they are so many times as rare: the clock stands still.
const MOST_CONTRADICTED: u64 = 3;

/// What is done with a row.
type Take<'a> = dyn FnMut(Row<'_>) -> Result<(), RecordingError> + 'a;

/// Decodes a log frame by frame. Every course is one message of one bus, in the order in which they were first heard.
pub(super) fn decode(
    log: &BusLog,
    dbc: &Dbc,
    take: &mut Take<'_>,
) -> Result<(Vec<Course>, Notes), RecordingError> {
    let mut decoder = Decoder::of(dbc);
    let mut notes = log.each(&mut |frame: &BusFrame| decoder.frame(frame, take))?;
    let (courses, count) = (decoder.courses, decoder.frames);
    if courses.is_empty() {
        return Err(format!("none of the {count} frames is a message of the DBC file").into());
    }
    for course in &courses {
        let (contradicted, frames) = (course.contradicted, course.frames);
        let name = &dbc.messages[course.message].name;
        if contradicted * MOST_CONTRADICTED > frames {
            return Err(format!(
                "message {name}: {contradicted} of {frames} frames have the time stamp of the frame before and other values: \
                 the time stands still, or the stamps are differences (candump -t d); record with candump -L"
            )
            .into());
        }
    }
    notes.append(decoder.notes);
    Ok((courses, notes))
}

struct Decoder<'a> {
    messages: Vec<Vec<Meaning<'a>>>,
    by_id: HashMap<(u32, bool), usize>,
    courses: Vec<Course>,
    /// The courses of each message, one a bus.
    of_message: Vec<Vec<usize>>,
    notes: Notes,
    frames: u64,
    now: Vec<f64>,
    before: Vec<f64>,
}

impl<'a> Decoder<'a> {
    fn of(dbc: &'a Dbc) -> Self {
        let places = dbc.messages.iter().enumerate();
        Self {
            messages: dbc
                .messages
                .iter()
                .map(|message| meanings(dbc, message))
                .collect(),
            by_id: places.map(|(i, m)| (identifier(m.id), i)).collect(),
            courses: Vec::new(),
            of_message: vec![Vec::new(); dbc.messages.len()],
            notes: Notes::default(),
            frames: 0,
            now: Vec::new(),
            before: Vec::new(),
        }
    }

    fn frame(&mut self, frame: &BusFrame, take: &mut Take<'_>) -> Result<(), RecordingError> {
        self.frames += 1;
        let place = format_args!("line {}", frame.line);
        let Some(&message) = self.by_id.get(&(frame.id, frame.extended)) else {
            let why = "no message of the DBC file";
            self.notes.count(Fate::LeftOut, Part::Frame, why, place);
            return Ok(());
        };
        let missing = self.values(message, &frame.data);
        let why = "the frame is too short for the signal";
        self.notes
            .count_many(Fate::LeftOut, Part::Value, why, missing, place);
        let mut own = self.of_message[message].iter().copied();
        let known = own.find(|&course| self.courses[course].bus == frame.bus);
        let course = known.unwrap_or_else(|| self.begin(message, frame));
        let known = &mut self.courses[course];
        known.frames += 1;
        let is_again = known.frames > 1 && frame.time_s <= known.time_s;
        if is_again {
            self.before.clone_from(&known.values);
            let differs = |(now, before): (&f64, &f64)| !now.is_nan() && !before.is_nan() && now != before;
            known.contradicted += u64::from(self.now.iter().zip(&self.before).any(differs));
            for (now, before) in self.now.iter_mut().zip(&self.before) {
                *now = if now.is_nan() { *before } else { *now };
            }
            let why = "with the stamp of the frame before";
            self.notes.count(Fate::Merged, Part::Frame, why, place);
        }
        known.time_s = frame.time_s;
        known.values.clone_from(&self.now);
        take(Row {
            course,
            message,
            time_s: frame.time_s,
            values: &self.now,
            instead_of: is_again.then_some(&self.before[..]),
        })
    }

    /// Decodes the signals; how many of those that the frame carries lie beyond its end.
    fn values(&mut self, message: usize, data: &[u8]) -> u64 {
        let meanings = &self.messages[message];
        let mut missing = 0;
        self.now.clear();
        for (i, meaning) in meanings.iter().enumerate() {
            let (bits, carried) = (raw(meaning.signal, data), is_carried(meanings, i, data));
            missing += u64::from(carried && bits.is_none());
            let bits = bits.filter(|_| carried);
            self.now.push(bits.map_or(f64::NAN, |bits| meaning.value(bits)));
        }
        missing
    }

    fn begin(&mut self, message: usize, frame: &BusFrame) -> usize {
        self.of_message[message].push(self.courses.len());
        self.courses.push(Course {
            bus: frame.bus.clone(),
            message,
            time_s: frame.time_s,
            values: Vec::new(),
            frames: 0,
            contradicted: 0,
        });
        self.courses.len() - 1
    }
}

/// The names of courses as groups: of the message; with its identifier where another message has its name, and with its bus
/// where it came from several.
pub(super) fn names(courses: &[Course], dbc: &Dbc) -> Vec<String> {
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

/// A channel without values.
pub(super) fn heading(dbc: &Dbc, course: &Course, signal: &Signal) -> Series {
    let message = &dbc.messages[course.message];
    Series {
        name: signal.name.clone(),
        unit: signal.unit.clone(),
        source: message.transmitter.clone().unwrap_or_default(),
        values: Vec::new(),
    }
}
