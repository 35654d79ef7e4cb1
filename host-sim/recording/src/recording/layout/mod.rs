//! Layouts: what the columns of somebody else's recordings are, as a file says it.
//!
//! A layout is TOML (`host-sim/recording/layouts/`, or a user's own). Its columns are sums of channels times numbers. Columns
//! `offset_m` (of the lane's centre, left positive, beside the vehicle) and `curvature_1pm` stand for the driver's two points;
//! `shared` is above 0.5 where an automation steers too. Other names serve the layout's own checks. What those find is refused or
//! left out here; the rest is a log's columns, which are read and checked as any others.

mod checks;
mod points;

use std::collections::BTreeMap;
use std::fmt;

use haptic_log::formats::{self, Contents, Format, Reading};
use haptic_log::near::did_you_mean;
use haptic_log::notes::Note;
use haptic_log::recording::{Group, Recording, Series, Term};
use haptic_log::units;
use serde::Deserialize;

use super::super::bus_trace;
use super::{DriveLog, LogError, Mapping, NAMES, SPEED_COLUMN, UNITS, of_channels, refuse};
use checks::counted;
use points::{SLOPE_S, slopes, two_points};

pub use points::{Signals, Table};

const BUILT_IN: [(&str, &str); 5] = [
    ("openlka", include_str!("../../../layouts/openlka.toml")),
    ("openpilot", include_str!("../../../layouts/openpilot.toml")),
    ("sadc", include_str!("../../../layouts/sadc.toml")),
    ("udacity", include_str!("../../../layouts/udacity.toml")),
    (
        "cognitive-driver-model",
        include_str!("../../../layouts/cognitive-driver-model.toml"),
    ),
];

/// Less driving than this is refused, s.
const LEAST_S: f64 = 10.0;
/// What the recordings of one source hold.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Layout {
    /// Its name: the built-in one, or the file's.
    #[serde(skip)]
    pub name: String,
    /// Where the recordings can be had.
    pub source: String,
    /// Under which licence.
    pub licence: String,
    /// The commit of the source that it was tried on; none: untested.
    pub tried_on: Option<String>,
    /// How many folders up from a recording the one is that is named after its vehicle; none: the one that it lies in.
    pub vehicle_folder: Option<usize>,
    /// What a reader of the estimates has to know.
    note: Option<String>,
    /// What the recordings lack, so that nobody can be identified from them.
    missing: Option<String>,
    /// The headings of a table without any.
    #[serde(default)]
    headings: Vec<String>,
    columns: BTreeMap<String, String>,
    /// Channels that must not be used, and why.
    #[serde(default)]
    never: BTreeMap<String, String>,
    /// Ranges of columns; rows outside are left out.
    #[serde(default)]
    keep: BTreeMap<String, [f64; 2]>,
    #[serde(default)]
    limits: BTreeMap<String, Limit>,
    #[serde(default)]
    slopes: Vec<Slope>,
}

/// A range that every value of a column has.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Limit {
    range: [f64; 2],
    why: String,
}

/// A range of the slope of one column on another.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Slope {
    of: String,
    on: String,
    range: [f64; 2],
    why: String,
}

impl Layout {
    /// The built-in layout of a name, or that in the file of a name that ends in `.toml`.
    ///
    /// # Errors
    /// No such name or file; a file that is no layout.
    pub fn named(name: &str) -> Result<Self, LogError> {
        let refused = |why: &dyn fmt::Display| LogError::in_file(format_args!("layout {name}"), why);
        let built_in = BUILT_IN.iter().find(|(known, _)| *known == name);
        let text = match built_in {
            Some((_, text)) => (*text).to_owned(),
            None if name.ends_with(".toml") => std::fs::read_to_string(name).map_err(|e| refused(&e))?,
            None => {
                let known = BUILT_IN.map(|(known, _)| known);
                let near = did_you_mean(name, known);
                let known = known.join(", ");
                return Err(refused(&format_args!(
                    "one of {known}, or a file NAME.toml is wanted{near}"
                )));
            }
        };
        let layout: Self = toml::from_str(&text).map_err(|e| refused(&e))?;
        Ok(Self {
            name: name.into(),
            ..layout
        })
    }

    /// All that are built in.
    ///
    /// # Errors
    /// As [`Layout::named`]; never for the files that are tested.
    pub fn built_in() -> Result<Vec<Self>, LogError> {
        BUILT_IN.iter().map(|(name, _)| Self::named(name)).collect()
    }

    /// Whether a file has all channels of this layout.
    #[must_use]
    pub fn fits(&self, bytes: &[u8], format: Option<Format>, maps: &[Mapping]) -> bool {
        self.table(bytes, format, maps).is_ok()
    }

    /// The log in a file's bytes: of the stretches by hand, or of those shared with an automation.
    pub(super) fn read(
        &self,
        bytes: &[u8],
        format: Option<Format>,
        maps: &[Mapping],
        how: &bus_trace::Recording<'_>,
    ) -> Result<(DriveLog, Vec<String>), LogError> {
        let Signals {
            time_s,
            columns: mut table,
            notes: left_out,
        } = self.signals(bytes, format, maps)?;
        let (dt_s, seconds) = step_of(&time_s);
        if let Some(speed) = table.get(SPEED_COLUMN) {
            let rate = slopes(speed, dt_s);
            two_points(&mut table, dt_s);
            table.insert("speed_rate".into(), rate);
        }
        let renewed_s = table.get("offset_m").map_or(0.0, |lane| renewed_s(lane, dt_s));
        let causes = self.causes(&time_s, &table, how.manual);
        let is_free: Vec<bool> = causes.iter().map(Option::is_none).collect();
        self.slopes_agree(&table, &is_free)?;
        let findings = counted(&causes, dt_s);
        let used_s = dt_s * is_free.iter().filter(|free| **free).count() as f64;
        if used_s < LEAST_S {
            let list: Vec<String> = findings.iter().map(|f| format!("{} {}", f[0], f[1])).collect();
            return refuse(format!(
                "{used_s:.1} s of {seconds:.1} s are left, less than {LEAST_S} s; left out: {}",
                list.join(", ")
            ));
        }
        let channels = NAMES.iter().zip(UNITS).skip(1).filter_map(|(name, unit)| {
            let mut values = table.remove(*name)?;
            for (value, free) in values.iter_mut().zip(&is_free) {
                if !free {
                    *value = f64::NAN;
                }
            }
            Some(Series {
                name: (*name).into(),
                unit: unit.into(),
                source: self.name.clone(),
                values,
            })
        });
        let group = Group::new(time_s, channels.collect());
        let (mut log, mut notes) = of_channels(Recording::of(group), &[], how)?;
        log.approximate_points = self.columns.contains_key("curvature_1pm");
        log.findings.extend(left_out.iter().map(Note::finding));
        log.findings.extend(findings);
        notes.push(format!("Layout {}; {}, {}", self.name, self.source, self.licence));
        notes.extend(self.note.clone());
        if renewed_s > SLOPE_S {
            notes.push(format!(
                "The lane is new every {renewed_s:.1} s only, and held in between: e_y is as old as that"
            ));
        }
        if self.tried_on.is_none() {
            notes.push(format!("Layout {} is untested: no file could be had", self.name));
        }
        Ok((log, notes))
    }

    /// The time and the columns of a file's bytes, every row, within the limits.
    ///
    /// # Errors
    /// A file that has not these columns, that lacks what the layout says, or whose values or time are out of their range.
    pub fn signals(
        &self,
        bytes: &[u8],
        format: Option<Format>,
        maps: &[Mapping],
    ) -> Result<Signals, LogError> {
        let signals = self.table(bytes, format, maps)?;
        let time_s = &signals.time_s;
        let (_, seconds) = step_of(time_s);
        self.within_limits(&signals.columns)?;
        if let Some(missing) = &self.missing {
            let rows = time_s.len();
            return refuse(format!(
                "{rows} rows of {seconds:.1} s are read, but {} recordings lack {missing}: no driver can be identified",
                self.name
            ));
        }
        if let Some(k) = time_s.windows(2).position(|w| w[1].is_nan() || w[1] <= w[0]) {
            let (from, to) = (time_s[k], time_s[k + 1]);
            return refuse(format!(
                "row {}: the time goes from {from} to {to}: it must grow",
                k + 2
            ));
        }
        Ok(signals)
    }

    /// Its columns, with what can be computed of them, as a recording.
    ///
    /// # Errors
    /// As [`Layout::signals`].
    pub fn recording(
        &self,
        bytes: &[u8],
        format: Option<Format>,
        maps: &[Mapping],
    ) -> Result<Recording, LogError> {
        let Signals {
            time_s,
            columns: mut table,
            notes,
        } = self.signals(bytes, format, maps)?;
        two_points(&mut table, step_of(&time_s).0);
        let channels = table.into_iter().map(|(name, values)| Series {
            unit: units::of_name(&name).unwrap_or_default().into(),
            source: self.name.clone(),
            name,
            values,
        });
        Ok(Recording {
            notes,
            ..Recording::of(Group::new(time_s, channels.collect()))
        })
    }

    /// The time and the columns, those mapped by the caller in place of the layout's.
    fn table(&self, bytes: &[u8], format: Option<Format>, maps: &[Mapping]) -> Result<Signals, LogError> {
        let mut columns: BTreeMap<&str, Vec<Term>> = BTreeMap::new();
        for (name, text) in &self.columns {
            let terms = text.split(" + ").map(str::parse).collect::<Result<_, _>>();
            let terms = terms.map_err(|e: haptic_log::recording::RecordingError| {
                format!("layout {}: {name} = {text:?}: {e}", self.name)
            })?;
            columns.insert(name, terms);
        }
        for map in maps {
            if let Some(why) = self.never.get(&map.term.channel) {
                return refuse(format!("channel {}: {why}", map.term.channel));
            }
            columns.insert(NAMES[map.column], vec![map.term.clone()]);
        }
        let times = columns.remove("time_s").unwrap_or_default();
        let [time] = &times[..] else {
            return refuse(format!(
                "layout {}: time_s is not given; --time CHANNEL*FACTOR",
                self.name
            ));
        };
        let mut whole = self.headings.join(",").into_bytes();
        if !whole.is_empty() {
            whole.push(b'\n');
        }
        whole.extend_from_slice(bytes);
        let named = |name: &str, term: &Term| term.channel == name || units::bare(&term.channel) == name;
        let is_wanted = |name: &str| {
            named(name, time)
                || columns
                    .values()
                    .flatten()
                    .any(|term| named(name, term) || named(units::bare(name), term))
        };
        let reading = Reading {
            time: Some(time),
            only: Some(&is_wanted),
        };
        let contents = formats::read_bytes(whole, format.unwrap_or(Format::Csv), reading);
        let Contents::Channels(recording) = contents? else {
            return refuse("a table is wanted, this is a recording of the bus");
        };
        let mut table = Table::new();
        for (name, terms) in columns {
            let mut sum = Vec::new();
            for term in terms {
                let (_, series) = recording.find(&term.channel)?;
                let factor = match units::of_name(name) {
                    Some(unit) => term.factor(series, unit)?,
                    None => term.factor.unwrap_or(1.0),
                };
                sum.resize(series.values.len(), 0.0);
                for (sum, value) in sum.iter_mut().zip(&series.values) {
                    *sum += factor * value;
                }
            }
            table.insert(name.into(), sum);
        }
        if let Some(kmh) = table.remove("speed_kmh") {
            table.insert(SPEED_COLUMN.into(), kmh.iter().map(|v| v / 3.6).collect());
        }
        let group = recording.groups.into_iter().next().unwrap_or_default();
        Ok(Signals {
            time_s: group.time_s,
            columns: table,
            notes: recording.notes,
        })
    }
}

/// The mean time between two rows, and of all, s.
fn step_of(time_s: &[f64]) -> (f64, f64) {
    let seconds = time_s.last().zip(time_s.first()).map_or(0.0, |(b, a)| b - a);
    (seconds / time_s.len().saturating_sub(1).max(1) as f64, seconds)
}

/// How long a signal keeps a value, s: the mean.
fn renewed_s(signal: &[f64], dt_s: f64) -> f64 {
    let values = signal.chunk_by(|a, b| a == b).count();
    dt_s * signal.len() as f64 / values.max(1) as f64
}

#[cfg(test)]
mod tests;
