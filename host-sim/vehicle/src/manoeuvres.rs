//! Which drive would tell what a record does not.
//!
//! Each manoeuvre is simulated with the values that the record led to, and what it would tell is added to what the record tells,
//! with the noise that the record had. The errors that follow are those of one drive of it behind the record.

use std::f64::consts::{PI, TAU};

use nalgebra::DMatrix;
use serde::Serialize;

use super::fit::sensitivity;
use super::log::{VehicleColumns, VehicleLog};
use super::model::{Physical, wheel_angle, yaw_rate};
use super::quantities::{Errors, QUANTILE_95, QUANTITIES, STEPS, beforehand};
use super::{Fits, P, Part, with_column};

const RATE_HZ: f64 = 100.0;
const STEP_S: f64 = 1.0 / RATE_HZ;
/// How long each goes on, s.
const LENGTH_S: f64 = 60.0;
/// Lateral acceleration of sine and step, m/s2.
const LATERAL_M_PER_S2: f64 = 2.5;

/// A kind of drive on an empty place.
#[derive(Debug, Clone, Copy)]
enum Kind {
    Sine,
    Step,
    Ramp,
}

const KINDS: [(&str, &str, Kind); 3] = [
    (
        "sine",
        "turn the wheel to and fro at 0.3 Hz, up to 2.5 m/s2, at a steady 80 km/h, for a minute",
        Kind::Sine,
    ),
    (
        "step",
        "turn the wheel within 0.3 s, up to 2.5 m/s2 at a steady 80 km/h, hold it for 3 s, turn back; to both sides, for a minute",
        Kind::Step,
    ),
    (
        "ramp",
        "hold the wheel still in a wide turn and let the speed rise slowly from 20 to 90 km/h; to both sides, a minute together",
        Kind::Ramp,
    ),
];

/// A drive that would tell something.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Manoeuvre {
    /// Its name.
    pub name: &'static str,
    /// How it is driven.
    pub how: &'static str,
    /// What it would tell, of what is not identified.
    pub tells: Vec<Telling>,
}

/// A quantity that a drive would tell.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Telling {
    /// The quantity.
    pub name: &'static str,
    /// Half of its interval behind record and manoeuvre, as text with its unit: of 95 %, if [`Telling::hold_at`] says nothing else.
    pub half_width: String,
    /// Whether it would be identified.
    pub identified: bool,
    #[serde(skip)]
    errors: Errors,
}

impl Telling {
    /// Takes the interval that reaches so many standard deviations of a normal distribution. What would be identified stays so.
    pub fn hold_at(&mut self, deviations: f64) {
        self.half_width = self.errors.half_as_text(deviations);
    }
}

/// What each manoeuvre would tell of these quantities; nothing without a fit of the vehicle.
pub(super) fn telling(fits: &Fits<'_>, lacking: &[&str]) -> Vec<Manoeuvre> {
    if fits.vehicle.is_err() || lacking.is_empty() {
        return Vec::new();
    }
    KINDS
        .iter()
        .filter_map(|(name, how, kind)| {
            Some(Manoeuvre {
                name,
                how,
                tells: tells(fits, *kind, lacking)?,
            })
        })
        .collect()
}

fn tells(fits: &Fits<'_>, kind: Kind, lacking: &[&str]) -> Option<Vec<Telling>> {
    let vehicle = fits.vehicle.as_ref().ok()?;
    let column = fits
        .column
        .as_ref()
        .ok()
        .filter(|_| fits.refuted(Part::Column).is_none());
    let known = fits.known;
    let at = column.map_or(&vehicle.parameters, |fit| &fit.parameters);
    let log = drive(kind, &Physical::of(known, at), known.wheelbase_m)?;
    let own = vehicle.noise.information(&sensitivity(
        &|x| yaw_rate(&log, known, x),
        &vehicle.parameters,
        &STEPS[..P::VEHICLE],
    ));
    let before = beforehand(known);
    let sure = DMatrix::from_fn(P::VEHICLE, P::VEHICLE, |i, j| {
        if i == j { before[i].1.powi(-2) } else { 0.0 }
    });
    let of_vehicle = own + &vehicle.information + sure;
    let of_column = column.and_then(|fit| {
        let own = fit.noise.information(&sensitivity(
            &|x| wheel_angle(&log, known, x),
            &fit.parameters,
            &STEPS,
        ));
        (own + &fit.information + with_column(&of_vehicle, known)).cholesky()
    });
    let of_column = of_column.map(|all| all.inverse());
    let of_vehicle = of_vehicle.cholesky()?.inverse();
    let speed = fits.log.mean_speed_m_per_s;
    let asked = QUANTITIES.iter().filter(|of| lacking.contains(&of.name));
    let tell = asked.filter_map(|of| {
        let (fit, covariance) = match of.part {
            Part::Vehicle => (vehicle, &of_vehicle),
            Part::Column => (column?, of_column.as_ref()?),
        };
        let found = of.known(known, &fit.parameters, covariance, speed);
        Some(Telling {
            name: of.name,
            half_width: found.half_as_text(QUANTILE_95),
            identified: of.lacks(&found).is_none(),
            errors: found,
        })
    });
    Some(tell.collect())
}

/// The manoeuvre as a record. The torque is the one that a still column takes, and what turns the wheel quickly comes on top, as the
/// angle's curvature times a usual inertia: how exactly it fits the column does not matter for what it tells.
fn drive(kind: Kind, physical: &Physical, wheelbase_m: f64) -> Option<VehicleLog> {
    let rows = (LENGTH_S * RATE_HZ) as usize;
    let time_s: Vec<f64> = (0..rows).map(|k| k as f64 * STEP_S).collect();
    let fast = 80.0 / 3.6;
    let amplitude = LATERAL_M_PER_S2 / fast / physical.yaw_rate_gain(fast);
    let speed = |t: f64| match kind {
        Kind::Ramp => (20.0 + 70.0 * (2.0 * t / LENGTH_S).fract()) / 3.6,
        Kind::Sine | Kind::Step => fast,
    };
    let wheel = |t: f64| match kind {
        Kind::Sine => amplitude * (TAU * 0.3 * t).sin(),
        Kind::Step => amplitude * steps(t),
        // As far as the lateral acceleration allows at the end.
        Kind::Ramp => amplitude * (fast / (90.0 / 3.6)).powi(2) * if t < 0.5 * LENGTH_S { 1.0 } else { -1.0 },
    };
    let torque = |t: f64| {
        let curvature = (wheel(t + STEP_S) - 2.0 * wheel(t) + wheel(t - STEP_S)) * RATE_HZ * RATE_HZ;
        let lateral = speed(t) * physical.yaw_rate_gain(speed(t)) * wheel(t);
        physical.aligning_gain() * lateral + physical.column_inertia() * curvature
    };
    let columns = VehicleColumns {
        wheel_angle_rad: time_s.iter().map(|t| wheel(*t)).collect(),
        yaw_rate_rad_per_s: time_s
            .iter()
            .map(|t| wheel(*t) * physical.yaw_rate_gain(speed(*t)))
            .collect(),
        speed_m_per_s: time_s.iter().map(|t| speed(*t)).collect(),
        driver_torque_nm: Some(time_s.iter().map(|t| torque(*t)).collect()),
        guidance_torque_nm: None,
        time_s,
    };
    VehicleLog::new(&columns, wheelbase_m).ok()
}

/// Steps to the left, back, to the right, back, each within 0.3 s and held for 3 s.
fn steps(t: f64) -> f64 {
    const LEVELS: [f64; 5] = [0.0, 1.0, 0.0, -1.0, 0.0];
    let place = t / 3.0;
    let level = place as usize % 4;
    let share = ((place.fract() * 3.0) / 0.3).min(1.0);
    LEVELS[level] + (LEVELS[level + 1] - LEVELS[level]) * 0.5 * (1.0 - (PI * share).cos())
}
