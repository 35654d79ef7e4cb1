//! Input that a person wrote (course, scenario, options), and what is wrong with it.

use std::fmt::{self, Display};
use std::ops::RangeInclusive;

use serde::de::DeserializeOwned;

/// Bad input: which file or option, and what is wrong with it. Never a fault of the program.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InputError {
    source: String,
    message: String,
}

impl InputError {
    /// `source` names the file or option, `message` the field, its value and its range.
    pub fn new(source: impl Display, message: impl Display) -> Self {
        Self {
            source: source.to_string(),
            message: message.to_string().trim_end().to_string(),
        }
    }
}

impl Display for InputError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.source, self.message)
    }
}

impl std::error::Error for InputError {}

/// What a TOML text says.
///
/// # Errors
/// Line, column and what is wrong there: syntax, an unknown field, a value of the wrong kind.
pub fn parse_toml<T: DeserializeOwned>(name: &str, text: &str) -> Result<T, InputError> {
    toml::from_str(text).map_err(|e| {
        // The parser speaks of Rust's types; whoever wrote the file need not know them.
        let message = e
            .to_string()
            .replace("expected f64", "expected a number")
            .replace("expected u64", "expected a whole number, 0 or more")
            .replace("expected path string", "expected a string");
        InputError::new(name, message)
    })
}

/// Refuses a value outside `range`, and NaN, in a sentence that names field, value and range.
///
/// # Errors
/// The sentence, without the file.
pub fn in_range(field: &str, value: f64, range: RangeInclusive<f64>, unit: &str) -> Result<(), String> {
    if range.contains(&value) {
        return Ok(());
    }
    let unit = if unit.is_empty() {
        String::new()
    } else {
        format!(" {unit}")
    };
    Err(format!(
        "{field} = {value}{unit} is outside {} to {}{unit}",
        range.start(),
        range.end()
    ))
}
