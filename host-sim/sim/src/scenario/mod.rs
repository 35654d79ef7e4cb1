//! A scenario: everything that decides a run, from a TOML file in which every field has a default.
//!
//! Fields bear the paper's symbols; defaults are tables 7 to 9. Terms: *condition*, how much the driver relies
//! on the guidance (section 5.1): a name for a pair of arm gains, or manual driving. *Failure*: the guidance
//! torque drops to zero, or its lane preview stops; the driver keeps the gains for one more second and then
//! drives as manually.

mod builder;
mod file;
mod guidance_file;
mod speed;
#[cfg(test)]
mod tests;

use std::fmt;

use haptic_core::config::Setup;
use haptic_core::params::{Params, VehicleParams};
use serde::{Deserialize, Serialize};

pub use builder::{ScenarioBuilder, ScenarioError};
pub(crate) use speed::SpeedProfile;
pub use speed::{ACCELERATION_M_PER_S2, CHANGING_SPEED_KMH, SPEED_KMH, Speed};

use crate::input::{InputError, in_range};
use crate::models::disturbances::SensorErrors;
use crate::models::driver::{ArmGains, DriverParameters};
use crate::models::real::WorldParameters;
use crate::models::road::{Course, LaneChoice};
use crate::models::tolerances::{Car, Tolerances};
use crate::models::vehicle::VehicleParameters;
use crate::seeds::Stream;

/// Speed of the paper's experiment and evaluation, km/h.
pub const DEFAULT_SPEED_KMH: f64 = 60.0;
/// When the paper lets the guidance fail, s.
pub const DEFAULT_FAILURE_TIME_S: f64 = 70.0;
/// How long the driver takes to notice a failure, s (section 5.2).
pub const FAILURE_REACTION_S: f64 = 1.0;

/// Shortest run, s. A course has to be longer than the look-ahead by as much, so that there is something to
/// measure.
const LEAST_DURATION_S: f64 = 1.0;

/// How the driver drives (section 5.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Condition {
    /// Without guidance.
    Manual,
    /// Relying on the guidance.
    High,
    /// In between; table 4's gains.
    Mid,
    /// Hardly relying on it.
    Low,
    /// With other gains than the paper's.
    #[serde(skip_deserializing)]
    Custom,
}

impl Condition {
    /// The paper's four.
    pub const ALL: [Self; 4] = [Self::Manual, Self::High, Self::Mid, Self::Low];

    /// The arm's gains under this condition; table 4's for gains of one's own.
    pub fn gains(self) -> ArmGains {
        match self {
            Self::Manual => ArmGains::MANUAL,
            Self::High => ArmGains { k_d: 2.0, k_hg: 0.0 },
            Self::Mid | Self::Custom => ArmGains { k_d: 3.0, k_hg: 0.5 },
            Self::Low => ArmGains { k_d: 4.0, k_hg: 1.0 },
        }
    }
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Manual => "manual",
            Self::High => "high",
            Self::Mid => "mid",
            Self::Low => "low",
            Self::Custom => "custom",
        })
    }
}

/// What the controller sees of the world.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Sensors {
    /// Full resolution every millisecond, past the bus: shows the controller alone.
    Exact,
    /// The paper's resolutions and 120 Hz, over the bus frames.
    #[default]
    Paper,
}

/// What fails.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FailureKind {
    /// Nothing.
    #[default]
    None,
    /// The guidance torque drops to zero (section 5.2).
    Torque,
    /// The lane preview stops; the ECU lives and hands over.
    Input,
}

impl fmt::Display for FailureKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::None => "none",
            Self::Torque => "torque",
            Self::Input => "input",
        })
    }
}

/// A failure and its time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Failure {
    /// What fails.
    pub kind: FailureKind,
    /// When, s after the start.
    #[serde(rename = "time")]
    pub time_s: f64,
}

impl Failure {
    /// When something fails, if anything does, s.
    pub fn at_s(&self) -> Option<f64> {
        (self.kind != FailureKind::None).then_some(self.time_s)
    }
}

impl Default for Failure {
    fn default() -> Self {
        Self {
            kind: FailureKind::None,
            time_s: DEFAULT_FAILURE_TIME_S,
        }
    }
}

/// A driver who changes in mid-drive, before a failure is noticed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriverChange {
    /// When, s after the start.
    #[serde(rename = "time")]
    pub time_s: f64,
    /// K_d from then on, N.m/rad.
    #[serde(rename = "K_d", alias = "k_d")]
    pub k_d: f64,
    /// K_hg from then on.
    #[serde(rename = "K_hg", alias = "k_hg")]
    pub k_hg: f64,
}

impl DriverChange {
    /// The arm's gains from then on.
    pub fn gains(&self) -> ArmGains {
        ArmGains {
            k_d: self.k_d,
            k_hg: self.k_hg,
        }
    }
}

/// The controller and the camera that feeds it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GuidanceParameters {
    /// The controller's own parameters; the default is table 8.
    pub controller: Params,
    /// t'_n, look-ahead time of the camera's near point, s.
    pub t_n: f64,
    /// t'_f, look-ahead time of its far point, s.
    pub t_f: f64,
    /// Whether the host asks for the probe. Seen only by the shipping controller.
    pub probe: bool,
}

impl Default for GuidanceParameters {
    fn default() -> Self {
        Self {
            controller: Params::PAPER,
            t_n: 0.3,
            t_f: 0.7,
            probe: false,
        }
    }
}

/// Everything that decides a run, checked: whoever holds one may simulate it. Made by a [`ScenarioBuilder`] or from
/// the text of a file.
#[derive(Debug, Clone)]
pub struct Scenario {
    values: Values,
    /// These follow from the values.
    setup: Setup,
    speed: SpeedProfile,
}

/// The values that a person chooses.
#[derive(Debug, Clone, PartialEq)]
struct Values {
    course: Course,
    speed: Speed,
    manual: bool,
    driver: DriverParameters,
    gains: ArmGains,
    manual_k_d: f64,
    vehicle: VehicleParameters,
    guidance: GuidanceParameters,
    sensors: Sensors,
    failure: Failure,
    driver_change: Option<DriverChange>,
    world: WorldParameters,
    sensor_errors: SensorErrors,
    tolerances: Tolerances,
    seed: u64,
}

impl Default for Values {
    fn default() -> Self {
        Self {
            course: Course::paper(),
            speed: Speed::Constant(DEFAULT_SPEED_KMH),
            manual: false,
            driver: DriverParameters::default(),
            gains: Condition::Mid.gains(),
            manual_k_d: ArmGains::MANUAL.k_d,
            vehicle: VehicleParameters::default(),
            guidance: GuidanceParameters::default(),
            sensors: Sensors::default(),
            failure: Failure::default(),
            driver_change: None,
            world: WorldParameters::default(),
            sensor_errors: SensorErrors::default(),
            tolerances: Tolerances::default(),
            seed: 1,
        }
    }
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
            values: Values::default(),
            setup: Setup::PAPER,
            speed: SpeedProfile::constant(DEFAULT_SPEED_KMH),
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

    /// The scenario as the text of a file that needs no other file: read again it is the same scenario, bit for bit. A
    /// course of OpenDRIVE is made of pieces that are written with rounding, so that a run on it is not the same to the last bit.
    pub fn to_toml(&self) -> String {
        // Only a map whose keys are no strings cannot be written, and there is none.
        file::write(self).unwrap_or_default()
    }

    /// Whether what is to happen in mid-drive happens before the run ends.
    ///
    /// # Errors
    /// The field whose time is too late, with its value and range.
    pub fn check_times(&self) -> Result<(), ScenarioError> {
        let change_s = self.values.driver_change.map(|change| change.time_s);
        let times = [
            ("failure.time", self.failure().at_s()),
            ("driver_change.time", change_s),
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

    /// The same once a failure is noticed, and the driver drives as manually.
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

    /// The car that drives: what vehicle, world and sensor errors say, with what the tolerances draw.
    pub fn car(&self) -> Car {
        let Values {
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

impl Values {
    /// The controller's parameters with what it knows of the vehicle.
    fn controller_params(&self) -> Params {
        Params {
            vehicle: self.vehicle_for_plausibility(),
            ..self.guidance.controller
        }
    }

    /// The vehicle as the controller's plausibility checks know it: the true one, from tables 8 and 9.
    fn vehicle_for_plausibility(&self) -> VehicleParams {
        let (near_time_s, far_time_s) = (self.guidance.t_n, self.guidance.t_f);
        if self.vehicle == VehicleParameters::default() {
            // The constants of the shipped image, so that host and target hold the same bits.
            return VehicleParams {
                far_time_s,
                near_time_s,
                ..Params::PAPER.vehicle
            };
        }
        let VehicleParameters {
            m,
            l_f,
            l_r,
            k_f,
            k_r,
            k_t,
            b_s,
            ..
        } = self.vehicle;
        let l = l_f + l_r;
        // The ECU knows understeering vehicles alone: a neutral or oversteering one is told as neutral.
        let stability = m * (l_r * k_r - l_f * k_f) / (2.0 * l * l * k_f * k_r);
        VehicleParams {
            curvature_gain_per_m: k_t / l,
            stability_factor_s2_per_m2: stability.max(0.0),
            aligning_gain_nm_s2_per_m: self.vehicle.aligning_stiffness() * m * l_r / (2.0 * l * k_f),
            column_damping_nm_s: b_s,
            far_time_s,
            near_time_s,
        }
    }
}
