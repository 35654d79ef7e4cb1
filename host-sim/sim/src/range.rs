//! Values outside their range.

use std::ops::RangeInclusive;

/// A value outside its range, or NaN.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{field} = {value}{space}{unit} is outside {min} to {max}{space}{unit}", space = if unit.is_empty() { "" } else { " " })]
pub struct RangeError {
    /// The field, with the table that it is in.
    pub field: String,
    /// Its value.
    pub value: f64,
    /// The least value allowed.
    pub min: f64,
    /// The largest value allowed.
    pub max: f64,
    /// The unit of all three; empty for a number without one.
    pub unit: &'static str,
}

impl RangeError {
    /// The same of a field in a table.
    #[must_use]
    pub fn within(mut self, table: &str) -> Self {
        self.field = format!("{table}.{}", self.field);
        self
    }
}

/// Refuses a value outside `range`, and NaN.
///
/// # Errors
/// Field, value, range and unit.
pub fn in_range(
    field: &str,
    value: f64,
    range: RangeInclusive<f64>,
    unit: &'static str,
) -> Result<(), RangeError> {
    if range.contains(&value) {
        return Ok(());
    }
    Err(RangeError {
        field: field.into(),
        value,
        min: *range.start(),
        max: *range.end(),
        unit,
    })
}
