//! The form of a scenario in a TOML file: tables `driver`, `vehicle`, `guidance`, `failure` and
//! `driver_change`, every field with a default, an unknown one an error. docs/files.md lists them all. Ranges
//! are checked by the scenario itself.

use serde::{Deserialize, Serialize};

use super::guidance_file::GuidanceFile;
use super::{Condition, DEFAULT_SPEED_KMH, DriverChange, Failure, Scenario, ScenarioBuilder, Sensors, Speed};
use crate::input::{InputError, parse_toml};
use crate::models::disturbances::SensorErrors;
use crate::models::driver::{ArmGains, DriverParameters};
use crate::models::real::WorldParameters;
use crate::models::road::{Course, LaneChoice, PAPER_COURSE, Segment};
use crate::models::tolerances::Tolerances;
use crate::models::vehicle::VehicleParameters;

/// Parses a scenario; only its course is checked.
pub(super) fn parse(
    name: &str,
    text: &str,
    course: impl FnOnce(&str, &LaneChoice) -> Result<Course, InputError>,
) -> Result<ScenarioBuilder, InputError> {
    let file: ScenarioFile = parse_toml(name, text)?;
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
    let DriverFile {
        a_1,
        a_2,
        a_3,
        t_p,
        t_n,
        t_f,
        t_nms,
        k_nms,
        k_d,
        k_hg,
        ..
    } = file.driver;
    let named = file.condition.gains();
    let gains = ArmGains {
        k_d: k_d.unwrap_or(named.k_d),
        k_hg: k_hg.unwrap_or(named.k_hg),
    };
    Ok(Scenario::builder()
        .course(course)
        .speed(file.speed)
        .condition(file.condition)
        .driver(DriverParameters {
            a_1,
            a_2,
            a_3,
            t_p,
            t_n,
            t_f,
            t_nms,
            k_nms,
            remnant_sd_nm: file.driver.remnant_sd,
            remnant_corner_hz: file.driver.remnant_corner,
            answers_hands_off_after_s: file.driver.answers_hands_off_after,
            line_m: file.driver.line,
        })
        .gains(gains)
        .manual_k_d(file.driver.manual_k_d)
        .vehicle(file.vehicle)
        .guidance(file.guidance.0)
        .sensors(file.sensors)
        .failure(file.failure)
        .driver_change(file.driver_change)
        .world(file.world.unwrap_or_default())
        .sensor_errors(file.sensor_errors.unwrap_or_default())
        .tolerances(file.tolerances.unwrap_or_default())
        .seed(file.seed))
}

/// A scenario as the text of a file that needs no other file: the course stands in it. Read again it is the same
/// scenario, bit for bit.
pub(super) fn write(scenario: &Scenario) -> Result<String, toml::ser::Error> {
    let super::ScenarioValues {
        course,
        speed,
        manual: _,
        driver: d,
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
        seed,
    } = &scenario.values;
    let built_in = *course == Course::paper();
    toml::to_string(&ScenarioFile {
        course: if built_in {
            CourseField::Named(PAPER_COURSE.into())
        } else {
            CourseField::Whole(InlineCourse::of(course))
        },
        road: None,
        lane: None,
        turn: Vec::new(),
        speed: speed.clone(),
        condition: match scenario.condition() {
            // The gains say the rest.
            Condition::Custom => Condition::Mid,
            named => named,
        },
        sensors: *sensors,
        seed: *seed,
        driver: DriverFile {
            a_1: d.a_1,
            a_2: d.a_2,
            a_3: d.a_3,
            t_p: d.t_p,
            t_n: d.t_n,
            t_f: d.t_f,
            t_nms: d.t_nms,
            k_nms: d.k_nms,
            k_d: Some(gains.k_d),
            k_hg: Some(gains.k_hg),
            manual_k_d: *manual_k_d,
            remnant_sd: d.remnant_sd_nm,
            remnant_corner: d.remnant_corner_hz,
            answers_hands_off_after: d.answers_hands_off_after_s,
            line: d.line_m,
        },
        vehicle: *vehicle,
        guidance: GuidanceFile(*guidance),
        failure: *failure,
        driver_change: *driver_change,
        world: (*world != WorldParameters::default()).then_some(*world),
        sensor_errors: (*sensor_errors != SensorErrors::default()).then_some(*sensor_errors),
        tolerances: (*tolerances != Tolerances::default()).then_some(*tolerances),
    })
}

/// A course by its name, or the course itself.
#[derive(Deserialize, Serialize)]
#[serde(
    untagged,
    expecting = "the name of a course, or a [course] with name, lane_width and [[course.segment]]"
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
    lane_width: f64,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    segment: Vec<InlineSegment>,
    /// The text of an OpenDRIVE file in the place of the other two: a lane that is not made of segments.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    opendrive: Option<String>,
}

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct InlineSegment {
    length: f64,
    curvature_start: f64,
    curvature_end: f64,
    #[serde(default)]
    bank_start: f64,
    #[serde(default)]
    bank_end: f64,
    #[serde(default)]
    grade_start: f64,
    #[serde(default)]
    grade_end: f64,
}

#[derive(Serialize)]
struct CourseText<'a> {
    lane_width: f64,
    segment: &'a [InlineSegment],
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
    fn of(course: &Course) -> Self {
        let segment = |s: &Segment| InlineSegment {
            length: s.length_m,
            curvature_start: s.curvature_start_1pm,
            curvature_end: s.curvature_end_1pm,
            bank_start: s.bank_rad[0],
            bank_end: s.bank_rad[1],
            grade_start: s.grade[0],
            grade_end: s.grade[1],
        };
        if !course.is_of_segments() {
            return Self {
                name: course.name().into(),
                lane_width: course.lane_width_m(),
                segment: Vec::new(),
                opendrive: Some(course.to_opendrive()),
            };
        }
        Self {
            name: course.name().into(),
            lane_width: course.lane_width_m(),
            segment: course.segments().iter().map(segment).collect(),
            opendrive: None,
        }
    }

    /// The course, checked as one from a file of its own.
    fn checked(&self, file: &str) -> Result<Course, InputError> {
        if let Some(text) = &self.opendrive {
            return Course::from_opendrive(&self.name, text, &LaneChoice::default())
                .map_err(|e| InputError::new(file, format!("course: {e}")));
        }
        let text = CourseText {
            lane_width: self.lane_width,
            segment: &self.segment,
        };
        let text = toml::to_string(&text).map_err(|e| InputError::new(file, e))?;
        Course::from_toml(&self.name, &text).map_err(|e| InputError::new(file, format!("course: {e}")))
    }
}

#[derive(Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
struct ScenarioFile {
    course: CourseField,
    #[serde(skip_serializing_if = "Option::is_none")]
    road: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    lane: Option<i32>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    turn: Vec<String>,
    speed: Speed,
    condition: Condition,
    sensors: Sensors,
    seed: u64,
    driver: DriverFile,
    vehicle: VehicleParameters,
    guidance: GuidanceFile,
    failure: Failure,
    driver_change: Option<DriverChange>,
    #[serde(skip_serializing_if = "Option::is_none")]
    world: Option<WorldParameters>,
    #[serde(skip_serializing_if = "Option::is_none")]
    sensor_errors: Option<SensorErrors>,
    #[serde(skip_serializing_if = "Option::is_none")]
    tolerances: Option<Tolerances>,
}

impl Default for ScenarioFile {
    fn default() -> Self {
        Self {
            course: CourseField::Named(PAPER_COURSE.into()),
            road: None,
            lane: None,
            turn: Vec::new(),
            speed: Speed::Constant(DEFAULT_SPEED_KMH),
            condition: Condition::Mid,
            sensors: Sensors::default(),
            seed: 1,
            driver: DriverFile::default(),
            vehicle: VehicleParameters::default(),
            guidance: GuidanceFile::default(),
            failure: Failure::default(),
            driver_change: None,
            world: None,
            sensor_errors: None,
            tolerances: None,
        }
    }
}

#[derive(Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
struct DriverFile {
    #[serde(alias = "a1")]
    a_1: f64,
    #[serde(alias = "a2")]
    a_2: f64,
    #[serde(alias = "a3")]
    a_3: f64,
    t_p: f64,
    t_n: f64,
    t_f: f64,
    t_nms: f64,
    #[serde(rename = "K_nms", alias = "k_nms")]
    k_nms: f64,
    #[serde(rename = "K_d", alias = "k_d")]
    k_d: Option<f64>,
    #[serde(rename = "K_hg", alias = "k_hg")]
    k_hg: Option<f64>,
    #[serde(rename = "manual_K_d", alias = "manual_k_d")]
    manual_k_d: f64,
    remnant_sd: f64,
    remnant_corner: f64,
    answers_hands_off_after: f64,
    line: f64,
}

impl Default for DriverFile {
    fn default() -> Self {
        let DriverParameters {
            a_1,
            a_2,
            a_3,
            t_p,
            t_n,
            t_f,
            t_nms,
            k_nms,
            remnant_sd_nm,
            remnant_corner_hz,
            answers_hands_off_after_s,
            line_m,
        } = DriverParameters::default();
        Self {
            a_1,
            a_2,
            a_3,
            t_p,
            t_n,
            t_f,
            t_nms,
            k_nms,
            k_d: None,
            k_hg: None,
            manual_k_d: ArmGains::MANUAL.k_d,
            remnant_sd: remnant_sd_nm,
            remnant_corner: remnant_corner_hz,
            answers_hands_off_after: answers_hands_off_after_s,
            line: line_m,
        }
    }
}
