//! A recording as one table of channels, whatever file it came from: each has a name, a unit, a source and the instants of
//! its values.
//!
//! Channels that share their instants are a [`Group`]. A CSV file has one group, a bus one for each message. Not here: what
//! the channels mean.

mod chosen;
pub mod grid;
mod stamps;
mod term;

use serde::Serialize;

use crate::notes::Notes;
use crate::trace::{CHANNELS, Trace};
use crate::units;
pub use stamps::Lines;
pub use term::Term;

/// A channel of a recording.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Series {
    /// Its name in the file.
    pub name: String,
    /// Its unit; empty if the file does not say.
    pub unit: String,
    /// Who measured or sent it; empty if the file does not say.
    pub source: String,
    /// Its values; NaN where there is none.
    pub values: Vec<f64>,
}

/// Channels with the same instants.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Group {
    /// Name of the group: a message, or nothing.
    pub name: String,
    /// The instants, s.
    pub time_s: Vec<f64>,
    /// The channels, each with as many values as there are instants.
    pub channels: Vec<Series>,
    /// Where the rows stand, of a text.
    pub lines: Lines,
}

/// Everything that a file holds.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Recording {
    /// The groups, in the order of the file.
    pub groups: Vec<Group>,
    /// Names of channels that nobody asked for, and that were not read.
    pub unread: Vec<String>,
    /// What the file holds that the groups do not.
    pub notes: Notes,
}

/// Why a recording was refused: one sentence with channel and reason, and the file where one is known.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct RecordingError(pub(crate) String);

impl RecordingError {
    /// One sentence to print, whatever a damaged file calls its channels.
    #[cfg(feature = "formats")]
    pub(crate) fn printable(self) -> Self {
        const LONGEST: usize = 400;
        let plain = self.0.chars().take(LONGEST);
        Self(plain.map(|c| if c.is_control() { '?' } else { c }).collect())
    }
}

impl<T: Into<String>> From<T> for RecordingError {
    fn from(sentence: T) -> Self {
        Self(sentence.into())
    }
}

/// A refusal in the words of another error.
#[cfg(feature = "formats")]
pub(crate) fn refuse(e: impl std::fmt::Display) -> RecordingError {
    RecordingError(e.to_string())
}

/// A line of the table of channels.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Line {
    /// Name of the channel.
    pub name: String,
    /// Its unit; empty if unknown.
    pub unit: String,
    /// Its source; empty if unknown.
    pub source: String,
    /// Values a second, in the mean; 0 for fewer than two.
    pub sample_rate_hz: f64,
    /// Values that are there.
    pub samples: usize,
}

impl Group {
    /// A group without a name.
    #[must_use]
    pub fn new(time_s: Vec<f64>, channels: Vec<Series>) -> Self {
        Self {
            time_s,
            channels,
            ..Self::default()
        }
    }

    /// Values a second, in the mean over the group's instants.
    #[must_use]
    pub fn sample_rate_hz(&self) -> f64 {
        let span_s = self
            .time_s
            .last()
            .zip(self.time_s.first())
            .map_or(0.0, |(b, a)| b - a);
        rate_hz(self.time_s.len(), span_s)
    }

    /// The first instant that is not after the one before it.
    #[must_use]
    pub fn step_back(&self) -> Option<usize> {
        self.time_s
            .windows(2)
            .position(|w| w[1].is_nan() || w[0].is_nan() || w[1] <= w[0])
    }
}

pub(crate) fn rate_hz(samples: usize, span_s: f64) -> f64 {
    if span_s > 0.0 {
        (samples - 1) as f64 / span_s
    } else {
        0.0
    }
}

impl Recording {
    /// A recording of one group.
    #[must_use]
    pub fn of(group: Group) -> Self {
        vec![group].into()
    }

    /// Every channel with its group.
    fn channels(&self) -> impl Iterator<Item = (&Group, &Series)> {
        self.groups
            .iter()
            .flat_map(|g| g.channels.iter().map(move |c| (g, c)))
    }

    /// The name of a channel, with that of its group where another channel has it too.
    fn name(&self, group: &Group, channel: &Series) -> String {
        match self.channels().filter(|(_, c)| c.name == channel.name).count() {
            2.. if !group.name.is_empty() => format!("{}.{}", group.name, channel.name),
            _ => channel.name.clone(),
        }
    }

    /// The table of channels.
    #[must_use]
    pub fn table(&self) -> Vec<Line> {
        let line = |(group, channel): (&Group, &Series)| {
            let is_there = |k: &usize| !channel.values[*k].is_nan();
            let mut there = (0..channel.values.len()).filter(is_there);
            let first = there.next();
            let ends = first.zip(there.next_back());
            let samples = there.count() + usize::from(first.is_some()) + usize::from(ends.is_some());
            let span_s = ends.map_or(0.0, |(first, last)| group.time_s[last] - group.time_s[first]);
            Line {
                name: self.name(group, channel),
                unit: channel.unit.clone(),
                source: channel.source.clone(),
                sample_rate_hz: rate_hz(samples, span_s),
                samples,
            }
        };
        self.channels().map(line).collect()
    }

    /// The channel of a name, or of a group's name, a point and a name; with or without its unit in brackets behind it.
    ///
    /// # Errors
    /// There is none, with the names that come near; there are several.
    pub fn find(&self, name: &str) -> Result<(&Group, &Series), RecordingError> {
        let named = |wanted: &str| -> Vec<(&Group, &Series)> {
            let is_it =
                |(g, c): &(&Group, &Series)| c.name == wanted || format!("{}.{}", g.name, c.name) == wanted;
            self.channels().filter(is_it).collect()
        };
        let mut found = named(name);
        if found.is_empty() {
            found = named(units::bare(name));
        }
        if found.is_empty() {
            found = self
                .channels()
                .filter(|(_, c)| units::bare(&c.name) == name)
                .collect();
        }
        if found.is_empty() {
            let bare = units::bare(name);
            found = self
                .channels()
                .filter(|(_, c)| c.name.eq_ignore_ascii_case(bare))
                .collect();
        }
        match found[..] {
            [found] => Ok(found),
            [] => Err(self
                .notes
                .left_out(units::bare(name))
                .unwrap_or_else(|| format!("there is no channel {name}{}", self.near(name)))
                .into()),
            [(first, a), (second, b), ..] if std::ptr::eq(first, second) && a.name == b.name => {
                Err(format!("channel {name} is there twice").into())
            }
            [(first, a), (second, b), ..] if std::ptr::eq(first, second) => Err(format!(
                "channel {name} is there twice, as {} and as {}: say which",
                a.name, b.name
            )
            .into()),
            [(first, _), (second, _), ..] => Err(format!(
                "channel {name} is there in groups {:?} and {:?}: say which, as GROUP.{name}",
                first.name, second.name
            )
            .into()),
        }
    }

    /// Names that differ from this one in the last part, where units stand, or at least have its first part.
    #[must_use]
    pub fn like(&self, name: &str) -> Vec<&str> {
        let lower = name.to_lowercase();
        let (stem, _) = lower.rsplit_once('_').unwrap_or((&lower, ""));
        let first = lower
            .split(['_', '.', ' '])
            .next()
            .filter(|first| first.len() > 2);
        let having = |part: &str| -> Vec<&str> {
            let is_it = |own: &&str| own.to_lowercase().contains(part);
            self.names().filter(is_it).collect()
        };
        let like = having(stem);
        match first {
            Some(first) if like.is_empty() => having(first),
            _ => like,
        }
    }

    fn names(&self) -> impl Iterator<Item = &str> {
        let read = self.channels().map(|(_, c)| c.name.as_str());
        read.chain(self.unread.iter().map(String::as_str))
    }

    fn near(&self, name: &str) -> String {
        let like = self.like(name);
        let (said, shown) = match like.is_empty() {
            false => ("near are", like),
            true => ("there are", self.names().collect()),
        };
        if shown.is_empty() {
            return "; there is none at all".into();
        }
        let dots = if shown.len() > 8 { ", .." } else { "" };
        format!("; {said} {}{dots}", shown[..shown.len().min(8)].join(", "))
    }

    /// Says of the product's own channels what a file did not say: unit and source.
    #[must_use]
    pub fn described(mut self) -> Self {
        for channel in self.groups.iter_mut().flat_map(|g| &mut g.channels) {
            if let Some(own) = CHANNELS.iter().find(|own| own.name == channel.name) {
                if channel.unit.is_empty() {
                    channel.unit = own.unit.to_owned();
                }
                if channel.source.is_empty() {
                    channel.source = own.source.to_string();
                }
            } else if channel.unit.is_empty() {
                let in_brackets = units::in_brackets(&channel.name).map(|(_, unit)| unit);
                let known = in_brackets.filter(|unit| units::is_known(unit));
                let unit = known.or_else(|| units::of_name(&channel.name));
                channel.unit = unit.unwrap_or_default().to_owned();
            }
        }
        self
    }
}

impl From<Vec<Group>> for Recording {
    fn from(groups: Vec<Group>) -> Self {
        Self {
            groups,
            ..Self::default()
        }
    }
}

impl From<&Trace> for Recording {
    fn from(trace: &Trace) -> Self {
        let channels = trace.channels().skip(1).map(|channel| Series {
            name: channel.name.into(),
            unit: channel.unit.into(),
            source: channel.source.to_string(),
            values: trace.samples.iter().map(channel.value).collect(),
        });
        let time_s = trace.samples.iter().map(|sample| sample.time_s).collect();
        Self::of(Group::new(time_s, channels.collect()))
    }
}
