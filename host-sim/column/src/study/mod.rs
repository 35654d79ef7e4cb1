//! What integrators and buyers of sensors ask of a torsion bar. Each study is its cases, what one case gives, and a result of all;
//! threads and progress are whose program it is.
//!
//! - [`assist`]: overlay or offset, what hands feel of it, margins, what a sudden loss costs.
//! - [`sensors`]: the hands' torque by the observer of core, by the angle's sensor.
//! - [`ecu`]: the ECU behind the bar, where its parameters are right and where they are not.

pub mod assist;
pub mod ecu;
pub mod sensors;

use haptic_core::controller::params::Params;
use serde::Deserialize;

use crate::{BarParameters, ColumnError, Curve};
use haptic_sim::models::vehicle::VehicleParameters;

/// A column of one's own, as a file (TOML) has it.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ColumnFile {
    /// Wheel, bar, sensor, compensator and motor; what is not there has its default.
    #[serde(default)]
    pub column: BarParameters,
    /// An assist in the place of the three of usual practice.
    pub assist: Option<Curve>,
}

/// Why a file is no column.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FileError {
    /// Not TOML, or a field that there is not.
    #[error(transparent)]
    Text(#[from] toml::de::Error),
    /// A value that cannot be.
    #[error(transparent)]
    Column(#[from] ColumnError),
}

impl ColumnFile {
    /// Reads a file's text and checks it.
    ///
    /// # Errors
    /// The field, its value and its range.
    pub fn from_toml(text: &str) -> Result<Self, FileError> {
        let file: Self = toml::from_str(text)?;
        file.column.check(&VehicleParameters::default())?;
        if let Some(curve) = &file.assist {
            curve.check()?;
        }
        Ok(file)
    }

    /// The assist of the sensors' studies: the file's, or medium of the three.
    fn medium(&self) -> Curve {
        self.assist.clone().unwrap_or_else(|| Curve::usual(1.0))
    }

    /// The curves, by name: the file's, or the three of usual practice.
    pub fn curves(&self) -> Vec<(&'static str, Curve)> {
        match &self.assist {
            Some(curve) => vec![("the file's", curve.clone())],
            None => [("light", 0.5), ("medium", 1.0), ("strong", 1.25)]
                .map(|(name, factor)| (name, Curve::usual(factor)))
                .into(),
        }
    }
}

/// What an ECU is told of a file's column, whose angle comes every so many seconds.
fn believed(file: &ColumnFile, column_period_s: f64, observer_bandwidth_rad_per_s: f64) -> Params {
    let column = &file.column;
    Params {
        torque_sensor: 1.0,
        wheel_inertia_kg_m2: column.j_w_kg_m2,
        wheel_damping_nm_s: column.b_w_nms_per_rad,
        wheel_friction_nm: column.upper_friction_nm,
        bar_stiffness_nm_per_rad: column.k_tb_nm_per_rad,
        column_period_s,
        observer_bandwidth_rad_per_s,
        ..Params::PAPER
    }
}

/// The root of the mean square.
fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), x| (sum + x * x, count + 1.0));
    f64::sqrt(sum / f64::max(count, 1.0))
}
