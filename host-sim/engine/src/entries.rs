//! Entries of a table of drives, as CSV and Parquet both write them.

use std::fmt;

use toml::Value;

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EntryKind {
    /// Whole numbers from 0 on.
    Whole,
    /// Numbers, some of which may be missing.
    Number,
    /// Texts.
    Text,
    /// Yes or no.
    Flag,
}

/// A value of a row.
pub enum Entry<'a> {
    /// In a column of whole numbers.
    Whole(u64),
    /// In a column of numbers.
    Number(Option<f64>),
    /// In a column of texts.
    Text(String),
    /// In a column of flags.
    Flag(bool),
    /// In a column of numbers or of texts.
    Value(&'a Value),
}

/// CSV has nothing for no number, and 0 or 1 for a flag.
impl fmt::Display for Entry<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Whole(whole) => write!(f, "{whole}"),
            Self::Number(number) => number.map_or(Ok(()), |number| write!(f, "{number}")),
            Self::Text(text) => f.write_str(text),
            Self::Flag(flag) => write!(f, "{}", u8::from(*flag)),
            Self::Value(value) => f.write_str(&text(value)),
        }
    }
}

/// The number in a value, if it is one.
pub fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Float(x) => Some(*x),
        Value::Integer(x) => Some(*x as f64),
        _ => None,
    }
}

/// The text of a table's field: a number that reads back to the same bits, a text without quotes.
pub fn text(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Float(x) => x.to_string(),
        other => other.to_string(),
    }
}
