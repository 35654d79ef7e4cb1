//! CSV: a heading with units in the names or in brackets behind them, and numbers that are read back bit for bit.

use std::collections::HashMap;
use std::io::Write;

use crate::recording::{Group, RecordingError, Series, refuse};
use crate::table::{TableError, TableReader, TableWriter, number};
use crate::units;

/// Columns of numbers; an empty field is NaN, `True` and `False` are 1 and 0. A column that holds no number at all is passed over, as text is.
pub(super) fn read(bytes: &[u8]) -> Result<Vec<Series>, RecordingError> {
    let mut table = TableReader::new(bytes).map_err(refuse)?;
    let mut columns = headings(table.header());
    let (mut is_text, mut has_numbers) = (vec![false; columns.len()], vec![false; columns.len()]);
    for row in table.rows() {
        let row = row.map_err(refuse)?;
        for (c, column) in columns.iter_mut().enumerate() {
            let value = number(row.field(c)).or_else(|| truth(row.field(c)));
            // Text before any number is a column of text; later it is a mistake.
            if value.is_none() && has_numbers[c] {
                return Err(refuse(TableError::NotANumber {
                    line: row.line,
                    column: column.name.clone(),
                    text: row.field(c).into(),
                }));
            }
            is_text[c] |= value.is_none();
            has_numbers[c] |= value.is_some_and(|value| !value.is_nan()) && !is_text[c];
            column.values.push(value.unwrap_or(f64::NAN));
        }
    }
    let kept = columns.into_iter().zip(is_text).filter(|(_, is_text)| !is_text);
    Ok(kept.map(|(column, _)| column).collect())
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

pub(super) fn write(group: &Group) -> Result<Vec<u8>, RecordingError> {
    let mut out = Vec::new();
    let mut table = begin(&mut out, &group.channels)?;
    for (k, time_s) in group.time_s.iter().enumerate() {
        let values = group.channels.iter().map(|channel| channel.values[k]);
        table
            .row(std::iter::once(*time_s).chain(values).map(text))
            .map_err(refuse)?;
    }
    table.finish().map_err(refuse)?;
    Ok(out)
}

/// A table with its heading: the names of the channels, with the unit in brackets where the name does not say it.
pub(super) fn begin<W: Write>(out: W, channels: &[Series]) -> Result<TableWriter<W>, RecordingError> {
    let names = channels.iter().map(|channel| {
        let said = units::of_name(&channel.name) == Some(channel.unit.as_str());
        if said || ["", "1"].contains(&channel.unit.as_str()) {
            channel.name.clone()
        } else {
            format!("{} [{}]", channel.name, channel.unit)
        }
    });
    TableWriter::new(out, std::iter::once("time_s".to_owned()).chain(names)).map_err(refuse)
}

pub(super) fn text(value: f64) -> String {
    match value.is_nan() {
        true => String::new(),
        false => value.to_string(),
    }
}
