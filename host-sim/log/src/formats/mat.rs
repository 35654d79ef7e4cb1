//! MATLAB level 5 (`save -v6` and `-v7`): each channel a column of doubles, `units` and `sources` structs of text.
//!
//! Read are real vectors of any class, plain or compressed, and matrices of a few of them beside each other. The crate matfile is not used: it reads numbers alone, so the
//! units would be lost.

use std::io::Write;

use super::Table;
use super::bytes::{Budget, Bytes};
use crate::notes::{Fate, Part};
use crate::recording::{Group, RecordingError, Series, Term, refuse};
use crate::units;

const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;
const STRUCT: u32 = 2;
const CHAR: u32 = 4;
const DOUBLE: u32 = 6;
/// Most signals of a matrix; a larger one is none of signals.
const MOST_SIGNALS: usize = 16;
/// Longest name of a field or variable, with its zero.
const NAME: usize = 64;

/// What a variable holds.
enum Value {
    Numbers(Vec<f64>),
    /// Numbers by columns, and how many rows there are.
    Matrix(Vec<f64>, usize),
    Text(String),
    Fields(Vec<(String, Value)>),
    Other,
}

/// Type, contents, and where the next element begins.
fn element(bytes: Bytes<'_>, at: u64) -> Result<(u32, Bytes<'_>, u64), RecordingError> {
    let tag = bytes.u32(at)?;
    if tag >> 16 != 0 {
        let size = u64::from(tag >> 16);
        return Ok((tag & 0xFFFF, Bytes(bytes.slice(at + 4, size.min(4))?), at + 8));
    }
    let size = u64::from(bytes.u32(at + 4)?);
    let padded = match tag {
        COMPRESSED => size,
        _ => size.next_multiple_of(8),
    };
    Ok((tag, Bytes(bytes.slice(at + 8, size)?), at + 8 + padded))
}

/// Numbers of an element, by its type.
fn numbers(kind: u32, b: Bytes<'_>) -> Vec<f64> {
    fn each<const N: usize>(b: Bytes<'_>, number: fn([u8; N]) -> f64) -> Vec<f64> {
        let (numbers, _) = b.0.as_chunks::<N>();
        numbers.iter().map(|bytes| number(*bytes)).collect()
    }
    match kind {
        1 => each::<1>(b, |x| f64::from(i8::from_le_bytes(x))),
        2 => each::<1>(b, |x| f64::from(x[0])),
        3 => each(b, |x| f64::from(i16::from_le_bytes(x))),
        4 => each(b, |x| f64::from(u16::from_le_bytes(x))),
        5 => each(b, |x| f64::from(i32::from_le_bytes(x))),
        6 => each(b, |x| f64::from(u32::from_le_bytes(x))),
        7 => each(b, |x| f64::from(f32::from_le_bytes(x))),
        9 => each(b, f64::from_le_bytes),
        12 => each(b, |x| i64::from_le_bytes(x) as f64),
        13 => each(b, |x| u64::from_le_bytes(x) as f64),
        _ => Vec::new(),
    }
}

/// A text, of bytes or of 16-bit characters.
fn text(kind: u32, b: Bytes<'_>) -> String {
    let trimmed = |text: String| text.trim_end_matches(['\0', ' ']).to_owned();
    if [4, 17].contains(&kind) {
        let (units, _) = b.0.as_chunks::<2>();
        let units: Vec<u16> = units.iter().map(|x| u16::from_le_bytes(*x)).collect();
        return trimmed(String::from_utf16_lossy(&units));
    }
    trimmed(String::from_utf8_lossy(b.0).into_owned())
}

/// A matrix's name and value.
fn matrix(b: Bytes<'_>, depth: u32) -> Result<(String, Value), RecordingError> {
    let (_, flags, at) = element(b, 0)?;
    let class = flags.u32(0)? & 0xFF;
    let complex = flags.u32(0)? & 0x800 != 0;
    let (_, dimensions, at) = element(b, at)?;
    let size = numbers(5, dimensions);
    let count: f64 = size.iter().product();
    let (_, name, mut at) = element(b, at)?;
    let name = text(1, name);
    let real = !complex && size.len() <= 2;
    let vector = size.iter().filter(|n| **n != 1.0).count() <= 1;
    let value = match class {
        CHAR => {
            let (kind, contents, _) = element(b, at)?;
            Value::Text(text(kind, contents))
        }
        DOUBLE..=15 if real || (vector && !complex) => {
            let (kind, contents, _) = element(b, at)?;
            let values = numbers(kind, contents);
            if values.len() as f64 != count {
                return Err(format!("channel {name}: {} values where it says {count}", values.len()).into());
            }
            if vector {
                Value::Numbers(values)
            } else {
                Value::Matrix(values, size[0] as usize)
            }
        }
        STRUCT if count == 1.0 && depth == 0 => {
            let (_, length, next) = element(b, at)?;
            let length = length.u32(0)?.max(1) as usize;
            let (_, names, next) = element(b, next)?;
            at = next;
            let mut fields = Vec::new();
            for name in names.0.chunks(length) {
                let (_, contents, next) = element(b, at)?;
                at = next;
                // An empty field is an empty element.
                if !contents.0.is_empty() {
                    fields.push((text(1, Bytes(name)), matrix(contents, depth + 1)?.1));
                }
            }
            Value::Fields(fields)
        }
        _ => Value::Other,
    };
    Ok((name, value))
}

/// Whether a file is of level 5, the only one that is read.
fn check_level(file: &[u8]) -> Result<(), RecordingError> {
    if file.starts_with(b"MATLAB 7.3") {
        return Err("this is MATLAB 7.3 (HDF5): save it with -v7".into());
    }
    match Bytes(file).slice(124, 4) {
        Ok([0, 1, b'I', b'M']) => Ok(()),
        Ok([_, _, b'M', b'I']) => Err("this MAT file is big-endian, which is not read".into()),
        _ => Err("this is no MAT file of level 5: save it with -v6 or -v7".into()),
    }
}

pub(super) fn read(file: &[u8], time: Option<&Term>) -> Result<Table, RecordingError> {
    let b = Bytes(file);
    check_level(file)?;
    let mut found = Table::default();
    let (mut columns, mut units, mut sources) = (Vec::<Series>::new(), Vec::new(), Vec::new());
    let mut budget = Budget::new(file);
    let mut at = 128;
    while at + 8 <= file.len() as u64 {
        let place = format!("byte {at}");
        let (kind, contents, next) = element(b, at)?;
        at = next;
        let unpacked;
        let contents = match kind {
            MATRIX => contents,
            COMPRESSED => {
                unpacked = budget.inflated(contents.0)?;
                match element(Bytes(&unpacked), 0)? {
                    (MATRIX, contents, _) => contents,
                    _ => continue,
                }
            }
            _ => continue,
        };
        match matrix(contents, 0)? {
            (name, _) if name.is_empty() => {
                found
                    .notes
                    .count(Fate::LeftOut, Part::Channel, "without a name", place)
            }
            (name, Value::Numbers(values)) => {
                budget.take(values.len())?;
                columns.push(Series {
                    name,
                    values,
                    ..Series::default()
                });
            }
            // A few signals beside each other: NAME.1, NAME.2 and so on.
            (name, Value::Matrix(values, rows))
                if rows > 0 && rows.min(values.len() / rows) <= MOST_SIGNALS =>
            {
                budget.take(values.len())?;
                let in_rows = rows <= values.len() / rows;
                let signals = if in_rows { rows } else { values.len() / rows };
                columns.extend((0..signals).map(|i| Series {
                    name: format!("{name}.{}", i + 1),
                    values: if in_rows {
                        values.iter().skip(i).step_by(rows).copied().collect()
                    } else {
                        values[i * rows..(i + 1) * rows].to_vec()
                    },
                    ..Series::default()
                }));
            }
            (name, Value::Fields(fields)) if name == "units" => units = fields,
            (name, Value::Fields(fields)) if name == "sources" => sources = fields,
            (name, value) => {
                let why = match value {
                    Value::Text(_) => "text",
                    Value::Fields(_) => "struct",
                    Value::Matrix(..) => "array of more than 16 rows and columns",
                    Value::Numbers(_) | Value::Other => "array, cell, object or complex numbers",
                };
                found.notes.channel(Fate::LeftOut, name, why);
            }
        }
    }
    for column in &mut columns {
        column.unit = said(&units, &column.name);
        column.source = said(&sources, &column.name);
    }
    found.keep(columns, time);
    Ok(found)
}

/// What a struct of texts says of a channel.
fn said(fields: &[(String, Value)], name: &str) -> String {
    match fields.iter().find(|(field, _)| field == name) {
        Some((_, Value::Text(text))) => text.clone(),
        _ => String::new(),
    }
}

impl Table {
    /// Keeps the vectors that are as long as the time, or where there is none as the longest.
    fn keep(&mut self, columns: Vec<Series>, time: Option<&Term>) {
        let wanted = time.map_or("time_s", |time| time.channel.as_str());
        let time = columns
            .iter()
            .find(|c| c.name == wanted || c.name == units::bare(wanted));
        let longest = || columns.iter().map(|c| c.values.len()).max().unwrap_or(0);
        let rows = time.map_or_else(longest, |c| c.values.len());
        for column in columns {
            let why = match column.values.len() {
                own if own == rows => {
                    self.columns.push(column);
                    continue;
                }
                0 | 1 => "a single value, or none".to_owned(),
                _ => format!("other length than the {rows} values of the time"),
            };
            self.notes.channel(Fate::LeftOut, column.name, &why);
        }
    }
}

fn put(out: &mut Vec<u8>, kind: u32, contents: &[u8]) -> Result<(), RecordingError> {
    let size = u32::try_from(contents.len())
        .map_err(|_| RecordingError("a MAT file of level 5 holds at most 4 GB a variable".into()))?;
    out.extend_from_slice(&kind.to_le_bytes());
    out.extend_from_slice(&size.to_le_bytes());
    out.extend_from_slice(contents);
    out.resize(out.len().next_multiple_of(8), 0);
    Ok(())
}

/// A matrix: class, rows and columns, name, and what follows them.
fn put_matrix(
    out: &mut Vec<u8>,
    class: u32,
    size: [i32; 2],
    name: &str,
    parts: &[(u32, &[u8])],
) -> Result<(), RecordingError> {
    let mut inside = Vec::new();
    put(&mut inside, 6, &[class.to_le_bytes(), [0; 4]].concat())?;
    put(&mut inside, 5, &size.map(i32::to_le_bytes).concat())?;
    put(&mut inside, 1, name.as_bytes())?;
    for (kind, contents) in parts {
        if *kind == MATRIX {
            inside.extend_from_slice(contents);
        } else {
            put(&mut inside, *kind, contents)?;
        }
    }
    put(out, MATRIX, &inside)
}

/// A name that MATLAB takes.
fn valid(name: &str) -> Result<String, RecordingError> {
    let mut valid: String = name
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() { c } else { '_' })
        .collect();
    if !valid.starts_with(|c: char| c.is_ascii_alphabetic()) {
        valid.insert(0, 'c');
    }
    if valid.len() >= NAME {
        let most = NAME - 1;
        return Err(format!("channel {name}: a name in a MAT file has at most {most} characters").into());
    }
    Ok(valid)
}

pub(super) fn write(group: &Group, to: &mut impl Write) -> Result<(), RecordingError> {
    let mut heading = b"MATLAB 5.0 MAT-file, written by haptic-guidance".to_vec();
    heading.resize(124, b' ');
    heading.extend_from_slice(&[0, 1, b'I', b'M']);
    let mut out = heading;
    let names = group.channels.iter().map(|channel| valid(&channel.name));
    let names = names.collect::<Result<Vec<_>, _>>()?;
    let time = ("time_s", "s", "clock", &group.time_s);
    let own = names.iter().zip(&group.channels);
    let all: Vec<_> = std::iter::once(time)
        .chain(own.map(|(name, c)| (name.as_str(), c.unit.as_str(), c.source.as_str(), &c.values)))
        .collect();
    let rows = i32::try_from(group.time_s.len())
        .map_err(|_| RecordingError("a MAT file of level 5 holds at most 2^31 rows".into()))?;
    for (name, _, _, values) in &all {
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        put_matrix(&mut out, DOUBLE, [rows, 1], name, &[(9, &bytes)])?;
        to.write_all(&out).map_err(refuse)?;
        out.clear();
    }
    let texts: [(&str, Vec<&str>); 2] = [
        ("units", all.iter().map(|(_, unit, ..)| *unit).collect()),
        ("sources", all.iter().map(|(_, _, source, _)| *source).collect()),
    ];
    for (what, texts) in texts {
        let mut names = Vec::new();
        let mut fields = Vec::new();
        for ((name, ..), text) in all.iter().zip(texts) {
            let mut name = name.as_bytes().to_vec();
            name.resize(NAME, 0);
            names.extend(name);
            let units: Vec<u16> = text.encode_utf16().collect();
            let bytes: Vec<u8> = units.iter().flat_map(|c| c.to_le_bytes()).collect();
            let rows = i32::from(!units.is_empty());
            put_matrix(&mut fields, CHAR, [rows, units.len() as i32], "", &[(4, &bytes)])?;
        }
        let length = (NAME as i32).to_le_bytes();
        let parts: [(u32, &[u8]); 3] = [(5, &length), (1, &names), (MATRIX, &fields)];
        put_matrix(&mut out, STRUCT, [1, 1], what, &parts)?;
    }
    to.write_all(&out).map_err(refuse)
}
