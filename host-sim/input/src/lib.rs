//! Input that a person wrote (course, scenario, options), and what is wrong with it; and [`mod@fields`], the lists of what tables
//! may hold. Text in, values out: no file, no thread, no clock.

pub mod fields;
mod range;

use std::fmt::Display;

use serde::de::DeserializeOwned;

pub use crate::range::{RangeError, in_range};

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
            // The parser ends its messages with a line break.
            message: message.to_string().trim_end().to_string(),
        }
    }
}

/// What a TOML text says.
///
/// # Errors
/// Line, column and what is wrong there: syntax, an unknown field, a value of the wrong kind; that the file is one of another
/// kind, where it is.
pub fn parse_toml<T: DeserializeOwned>(name: &str, text: &str) -> Result<T, InputError> {
    toml::from_str(text).map_err(|e| {
        // The parser speaks of Rust's types; whoever wrote the file need not know them.
        let message = e
            .to_string()
            .replace("expected f64", "expected a number")
            .replace("expected u64", "expected a whole number, 0 or more")
            .replace("expected path string", "expected a string");
        match other_kind::<T>(text) {
            Some(hint) => InputError::new(name, hint),
            None => InputError::new(name, with_near(message)),
        }
    })
}

/// How alike two names are, 0 to 1, that one of them may be the other mistyped.
const ALIKE: f64 = 0.75;

/// Behind a name that is none of those that are known: `; did you mean NAME?` if one is like it, else nothing.
#[must_use]
pub fn did_you_mean<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    let lower = name.to_lowercase();
    let alike = known
        .into_iter()
        .map(|known| (known, strsim::jaro_winkler(&lower, known)));
    let best = alike.max_by(|a, b| a.1.total_cmp(&b.1));
    match best.filter(|(_, alike)| *alike >= ALIKE) {
        Some((near, _)) => format!("; did you mean {near}?"),
        None => String::new(),
    }
}

/// A message of the parser, with the name that is meant behind the list of those that are known.
fn with_near(message: String) -> String {
    let near = ["unknown field `", "unknown variant `"].iter().find_map(|begin| {
        let (name, rest) = message.split_once(begin)?.1.split_once('`')?;
        // The names that it expects stand between backticks, other words between these.
        let near = did_you_mean(name, rest.split('`').skip(1).step_by(2));
        (!near.is_empty()).then_some(near)
    });
    message.trim_end().to_owned() + &near.unwrap_or_default()
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
    // Only the parser knows which fields T has: it is asked with the field alone.
    let refusal = toml::from_str::<T>(&format!("{field} = 0")).err()?;
    refusal
        .message()
        .starts_with(&format!("unknown field `{field}`"))
        .then(|| format!("this is {kind} (it has `{field}`)"))
}
