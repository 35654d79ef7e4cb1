//! The form of a scenario in a TOML file: tables `driver`, `vehicle`, `guidance`, `failure` and
//! `driver_change`, every field with a default, an unknown one an error. examples/every-field.toml lists them. Ranges
//! are checked by the scenario itself.

use serde::{Deserialize, Serialize};

use super::guidance_file::GuidanceInFile;
use super::{Condition, DEFAULT_SPEED_KMH, DriverChange, Failure, Scenario, ScenarioBuilder, Sensors, Speed};
use crate::fields::{Field, Fields, InFile, Range};
use crate::input::InputError;
use crate::models::disturbances::SensorErrors;
use crate::models::driver::{ArmGains, ArmInFile, DriverParameters};
use crate::models::nonlinear::WorldParameters;
use crate::models::road::{COURSE_FIELDS, Course, LaneChoice, PAPER_COURSE, SEGMENT_FIELDS, SegmentFile};
use crate::models::tolerances::Tolerances;
use crate::models::torsion_bar::{AssistParameters, ColumnParameters};
use crate::models::vehicle::VehicleParameters;

/// What a scenario's file says; only its course is checked.
pub(super) fn values(
    name: &str,
    file: ScenarioFile,
    course: impl FnOnce(&str, &LaneChoice) -> Result<Course, InputError>,
) -> Result<ScenarioBuilder, InputError> {
    let choice = LaneChoice {
        road: file.road.clone(),
        lane: file.lane,
        turns: file.turn.clone(),
    };
    let course = match &file.course {
        CourseField::Named(path) if path != PAPER_COURSE => {
            course(path, &choice).map_err(|error| InputError::new(name, format!("course: {error}")))?
        }
        built_in => {
            choice.check_none(name)?;
            built_in.own(name)?
        }
    };
    let InFile((driver, arm)) = file.driver;
    let named = file.condition.gains();
    let gains = ArmGains {
        k_d: arm.k_d.unwrap_or(named.k_d),
        k_hg: arm.k_hg.unwrap_or(named.k_hg),
    };
    let speed = match (file.speed, file.speed_m_per_s, file.speed_kmh) {
        (Some(changing), None, None) => changing,
        (None, Some(constant), None) => Speed::Constant(constant),
        (None, None, Some(kmh)) => Speed::constant_kmh(kmh),
        (None, None, None) => Speed::constant_kmh(DEFAULT_SPEED_KMH),
        _ => {
            let what = "one of speed_m_per_s, speed_kmh and a table [speed] is wanted";
            return Err(InputError::new(name, what));
        }
    };
    Ok(Scenario::builder()
        .course(course)
        .speed(speed)
        .condition(file.condition)
        .driver(driver)
        .gains(gains)
        .manual_k_d(arm.manual_k_d)
        .vehicle(file.vehicle.0)
        .guidance(file.guidance.0.into())
        .sensors(file.sensors)
        .failure(file.failure.0)
        .driver_change(file.driver_change.map(|change| change.0))
        .world(file.world.unwrap_or_default().0)
        .sensor_errors(file.sensor_errors.unwrap_or_default().0)
        .tolerances(file.tolerances.unwrap_or_default().0)
        .column(file.column.unwrap_or_default().0)
        .assist(file.assist.unwrap_or_default().0)
        .seed(file.seed))
}

/// A scenario as the text of a file that needs no other file: the course stands in it. Read again it is the same
/// scenario, bit for bit.
pub(super) fn write(scenario: &Scenario) -> Result<String, toml::ser::Error> {
    let super::ScenarioValues {
        course,
        speed,
        manual: _,
        driver,
        gains,
        manual_k_d,
        vehicle,
        guidance,
        sensors,
        failure,
        driver_change,
        world,
        sensor_errors,
        tolerances,
        column,
        assist,
        seed,
    } = &scenario.values;
    let built_in = *course == Course::paper();
    let constant = match speed {
        Speed::Constant(m_per_s) => Some(*m_per_s),
        _ => None,
    };
    let arm = ArmInFile {
        k_d: Some(gains.k_d),
        k_hg: Some(gains.k_hg),
        manual_k_d: *manual_k_d,
    };
    toml::to_string(&ScenarioFile {
        course: if built_in {
            CourseField::Named(PAPER_COURSE.into())
        } else {
            CourseField::Whole(InlineCourse::new(course))
        },
        road: None,
        lane: None,
        turn: Vec::new(),
        speed_m_per_s: constant,
        speed_kmh: None,
        speed: constant.is_none().then(|| speed.clone()),
        condition: match scenario.condition() {
            // The gains say the rest.
            Condition::Custom => Condition::Mid,
            named => named,
        },
        sensors: *sensors,
        seed: *seed,
        driver: InFile((*driver, arm)),
        vehicle: InFile(*vehicle),
        guidance: InFile((*guidance).into()),
        failure: InFile(*failure),
        driver_change: driver_change.map(InFile),
        world: unless_default(*world),
        sensor_errors: unless_default(*sensor_errors),
        tolerances: unless_default(*tolerances),
        column: unless_default(*column),
        assist: unless_default(assist.clone()),
    })
}

/// A table that says something.
fn unless_default<T: Fields + PartialEq>(table: T) -> Option<InFile<T>> {
    (table != T::default()).then_some(InFile(table))
}

/// The table `[driver]`.
type DriverInFile = (DriverParameters, ArmInFile);

/// How a list of fields is asked for.
pub type FieldsOf = fn() -> Vec<&'static Field>;

/// The lists of a scenario's tables, by the tables' names.
pub const TABLES: [(&str, FieldsOf); 10] = [
    (DriverInFile::TABLE, DriverInFile::fields),
    (VehicleParameters::TABLE, VehicleParameters::fields),
    (GuidanceInFile::TABLE, GuidanceInFile::fields),
    (Failure::TABLE, Failure::fields),
    (DriverChange::TABLE, DriverChange::fields),
    (WorldParameters::TABLE, WorldParameters::fields),
    (SensorErrors::TABLE, SensorErrors::fields),
    (Tolerances::TABLE, Tolerances::fields),
    (ColumnParameters::TABLE, ColumnParameters::fields),
    (AssistParameters::TABLE, AssistParameters::fields),
];

/// The fields of a table of a scenario file, `segment` for those of a course; none of what is no list.
pub fn fields_of(table: &str) -> Vec<&'static Field> {
    match table {
        "course" => return COURSE_FIELDS.iter().collect(),
        "segment" => return SEGMENT_FIELDS.iter().collect(),
        _ => {}
    }
    let found = TABLES.iter().find(|(name, _)| *name == table);
    found.map_or_else(Vec::new, |(_, fields)| fields())
}

/// The unit of a field by its path, such as `driver.t_p_s` or `course.segment.1.length_m`; empty for a number without one, none of
/// what is no number.
pub fn unit_of(path: &str) -> Option<&'static str> {
    match path.split('.').collect::<Vec<_>>()[..] {
        ["speed_m_per_s"] => Some("m/s"),
        ["speed_kmh"] => Some("km/h"),
        [table, name] | ["course", table @ "segment", _, name] => {
            let field = fields_of(table).into_iter().find(|field| field.name == name)?;
            matches!(field.range, Range::Between(..)).then_some(field.unit)
        }
        _ => None,
    }
}

/// A course by its name, or the course itself.
#[derive(Deserialize, Serialize)]
#[serde(
    untagged,
    expecting = "the name of a course, or a [course] with name, lane_width_m and [[course.segment]]"
)]
enum CourseField {
    Named(String),
    Whole(InlineCourse),
}

/// A course as it stands in a scenario file.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct InlineCourse {
    name: String,
    #[serde(default)]
    lane_width_m: f64,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    segment: Vec<SegmentFile>,
    /// The text of an OpenDRIVE file in the place of the other two: a lane that is not made of segments.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    opendrive: Option<String>,
}

impl CourseField {
    /// The course that needs no file: the built-in one, or one that stands in the scenario.
    fn own(&self, scenario: &str) -> Result<Course, InputError> {
        match self {
            Self::Named(_) => Ok(Course::paper()),
            Self::Whole(inline) => inline.checked(scenario),
        }
    }
}

impl InlineCourse {
    fn new(course: &Course) -> Self {
        if !course.is_of_segments() {
            return Self {
                name: course.name().into(),
                lane_width_m: course.lane_width_m(),
                segment: Vec::new(),
                opendrive: Some(course.to_opendrive()),
            };
        }
        Self {
            name: course.name().into(),
            lane_width_m: course.lane_width_m(),
            segment: course.segments().iter().map(SegmentFile::from).collect(),
            opendrive: None,
        }
    }

    /// The course, checked as one from a file of its own.
    fn checked(&self, file: &str) -> Result<Course, InputError> {
        if let Some(text) = &self.opendrive {
            return Course::from_opendrive(&self.name, text, &LaneChoice::default())
                .map_err(|e| InputError::new(file, format!("course: {e}")));
        }
        Course::of_file(&self.name, self.lane_width_m, &self.segment)
            .map_err(|e| InputError::new(file, format!("course: {e}")))
    }
}

#[derive(Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct ScenarioFile {
    course: CourseField,
    #[serde(skip_serializing_if = "Option::is_none")]
    road: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    lane: Option<i32>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    turn: Vec<String>,
    speed_m_per_s: Option<f64>,
    #[serde(skip_serializing)]
    speed_kmh: Option<f64>,
    speed: Option<Speed>,
    condition: Condition,
    sensors: Sensors,
    seed: u64,
    driver: InFile<DriverInFile>,
    vehicle: InFile<VehicleParameters>,
    guidance: InFile<GuidanceInFile>,
    failure: InFile<Failure>,
    driver_change: Option<InFile<DriverChange>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    world: Option<InFile<WorldParameters>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    sensor_errors: Option<InFile<SensorErrors>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    tolerances: Option<InFile<Tolerances>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    column: Option<InFile<ColumnParameters>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    assist: Option<InFile<AssistParameters>>,
}

impl Default for ScenarioFile {
    fn default() -> Self {
        Self {
            course: CourseField::Named(PAPER_COURSE.into()),
            road: None,
            lane: None,
            turn: Vec::new(),
            speed_m_per_s: None,
            speed_kmh: None,
            speed: None,
            condition: Condition::Mid,
            sensors: Sensors::default(),
            seed: 1,
            driver: InFile::default(),
            vehicle: InFile::default(),
            guidance: InFile::default(),
            failure: InFile::default(),
            driver_change: None,
            world: None,
            sensor_errors: None,
            tolerances: None,
            column: None,
            assist: None,
        }
    }
}
