//! Parameters as bytes in memory that survives power: two copies, each with a sequence number and a CRC-32.
//!
//! | bytes | what |
//! |---|---|
//! | 0..4 | version of this layout, u32 |
//! | 4..8 | sequence number, u32; the newer of two good copies counts, across a wrap |
//! | 8..12 | the number of the processor that wrote it, u32 |
//! | 12..16 | the number of the vehicle that it is for, u32; 0: nobody said |
//! | 16..264 | the parameters in the order of [`PARAMETERS`], SI, f64 |
//! | 264..268 | CRC-32 (ISO-HDLC, as in zlib) of all before |
//!
//! All little-endian. Who writes puts the next sequence number into the copy that was *not* loaded, so that a
//! write that power cuts short leaves the previous set in use. Not here: the memory itself, and what to do
//! without a good copy (`Ecu::new` locks). Absurd values within their ranges are accepted: the envelope bounds
//! what they can do.

use core::num::NonZeroU32;

use crc::{CRC_32_ISO_HDLC, Crc, NoTable};

use crate::controller::config::Setup;
use crate::controller::params::{PARAMETERS, Params};

/// Length of a copy.
pub const BYTES: usize = 16 + 8 * VALUES + 4;
const VALUES: usize = PARAMETERS.len();
/// Counts up with every change of the list of parameters: a copy of another layout is no copy.
const VERSION: u32 = 5;
const CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

/// Parameters, and whom they are for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Set {
    /// The parameters.
    pub params: Params,
    /// The number of the vehicle, if anybody said it.
    pub vehicle: Option<NonZeroU32>,
}

/// What [`load`] found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stored {
    /// The set, every parameter within its range.
    pub set: Set,
    /// Its sequence number.
    pub sequence: u32,
    /// Which copy it comes from, 0 or 1; the next set belongs into the other one.
    pub copy: usize,
}

/// A copy to write, by the processor of that number.
#[must_use]
pub fn save(set: &Set, sequence: u32, hardware: u32) -> [u8; BYTES] {
    let mut bytes = [0; BYTES];
    let vehicle = set.vehicle.map_or(0, NonZeroU32::get);
    let head = [VERSION, sequence, hardware, vehicle]
        .into_iter()
        .flat_map(u32::to_le_bytes);
    let values = set.params.to_values().into_iter().flat_map(f64::to_le_bytes);
    for (byte, value) in bytes.iter_mut().zip(head.chain(values)) {
        *byte = value;
    }
    let [body @ .., a, b, c, d] = &mut bytes;
    [*a, *b, *c, *d] = CRC.checksum(body).to_le_bytes();
    bytes
}

/// The newest good copy that the processor of that number wrote, if there is one. A copy of another processor's came with
/// the memory of another ECU, and may be another vehicle's.
#[must_use]
pub fn load(copies: [&[u8]; 2], hardware: u32) -> Option<Stored> {
    let [a, b] = copies.map(|bytes| read(bytes, hardware));
    let stored = |copy: usize| move |(sequence, set)| Stored { set, sequence, copy };
    match (a, b) {
        // Ahead by less than half of all numbers is newer.
        (Some(a), Some(b)) if b.0.wrapping_sub(a.0).cast_signed() > 0 => Some(stored(1)(b)),
        (None, b) => b.map(stored(1)),
        (a, _) => a.map(stored(0)),
    }
}

fn read(bytes: &[u8], hardware: u32) -> Option<(u32, Set)> {
    let bytes: &[u8; BYTES] = bytes.try_into().ok()?;
    let [body @ .., a, b, c, d] = bytes;
    let (head, values) = body.split_first_chunk::<16>()?;
    let mut words = [0; 4];
    for (word, bytes) in words.iter_mut().zip(head.as_chunks().0) {
        *word = u32::from_le_bytes(*bytes);
    }
    let [version, sequence, written_by, vehicle] = words;
    let is_whole = CRC.checksum(body) == u32::from_le_bytes([*a, *b, *c, *d]);
    let is_ours = version == VERSION && written_by == hardware;
    let mut si = [0.0; VALUES];
    for (si, bytes) in si.iter_mut().zip(values.as_chunks().0) {
        *si = f64::from_le_bytes(*bytes);
    }
    let (params, vehicle) = (Params::from_values(&si), NonZeroU32::new(vehicle));
    (is_whole && is_ours && Setup::check(&params).is_ok()).then_some((sequence, Set { params, vehicle }))
}
