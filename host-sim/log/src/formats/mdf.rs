//! ASAM MDF 4. The crate mdf4-rs writes. It does not read: it takes a file's own word for where its blocks end, and panics on
//! a damaged one; it reads no compressed records, and none that straddle blocks.
//!
//! Read are sorted and unsorted files, plain or with deflated blocks, numbers with linear, rational and tabular conversions,
//! invalid values as NaN. Passed over are channels of text, bytes or arrays, and groups without a time.

use std::collections::{HashMap, HashSet};

use mdf4_rs::{DataType, DecodedValue, MdfWriter};

use super::bytes::{Budget, Bytes};
use crate::recording::{Group, Recording, RecordingError, Series};

const HEAD: u64 = 24;
const SOURCE: &str = "source: ";

/// A block: its kind, its links, and where its data begin and end.
struct Block<'a> {
    bytes: Bytes<'a>,
    at: u64,
    links: u64,
    end: u64,
}

impl<'a> Block<'a> {
    fn at(bytes: Bytes<'a>, at: u64) -> Result<Self, RecordingError> {
        bytes.slice(at, HEAD)?;
        let (length, links) = (bytes.u64(at + 8)?, bytes.u64(at + 16)?);
        let end = at.checked_add(length).filter(|end| *end <= bytes.0.len() as u64);
        let fits = |end: &u64| links.checked_mul(8).is_some_and(|l| at + HEAD + l <= *end);
        let end = end.filter(fits);
        let end =
            end.ok_or_else(|| format!("byte {at}: a block of {length} bytes does not fit into the file"))?;
        Ok(Self {
            bytes,
            at,
            links,
            end,
        })
    }

    fn kind(&self) -> &'a [u8] {
        self.bytes.slice(self.at, 4).unwrap_or_default()
    }

    fn expect(self, kind: &str) -> Result<Self, RecordingError> {
        if self.kind() == kind.as_bytes() {
            return Ok(self);
        }
        Err(format!("byte {}: there is no block {kind}", self.at).into())
    }

    /// Where a link leads; 0 is nowhere.
    fn link(&self, i: u64) -> u64 {
        match i < self.links {
            true => self.bytes.u64(self.at + HEAD + 8 * i).unwrap_or(0),
            false => 0,
        }
    }

    /// Where the data begin.
    fn data(&self) -> u64 {
        self.at + HEAD + 8 * self.links
    }

    fn contents(&self) -> Result<&'a [u8], RecordingError> {
        self.bytes.slice(self.data(), self.end - self.data())
    }
}

/// The blocks of a chain, each linked by the first link of the one before.
fn chain<'a>(bytes: Bytes<'a>, mut at: u64, kind: &str) -> Result<Vec<Block<'a>>, RecordingError> {
    let (mut seen, mut blocks) = (HashSet::new(), Vec::new());
    while at != 0 {
        if !seen.insert(at) {
            return Err(format!("byte {at}: the blocks {kind} form a circle").into());
        }
        let block = Block::at(bytes, at)?.expect(kind)?;
        at = block.link(0);
        blocks.push(block);
    }
    Ok(blocks)
}

/// A text block, or what stands in `<TX>` of an XML one.
fn text(bytes: Bytes<'_>, at: u64) -> Result<String, RecordingError> {
    if at == 0 {
        return Ok(String::new());
    }
    let block = Block::at(bytes, at)?;
    let text = String::from_utf8_lossy(block.contents()?);
    let text = text.trim_end_matches('\0').to_owned();
    if block.kind() != b"##MD" {
        return Ok(text);
    }
    let inside = text.split_once("<TX");
    let inside = inside.and_then(|(_, rest)| rest.split_once('>')?.1.split_once("</TX>"));
    Ok(inside.map_or(String::new(), |(inside, _)| inside.trim().to_owned()))
}

/// The data blocks of a file, of which none is used twice.
struct Data<'a> {
    bytes: Bytes<'a>,
    seen: HashSet<u64>,
    budget: Budget,
}

/// A list of lists of blocks is as deep as data are.
const DEEPEST: u32 = 4;

impl Data<'_> {
    /// Appends the records of a data group: its blocks, put together.
    fn records(&mut self, at: u64, depth: u32, out: &mut Vec<u8>) -> Result<(), RecordingError> {
        if at == 0 {
            return Ok(());
        }
        let refuse = |what: &str| Err(RecordingError(format!("byte {at}: {what}")));
        if depth > DEEPEST {
            return refuse("the data blocks are nested too deep");
        }
        if !self.seen.insert(at) {
            return refuse("the data block is used twice");
        }
        let block = Block::at(self.bytes, at)?;
        match block.kind() {
            b"##DT" | b"##DV" => out.extend_from_slice(block.contents()?),
            b"##DZ" => out.extend(unzipped(&block, &mut self.budget)?),
            b"##HL" => self.records(block.link(0), depth + 1, out)?,
            b"##DL" => {
                let mut list = Some(block);
                while let Some(block) = list {
                    for i in 1..block.links {
                        self.records(block.link(i), depth + 1, out)?;
                    }
                    let next = block.link(0);
                    if next != 0 && !self.seen.insert(next) {
                        return refuse("the data lists form a circle");
                    }
                    list = (next != 0)
                        .then(|| Block::at(self.bytes, next)?.expect("##DL"))
                        .transpose()?;
                }
            }
            other => {
                let kind = String::from_utf8_lossy(other);
                return refuse(&format!("data in a block {kind} are not read"));
            }
        }
        Ok(())
    }
}

fn unzipped(block: &Block<'_>, budget: &mut Budget) -> Result<Vec<u8>, RecordingError> {
    let (b, data) = (block.bytes, block.data());
    let (method, columns) = (b.u8(data + 2)?, b.u32(data + 4)? as usize);
    let bytes = budget.inflated(b.slice(data + 24, b.u64(data + 16)?)?)?;
    match method {
        0 => Ok(bytes),
        // Bytes of one place in all records stand together.
        1 if columns > 0 => {
            let rows = bytes.len() / columns;
            let mut records = bytes.clone();
            for row in 0..rows {
                for column in 0..columns {
                    records[row * columns + column] = bytes[column * rows + row];
                }
            }
            Ok(records)
        }
        other => Err(format!("byte {}: compression {other} is not known", block.at).into()),
    }
}

/// How a channel is found in a record, and what its number means.
struct Place {
    series: Series,
    time: bool,
    is_virtual: bool,
    kind: u8,
    bit: u64,
    bits: u32,
    invalid_bit: Option<u64>,
    conversion: Conversion,
}

enum Conversion {
    None,
    Linear([f64; 2]),
    Rational([f64; 6]),
    Table { points: Vec<[f64; 2]>, between: bool },
}

/// The conversion at a link; none if it is not one of numbers to numbers.
fn conversion(bytes: Bytes<'_>, at: u64) -> Result<Option<Conversion>, RecordingError> {
    if at == 0 {
        return Ok(Some(Conversion::None));
    }
    let block = Block::at(bytes, at)?.expect("##CC")?;
    let data = block.data();
    let count = u64::from(bytes.u16(data + 6)?);
    let values = (0..count)
        .map(|i| bytes.f64(data + 24 + 8 * i))
        .collect::<Result<Vec<_>, _>>()?;
    Ok(match (bytes.u8(data)?, &values[..]) {
        // Codes with names stay codes.
        (0 | 7 | 8, _) => Some(Conversion::None),
        (1, [offset, factor]) => Some(Conversion::Linear([*offset, *factor])),
        (2, &[a, b, c, d, e, f]) => Some(Conversion::Rational([a, b, c, d, e, f])),
        (kind @ (4 | 5), _) if !values.is_empty() => Some(Conversion::Table {
            points: values.as_chunks::<2>().0.to_vec(),
            between: kind == 4,
        }),
        _ => None,
    })
}

impl Conversion {
    fn apply(&self, x: f64) -> f64 {
        match self {
            Self::None => x,
            Self::Linear([offset, factor]) => offset + factor * x,
            Self::Rational([a, b, c, d, e, f]) => (a * x * x + b * x + c) / (d * x * x + e * x + f),
            Self::Table { points, between } => {
                let next = points.partition_point(|p| p[0] <= x);
                let Some(low) = next.checked_sub(1).map(|i| points[i]) else {
                    return points.first().map_or(f64::NAN, |p| p[1]);
                };
                let Some(high) = points.get(next) else {
                    return low[1];
                };
                let share = (x - low[0]) / (high[0] - low[0]);
                if *between {
                    low[1] + share * (high[1] - low[1])
                } else if share <= 0.5 {
                    low[1]
                } else {
                    high[1]
                }
            }
        }
    }
}

fn place(block: &Block<'_>, data_bytes: u64) -> Result<Option<Place>, RecordingError> {
    let (b, data) = (block.bytes, block.data());
    let (kind, flags) = (b.u8(data + 2)?, b.u32(data + 12)?);
    let bits = b.u32(data + 8)?;
    let channel_type = b.u8(data)?;
    let name = text(b, block.link(2))?;
    let mut unit = text(b, block.link(6))?;
    if unit.is_empty() && block.link(4) != 0 {
        unit = text(b, Block::at(b, block.link(4))?.link(1))?;
    }
    let comment = text(b, block.link(7))?;
    let Some(conversion) = conversion(b, block.link(4))? else {
        return Ok(None);
    };
    let number = match kind {
        0..=3 => (1..=64).contains(&bits),
        4 | 5 => [32, 64].contains(&bits),
        _ => false,
    };
    let is_virtual = [3, 6].contains(&channel_type);
    if !(number && [0, 2].contains(&channel_type) || is_virtual) {
        return Ok(None);
    }
    Ok(Some(Place {
        series: Series {
            name,
            unit,
            source: comment.strip_prefix(SOURCE).unwrap_or_default().into(),
            values: Vec::new(),
        },
        time: [2, 3].contains(&channel_type) && b.u8(data + 1)? == 1,
        is_virtual,
        kind,
        bit: 8 * u64::from(b.u32(data + 4)?) + u64::from(b.u8(data + 3)?),
        bits,
        invalid_bit: match flags & 2 {
            0 => None,
            _ => Some(8 * data_bytes + u64::from(b.u32(data + 16)?)),
        },
        conversion,
    }))
}

impl Place {
    fn value(&self, record: &[u8], row: usize) -> f64 {
        if self.is_virtual {
            return self.conversion.apply(row as f64);
        }
        let byte_of = |bit: u64| record.get((bit / 8) as usize);
        let invalid = |bit: u64| byte_of(bit).is_none_or(|byte| byte >> (bit % 8) & 1 == 1);
        let from = (self.bit / 8) as usize;
        let size = (self.bit % 8 + u64::from(self.bits)).div_ceil(8) as usize;
        let Some(bytes) = record.get(from..from.saturating_add(size)) else {
            return f64::NAN;
        };
        if size > 16 || self.invalid_bit.is_some_and(invalid) {
            return f64::NAN;
        }
        let mut wide = [0; 16];
        wide[..size].copy_from_slice(bytes);
        if self.kind % 2 == 1 {
            wide[..size].reverse();
        }
        let bits = (u128::from_le_bytes(wide) >> (self.bit % 8)) as u64;
        let top = bits << (64 - self.bits);
        let number = match (self.kind / 2, self.bits) {
            (0, _) => (top >> (64 - self.bits)) as f64,
            (1, _) => ((top as i64) >> (64 - self.bits)) as f64,
            (_, 32) => f64::from(f32::from_bits(bits as u32)),
            _ => f64::from_bits(bits),
        };
        self.conversion.apply(number)
    }
}

/// A channel group under way.
struct Open {
    name: String,
    size: u64,
    varying: bool,
    rows: usize,
    places: Vec<Place>,
}

pub(super) fn read(file: &[u8]) -> Result<Recording, RecordingError> {
    if !file.starts_with(b"MDF     ") {
        let what = match file.starts_with(b"UnFinMF") {
            true => "an unfinished MDF file: finalise it first",
            false => "no MDF file",
        };
        return Err(format!("this is {what}").into());
    }
    let bytes = Bytes(file);
    if bytes.u16(28)? < 400 {
        return Err("this is MDF 3, which is not read: convert it to MDF 4".into());
    }
    let header = Block::at(bytes, 64)?.expect("##HD")?;
    let mut groups = Vec::new();
    let mut blocks = Data {
        bytes,
        seen: HashSet::new(),
        budget: Budget::new(file),
    };
    for data_group in chain(bytes, header.link(0), "##DG")? {
        let id_size = u64::from(bytes.u8(data_group.data())?);
        let mut open = HashMap::new();
        for group in chain(bytes, data_group.link(1), "##CG")? {
            let data = group.data();
            let data_bytes = u64::from(bytes.u32(data + 24)?);
            let mut places = Vec::new();
            for channel in chain(bytes, group.link(1), "##CN")? {
                places.extend(place(&channel, data_bytes)?);
            }
            let made = Open {
                name: text(bytes, group.link(2))?,
                size: data_bytes + u64::from(bytes.u32(data + 28)?),
                varying: bytes.u16(data + 16)? & 1 == 1,
                rows: 0,
                places,
            };
            open.insert(bytes.u64(data)?, made);
        }
        let mut data = Vec::new();
        blocks.records(data_group.link(2), 0, &mut data)?;
        sort(Bytes(&data), id_size, &mut open, &mut blocks.budget)?;
        let mut made: Vec<(u64, Open)> = open.into_iter().collect();
        made.sort_by_key(|(id, _)| *id);
        groups.extend(made.into_iter().filter_map(|(_, open)| finished(open)));
    }
    if groups.is_empty() {
        return Err("there is no group of channels with a time".into());
    }
    Ok(groups.into())
}

/// Every record to its group.
fn sort(
    data: Bytes<'_>,
    id_size: u64,
    open: &mut HashMap<u64, Open>,
    budget: &mut Budget,
) -> Result<(), RecordingError> {
    let only = open.keys().next().copied().unwrap_or_default();
    let mut at = 0;
    while at + id_size < data.0.len() as u64 {
        let id = match id_size {
            0 => only,
            1 => data.u8(at)?.into(),
            2 => data.u16(at)?.into(),
            4 => data.u32(at)?.into(),
            8 => data.u64(at)?,
            other => return Err(format!("record numbers of {other} bytes are not known").into()),
        };
        let Some(group) = open.get_mut(&id) else {
            return Err(format!("byte {at} of the records: there is no group {id}").into());
        };
        at += id_size;
        if group.varying {
            at += 4 + u64::from(data.u32(at)?);
            continue;
        }
        if group.size == 0 {
            return Err(format!("group {:?}: its records have no bytes", group.name).into());
        }
        let record = data.slice(at, group.size)?;
        budget.take(group.places.len())?;
        for place in &mut group.places {
            let value = place.value(record, group.rows);
            place.series.values.push(value);
        }
        group.rows += 1;
        at += group.size;
    }
    Ok(())
}

fn finished(open: Open) -> Option<Group> {
    let (mut time, channels): (Vec<Place>, Vec<Place>) =
        open.places.into_iter().partition(|place| place.time);
    let time = time.pop()?.series;
    let factor = crate::units::factor(&time.unit, "s").unwrap_or(1.0);
    Some(Group {
        name: open.name,
        time_s: time.values.iter().map(|t| t * factor).collect(),
        channels: channels.into_iter().map(|place| place.series).collect(),
        ..Group::default()
    })
}

pub(super) fn write(recording: &Recording) -> Result<Vec<u8>, RecordingError> {
    let made = || -> mdf4_rs::Result<Vec<u8>> {
        let mut file = MdfWriter::in_memory();
        file.init_mdf_file()?;
        for group in &recording.groups {
            let id = file.add_channel_group(None, |_| {})?;
            file.set_channel_group_name(&id, &group.name)?;
            let time = Series {
                name: "time_s".into(),
                unit: "s".into(),
                source: "clock".into(),
                values: Vec::new(),
            };
            let mut before: Option<String> = None;
            for (i, channel) in std::iter::once(&time).chain(&group.channels).enumerate() {
                let made = file.add_channel(&id, before.as_deref(), |block| {
                    block.name = Some(channel.name.clone());
                    block.data_type = DataType::FloatLE;
                    block.bit_count = 64;
                })?;
                if i == 0 {
                    file.set_time_channel(&made)?;
                }
                file.set_channel_unit(&made, &channel.unit)?;
                file.set_channel_comment(&made, &format!("{SOURCE}{}", channel.source))?;
                before = Some(made);
            }
            file.start_data_block_for_cg(&id, 0)?;
            for (k, time_s) in group.time_s.iter().enumerate() {
                let values = std::iter::once(*time_s).chain(group.channels.iter().map(|c| c.values[k]));
                let record: Vec<DecodedValue> = values.map(DecodedValue::Float).collect();
                file.write_record(&id, &record)?;
            }
            file.finish_data_block(&id)?;
        }
        file.finalize()?;
        Ok(file.into_inner().into_inner())
    };
    made().map_err(|e| RecordingError(format!("{e:?}")))
}
