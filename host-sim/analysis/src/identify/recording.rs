//! A recorded drive from any format: which channel of a file is which column of a log, and in which unit.
//!
//! A column is the channel of its own name unless a [`Mapping`] names another. A channel's unit is converted where the file
//! says it, or taken as said by a scale; what cannot be converted is refused. Channels of one table are taken row by
//! row and checked as a CSV file's are. Channels with instants of their own are taken at those of the driver torque, whose
//! noise must stay as it is: T_h as held, and lane signals that are slower than the torque too, for a line between two
//! pictures would hide the camera's noise; the others on the line between their neighbours.

use std::path::Path;

use haptic_log::formats::{self, Contents, Format, TimeColumn};
use haptic_log::recording::{Group, Recording, Series};
use haptic_log::units;

use super::bus_trace;
use super::log::{COLUMNS, DriveLog, LogError, SPEED_COLUMN};

const UNITS: [&str; 6] = ["s", "m", "rad", "rad", "N.m", "N.m"];
const LANE: [usize; 2] = [1, 2];
const GUIDANCE: usize = 4;
const DRIVER: usize = 5;
/// A lane signal whose usual step is so many of the driver torque's is slower.
const SLOWER: f64 = 1.5;
/// Longest pause of a channel with instants of its own that is bridged here, in its usual periods.
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
        at_the_torque(&columns, &mut notes)?
    };
    let mut log = DriveLog::from_rows(time_s, values, manual).map_err(|e| e.to_string())?;
    tell_speed(&mut log, recording);
    Ok((log, notes))
}

/// What the recording says of the speed, if it does: not needed, so that another unit or name tells nothing.
fn tell_speed(log: &mut DriveLog, recording: &Recording) {
    let factor = |unit: &str| units::factor(if unit.is_empty() { "m/s" } else { unit }, "m/s");
    let found = recording.find(SPEED_COLUMN).ok();
    if let Some((speed, factor)) = found.and_then(|(_, speed)| Some((speed, factor(&speed.unit)?))) {
        let speeds: Vec<f64> = speed.values.iter().map(|v| v * factor).collect();
        log.tell_speed(&speeds);
    }
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

/// A column's values where it has any, and its usual step, s.
struct Course {
    time_s: Vec<f64>,
    values: Vec<f64>,
    usual_s: f64,
}

impl Course {
    fn of(column: &Column<'_>) -> Result<Self, String> {
        let (group, series) = (column.group, column.series);
        let known = group
            .time_s
            .iter()
            .zip(&series.values)
            .filter(|(_, v)| !v.is_nan());
        let (time_s, values): (Vec<f64>, Vec<f64>) = known.map(|(t, v)| (*t, v * column.scale)).unzip();
        let refuse = |what: String| Err(format!("channel {}: {what}", series.name));
        if let Some(w) = time_s.windows(2).find(|w| w[1].is_nan() || w[1] <= w[0]) {
            return refuse(format!("the time goes from {} to {} s: it must grow", w[0], w[1]));
        }
        let mut steps: Vec<f64> = time_s.windows(2).map(|w| w[1] - w[0]).collect();
        steps.sort_by(f64::total_cmp);
        match steps.get(steps.len() / 2) {
            Some(&usual_s) => Ok(Self {
                time_s,
                values,
                usual_s,
            }),
            None => refuse(format!("it has {} values, too few", values.len())),
        }
    }

    /// The values at rising instants, as held or on the line between neighbours; none in a pause and beyond the ends. Instants
    /// up to a microsecond before a value have it already, as clocks round.
    fn at(&self, instants_s: &[f64], held: bool) -> Vec<f64> {
        let (time_s, last) = (&self.time_s, self.time_s.len() - 1);
        let mut k = 0;
        let value = |t: f64| {
            while k < last && time_s[k + 1] <= t + 1e-6 {
                k += 1;
            }
            let (past, next) = (t - time_s[k], (k + 1).min(last));
            let step = time_s[next] - time_s[k];
            let longest = LONGEST_PAUSE * self.usual_s;
            if past < -1e-6 || past > longest || (past > 1e-6 && step > longest) {
                f64::NAN
            } else if held || next == k {
                self.values[k]
            } else {
                self.values[k] + (past / step).max(0.0) * (self.values[next] - self.values[k])
            }
        };
        instants_s.iter().copied().map(value).collect()
    }
}

/// The columns at the driver torque's instants, over the time that all cover.
fn at_the_torque(
    columns: &[Option<Column<'_>>; 6],
    notes: &mut Vec<String>,
) -> Result<(Vec<f64>, Values), String> {
    let mut courses: [Option<Course>; 6] = Default::default();
    for (course, column) in courses.iter_mut().zip(columns) {
        *course = column.as_ref().map(Course::of).transpose()?;
    }
    let all = || courses.iter().flatten();
    let from = all().map(|c| c.time_s[0]).fold(f64::NEG_INFINITY, f64::max);
    let to = all()
        .map(|c| c.time_s[c.time_s.len() - 1])
        .fold(f64::INFINITY, f64::min);
    let torque = courses[DRIVER].as_ref().map_or(&[][..], |c| &c.time_s);
    let instants: Vec<f64> = torque
        .iter()
        .copied()
        .filter(|t| (from..=to).contains(t))
        .collect();
    if instants.is_empty() {
        return Err("the channels have no time in common".to_owned());
    }
    let pace_s = courses[DRIVER].as_ref().map_or(0.0, |c| c.usual_s);
    notes.push(format!(
        "The channels have instants of their own: taken at those of {}, one in {:.4} s",
        columns[DRIVER].as_ref().map_or("", |c| c.series.name.as_str()),
        pace_s
    ));
    let values = std::array::from_fn(|i| {
        let course = courses[i].as_ref()?;
        let is_slow_lane = LANE.contains(&i) && course.usual_s > SLOWER * pace_s;
        Some(course.at(&instants, i == GUIDANCE || is_slow_lane))
    });
    Ok((instants, values))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A channel in a group of its own: `count` values, one each `period_s` from `start_s` on.
    fn group(name: &str, unit: &str, start_s: f64, period_s: f64, value: impl Fn(usize) -> f64) -> Group {
        let count = (12.0 / period_s) as usize;
        Group {
            name: name.into(),
            time_s: (0..count).map(|k| start_s + period_s * k as f64).collect(),
            channels: vec![Series {
                name: name.into(),
                unit: unit.into(),
                source: String::new(),
                values: (0..count).map(value).collect(),
            }],
        }
    }

    #[test]
    fn a_slow_camera_is_held_and_a_slow_angle_is_not() {
        let zigzag = |k: usize| [0.2, -0.2][k % 2];
        let recording = Recording {
            groups: vec![
                group("Torque", "N.m", 0.0, 0.01, zigzag),
                group("Angle", "rad", 0.0, 0.04, |k| 0.01 * k as f64),
                group("Assist", "N.m", 0.0, 0.04, |k| 0.01 * k as f64),
                group("Offset", "cm", 0.0, 0.04, |k| 100.0 * zigzag(k)),
                group("Heading", "rad", 0.0, 0.01, zigzag),
                group(SPEED_COLUMN, "km/h", 0.0, 0.01, |k| 36.0 + 0.09 * k as f64),
            ],
        };
        let map = |text: &str| text.parse::<Mapping>().unwrap();
        let maps = [
            "driver_torque_nm=Torque",
            "wheel_angle_rad=Angle",
            "guidance_torque_nm=Assist",
            "e_y_m=Offset",
            "e_theta_rad=Heading",
        ]
        .map(map);
        let (log, _) = of_channels(&recording, &maps, false).unwrap();
        assert!((log.dt_s - 0.01).abs() < 1e-12, "{}", log.dt_s);
        let [least, most] = log.speeds_m_per_s.unwrap();
        assert!((least - 10.0).abs() < 1e-9 && (most - 39.975).abs() < 1e-9 && log.changes_speed());
        for k in 0..800 {
            let near =
                |value: f64, wanted: f64| assert!((value - wanted).abs() < 1e-9, "{k}: {value} {wanted}");
            // Each picture with its own noise, and no value that no picture had.
            near(log.e_y_m[k], zigzag(k / 4));
            near(log.guidance_torque_nm[k], 0.01 * (k / 4) as f64);
            near(log.wheel_angle_rad[k], 0.01 * k as f64 / 4.0);
            // As quick as the torque: value for value.
            near(log.e_theta_rad[k], zigzag(k));
            near(log.driver_torque_nm[k], zigzag(k));
        }
    }
}
