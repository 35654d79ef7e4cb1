//! SLCAN, the Lawicel ASCII protocol: CAN frames as lines on a serial port, so that `python-can`'s slcan
//! interface and `slcand` talk to a board without a CAN controller.
//!
//! `tIIILDD..` and a carriage return is a data frame: identifier and bytes in hex, length in one digit.
//! Commands answered here: `O` open, `C` close, `Sn` bit rate, `V` version, `N` serial number, `F` flags.
//! Not here: extended and remote frames (answered with an error), time stamps, and the port itself.

#![expect(clippy::as_conversions, reason = "digits of four bits, cut to a byte")]

use heapless::Vec;

use super::frame::Frame;

/// Longest line: `T`, eight digits, a length, sixteen digits.
const LINE_MAX: usize = 26;
/// A command is done.
pub const OK: &[u8] = b"\r";
/// A command is not understood.
pub const ERROR: &[u8] = b"\x07";

/// One complete line from the other side.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Line {
    /// A data frame.
    Frame(Frame),
    /// Open the channel.
    Open,
    /// Close the channel.
    Close,
    /// A setting that has no meaning here (bit rate, acceptance filters, time stamps): accepted.
    Setting,
    /// Ask for the version.
    Version,
    /// Ask for the serial number.
    Serial,
    /// Ask for the status flags.
    Flags,
    /// An empty line, which clients send to flush.
    Empty,
    /// Not understood.
    Invalid,
}

impl Line {
    /// The answer that the other side expects.
    #[must_use]
    pub const fn answer(self) -> &'static [u8] {
        match self {
            Self::Frame(_) => b"z\r",
            Self::Open | Self::Close | Self::Setting | Self::Empty => OK,
            Self::Version => b"V1013\r",
            Self::Serial => b"NHG01\r",
            Self::Flags => b"F00\r",
            Self::Invalid => ERROR,
        }
    }
}

/// Collects bytes to lines.
#[derive(Debug, Clone, Default)]
pub struct Parser {
    line: Vec<u8, LINE_MAX>,
    overlong: bool,
}

impl Parser {
    /// Takes one byte; returns a line when it is complete.
    pub fn push(&mut self, byte: u8) -> Option<Line> {
        match byte {
            b'\r' => {
                let line = if self.overlong {
                    Line::Invalid
                } else {
                    parse(&self.line)
                };
                self.line.clear();
                self.overlong = false;
                Some(line)
            }
            // Some clients end lines with both.
            b'\n' => None,
            _ => {
                self.overlong |= self.line.push(byte).is_err();
                None
            }
        }
    }
}

fn parse(line: &[u8]) -> Line {
    match line {
        [] => Line::Empty,
        [b't', rest @ ..] => parse_frame(rest).map_or(Line::Invalid, Line::Frame),
        [b'O' | b'L'] => Line::Open,
        [b'C'] => Line::Close,
        [b'S', b'0'..=b'8'] | [b's' | b'M' | b'm' | b'Z' | b'X' | b'W', ..] => Line::Setting,
        [b'V' | b'v'] => Line::Version,
        [b'N'] => Line::Serial,
        [b'F'] => Line::Flags,
        _ => Line::Invalid,
    }
}

fn parse_frame(text: &[u8]) -> Option<Frame> {
    let [a, b, c, length, digits @ ..] = text else {
        return None;
    };
    let id = (digit(*a)? << 8) | (digit(*b)? << 4) | digit(*c)?;
    let (pairs, rest) = digits.as_chunks::<2>();
    if usize::from(digit(*length)?) != pairs.len() || !rest.is_empty() {
        return None;
    }
    let mut data = [0; 8];
    for (byte, [high, low]) in data.iter_mut().zip(pairs) {
        *byte = ((digit(*high)? << 4) | digit(*low)?) as u8;
    }
    Frame::new(id, data.get(..pairs.len())?)
}

fn digit(ascii: u8) -> Option<u16> {
    match ascii {
        b'0'..=b'9' => Some(u16::from(ascii.wrapping_sub(b'0'))),
        b'a'..=b'f' => Some(u16::from(ascii.wrapping_sub(b'a').wrapping_add(10))),
        b'A'..=b'F' => Some(u16::from(ascii.wrapping_sub(b'A').wrapping_add(10))),
        _ => None,
    }
}

/// A frame as a line, carriage return included.
#[must_use]
pub fn format(frame: &Frame) -> Vec<u8, LINE_MAX> {
    let mut line = Vec::new();
    // 1 + 3 + 1 + 16 + 1 = 22 bytes always fit in 26.
    let mut put = |byte: u8| {
        let _ = line.push(byte);
    };
    let id = frame.id();
    put(b't');
    put(hex((id >> 8) as u8));
    put(hex((id >> 4) as u8));
    put(hex(id as u8));
    put(hex(frame.data().len() as u8));
    for byte in frame.data() {
        put(hex(byte >> 4));
        put(hex(*byte));
    }
    put(b'\r');
    line
}

fn hex(nibble: u8) -> u8 {
    match nibble & 0x0F {
        low @ 0..=9 => low.wrapping_add(b'0'),
        high => high.wrapping_sub(10).wrapping_add(b'A'),
    }
}
