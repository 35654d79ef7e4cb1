//! A chunk of drives as bytes: what a worker hands back, and what lies on the disk until all are there.
//!
//! Eight bytes that name the form; the sweep's fingerprint, the chunk's number, its rows and its columns as `u64`;
//! the rows as `f64` (NaN: no value); a checksum. All little-endian.

use haptic_sim::unguided::Cause;

use super::Driven;
use crate::Away;

const FORM: &[u8; 8] = b"HSWEEP2\n";
/// Columns before the metrics: diverged, end_m, and when, why (0: never), until when and for how long the guidance was away.
const OWN: usize = 6;

/// Drives that follow each other.
#[derive(Debug, Clone, PartialEq)]
pub struct Chunk {
    /// From 0.
    pub number: u64,
    /// Its drives, in order.
    pub rows: Vec<Driven>,
}

impl Chunk {
    /// The bytes that [`Chunk::from_bytes`] reads.
    pub fn to_bytes(&self, fingerprint: u64) -> Vec<u8> {
        let columns = OWN + self.rows.first().map_or(0, |row| row.metrics.len());
        let mut bytes = FORM.to_vec();
        for head in [fingerprint, self.number, self.rows.len() as u64, columns as u64] {
            bytes.extend(head.to_le_bytes());
        }
        for row in &self.rows {
            let number = |value: Option<f64>| value.unwrap_or(f64::NAN);
            let own = [
                f64::from(row.diverged),
                row.end_m,
                number(row.away.guidance_left_s),
                row.away.guidance_left_why.map_or(0.0, Cause::code),
                number(row.away.guidance_back_s),
                number(row.away.unguided_s),
            ];
            let metrics = row.metrics.iter().map(|value| number(*value));
            for value in own.into_iter().chain(metrics) {
                bytes.extend(value.to_le_bytes());
            }
        }
        bytes.extend(checksum(&bytes).to_le_bytes());
        bytes
    }

    /// Reads a chunk; `None` if these are not the bytes of one, of that sweep, with so many rows and metrics.
    pub fn from_bytes(bytes: &[u8], fingerprint: u64, rows: usize, metrics: usize) -> Option<Self> {
        let (body, sum) = bytes.split_last_chunk::<8>()?;
        if checksum(body) != u64::from_le_bytes(*sum) {
            return None;
        }
        let mut words = body.strip_prefix(FORM)?.chunks_exact(8).map(|word| {
            let mut bytes = [0; 8];
            bytes.copy_from_slice(word);
            u64::from_le_bytes(bytes)
        });
        let head: Vec<u64> = words.by_ref().take(4).collect();
        let &[of, number, count, columns] = head.as_slice() else {
            return None;
        };
        if (of, count, columns) != (fingerprint, rows as u64, (OWN + metrics) as u64) {
            return None;
        }
        let values: Vec<f64> = words.map(f64::from_bits).collect();
        let rows: Vec<Driven> = values.chunks_exact(OWN + metrics).map(driven).collect();
        (rows.len() as u64 == count).then_some(Self { number, rows })
    }
}

fn driven(row: &[f64]) -> Driven {
    let number = |value: &f64| value.is_finite().then_some(*value);
    Driven {
        diverged: row[0] != 0.0,
        end_m: row[1],
        away: Away {
            guidance_left_s: number(&row[2]),
            guidance_left_why: Cause::from_code(row[3]),
            guidance_back_s: number(&row[4]),
            unguided_s: number(&row[5]),
        },
        metrics: row[OWN..].iter().map(number).collect(),
    }
}

/// FNV-1a: against a file cut short or spoiled, not against ill will.
pub(super) fn checksum(bytes: &[u8]) -> u64 {
    let step = |sum: u64, byte: &u8| (sum ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01B3);
    bytes.iter().fold(0xCBF2_9CE4_8422_2325, step)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Published values of FNV-1a with 64 bits (Fowler, Noll and Vo): the empty text, "a", "foobar".
    #[test]
    fn the_checksum_has_its_published_values() {
        assert_eq!(checksum(b""), 0xCBF2_9CE4_8422_2325);
        assert_eq!(checksum(b"a"), 0xAF63_DC4C_8601_EC8C);
        assert_eq!(checksum(b"foobar"), 0x8594_4171_F739_67E8);
    }

    #[test]
    fn a_chunk_reads_back_and_a_spoiled_one_does_not() {
        let row = |end_m, value: Option<f64>| Driven {
            diverged: end_m > 5.0,
            end_m,
            away: Away {
                guidance_left_s: value.map(|_| 30.5),
                guidance_left_why: value.map(|_| Cause::TooSlow),
                guidance_back_s: None,
                unguided_s: value.map(f64::abs),
            },
            metrics: vec![Some(0.25), value],
        };
        let chunk = Chunk {
            number: 7,
            rows: vec![row(1.5, None), row(9.0, Some(-0.0))],
        };
        let bytes = chunk.to_bytes(42);
        let read = Chunk::from_bytes(&bytes, 42, 2, 2).unwrap();
        assert_eq!(read, chunk);
        assert_eq!(read.to_bytes(42), bytes);
        assert_eq!(Chunk::from_bytes(&bytes, 43, 2, 2), None);
        assert_eq!(Chunk::from_bytes(&bytes, 42, 3, 2), None);
        for cut in 0..bytes.len() {
            assert_eq!(Chunk::from_bytes(&bytes[..cut], 42, 2, 2), None, "{cut}");
            let mut flipped = bytes.clone();
            flipped[cut] ^= 0x10;
            assert_eq!(Chunk::from_bytes(&flipped, 42, 2, 2), None, "{cut}");
        }
    }
}
