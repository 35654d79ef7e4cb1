//! The text that `candump` writes: `(1700000000.123456) can0 0C0#0102030405060708` with `-L` or `-l`, and
//! `(1700000000.123456)  can0  0C0   [8]  01 02 03 04 05 06 07 08` with `-ta`. Written is the first form.
//!
//! It is written by hand because the crate `socketcan`, which has a reader too, knows the form of `-L` alone, refuses codes of the
//! length (`_9`), and builds on Linux alone, while this crate builds on every system and for a browser.
//!
//! Not here: what the frames mean.

use std::io::{self, BufRead, Write};

use crate::bus::{BusFrame, Form, Intake, Line, Take, bytes_into, read_lines, seconds};
use crate::notes::{Notes, Part};
use crate::recording::RecordingError;

/// Bits of an identifier with which the kernel says what a frame is.
const ERROR: u32 = 1 << 29;

/// Whether `text` is a trace of `candump` rather than a table.
pub fn looks_like_one(text: &[u8]) -> bool {
    let mut lines = text.split(|byte| *byte == b'\n').map(<[u8]>::trim_ascii);
    let Some(line) = lines.find(|line| !line.is_empty()) else {
        return false;
    };
    let line = String::from_utf8_lossy(line);
    let count = |word: &str| word.strip_prefix('[')?.strip_suffix(']')?.parse::<u8>().ok();
    line.starts_with('(') || line.split_whitespace().nth(2).and_then(count).is_some()
}

/// Reads the data frames, of one bus if one is wanted. What else stands there is counted, a line that is not understood too.
///
/// # Errors
/// A clock that does not go on; no frame; what `take` says.
pub fn read(
    input: &mut dyn BufRead,
    bus: Option<&str>,
    take: &mut Take<'_>,
) -> Result<Notes, RecordingError> {
    let mut intake = Intake::new("line", bus, take);
    read_lines(input, &mut intake, parse)?;
    intake.finish()
}

fn parse(content: &str, frame: &mut BusFrame, notes: &mut Notes) -> Result<Line, &'static str> {
    if content.is_empty() {
        return Ok(Line::Nothing);
    }
    let stamped = content.strip_prefix('(').and_then(|c| c.split_once(')'));
    let (time, rest) = stamped.ok_or("no time stamp; record with candump -L")?;
    frame.time_s = seconds(time.trim(), frame.line, notes)
        .ok_or("the time stamp is no number of seconds; record with candump -L")?;
    let mut words = rest.split_whitespace();
    frame.bus.clear();
    frame.bus.push_str(words.next().ok_or("no interface")?);
    let mut first = words.next().ok_or("no frame")?;
    // `candump -x` writes direction, bit rate switch and error state before the frame, or the direction behind it.
    let mut flags = [""; 2];
    frame.sent = first == "TX";
    if frame.sent || first == "RX" {
        flags = [(); 2].map(|()| words.next().unwrap_or_default());
        first = words.next().ok_or("no frame")?;
    }
    if first.contains('#') {
        frame.sent = words.next() == Some("T");
        return compact(first, frame);
    }
    identifier(first, frame)?;
    let length = words
        .next()
        .and_then(|word| word.strip_prefix('[')?.strip_suffix(']'));
    let length = length.ok_or("no length in brackets")?;
    // One digit of a classic frame, two of CAN FD.
    frame.form = match length.len() {
        1 => Form::Classic,
        _ => Form::Fd {
            switched: flags[0] == "B",
            passive: flags[1] == "E",
        },
    };
    let count: usize = length.parse().map_err(|_| "no length in brackets")?;
    if frame.id & ERROR != 0 {
        return Ok(Line::Other(Part::Frame, "error frame"));
    }
    let mut words = words.peekable();
    if words.next_if_eq(&"remote").is_some() {
        return Ok(Line::Other(Part::Frame, "remote frame"));
    }
    // `candump -a` adds the bytes as text in quotes.
    bytes_into(words.take(count), 16, &mut frame.data).ok_or("the data are no bytes in hexadecimal")?;
    if frame.data.len() != count {
        return Err("not as many bytes as it says");
    }
    within(frame)
}

/// `0C0#0102`; in CAN FD `0C0##1` with a digit of flags before the bytes; `0C0#R` is a remote frame.
fn compact(word: &str, frame: &mut BusFrame) -> Result<Line, &'static str> {
    const NO_BYTES: &str = "the data are no bytes in hexadecimal";
    let (id, mut digits) = word.split_once('#').ok_or("no frame")?;
    identifier(id, frame)?;
    frame.form = Form::Classic;
    if let Some(rest) = digits.strip_prefix('#') {
        let flags = rest.get(..1).and_then(|digit| u8::from_str_radix(digit, 16).ok());
        let flags = flags.ok_or(NO_BYTES)?;
        digits = &rest[1..];
        frame.form = Form::Fd {
            switched: flags & 1 != 0,
            passive: flags & 2 != 0,
        };
    }
    if digits.starts_with('R') {
        return Ok(Line::Other(Part::Frame, "remote frame"));
    }
    if frame.id & ERROR != 0 {
        return Ok(Line::Other(Part::Frame, "error frame"));
    }
    // A code of the length behind eight bytes.
    let digits = digits.split('_').next().unwrap_or_default();
    let pairs = digits.as_bytes().chunks(2).map(|pair| match pair {
        [_, _] => str::from_utf8(pair).unwrap_or_default(),
        _ => "",
    });
    bytes_into(pairs, 16, &mut frame.data).ok_or(NO_BYTES)?;
    within(frame)
}

/// Three digits of 11 bits, eight of 29.
fn identifier(digits: &str, frame: &mut BusFrame) -> Result<(), &'static str> {
    frame.id = u32::from_str_radix(digits, 16).map_err(|_| "no identifier")?;
    frame.extended = digits.len() > 3;
    match frame.id {
        0x800.. if !frame.extended => Err("an identifier of more than 11 bits in three digits"),
        0x4000_0000.. => Err("an identifier of more than 29 bits"),
        _ => Ok(()),
    }
}

fn within(frame: &BusFrame) -> Result<Line, &'static str> {
    if frame.data.len() > frame.form.most_bytes() {
        return Err("more bytes than a frame has");
    }
    Ok(Line::Frame)
}

/// Writes a frame of an 11-bit identifier as `candump -L` writes it, on an interface that is called `can0`.
///
/// # Errors
/// What `out` says.
pub fn write(out: &mut (impl Write + ?Sized), time_s: f64, id: u16, data: &[u8]) -> io::Result<()> {
    write!(out, "({time_s:.6}) can0 {id:03X}#")?;
    write_bytes(out, data)
}

/// Writes a frame, its identifier with eight digits if it has 29 bits; `interface` is its bus.
///
/// # Errors
/// What `out` says.
pub fn write_frame(out: &mut (impl Write + ?Sized), interface: &str, frame: &BusFrame) -> io::Result<()> {
    let (time_s, id, digits) = (frame.time_s, frame.id, if frame.extended { 8 } else { 3 });
    write!(out, "({time_s:.6}) {interface} {id:0digits$X}#")?;
    if let Form::Fd { switched, passive } = frame.form {
        write!(out, "#{:X}", u8::from(switched) | u8::from(passive) << 1)?;
    }
    write_bytes(out, &frame.data)
}

fn write_bytes(out: &mut (impl Write + ?Sized), data: &[u8]) -> io::Result<()> {
    for byte in data {
        write!(out, "{byte:02X}")?;
    }
    writeln!(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frames(text: &str) -> Result<(Vec<BusFrame>, Vec<String>), String> {
        let mut frames = Vec::new();
        let mut keep = |frame: &BusFrame| -> Result<(), RecordingError> {
            frames.push(frame.clone());
            Ok(())
        };
        let notes = read(&mut text.as_bytes(), None, &mut keep).map_err(|e| e.to_string())?;
        Ok((frames, notes.iter().map(ToString::to_string).collect()))
    }

    #[test]
    fn what_is_written_is_read_again() {
        let mut text = Vec::new();
        write(&mut text, 12.5, 0x0C0, &[0x01, 0xAB]).unwrap();
        write(&mut text, 12.501, 0x7FF, &[]).unwrap();
        let fd = BusFrame {
            line: 3,
            time_s: 12.502,
            bus: "vcan1".into(),
            id: 0x123,
            extended: true,
            form: Form::Fd {
                switched: true,
                passive: false,
            },
            sent: false,
            data: (0..12).collect(),
        };
        write_frame(&mut text, "vcan1", &fd).unwrap();
        let text = String::from_utf8(text).unwrap();
        assert_eq!(
            text,
            "(12.500000) can0 0C0#01AB\n(12.501000) can0 7FF#\n(12.502000) vcan1 00000123##1000102030405060708090A0B\n"
        );
        assert!(looks_like_one(text.as_bytes()));
        let (frames, notes) = frames(&text).unwrap();
        let found: Vec<_> = frames[..2]
            .iter()
            .map(|f| (f.time_s, f.id, &f.data[..]))
            .collect();
        assert_eq!(
            found,
            [(12.5, 0x0C0, &[0x01, 0xAB][..]), (12.501, 0x7FF, &[][..])]
        );
        assert_eq!(frames[2], fd);
        assert!(notes.is_empty());
    }

    /// The first two lines are those of the manual page of candump's own output forms; the others as can-utils 2023.03 writes
    /// them.
    #[test]
    fn both_forms_are_read() {
        let text = "(1436509052.249713) vcan0 044#2A366C2B0BA5\n\
                    (1436509052.449847)  vcan0  1F334455   [3]  11 22 33   '.\"3'\n\
                    \n(1436509053.0) vcan0 123#R8\n(1436509053.1) vcan0 123##311\n\
                    (1436509053.2)  vcan0  TX B -  123  [12]  00 01 02 03 04 05 06 07 08 09 0A 0B\n\
                    (1436509053.3)  vcan0  123   [0]  remote request\n\
                    (1436509053.4) vcan0 20000080#0000000000000000\n\
                    (1436509053,5) vcan1 123#1122334455667788_9 T\n";
        assert!(looks_like_one(text.as_bytes()));
        let (found, notes) = frames(text).unwrap();
        assert_eq!(found.len(), 5);
        assert_eq!(
            (found[0].line, found[0].id, found[0].time_s),
            (1, 0x44, 1_436_509_052.249_713)
        );
        assert_eq!(found[0].data, [0x2A, 0x36, 0x6C, 0x2B, 0x0B, 0xA5]);
        assert_eq!(
            (found[1].line, found[1].id, found[1].extended),
            (2, 0x1F33_4455, true)
        );
        assert_eq!(found[1].data, [0x11, 0x22, 0x33]);
        let fd = |switched, passive| Form::Fd { switched, passive };
        assert_eq!((found[2].form, &found[2].data[..]), (fd(true, true), &[0x11][..]));
        assert_eq!(
            (found[3].form, found[3].sent, found[3].data.len()),
            (fd(true, false), true, 12)
        );
        assert_eq!((found[4].time_s, found[4].data.len()), (1_436_509_053.5, 8));
        assert_eq!((found[4].bus.as_str(), found[4].sent), ("vcan1", true));
        assert_eq!(
            notes,
            [
                "2 frames left out: remote frame, the first in line 4",
                "1 frame left out: error frame, in line 8",
                "1 time stamp converted: decimal comma, in line 9",
            ]
        );
    }

    /// One bad line is left out; where there is nothing else, it is why the file is refused.
    #[test]
    fn what_cannot_be_read_is_named_with_its_line() {
        for (text, says) in [
            (
                "  can0  044   [2]  11 22",
                "line 1: no time stamp; record with candump -L",
            ),
            ("(today) can0 044#11", "line 1: the time stamp is no number"),
            ("(2.0) can0 xyz#11", "line 1: no identifier"),
            ("(2.0) can0 800#11", "line 1: an identifier of more than 11 bits"),
            (
                "(2.0) can0 40000000#11",
                "line 1: an identifier of more than 29 bits",
            ),
            ("(1.0) can0 044#112", "line 1: the data are no bytes"),
            (
                "(1.0) can0 044#112233445566778899",
                "line 1: more bytes than a frame has",
            ),
            ("(1.0) can0 044 [2] 11", "line 1: not as many bytes as it says"),
            ("(1.0) can0", "line 1: no frame"),
        ] {
            assert!(looks_like_one(text.as_bytes()));
            let error = frames(text).unwrap_err();
            assert!(error.starts_with(says), "{error}");
            let (read, notes) = frames(&format!("{text}\n(3.0) can0 7FF#11\n")).unwrap();
            assert_eq!((read.len(), notes.len()), (1, 1), "{notes:?}");
        }
        for table in [
            "time_s,e_y_m\n0,0",
            "Time [s];Lane error [m];Angle [deg]\n0;0;0",
            "Wheel angle [deg],T",
        ] {
            assert!(!looks_like_one(table.as_bytes()));
        }
    }
}
