//! CSV: a heading with units in the names or in brackets behind them, and numbers that are read back bit for bit.

use crate::recording::{Group, RecordingError, Series};
use crate::table::{TableReader, TableWriter};
use crate::units;

fn refuse(e: impl std::fmt::Display) -> RecordingError {
    RecordingError(e.to_string())
}

/// Columns of numbers; an empty field is NaN. A column that holds no number at all is passed over, as text is.
pub(super) fn read(bytes: &[u8]) -> Result<Vec<Series>, RecordingError> {
    let mut table = TableReader::new(bytes).map_err(refuse)?;
    let mut columns: Vec<Series> = table.header().iter().map(|name| heading(name)).collect();
    let mut is_text = vec![None; columns.len()];
    for row in table.rows() {
        let row = row.map_err(refuse)?;
        for (c, column) in columns.iter_mut().enumerate() {
            let text = row.field(c);
            let value = match text.parse() {
                Ok(value) => value,
                Err(_) if text.is_empty() => f64::NAN,
                // Text from the first row on is a column of text; later it is a mistake.
                Err(_) if row_count(column) == 0 || is_text[c] == Some(true) => {
                    is_text[c] = Some(true);
                    f64::NAN
                }
                Err(_) => {
                    let name = &column.name;
                    return Err(refuse(format!(
                        "line {}: {name} is {text:?}, which is not a number",
                        row.line
                    )));
                }
            };
            column.values.push(value);
        }
    }
    let kept = columns
        .into_iter()
        .zip(is_text)
        .filter(|(_, is_text)| *is_text != Some(true));
    Ok(kept.map(|(column, _)| column).collect())
}

fn row_count(column: &Series) -> usize {
    column.values.len()
}

/// `name [unit]`, `name (unit)` or `name`.
fn heading(text: &str) -> Series {
    let split = |open: char, close: char| -> Option<(&str, &str)> {
        let (name, unit) = text.trim().strip_suffix(close)?.rsplit_once(open)?;
        (!name.trim().is_empty()).then_some((name.trim(), unit.trim()))
    };
    let (name, unit) = split('[', ']')
        .or_else(|| split('(', ')'))
        .unwrap_or((text.trim(), ""));
    Series {
        name: name.into(),
        unit: unit.into(),
        ..Series::default()
    }
}

pub(super) fn write(group: &Group) -> Result<Vec<u8>, RecordingError> {
    let mut out = Vec::new();
    let names = group.channels.iter().map(|channel| {
        let said = units::of_name(&channel.name) == Some(channel.unit.as_str());
        if said || ["", "1"].contains(&channel.unit.as_str()) {
            channel.name.clone()
        } else {
            format!("{} [{}]", channel.name, channel.unit)
        }
    });
    let mut table =
        TableWriter::new(&mut out, std::iter::once("time_s".to_owned()).chain(names)).map_err(refuse)?;
    let text = |value: f64| {
        if value.is_nan() {
            String::new()
        } else {
            format!("{value}")
        }
    };
    for (k, time_s) in group.time_s.iter().enumerate() {
        let values = group.channels.iter().map(|channel| channel.values[k]);
        table
            .row(std::iter::once(*time_s).chain(values).map(text))
            .map_err(refuse)?;
    }
    table.finish().map_err(refuse)?;
    Ok(out)
}
