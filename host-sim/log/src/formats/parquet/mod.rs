//! Parquet: a column of doubles for each channel; units, sources and sample rates as JSON in the file's metadata, by the key
//! `haptic.channels`. Written with Snappy, which every reader knows.

mod nesting;
mod pages;

use std::io::Write;
use std::sync::Arc;

use bytes::Bytes;
use parquet::basic::{Compression, ConvertedType, LogicalType, Repetition, TimeUnit, Type as Physical};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl, get_column_reader};
use parquet::data_type::{DataType, DoubleType, Int96};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::{ColumnDescPtr, ColumnDescriptor, Type};
use serde_json::{Value, json};

use self::pages::Pages;
use super::bytes::{Budget, half};
use super::{Only, Table};
use crate::guard::guarded;
use crate::notes::Fate;
use crate::recording::{Group, RecordingError, Series, refuse};

const KEY: &str = "haptic.channels";

pub(super) fn read(file: Vec<u8>, only: Only<'_>) -> Result<Table, RecordingError> {
    // The reader is safe code, but not written for files that lie.
    guarded(|| columns(file.into(), only)).unwrap_or_else(|| Err(refuse("the file is damaged")))
}

fn columns(file: Bytes, only: Only<'_>) -> Result<Table, RecordingError> {
    if !nesting::is_shallow(&file) {
        return Err("this is no Parquet file, or its schema is nested too deep".into());
    }
    let reader = SerializedFileReader::new(file.clone()).map_err(refuse)?;
    let metadata = reader.metadata();
    let said: Value = metadata
        .file_metadata()
        .key_value_metadata()
        .and_then(|all| all.iter().find(|pair| pair.key == KEY))
        .and_then(|pair| serde_json::from_str(pair.value.as_deref()?).ok())
        .unwrap_or_default();
    let schema = metadata.file_metadata().schema_descr();
    let mut budget = Budget::new(&file);
    let mut found = Table::default();
    for (c, column) in schema.columns().iter().enumerate() {
        // A field of a struct has the struct's name before its own.
        let name = column.path().parts().join(".");
        if only.is_some_and(|is_wanted| !is_wanted(&name)) {
            found.unread.push(name);
            continue;
        }
        let kind = match Kind::from_column(column) {
            Ok(kind) => kind,
            Err(why) => {
                found.notes.channel(Fate::LeftOut, name, why);
                continue;
            }
        };
        let rows = metadata.row_groups().iter().map(|group| group.num_rows());
        let rows = usize::try_from(rows.sum::<i64>()).unwrap_or(0);
        let mut values = Vec::with_capacity(budget.at_most(rows));
        for group in metadata.row_groups() {
            let rows = usize::try_from(group.num_rows()).unwrap_or(0);
            let read = Pages::new(&file, group.column(c), rows)
                .and_then(|pages| append(schema.column(c), pages, kind, &mut values, &mut budget));
            let read = read.map_err(|e| refuse(format!("channel {name}: {e}")))?;
            if read != rows {
                return Err(format!("channel {name}: {read} values in a group of {rows} rows").into());
            }
        }
        let is_it = |c: &&Value| c["name"] == name.as_str();
        let entry = said.as_array().and_then(|all| all.iter().find(is_it));
        let text = |key: &str| entry.and_then(|e| e[key].as_str()).unwrap_or_default().to_owned();
        if let Numbers::Decimal(_) = kind.numbers {
            found
                .notes
                .channel(Fate::Converted, name.clone(), "decimal to float");
        }
        found.columns.push(Series {
            // What is a date counts in parts of a second.
            unit: kind.unit.map_or_else(|| text("unit"), str::to_owned),
            source: text("source"),
            values,
            name,
        });
    }
    Ok(found)
}

/// Values that are read at once.
const BATCH: usize = 1 << 16;

/// How the numbers of a column are meant.
#[derive(Debug, Clone, Copy)]
struct Kind {
    numbers: Numbers,
    /// That of a date or a time of day.
    unit: Option<&'static str>,
}

#[derive(Debug, Clone, Copy)]
enum Numbers {
    Signed,
    Unsigned,
    /// Whole numbers of so many digits behind the point, the highest byte first where they are bytes.
    Decimal(i32),
    /// Two bytes each.
    Half,
    /// Nanoseconds of a day and the Julian day.
    Int96,
}

impl Kind {
    /// What a column holds, or why it is no channel.
    fn from_column(column: &ColumnDescriptor) -> Result<Self, &'static str> {
        use ConvertedType as Old;
        use Physical::{BOOLEAN, BYTE_ARRAY, DOUBLE, FIXED_LEN_BYTE_ARRAY, FLOAT, INT32, INT64, INT96};
        if column.max_rep_level() > 0 {
            return Err("array");
        }
        let is_bytes = matches!(column.physical_type(), BYTE_ARRAY | FIXED_LEN_BYTE_ARRAY);
        let plain = |numbers| Ok(Self { numbers, unit: None });
        let in_parts = |unit| {
            let (numbers, unit) = (Numbers::Signed, Some(unit));
            Ok(Self { numbers, unit })
        };
        let part = |unit: &TimeUnit| match unit {
            TimeUnit::MILLIS => "ms",
            TimeUnit::MICROS => "us",
            TimeUnit::NANOS => "ns",
        };
        match (column.logical_type_ref(), column.converted_type()) {
            (Some(LogicalType::Timestamp(stamp)), _) => in_parts(part(&stamp.unit)),
            (Some(LogicalType::Time(time)), _) => in_parts(part(&time.unit)),
            (None, Old::TIMESTAMP_MILLIS | Old::TIME_MILLIS) => in_parts("ms"),
            (None, Old::TIMESTAMP_MICROS | Old::TIME_MICROS) => in_parts("us"),
            (Some(LogicalType::Date), _) | (None, Old::DATE) => Err("date without a time of day"),
            (Some(LogicalType::Decimal(_)), _) | (None, Old::DECIMAL) => {
                plain(Numbers::Decimal(column.type_scale()))
            }
            (Some(LogicalType::Float16), _) if is_bytes => plain(Numbers::Half),
            (Some(LogicalType::Integer(integer)), _) if !integer.is_signed => plain(Numbers::Unsigned),
            (None, Old::UINT_8 | Old::UINT_16 | Old::UINT_32 | Old::UINT_64) => plain(Numbers::Unsigned),
            _ => match column.physical_type() {
                BOOLEAN | INT32 | INT64 | FLOAT | DOUBLE => plain(Numbers::Signed),
                INT96 => {
                    let (numbers, unit) = (Numbers::Int96, Some("s"));
                    Ok(Self { numbers, unit })
                }
                BYTE_ARRAY | FIXED_LEN_BYTE_ARRAY => Err("text or bytes"),
            },
        }
    }

    fn of_bytes(self, bytes: &[u8]) -> f64 {
        match (self.numbers, bytes) {
            (Numbers::Half, &[low, high]) => half(u16::from_le_bytes([low, high])),
            (Numbers::Decimal(scale), [first, ..]) if bytes.len() <= 16 => {
                let sign = if first >> 7 == 1 { -1 } else { 0 };
                let whole = bytes
                    .iter()
                    .fold(sign, |whole: i128, byte| whole << 8 | i128::from(*byte));
                decimal(whole as f64, scale)
            }
            _ => f64::NAN,
        }
    }
}

/// A whole number with so many of its digits behind the point.
fn decimal(whole: f64, scale: i32) -> f64 {
    whole / 10_f64.powi(scale)
}

/// Nanoseconds of a day and the Julian day, as seconds since 1970.
fn of_int96(x: &Int96) -> f64 {
    const JULIAN_1970: f64 = 2_440_588.0;
    let &[low, high, day] = x.data() else {
        return f64::NAN;
    };
    (f64::from(day) - JULIAN_1970) * 86_400.0 + (u64::from(high) << 32 | u64::from(low)) as f64 * 1e-9
}

/// Appends the values of a column chunk, NaN where there is none; says how many there are.
fn append(
    column: ColumnDescPtr,
    pages: Pages,
    kind: Kind,
    out: &mut Vec<f64>,
    budget: &mut Budget,
) -> Result<usize, ParquetError> {
    fn all<T: DataType>(
        mut reader: ColumnReaderImpl<T>,
        deepest: i16,
        out: &mut Vec<f64>,
        budget: &mut Budget,
        number: impl Fn(&T::T) -> f64,
    ) -> Result<usize, ParquetError> {
        let before = out.len();
        let (mut values, mut levels) = (Vec::new(), Vec::new());
        loop {
            values.clear();
            levels.clear();
            let (rows, ..) = reader.read_records(BATCH, Some(&mut levels), None, &mut values)?;
            if rows == 0 {
                return Ok(out.len() - before);
            }
            // A column of one value takes no room in a file.
            let taken = budget.take(rows);
            taken.map_err(|e| ParquetError::General(e.to_string()))?;
            let mut there = values.iter().map(&number);
            if deepest > 0 {
                let level = |level: &i16| if *level == deepest { there.next() } else { None };
                out.extend(levels.iter().map(level).map(|value| value.unwrap_or(f64::NAN)));
            } else {
                out.extend(there);
            }
        }
    }
    // A value is there where every struct around it is too.
    let deepest = column.max_def_level();
    use ColumnReader as R;
    match (get_column_reader(column, Box::new(pages)), kind.numbers) {
        (R::BoolColumnReader(r), _) => all(r, deepest, out, budget, |x| f64::from(u8::from(*x))),
        (R::Int32ColumnReader(r), Numbers::Unsigned) => {
            all(r, deepest, out, budget, |x| f64::from(*x as u32))
        }
        (R::Int32ColumnReader(r), Numbers::Decimal(scale)) => {
            all(r, deepest, out, budget, |x| decimal(f64::from(*x), scale))
        }
        (R::Int32ColumnReader(r), _) => all(r, deepest, out, budget, |x| f64::from(*x)),
        (R::Int64ColumnReader(r), Numbers::Unsigned) => all(r, deepest, out, budget, |x| *x as u64 as f64),
        (R::Int64ColumnReader(r), Numbers::Decimal(scale)) => {
            all(r, deepest, out, budget, |x| decimal(*x as f64, scale))
        }
        (R::Int64ColumnReader(r), _) => all(r, deepest, out, budget, |x| *x as f64),
        (R::Int96ColumnReader(r), _) => all(r, deepest, out, budget, of_int96),
        (R::FloatColumnReader(r), _) => all(r, deepest, out, budget, |x| f64::from(*x)),
        (R::DoubleColumnReader(r), _) => all(r, deepest, out, budget, |x| *x),
        (R::ByteArrayColumnReader(r), _) => all(r, deepest, out, budget, |x| kind.of_bytes(x.data())),
        (R::FixedLenByteArrayColumnReader(r), _) => all(r, deepest, out, budget, |x| kind.of_bytes(x.data())),
    }
}

pub(super) fn write(group: &Group, out: impl Write + Send) -> Result<(), RecordingError> {
    let time = Series {
        name: "time_s".into(),
        unit: "s".into(),
        source: "clock".into(),
        values: group.time_s.clone(),
    };
    let all: Vec<&Series> = std::iter::once(&time).chain(&group.channels).collect();
    let fields = all.iter().map(|channel| {
        let optional = channel.values.iter().any(|value| value.is_nan());
        let repetition = match optional {
            true => Repetition::OPTIONAL,
            false => Repetition::REQUIRED,
        };
        Type::primitive_type_builder(&channel.name, Physical::DOUBLE)
            .with_repetition(repetition)
            .build()
            .map(Arc::new)
    });
    let fields = fields.collect::<Result<Vec<_>, _>>().map_err(refuse)?;
    let schema = Type::group_type_builder("recording")
        .with_fields(fields)
        .build()
        .map_err(refuse)?;
    let rate_hz = group.sample_rate_hz();
    let channels: Vec<Value> = all
        .iter()
        .map(|c| json!({"name": c.name, "unit": c.unit, "source": c.source, "sample_rate_hz": rate_hz}))
        .collect();
    let properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_key_value_metadata(Some(vec![KeyValue::new(
            KEY.to_owned(),
            Value::Array(channels).to_string(),
        )]))
        .build();
    let mut writer =
        SerializedFileWriter::new(out, Arc::new(schema), Arc::new(properties)).map_err(refuse)?;
    let mut rows = writer.next_row_group().map_err(refuse)?;
    for channel in all {
        let Some(mut column) = rows.next_column().map_err(refuse)? else {
            return Err(refuse("a column is missing"));
        };
        let values = channel.values.iter().copied();
        let there: Vec<f64> = values.clone().filter(|value| !value.is_nan()).collect();
        let levels: Vec<i16> = values.map(|value| i16::from(!value.is_nan())).collect();
        let levels = (there.len() < levels.len()).then_some(&levels[..]);
        let written = column.typed::<DoubleType>().write_batch(&there, levels, None);
        written.map_err(refuse)?;
        column.close().map_err(refuse)?;
    }
    rows.close().map_err(refuse)?;
    writer.close().map_err(refuse)?;
    Ok(())
}
