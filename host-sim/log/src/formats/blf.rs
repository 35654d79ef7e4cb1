//! Vector's BLF: objects in compressed containers behind a heading with the start's date.
//!
//! Read are data frames of classic CAN (objects 1 and 86); times are since 1970, as python-can gives them, to the
//! nanosecond. The crate blf_asc is not used: it reads an object of size zero for ever.

use super::bytes::{Budget, Bytes};
use super::calendar;
use crate::candump::CandumpFrame;
use crate::recording::RecordingError;

const SIGNATURE: &[u8] = b"LOGG";
const OBJECT: &[u8] = b"LOBJ";
const HEADING: u32 = 144;
const CAN_MESSAGE: u32 = 1;
const CONTAINER: u32 = 10;
const CAN_MESSAGE_2: u32 = 86;
const EXTENDED: u32 = 1 << 31;
const REMOTE: u8 = 0x80;
const OBJECT_HEAD: u64 = 16;

/// Every data frame of classic CAN; `line` is the number of the object.
///
/// # Errors
/// Another file, a damaged one.
pub fn parse(file: &[u8]) -> Result<Vec<CandumpFrame>, RecordingError> {
    if !file.starts_with(SIGNATURE) {
        return Err("this is no BLF file: it does not begin with LOGG".into());
    }
    let bytes = Bytes(file);
    let mut start = [0; 8];
    for (i, part) in start.iter_mut().enumerate() {
        *part = bytes.u16(40 + 2 * i as u64)?;
    }
    let start_ms = calendar::ms(start).unwrap_or(0);
    let mut at = u64::from(bytes.u32(4)?.max(72));
    // Objects may straddle containers, so that their contents are one stream.
    let (mut stream, mut budget) = (Vec::new(), Budget::new(file));
    while at + OBJECT_HEAD <= file.len() as u64 {
        let (size, kind) = head(bytes, at)?;
        if kind == CONTAINER {
            let method = bytes.u16(at + OBJECT_HEAD)?;
            let from = OBJECT_HEAD + 16;
            let inside = bytes.slice(at + from, size.checked_sub(from).ok_or_else(|| too_small(at))?)?;
            match method {
                0 => stream.extend_from_slice(inside),
                2 => {
                    let inflated = budget.inflated(inside);
                    stream.extend(inflated.map_err(|e| RecordingError(format!("byte {at}: {e}")))?);
                }
                other => return Err(format!("byte {at}: compression {other} is not known").into()),
            }
        } else {
            stream.extend_from_slice(bytes.slice(at, size)?);
            stream.resize(stream.len().next_multiple_of(4), 0);
        }
        at += size + size % 4;
    }
    frames(Bytes(&stream), start_ms)
}

fn too_small(at: u64) -> RecordingError {
    RecordingError(format!("byte {at}: an object is smaller than its head"))
}

/// Size and kind of the object at a place.
fn head(bytes: Bytes<'_>, at: u64) -> Result<(u64, u32), RecordingError> {
    if bytes.slice(at, 4)? != OBJECT {
        return Err(format!("byte {at}: no object (LOBJ) where one has to be").into());
    }
    let size = u64::from(bytes.u32(at + 8)?);
    if size < OBJECT_HEAD {
        return Err(too_small(at));
    }
    Ok((size, bytes.u32(at + 12)?))
}

fn frames(stream: Bytes<'_>, start_ms: u64) -> Result<Vec<CandumpFrame>, RecordingError> {
    let mut frames = Vec::new();
    let (mut at, mut number) = (0, 0);
    while at + OBJECT_HEAD <= stream.0.len() as u64 {
        // Writers fill up to a multiple of four, some by the remainder instead.
        while at < stream.0.len() as u64 - 4
            && !stream.slice(at, 4)?.starts_with(OBJECT)
            && stream.u8(at)? == 0
        {
            at += 1;
        }
        if at + OBJECT_HEAD > stream.0.len() as u64 {
            break;
        }
        let (size, kind) = head(stream, at)?;
        number += 1;
        if kind == CAN_MESSAGE || kind == CAN_MESSAGE_2 {
            let head_size = u64::from(stream.u16(at + 4)?);
            let ticks = stream.u64(at + 24)?;
            let ns = match stream.u32(at + 16)? {
                1 => ticks.saturating_mul(10_000),
                _ => ticks,
            };
            let body = at + head_size;
            let (flags, length) = (stream.u8(body + 2)?, stream.u8(body + 3)?.min(8));
            let id = stream.u32(body + 4)?;
            let data = stream.slice(body + 8, length.into())?.to_vec();
            if flags & REMOTE == 0 {
                // Whole milliseconds and the rest apart: the sum is rounded once.
                let total_ns = u128::from(start_ms) * 1_000_000 + u128::from(ns);
                let extended = id & EXTENDED != 0;
                let id = id & 0x1FFF_FFFF;
                frames.push(CandumpFrame {
                    line: number,
                    time_s: total_ns as f64 / 1e9,
                    id,
                    extended,
                    data,
                });
            }
        }
        at += size;
    }
    Ok(frames)
}

pub(super) fn write(frames: &[CandumpFrame]) -> Vec<u8> {
    const MOST: usize = 128 * 1024;
    let ns = |time_s: f64| (time_s.max(0.0) * 1e9).round() as u64;
    let start_ms = frames.first().map_or(0, |frame| ns(frame.time_s) / 1_000_000);
    let stop_ms = frames.last().map_or(0, |frame| ns(frame.time_s) / 1_000_000);
    let mut containers = Vec::new();
    let mut uncompressed = u64::from(HEADING);
    let mut inside = Vec::new();
    let mut close = |inside: &mut Vec<u8>| {
        let packed = miniz_oxide::deflate::compress_to_vec_zlib(inside, 6);
        let size = 32 + packed.len() as u32;
        containers.extend_from_slice(OBJECT);
        containers.extend_from_slice(&16_u16.to_le_bytes());
        containers.extend_from_slice(&1_u16.to_le_bytes());
        containers.extend_from_slice(&size.to_le_bytes());
        containers.extend_from_slice(&CONTAINER.to_le_bytes());
        containers.extend_from_slice(&[2, 0, 0, 0, 0, 0, 0, 0]);
        containers.extend_from_slice(&(inside.len() as u32).to_le_bytes());
        containers.extend_from_slice(&[0; 4]);
        containers.extend_from_slice(&packed);
        containers.resize(containers.len() + size as usize % 4, 0);
        uncompressed += 32 + inside.len() as u64;
        inside.clear();
    };
    for frame in frames {
        inside.extend_from_slice(OBJECT);
        inside.extend_from_slice(&32_u16.to_le_bytes());
        inside.extend_from_slice(&1_u16.to_le_bytes());
        inside.extend_from_slice(&48_u32.to_le_bytes());
        inside.extend_from_slice(&CAN_MESSAGE.to_le_bytes());
        // Nanoseconds.
        inside.extend_from_slice(&2_u32.to_le_bytes());
        inside.extend_from_slice(&[0; 4]);
        let since_ns = ns(frame.time_s).saturating_sub(start_ms * 1_000_000);
        inside.extend_from_slice(&since_ns.to_le_bytes());
        inside.extend_from_slice(&1_u16.to_le_bytes());
        inside.push(0);
        inside.push(frame.data.len() as u8);
        inside.extend_from_slice(&(frame.id | if frame.extended { EXTENDED } else { 0 }).to_le_bytes());
        let mut data = [0; 8];
        data[..frame.data.len()].copy_from_slice(&frame.data);
        inside.extend_from_slice(&data);
        if inside.len() + 48 > MOST {
            close(&mut inside);
        }
    }
    if !inside.is_empty() {
        close(&mut inside);
    }
    let mut file = Vec::with_capacity(HEADING as usize + containers.len());
    file.extend_from_slice(SIGNATURE);
    file.extend_from_slice(&HEADING.to_le_bytes());
    file.extend_from_slice(&[5, 0, 0, 0, 2, 6, 8, 1]);
    file.extend_from_slice(&(u64::from(HEADING) + containers.len() as u64).to_le_bytes());
    file.extend_from_slice(&uncompressed.to_le_bytes());
    file.extend_from_slice(&(frames.len() as u32).to_le_bytes());
    file.extend_from_slice(&[0; 4]);
    for part in [start_ms, stop_ms].map(calendar::date).as_flattened() {
        file.extend_from_slice(&part.to_le_bytes());
    }
    file.resize(HEADING as usize, 0);
    file.extend_from_slice(&containers);
    file
}
