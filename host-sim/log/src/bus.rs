//! Frames of a bus as a log has them, and what every log's reader does with each.
//!
//! Not here: the formats of logs, and what the frames mean.

use std::collections::HashMap;
use std::io::{BufRead, Read};

use crate::notes::{Fate, Notes, Part};
use crate::recording::RecordingError;

/// A data frame with its time and the place where it stands in the log.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BusFrame {
    /// The line, or the object of a BLF file, from 1.
    pub line: usize,
    /// When it was received, s.
    pub time_s: f64,
    /// Its bus as the log names it: an interface (`can0`) or the number of a channel (`1`).
    pub bus: String,
    /// The identifier, 11 or 29 bits.
    pub id: u32,
    /// Whether the identifier has 29 bits.
    pub extended: bool,
    /// Classic CAN or CAN FD.
    pub form: Form,
    /// Whether the logger itself sent it.
    pub sent: bool,
    /// Up to 8 bytes, up to 64 in CAN FD.
    pub data: Vec<u8>,
}

/// What the frame looked like on the wire.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Form {
    /// Classic CAN.
    #[default]
    Classic,
    /// CAN FD.
    Fd {
        /// The data were sent at the second bit rate.
        switched: bool,
        /// The sender is error passive.
        passive: bool,
    },
}

impl Form {
    /// Most bytes that a frame has.
    #[must_use]
    pub const fn most_bytes(self) -> usize {
        match self {
            Self::Classic => 8,
            Self::Fd { .. } => 64,
        }
    }
}

/// Lengths of CAN FD by their codes.
const FD_LENGTHS: [u8; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];

/// The code of a length: the next one that CAN FD has.
pub(crate) fn length_code(bytes: usize) -> u8 {
    FD_LENGTHS
        .iter()
        .take_while(|has| usize::from(**has) < bytes)
        .count() as u8
}

/// What is done with each frame.
pub type Take<'a> = dyn FnMut(&BusFrame) -> Result<(), RecordingError> + 'a;

/// More buses than any logger has: the file is damaged.
const MOST_BUSES: usize = 256;
/// Frames of one bus come by the clock but for so much, s: drivers hand them on in batches.
pub(crate) const DISORDER_S: f64 = 1.0;

/// Takes the frames of one log: of the bus that is wanted, by a clock that goes on. What is left out is counted.
pub(crate) struct Intake<'a> {
    wanted: Option<&'a str>,
    take: &'a mut Take<'a>,
    /// What its frames are counted in: `line` or `object`.
    unit: &'static str,
    pub(crate) notes: Notes,
    /// Every bus with its latest stamp.
    buses: Vec<(String, f64)>,
    /// The latest stamp of each message of a bus.
    last_s: HashMap<(usize, u32, bool), f64>,
    taken: u64,
    misread: Option<String>,
}

impl<'a> Intake<'a> {
    pub(crate) fn new(unit: &'static str, wanted: Option<&'a str>, take: &'a mut Take<'a>) -> Self {
        Self {
            wanted,
            take,
            unit,
            notes: Notes::default(),
            buses: Vec::new(),
            last_s: HashMap::new(),
            taken: 0,
            misread: None,
        }
    }

    pub(crate) fn frame(&mut self, frame: &BusFrame) -> Result<(), RecordingError> {
        let bus = self.bus(frame)?;
        if self.wanted.is_some_and(|wanted| wanted != frame.bus) {
            self.left_out(Part::Frame, "of another bus", frame.line);
            return Ok(());
        }
        self.check_clock(bus, frame)?;
        self.taken += 1;
        (self.take)(frame)
    }

    /// Place of the frame's bus.
    fn bus(&mut self, frame: &BusFrame) -> Result<usize, RecordingError> {
        if let Some(place) = self.buses.iter().position(|(name, _)| *name == frame.bus) {
            return Ok(place);
        }
        if self.buses.len() == MOST_BUSES {
            let (unit, line) = (self.unit, frame.line);
            return Err(format!("{unit} {line}: more than {MOST_BUSES} buses: the file is damaged").into());
        }
        self.buses.push((frame.bus.clone(), f64::NEG_INFINITY));
        Ok(self.buses.len() - 1)
    }

    /// A stamp that goes back belongs to another clock: no message could be put in order with another.
    fn check_clock(&mut self, bus: usize, frame: &BusFrame) -> Result<(), RecordingError> {
        let now_s = frame.time_s;
        let key = (bus, frame.id, frame.extended);
        let before_s = self.last_s.insert(key, now_s).unwrap_or(f64::NEG_INFINITY);
        let latest_s = &mut self.buses[bus].1;
        let from_s = if now_s < before_s { before_s } else { *latest_s };
        if now_s < before_s || now_s < *latest_s - DISORDER_S {
            return Err(format!(
                "{} {}: the time goes back from {from_s} to {now_s} s: a clock that wrapped or was set, two recordings in one \
                 file, or differences of stamps (candump -t d); cut the file there, or record with candump -L",
                self.unit, frame.line
            )
            .into());
        }
        *latest_s = latest_s.max(now_s);
        Ok(())
    }

    pub(crate) fn left_out(&mut self, part: Part, why: &str, line: usize) {
        let place = format_args!("{} {line}", self.unit);
        self.notes.count(Fate::LeftOut, part, why, place);
    }

    /// Counts a line that is no frame as one has to be.
    pub(crate) fn misread(&mut self, line: usize, why: &str, content: &str) {
        self.left_out(Part::Line, why, line);
        self.misread
            .get_or_insert_with(|| format!("line {line}: {why}: {content:?}"));
    }

    /// What was left out of the log.
    ///
    /// # Errors
    /// It has no frame that is wanted.
    pub(crate) fn finish(self) -> Result<Notes, RecordingError> {
        if self.taken > 0 {
            return Ok(self.notes);
        }
        if let Some(wanted) = self.wanted.filter(|_| !self.buses.is_empty()) {
            let names: Vec<&str> = self.buses.iter().map(|(name, _)| name.as_str()).collect();
            let names = names.join(", ");
            return Err(format!("no frame is of the bus {wanted}; there are {names}").into());
        }
        if let Some(sentence) = self.misread {
            return Err(sentence.into());
        }
        Err(format!("there is no data frame in it{}", self.notes.aside()).into())
    }
}

/// What a line of a text log holds that can be read.
pub(crate) enum Line {
    /// A data frame.
    Frame,
    /// Nothing that is looked for.
    Nothing,
    /// Something that is left out.
    Other(Part, &'static str),
}

/// Longest line that is read as one: a frame of 64 bytes with all that loggers write about it has 400 characters.
const LONGEST_LINE: u64 = 16 << 10;

/// Reads a text line by line: `parse` fills the frame, or says why it cannot.
pub(crate) fn read_lines(
    input: &mut dyn BufRead,
    intake: &mut Intake<'_>,
    mut parse: impl FnMut(&str, &mut BusFrame, &mut Notes) -> Result<Line, &'static str>,
) -> Result<(), RecordingError> {
    let (mut bytes, mut frame) = (Vec::new(), BusFrame::default());
    loop {
        bytes.clear();
        let read = input.take(LONGEST_LINE).read_until(b'\n', &mut bytes);
        if read.map_err(|e| RecordingError(e.to_string()))? == 0 {
            return Ok(());
        }
        frame.line += 1;
        // Some loggers write names in the encoding of their country: those bytes are not looked at.
        let text = String::from_utf8_lossy(&bytes);
        let content = text.trim();
        match parse(content, &mut frame, &mut intake.notes) {
            Ok(Line::Frame) => intake.frame(&frame)?,
            Ok(Line::Nothing) => {}
            Ok(Line::Other(part, why)) => intake.left_out(part, why, frame.line),
            Err(why) => intake.misread(frame.line, why, content),
        }
    }
}

/// A number of seconds; with a decimal comma too, which is counted.
pub(crate) fn seconds(word: &str, line: usize, notes: &mut Notes) -> Option<f64> {
    let finite = |word: &str| word.parse().ok().filter(|t: &f64| t.is_finite());
    finite(word).or_else(|| {
        let time_s = finite(&word.replacen(',', ".", 1))?;
        notes.count(
            Fate::Converted,
            Part::Stamp,
            "decimal comma",
            format_args!("line {line}"),
        );
        Some(time_s)
    })
}

/// Bytes in digits of a base, into `data`.
pub(crate) fn bytes_into<'t>(
    words: impl Iterator<Item = &'t str>,
    base: u32,
    data: &mut Vec<u8>,
) -> Option<()> {
    data.clear();
    for word in words {
        data.push(u8::from_str_radix(word, base).ok()?);
    }
    Some(())
}

/// Numbers for the names of buses, in formats that number their channels.
#[derive(Default)]
pub(crate) struct Numbers(Vec<(String, u16)>);

impl Numbers {
    /// A number is itself, and `can0` channel 1, as python-can has it; a name whose number is taken has the next one.
    pub(crate) fn of(&mut self, bus: &str) -> u16 {
        if let Some((_, number)) = self.0.iter().find(|(name, _)| name == bus) {
            return *number;
        }
        let name = bus.trim_end_matches(|c: char| c.is_ascii_digit());
        let own = bus[name.len()..].parse::<u16>().ok();
        let own = own.and_then(|own| {
            if name.is_empty() {
                Some(own)
            } else {
                own.checked_add(1)
            }
        });
        let is_free = |number: &u16| self.0.iter().all(|(_, taken)| taken != number);
        let number = own.filter(is_free).or_else(|| (1..u16::MAX).find(is_free));
        let number = number.unwrap_or_default();
        self.0.push((bus.to_owned(), number));
        number
    }

    /// What names became, where the number does not tell.
    pub(crate) fn tell(&self, notes: &mut Notes) {
        for (name, number) in &self.0 {
            if interface(&number.to_string()) != interface(name) {
                notes.channel(
                    Fate::Converted,
                    format!("{name} to {number}"),
                    "a bus that the format numbers",
                );
            }
        }
    }
}

/// The name of a bus as an interface: channel 1 is `can0`.
pub(crate) fn interface(bus: &str) -> std::borrow::Cow<'_, str> {
    match bus.parse::<u16>().ok().and_then(|number| number.checked_sub(1)) {
        Some(index) => format!("can{index}").into(),
        None => bus.into(),
    }
}
