//! Vector's ASC: `   1.000000 1  100             Rx   d 8 01 02 03 04 05 06 07 08`, of CAN FD
//! `   1.000000 CANFD   1 Rx        100                 1 0 9 12 01 02 ..`.
//!
//! Read are data frames in hexadecimal or decimal, with absolute or relative time stamps; times stay as they stand. Written
//! are frames in hexadecimal; stamps since 1970 are written from the first frame's second on, which the heading's date holds.

use std::io::{self, BufRead, Write};

use super::calendar;
use crate::bus::{BusFrame, Form, Intake, Line, Numbers, Take, bytes_into, length_code, read_lines, seconds};
use crate::notes::{Fate, Notes, Part};
use crate::recording::RecordingError;

/// Lines of the heading and between the events.
const HEADINGS: [&str; 8] = ["date", "base", "internal", "no", "begin", "end", "//", "previous"];
/// Flags of a line of CAN FD: a remote frame, and a frame of CAN FD.
const REMOTE: u32 = 1 << 4;
const FD: u32 = 1 << 12;

pub(super) fn read(
    input: &mut dyn BufRead,
    bus: Option<&str>,
    take: &mut Take<'_>,
) -> Result<Notes, RecordingError> {
    let mut intake = Intake::new("line", bus, take);
    let (mut base, mut relative, mut now_s) = (16, false, 0.0);
    read_lines(input, &mut intake, |content, frame, notes| {
        let mut words = content.split_whitespace();
        let Some(first) = words.next() else {
            return Ok(Line::Nothing);
        };
        let lower = first.to_ascii_lowercase();
        if lower == "base" {
            base = match words.next() {
                Some(word) if word.eq_ignore_ascii_case("dec") => 10,
                _ => 16,
            };
            relative = words
                .nth(1)
                .is_some_and(|word| word.eq_ignore_ascii_case("relative"));
        }
        if HEADINGS.iter().any(|heading| lower.starts_with(heading)) {
            return Ok(Line::Nothing);
        }
        let time_s = seconds(first, frame.line, notes).ok_or("no time stamp")?;
        now_s = if relative { now_s + time_s } else { time_s };
        frame.time_s = now_s;
        event(words, base, frame, notes)
    })?;
    intake.finish()
}

/// What stands behind the time.
fn event<'t>(
    mut words: impl Iterator<Item = &'t str>,
    base: u32,
    frame: &mut BusFrame,
    notes: &mut Notes,
) -> Result<Line, &'static str> {
    const OTHER: Line = Line::Other(Part::Line, "an event that is no frame of CAN");
    let mut word = move || words.next().unwrap_or_default();
    let first = word();
    let in_fd = first.eq_ignore_ascii_case("CANFD");
    let channel = if in_fd { word() } else { first };
    if first.eq_ignore_ascii_case("start") {
        return Ok(Line::Nothing);
    }
    if channel.parse::<u16>().is_err() {
        return Ok(OTHER);
    }
    frame.bus.clear();
    frame.bus.push_str(channel);
    // Classic: identifier, direction, kind, length, data. In CAN FD the direction comes first.
    let id = word();
    let (id, direction) = match in_fd {
        true if id.eq_ignore_ascii_case("errorframe") => (id, ""),
        true => (word(), id),
        false if id.eq_ignore_ascii_case("errorframe") => (id, ""),
        false => (id, word()),
    };
    if id.eq_ignore_ascii_case("errorframe") {
        return Ok(Line::Other(Part::Frame, "error frame"));
    }
    let is = |word: &str, other: &str| word.eq_ignore_ascii_case(other);
    frame.sent = is(direction, "tx");
    if !frame.sent && !is(direction, "rx") {
        return Ok(OTHER);
    }
    let kind = word();
    if is(kind, "r") {
        return Ok(Line::Other(Part::Frame, "remote frame"));
    }
    if !in_fd && !is(kind, "d") {
        return Ok(OTHER);
    }
    identifier(id, base, frame, notes)?;
    if !in_fd {
        // Codes above 8 of classic CAN mean 8 bytes.
        let code = usize::from_str_radix(word(), base)
            .ok()
            .filter(|code| *code <= 15);
        let length = code.ok_or("no length")?.min(8);
        frame.form = Form::Classic;
        return data(std::iter::from_fn(|| Some(word())), length, base, frame);
    }
    // Behind the identifier there may be the message's name.
    let (switched, passive) = match kind.parse::<u8>() {
        Ok(switched) => (switched, word()),
        Err(_) => (u8::from(word() == "1"), word()),
    };
    let (_code, length) = (word(), word().parse().map_err(|_| "no length")?);
    frame.form = Form::Fd {
        switched: switched == 1,
        passive: passive == "1",
    };
    data(
        std::iter::from_fn(|| Some(word())).take(length),
        length,
        base,
        frame,
    )?;
    // Duration and length on the wire stand before the flags.
    let flags = [(); 3].map(|()| word())[2];
    let flags = u32::from_str_radix(flags, 16).unwrap_or(FD);
    if flags & REMOTE != 0 {
        return Ok(Line::Other(Part::Frame, "remote frame"));
    }
    if flags & FD == 0 && length <= Form::Classic.most_bytes() && !(switched == 1 || passive == "1") {
        frame.form = Form::Classic;
    } else if flags & FD == 0 {
        let (why, place) = (
            "CAN FD by its bytes or bits, and not by its flags",
            format_args!("line {}", frame.line),
        );
        notes.count(Fate::Guessed, Part::Frame, why, place);
    }
    Ok(Line::Frame)
}

fn identifier(word: &str, base: u32, frame: &mut BusFrame, notes: &mut Notes) -> Result<(), &'static str> {
    let id = word.strip_suffix(['x', 'X']);
    frame.id = u32::from_str_radix(id.unwrap_or(word), base).map_err(|_| "no identifier")?;
    frame.extended = id.is_some();
    if frame.id > 0x1FFF_FFFF {
        return Err("an identifier of more than 29 bits");
    }
    if frame.id > 0x7FF && !frame.extended {
        let place = format_args!("line {}", frame.line);
        notes.count(
            Fate::Guessed,
            Part::Frame,
            "an identifier above 7FF without x has 29 bits",
            place,
        );
        frame.extended = true;
    }
    Ok(())
}

fn data<'t>(
    words: impl Iterator<Item = &'t str>,
    length: usize,
    base: u32,
    frame: &mut BusFrame,
) -> Result<Line, &'static str> {
    if length > frame.form.most_bytes() {
        return Err("more bytes than a frame has");
    }
    bytes_into(words.take(length), base, &mut frame.data).ok_or("not as many bytes as it says")?;
    Ok(Line::Frame)
}

/// Writes what is before the first frame; the date is that of the first frame's second, which stamps are counted from.
fn heading(out: &mut impl Write, start_s: f64) -> io::Result<()> {
    const MONTHS: [&str; 12] = [
        "Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec",
    ];
    const DAYS: [&str; 7] = ["Sun", "Mon", "Tue", "Wed", "Thu", "Fri", "Sat"];
    let [year, month, weekday, day, hour, minute, second, ms] = calendar::date((start_s * 1e3) as u64);
    let half = if hour < 12 { "am" } else { "pm" };
    let date = format!(
        "{} {} {day} {:02}:{minute:02}:{second:02}.{ms:03} {half} {year}",
        DAYS[usize::from(weekday)],
        MONTHS[usize::from(month) - 1],
        (hour + 11) % 12 + 1,
    );
    writeln!(
        out,
        "date {date}\nbase hex  timestamps absolute\ninternal events logged"
    )?;
    writeln!(out, "Begin Triggerblock {date}\n   0.000000 Start of measurement")
}

/// A log that is being written.
pub(super) struct Writer<W> {
    out: W,
    pub(super) numbers: Numbers,
    start_s: Option<f64>,
}

impl<W: Write> Writer<W> {
    pub(super) fn new(out: W) -> Self {
        Self {
            out,
            numbers: Numbers::default(),
            start_s: None,
        }
    }

    pub(super) fn frame(&mut self, frame: &BusFrame) -> io::Result<()> {
        let start_s = match self.start_s {
            Some(start_s) => start_s,
            None => {
                // Stamps of a run begin at zero and stay as they are.
                let start_s = if frame.time_s > 1e8 {
                    frame.time_s.floor()
                } else {
                    0.0
                };
                heading(&mut self.out, start_s)?;
                *self.start_s.insert(start_s)
            }
        };
        let channel = self.numbers.of(&frame.bus);
        let (time_s, out) = (frame.time_s - start_s, &mut self.out);
        let id = format!("{:X}{}", frame.id, if frame.extended { "x" } else { "" });
        let direction = if frame.sent { "Tx" } else { "Rx" };
        let bytes: Vec<String> = frame.data.iter().map(|byte| format!("{byte:02X}")).collect();
        let (bytes, length) = (bytes.join(" "), frame.data.len());
        match frame.form {
            Form::Classic => writeln!(
                out,
                "{time_s:11.6} {channel}  {id:<15} {direction}   d {length:x} {bytes}"
            ),
            Form::Fd { switched, passive } => {
                let flags = FD | u32::from(switched) << 13 | u32::from(passive) << 14;
                let [switched, passive] = [switched, passive].map(u8::from);
                let code = length_code(length);
                writeln!(
                    out,
                    "{time_s:11.6} CANFD {channel:3} {direction:<4} {id:>8}  {:>32} {switched} {passive} {code:x} {length:2} \
                     {bytes} {:>8} {:>4} {flags:8X} {:>8} {:>8} {:>8} {:>8} {:>8}",
                    "", 0, 0, 0, 0, 0, 0, 0
                )
            }
        }
    }

    pub(super) fn finish(mut self) -> io::Result<()> {
        if self.start_s.is_none() {
            heading(&mut self.out, 0.0)?;
        }
        writeln!(self.out, "End TriggerBlock")?;
        self.out.flush()
    }
}
