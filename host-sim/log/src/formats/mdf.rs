//! ASAM MDF 4. The crate mdf4-rs writes (`mdf_write`). It does not read: it takes a file's own word for where its blocks end, and
//! panics on a damaged one; it reads no compressed records, and none that straddle blocks.
//!
//! Read are sorted and unsorted files, plain or with deflated blocks, numbers with every conversion but formulas, and the
//! fields of structures; invalid values are NaN. Left out by name are texts, bytes, arrays and groups without a time.

use std::collections::{HashMap, HashSet};

use super::bytes::{Budget, Bytes, half};
use super::{Reading, mdf_bus, numbered};
use crate::notes::{Fate, Notes, Part};
use crate::recording::{Group, Recording, RecordingError, Series};
use crate::units;

const HEAD: u64 = 24;
/// What a comment begins with that says where a channel comes from.
pub(super) const SOURCE: &str = "source: ";

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

#[derive(Clone)]
enum Conversion {
    None,
    Linear([f64; 2]),
    Rational([f64; 6]),
    Table {
        points: Vec<[f64; 2]>,
        between: bool,
    },
    /// Ranges, each with a conversion of its own, and what all other numbers are converted by.
    Ranges {
        rows: Vec<([f64; 2], Conversion)>,
        other: Box<Conversion>,
    },
    /// To this number; to a text, which is none, as NaN.
    To(f64),
}

/// Deepest conversions in conversions.
const DEEPEST_CONVERSION: u32 = 4;

/// The conversion at a link, or why there is none to numbers.
fn conversion(
    bytes: Bytes<'_>,
    at: u64,
    depth: u32,
) -> Result<Result<Conversion, &'static str>, RecordingError> {
    if at == 0 {
        return Ok(Ok(Conversion::None));
    }
    let block = Block::at(bytes, at)?;
    if [&b"##TX"[..], b"##MD"].contains(&block.kind()) {
        return Ok(Ok(Conversion::To(f64::NAN)));
    }
    if depth > DEEPEST_CONVERSION {
        return Err(format!("byte {at}: the conversions are nested too deep").into());
    }
    let block = block.expect("##CC")?;
    let data = block.data();
    let [refs, count] = [bytes.u16(data + 4)?, bytes.u16(data + 6)?].map(u64::from);
    let values = (0..count)
        .map(|i| bytes.f64(data + 24 + 8 * i))
        .collect::<Result<Vec<_>, _>>()?;
    Ok(Ok(match (bytes.u8(data)?, &values[..]) {
        (0, _) => Conversion::None,
        (1, [offset, factor]) => Conversion::Linear([*offset, *factor]),
        (2, &[a, b, c, d, e, f]) => Conversion::Rational([a, b, c, d, e, f]),
        (3, _) => return Ok(Err("formula")),
        (kind @ (4 | 5), _) if !values.is_empty() => Conversion::Table {
            points: values.as_chunks::<2>().0.to_vec(),
            between: kind == 4,
        },
        (6, _) if count % 3 == 1 => Conversion::Ranges {
            rows: values
                .as_chunks::<3>()
                .0
                .iter()
                .map(|&[low, high, to]| ([low, high], Conversion::To(to)))
                .collect(),
            other: Box::new(Conversion::To(values[values.len() - 1])),
        },
        (kind @ (7 | 8), _) => {
            let ranges: Vec<[f64; 2]> = match kind {
                7 => values.iter().map(|x| [*x, *x]).collect(),
                _ => values.as_chunks::<2>().0.to_vec(),
            };
            let mut conversions = Vec::new();
            for i in 0..refs.max(ranges.len() as u64 + 1) {
                match conversion(bytes, block.link(4 + i), depth + 1)? {
                    Ok(conversion) => conversions.push(conversion),
                    Err(why) => return Ok(Err(why)),
                }
            }
            let is_text = |to: &Conversion| matches!(to, Conversion::To(x) if x.is_nan());
            let has_default = block.link(4 + ranges.len() as u64) != 0;
            let other = conversions.swap_remove(ranges.len());
            // Codes with names stay codes, where nothing but names is said of them.
            if conversions.iter().all(is_text) && (!has_default || is_text(&other)) {
                return Ok(Ok(Conversion::None));
            }
            let rows = ranges.into_iter().zip(conversions).collect();
            let other = Box::new(other);
            Conversion::Ranges { rows, other }
        }
        (9..=11, _) => return Ok(Err("text")),
        _ => return Ok(Err("a conversion that is not known")),
    }))
}

impl Conversion {
    fn apply(&self, x: f64) -> f64 {
        match self {
            Self::None => x,
            Self::To(value) => *value,
            Self::Linear([offset, factor]) => offset + factor * x,
            Self::Rational([a, b, c, d, e, f]) => (a * x * x + b * x + c) / (d * x * x + e * x + f),
            Self::Ranges { rows, other } => {
                let is_in = |[low, high]: [f64; 2]| {
                    low == x || (low <= x && (x < high || (x == high && x.fract() == 0.0)))
                };
                let found = rows.iter().find(|(range, _)| is_in(*range));
                found.map_or(&**other, |(_, conversion)| conversion).apply(x)
            }
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

/// A channel of a group, or why it is none.
fn place(
    block: &Block<'_>,
    name: String,
    data_bytes: u64,
) -> Result<Result<Place, &'static str>, RecordingError> {
    let (b, data) = (block.bytes, block.data());
    let (kind, flags) = (b.u8(data + 2)?, b.u32(data + 12)?);
    let bits = b.u32(data + 8)?;
    let channel_type = b.u8(data)?;
    let mut unit = text(b, block.link(6))?;
    if unit.is_empty() && block.link(4) != 0 {
        unit = text(b, Block::at(b, block.link(4))?.link(1))?;
    }
    let comment = text(b, block.link(7))?;
    let is_virtual = [3, 6].contains(&channel_type);
    let why = match (channel_type, kind, bits) {
        _ if flags & 1 == 1 => Some("every value is invalid"),
        (3 | 6, ..) | (0 | 2, 0..=3, 1..=64) | (0 | 2, 4 | 5, 16 | 32 | 64) => None,
        (1, 10..=12, _) => Some("bytes of varying length"),
        (1, ..) | (_, 6..=9, _) => Some("text"),
        (_, 10..=12, _) => Some("bytes"),
        (_, 13 | 14, _) => Some("date"),
        (_, 15 | 16, _) => Some("complex numbers"),
        (4, ..) => Some("places in another file"),
        _ => Some("a kind of number that is not known"),
    };
    if let Some(why) = why {
        return Ok(Err(why));
    }
    let conversion = match conversion(b, block.link(4), 0)? {
        Ok(conversion) => conversion,
        Err(why) => return Ok(Err(why)),
    };
    Ok(Ok(Place {
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

/// Each byte of a field of bytes as a number; none if they do not stand in the record.
fn bytes_of(block: &Block<'_>) -> Result<Option<Vec<Place>>, RecordingError> {
    let (b, data) = (block.bytes, block.data());
    let (channel_type, kind, bits) = (b.u8(data)?, b.u8(data + 2)?, b.u32(data + 8)?);
    if channel_type != 0 || kind != 10 || bits > 8 * 64 {
        return Ok(None);
    }
    let from = 8 * u64::from(b.u32(data + 4)?);
    let byte = |i: u64| Place {
        series: Series {
            name: format!("{}.{i}", mdf_bus::BYTES),
            ..Series::default()
        },
        time: false,
        is_virtual: false,
        kind: 0,
        bit: from + 8 * i,
        bits: 8,
        invalid_bit: None,
        conversion: Conversion::None,
    };
    Ok(Some((0..u64::from(bits / 8)).map(byte).collect()))
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
            (_, 16) => half(bits as u16),
            (_, 32) => f64::from(f32::from_bits(bits as u32)),
            _ => f64::from_bits(bits),
        };
        self.conversion.apply(number)
    }

    /// The values of whole records, the usual kinds of number by a loop of their own.
    fn append(&mut self, records: &[u8], size: usize) {
        fn each<const N: usize>(
            records: &[u8],
            (size, from): (usize, usize),
            out: &mut Vec<f64>,
            number: impl Fn([u8; N]) -> f64,
        ) {
            out.extend(records.chunks_exact(size).map(|record| {
                let bytes = record.get(from..).and_then(|bytes| bytes.first_chunk::<N>());
                bytes.map_or(f64::NAN, |bytes| number(*bytes))
            }));
        }
        let is_plain = !self.is_virtual && self.bit.is_multiple_of(8) && self.invalid_bit.is_none();
        let (place, to, out) = (
            (size, (self.bit / 8) as usize),
            &self.conversion,
            &mut self.series.values,
        );
        out.reserve(records.len() / size);
        match (self.kind, self.bits) {
            (0, 8) if is_plain => each::<1>(records, place, out, |x| to.apply(x[0].into())),
            (0, 16) if is_plain => each(records, place, out, |x| to.apply(u16::from_le_bytes(x).into())),
            (0, 32) if is_plain => each(records, place, out, |x| to.apply(u32::from_le_bytes(x).into())),
            (2, 16) if is_plain => each(records, place, out, |x| to.apply(i16::from_le_bytes(x).into())),
            (2, 32) if is_plain => each(records, place, out, |x| to.apply(i32::from_le_bytes(x).into())),
            (4, 32) if is_plain => each(records, place, out, |x| to.apply(f32::from_le_bytes(x).into())),
            (4, 64) if is_plain => each(records, place, out, |x| to.apply(f64::from_le_bytes(x))),
            _ => {
                for (row, record) in records.chunks_exact(size).enumerate() {
                    let value = self.value(record, row);
                    self.series.values.push(value);
                }
            }
        }
    }
}

/// A channel group under way.
struct Open {
    name: String,
    size: u64,
    varying: bool,
    /// How many rows there are, as it says.
    count: u64,
    rows: u64,
    places: Vec<Place>,
}

/// What is met on the way through a file.
struct Found<'a> {
    reading: Reading<'a>,
    unread: Vec<String>,
    notes: Notes,
}

impl Found<'_> {
    fn is_time(&self, name: &str) -> bool {
        let named = self.reading.time.map(|term| term.channel.as_str());
        named.is_some_and(|wanted| name == wanted || name == units::bare(wanted))
    }

    /// The channels of a chain, those inside structures too.
    fn places(
        &mut self,
        bytes: Bytes<'_>,
        at: u64,
        data_bytes: u64,
        depth: u32,
        out: &mut Vec<Place>,
    ) -> Result<(), RecordingError> {
        if depth > DEEPEST {
            return Err(format!("byte {at}: structures are nested too deep").into());
        }
        for channel in chain(bytes, at, "##CN")? {
            let name = text(bytes, channel.link(2))?;
            let parts = match channel.link(1) {
                0 => None,
                inside => Some(Block::at(bytes, inside)?),
            };
            match parts {
                Some(parts) if parts.kind() == b"##CN" => {
                    self.places(bytes, parts.at, data_bytes, depth + 1, out)?;
                    continue;
                }
                Some(_) => {
                    self.notes.channel(Fate::LeftOut, name, "array");
                    continue;
                }
                None => {}
            }
            if name == mdf_bus::BYTES
                && let Some(bytes) = bytes_of(&channel)?
            {
                out.extend(bytes);
                continue;
            }
            let made = place(&channel, name.clone(), data_bytes)?;
            let is_time = made.as_ref().is_ok_and(|made| made.time) || self.is_time(&name);
            let is_of_bus = name.starts_with(mdf_bus::FRAME);
            if !is_time && !is_of_bus && self.reading.only.is_some_and(|is_wanted| !is_wanted(&name)) {
                self.unread.push(name);
                continue;
            }
            match made {
                Ok(place) => out.push(place),
                Err(why) => self.notes.channel(Fate::LeftOut, name, why),
            }
        }
        Ok(())
    }
}

pub(super) fn read(file: &[u8], reading: Reading<'_>) -> Result<Recording, RecordingError> {
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
    let mut found = Found {
        reading,
        unread: Vec::new(),
        notes: Notes::default(),
    };
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
            found.places(bytes, group.link(1), data_bytes, 0, &mut places)?;
            let made = Open {
                name: text(bytes, group.link(2))?,
                size: data_bytes + u64::from(bytes.u32(data + 28)?),
                varying: bytes.u16(data + 16)? & 1 == 1,
                count: bytes.u64(data + 8)?,
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
        for (_, open) in made {
            groups.extend(found.finished(open)?);
        }
    }
    if groups.is_empty() {
        let aside = found.notes.aside();
        return Err(format!("there is no group of channels with a time{aside}").into());
    }
    tell_apart(&mut groups);
    Ok(Recording {
        groups,
        unread: found.unread,
        notes: found.notes,
    })
}

/// Gives groups a name of their own that share name and channels with another: the name with the group's number.
fn tell_apart(groups: &mut [Group]) {
    let (mut first, mut shared) = (HashMap::new(), HashSet::new());
    for (i, group) in groups.iter().enumerate() {
        for channel in &group.channels {
            let other = *first.entry((&group.name, &channel.name)).or_insert(i);
            if other != i {
                shared.extend([other, i]);
            }
        }
    }
    let mut taken: HashSet<String> = groups.iter().map(|group| group.name.clone()).collect();
    for (i, group) in groups.iter_mut().enumerate() {
        if shared.contains(&i) {
            let stem = match group.name.as_str() {
                "" => "group",
                name => name,
            };
            group.name = numbered(stem, i + 1, &mut taken);
        }
    }
}

/// Every record to its group.
fn sort(
    data: Bytes<'_>,
    id_size: u64,
    open: &mut HashMap<u64, Open>,
    budget: &mut Budget,
) -> Result<(), RecordingError> {
    let only = open.keys().next().copied().unwrap_or_default();
    let no_bytes = |group: &Open| {
        let name = &group.name;
        Err(RecordingError(format!(
            "group {name:?}: its records have no bytes"
        )))
    };
    if id_size == 0
        && let Some(group) = open.get_mut(&only)
        && !group.varying
    {
        if data.0.is_empty() {
            return Ok(());
        }
        if group.size == 0 {
            return no_bytes(group);
        }
        group.rows = data.0.len() as u64 / group.size;
        let kept = group.rows.min(group.count);
        budget.take((kept as usize).saturating_mul(group.places.len()))?;
        let records = data.slice(0, kept * group.size)?;
        for place in &mut group.places {
            place.append(records, group.size as usize);
        }
        return Ok(());
    }
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
            return no_bytes(group);
        }
        let record = data.slice(at, group.size)?;
        if group.rows < group.count {
            budget.take(group.places.len())?;
            for place in &mut group.places {
                let value = place.value(record, group.rows as usize);
                place.series.values.push(value);
            }
        }
        group.rows += 1;
        at += group.size;
    }
    Ok(())
}

impl Found<'_> {
    /// A group with its time; none if it has none.
    fn finished(&mut self, open: Open) -> Result<Option<Group>, RecordingError> {
        let Open {
            name,
            count,
            rows,
            mut places,
            varying,
            ..
        } = open;
        let place = match name.as_str() {
            "" => "a group without a name".to_owned(),
            _ => format!("group {name:?}"),
        };
        if rows > count {
            let why = format!("behind the {count} rows that its group has");
            self.notes
                .count_many(Fate::LeftOut, Part::Row, &why, rows - count, &place);
        } else if rows < count && !varying && !places.is_empty() {
            let why = format!("its group says {count}");
            self.notes
                .count_many(Fate::Cut, Part::Row, &why, count - rows, &place);
        }
        let named = places.iter().position(|place| self.is_time(&place.series.name));
        let Some(time) = named.or_else(|| places.iter().position(|place| place.time)) else {
            for place in places {
                self.notes
                    .channel(Fate::LeftOut, place.series.name, "no time in its group");
            }
            return Ok(None);
        };
        let time = places.remove(time).series;
        let factor = match (self.reading.time, named) {
            (Some(term), Some(_)) => term.factor(&time, "s")?,
            _ if time.unit.is_empty() => 1.0,
            _ => units::factor(&time.unit, "s").ok_or_else(|| {
                let (name, unit) = (&time.name, &time.unit);
                RecordingError(format!(
                    "{place}: the unit of its time {name}, {unit:?}, is no unit of time"
                ))
            })?,
        };
        for place in places.extract_if(.., |place| place.time) {
            let why = "another channel was named as the time";
            self.notes.channel(Fate::LeftOut, place.series.name, why);
        }
        for place in &places {
            if let Conversion::Ranges { .. } = place.conversion {
                let texts = place.series.values.iter().filter(|value| value.is_nan()).count();
                let why = "text in place of a number";
                let channel = format!("channel {}", place.series.name);
                self.notes
                    .count_many(Fate::LeftOut, Part::Value, why, texts as u64, channel);
            }
        }
        Ok(Some(Group {
            name,
            time_s: time.values.iter().map(|t| t * factor).collect(),
            channels: places.into_iter().map(|place| place.series).collect(),
            ..Group::default()
        }))
    }
}
