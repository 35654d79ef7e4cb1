//! A drive recorded on the bus: a log of frames, with the DBC file that says what they mean. It is read frame by frame, and what
//! is kept grows with the rows of the drive, not with the frames: a first reading says from when to when the signals go
//! ([`survey`]), a second one puts them on the grid.
//!
//! Needed are the lane preview (e_y at the near point that driver and guidance share, e_theta at the guidance's far
//! point), the column (driver torque, wheel angle), the torque of the guidance unless the drive is a manual one, and the
//! speed. Signals are found by their names in `core/haptic.dbc`, wherever a DBC file puts them. e_theta at the
//! driver's far point is not on the bus; [`far_point`] computes it, and a note says so.
//!
//! The signals are put on an even grid at the pace of the camera: T_h as held at each instant, the others on the line
//! between their neighbours. Frames with a wrong CRC are not used and those that are lost are counted ([`haptic_log::formats::protection`]);
//! where a signal pauses or the preview is not valid, it is missing, and the preflight bridges or cuts the drive there. So
//! it is where the vehicle is slower than its model goes.

mod far_point;
mod heard;
mod survey;

use std::ops::RangeInclusive;
use std::path::Path;

use super::log::{DriveLog, LogError, refuse};
use can_dbc::Dbc;
pub use far_point::SingleTrack;
use haptic_log::formats::{BusLog, Watch, dbc};
use haptic_log::notes::{Note, Notes};
use haptic_log::recording::grid::{Grid, OnGrid};
use heard::{Heard, Value};
use survey::Survey;

/// The product's own bus: core/haptic.dbc.
pub const HAPTIC_DBC: &str = include_str!("../../../../core/haptic.dbc");

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
    /// Who is told how far a file is read.
    pub watch: Option<&'a Watch>,
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

/// Places among the signals that a log needs.
const E_Y: usize = 0;
const E_THETA: usize = 1;
const VALID: usize = 2;
const AGE: usize = 3;
const TORQUE: usize = 4;
const ANGLE: usize = 5;
const SPEED: usize = 6;
const GUIDANCE: usize = 7;

/// The signals that a log needs, at their places. The torque of the guidance is not among those of a manual drive.
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

/// Signals that have to be there at each row; the speed, which is held longer, is not among them.
const ON_THE_GRID: [usize; 5] = [E_Y, E_THETA, TORQUE, ANGLE, GUIDANCE];

/// A log and how it is understood, to be read as often as needed.
struct Trace<'a> {
    bus: &'a BusLog,
    dbc: &'a Dbc,
    needed: &'a [&'static str],
}

/// All of a log's time.
const ALWAYS: RangeInclusive<f64> = f64::NEG_INFINITY..=f64::INFINITY;

impl Trace<'_> {
    /// Reads the log once; `each` takes the values of the signals within `used`.
    fn each(
        &self,
        used: &RangeInclusive<f64>,
        each: &mut dyn FnMut(&Value),
    ) -> Result<(Heard<'_>, Notes), LogError> {
        let mut heard = Heard::of(self.needed, self.dbc)?;
        let mut within = |value: &Value| {
            if used.contains(&value.time_s) {
                each(value);
            }
        };
        let notes = self.bus.each(&mut |frame| {
            let taken = heard.take(frame, &mut within);
            taken.map_err(|e| e.to_string().into())
        })?;
        Ok((heard, notes))
    }

    fn survey(&self, used: &RangeInclusive<f64>) -> Result<(Survey, Heard<'_>, Notes), LogError> {
        let mut survey = Survey::default();
        let (heard, notes) = self.each(used, &mut |value| survey.take(value))?;
        Ok((survey, heard, notes))
    }

    /// The signals every `1/RATE_HZ` s: at the places of [`NEEDED`], the guidance as held, the others on the line between
    /// their neighbours.
    fn on_grid(&self, used: &RangeInclusive<f64>, from_s: f64, to_s: f64) -> Result<[Vec<f64>; 8], LogError> {
        let rows = ((to_s - from_s).max(0.0) * RATE_HZ) as usize;
        let grid = Grid::even(from_s, RATE_HZ, rows, LONGEST_PAUSE_S);
        let mut signals = std::array::from_fn::<_, 8, _>(|place| OnGrid::new(place == GUIDANCE));
        let mut begun = false;
        self.each(used, &mut |value| {
            let signal = &mut signals[value.signal];
            if value.signal == SPEED && !begun {
                // Before its first value the speed is that value.
                signal.take(&grid, value.time_s.min(from_s), value.value);
                begun = true;
            }
            signal.take(&grid, value.time_s, value.value);
        })?;
        Ok(signals.map(|signal| signal.finish(&grid)))
    }
}

fn read_trace(bus: &BusLog, how: &Recording<'_>) -> Result<DriveLog, LogError> {
    let (dbc, mut notes) = dbc::parse(&dbc_file(how.dbc)?)?;
    let trace = Trace {
        bus,
        dbc: &dbc,
        // The torque of the guidance is the last one, here and on the grid.
        needed: &NEEDED[..if how.manual { 7 } else { 8 }],
    };
    let (mut survey, heard, read) = trace.survey(&ALWAYS)?;
    notes.append(read);
    let mut findings: Vec<[String; 3]> = notes.iter().map(Note::finding).collect();
    findings.extend(heard.findings());
    heard.check()?;
    let on_grid = &ON_THE_GRID[..if how.manual { 4 } else { 5 }];
    let begins_s = survey.begin(on_grid)?;
    // The ECU's milliseconds are counted from one of its frames.
    let zero_s = match how.manual {
        true => begins_s,
        false => survey.courses[GUIDANCE].first_s,
    };
    let used = survey.used(zero_s, how.stretches)?;
    if used != ALWAYS {
        survey = trace.survey(&used)?.0;
    }
    let start_s = survey.begin(on_grid)?;
    survey.courses[SPEED].check_speed(NEEDED[SPEED])?;
    findings.extend(
        on_grid
            .iter()
            .filter_map(|&place| survey.courses[place].pauses(NEEDED[place])),
    );
    let end_s = survey.end(on_grid);
    let [
        e_y_m,
        mut seen_rad,
        _,
        _,
        torque_nm,
        angle_rad,
        speed,
        guidance_nm,
    ] = trace.on_grid(&used, start_s, end_s)?;
    let (speed_m_per_s, slow) = held(&speed);
    findings.extend(too_slow(&slow));
    for (seen, slow) in seen_rad.iter_mut().zip(&slow) {
        *seen = if *slow { f64::NAN } else { *seen };
    }
    let vehicle = how.vehicle.unwrap_or(far_point::TABLE_9);
    let dt_s = 1.0 / RATE_HZ;
    let e_theta_rad = far_point::driver_yaw_error(&seen_rad, &angle_rad, &vehicle, &speed_m_per_s, dt_s);
    let rows = e_theta_rad.len();
    let guidance_nm = if how.manual { vec![0.0; rows] } else { guidance_nm };
    let mut signals = [e_y_m, e_theta_rad, angle_rad, guidance_nm, torque_nm];
    for signal in &mut signals {
        signal.truncate(rows);
    }
    let mut log = DriveLog::from_signals(start_s - zero_s, dt_s, signals)?;
    log.findings = findings;
    log.tell_speed(&survey.courses[SPEED].range);
    Ok(log.thinned())
}

/// A speed on the grid, the last one where it is missing, and whether each was too slow for the vehicle model.
fn held(speed: &[f64]) -> (Vec<f64>, Vec<bool>) {
    let mut last = speed.iter().copied().find(|v| v.is_finite()).unwrap_or(0.0);
    let held = speed.iter().map(|&v| {
        last = if v.is_finite() { v } else { last };
        (
            // The range in which the vehicle model goes, and a car.
            last.clamp(TOO_SLOW_M_PER_S, TOO_FAST_M_PER_S),
            last < TOO_SLOW_M_PER_S,
        )
    });
    held.unzip()
}

/// How often the vehicle was too slow, in words.
fn too_slow(slow: &[bool]) -> Option<[String; 3]> {
    let seconds = slow.iter().filter(|slow| **slow).count() as f64 / RATE_HZ;
    (seconds > 0.0).then(|| {
        [
            NEEDED[SPEED].to_owned(),
            format!(
                "{seconds:.1} s below {TOO_SLOW_M_PER_S} m/s, where e_theta at the driver's far point cannot be computed"
            ),
            "bridged if short, else cut".to_owned(),
        ]
    })
}
