//! Frames as the bytes of a channel, and back.

use haptic_core::bus::Frame;
use haptic_core::bus::slcan::{self, Line, Parser};
use haptic_lockstep::{RECORD_LEN, from_record, to_record};

use super::{Channel, PilError};

/// What an SLCAN client sends first: close what is open, 500 kbit/s, open.
pub(super) const OPEN: &[u8] = b"C\rS6\rO\r";
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

/// Collects bytes to frames. Answers to our own SLCAN lines are passed over.
pub(super) enum Decoder {
    Fifo(Vec<u8>),
    Slcan(Parser),
}

impl Decoder {
    pub(super) fn new(channel: Channel) -> Self {
        match channel {
            Channel::Fifo => Self::Fifo(Vec::with_capacity(RECORD_LEN)),
            Channel::Slcan => Self::Slcan(Parser::default()),
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
            Self::Slcan(parser) => match parser.push(byte) {
                Some(Line::Frame(frame)) => Ok(Some(frame)),
                _ => Ok(None),
            },
        }
    }
}
