//! Broken files out of good ones.

use std::hash::{DefaultHasher, Hash, Hasher};

use rand::rngs::SmallRng;
use rand::{RngExt, SeedableRng};

/// Numbers as texts write them, and should not.
const TEXTS: [&str; 24] = [
    "0",
    "-1",
    "1",
    "1e9",
    "1.7e9",
    "86400",
    "1e300",
    "-1e300",
    "1e-300",
    "nan",
    "inf",
    "-inf",
    "",
    "x",
    "99999999999999999999",
    "2147483648",
    "-2147483649",
    "4294967296",
    "65536",
    "255",
    "0.1",
    "1e5",
    "3,5",
    "0x7fffffffffffffff",
];
const LONGEST: usize = 1 << 18;

/// Input `number` of a reader: one of its seeds, broken in one to five places. Later seeds are longer, and come less often.
pub(crate) fn input(seeds: &[Vec<u8>], reader: &str, seed: u64, number: u64) -> Vec<u8> {
    let mut hash = DefaultHasher::new();
    (reader, seed, number).hash(&mut hash);
    let mut rng = SmallRng::seed_from_u64(hash.finish());
    let mut pick = rng.random_range(0..seeds.len());
    if rng.random_range(0..16) != 0 {
        pick = pick.min(rng.random_range(0..seeds.len()));
    }
    let mut bytes = seeds[pick].clone();
    let other = &seeds[rng.random_range(0..seeds.len())];
    let is_text = std::str::from_utf8(&bytes).is_ok();
    for _ in 0..rng.random_range(1..=5) {
        if is_text && rng.random_range(0..4) != 0 {
            break_text(&mut bytes, &mut rng);
        } else {
            break_bytes(&mut bytes, other, &mut rng);
        }
    }
    bytes.truncate(LONGEST);
    bytes
}

/// A place, more often near either end, where headings and footers are.
fn place(length: usize, rng: &mut SmallRng) -> usize {
    let near = rng.random_range(0..length.clamp(1, 400));
    match rng.random_range(0..4) {
        0 => near,
        1 => length.saturating_sub(1 + near),
        _ => rng.random_range(0..length.max(1)),
    }
}

fn break_bytes(bytes: &mut Vec<u8>, other: &[u8], rng: &mut SmallRng) {
    let at = place(bytes.len(), rng);
    let size = rng.random_range(0..64).min(bytes.len() - at.min(bytes.len()));
    match rng.random_range(0..9) {
        0 => bytes.truncate(at),
        1 => drop(bytes.drain(at.min(bytes.len())..at + size)),
        2 => {
            let copy = bytes[at.min(bytes.len())..at + size].to_vec();
            bytes.splice(
                at..at,
                copy.into_iter().cycle().take(size * rng.random_range(1..8)),
            );
        }
        3 => {
            let from = place(other.len(), rng);
            let piece = &other[from.min(other.len())..(from + 4 * size).min(other.len())];
            bytes.splice(at..(at + size).min(bytes.len()), piece.iter().copied());
        }
        4 => {
            if let Some(byte) = bytes.get_mut(at) {
                *byte ^= 1 << rng.random_range(0..8);
            }
        }
        5 => {
            if let Some(byte) = bytes.get_mut(at) {
                *byte = [0, 1, 0x7F, 0x80, 0xFF, rng.random()][rng.random_range(0..6)];
            }
        }
        _ => {
            // A number of two, four or eight bytes.
            let values = [
                0,
                1,
                u64::MAX,
                1 << 31,
                1 << 32,
                0x7FFF_FFFF,
                bytes.len() as u64,
                1e300_f64.to_bits(),
                rng.random(),
            ];
            let value = values[rng.random_range(0..values.len())].to_le_bytes();
            let width = [2, 4, 8][rng.random_range(0..3)];
            for (byte, new) in bytes.iter_mut().skip(at).zip(&value[..width]) {
                *byte = *new;
            }
        }
    }
}

fn break_text(bytes: &mut Vec<u8>, rng: &mut SmallRng) {
    let at = place(bytes.len(), rng).min(bytes.len());
    let is_number = |byte: &u8| byte.is_ascii_digit() || b".-+eE".contains(byte);
    match rng.random_range(0..6) {
        0 => {
            // A line is there twice, or not at all, or somewhere else.
            let mut lines: Vec<Vec<u8>> = bytes.split(|b| *b == b'\n').map(<[u8]>::to_vec).collect();
            let (a, b) = (rng.random_range(0..lines.len()), rng.random_range(0..lines.len()));
            match rng.random_range(0..3) {
                0 => drop(lines.remove(a)),
                1 => lines.insert(b, lines[a].clone()),
                _ => lines.swap(a, b),
            }
            *bytes = lines.join(&b'\n');
        }
        1 => {
            let word = b" \t,;#\"'<>/[]{}()=:\n|@*-_"[rng.random_range(0..24)];
            bytes.splice(at..at, std::iter::repeat_n(word, rng.random_range(1..4)));
        }
        _ => {
            let Some(from) = (at..bytes.len()).find(|&k| bytes[k].is_ascii_digit()) else {
                return;
            };
            let first = bytes[..from].iter().rev().take_while(|b| is_number(b)).count();
            let rest = bytes[from..].iter().take_while(|b| is_number(b)).count();
            let text = TEXTS[rng.random_range(0..TEXTS.len())].bytes();
            bytes.splice(from - first..from + rest, text);
        }
    }
}
