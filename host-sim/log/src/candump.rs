//! The text that `candump` writes: `(1700000000.123456) can0 0C0#0102030405060708` with `-L` or `-l`, and
//! `(1700000000.123456)  can0  0C0   [8]  01 02 03 04 05 06 07 08` with `-ta`. Written is the first form.
//!
//! Not here: what the frames mean.

use std::io::{self, Write};

use crate::recording::RecordingError;

/// A frame with its time and the line that it stands on.
#[derive(Debug, Clone, PartialEq)]
pub struct CandumpFrame {
    /// The line, from 1.
    pub line: usize,
    /// When it was received, s.
    pub time_s: f64,
    /// The identifier, 11 or 29 bits.
    pub id: u32,
    /// Whether the identifier has 29 bits.
    pub extended: bool,
    /// Up to eight bytes.
    pub data: Vec<u8>,
}

/// Whether `text` is a trace of `candump` rather than a table.
pub fn looks_like_one(text: &str) -> bool {
    let Some(line) = text.lines().map(str::trim).find(|line| !line.is_empty()) else {
        return false;
    };
    let count = |word: &str| word.strip_prefix('[')?.strip_suffix(']')?.parse::<u8>().ok();
    line.starts_with('(') || line.split_whitespace().nth(2).and_then(count).is_some()
}

/// Every data frame of classic CAN, in the order of the text. Remote, error and FD frames are left out: none of
/// the messages looked for is one.
///
/// # Errors
/// A line that is not in one of the two forms, with its number.
pub fn parse(text: &str) -> Result<Vec<CandumpFrame>, RecordingError> {
    let mut frames: Vec<CandumpFrame> = Vec::new();
    for (line, content) in (1..).zip(text.lines()) {
        let content = content.trim();
        if content.is_empty() {
            continue;
        }
        let refuse = |what: &str| RecordingError(format!("line {line}: {what}: {content:?}"));
        let Some((time, rest)) = content.strip_prefix('(').and_then(|c| c.split_once(')')) else {
            return Err(refuse("no time stamp; record with candump -L"));
        };
        let time_s = time.trim().parse().ok().filter(|t: &f64| t.is_finite());
        let time_s =
            time_s.ok_or_else(|| refuse("the time stamp is no number of seconds; record with candump -L"))?;
        let mut words = rest.split_whitespace().skip(1).peekable();
        let Some(first) = words.next() else {
            return Err(refuse("no frame"));
        };
        // Both forms as identifier and bytes in hexadecimal.
        let (id, bytes) = match first.split_once('#') {
            Some((_, bytes)) if bytes.starts_with(['#', 'R']) => continue,
            Some((id, bytes)) => (id, bytes.to_owned()),
            None => {
                words.next_if(|word| word.starts_with('['));
                if words.peek() == Some(&"remote") {
                    continue;
                }
                // `candump -a` adds the bytes as text in quotes.
                (first, words.take_while(|word| !word.starts_with('\'')).collect())
            }
        };
        let extended = id.len() > 3;
        let id = u32::from_str_radix(id, 16).map_err(|_| refuse("no identifier"))?;
        let digits = bytes.split('_').next().unwrap_or_default();
        let data = digits
            .as_bytes()
            .chunks(2)
            .map(|pair| u8::from_str_radix(str::from_utf8(pair).ok().filter(|p| p.len() == 2)?, 16).ok())
            .collect::<Option<Vec<u8>>>()
            .filter(|data| data.len() <= 8)
            .ok_or_else(|| refuse("the data are no bytes in hexadecimal"))?;
        frames.push(CandumpFrame {
            line,
            time_s,
            id,
            extended,
            data,
        });
    }
    Ok(frames)
}

/// Writes a frame of an 11-bit identifier as `candump -L` writes it, on an interface that is called `can0`.
///
/// # Errors
/// What `out` says.
pub fn write(out: &mut (impl Write + ?Sized), time_s: f64, id: u16, data: &[u8]) -> io::Result<()> {
    write_line(out, time_s, (id.into(), 3), data)
}

/// Writes a frame, its identifier with eight digits if it has 29 bits.
///
/// # Errors
/// What `out` says.
pub fn write_frame(out: &mut (impl Write + ?Sized), frame: &CandumpFrame) -> io::Result<()> {
    let digits = if frame.extended { 8 } else { 3 };
    write_line(out, frame.time_s, (frame.id, digits), &frame.data)
}

fn write_line(
    out: &mut (impl Write + ?Sized),
    time_s: f64,
    (id, digits): (u32, usize),
    data: &[u8],
) -> io::Result<()> {
    write!(out, "({time_s:.6}) can0 {id:0digits$X}#")?;
    for byte in data {
        write!(out, "{byte:02X}")?;
    }
    writeln!(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_again() {
        let mut text = Vec::new();
        write(&mut text, 12.5, 0x0C0, &[0x01, 0xAB]).unwrap();
        write(&mut text, 12.501, 0x7FF, &[]).unwrap();
        let text = String::from_utf8(text).unwrap();
        assert_eq!(text, "(12.500000) can0 0C0#01AB\n(12.501000) can0 7FF#\n");
        assert!(looks_like_one(&text));
        let frames = parse(&text).unwrap();
        let found: Vec<_> = frames.iter().map(|f| (f.time_s, f.id, &f.data[..])).collect();
        assert_eq!(
            found,
            [(12.5, 0x0C0, &[0x01, 0xAB][..]), (12.501, 0x7FF, &[][..])]
        );
    }

    /// The two lines are those of the manual page of candump's own output forms.
    #[test]
    fn both_forms_are_read() {
        let text = "(1436509052.249713) vcan0 044#2A366C2B0BA5\n\
                    (1436509052.449847)  vcan0  1F334455   [3]  11 22 33   '.\"3'\n\
                    \n(1436509053.0) vcan0 123#R8\n(1436509053.1) vcan0 123##311";
        assert!(looks_like_one(text));
        let found = parse(text).unwrap();
        assert_eq!(found.len(), 2);
        assert_eq!(
            (found[0].line, found[0].id, found[0].time_s),
            (1, 0x44, 1_436_509_052.249_713)
        );
        assert_eq!(found[0].data, [0x2A, 0x36, 0x6C, 0x2B, 0x0B, 0xA5]);
        assert_eq!((found[1].line, found[1].id), (2, 0x1F33_4455));
        assert_eq!(found[1].data, [0x11, 0x22, 0x33]);
    }

    #[test]
    fn what_cannot_be_read_is_named_with_its_line() {
        for (text, says) in [
            (
                "  can0  044   [2]  11 22",
                "line 1: no time stamp; record with candump -L",
            ),
            ("(today) can0 044#11", "line 1: the time stamp is no number"),
            ("(1.0) can0 044#1122\n(2.0) can0 xyz#11", "line 2: no identifier"),
            ("(1.0) can0 044#112", "line 1: the data are no bytes"),
            ("(1.0) can0", "line 1: no frame"),
        ] {
            assert!(looks_like_one(text));
            let error = parse(text).unwrap_err().to_string();
            assert!(error.starts_with(says), "{error}");
        }
        for table in [
            "time_s,e_y_m\n0,0",
            "Time [s];Lane error [m];Angle [deg]\n0;0;0",
            "Wheel angle [deg],T",
        ] {
            assert!(!looks_like_one(table));
        }
    }
}
