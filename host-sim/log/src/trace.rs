//! What one closed-loop run leaves behind: evenly spaced samples of the truth, not of the sensors.
//!
//! Signs and frames are ISO 8855 (y left, yaw counter-clockwise); "lateral error" is the offset of the
//! centre of gravity from the centreline, left positive.
//!
//! The channels are one list, [`channels!`](self) below: one more channel is one more entry of it. From it follow the
//! fields of [`Sample`], the table [`CHANNELS`], the columns of a CSV file, writing it and reading it back. What else wants a decision
//! says so itself: the compiler refuses the simulator's sample until it has a value for the new field, and
//! `tests/channels.rs` asks for its row in `docs/reference/formats.md`.

use std::fmt;
use std::io::{self, Read, Write};

use crate::table::{TableError, TableReader, TableWriter, fixed, number};

/// What the values of a channel belong to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Source {
    /// The step's number.
    Clock,
    /// The centreline, at the vehicle or ahead of it.
    Road,
    /// The vehicle, the column and the wheel.
    Vehicle,
    /// The driver.
    Driver,
    /// The guidance and its actuator.
    Guidance,
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Clock => "clock",
            Self::Road => "road",
            Self::Vehicle => "vehicle",
            Self::Driver => "driver",
            Self::Guidance => "guidance",
        })
    }
}

/// One channel of a trace.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub struct Channel {
    /// The field of [`Sample`] and the column of a file; its unit is its last part.
    pub name: &'static str,
    /// SI unit; `1` if it has none.
    pub unit: &'static str,
    /// Digits after the point in a text: far below what any sensor resolves.
    pub decimals: usize,
    /// What it belongs to.
    pub source: Source,
    /// What it is.
    pub meaning: &'static str,
    /// Whether there are drives without it.
    pub is_optional: bool,
    /// Its value in a sample; a flag is 0 or 1; what a drive does not have is not a number.
    pub value: fn(&Sample) -> f64,
    set: fn(&mut Sample, f64),
}

/// A quantity or a flag, of a number.
trait Value {
    /// Whether there are drives without it.
    const IS_OPTIONAL: bool = false;
    fn from_number(number: f64) -> Self;
    fn number(self) -> f64;
}

impl Value for f64 {
    fn from_number(number: f64) -> Self {
        number
    }

    fn number(self) -> f64 {
        self
    }
}

impl Value for Option<f64> {
    const IS_OPTIONAL: bool = true;

    fn from_number(number: f64) -> Self {
        Some(number).filter(|number| !number.is_nan())
    }

    fn number(self) -> f64 {
        self.unwrap_or(f64::NAN)
    }
}

impl Value for bool {
    fn from_number(number: f64) -> Self {
        number != 0.0
    }

    fn number(self) -> f64 {
        f64::from(self)
    }
}

/// Declares the channels: `field: type, unit, digits, source;`.
macro_rules! channels {
    ($($(#[doc = $meaning:literal])+ $field:ident: $type:ty, $unit:literal, $decimals:literal, $source:ident;)*) => {
        /// One instant of a run, in SI units.
        #[derive(Debug, Clone, Copy, Default, PartialEq)]
        pub struct Sample {
            $($(#[doc = $meaning])+ #[doc = concat!("\n\nUnit ", $unit, ".")] pub $field: $type,)*
        }

        /// Every channel, in the order of the columns of a file.
        pub const CHANNELS: [Channel; [$(stringify!($field)),*].len()] = [
            $(Channel {
                name: stringify!($field),
                unit: $unit,
                decimals: $decimals,
                source: Source::$source,
                meaning: concat!($($meaning),+),
                is_optional: <$type as Value>::IS_OPTIONAL,
                value: |sample| sample.$field.number(),
                set: |sample, number| sample.$field = Value::from_number(number),
            },)*
        ];
    };
}

channels! {
    /// Time since the start of the run.
    time_s: f64, "s", 6, Clock;
    /// e_y at the driver's near point.
    e_y_m: f64, "m", 6, Road;
    /// e_theta at the driver's far point.
    e_theta_rad: f64, "rad", 7, Road;
    /// Steering wheel angle phi.
    wheel_angle_rad: f64, "rad", 7, Vehicle;
    /// Guidance torque T_h really applied.
    guidance_torque_nm: f64, "N.m", 5, Guidance;
    /// Driver torque T_d on the column, with the remnant, if any.
    driver_torque_nm: f64, "N.m", 5, Driver;
    /// Offset of the centre of gravity from the centreline, left positive.
    lateral_error_m: f64, "m", 6, Vehicle;
    /// Arc length of the centre of gravity's projection on the centreline.
    s_m: f64, "m", 4, Vehicle;
    /// Direction of movement minus the centreline's heading at `s_m`.
    heading_error_rad: f64, "rad", 7, Vehicle;
    /// Curvature of the centreline at `s_m`, left positive.
    curvature_1pm: f64, "1/m", 8, Road;
    /// e_y' at the guidance's near point.
    guidance_e_y_m: f64, "m", 6, Road;
    /// e_theta' at the guidance's far point.
    guidance_e_theta_rad: f64, "rad", 7, Road;
    /// Rate of the steering wheel.
    wheel_rate_rad_per_s: f64, "rad/s", 6, Vehicle;
    /// Yaw rate r.
    yaw_rate_rad_per_s: f64, "rad/s", 7, Vehicle;
    /// Side-slip angle beta.
    sideslip_rad: f64, "rad", 7, Vehicle;
    /// Whether a limit held the guidance torque back: 0 or 1.
    guidance_limited: bool, "1", 0, Guidance;
    /// Speed v of the vehicle.
    speed_m_per_s: f64, "m/s", 6, Vehicle;
    /// Why the guidance is away: 0 where it is not; -1 torque lost, -2 lane preview lost, -3 request ended, -4 too slow,
    /// -5 no fault named; above 0 the ECU's fault word.
    unguided_cause: f64, "1", 0, Guidance;
    /// T_tb, where the column has a torsion bar.
    bar_torque_nm: Option<f64>, "N.m", 5, Vehicle;
    /// Torque of the power assist there, seen at the wheel.
    assist_torque_nm: Option<f64>, "N.m", 5, Vehicle;
}

/// What files of earlier versions do not have.
const LATER_CHANNELS: [&str; 2] = ["speed_m_per_s", "unguided_cause"];

/// A run's samples, evenly spaced in time.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Trace {
    /// Samples per second.
    pub sample_rate_hz: f64,
    /// The samples in order of time; the first is at t = 0.
    pub samples: Vec<Sample>,
}

impl Trace {
    /// The channels that its drive has.
    pub fn channels(&self) -> impl Iterator<Item = &'static Channel> {
        let first = self.samples.first();
        CHANNELS.iter().filter(move |channel| {
            !channel.is_optional || first.is_some_and(|s| !(channel.value)(s).is_nan())
        })
    }

    /// Writes every sample as a row of a CSV table. A value that is not finite is an empty field.
    ///
    /// The first columns are those of a driver's log, so that a simulated run can be read wherever a log can.
    ///
    /// # Errors
    /// What `out` says.
    pub fn write_csv(&self, out: impl Write) -> io::Result<()> {
        let channels: Vec<_> = self.channels().collect();
        let mut table = TableWriter::new(out, channels.iter().map(|channel| channel.name))?;
        for sample in &self.samples {
            table.row(channels.iter().map(|channel| match (channel.value)(sample) {
                value if value.is_finite() => fixed(value, channel.decimals),
                _ => String::new(),
            }))?;
        }
        table.finish()
    }

    /// Reads what [`Trace::write_csv`] has written. Columns of other names are passed over; an empty field is NaN, and so are
    /// the speed and the cause of unguided driving in a file of an earlier version, which has none. The sample rate is that
    /// of the first and the last time stamp.
    ///
    /// # Errors
    /// What cannot be read, a column that is missing, a field that is no number.
    ///
    /// ```
    /// use haptic_log::trace::{Sample, Trace};
    /// let sample = |time_s, e_y_m| Sample { time_s, e_y_m, ..Sample::default() };
    /// let trace = Trace { sample_rate_hz: 2.0, samples: vec![sample(0.0, 0.125), sample(0.5, -0.25)] };
    /// let mut csv = Vec::new();
    /// trace.write_csv(&mut csv).unwrap();
    /// assert_eq!(Trace::read_csv(&csv[..]).unwrap(), trace);
    /// ```
    pub fn read_csv(source: impl Read) -> Result<Self, TableError> {
        let mut table = TableReader::new(source)?;
        let place = |channel: Channel| {
            let found = table.header().iter().position(|name| *name == channel.name);
            if found.is_none() && !channel.is_optional && !LATER_CHANNELS.contains(&channel.name) {
                return Err(TableError::MissingColumn(channel.name.into()));
            }
            Ok(found)
        };
        let places = CHANNELS.into_iter().map(place).collect::<Result<Vec<_>, _>>()?;
        let mut samples = Vec::new();
        while let Some(row) = table.next_row()? {
            let mut sample = Sample::default();
            for (channel, place) in CHANNELS.iter().zip(&places) {
                let text = place.map(|place| row.field(place)).unwrap_or_default();
                let value = number(&text).ok_or_else(|| TableError::NotANumber {
                    line: row.line,
                    column: channel.name.into(),
                    text: text.to_string(),
                })?;
                (channel.set)(&mut sample, value);
            }
            samples.push(sample);
        }
        if let Some(line) = table.cut() {
            let what = "the file ends in it".into();
            return Err(TableError::Row { line, what });
        }
        let ends = samples.last().zip(samples.first());
        let span_s = ends.map_or(0.0, |(b, a)| b.time_s - a.time_s);
        let sample_rate_hz = match span_s > 0.0 {
            true => (samples.len() - 1) as f64 / span_s,
            false => 0.0,
        };
        Ok(Self {
            sample_rate_hz,
            samples,
        })
    }
}
