//! Parquet: a column of doubles for each channel; units, sources and sample rates as JSON in the file's metadata, by the key
//! `haptic.channels`. Written with Snappy, which every reader knows.

mod nesting;
mod pages;

use std::sync::Arc;

use bytes::Bytes;
use parquet::basic::{Compression, ConvertedType, LogicalType, Repetition, TimeUnit, Type as Physical};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl, get_column_reader};
use parquet::data_type::{DataType, DoubleType};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::{ColumnDescPtr, ColumnDescriptor, Type};
use serde_json::{Value, json};

use self::pages::Pages;
use super::bytes::Budget;
use crate::guard::guarded;
use crate::recording::{Group, RecordingError, Series, refuse};

const KEY: &str = "haptic.channels";

pub(super) fn read(file: Vec<u8>) -> Result<Vec<Series>, RecordingError> {
    // The reader is safe code, but not written for files that lie.
    guarded(|| columns(file.into())).unwrap_or_else(|| Err(refuse("the file is damaged")))
}

fn columns(file: Bytes) -> Result<Vec<Series>, RecordingError> {
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
    let mut found = Vec::new();
    for (c, column) in schema.columns().iter().enumerate() {
        let Some(kind) = Kind::from_column(column) else {
            continue;
        };
        let name = schema.column(c).name().to_owned();
        let mut values = Vec::new();
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
        found.push(Series {
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
#[derive(Debug, Clone, Copy, Default)]
struct Kind {
    is_unsigned: bool,
    /// That of a date.
    unit: Option<&'static str>,
}

impl Kind {
    /// None for what is no number.
    fn from_column(column: &ColumnDescriptor) -> Option<Self> {
        use ConvertedType as Old;
        use Physical::{BOOLEAN, DOUBLE, FLOAT, INT32, INT64};
        if column.path().parts().len() != 1 || column.max_rep_level() > 0 || column.max_def_level() > 1 {
            return None;
        }
        let is_number = matches!(column.physical_type(), BOOLEAN | INT32 | INT64 | FLOAT | DOUBLE);
        let in_parts = |unit| Self {
            unit: Some(unit),
            ..Self::default()
        };
        let kind = match (column.logical_type_ref(), column.converted_type()) {
            (Some(LogicalType::Timestamp(stamp)), _) => in_parts(match stamp.unit {
                TimeUnit::MILLIS => "ms",
                TimeUnit::MICROS => "us",
                TimeUnit::NANOS => "ns",
            }),
            (None, Old::TIMESTAMP_MILLIS) => in_parts("ms"),
            (None, Old::TIMESTAMP_MICROS) => in_parts("us"),
            (Some(LogicalType::Integer(integer)), _) => Self {
                is_unsigned: !integer.is_signed,
                unit: None,
            },
            (None, Old::UINT_8 | Old::UINT_16 | Old::UINT_32 | Old::UINT_64) => Self {
                is_unsigned: true,
                unit: None,
            },
            (None, Old::NONE | Old::INT_8 | Old::INT_16 | Old::INT_32 | Old::INT_64) => Self::default(),
            _ => return None,
        };
        is_number.then_some(kind)
    }
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
        has_gaps: bool,
        out: &mut Vec<f64>,
        budget: &mut Budget,
        number: impl Fn(&T::T) -> f64,
    ) -> Result<usize, ParquetError> {
        let before = out.len();
        loop {
            let (mut values, mut levels) = (Vec::new(), Vec::new());
            let (rows, ..) = reader.read_records(BATCH, Some(&mut levels), None, &mut values)?;
            if rows == 0 {
                return Ok(out.len() - before);
            }
            // A column of one value takes no room in a file.
            let taken = budget.take(rows);
            taken.map_err(|e| ParquetError::General(e.to_string()))?;
            let mut there = values.iter().map(&number);
            if has_gaps {
                let level = |level: &i16| if *level > 0 { there.next() } else { None };
                out.extend(levels.iter().map(level).map(|value| value.unwrap_or(f64::NAN)));
            } else {
                out.extend(there);
            }
        }
    }
    let has_gaps = column.max_def_level() > 0;
    match get_column_reader(column, Box::new(pages)) {
        ColumnReader::BoolColumnReader(r) => all(r, has_gaps, out, budget, |x| f64::from(u8::from(*x))),
        ColumnReader::Int32ColumnReader(r) if kind.is_unsigned => {
            all(r, has_gaps, out, budget, |x| f64::from(*x as u32))
        }
        ColumnReader::Int32ColumnReader(r) => all(r, has_gaps, out, budget, |x| f64::from(*x)),
        ColumnReader::Int64ColumnReader(r) if kind.is_unsigned => {
            all(r, has_gaps, out, budget, |x| *x as u64 as f64)
        }
        ColumnReader::Int64ColumnReader(r) => all(r, has_gaps, out, budget, |x| *x as f64),
        ColumnReader::FloatColumnReader(r) => all(r, has_gaps, out, budget, |x| f64::from(*x)),
        ColumnReader::DoubleColumnReader(r) => all(r, has_gaps, out, budget, |x| *x),
        _ => Ok(0),
    }
}

pub(super) fn write(group: &Group) -> Result<Vec<u8>, RecordingError> {
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
    let mut out = Vec::new();
    let mut writer =
        SerializedFileWriter::new(&mut out, Arc::new(schema), Arc::new(properties)).map_err(refuse)?;
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
    Ok(out)
}
