//! How a scenario is made, and why it is refused.

use haptic_core::controller::config::Setup;

use super::guidance_file::in_words_of_the_file;
use super::{
    Condition, DriverChange, Failure, FailureKind, GuidanceParameters, LEAST_DURATION_S, Scenario,
    ScenarioValues, Sensors, Speed, file,
};
use crate::fields::Fields;
use crate::input::{InputError, RangeError, parse_toml};
use crate::models::disturbances::SensorErrors;
use crate::models::driver::{ArmGains, ArmInFile, DriverParameters};
use crate::models::nonlinear::WorldParameters;
use crate::models::road::{Course, LaneChoice};
use crate::models::tolerances::Tolerances;
use crate::models::torsion_bar::{AssistParameters, ColumnParameters};
use crate::models::vehicle::VehicleParameters;

/// Chooses the values of a [`Scenario`]; each has a default.
#[derive(Debug, Clone, Default)]
#[must_use]
pub struct ScenarioBuilder {
    pub(super) values: ScenarioValues,
}

/// Why there is no such scenario.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ScenarioError {
    /// A value outside its range.
    #[error(transparent)]
    Range(#[from] RangeError),
    /// An instant outside the run.
    #[error("{0}: the run ends there")]
    AfterTheEnd(RangeError),
    /// Points of a speed that do not go together.
    #[error("{0}")]
    Speed(String),
    /// A manual driver with something that takes guidance.
    #[error("condition = \"manual\" has no guidance, but {what}; {cure}")]
    ManualWith {
        /// The field, with its value.
        what: String,
        /// What to do about it.
        cure: &'static str,
    },
    /// The wheel has more of something than wheel and column together.
    #[error("column.{field} = {value} {unit} leaves the column none of the vehicle's {all} {unit}")]
    WheelHasAll {
        /// The field.
        field: &'static str,
        /// Its value.
        value: f64,
        /// Its unit.
        unit: &'static str,
        /// That of wheel and column together.
        all: f64,
    },
    /// Points of an assist that are no curve.
    #[error("{field} has to be: {is}")]
    Curve {
        /// The field.
        field: &'static str,
        /// What it has to be.
        is: &'static str,
    },
    /// A value of a bar or its assist, where there is none.
    #[error("{0} takes column.kind = \"torsion-bar\"")]
    WithoutBar(String),
    /// Guidance in front of an assist that there is not.
    #[error(
        "assist.inject = \"offset\" takes an assist.curve other than \"none\": without one the guidance turns nothing"
    )]
    OffsetOfNothing,
    /// A value of the rigid column, where there is a bar.
    #[error(
        "{field} = {value} is of a rigid column, and column.kind is \"torsion-bar\": leave it out, {instead} has it"
    )]
    OfTheRigidColumn {
        /// The field.
        field: &'static str,
        /// Its value.
        value: f64,
        /// What a column with a bar has in its place.
        instead: &'static str,
    },
    /// A course with less than a second to drive.
    #[error(
        "course {course} is {length_m:.1} m long, but at {speed_kmh} km/h it needs {needed_m:.1} m: {look_ahead_m:.1} m of \
         look-ahead ({look_ahead_s:.2} s) and {LEAST_DURATION_S} s to drive"
    )]
    CourseTooShort {
        /// Its name.
        course: String,
        /// Its length, m.
        length_m: f64,
        /// The length that it needs, m.
        needed_m: f64,
        /// Speed, km/h.
        speed_kmh: f64,
        /// Look-ahead at that speed, m.
        look_ahead_m: f64,
        /// Look-ahead time, s.
        look_ahead_s: f64,
    },
}

impl ScenarioBuilder {
    /// The values in the text of a scenario file, not yet checked against their ranges; `name` and `course` as in
    /// [`Scenario::from_toml`].
    ///
    /// # Errors
    /// A syntax error (with its line), an unknown field (by name); what `course` says.
    pub fn from_toml(
        name: &str,
        text: &str,
        course: impl FnOnce(&str, &LaneChoice) -> Result<Course, InputError>,
    ) -> Result<Self, InputError> {
        file::values(name, parse_toml(name, text)?, course)
    }

    /// The road.
    pub fn course(mut self, course: Course) -> Self {
        self.values.course = course;
        self
    }

    /// Constant speed, km/h: 20 to 250. What a file says is in m/s.
    pub fn speed_kmh(mut self, speed_kmh: f64) -> Self {
        self.values.speed = Speed::constant_kmh(speed_kmh);
        self
    }

    /// How fast the vehicle goes.
    pub fn speed(mut self, speed: Speed) -> Self {
        self.values.speed = speed;
        self
    }

    /// How the driver drives, with the gains that the paper gives the condition. [`Condition::Custom`] is guidance
    /// with whatever gains were chosen.
    pub fn condition(mut self, condition: Condition) -> Self {
        self.values.manual = condition == Condition::Manual;
        if condition != Condition::Custom {
            self.values.gains = condition.gains();
        }
        self
    }

    /// The driver's vision, delay, arm and remnant.
    pub fn driver(mut self, driver: DriverParameters) -> Self {
        self.values.driver = driver;
        self
    }

    /// How the driver's arm weighs vision against guidance; call it behind [`ScenarioBuilder::condition`], which
    /// has gains of its own.
    pub fn gains(mut self, gains: ArmGains) -> Self {
        self.values.gains = gains;
        self
    }

    /// K_d of a driver who has noticed that guidance failed, N.m/rad; the paper's 4 without it.
    pub fn manual_k_d(mut self, k_d: f64) -> Self {
        self.values.manual_k_d = k_d;
        self
    }

    /// The vehicle.
    pub fn vehicle(mut self, vehicle: VehicleParameters) -> Self {
        self.values.vehicle = vehicle;
        self
    }

    /// The controller and its camera.
    pub fn guidance(mut self, guidance: GuidanceParameters) -> Self {
        self.values.guidance = guidance;
        self
    }

    /// Whether the host asks for the probe.
    pub fn probe(mut self, probe: bool) -> Self {
        self.values.guidance.probe = probe;
        self
    }

    /// What the controller sees.
    pub fn sensors(mut self, sensors: Sensors) -> Self {
        self.values.sensors = sensors;
        self
    }

    /// What fails.
    pub fn failure(mut self, failure: Failure) -> Self {
        self.values.failure = failure;
        self
    }

    /// When the driver changes, if that happens.
    pub fn driver_change(mut self, change: Option<DriverChange>) -> Self {
        self.values.driver_change = change;
        self
    }

    /// What is less than ideal in the world.
    pub fn world(mut self, world: WorldParameters) -> Self {
        self.values.world = world;
        self
    }

    /// What the sensors add to the truth.
    pub fn sensor_errors(mut self, errors: SensorErrors) -> Self {
        self.values.sensor_errors = errors;
        self
    }

    /// How far cars of this kind differ.
    pub fn tolerances(mut self, tolerances: Tolerances) -> Self {
        self.values.tolerances = tolerances;
        self
    }

    /// What the steering column is.
    pub fn column(mut self, column: ColumnParameters) -> Self {
        self.values.column = column;
        self
    }

    /// What amplifies the torque of its bar.
    pub fn assist(mut self, assist: AssistParameters) -> Self {
        self.values.assist = assist;
        self
    }

    /// Root of all random numbers.
    pub fn seed(mut self, seed: u64) -> Self {
        self.values.seed = seed;
        self
    }

    /// Checks everything.
    ///
    /// # Errors
    /// The first value out of range, by field, value and range; a manual driver with something that takes guidance;
    /// a course with less than a second to drive.
    pub fn build(self) -> Result<Scenario, ScenarioError> {
        let values = self.values;
        let speed = values.speed.profile()?;
        values.driver.check()?;
        let ArmGains { k_d, k_hg } = values.gains;
        let arm = ArmInFile {
            k_d: Some(k_d),
            k_hg: Some(k_hg),
            manual_k_d: values.manual_k_d,
        };
        arm.check()?;
        values.vehicle.check()?;
        let (_, camera) = values.guidance.into();
        camera.check()?;
        let setup = Setup::new(&values.controller_params()).map_err(|e| in_words_of_the_file(&e))?;
        values.failure.check()?;
        values.driver_change.as_ref().map_or(Ok(()), Fields::check)?;
        values.world.check()?;
        values.sensor_errors.check()?;
        values.tolerances.check()?;
        values.column.check()?;
        values.column.check_share(&values.vehicle)?;
        values.assist.check()?;
        values.assist.curve.check()?;
        values
            .column
            .check_with(&values.assist, &values.world, &values.tolerances)?;
        let scenario = Scenario { values, setup, speed };
        scenario.check_length()?;
        scenario.check_manual()?;
        Ok(scenario)
    }
}

impl Scenario {
    fn check_length(&self) -> Result<(), ScenarioError> {
        if self.duration_s() >= LEAST_DURATION_S {
            return Ok(());
        }
        let ahead_s = self.longest_look_ahead_s();
        // While the vehicle brakes, the farthest point may come back: what counts is how far it ever was.
        let (mut needed_m, mut v) = (0.0, 0.0);
        for tenth in 0..=10 {
            let time_s = 0.1 * f64::from(tenth) * LEAST_DURATION_S;
            let way_m = self.speed.way_m(time_s);
            let then = self.speed.at(time_s, way_m);
            if way_m + then * ahead_s > needed_m {
                (needed_m, v) = (way_m + then * ahead_s, then);
            }
        }
        Err(ScenarioError::CourseTooShort {
            course: self.course().name().into(),
            length_m: self.course().length_m(),
            needed_m,
            speed_kmh: if self.changes_speed() {
                (36.0 * v).round() / 10.0
            } else {
                self.speed_kmh()
            },
            look_ahead_m: v * ahead_s,
            look_ahead_s: ahead_s,
        })
    }

    /// A manual driver has no guidance that could fail, probe or be weighed.
    fn check_manual(&self) -> Result<(), ScenarioError> {
        let values = &self.values;
        if !values.manual {
            return Ok(());
        }
        let refused = |what: String, cure| Err(ScenarioError::ManualWith { what, cure });
        if values.failure.kind != FailureKind::None {
            return refused(
                format!("failure.kind = \"{}\"", values.failure.kind),
                "leave it out",
            );
        }
        if values.guidance.probe {
            return refused("guidance.probe = true".into(), "leave it out");
        }
        let changed = values.driver_change.map_or(0.0, |change| change.k_hg);
        for (field, k_hg) in [
            ("driver.k_hg", values.gains.k_hg),
            ("driver_change.k_hg", changed),
        ] {
            if k_hg != 0.0 {
                return refused(format!("{field} = {k_hg}"), "it can only be 0");
            }
        }
        Ok(())
    }
}
