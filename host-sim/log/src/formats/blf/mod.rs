//! Vector's BLF: objects in compressed containers behind a heading with the start's date.
//!
//! Read are data frames (objects 1 and 86 of classic CAN, 100 and 101 of CAN FD, which hold classic frames too); times are
//! since 1970, as python-can gives them, to the nanosecond. One container is in memory at a time. The crate blf_asc is not
//! used: it reads an object of size zero for ever.

mod writer;

use std::io::Read;

use super::bytes::{Budget, Bytes};
use super::calendar;
use crate::bus::{BusFrame, Form, Intake, Take};
use crate::notes::{Fate, Notes, Part};
use crate::recording::{RecordingError, refuse};
pub(super) use writer::Writer;

const SIGNATURE: &[u8] = b"LOGG";
const OBJECT: &[u8] = b"LOBJ";
const CONTAINER: u32 = 10;
const CAN_MESSAGE: u32 = 1;
const CAN_MESSAGE_2: u32 = 86;
const FD_MESSAGE: u32 = 100;
const FD_MESSAGE_64: u32 = 101;
const ERRORS: [u32; 3] = [2, 73, 104];
const EXTENDED: u32 = 1 << 31;
const REMOTE: u8 = 0x80;
const SENT: u8 = 1;
const OBJECT_HEAD: u64 = 16;
/// Largest object that is believed: those of CAN have 150 bytes, containers of Vector's tools 128 KB.
const LARGEST: u64 = 64 << 20;

/// Reads the data frames of one file, of which `size` is the length; of one bus if one is wanted. What is cut or damaged is
/// counted, and read as far as it goes.
pub(super) fn read(
    input: &mut dyn Read,
    size: u64,
    bus: Option<&str>,
    take: &mut Take<'_>,
) -> Result<Notes, RecordingError> {
    let mut intake = Intake::new("object", bus, take);
    let head = up_to(input, 72)?;
    if !head.starts_with(SIGNATURE) {
        return Err("this is no BLF file: it does not begin with LOGG".into());
    }
    let head = Bytes(&head);
    let mut start = [0; 8];
    for (i, part) in start.iter_mut().enumerate() {
        *part = head.u16(40 + 2 * i as u64)?;
    }
    let (said_size, said_objects) = (head.u64(16)?, head.u32(32)?);
    let mut stream = Stream {
        bytes: Vec::new(),
        start_ms: calendar::ms(start).unwrap_or(0),
        frame: BusFrame::default(),
    };
    let mut at = u64::from(head.u32(4)?.max(72));
    up_to(input, at - 72)?;
    let mut budget = Budget::of_size(size);
    let mut is_damaged = false;
    let is_whole = loop {
        let head = up_to(input, OBJECT_HEAD)?;
        let Some((length, kind)) = object(&head) else {
            break head.iter().all(|byte| *byte == 0);
        };
        let mut body = up_to(input, length - OBJECT_HEAD)?;
        let is_whole = body.len() as u64 == length - OBJECT_HEAD;
        let mut is_good = true;
        if kind == CONTAINER {
            is_good = contents(&body, &mut budget, &mut stream.bytes)?;
        } else {
            stream.bytes.extend_from_slice(&head);
            stream.bytes.append(&mut body);
            stream.bytes.resize(stream.bytes.len().next_multiple_of(4), 0);
        }
        stream.frames(&mut intake)?;
        if !is_good {
            // What the container began does not go on in the next one.
            stream.bytes.clear();
            is_damaged = true;
        }
        if !is_whole {
            break false;
        }
        up_to(input, length % 4)?;
        at += length + length % 4;
    };
    if is_damaged || !is_whole || said_size > size || stream.bytes.starts_with(OBJECT) {
        // The heading says how many there were, unless its writer never came to that.
        let missing = u64::from(said_objects)
            .saturating_sub(stream.frame.line as u64)
            .max(1);
        let place = format_args!("byte {at}");
        intake.notes.count_many(
            Fate::Cut,
            Part::Object,
            "the file is cut or damaged",
            missing,
            place,
        );
    }
    intake.finish()
}

/// Reads so many bytes, or what is left.
fn up_to(input: &mut dyn Read, size: u64) -> Result<Vec<u8>, RecordingError> {
    let mut bytes = Vec::new();
    input.take(size).read_to_end(&mut bytes).map_err(refuse)?;
    Ok(bytes)
}

/// Size and kind of an object by its head; none where there is no object.
fn object(head: &[u8]) -> Option<(u64, u32)> {
    let bytes = Bytes(head);
    let size = bytes.u32(8).ok()?.into();
    let is_one = head.starts_with(OBJECT) && (OBJECT_HEAD..LARGEST).contains(&size);
    is_one.then_some((size, bytes.u32(12).ok()?))
}

/// What stands in a container, to the stream of all of them: objects may straddle two. False if it is damaged or cut.
fn contents(body: &[u8], budget: &mut Budget, stream: &mut Vec<u8>) -> Result<bool, RecordingError> {
    let Some((head, inside)) = body.split_at_checked(16) else {
        return Ok(false);
    };
    match Bytes(head).u16(0)? {
        0 => stream.extend_from_slice(inside),
        2 => {
            let (inflated, is_whole) = budget.inflated_as_far(inside)?;
            stream.extend(inflated);
            return Ok(is_whole);
        }
        other => return Err(format!("compression {other} of a container is not known").into()),
    }
    Ok(true)
}

/// The contents of the containers that are not read yet.
struct Stream {
    bytes: Vec<u8>,
    start_ms: u64,
    frame: BusFrame,
}

impl Stream {
    /// Reads the objects that are there as a whole.
    fn frames(&mut self, intake: &mut Intake<'_>) -> Result<(), RecordingError> {
        let bytes = std::mem::take(&mut self.bytes);
        let mut at = 0;
        // Writers fill up to a multiple of four, some by the remainder instead; behind damage the next object goes on.
        while let Some(next) = bytes[at..].windows(4).position(|four| four == OBJECT) {
            at += next;
            let Some(head) = bytes.get(at..at + OBJECT_HEAD as usize) else {
                break;
            };
            let Some((size, kind)) = object(head) else {
                at += OBJECT.len();
                continue;
            };
            let Some(whole) = bytes.get(at..at + size as usize) else {
                break;
            };
            self.frame.line += 1;
            match self.message(kind, Bytes(whole)) {
                Ok(Found::Frame { missing }) => {
                    let (why, place) = (
                        "the object ends before the frame, whose other bytes are 0",
                        format_args!("object {}", self.frame.line),
                    );
                    let cut = u64::from(missing > 0);
                    intake
                        .notes
                        .count_many(Fate::Mended, Part::Frame, why, cut, place);
                    intake.frame(&self.frame)?;
                }
                Ok(Found::Other(part, why)) => intake.left_out(part, why, self.frame.line),
                Err(_) => intake.left_out(Part::Object, "damaged", self.frame.line),
            }
            at += size as usize;
        }
        self.bytes = bytes;
        self.bytes.drain(..at);
        Ok(())
    }

    /// Fills the frame from an object.
    fn message(&mut self, kind: u32, object: Bytes<'_>) -> Result<Found, RecordingError> {
        if ERRORS.contains(&kind) {
            return Ok(Found::Other(Part::Frame, "error frame"));
        }
        let body = u64::from(object.u16(4)?);
        let (channel, flags, code) = (object.u16(body), object.u8(body + 2), object.u8(body + 3));
        let mut end = object.0.len();
        // Place and number of the bytes; bits of CAN FD, of the switched rate and of the sender's state.
        let (channel, flags, from, length, bits) = match kind {
            CAN_MESSAGE | CAN_MESSAGE_2 => (channel?, flags?, 8, code?.min(8), [false; 3]),
            FD_MESSAGE => {
                let bits = object.u8(body + 13)?;
                let bits = [1, 2, 4].map(|bit| bits & bit != 0);
                (channel?, flags?, 20, object.u8(body + 14)?, bits)
            }
            FD_MESSAGE_64 => {
                let bits = object.u32(body + 12)?;
                let remote = if bits & 0x10 != 0 { REMOTE } else { 0 };
                let flags = remote | u8::from(object.u8(body + 34)? != 0);
                let bits = [0x1000, 0x2000, 0x4000].map(|bit| bits & bit != 0);
                // Behind the bytes there may be more about the frame.
                let more = usize::from(object.u8(body + 35)?);
                end = if more == 0 { end } else { end.min(more) };
                (object.u8(body)?.into(), flags, 40, object.u8(body + 2)?, bits)
            }
            _ => return Ok(Found::Other(Part::Object, "no frame of CAN")),
        };
        if flags & REMOTE != 0 {
            return Ok(Found::Other(Part::Frame, "remote frame"));
        }
        let frame = &mut self.frame;
        frame.form = match bits {
            [true, switched, passive] => Form::Fd { switched, passive },
            [false, ..] => Form::Classic,
        };
        let id = object.u32(body + 4)?;
        (frame.id, frame.extended) = (id & 0x1FFF_FFFF, id & EXTENDED != 0);
        let length = usize::from(length);
        if length > frame.form.most_bytes() {
            return Ok(Found::Other(Part::Frame, "more bytes than a frame has"));
        }
        if frame.id > 0x7FF && !frame.extended {
            let why = "an identifier above 7FF that has 11 bits";
            return Ok(Found::Other(Part::Frame, why));
        }
        // Writers leave out what the end of a frame has of zeros, as Vector's own library reads it.
        let from = (body + from) as usize;
        let bytes = object.0.get(from..end).ok_or("no place for bytes")?;
        frame.data.clear();
        frame.data.extend(bytes.iter().take(length));
        let missing = length - frame.data.len();
        if missing > 0 && kind != FD_MESSAGE_64 {
            return Err("the object ends before the frame".into());
        }
        frame.data.resize(length, 0);
        frame.sent = flags & SENT != 0;
        frame.bus.clear();
        // Writing to a string does not fail.
        let _ = std::fmt::Write::write_fmt(&mut frame.bus, format_args!("{channel}"));
        let ticks = object.u64(24)?;
        let ns = match object.u32(16)? {
            1 => ticks.saturating_mul(10_000),
            _ => ticks,
        };
        // Whole milliseconds and the rest apart: the sum is rounded once.
        let total_ns = u128::from(self.start_ms) * 1_000_000 + u128::from(ns);
        frame.time_s = total_ns as f64 / 1e9;
        Ok(Found::Frame { missing })
    }
}

/// What an object is.
enum Found {
    /// A data frame, and how many of its bytes the object does not have.
    Frame {
        missing: usize,
    },
    Other(Part, &'static str),
}
