//! A table of drives as Parquet. Row groups have a fixed number of rows, so the bytes follow from the rows.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::sync::Arc;

use parquet::basic::{Compression, ConvertedType, Repetition, Type as Kind};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::Type;

/// Rows in memory at once.
const ROWS_OF_A_GROUP: usize = 65_536;

/// A value of a row.
pub(crate) enum Cell {
    Whole(u64),
    Number(Option<f64>),
    Text(String),
    Flag(bool),
}

/// A column's values on their way.
pub(crate) enum ParquetColumn {
    Whole(Vec<i64>),
    Number(Vec<Option<f64>>),
    Text(Vec<String>),
    Flag(Vec<bool>),
}

/// A table on its way.
pub(crate) struct Table {
    writer: SerializedFileWriter<BufWriter<File>>,
    columns: Vec<ParquetColumn>,
    rows: usize,
}

impl Table {
    /// With its columns, empty, and with what the file's metadata say.
    pub(crate) fn create(
        columns: impl IntoIterator<Item = (String, ParquetColumn)>,
        metadata: &[(&str, &str)],
        file: File,
    ) -> io::Result<Self> {
        let (names, columns): (Vec<String>, Vec<ParquetColumn>) = columns.into_iter().unzip();
        let fields = names
            .iter()
            .zip(&columns)
            .map(|(name, column)| column.field(name));
        let fields: Vec<Arc<Type>> = fields.collect::<io::Result<_>>()?;
        let schema = Type::group_type_builder("drives")
            .with_fields(fields)
            .build()
            .map_err(other)?;
        let entries = metadata
            .iter()
            .map(|(key, value)| KeyValue::new((*key).to_string(), (*value).to_string()));
        let properties = WriterProperties::builder()
            .set_compression(Compression::SNAPPY)
            .set_key_value_metadata(Some(entries.collect()))
            .build();
        let writer = SerializedFileWriter::new(BufWriter::new(file), Arc::new(schema), Arc::new(properties));
        Ok(Self {
            writer: writer.map_err(other)?,
            columns,
            rows: 0,
        })
    }

    /// A row, with a cell of its kind for each column.
    pub(crate) fn row(&mut self, cells: impl IntoIterator<Item = Cell>) -> io::Result<()> {
        for (column, cell) in self.columns.iter_mut().zip(cells) {
            column.push(cell);
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

    pub(crate) fn finish(mut self) -> io::Result<()> {
        if self.rows > 0 {
            self.write_group()?;
        }
        let mut file = self.writer.into_inner().map_err(other)?;
        file.flush()?;
        file.get_ref().sync_all()
    }
}

impl ParquetColumn {
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

    fn push(&mut self, cell: Cell) {
        match (self, cell) {
            (Self::Whole(values), Cell::Whole(value)) => values.push(value as i64),
            (Self::Number(values), Cell::Number(value)) => values.push(value),
            (Self::Text(values), Cell::Text(value)) => values.push(value),
            (Self::Flag(values), Cell::Flag(value)) => values.push(value),
            // The group would not close: its columns differ in length.
            _ => {}
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
