//! A recorded drive from any format: which channel of a file is which column of a log, and in which unit.
//!
//! A column is the channel of its own name unless a [`Mapping`] names another. A channel's unit is converted where the file
//! says it, or taken as said by a scale; what cannot be converted is refused. Channels of one table are taken row by
//! row and checked as a CSV file's are. Channels with instants of their own are put on an even grid at the pace of the
//! driver torque first: T_h as held, the others on the line between their neighbours.

use std::path::Path;

use haptic_log::formats::{self, Contents, Format, TimeColumn};
use haptic_log::recording::{Group, Recording, Series};
use haptic_log::units;

use super::bus_trace;
use super::log::{COLUMNS, DriveLog, LogError};

const UNITS: [&str; 6] = ["s", "m", "rad", "rad", "N.m", "N.m"];
const GUIDANCE: usize = 4;
const DRIVER: usize = 5;
/// Longest pause of a channel that has instants of its own, in its usual periods.
const LONGEST_PAUSE: f64 = 3.5;

/// Which channel of a file is a column of a log: `NAME=CHANNEL` or `NAME=CHANNEL*SCALE`.
#[derive(Debug, Clone, PartialEq)]
pub struct Mapping {
    column: usize,
    channel: String,
    scale: Option<f64>,
}

impl std::str::FromStr for Mapping {
    type Err = LogError;

    fn from_str(text: &str) -> Result<Self, LogError> {
        let refuse = |what: String| LogError::new(format!("--map {text}: {what}"));
        let Some((name, channel)) = text.split_once('=') else {
            return Err(refuse("NAME=CHANNEL or NAME=CHANNEL*SCALE is wanted".into()));
        };
        let column = COLUMNS.iter().position(|column| *column == name.trim());
        let column = column.ok_or_else(|| refuse(format!("{name:?} is none of {}", COLUMNS.join(", "))))?;
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

/// Reads the log at `path`: a CSV file, a recording of the bus, or a file of another tool by its extension; `dbc` says what the
/// frames of a bus mean, if it is not the product's own file. The sentences say what was converted or computed.
///
/// # Errors
/// As [`DriveLog::open`], with the channel; a column that is mapped twice.
pub fn open(
    path: &Path,
    maps: &[Mapping],
    how: &bus_trace::Recording<'_>,
) -> Result<(DriveLog, Vec<String>), LogError> {
    let manual = how.manual;
    let named = |e: String| LogError::new(format!("{}: {e}", path.display()));
    for (i, map) in maps.iter().enumerate() {
        if maps[..i].iter().any(|other| other.column == map.column) {
            return Err(LogError::new(format!(
                "--map {} is given twice",
                COLUMNS[map.column]
            )));
        }
    }
    // Text files keep their own readers: those name lines, and tell a table from a trace by its looks.
    let format = Format::of(path).ok();
    if maps.is_empty() && matches!(format, None | Some(Format::Csv | Format::Candump)) {
        let (log, note) = bus_trace::open_recording_with(path, how)?;
        return Ok((log, note.map(String::from).into_iter().collect()));
    }
    let time = maps.iter().find(|map| map.column == 0).map(|map| TimeColumn {
        name: map.channel.clone(),
        scale: map.scale,
    });
    match formats::read(path, time.as_ref()).map_err(|e| LogError::new(e.to_string()))? {
        Contents::Frames(frames) if maps.is_empty() => {
            let (log, note) = bus_trace::of_frames(&frames, how).map_err(named)?;
            Ok((log, vec![note.into()]))
        }
        Contents::Frames(frames) => {
            let dbc = bus_trace::dbc_text(how.dbc)?;
            let recording = formats::dbc::channels(&frames, &dbc).map_err(|e| named(e.to_string()))?;
            of_channels(&recording, maps, manual).map_err(named)
        }
        Contents::Channels(recording) => of_channels(&recording, maps, manual).map_err(named),
    }
}

/// A column's channel with what makes it SI.
struct Column<'a> {
    group: &'a Group,
    series: &'a Series,
    scale: f64,
}

fn of_channels(
    recording: &Recording,
    maps: &[Mapping],
    manual: bool,
) -> Result<(DriveLog, Vec<String>), String> {
    let mut notes = Vec::new();
    let mut columns: [Option<Column<'_>>; 6] = Default::default();
    for (i, column) in columns.iter_mut().enumerate().skip(1) {
        let map = maps.iter().find(|map| map.column == i);
        let name = map.map_or(COLUMNS[i], |map| map.channel.as_str());
        let (group, series) = match recording.find(name) {
            Ok(found) => found,
            Err(_) if manual && i == GUIDANCE && map.is_none() => continue,
            Err(error) if map.is_none() => {
                let wanted = COLUMNS[i];
                return Err(format!(
                    "{error}; --map {wanted}=CHANNEL[*SCALE] names another one"
                ));
            }
            Err(error) => return Err(error.to_string()),
        };
        let scale = match (map.and_then(|map| map.scale), series.unit.as_str()) {
            (Some(scale), _) => scale,
            (None, "") => 1.0,
            (None, unit) => units::factor(unit, UNITS[i]).ok_or_else(|| {
                let (wanted, name) = (UNITS[i], &series.name);
                format!("channel {name}: its unit {unit:?} is not known as one of {wanted}; --map {}={name}*SCALE says how \
                         many {wanted} it is", COLUMNS[i])
            })?,
        };
        if scale != 1.0 {
            notes.push(format!(
                "{} is {} ({:?}) times {scale}",
                COLUMNS[i], series.name, series.unit
            ));
        }
        *column = Some(Column { group, series, scale });
    }
    let one = columns
        .iter()
        .flatten()
        .all(|c| std::ptr::eq(c.group, columns[DRIVER].as_ref().map_or(c.group, |d| d.group)));
    let (time_s, values) = if one {
        rows(&columns)
    } else {
        on_a_grid(&columns, &mut notes)?
    };
    let log = DriveLog::from_rows(time_s, values, manual).map_err(|e| e.to_string())?;
    Ok((log, notes))
}

type Values = [Option<Vec<f64>>; 6];

/// The columns as the table has them.
fn rows(columns: &[Option<Column<'_>>; 6]) -> (Vec<f64>, Values) {
    let values = std::array::from_fn(|i| {
        let column = columns[i].as_ref()?;
        Some(column.series.values.iter().map(|v| v * column.scale).collect())
    });
    (
        columns
            .iter()
            .flatten()
            .next()
            .map_or(Vec::new(), |c| c.group.time_s.clone()),
        values,
    )
}

/// The columns at the pace of the driver torque, over the time that all cover.
fn on_a_grid(
    columns: &[Option<Column<'_>>; 6],
    notes: &mut Vec<String>,
) -> Result<(Vec<f64>, Values), String> {
    let mut groups = Vec::new();
    let mut rate_hz = 0.0;
    for (i, column) in columns.iter().enumerate() {
        let Some(column) = column else { continue };
        let name = &column.series.name;
        let course: Vec<(f64, f64)> = column
            .group
            .time_s
            .iter()
            .zip(&column.series.values)
            .filter(|(_, v)| !v.is_nan())
            .map(|(t, v)| (*t, v * column.scale))
            .collect();
        let mut steps: Vec<f64> = course.windows(2).map(|w| w[1].0 - w[0].0).collect();
        steps.sort_by(f64::total_cmp);
        let usual_s = steps.get(steps.len() / 2).copied().unwrap_or(0.0);
        if usual_s.is_nan() || usual_s <= 0.0 {
            return Err(format!(
                "channel {name}: it has {} values, too few, or no time that grows",
                course.len()
            ));
        }
        let pause = course
            .windows(2)
            .find(|w| !(0.0..=LONGEST_PAUSE * usual_s).contains(&(w[1].0 - w[0].0)));
        if let Some(w) = pause {
            let step = w[1].0 - w[0].0;
            return Err(format!(
                "channel {name}: a step of {step:.3} s at {:.3} s where {usual_s:.4} s is usual: cut the log there",
                w[0].0
            ));
        }
        if i == DRIVER {
            rate_hz = 1.0 / usual_s;
        }
        let (time_s, values) = course.into_iter().unzip();
        groups.push(Group {
            name: COLUMNS[i].into(),
            time_s,
            channels: vec![Series {
                name: COLUMNS[i].into(),
                values,
                ..Series::default()
            }],
        });
    }
    let held = |name: &str| name == COLUMNS[GUIDANCE];
    let grid = Recording { groups }
        .on_grid(rate_hz, held)
        .map_err(|e| e.to_string())?;
    notes.push(format!(
        "The channels have instants of their own: put on an even grid of {rate_hz:.1} Hz"
    ));
    let mut made: Values = Default::default();
    for channel in grid.channels {
        if let Some(i) = COLUMNS.iter().position(|name| *name == channel.name) {
            made[i] = Some(channel.values);
        }
    }
    Ok((grid.time_s, made))
}
