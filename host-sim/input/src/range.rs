//! Values outside their range.

use std::fmt;
use std::ops::RangeInclusive;

use haptic_core::controller::params::WHOLE;

/// A value outside its range, or NaN.
#[derive(Debug, Clone, PartialEq)]
pub struct RangeError {
    /// The field, with the table that it is in.
    pub field: String,
    /// Its value.
    pub value: f64,
    /// The least value allowed.
    pub min: f64,
    /// The largest value allowed.
    pub max: f64,
    /// The unit of all three; empty for a number without one; [`WHOLE`] where only whole numbers are in the range.
    pub unit: &'static str,
}

impl fmt::Display for RangeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            field,
            value,
            min,
            max,
            unit,
        } = self;
        match *unit {
            WHOLE => write!(f, "{field} = {value} is not a whole number from {min} to {max}"),
            "" => write!(f, "{field} = {value} is outside {min} to {max}"),
            unit => write!(f, "{field} = {value} {unit} is outside {min} to {max} {unit}"),
        }
    }
}

impl std::error::Error for RangeError {}

impl RangeError {
    /// The error of a field in a table.
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
