//! Parquet: a column of doubles for each channel; units, sources and sample rates as JSON in the file's metadata, by the key
//! `haptic.channels`. Written with Snappy, which every reader knows.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use bytes::Bytes;
use parquet::basic::{Compression, LogicalType, Repetition, TimeUnit, Type as Physical};
use parquet::data_type::DoubleType;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::record::Field;
use parquet::schema::types::Type;
use serde_json::{Value, json};

use crate::recording::{Group, RecordingError, Series};

const KEY: &str = "haptic.channels";

fn refuse(e: impl std::fmt::Display) -> RecordingError {
    RecordingError(e.to_string())
}

pub(super) fn read(file: Vec<u8>) -> Result<Vec<Series>, RecordingError> {
    // The reader is safe code, but not written for files that lie.
    catch_unwind(AssertUnwindSafe(|| columns(file))).unwrap_or_else(|_| Err(refuse("the file is damaged")))
}

fn columns(file: Vec<u8>) -> Result<Vec<Series>, RecordingError> {
    let reader = SerializedFileReader::new(Bytes::from(file)).map_err(refuse)?;
    let metadata = reader.metadata().file_metadata();
    let said: Value = metadata
        .key_value_metadata()
        .and_then(|all| all.iter().find(|pair| pair.key == KEY))
        .and_then(|pair| serde_json::from_str(pair.value.as_deref()?).ok())
        .unwrap_or_default();
    let fields = metadata.schema().get_fields().to_vec();
    let mut columns: Vec<Series> = fields
        .iter()
        .map(|field| {
            let entry = said
                .as_array()
                .and_then(|all| all.iter().find(|c| c["name"] == field.name()));
            let text = |key: &str| entry.and_then(|e| e[key].as_str()).unwrap_or_default().to_owned();
            Series {
                name: field.name().into(),
                unit: text("unit"),
                source: text("source"),
                values: Vec::new(),
            }
        })
        .collect();
    let mut is_number = vec![true; columns.len()];
    for row in reader.get_row_iter(None).map_err(refuse)? {
        let row = row.map_err(refuse)?;
        for (c, (_, field)) in row.get_column_iter().enumerate() {
            let value = number(field);
            is_number[c] &= value.is_some();
            columns[c].values.push(value.unwrap_or(f64::NAN));
        }
    }
    // What is a date counts in parts of a second.
    for (column, field) in columns.iter_mut().zip(&fields) {
        if let Some(LogicalType::Timestamp(stamp)) = field.get_basic_info().logical_type_ref() {
            column.unit = match stamp.unit {
                TimeUnit::MILLIS => "ms",
                TimeUnit::MICROS => "us",
                TimeUnit::NANOS => "ns",
            }
            .into();
        }
    }
    let kept = columns
        .into_iter()
        .zip(is_number)
        .filter(|(_, is_number)| *is_number);
    Ok(kept.map(|(column, _)| column).collect())
}

/// A value as a number; none for what is none.
fn number(field: &Field) -> Option<f64> {
    Some(match field {
        Field::Null => f64::NAN,
        Field::Bool(x) => f64::from(u8::from(*x)),
        Field::Byte(x) => f64::from(*x),
        Field::Short(x) => f64::from(*x),
        Field::Int(x) => f64::from(*x),
        Field::Long(x) | Field::TimestampMillis(x) | Field::TimestampMicros(x) => *x as f64,
        Field::UByte(x) => f64::from(*x),
        Field::UShort(x) => f64::from(*x),
        Field::UInt(x) => f64::from(*x),
        Field::ULong(x) => *x as f64,
        Field::Float(x) => f64::from(*x),
        Field::Double(x) => *x,
        _ => return None,
    })
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
        let repetition = if optional {
            Repetition::OPTIONAL
        } else {
            Repetition::REQUIRED
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
        let there: Vec<f64> = channel
            .values
            .iter()
            .copied()
            .filter(|value| !value.is_nan())
            .collect();
        let levels: Vec<i16> = channel
            .values
            .iter()
            .map(|value| i16::from(!value.is_nan()))
            .collect();
        let levels = (there.len() < levels.len()).then_some(&levels[..]);
        column
            .typed::<DoubleType>()
            .write_batch(&there, levels, None)
            .map_err(refuse)?;
        column.close().map_err(refuse)?;
    }
    rows.close().map_err(refuse)?;
    writer.close().map_err(refuse)?;
    Ok(out)
}
