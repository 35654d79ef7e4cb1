//! A scenario: everything that decides a run, from a TOML file in which every field has a default.
//!
//! Fields bear the paper's symbols and their units ([`mod@crate::fields`]); defaults are tables 7 to 9. Terms: *condition*, how much the driver relies
//! on the guidance (section 5.1): a name for a pair of arm gains, or manual driving. *Failure*: the guidance
//! torque drops to zero, or its lane preview stops; the driver keeps the gains for one more second and then
//! drives as manually.

mod builder;
mod condition;
mod failure;
mod file;
mod guidance_file;
mod speed;
#[cfg(test)]
mod tests;
mod values;

use haptic_core::controller::config::Setup;
use haptic_core::controller::params::Params;
use toml::Table;

pub use builder::{ScenarioBuilder, ScenarioError};
pub use condition::{Condition, Sensors};
pub use failure::{DEFAULT_FAILURE_TIME_S, DriverChange, Failure, FailureKind};
pub use file::{FieldsOf, TABLES, fields_of, unit_of};
pub use speed::{ACCELERATION_M_PER_S2, CHANGING_SPEED_M_PER_S, SPEED_M_PER_S, Speed, SpeedProfile};
pub use values::{GuidanceParameters, ScenarioValues};

use crate::input::{InputError, in_range, parse_toml};
use crate::models::disturbances::SensorErrors;
use crate::models::driver::{ArmGains, DriverParameters};
use crate::models::nonlinear::WorldParameters;
use crate::models::road::{Course, LaneChoice};
use crate::models::tolerances::{Car, Tolerances};
use crate::models::torsion_bar::{AssistParameters, ColumnParameters};
use crate::models::vehicle::VehicleParameters;
use crate::seeds::Stream;

/// Speeds that a person asks a command for, km/h.
pub const SPEED_KMH: std::ops::RangeInclusive<f64> = 20.0..=250.0;

/// Speed of the paper's experiment and evaluation, km/h.
pub const DEFAULT_SPEED_KMH: f64 = 60.0;

/// Shortest run, s. A course has to be longer than the look-ahead by as much, so that there is something to
/// measure.
const LEAST_DURATION_S: f64 = 1.0;

/// Everything that decides a run, checked: whoever holds one may simulate it. Made by a [`ScenarioBuilder`] or from
/// the text of a file.
#[derive(Debug, Clone)]
pub struct Scenario {
    values: ScenarioValues,
    /// These follow from the values.
    setup: Setup,
    speed: SpeedProfile,
}

impl PartialEq for Scenario {
    fn eq(&self, other: &Self) -> bool {
        self.values == other.values
    }
}

impl Default for Scenario {
    /// Driver 1 with medium reliance on the evaluation's course, tables 7 to 9.
    fn default() -> Self {
        Self {
            values: ScenarioValues::default(),
            setup: Setup::PAPER,
            speed: SpeedProfile::constant(DEFAULT_SPEED_KMH / 3.6),
        }
    }
}

impl Scenario {
    /// A builder that holds the defaults: tables 7 to 9.
    pub fn builder() -> ScenarioBuilder {
        ScenarioBuilder::default()
    }

    /// A builder that holds this scenario's values.
    pub fn to_builder(&self) -> ScenarioBuilder {
        ScenarioBuilder {
            values: self.values.clone(),
        }
    }

    /// Checks the text of a scenario file; `name` stands for the file in errors, `course` opens a course by the
    /// name that the file gives it, unless that is the built-in one.
    ///
    /// # Errors
    /// A syntax error (with its line), an unknown field (by name), as [`ScenarioBuilder::build`]; what `course`
    /// says.
    pub fn from_toml(
        name: &str,
        text: &str,
        course: impl FnOnce(&str, &LaneChoice) -> Result<Course, InputError>,
    ) -> Result<Self, InputError> {
        let builder = ScenarioBuilder::from_toml(name, text, course)?;
        builder.build().map_err(|e| InputError::new(name, e))
    }

    /// A scenario from what its file says, as [`Scenario::from_toml`] gives it from the text.
    ///
    /// # Errors
    /// What [`Scenario::from_toml`] says of that text.
    pub fn from_table(
        name: &str,
        table: Table,
        course: impl FnOnce(&str, &LaneChoice) -> Result<Course, InputError>,
    ) -> Result<Self, InputError> {
        // Why a table is refused, the reader of texts says better.
        let read = table.clone().try_into();
        let file = read.or_else(|_| parse_toml(name, &table.to_string()))?;
        let builder = file::values(name, file, course)?;
        builder.build().map_err(|e| InputError::new(name, e))
    }

    /// Takes another scenario's road where it is the same, so that it is made once.
    pub fn share_road(&mut self, with: &Self) {
        if self.values.course == with.values.course {
            self.values.course = with.values.course.clone();
        }
    }

    /// The scenario as the text of a file that needs no other file: read again it is the same scenario, bit for bit. A
    /// course of OpenDRIVE is made of pieces that are written with rounding, so that a run on it is not the same to the last bit.
    pub fn to_toml(&self) -> String {
        // Only a map whose keys are no strings cannot be written, and there is none.
        file::write(self).unwrap_or_default()
    }

    /// Every value that a person chose.
    pub fn values(&self) -> &ScenarioValues {
        &self.values
    }

    /// Whether what is to happen in mid-drive happens before the run ends.
    ///
    /// # Errors
    /// The field whose time is too late, with its value and range.
    pub fn check_times(&self) -> Result<(), ScenarioError> {
        let change_s = self.values.driver_change.map(|change| change.time_s);
        let times = [
            ("failure.time_s", self.failure().at_s()),
            ("driver_change.time_s", change_s),
            ("column.fault_time_s", self.column().fault_at_s()),
        ];
        for (field, time_s) in times {
            if let Some(time_s) = time_s {
                self.check_time(field, time_s)?;
            }
        }
        Ok(())
    }

    /// Whether a time lies within the run.
    ///
    /// # Errors
    /// `field`, the value and its range.
    pub fn check_time(&self, field: &str, time_s: f64) -> Result<(), ScenarioError> {
        // Whole tenths, for people to read.
        let end_s = (10.0 * self.duration_s()).floor() / 10.0;
        in_range(field, time_s, 0.0..=end_s, "s").map_err(ScenarioError::AfterTheEnd)
    }

    /// The road.
    pub fn course(&self) -> &Course {
        &self.values.course
    }

    /// How fast the vehicle goes.
    pub fn speed(&self) -> &Speed {
        &self.values.speed
    }

    /// Whether the speed changes in the run.
    pub fn changes_speed(&self) -> bool {
        !self.speed.is_constant()
    }

    /// Speed at the start, km/h: that of the whole run unless it changes.
    pub fn speed_kmh(&self) -> f64 {
        self.values.speed.start_kmh()
    }

    /// Speed over the run.
    pub(crate) fn speed_profile(&self) -> &SpeedProfile {
        &self.speed
    }

    /// How the driver drives: follows from the gains and from whether there is guidance.
    pub fn condition(&self) -> Condition {
        if self.values.manual {
            return Condition::Manual;
        }
        [Condition::High, Condition::Mid, Condition::Low]
            .into_iter()
            .find(|condition| condition.gains() == self.values.gains)
            .unwrap_or(Condition::Custom)
    }

    /// The driver's vision, delay, arm and remnant.
    pub fn driver(&self) -> &DriverParameters {
        &self.values.driver
    }

    /// How the driver's arm weighs vision against guidance, until a failure is noticed.
    pub fn gains(&self) -> ArmGains {
        self.values.gains
    }

    /// The gains once a failure is noticed, and the driver drives as manually.
    pub fn manual_gains(&self) -> ArmGains {
        ArmGains {
            k_d: self.values.manual_k_d,
            ..ArmGains::MANUAL
        }
    }

    /// The vehicle on paper, which the controller knows.
    pub fn vehicle(&self) -> &VehicleParameters {
        &self.values.vehicle
    }

    /// The controller and its camera.
    pub fn guidance(&self) -> &GuidanceParameters {
        &self.values.guidance
    }

    /// What the controller sees.
    pub fn sensors(&self) -> Sensors {
        self.values.sensors
    }

    /// What fails.
    pub fn failure(&self) -> Failure {
        self.values.failure
    }

    /// When the driver changes how vision is weighed against guidance, if that happens.
    pub fn driver_change(&self) -> Option<DriverChange> {
        self.values.driver_change
    }

    /// What is less than ideal in the world.
    pub fn world(&self) -> &WorldParameters {
        &self.values.world
    }

    /// What the sensors add to the truth.
    pub fn sensor_errors(&self) -> &SensorErrors {
        &self.values.sensor_errors
    }

    /// How far cars of this kind differ.
    pub fn tolerances(&self) -> &Tolerances {
        &self.values.tolerances
    }

    /// What the steering column is.
    pub fn column(&self) -> &ColumnParameters {
        &self.values.column
    }

    /// What amplifies the torque of its bar.
    pub fn assist(&self) -> &AssistParameters {
        &self.values.assist
    }

    /// The car that drives: what vehicle, world and sensor errors say, with what the tolerances draw.
    pub fn car(&self) -> Car {
        let ScenarioValues {
            vehicle,
            world,
            sensor_errors,
            tolerances,
            seed,
            ..
        } = self.values;
        let number = tolerances.car.unwrap_or(seed);
        tolerances.draw(
            Stream::Car.seed(number),
            &Car {
                vehicle,
                world,
                sensor_errors,
            },
        )
    }

    /// Root of all random numbers.
    pub fn seed(&self) -> u64 {
        self.values.seed
    }

    /// The controller's checked parameters.
    pub fn setup(&self) -> &Setup {
        &self.setup
    }

    /// The controller's parameters with what it knows of the vehicle.
    pub fn controller_params(&self) -> Params {
        self.values.controller_params()
    }

    /// Speed at the start, m/s: that of the whole run unless it changes.
    pub fn speed_m_per_s(&self) -> f64 {
        self.speed.start_m_per_s()
    }

    /// Mean speed between two times of a run that follows the road, m/s.
    pub fn mean_speed_m_per_s(&self, from_s: f64, to_s: f64) -> f64 {
        if self.speed.is_constant() {
            return self.speed_m_per_s();
        }
        (self.speed.way_m(to_s) - self.speed.way_m(from_s)) / (to_s - from_s)
    }

    /// Distance of the farthest point that anybody looks at when the run ends, m: it ends because that point reaches
    /// the end of the course. With table 8 it is the driver's far point.
    pub fn look_ahead_m(&self) -> f64 {
        let (_, v) = self.end();
        v * self.longest_look_ahead_s()
    }

    /// Arc length that the centre of gravity reaches in a run that does not diverge, m: the course's, less the
    /// look-ahead.
    pub fn reach_m(&self) -> f64 {
        self.values.course.length_m() - self.look_ahead_m()
    }

    /// How long a run lasts that does not diverge, s. In curves the points ahead lie a little further along
    /// the road than their distance, so a run may end some hundredths of a second earlier.
    pub fn duration_s(&self) -> f64 {
        self.end().0
    }

    /// When the run ends that does not diverge, s, and the speed then, m/s.
    fn end(&self) -> (f64, f64) {
        let length_m = self.values.course.length_m();
        self.speed.end(length_m, self.longest_look_ahead_s())
    }

    pub(crate) fn longest_look_ahead_s(&self) -> f64 {
        let DriverParameters { t_n, t_f, .. } = self.values.driver;
        let guidance = &self.values.guidance;
        t_n.max(t_f).max(guidance.t_n).max(guidance.t_f)
    }
}
