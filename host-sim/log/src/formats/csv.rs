//! CSV: a heading with units in the names or in brackets behind them, and numbers that are read back bit for bit.

use std::collections::HashMap;
use std::io::{Read, Write};

use super::calendar::{self, Origin};
use super::{Only, Table};
use crate::notes::{Fate, Part};
use crate::recording::{Group, RecordingError, Series, refuse};
use crate::table::{Row, TableError, TableReader, TableWriter, number};
use crate::units;

/// A column under way.
struct Column {
    place: usize,
    series: Series,
    has_numbers: bool,
    date: Option<Origin>,
    /// The first field that is no number, and its line.
    text: Option<(u64, String)>,
}

/// Columns of numbers; an empty field is NaN, `True` and `False` are 1 and 0, a date is seconds since 1970.
///
/// # Errors
/// What is no table.
pub(super) fn read(source: impl Read, only: Only<'_>) -> Result<Table, RecordingError> {
    let mut table = TableReader::new(source).map_err(refuse)?;
    let (mut columns, mut found) = (Vec::new(), Table::default());
    for (place, series) in headings(table.header()).into_iter().enumerate() {
        if only.is_none_or(|is_wanted| is_wanted(&series.name)) {
            columns.push(Column {
                place,
                series,
                has_numbers: false,
                date: None,
                text: None,
            });
        } else {
            found.unread.push(series.name);
        }
    }
    let mut rows = 0;
    while let Some(row) = table.next_row().map_err(refuse)? {
        found.lines.push(rows, row.line);
        rows += 1;
        for column in &mut columns {
            column.take(row);
        }
    }
    if let Some(line) = table.cut() {
        found.notes.count(
            Fate::Cut,
            Part::Row,
            "the file ends in it",
            format!("line {line}"),
        );
    }
    for mut column in columns {
        let name = column.series.name.clone();
        if let Some(why) = column.why_left_out() {
            found.notes.channel(Fate::LeftOut, name, &why);
            continue;
        }
        if let Some(origin) = column.date {
            column.series.unit = "s".into();
            let why = match origin {
                Origin::Epoch => "date and time as text, to seconds since 1970, UTC if no zone is said",
                Origin::Midnight => "time of day as text, to seconds since midnight",
            };
            found.notes.channel(Fate::Converted, name, why);
        }
        found.columns.push(column.series);
    }
    Ok(found)
}

impl Column {
    fn take(&mut self, row: Row<'_>) {
        let field = row.field(self.place);
        let value = number(&field).or_else(|| truth(&field));
        let date = || {
            let (seconds, origin) = calendar::seconds(&field)?;
            let fits = self.date == Some(origin) || !self.has_numbers;
            fits.then_some((seconds, Some(origin)))
        };
        let value = match (value.map(|value| (value, None)).or_else(date), &self.text) {
            (Some((value, None)), None) if self.date.is_some() && !value.is_nan() => {
                self.text = Some((row.line, field.into_owned()));
                return;
            }
            (Some((value, date)), None) => {
                self.date = date.or(self.date);
                self.has_numbers |= !value.is_nan();
                value
            }
            // It will be left out: what else is in it only says why.
            (Some((value, _)), Some(_)) => {
                self.has_numbers |= !value.is_nan();
                return;
            }
            (None, _) => {
                self.text.get_or_insert_with(|| (row.line, field.into_owned()));
                return;
            }
        };
        self.series.values.push(value);
    }

    /// A column of texts is one; a text among numbers is a mistake, which is named.
    fn why_left_out(&self) -> Option<String> {
        let (line, text) = self.text.clone()?;
        let is_comma = text.replacen(',', ".", 1).parse::<f64>().is_ok();
        if !self.has_numbers && !is_comma {
            return Some("text".into());
        }
        let column = self.series.name.clone();
        Some(TableError::NotANumber { line, column, text }.to_string())
    }
}

/// A flag, as Python (`True`) and others (`true`) write it.
fn truth(field: &str) -> Option<f64> {
    match field.to_ascii_lowercase().as_str() {
        "true" => Some(1.0),
        "false" => Some(0.0),
        _ => None,
    }
}

/// Columns by their headings, without the units in brackets unless those alone tell two of them apart.
pub(super) fn headings(texts: &[String]) -> Vec<Series> {
    fn split(text: &str) -> (&str, &str) {
        units::in_brackets(text).unwrap_or((text.trim(), ""))
    }
    let mut count: HashMap<&str, usize> = HashMap::new();
    for text in texts {
        *count.entry(split(text).0).or_default() += 1;
    }
    let series = |text: &String| {
        let (name, unit) = split(text);
        let alone = count[name] == 1;
        Series {
            name: if alone { name } else { text.trim() }.into(),
            unit: unit.into(),
            ..Series::default()
        }
    };
    texts.iter().map(series).collect()
}

pub(super) fn write(group: &Group, out: impl Write) -> Result<(), RecordingError> {
    let mut table = begin(out, &group.channels)?;
    for (k, time_s) in group.time_s.iter().enumerate() {
        let values = group.channels.iter().map(|channel| channel.values[k]);
        table
            .row(std::iter::once(*time_s).chain(values).map(text))
            .map_err(refuse)?;
    }
    table.finish().map_err(refuse)
}

/// A table with its heading: the names of the channels, with the unit in brackets where the name does not say it.
pub(super) fn begin<W: Write>(out: W, channels: &[Series]) -> Result<TableWriter<W>, RecordingError> {
    let names = channels.iter().map(|channel| {
        let unit = units::of_name(&channel.name);
        let unit = unit.or_else(|| Some(units::in_brackets(&channel.name)?.1));
        let said = unit == Some(channel.unit.as_str());
        if said || ["", "1"].contains(&channel.unit.as_str()) {
            channel.name.clone()
        } else {
            format!("{} [{}]", channel.name, channel.unit)
        }
    });
    TableWriter::new(out, std::iter::once("time_s".to_owned()).chain(names)).map_err(refuse)
}

/// The shortest digits that are read back as this number. pandas takes whole numbers beyond 64 bits for texts: those and all
/// other large or small ones have an exponent.
pub(super) fn text(value: f64) -> String {
    match value.abs() {
        size if size.is_nan() => String::new(),
        0.0 | 1e-5..1e16 => value.to_string(),
        _ => format!("{value:e}"),
    }
}
