//! Entries of a table of drives, as CSV and Parquet both write them.

use std::fmt;

use toml::Value;

use crate::sweep::value;

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum EntryKind {
    Whole,
    Number,
    Text,
    Flag,
}

/// A value of a row.
pub(crate) enum Entry<'a> {
    Whole(u64),
    Number(Option<f64>),
    Text(String),
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
            Self::Value(value) => f.write_str(&value::text(value)),
        }
    }
}
