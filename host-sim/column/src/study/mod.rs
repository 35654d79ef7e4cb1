//! What integrators and buyers of sensors ask of a torsion bar. Where drives are many, a study is a value of the engine's trait
//! ([`haptic_engine::Study`]), which has threads, progress and an end on request.
//!
//! - [`assist`]: overlay or offset, what hands feel of it, margins, what a sudden loss costs.
//! - [`hands`]: whether a hand is at the wheel, and how soon that is known.
//! - [`reading`]: what the ECU reads of K_hg through the bar.
//! - [`sensors`]: the hands' torque by the observer of core, by the angle's sensor; with [`ecu`], the ECU behind the bar, where its
//!   parameters are right and where they are not.

pub mod assist;
pub mod ecu;
pub mod hands;
pub mod reading;
pub mod sensors;

use haptic_core::controller::config::Config;
use haptic_core::controller::params::{BAR_AND_COLUMN_ANGLE, ParamError, Params};
use haptic_core::observer::{Sensor, State};
use haptic_core::quantity::{Radians, Torque};
use haptic_engine::StudyError;
use haptic_sim::Scenario;
use haptic_sim::fields::InFile;
use haptic_sim::models::sensors::camera_looks;
use haptic_sim::models::torsion_bar::{
    AssistParameters, BarPlant, ColumnKind, ColumnParameters, CurveChoice, Usual,
};
use haptic_sim::scenario::{GuidanceParameters, ScenarioBuilder, ScenarioError};
use serde::{Deserialize, Serialize};

/// A column of one's own, as a file (TOML) has it: the two tables of a scenario. It has a bar whatever its kind says.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ColumnFile {
    /// Wheel, bar and sensor; what is not there has its default.
    pub column: ColumnParameters,
    /// Compensator, motor, and an assist in the place of the three of usual practice.
    pub assist: AssistParameters,
}

/// Why a file is no column.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FileError {
    /// Not TOML, or a field that there is not.
    #[error(transparent)]
    Text(#[from] toml::de::Error),
    /// A value that cannot be.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
}

#[derive(Deserialize)]
#[serde(default, deny_unknown_fields)]
#[derive(Default)]
struct Tables {
    column: InFile<ColumnParameters>,
    assist: InFile<AssistParameters>,
}

impl ColumnFile {
    /// Reads a file's text and checks it.
    ///
    /// # Errors
    /// The field, its value and its range.
    pub fn from_toml(text: &str) -> Result<Self, FileError> {
        let tables: Tables = toml::from_str(text)?;
        let (column, assist) = (tables.column.0, tables.assist.0);
        let file = Self { column, assist };
        file.with(Scenario::builder()).build()?;
        Ok(file)
    }

    /// A scenario with this column.
    fn with(&self, builder: ScenarioBuilder) -> ScenarioBuilder {
        let kind = ColumnKind::TorsionBar;
        let column = ColumnParameters { kind, ..self.column };
        builder.column(column).assist(self.assist.clone())
    }

    /// The file's car on the paper's course.
    fn plant(&self) -> Result<BarPlant, ScenarioError> {
        Ok(BarPlant::new(&self.with(Scenario::builder()).build()?))
    }

    /// The curves, by name: the file's, or the three of usual practice.
    pub fn curves(&self) -> Vec<(&'static str, CurveChoice)> {
        let named = |usual: Usual| (usual.name(), CurveChoice::Usual(usual));
        match &self.assist.curve {
            CurveChoice::Usual(Usual::None) => Usual::ALL.map(named).into(),
            CurveChoice::Usual(usual) => vec![named(*usual)],
            points @ CurveChoice::Points(_) => vec![("the file's", points.clone())],
        }
    }

    /// The curve that a study of one takes: the file's, or medium.
    fn one_curve(&self) -> (&'static str, CurveChoice) {
        let mut curves = self.curves();
        let medium = curves.iter().position(|(name, _)| *name == Usual::Medium.name());
        curves.swap_remove(medium.unwrap_or(0))
    }
}

/// How often an angle is sampled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Rate {
    /// 1 kHz.
    EveryStep,
    /// 120 Hz, on the grid of 1 ms.
    Camera,
}

impl Rate {
    /// In Hz.
    pub fn hz(self) -> f64 {
        match self {
            Self::EveryStep => 1000.0,
            Self::Camera => 120.0,
        }
    }

    /// Whether an angle is sampled in a step.
    fn samples(self, step: u32) -> bool {
        self == Self::EveryStep || camera_looks(step)
    }
}

/// A column that the observer cannot be set up for.
fn no_observer(why: ParamError) -> StudyError {
    format!("the observer: {why}").into()
}

/// What an ECU is told of a file's column, whose angle comes every so many seconds.
fn believed(file: &ColumnFile, column_period_s: f64, observer_bandwidth_rad_per_s: f64) -> Params {
    let told = GuidanceParameters::default().told_of(&file.column);
    Params {
        // The studies give the ECU the angle of the column.
        torque_sensor: BAR_AND_COLUMN_ANGLE,
        column_period_s,
        observer_bandwidth_rad_per_s,
        ..told.controller
    }
}

/// What an ECU makes of the bar's torque and, where it is sampled, the angle.
fn hands_torque(config: &Config, state: &mut State, bar_torque: Torque, angle: Option<Radians>) -> Torque {
    match config.sensor() {
        Some(Sensor::Bar(observer)) => observer.step(state, bar_torque, angle),
        Some(Sensor::Hands) | None => bar_torque,
    }
}

/// The root of the mean square.
fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), x| (sum + x * x, count + 1.0));
    f64::sqrt(sum / f64::max(count, 1.0))
}
