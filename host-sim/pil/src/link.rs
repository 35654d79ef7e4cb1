//! Frames as the bytes of a channel, and back.

use haptic_core::bus::Frame;
use haptic_core::bus::slcan::{self, Line, Parser};
use haptic_lockstep::{RECORD_LEN, from_record, to_record};
use serde::Serialize;

use super::{Channel, PilError};

/// What an SLCAN client sends first: close what is open, 500 kbit/s, no time stamps, open.
pub(super) const OPEN: &[u8] = b"C\rS6\rZ0\rO\r";
/// After the other end has forgotten it.
pub(super) const REOPEN: &[u8] = b"O\r";
/// And last.
pub(super) const CLOSE: &[u8] = b"C\r";

pub(super) fn encode(channel: Channel, frame: &Frame) -> Vec<u8> {
    match channel {
        Channel::Fifo => to_record(frame).to_vec(),
        Channel::Slcan => slcan::format(frame).to_vec(),
    }
}

/// Lines of an SLCAN adapter that are no frame of this bus.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Unread {
    /// Frames of other kinds: identifiers of 29 bits, remote frames.
    pub frames: u64,
    /// Lines that are neither a frame nor an answer.
    pub lines: u64,
    /// The first of them.
    pub first_line: Option<String>,
}

/// Longest line: a frame of 29 bits with a time stamp has 30 characters.
const LONGEST_LINE: usize = 64;
/// What an adapter answers, without a carriage return where it refuses.
const REFUSED: u8 = 7;

/// Collects the lines of an SLCAN adapter.
#[derive(Default)]
pub(super) struct Lines {
    line: Vec<u8>,
    unread: Unread,
}

impl Lines {
    /// Takes one byte; a frame if it completes one. Lines that answer our own are passed over.
    fn push(&mut self, byte: u8) -> Option<Frame> {
        match byte {
            b'\r' => {
                let line = std::mem::take(&mut self.line);
                self.whole(&line)
            }
            REFUSED | b'\n' => None,
            _ => {
                if self.line.len() < LONGEST_LINE {
                    self.line.push(byte);
                }
                None
            }
        }
    }

    fn whole(&mut self, line: &[u8]) -> Option<Frame> {
        let bytes = line.get(4).and_then(|digit| char::from(*digit).to_digit(16));
        let stamped = bytes.map(|bytes| 5 + 2 * bytes as usize + 4);
        match line {
            // Some adapters write a time stamp of four digits behind the frame, whether or not they are told not to.
            [b't', ..] => {
                let without = if stamped == Some(line.len()) {
                    &line[..line.len() - 4]
                } else {
                    line
                };
                let mut parser = Parser::default();
                let mut lines = without.iter().chain(b"\r").filter_map(|byte| parser.push(*byte));
                if let Some(Line::Frame(frame)) = lines.next() {
                    return Some(frame);
                }
            }
            [b'T' | b'r' | b'R', _, ..] => {
                self.unread.frames += 1;
                return None;
            }
            [] | [b'z' | b'Z'] | [b'V' | b'v' | b'N' | b'F', ..] => return None,
            _ => {}
        }
        self.unread.lines += 1;
        let text = || String::from_utf8_lossy(line).escape_default().to_string();
        self.unread.first_line.get_or_insert_with(text);
        None
    }
}

/// Collects bytes to frames.
pub(super) enum Decoder {
    Fifo(Vec<u8>),
    Slcan(Lines),
}

impl Decoder {
    pub(super) fn new(channel: Channel) -> Self {
        match channel {
            Channel::Fifo => Self::Fifo(Vec::with_capacity(RECORD_LEN)),
            Channel::Slcan => Self::Slcan(Lines::default()),
        }
    }

    /// What was no frame of this bus.
    pub(super) fn unread(&self) -> Unread {
        match self {
            Self::Fifo(_) => Unread::default(),
            Self::Slcan(lines) => lines.unread.clone(),
        }
    }

    /// Takes one byte; a frame if it completes one. An error names bytes that are no frame.
    pub(super) fn push(&mut self, byte: u8) -> Result<Option<Frame>, PilError> {
        match self {
            Self::Fifo(bytes) => {
                bytes.push(byte);
                let Ok(record) = <[u8; RECORD_LEN]>::try_from(bytes.as_slice()) else {
                    return Ok(None);
                };
                bytes.clear();
                from_record(&record)
                    .map(Some)
                    .ok_or_else(|| PilError::Failed(format!("no frame's record: {record:02X?}")))
            }
            Self::Slcan(lines) => Ok(lines.push(byte)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lines as the Lawicel protocol has them: a frame, one with its time stamp, one of 29 bits, a refusal before a frame, answers,
    /// and three lines that are none.
    #[test]
    fn lines_that_are_no_frame_are_counted_and_the_first_is_kept() {
        let mut decoder = Decoder::new(Channel::Slcan);
        let bytes = b"\r\x07t0C02BEEF\rt1100EA60\rT0000010021234\rr1008\rz\rV1013\r\x07t12311F\rt1232AB\rhello\rtXYZ0\r";
        let heard = bytes.iter().filter_map(|byte| decoder.push(*byte).unwrap());
        let heard: Vec<_> = heard.map(|frame| (frame.id(), frame.data().to_vec())).collect();
        assert_eq!(
            heard,
            [(0x0C0, vec![0xBE, 0xEF]), (0x110, vec![]), (0x123, vec![0x1F])]
        );
        let expected = Unread {
            frames: 2,
            lines: 3,
            first_line: Some("t1232AB".into()),
        };
        assert_eq!(decoder.unread(), expected);
        // A line without an end fills no memory, and is one line.
        for _ in 0..1000 {
            assert_eq!(decoder.push(b't').unwrap(), None);
        }
        assert_eq!(decoder.push(b'\r').unwrap(), None);
        assert_eq!(decoder.unread().lines, 4);
    }

    /// An adapter that stamps its frames although it was told not to.
    #[test]
    fn stamped_frames_of_an_adapter_are_heard() {
        use std::io::{Read, Write};
        let server = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let address = server.local_addr().unwrap();
        let adapter = std::thread::spawn(move || {
            let (mut client, _) = server.accept().unwrap();
            let mut told = [0; OPEN.len()];
            client.read_exact(&mut told).unwrap();
            client
                .write_all(b"\r\r\r\rt0C080102030405060708EA5F\rt1000\r0000\r")
                .unwrap();
            told
        });
        let mut listener = crate::live::Listener::on(&format!("tcp:{address}")).unwrap();
        let mut heard = Vec::new();
        // The adapter is gone when its thread ends.
        while let Ok(frame) = listener.frame() {
            heard.extend(frame.map(|frame| (frame.id(), frame.data().to_vec())));
        }
        assert_eq!(heard, [(0x0C0, (1..=8).collect()), (0x100, Vec::new())]);
        assert_eq!(listener.unread().lines, 1);
        assert_eq!(&adapter.join().unwrap(), b"C\rS6\rZ0\rO\r");
    }
}
