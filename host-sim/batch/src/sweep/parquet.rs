//! The table of drives as Parquet. Row groups have a fixed number of rows, so the bytes follow from the rows.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::sync::Arc;

use parquet::basic::{Compression, ConvertedType, Repetition, Type as Kind};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::Type;

use super::axis::Kind as AxisKind;
use super::table::header;
use super::{Driven, Point, Sweep, value};

/// Rows in memory at once.
const ROWS_OF_A_GROUP: usize = 65_536;

/// A column's values on their way.
enum Column {
    Whole(Vec<i64>),
    Number(Vec<Option<f64>>),
    Text(Vec<String>),
    Flag(Vec<bool>),
}

pub(super) struct ParquetTable {
    writer: SerializedFileWriter<BufWriter<File>>,
    version: String,
    columns: Vec<Column>,
    rows: usize,
}

impl ParquetTable {
    pub(super) fn create(sweep: &Sweep, version: &str, file: File) -> io::Result<Self> {
        let columns = columns(sweep);
        let fields = header(sweep)
            .into_iter()
            .zip(&columns)
            .map(|(name, column)| column.field(&name));
        let fields: Vec<Arc<Type>> = fields.collect::<io::Result<_>>()?;
        let schema = Type::group_type_builder("drives")
            .with_fields(fields)
            .build()
            .map_err(other)?;
        let entry = |key: &str, value: &str| KeyValue::new(key.to_string(), value.to_string());
        let properties = WriterProperties::builder()
            .set_compression(Compression::SNAPPY)
            .set_key_value_metadata(Some(vec![
                entry("haptic.version", version),
                entry("haptic.sweep", sweep.text()),
            ]))
            .build();
        let writer = SerializedFileWriter::new(BufWriter::new(file), Arc::new(schema), Arc::new(properties));
        Ok(Self {
            writer: writer.map_err(other)?,
            version: version.into(),
            columns,
            rows: 0,
        })
    }

    pub(super) fn row(&mut self, point: &Point, driven: &Driven) -> io::Result<()> {
        let version = &self.version;
        let mut columns = self.columns.iter_mut();
        let mut next = |fill: &dyn Fn(&mut Column)| {
            if let Some(column) = columns.next() {
                fill(column);
            }
        };
        next(&|column| column.whole(point.drive));
        next(&|column| column.whole(point.seed));
        next(&|column| column.text(version.clone()));
        for own in &point.values {
            next(&|column| match column {
                Column::Text(_) => column.text(value::text(own)),
                _ => column.number(value::number(own)),
            });
        }
        next(&|column| column.flag(driven.diverged));
        next(&|column| column.number(Some(driven.end_m)));
        let away = driven.away;
        next(&|column| column.number(away.guidance_left_s));
        next(&|column| {
            column.text(
                away.guidance_left_why
                    .map_or(String::new(), |why| why.to_string()),
            )
        });
        next(&|column| column.number(away.guidance_back_s));
        next(&|column| column.number(away.unguided_s));
        for metric in &driven.metrics {
            next(&|column| column.number(*metric));
        }
        self.rows += 1;
        if self.rows == ROWS_OF_A_GROUP {
            self.write_group()?;
        }
        Ok(())
    }

    fn write_group(&mut self) -> io::Result<()> {
        let mut group = self.writer.next_row_group().map_err(other)?;
        for column in &mut self.columns {
            column.write(&mut group)?;
        }
        group.close().map_err(other)?;
        self.rows = 0;
        Ok(())
    }

    pub(super) fn finish(mut self) -> io::Result<()> {
        if self.rows > 0 {
            self.write_group()?;
        }
        let mut file = self.writer.into_inner().map_err(other)?;
        file.flush()?;
        file.get_ref().sync_all()
    }
}

/// Empty columns in the order of [`header`]. What is varied is a column of numbers if all its values are numbers.
fn columns(sweep: &Sweep) -> Vec<Column> {
    let number = || Column::Number(Vec::new());
    let mut columns = vec![
        Column::Whole(Vec::new()),
        Column::Whole(Vec::new()),
        Column::Text(Vec::new()),
    ];
    for axis in sweep.axes() {
        let rows = match &axis.kind {
            AxisKind::Grid(rows) => Some(rows.as_slice()),
            AxisKind::Sampled(distribution) => distribution.rows(),
        };
        for i in 0..axis.columns.len() {
            let of_numbers = rows.is_none_or(|rows| rows.iter().all(|row| value::number(&row[i]).is_some()));
            columns.push(if of_numbers {
                number()
            } else {
                Column::Text(Vec::new())
            });
        }
    }
    columns.extend([Column::Flag(Vec::new()), number()]);
    columns.extend([number(), Column::Text(Vec::new()), number(), number()]);
    columns.extend(sweep.metrics().iter().map(|_| number()));
    columns
}

impl Column {
    fn field(&self, name: &str) -> io::Result<Arc<Type>> {
        let (kind, repetition) = match self {
            Self::Whole(_) => (Kind::INT64, Repetition::REQUIRED),
            Self::Number(_) => (Kind::DOUBLE, Repetition::OPTIONAL),
            Self::Text(_) => (Kind::BYTE_ARRAY, Repetition::REQUIRED),
            Self::Flag(_) => (Kind::BOOLEAN, Repetition::REQUIRED),
        };
        let builder = Type::primitive_type_builder(name, kind).with_repetition(repetition);
        let builder = if kind == Kind::BYTE_ARRAY {
            builder.with_converted_type(ConvertedType::UTF8)
        } else {
            builder
        };
        builder.build().map(Arc::new).map_err(other)
    }

    fn whole(&mut self, value: u64) {
        if let Self::Whole(values) = self {
            values.push(value as i64);
        }
    }

    fn number(&mut self, value: Option<f64>) {
        if let Self::Number(values) = self {
            values.push(value);
        }
    }

    fn text(&mut self, value: String) {
        if let Self::Text(values) = self {
            values.push(value);
        }
    }

    fn flag(&mut self, value: bool) {
        if let Self::Flag(values) = self {
            values.push(value);
        }
    }

    /// Writes the values and forgets them.
    fn write(&mut self, group: &mut SerializedRowGroupWriter<'_, BufWriter<File>>) -> io::Result<()> {
        let Some(mut column) = group.next_column().map_err(other)? else {
            return Err(io::Error::other("more columns than the schema has"));
        };
        match self {
            Self::Whole(values) => {
                column
                    .typed::<Int64Type>()
                    .write_batch(values, None, None)
                    .map_err(other)?;
                values.clear();
            }
            Self::Number(values) => {
                let levels: Vec<i16> = values.iter().map(|value| i16::from(value.is_some())).collect();
                let there: Vec<f64> = values.iter().copied().flatten().collect();
                column
                    .typed::<DoubleType>()
                    .write_batch(&there, Some(&levels), None)
                    .map_err(other)?;
                values.clear();
            }
            Self::Text(values) => {
                let bytes: Vec<ByteArray> =
                    values.iter().map(|text| ByteArray::from(text.as_str())).collect();
                column
                    .typed::<ByteArrayType>()
                    .write_batch(&bytes, None, None)
                    .map_err(other)?;
                values.clear();
            }
            Self::Flag(values) => {
                column
                    .typed::<BoolType>()
                    .write_batch(values, None, None)
                    .map_err(other)?;
                values.clear();
            }
        }
        column.close().map_err(other)
    }
}

fn other(error: parquet::errors::ParquetError) -> io::Error {
    io::Error::other(error)
}
