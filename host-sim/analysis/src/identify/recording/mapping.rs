//! `NAME=CHANNEL*SCALE`: which channel of a file is a column of a log.

use super::{LogError, NAMES};

/// Which channel of a file is a column of a log: `NAME=CHANNEL` or `NAME=CHANNEL*SCALE`.
#[derive(Debug, Clone, PartialEq)]
pub struct Mapping {
    pub(super) column: usize,
    pub(super) channel: String,
    pub(super) scale: Option<f64>,
}

impl std::str::FromStr for Mapping {
    type Err = LogError;

    fn from_str(text: &str) -> Result<Self, LogError> {
        let refuse = |what: String| LogError::in_file(format_args!("map {text}"), what);
        let Some((name, channel)) = text.split_once('=') else {
            return Err(refuse("NAME=CHANNEL or NAME=CHANNEL*SCALE is wanted".into()));
        };
        let column = NAMES.iter().position(|column| *column == name.trim());
        let column = column.ok_or_else(|| refuse(format!("{name:?} is none of {}", NAMES.join(", "))))?;
        let (channel, scale) = match channel.rsplit_once('*') {
            Some((channel, scale)) => {
                let scale: Option<f64> = scale.trim().parse().ok();
                let scale = scale.filter(|s| s.is_finite() && *s != 0.0);
                (
                    channel,
                    Some(scale.ok_or_else(|| refuse("the scale is no number other than 0".into()))?),
                )
            }
            None => (channel, None),
        };
        if channel.trim().is_empty() {
            return Err(refuse("the channel has no name".into()));
        }
        Ok(Self {
            column,
            channel: channel.trim().into(),
            scale,
        })
    }
}
