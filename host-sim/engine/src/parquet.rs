//! A table of drives as Parquet. Row groups have a fixed number of rows, so the bytes follow from the rows.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::mem::take;
use std::sync::Arc;

use parquet::basic::{Compression, ConvertedType, Repetition, Type as Kind};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::Type;

use super::{Entry, EntryKind, number, text};

/// Rows in memory at once.
const ROWS_OF_A_GROUP: usize = 65_536;

/// A column's values on their way.
enum ParquetColumn {
    Whole(Vec<i64>),
    Number(Vec<Option<f64>>),
    Text(Vec<String>),
    Flag(Vec<bool>),
}

/// A table on its way.
pub(super) struct Table {
    writer: SerializedFileWriter<BufWriter<File>>,
    columns: Vec<ParquetColumn>,
    rows: usize,
}

impl Table {
    /// A table with its columns, empty, and with what the file's metadata say.
    pub(super) fn create(
        columns: impl IntoIterator<Item = (String, EntryKind)>,
        metadata: &[(&str, &str)],
        file: File,
    ) -> io::Result<Self> {
        let columns = columns
            .into_iter()
            .map(|(name, kind)| (name, ParquetColumn::new(kind)));
        let (names, columns): (Vec<String>, Vec<ParquetColumn>) = columns.unzip();
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

    /// A row, with an entry of its kind for each column.
    pub(super) fn row<'a>(&mut self, entries: impl IntoIterator<Item = Entry<'a>>) -> io::Result<()> {
        for (column, entry) in self.columns.iter_mut().zip(entries) {
            column.push(entry);
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

impl ParquetColumn {
    fn new(kind: EntryKind) -> Self {
        match kind {
            EntryKind::Whole => Self::Whole(Vec::new()),
            EntryKind::Number => Self::Number(Vec::new()),
            EntryKind::Text => Self::Text(Vec::new()),
            EntryKind::Flag => Self::Flag(Vec::new()),
        }
    }

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

    fn push(&mut self, entry: Entry<'_>) {
        match (self, entry) {
            (Self::Whole(values), Entry::Whole(value)) => values.push(value as i64),
            (Self::Number(values), Entry::Number(value)) => values.push(value),
            (Self::Text(values), Entry::Text(value)) => values.push(value),
            (Self::Flag(values), Entry::Flag(value)) => values.push(value),
            (Self::Number(values), Entry::Value(value)) => values.push(number(value)),
            (Self::Text(values), Entry::Value(value)) => values.push(text(value)),
            // The group would not close: its columns differ in length.
            _ => {}
        }
    }

    /// Writes the values and forgets them.
    fn write(&mut self, group: &mut SerializedRowGroupWriter<'_, BufWriter<File>>) -> io::Result<()> {
        let Some(mut column) = group.next_column().map_err(other)? else {
            return Err(io::Error::other("more columns than the schema has"));
        };
        let written = match self {
            Self::Whole(values) => column.typed::<Int64Type>().write_batch(&take(values), None, None),
            Self::Number(values) => {
                let values = take(values);
                let levels: Vec<i16> = values.iter().map(|value| i16::from(value.is_some())).collect();
                let there: Vec<f64> = values.into_iter().flatten().collect();
                column
                    .typed::<DoubleType>()
                    .write_batch(&there, Some(&levels), None)
            }
            Self::Text(values) => {
                let texts = take(values).into_iter();
                let bytes: Vec<ByteArray> = texts.map(|text| text.into_bytes().into()).collect();
                column.typed::<ByteArrayType>().write_batch(&bytes, None, None)
            }
            Self::Flag(values) => column.typed::<BoolType>().write_batch(&take(values), None, None),
        };
        written.map_err(other)?;
        column.close().map_err(other)
    }
}

fn other(error: parquet::errors::ParquetError) -> io::Error {
    io::Error::other(error)
}
