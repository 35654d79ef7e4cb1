//! Parameters as bytes in memory that survives power: two copies, each with a sequence number and a CRC-32.
//!
//! | bytes | what |
//! |---|---|
//! | 0..4 | version of this layout, u32 |
//! | 4..8 | sequence number, u32; the newer of two good copies counts, across a wrap |
//! | 8..160 | the parameters in the order of [`PARAMETERS`], SI, f64 |
//! | 160..164 | CRC-32 (ISO-HDLC, as in zlib) of all before |
//!
//! All little-endian. Who writes puts the next sequence number into the copy that was *not* loaded, so that a
//! write that power cuts short leaves the previous set in use. Not here: the memory itself, and what to do
//! without a good copy (`Ecu::new` locks). Absurd values within their ranges are accepted: the envelope bounds
//! what they can do.

use crc::{CRC_32_ISO_HDLC, Crc, NoTable};

use crate::config::Setup;
use crate::params::{PARAMETERS, Params};

/// Length of a copy.
pub const BYTES: usize = 8 + 8 * VALUES + 4;
const VALUES: usize = PARAMETERS.len();
/// Counts up with every change of the list of parameters: a copy of another layout is no copy.
const VERSION: u32 = 2;
const CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

/// What [`load`] found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stored {
    /// The parameters, every one within its range.
    pub params: Params,
    /// Their sequence number.
    pub sequence: u32,
    /// Which copy they come from, 0 or 1; the next set belongs into the other one.
    pub copy: usize,
}

/// A copy to write.
#[must_use]
pub fn save(params: &Params, sequence: u32) -> [u8; BYTES] {
    let mut bytes = [0; BYTES];
    let head = VERSION.to_le_bytes().into_iter().chain(sequence.to_le_bytes());
    let values = params.to_values().into_iter().flat_map(f64::to_le_bytes);
    for (byte, value) in bytes.iter_mut().zip(head.chain(values)) {
        *byte = value;
    }
    let [body @ .., a, b, c, d] = &mut bytes;
    [*a, *b, *c, *d] = CRC.checksum(body).to_le_bytes();
    bytes
}

/// The newest good copy, if there is one.
#[must_use]
pub fn load(copies: [&[u8]; 2]) -> Option<Stored> {
    let [a, b] = copies.map(read);
    let stored = |copy: usize| {
        move |(sequence, params)| Stored {
            params,
            sequence,
            copy,
        }
    };
    match (a, b) {
        // Ahead by less than half of all numbers is newer.
        (Some(a), Some(b)) if b.0.wrapping_sub(a.0).cast_signed() > 0 => Some(stored(1)(b)),
        (None, b) => b.map(stored(1)),
        (a, _) => a.map(stored(0)),
    }
}

fn read(bytes: &[u8]) -> Option<(u32, Params)> {
    let bytes: &[u8; BYTES] = bytes.try_into().ok()?;
    let [body @ .., a, b, c, d] = bytes;
    let [v0, v1, v2, v3, s0, s1, s2, s3, values @ ..] = body;
    let is_whole = CRC.checksum(body) == u32::from_le_bytes([*a, *b, *c, *d]);
    let is_ours = u32::from_le_bytes([*v0, *v1, *v2, *v3]) == VERSION;
    let mut si = [0.0; VALUES];
    for (si, bytes) in si.iter_mut().zip(values.as_chunks().0) {
        *si = f64::from_le_bytes(*bytes);
    }
    let params = Params::from_values(&si);
    (is_whole && is_ours && Setup::new(&params).is_ok())
        .then(|| (u32::from_le_bytes([*s0, *s1, *s2, *s3]), params))
}
