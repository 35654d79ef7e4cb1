//! A drive recorded on the bus: a log of frames, with the DBC file that says what they mean. It is read once, frame by frame;
//! kept are the signals that are needed.
//!
//! Needed are the lane preview (e_y at the near point that driver and guidance share, e_theta at the guidance's far
//! point), the column (driver torque, wheel angle), the torque of the guidance unless the drive is a manual one, and the
//! speed. Signals are found by their names in `core/haptic.dbc`, wherever a DBC file puts them. e_theta at the
//! driver's far point is not on the bus; [`far_point`] computes it, and a note says so.
//!
//! The signals are put on an even grid at the pace of the camera: T_h as held at each instant, the others on the line
//! between their neighbours. Frames with a wrong CRC are not used and those that are lost are counted ([`protection`]);
//! where a signal pauses or the preview is not valid, it is missing, and the preflight bridges or cuts the drive there. So
//! it is where the vehicle is slower than its model goes.

mod far_point;
mod heard;
mod protection;

use std::ops::RangeInclusive;
use std::path::Path;

use super::log::jumps::jump;
use super::log::{DriveLog, LogError, refuse};
pub use far_point::SingleTrack;
use haptic_log::formats::{BusLog, dbc};
use haptic_log::notes::Note;
use heard::Heard;

/// The product's own bus: core/haptic.dbc.
pub const HAPTIC_DBC: &str = include_str!("../../../../../core/haptic.dbc");

/// Rows a second: the camera's.
const RATE_HZ: f64 = 120.0;
/// Longest pause of a signal, s: the age at which the ECU no longer trusts it.
const LONGEST_PAUSE_S: f64 = 0.03;
/// Below it the vehicle model's equations, which divide by the speed, are not used, m/s.
const TOO_SLOW_M_PER_S: f64 = 2.5;
/// Faster than any car, m/s: a signal that says so is wrong.
const TOO_FAST_M_PER_S: f64 = 200.0;
/// Slowest mean speed, m/s, at which the guidance works.
const SLOWEST_M_PER_S: f64 = 5.0;

/// Said of every log that comes from a trace, of the vehicle of table 9 and of another.
const NOTE: &str = "From a bus trace: e_theta at the driver's far point (1.0 s) is computed from the guidance's far point \
                    (0.7 s) when it is there, some 0.3 s later, and the turn that the vehicle of table 9 makes until then with the recorded wheel angle. The \
                    estimates are as good as that vehicle's parameters.";

const NOTE_OF_OTHER: &str = "From a bus trace: e_theta at the driver's far point (1.0 s) is computed from the guidance's \
                             far point (0.7 s) when it is there, some 0.3 s later, and the turn that the vehicle given makes until then with the recorded \
                             wheel angle. The estimates are as good as that vehicle's parameters.";

/// How a recording is to be understood.
#[derive(Debug, Clone, Copy, Default)]
pub struct Recording<'a> {
    /// What a trace's frames mean, if not the product's own file.
    pub dbc: Option<&'a Path>,
    /// The vehicle, if not that of table 9.
    pub vehicle: Option<SingleTrack>,
    /// The bus that a log of several is read of, by its name there.
    pub bus: Option<&'a str>,
    /// Without guidance.
    pub manual: bool,
    /// The stretches that will be used, s of the log's time; all of it if there is none. They choose a side where the clock
    /// was set.
    pub stretches: &'a [(f64, f64)],
}

/// A log of frames, and the sentence about it.
pub(super) fn of_bus(log: BusLog, recording: &Recording<'_>) -> Result<(DriveLog, &'static str), LogError> {
    let log = read_trace(&log.of_bus(recording.bus), recording)?;
    let note = if recording.vehicle.is_some() {
        NOTE_OF_OTHER
    } else {
        NOTE
    };
    Ok((log, note))
}

/// The DBC file, or that of the product's own.
pub(super) fn dbc_file(dbc: Option<&Path>) -> Result<Vec<u8>, LogError> {
    let Some(dbc) = dbc else {
        return Ok(HAPTIC_DBC.into());
    };
    std::fs::read(dbc).map_err(|e| LogError::in_file(dbc.display(), e))
}

/// A signal over time.
#[derive(Default)]
struct Course {
    name: &'static str,
    line: Vec<u32>,
    time_s: Vec<f64>,
    value: Vec<f64>,
}

/// Place of T_h among the signals that a log needs: behind e_y, e_theta, T_d and the wheel angle.
const GUIDANCE: usize = 4;

/// The signals that a log needs. The torque of the guidance is not among those of a manual drive.
const NEEDED: [&str; 8] = [
    "LanePreview_LateralError",
    "LanePreview_YawError",
    "LanePreview_Valid",
    "LanePreview_Age",
    "Column_DriverTorque",
    "Column_WheelAngle",
    "Vehicle_Speed1",
    "Guidance_Torque",
];

fn read_trace(bus: &BusLog, how: &Recording<'_>) -> Result<DriveLog, LogError> {
    let (dbc, mut notes) = dbc::parse(&dbc_file(how.dbc)?)?;
    let needed = &NEEDED[..if how.manual { 7 } else { 8 }];
    let mut heard = Heard::of(needed, &dbc)?;
    notes.append(bus.each(&mut |frame| heard.take(frame).map_err(|e| e.to_string().into()))?);
    let mut findings: Vec<[String; 3]> = notes.iter().map(Note::finding).collect();
    findings.extend(heard.findings());
    let mut courses = heard.courses()?.into_iter();
    let mut next = || courses.next().unwrap_or_default();
    let [e_y, e_theta, valid, age, torque, angle, speed] = [(); 7].map(|()| next());
    let guidance = courses.next();
    findings.extend(valid.not_valid());
    let [e_y, e_theta] = [e_y, e_theta].map(|c| c.earlier_by(&age).only(&valid));

    let mut needed: Vec<Course> = [e_y, e_theta, torque, angle]
        .into_iter()
        .chain(guidance)
        .collect();
    let begins_s = begin(&needed)?;
    // The ECU's milliseconds are counted from one of its frames.
    let zero_s = if how.manual {
        begins_s
    } else {
        needed[GUIDANCE].time_s[0]
    };
    let used = used(&needed, zero_s, how.stretches)?;
    for c in &mut needed {
        c.cut(&used);
    }
    let start_s = begin(&needed)?;
    let speed = speed.guided(&used)?;
    findings.extend(needed.iter().filter_map(Course::pauses));
    let end_s = needed.iter().map(|c| c.last_s()).fold(f64::INFINITY, f64::min);
    let rows = ((end_s - start_s).max(0.0) * RATE_HZ) as usize;
    let dt_s = 1.0 / RATE_HZ;
    let at = |k: usize| start_s + k as f64 * dt_s;
    let on_grid = |c: usize, hold: Hold| -> Vec<f64> { sampled(&needed[c], (0..rows).map(at), hold) };
    let wheel_angle_rad = on_grid(3, Hold::Line);
    let (speed_m_per_s, slow) = speed.on((0..rows).map(at));
    findings.extend(speed.slow(&slow));
    let mut seen_rad = on_grid(1, Hold::Line);
    for (seen, slow) in seen_rad.iter_mut().zip(&slow) {
        *seen = if *slow { f64::NAN } else { *seen };
    }
    let vehicle = how.vehicle.unwrap_or(far_point::TABLE_9);
    let e_theta_rad =
        far_point::driver_yaw_error(&seen_rad, &wheel_angle_rad, &vehicle, &speed_m_per_s, dt_s);
    let rows = e_theta_rad.len();
    let cut = |mut values: Vec<f64>| {
        values.truncate(rows);
        values
    };
    let guidance_nm = match how.manual {
        true => vec![0.0; rows],
        false => cut(on_grid(GUIDANCE, Hold::Value)),
    };
    let mut log = DriveLog::from_signals(
        start_s - zero_s,
        dt_s,
        [
            cut(on_grid(0, Hold::Line)),
            e_theta_rad,
            cut(wheel_angle_rad),
            guidance_nm,
            cut(on_grid(2, Hold::Line)),
        ],
    )?;
    log.findings = findings;
    log.tell_speed(&speed.value);
    Ok(log)
}

/// When the last of the signals begins.
fn begin(courses: &[Course]) -> Result<f64, LogError> {
    if let Some(c) = courses.iter().find(|c| c.time_s.len() < 2) {
        return refuse(format!("no frame of {} can be used", c.name));
    }
    let starts_s = courses.iter().map(|c| c.time_s[0]);
    Ok(starts_s.fold(f64::NEG_INFINITY, f64::max))
}

/// From when to when the signals are used: to a jump of the clock, or from it on.
fn used(courses: &[Course], zero_s: f64, stretches: &[(f64, f64)]) -> Result<RangeInclusive<f64>, LogError> {
    let of =
        |c: &Course| -> Vec<(f64, u32)> { c.time_s.iter().copied().zip(c.line.iter().copied()).collect() };
    let mut frames: Vec<(f64, u32)> = courses.iter().flat_map(of).collect();
    frames.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut time_s, lines): (Vec<f64>, Vec<u32>) = frames.into_iter().unzip();
    let mut first = 0;
    while let Some(jump) = jump(&time_s[first..], 1.0 / RATE_HZ) {
        let next = first + jump.row + 1;
        let place = format!("line {}", lines[next]);
        if jump.use_after(&place, zero_s, stretches)? {
            first = next;
        } else {
            time_s.truncate(next);
        }
    }
    Ok(time_s[first]..=time_s[time_s.len() - 1])
}

impl Course {
    fn last_s(&self) -> f64 {
        self.time_s[self.time_s.len() - 1]
    }

    /// Moved to when it was measured.
    fn earlier_by(mut self, age: &Self) -> Self {
        for (time_s, age_s) in self.time_s.iter_mut().zip(&age.value) {
            *time_s -= age_s;
        }
        self
    }

    /// Without the samples that are not `valid`, and in the order of their time.
    fn only(self, valid: &Self) -> Self {
        let mut out = Self {
            name: self.name,
            line: Vec::new(),
            time_s: Vec::new(),
            value: Vec::new(),
        };
        for (k, &valid) in valid.value.iter().enumerate().take(self.value.len()) {
            let later = out.time_s.last().is_none_or(|&last| self.time_s[k] > last);
            if valid != 0.0 && later {
                out.line.push(self.line[k]);
                out.time_s.push(self.time_s[k]);
                out.value.push(self.value[k]);
            }
        }
        out
    }

    /// Keeps what lies between two instants.
    fn cut(&mut self, used: &RangeInclusive<f64>) {
        let from = self.time_s.partition_point(|t| t < used.start());
        let to = self.time_s.partition_point(|t| t <= used.end());
        for values in [&mut self.time_s, &mut self.value] {
            values.truncate(to);
            values.drain(..from.min(to));
        }
        self.line.truncate(to);
        self.line.drain(..from.min(to));
    }

    /// How often the lane preview says that it is not valid, in words.
    fn not_valid(&self) -> Option<[String; 3]> {
        let count = self.value.iter().filter(|&&v| v == 0.0).count();
        (count > 0).then(|| {
            [
                "LanePreview".to_owned(),
                format!("{count} frames that say that they are not valid"),
                "not used".to_owned(),
            ]
        })
    }

    /// How often the signal pauses, in words.
    fn pauses(&self) -> Option<[String; 3]> {
        let steps = self.time_s.windows(2).map(|w| w[1] - w[0]);
        let long: Vec<(usize, f64)> = steps.enumerate().filter(|s| s.1 > LONGEST_PAUSE_S).collect();
        let &(k, _) = long.first()?;
        let longest = long.iter().map(|s| s.1).fold(0.0, f64::max);
        Some([
            self.name.to_owned(),
            format!(
                "{} pause{}, the longest of {longest:.3} s, the first before line {}",
                long.len(),
                if long.len() == 1 { "" } else { "s" },
                self.line[k + 1]
            ),
            "bridged if short, else cut".to_owned(),
        ])
    }

    /// The part of it that is used, if it is a speed at which there is guidance, in the mean.
    fn guided(mut self, used: &RangeInclusive<f64>) -> Result<Self, LogError> {
        self.cut(used);
        if self.value.is_empty() {
            return refuse(format!("no frame of {} can be used", self.name));
        }
        let mean = self.value.iter().sum::<f64>() / self.value.len() as f64;
        if mean < SLOWEST_M_PER_S {
            return refuse(format!(
                "{} is {mean:.2} m/s in the mean, below {SLOWEST_M_PER_S}: there is no guidance",
                self.name
            ));
        }
        Ok(self)
    }

    /// A speed at these instants, the last one where it is missing, and whether each was too slow for the vehicle model.
    fn on(&self, at_s: impl Iterator<Item = f64>) -> (Vec<f64>, Vec<bool>) {
        let within = at_s.map(|t| t.clamp(self.time_s[0], self.last_s()));
        let mut last = self.value[0];
        let held = sampled(self, within, Hold::Line).into_iter().map(|v| {
            last = if v.is_finite() { v } else { last };
            (
                last.clamp(TOO_SLOW_M_PER_S, TOO_FAST_M_PER_S),
                last < TOO_SLOW_M_PER_S,
            )
        });
        held.unzip()
    }

    /// How often it was too slow, in words.
    fn slow(&self, slow: &[bool]) -> Option<[String; 3]> {
        let count = slow.iter().filter(|slow| **slow).count();
        (count > 0).then(|| {
            [
                self.name.to_owned(),
                format!(
                    "{:.1} s below {TOO_SLOW_M_PER_S} m/s, where e_theta at the driver's far point cannot be computed",
                    count as f64 / RATE_HZ
                ),
                "bridged if short, else cut".to_owned(),
            ]
        })
    }
}

#[derive(Clone, Copy)]
enum Hold {
    /// The last value.
    Value,
    /// On the line to the next one.
    Line,
}

/// Values at rising instants within the course. Instants a microsecond before a value, as candump's clock rounds
/// them, have the new value already.
fn sampled(course: &Course, at_s: impl Iterator<Item = f64>, hold: Hold) -> Vec<f64> {
    let (time, value) = (&course.time_s, &course.value);
    let mut k = 0;
    at_s.map(|t| {
        while k + 1 < time.len() && time[k + 1] <= t + 1e-6 {
            k += 1;
        }
        let next = (k + 1).min(time.len() - 1);
        if time[next] - time[k] > LONGEST_PAUSE_S && t > time[k] + 1e-6 {
            return f64::NAN;
        }
        match hold {
            Hold::Line if time[next] > time[k] => {
                value[k] + (t - time[k]) / (time[next] - time[k]) * (value[next] - value[k])
            }
            _ => value[k],
        }
    })
    .collect()
}
