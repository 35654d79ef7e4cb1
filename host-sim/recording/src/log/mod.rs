//! A recorded drive, read from a CSV file and checked before anything is estimated from it.
//!
//! An estimator turns a wrong unit into a plausible wrong number, so what can be seen to be another unit, no number or
//! no time is refused here, with the line. What real recorders do is read: rows that were lost and values that are
//! empty or NaN stay missing (no number) in the log, uneven stamps are put on an even grid ([`grid`]), and what was
//! found is kept in [`DriveLog::findings`]. What is *not* here: any filtering or repair; that is the preflight's.
//!
//! Columns: `time_s`, `e_y_m` and `e_theta_rad` (at the driver's near and far point), `wheel_angle_rad`,
//! `guidance_torque_nm` (the torque really applied, probe included), `driver_torque_nm`. Others are ignored.

mod grid;
pub(crate) mod jumps;
#[cfg(test)]
mod tests;
mod write;

use std::fmt;

use grid::{Grid, usual_step};
pub use grid::{SWITCH_RATE_NM_S, median};
use haptic_log::recording::{Lines, RecordingError};

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

/// Shortest record, s: a few times the slowest thing to be told from the data (the remnant's corner).
const SHORTEST_S: f64 = 10.0;

/// A drive as recorded: on an even grid, in SI units. What is missing is no number.
#[derive(Debug, Clone, Default, PartialEq)]
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
    /// Whether e_y and e_theta were made of two lane lines and a curvature: too rough for anything but K_hg.
    pub approximate_points: bool,
    /// Autocorrelation, from lag 1 on, that white noise has here because the signals were read off between rows; empty
    /// where the rows are as recorded.
    pub resampling: Vec<f64>,
    /// The least and the largest speed, m/s, if the record tells it.
    pub speeds_m_per_s: Option<[f64; 2]>,
    /// What was found when the log was read: what, found, done.
    pub findings: Vec<[String; 3]>,
}

/// Rows beyond which a fit gains nothing that a driver's remnant of half a hertz would let it: 42 min at 120 Hz.
const MOST_ROWS: usize = 300_000;
/// How much is used of a record that has more rows even so, s: what a fit costs grows with the square of the time.
const LONGEST_S: f64 = 14_400.0;
/// Rows a second that are left of more: two in the muscle's lag of 0.1 s.
const LEAST_RATE_HZ: f64 = 20.0;

/// The column of a time series that tells the speed; a log may lack it.
pub const SPEED_COLUMN: &str = "speed_m_per_s";
/// The largest speed over the least that passes for one speed.
const ONE_SPEED: f64 = 1.06;

/// Why a log was refused. The text names the line (1 is the header) and the column.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct LogError(String);

impl From<RecordingError> for LogError {
    fn from(error: RecordingError) -> Self {
        Self(error.to_string())
    }
}

impl From<String> for LogError {
    fn from(sentence: String) -> Self {
        Self(sentence)
    }
}

impl LogError {
    /// An error in a file, an option or a channel, which the text then begins with.
    pub(crate) fn in_file(name: impl fmt::Display, error: impl fmt::Display) -> Self {
        Self(format!("{name}: {error}"))
    }
}

/// Refuses a recording, with the reason.
///
/// # Errors
/// Always: the reason.
pub fn refuse<T>(message: impl Into<String>) -> Result<T, LogError> {
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
        let span_s = dt_s * signals[4].len() as f64;
        if span_s < SHORTEST_S {
            return refuse(too_short(span_s));
        }
        Self::from_grid(start_s, dt_s, signals)
    }

    /// A log of signals on an even grid, however long it is.
    fn from_grid(start_s: f64, dt_s: f64, signals: [Vec<f64>; 5]) -> Result<Self, LogError> {
        let [
            e_y_m,
            e_theta_rad,
            wheel_angle_rad,
            guidance_torque_nm,
            driver_torque_nm,
        ] = signals;
        check_sensor(&driver_torque_nm)?;
        Ok(Self {
            start_s,
            dt_s,
            e_y_m,
            e_theta_rad,
            wheel_angle_rad,
            guidance_torque_nm,
            driver_torque_nm,
            approximate_points: false,
            resampling: Vec::new(),
            speeds_m_per_s: None,
            findings: Vec::new(),
        })
    }

    /// The signals, in the order of [`COLUMNS`] behind the time.
    #[must_use]
    pub fn signals(&self) -> [&Vec<f64>; 5] {
        [
            &self.e_y_m,
            &self.e_theta_rad,
            &self.wheel_angle_rad,
            &self.guidance_torque_nm,
            &self.driver_torque_nm,
        ]
    }

    /// Every so many-th row, where there are more than a fit gains from: the least that leaves `MOST_ROWS`, but not so many
    /// that fewer than `LEAST_RATE_HZ` would remain.
    pub fn thinned(self) -> Self {
        self.every_so_many_th().begun()
    }

    /// By how much more variance a slow sum of the prediction errors has than if they were white, at most: reading off between rows
    /// makes neighbours alike, and the noise model may take up a part of that.
    pub fn slow_noise(&self) -> f64 {
        1.0 + 2.0 * self.resampling.iter().map(|r| r.max(0.0)).sum::<f64>()
    }

    fn every_so_many_th(mut self) -> Self {
        let rate_hz = 1.0 / self.dt_s;
        let every = self
            .len()
            .div_ceil(MOST_ROWS)
            .min((rate_hz / LEAST_RATE_HZ) as usize);
        if every < 2 {
            return self;
        }
        self.findings.push([
            "rows".to_owned(),
            format!("{} at {rate_hz:.0} Hz", self.len()),
            format!("one of {every} used"),
        ]);
        self.keep_every(every);
        self
    }

    /// Leaves the first of so many rows each.
    pub fn keep_every(&mut self, every: usize) {
        for signal in self.signals_mut() {
            *signal = signal.iter().copied().step_by(every).collect();
        }
        self.dt_s *= every as f64;
        self.resampling = self
            .resampling
            .iter()
            .copied()
            // The first lag is 1: lag `every` is the first between rows that are kept.
            .skip(every - 1)
            .step_by(every)
            .collect();
    }

    /// Its beginning, where there are more rows than a fit gains from and it is longer than [`LONGEST_S`].
    fn begun(mut self) -> Self {
        let rows = (LONGEST_S / self.dt_s) as usize;
        if self.len() > MOST_ROWS.max(rows) {
            self.findings.push([
                "rows".to_owned(),
                format!("{:.1} h", self.len() as f64 * self.dt_s / 3600.0),
                format!(
                    "the first {} h used; --from and --to take others",
                    LONGEST_S / 3600.0
                ),
            ]);
            for signal in self.signals_mut() {
                signal.truncate(rows);
            }
        }
        self
    }

    const fn signals_mut(&mut self) -> [&mut Vec<f64>; 5] {
        [
            &mut self.e_y_m,
            &mut self.e_theta_rad,
            &mut self.wheel_angle_rad,
            &mut self.guidance_torque_nm,
            &mut self.driver_torque_nm,
        ]
    }

    /// Keeps what the record says of the speed.
    pub fn tell_speed(&mut self, speeds_m_per_s: &[f64]) {
        let known = || speeds_m_per_s.iter().copied().filter(|v| v.is_finite());
        self.speeds_m_per_s = known()
            .reduce(f64::min)
            .zip(known().reduce(f64::max))
            .map(Into::into);
        if let Some([least, most]) = self.speeds_m_per_s.filter(|_| self.changes_speed()) {
            self.findings.push([
                "speed".to_owned(),
                format!("{least:.1} to {most:.1} m/s"),
                "the balance of torques on the column, which takes one speed, is not judged".to_owned(),
            ]);
        }
    }

    /// Whether the record says that the speed changed by more than a few per cent: the aligning torque then does too.
    pub fn changes_speed(&self) -> bool {
        self.speeds_m_per_s
            .is_some_and(|[least, most]| most > ONE_SPEED * least)
    }

    /// A log of columns in memory, in the order of [`COLUMNS`] and of equal lengths; a value that is missing is NaN. Rows
    /// are named as lines, from 1.
    ///
    /// # Errors
    /// As [`DriveLog::read`]; columns of different lengths.
    pub fn from_columns(columns: [Vec<f64>; 6], manual: bool) -> Result<Self, LogError> {
        Self::from_columns_within(columns, manual, (&Lines::default(), &[]))
    }

    fn from_columns_within(
        mut columns: [Vec<f64>; 6],
        manual: bool,
        (lines, stretches): (&Lines, &[(f64, f64)]),
    ) -> Result<Self, LogError> {
        let rows = columns[0].len();
        if let Some(c) = (0..6).find(|&c| columns[c].len() != rows) {
            return refuse(format!(
                "{} has {} rows where time_s has {rows}",
                COLUMNS[c],
                columns[c].len()
            ));
        }
        for (c, column) in columns.iter_mut().enumerate() {
            for (row, value) in column.iter_mut().enumerate() {
                *value = within_limits(*value, c).map_err(|what| format!("{}: {what}", lines.place(row)))?;
            }
        }
        Self::from_table(lines, columns, manual, stretches)
    }

    /// A log of a table's columns in the order of [`COLUMNS`]; the first is not looked at. Of a `manual` drive the guidance
    /// may be missing.
    pub(crate) fn from_rows(
        time_s: Vec<f64>,
        columns: [Option<Vec<f64>>; 6],
        manual: bool,
        within: (&Lines, &[(f64, f64)]),
    ) -> Result<Self, LogError> {
        let nothing = || vec![0.0; time_s.len()];
        let mut columns = columns.map(|column| column.unwrap_or_else(nothing));
        columns[0] = time_s;
        Self::from_columns_within(columns, manual, within)
    }

    /// Puts columns that are in their limits on an even grid.
    fn from_table(
        lines: &Lines,
        columns: [Vec<f64>; 6],
        manual: bool,
        stretches: &[(f64, f64)],
    ) -> Result<Self, LogError> {
        let usual_s = usual_step(&columns[0], lines)?;
        let used = jumps::usable(&columns[0], lines, usual_s, stretches)?;
        let first = used.start;
        let [time, signals @ ..] = columns.map(|mut column| {
            column.truncate(used.end);
            column.split_off(used.start)
        });
        let grid = Grid::new(&time, usual_s)?;
        let mut c = 0;
        let mut signals = signals.map(|column| {
            c += 1;
            grid.put(&time, column, c)
        });
        if manual {
            // The time is no signal, so places are one less than in COLUMNS.
            for x in signals[GUIDANCE_COLUMN - 1].iter_mut().filter(|x| x.is_nan()) {
                *x = 0.0;
            }
        }
        for (signal, name) in signals.iter().zip(&COLUMNS[1..]) {
            if signal.iter().all(|x| x.is_nan()) {
                return refuse(format!("{name} holds no number"));
            }
        }
        check_wheel_resolution(&signals[2], (lines, first))?;
        Ok(Self {
            resampling: grid.autocorrelation(&time),
            findings: grid.finding.iter().cloned().collect(),
            ..Self::from_grid(grid.start_s, grid.dt_s, signals)?
        })
    }
}

/// A sensor that says the same from beginning to end is dead, or not connected: there is nothing to explain.
fn check_sensor(driver_torque_nm: &[f64]) -> Result<(), LogError> {
    let mut known = driver_torque_nm.iter().copied().filter(|t| t.is_finite());
    let first = known.next().unwrap_or(0.0);
    if known.all(|t| t == first) {
        return refuse(format!(
            "driver_torque_nm is {first} throughout: the sensor measures nothing"
        ));
    }
    Ok(())
}

/// A value that its column can have; missing if it is not finite.
fn within_limits(value: f64, c: usize) -> Result<f64, String> {
    let (limit, hint) = LIMITS[c];
    match value.is_finite() {
        false if c == 0 => Err(format!("time_s is {value}, which is not a finite number")),
        false => Ok(f64::NAN),
        true if value.abs() > limit => {
            let name = COLUMNS[c];
            Err(format!(
                "{name} is {value}, outside -{limit:.4} to {limit:.4}: {hint}"
            ))
        }
        true => Ok(value),
    }
}

fn too_short(span_s: f64) -> String {
    format!("the log covers {span_s:.3} s, less than {SHORTEST_S} s")
}

fn check_wheel_resolution(wheel_angle: &[f64], (lines, first): (&Lines, usize)) -> Result<(), LogError> {
    let step = wheel_angle
        .windows(2)
        .map(|w| (w[1] - w[0]).abs())
        .filter(|&d| d > 1e-12)
        .fold(f64::INFINITY, f64::min);
    if step.is_finite() && step > COARSEST_WHEEL_STEP_RAD {
        let moves = wheel_angle.windows(2).position(|w| (w[1] - w[0]).abs() > 1e-12);
        let place = lines.place(first + moves.unwrap_or(0) + 1);
        return refuse(format!(
            "{place}: wheel_angle_rad moves by {step:.3} at least, coarser than {COARSEST_WHEEL_STEP_RAD} rad: \
             is it in degrees?"
        ));
    }
    Ok(())
}
