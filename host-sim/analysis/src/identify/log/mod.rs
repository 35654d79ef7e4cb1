//! A recorded drive, read from a CSV file and checked before anything is estimated from it.
//!
//! An estimator turns a wrong unit or a hole in the record into a plausible wrong number, so everything that
//! can be seen to be wrong is refused here, with the line. What is *not* here: any filtering or repair. A log
//! with a gap is cut by its owner, who knows what happened there.
//!
//! Columns: `time_s`, `e_y_m` and `e_theta_rad` (at the driver's near and far point), `wheel_angle_rad`,
//! `guidance_torque_nm` (the torque really applied, probe included), `driver_torque_nm`. Others are ignored.

#[cfg(test)]
mod tests;
mod write;

use std::fmt;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use haptic_log::table::TableError;
use haptic_log::table::TableReader;

/// Names of the columns that a log must have, in the order of the fields of [`DriveLog`].
pub const COLUMNS: [&str; 6] = [
    "time_s",
    "e_y_m",
    "e_theta_rad",
    "wheel_angle_rad",
    "guidance_torque_nm",
    "driver_torque_nm",
];

const GUIDANCE_COLUMN: usize = 4;

/// Largest magnitude that a column may hold, and what a larger one suggests. Chosen so that no drive on a road
/// reaches it while the usual wrong unit does within the first curve.
const LIMITS: [(f64, &str); 6] = [
    (f64::INFINITY, ""),
    (10.0, "is it in mm?"),
    // The range of the lane preview on the bus; 1 s ahead on a bend of 0.3 g at 60 km/h it is 0.18 rad.
    (0.5, "is it in degrees?"),
    // Hands at ten and two do not go past half a turn.
    (std::f64::consts::PI, "is it in degrees?"),
    (50.0, "is it in mN.m?"),
    (50.0, "is it in mN.m?"),
];

/// A wheel angle recorded more coarsely than this (about 1.1 deg) is not in radians.
const COARSEST_WHEEL_STEP_RAD: f64 = 0.02;

/// Share of a sample period by which a time stamp may miss the even grid: rounding to a millisecond makes it 6 %
/// at 120 Hz and 12.5 % at 250 Hz.
const TIME_STAMP_TOLERANCE: f64 = 0.15;

/// Sample periods that the models here are valid for, s: the muscle's lag of 0.1 s needs 20 Hz at least.
const SAMPLE_PERIOD_RANGE_S: (f64, f64) = (1e-4, 0.05);

/// Shortest record, s: a few times the slowest thing to be told from the data (the remnant's corner).
const SHORTEST_S: f64 = 10.0;

/// A drive as recorded: evenly spaced, finite, in SI units.
#[derive(Debug, Clone, PartialEq)]
pub struct DriveLog {
    /// Time of the first row, s.
    pub start_s: f64,
    /// Sample period, s.
    pub dt_s: f64,
    /// e_y at the driver's near point, m.
    pub e_y_m: Vec<f64>,
    /// e_theta at the driver's far point, rad.
    pub e_theta_rad: Vec<f64>,
    /// Wheel angle phi, rad.
    pub wheel_angle_rad: Vec<f64>,
    /// Guidance torque T_h as applied, N.m.
    pub guidance_torque_nm: Vec<f64>,
    /// Driver torque T_d as measured, N.m.
    pub driver_torque_nm: Vec<f64>,
}

/// Why a log was refused. The text names the line (1 is the header) and the column.
#[derive(Debug, Clone, PartialEq)]
pub struct LogError(String);

impl fmt::Display for LogError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for LogError {}

impl From<TableError> for LogError {
    fn from(error: TableError) -> Self {
        Self(error.to_string())
    }
}

impl LogError {
    pub(crate) fn new(message: String) -> Self {
        Self(message)
    }

    /// Of a file without lines: counted are the rows.
    fn in_a_row(self) -> Self {
        Self(match self.0.strip_prefix("line ") {
            Some(rest) => format!("row {rest}"),
            None => self.0,
        })
    }
}

fn refuse<T>(message: impl Into<String>) -> Result<T, LogError> {
    Err(LogError(message.into()))
}

impl DriveLog {
    /// Number of rows.
    pub fn len(&self) -> usize {
        self.driver_torque_nm.len()
    }

    /// Whether there is no row; never so for a log that was read.
    pub fn is_empty(&self) -> bool {
        self.driver_torque_nm.is_empty()
    }

    /// Time of row `k`, s.
    pub fn time_s(&self, k: usize) -> f64 {
        self.start_s + k as f64 * self.dt_s
    }

    /// A log of signals that are on an even grid already: e_y, e_theta, wheel angle, T_h and T_d, of equal lengths.
    pub(crate) fn from_signals(start_s: f64, dt_s: f64, signals: [Vec<f64>; 5]) -> Result<Self, LogError> {
        let [
            e_y_m,
            e_theta_rad,
            wheel_angle_rad,
            guidance_torque_nm,
            driver_torque_nm,
        ] = signals;
        let span_s = dt_s * driver_torque_nm.len() as f64;
        if span_s < SHORTEST_S {
            return refuse(too_short(span_s));
        }
        check_sensor(&driver_torque_nm)?;
        Ok(Self {
            start_s,
            dt_s,
            e_y_m,
            e_theta_rad,
            wheel_angle_rad,
            guidance_torque_nm,
            driver_torque_nm,
        })
    }

    /// Reads and checks the file at `path`. Lines that begin with `#` are skipped; upper and lower case are one in
    /// the header. Of a `manual` drive the guidance may be missing, as a column or as a number: it is then zero.
    ///
    /// # Errors
    /// The file cannot be read, or what it holds is refused; the text begins with the path.
    pub fn open(path: &Path, manual: bool) -> Result<Self, LogError> {
        let named = |e: String| LogError(format!("{}: {e}", path.display()));
        let file = File::open(path).map_err(|e| named(e.to_string()))?;
        Self::read(BufReader::new(file), manual).map_err(|e| named(e.0))
    }

    /// Reads and checks a log from `source`; see [`DriveLog::open`].
    ///
    /// # Errors
    /// A missing or doubled column, a field that is no finite number, a value beyond its column's range, time
    /// stamps that run backwards, repeat, leave a gap or are uneven, or a record that is too short.
    pub fn read(source: impl Read, manual: bool) -> Result<Self, LogError> {
        let mut table = TableReader::new(source)?;
        let index = find_columns(table.header(), table.header_line(), manual)?;
        let mut lines = Vec::new();
        let mut columns: [Vec<f64>; 6] = Default::default();
        for row in table.rows() {
            let row = row?;
            lines.push(row.line);
            for (c, column) in columns.iter_mut().enumerate() {
                column.push(match index[c] {
                    // Not used, but if it is there, it shows whether the drive was a manual one.
                    Some(i) if manual && c == GUIDANCE_COLUMN => {
                        field(row.field(i), row.line, c).unwrap_or_default()
                    }
                    Some(i) => field(row.field(i), row.line, c)?,
                    None => 0.0,
                });
            }
        }
        Self::checked(columns, &lines)
    }

    /// A log of a table's columns in the order of [`COLUMNS`], checked as a file is; the first is not looked at. Of a `manual`
    /// drive the guidance may be missing.
    pub(crate) fn from_rows(
        time_s: Vec<f64>,
        columns: [Option<Vec<f64>>; 6],
        manual: bool,
    ) -> Result<Self, LogError> {
        let mut checked: [Vec<f64>; 6] = Default::default();
        for (c, (column, checked)) in columns.into_iter().zip(&mut checked).enumerate() {
            *checked = match column {
                _ if c == 0 => time_s.clone(),
                Some(values) => values,
                None => vec![0.0; time_s.len()],
            };
            for (row, value) in (1..).zip(checked) {
                match within(*value, &value.to_string(), row, c) {
                    Err(_) if manual && c == GUIDANCE_COLUMN => *value = 0.0,
                    result => result.map_err(|e| e.in_a_row())?,
                }
            }
        }
        let rows: Vec<u64> = (1..=time_s.len() as u64).collect();
        Self::checked(checked, &rows).map_err(LogError::in_a_row)
    }

    fn checked(columns: [Vec<f64>; 6], lines: &[u64]) -> Result<Self, LogError> {
        let [
            time,
            e_y_m,
            e_theta_rad,
            wheel_angle_rad,
            guidance_torque_nm,
            driver_torque_nm,
        ] = columns;
        let (start_s, dt_s) = check_time(&time, lines)?;
        check_wheel_resolution(&wheel_angle_rad, lines)?;
        check_sensor(&driver_torque_nm)?;
        Ok(Self {
            start_s,
            dt_s,
            e_y_m,
            e_theta_rad,
            wheel_angle_rad,
            guidance_torque_nm,
            driver_torque_nm,
        })
    }
}

/// A sensor that says the same from beginning to end is dead, or not connected: there is nothing to explain.
fn check_sensor(driver_torque_nm: &[f64]) -> Result<(), LogError> {
    let first = driver_torque_nm[0];
    if driver_torque_nm.iter().all(|&t| t == first) {
        return refuse(format!(
            "driver_torque_nm is {first} throughout: the sensor measures nothing"
        ));
    }
    Ok(())
}

/// Where each of [`COLUMNS`] stands; all that are missing are named at once.
fn find_columns(header: &[String], line: u64, manual: bool) -> Result<[Option<usize>; 6], LogError> {
    if header.len() == 1
        && let Some(separator) = header[0].chars().find(|c| [';', '\t'].contains(c))
    {
        return refuse(format!(
            "line {line}: this file is separated by {separator:?}; commas are wanted"
        ));
    }
    let names: Vec<String> = header.iter().map(|name| name.to_ascii_lowercase()).collect();
    let mut index = [None; 6];
    let mut missing = Vec::new();
    for (c, wanted) in COLUMNS.iter().enumerate() {
        let mut places = names
            .iter()
            .enumerate()
            .filter(|(_, n)| n == wanted)
            .map(|(i, _)| i);
        index[c] = places.next();
        if places.next().is_some() {
            return refuse(format!("line {line}: column {wanted} is there twice"));
        }
        if index[c].is_none() && !(manual && c == GUIDANCE_COLUMN) {
            // The unit is the last part of a name: a column that differs only there is a likely mistake.
            let stem = wanted.rsplit_once('_').map_or(*wanted, |(stem, _)| stem);
            match names.iter().find(|n| n.starts_with(stem)) {
                Some(near) => missing.push(format!("{wanted} (there is {near}: convert it)")),
                None => missing.push((*wanted).to_owned()),
            }
        }
    }
    if !missing.is_empty() {
        return refuse(format!("line {line}: missing column(s): {}", missing.join(", ")));
    }
    Ok(index)
}

fn field(text: &str, line: u64, c: usize) -> Result<f64, LogError> {
    let name = COLUMNS[c];
    let Ok(value) = text.parse::<f64>() else {
        return refuse(format!("line {line}: {name} is {text:?}, which is not a number"));
    };
    within(value, text, line, c)?;
    Ok(value)
}

/// Whether a value can be one of its column.
fn within(value: f64, text: &str, line: u64, c: usize) -> Result<(), LogError> {
    let name = COLUMNS[c];
    let (limit, hint) = LIMITS[c];
    if !value.is_finite() {
        return refuse(format!(
            "line {line}: {name} is {text}, which is not a finite number"
        ));
    }
    if value.abs() > limit {
        return refuse(format!(
            "line {line}: {name} is {value}, outside -{limit:.4} to {limit:.4}: {hint}"
        ));
    }
    Ok(())
}

/// Checks the time stamps and returns start and period of the even grid that fits them best, s.
fn check_time(time: &[f64], lines: &[u64]) -> Result<(f64, f64), LogError> {
    if time.len() < 3 {
        return refuse(format!("the log has {} rows, which is too few", time.len()));
    }
    let mut steps: Vec<f64> = time.windows(2).map(|w| w[1] - w[0]).collect();
    if let Some(k) = steps.iter().position(|&d| d <= 0.0) {
        return refuse(format!(
            "line {}: time_s goes from {} to {}: it must grow",
            lines[k + 1],
            time[k],
            time[k + 1]
        ));
    }
    steps.sort_by(f64::total_cmp);
    let usual = steps[steps.len() / 2];
    let (low, high) = SAMPLE_PERIOD_RANGE_S;
    if !(low..=high).contains(&usual) {
        return refuse(format!(
            "line {}: the step of time_s is {usual}, outside {low} to {high} s: is it in ms?",
            lines[1]
        ));
    }
    for (k, w) in time.windows(2).enumerate() {
        let step = w[1] - w[0];
        if step > 1.5 * usual {
            return refuse(format!(
                "line {}: gap of {step:.6} s before it, {:.1} samples of {usual:.6} s are missing",
                lines[k + 1],
                step / usual - 1.0
            ));
        }
    }
    let (start, dt) = even_grid(time);
    let missed = |k: usize| (time[k] - start - k as f64 * dt).abs();
    let worst = (0..time.len()).max_by(|&a, &b| missed(a).total_cmp(&missed(b)));
    if let Some(k) = worst.filter(|&k| missed(k) > TIME_STAMP_TOLERANCE * dt) {
        return refuse(format!(
            "line {}: uneven time stamps, time_s is {} where an even grid has {:.6}",
            lines[k],
            time[k],
            start + k as f64 * dt
        ));
    }
    let span = time[time.len() - 1] - time[0];
    if span < SHORTEST_S {
        return refuse(too_short(span));
    }
    Ok((start, dt))
}

/// Start and period of the even grid through `time`, by least squares.
fn even_grid(time: &[f64]) -> (f64, f64) {
    let middle = (time.len() - 1) as f64 / 2.0;
    let (mut mean, mut product, mut square) = (0.0, 0.0, 0.0);
    for (k, t) in time.iter().enumerate() {
        let from_middle = k as f64 - middle;
        mean += (t - time[0]) / time.len() as f64;
        product += from_middle * (t - time[0]);
        square += from_middle * from_middle;
    }
    let dt = product / square;
    (time[0] + mean - middle * dt, dt)
}

fn too_short(span_s: f64) -> String {
    format!("the log covers {span_s:.3} s, less than {SHORTEST_S} s")
}

fn check_wheel_resolution(wheel_angle: &[f64], lines: &[u64]) -> Result<(), LogError> {
    let step = wheel_angle
        .windows(2)
        .map(|w| (w[1] - w[0]).abs())
        .filter(|&d| d > 1e-12)
        .fold(f64::INFINITY, f64::min);
    if step.is_finite() && step > COARSEST_WHEEL_STEP_RAD {
        let first = wheel_angle.windows(2).position(|w| (w[1] - w[0]).abs() > 1e-12);
        let line = lines[first.unwrap_or(0) + 1];
        return refuse(format!(
            "line {line}: wheel_angle_rad moves by {step:.3} at least, coarser than {COARSEST_WHEEL_STEP_RAD} rad: \
             is it in degrees?"
        ));
    }
    Ok(())
}
