//! `NAME=CHANNEL`: which channel of a file is a column of a log.

use haptic_log::near::did_you_mean;
use haptic_log::recording::Term;

use super::{LogError, NAMES};

/// Which channel of a file is a column of a log: `NAME=CHANNEL`, `NAME=CHANNEL [unit]` or `NAME=CHANNEL*FACTOR`.
#[derive(Debug, Clone, PartialEq)]
pub struct Mapping {
    pub(super) column: usize,
    pub(super) term: Term,
}

impl std::str::FromStr for Mapping {
    type Err = LogError;

    fn from_str(text: &str) -> Result<Self, LogError> {
        let refuse = |what: String| LogError::in_file(format_args!("map {text}"), what);
        let Some((name, channel)) = text.split_once('=') else {
            return Err(refuse(
                "NAME=CHANNEL, NAME=CHANNEL [unit] or NAME=CHANNEL*FACTOR is wanted".into(),
            ));
        };
        let column = NAMES.iter().position(|column| *column == name.trim());
        let column = column.ok_or_else(|| {
            let near = did_you_mean(name.trim(), NAMES);
            refuse(format!("{name:?} is none of {}{near}", NAMES.join(", ")))
        })?;
        let term = channel.parse();
        Ok(Self {
            column,
            term: term.map_err(|e: haptic_log::recording::RecordingError| refuse(e.to_string()))?,
        })
    }
}
