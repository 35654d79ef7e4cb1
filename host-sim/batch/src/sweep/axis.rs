//! What varies together, and its values.

use toml::Value;

use super::value::Distribution;

/// Most values of one list or range: more belong into a distribution.
pub(super) const MOST_VALUES: u32 = 100_000;

/// A column of the results, and the fields of the scenario that it sets.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Column {
    pub name: String,
    pub paths: Vec<String>,
    /// What the fields get is the column's number times this,
    pub times: f64,
    /// over the number of that column.
    pub over: Option<String>,
}

/// Columns that vary together.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Axis {
    pub columns: Vec<Column>,
    pub kind: Kind,
}

impl Axis {
    /// The values of a list or a choice; none of a distribution.
    pub(super) fn rows(&self) -> Option<&[Vec<Value>]> {
        match &self.kind {
            Kind::Grid(rows) => Some(rows),
            Kind::Sampled(distribution) => distribution.rows(),
        }
    }
}

#[derive(Debug, Clone, PartialEq)]
pub(super) enum Kind {
    /// Every row with everything else.
    Grid(Vec<Vec<Value>>),
    /// A row a sample.
    Sampled(Distribution),
}
