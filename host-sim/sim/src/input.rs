//! Input that a person wrote (course, scenario, options), and what is wrong with it.

use std::fmt::Display;

use serde::de::DeserializeOwned;

use crate::fields::old_name;
pub use crate::range::{RangeError, in_range};
use crate::scenario::fields_of;

/// Bad input: which file or option, and what is wrong with it. Never a fault of the program.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{place}: {message}")]
pub struct InputError {
    place: String,
    message: String,
}

impl InputError {
    /// `place` names the file or option, `message` the field, its value and its range.
    pub fn new(place: impl Display, message: impl Display) -> Self {
        Self {
            place: place.to_string(),
            message: message.to_string().trim_end().to_string(),
        }
    }
}

/// What a TOML text says.
///
/// # Errors
/// Line, column and what is wrong there: syntax, an unknown field, a value of the wrong kind; that the file is one of another
/// kind, where it is; what a field of an old name is called.
pub fn parse_toml<T: DeserializeOwned>(name: &str, text: &str) -> Result<T, InputError> {
    toml::from_str(text).map_err(|e| {
        // The parser speaks of Rust's types; whoever wrote the file need not know them.
        let message = e
            .to_string()
            .replace("expected f64", "expected a number")
            .replace("expected u64", "expected a whole number, 0 or more")
            .replace("expected path string", "expected a string");
        match other_kind::<T>(text).or_else(|| old_name(text, fields_of)) {
            Some(hint) => InputError::new(name, hint),
            None => InputError::new(name, message),
        }
    })
}

/// A field that files of one kind alone have, and what those files are for.
const KINDS: [(&str, &str); 5] = [
    (
        "segment",
        "a course: a scenario names it with `course = \"FILE\"`",
    ),
    ("law", "a comparison of laws, for `host-sim compare`"),
    ("participant", "a study, for `host-sim study`"),
    ("vary", "a sweep, for `host-sim sweep`"),
    ("course", "a scenario, for `host-sim run`"),
];

/// What a file is for that has a field which files of this kind do not have.
fn other_kind<T: DeserializeOwned>(text: &str) -> Option<String> {
    let fields: toml::Table = toml::from_str(text).ok()?;
    let (field, kind) = KINDS.iter().find(|(field, _)| fields.contains_key(*field))?;
    let refusal = toml::from_str::<T>(&format!("{field} = 0")).err()?;
    refusal
        .message()
        .starts_with(&format!("unknown field `{field}`"))
        .then(|| format!("this is {kind} (it has `{field}`)"))
}
