//! The form of a scenario in a TOML file: tables `driver`, `vehicle`, `guidance`, `failure` and
//! `driver_change`, every field with a default, an unknown one an error. docs/files.md lists them all. Ranges
//! are checked by the scenario itself.

use haptic_core::params::Params;
use serde::{Deserialize, Serialize};

use super::{
    Condition, DEFAULT_SPEED_KMH, DriverChange, Failure, GuidanceParameters, Scenario, ScenarioBuilder,
    Sensors,
};
use crate::input::{InputError, parse_toml};
use crate::models::driver::{ArmGains, DriverParameters};
use crate::models::road::{Course, PAPER_COURSE, Segment};
use crate::models::vehicle::VehicleParameters;

/// Parses a scenario; only its course is checked.
pub(super) fn parse(
    name: &str,
    text: &str,
    course: impl FnOnce(&str) -> Result<Course, InputError>,
) -> Result<ScenarioBuilder, InputError> {
    let file: ScenarioFile = parse_toml(name, text).map_err(|error| {
        if Course::from_toml(name, text).is_ok() {
            let hint = "this is a course, not a scenario: a scenario names it with `course = \"FILE\"`";
            return InputError::new(name, hint);
        }
        error
    })?;
    let course = match &file.course {
        CourseField::Named(built_in) if built_in == PAPER_COURSE => Course::paper(),
        CourseField::Named(path) => course(path)?,
        CourseField::Whole(inline) => inline.checked(name)?,
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
    let g = file.guidance;
    Ok(Scenario::builder()
        .course(course)
        .speed_kmh(file.speed)
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
        })
        .gains(gains)
        .vehicle(file.vehicle)
        .guidance(GuidanceParameters {
            controller: Params {
                k_1: g.k_1,
                a_1: g.a_1,
                a_2: g.a_2,
                a_3: g.a_3,
                a_4: g.a_4,
                rate_corner_hz: g.rate_corner_hz,
                torque_limit_nm: g.torque_limit_nm,
                wind_up_nm_per_s: g.wind_up_nm_per_s,
                reduction_nm_per_s: g.reduction_nm_per_s,
                least_speed_m_per_s: g.least_speed_m_per_s,
                probe_amplitude_nm: g.probe_amplitude_nm,
                probe_frequency_hz: g.probe_frequency_hz,
                // What the controller takes for granted, whatever the driver is.
                t_nms_s: Params::PAPER.t_nms_s,
                k_nms: Params::PAPER.k_nms,
                // Follows from the vehicle, see `Scenario::setup`.
                vehicle: Params::PAPER.vehicle,
            },
            t_n: g.t_n,
            t_f: g.t_f,
            probe: g.probe,
        })
        .sensors(file.sensors)
        .failure(file.failure)
        .driver_change(file.driver_change)
        .seed(file.seed))
}

/// A scenario as the text of a file that needs no other file: the course stands in it. Read again it is the same
/// scenario, bit for bit.
pub(super) fn write(scenario: &Scenario) -> Result<String, toml::ser::Error> {
    let super::Values {
        course,
        speed_kmh,
        manual: _,
        driver: d,
        gains,
        vehicle,
        guidance,
        sensors,
        failure,
        driver_change,
        seed,
    } = &scenario.values;
    let built_in = *course == Course::paper();
    let c = guidance.controller;
    toml::to_string(&ScenarioFile {
        course: if built_in {
            CourseField::Named(PAPER_COURSE.into())
        } else {
            CourseField::Whole(InlineCourse::of(course))
        },
        speed: *speed_kmh,
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
            remnant_sd: d.remnant_sd_nm,
            remnant_corner: d.remnant_corner_hz,
        },
        vehicle: *vehicle,
        guidance: GuidanceFile {
            k_1: c.k_1,
            a_1: c.a_1,
            a_2: c.a_2,
            a_3: c.a_3,
            a_4: c.a_4,
            t_n: guidance.t_n,
            t_f: guidance.t_f,
            rate_corner_hz: c.rate_corner_hz,
            torque_limit_nm: c.torque_limit_nm,
            wind_up_nm_per_s: c.wind_up_nm_per_s,
            reduction_nm_per_s: c.reduction_nm_per_s,
            least_speed_m_per_s: c.least_speed_m_per_s,
            probe: guidance.probe,
            probe_amplitude_nm: c.probe_amplitude_nm,
            probe_frequency_hz: c.probe_frequency_hz,
        },
        failure: *failure,
        driver_change: *driver_change,
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
    lane_width: f64,
    segment: Vec<InlineSegment>,
}

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct InlineSegment {
    length: f64,
    curvature_start: f64,
    curvature_end: f64,
}

#[derive(Serialize)]
struct CourseText<'a> {
    lane_width: f64,
    segment: &'a [InlineSegment],
}

impl InlineCourse {
    fn of(course: &Course) -> Self {
        let segment = |s: &Segment| InlineSegment {
            length: s.length_m,
            curvature_start: s.curvature_start_1pm,
            curvature_end: s.curvature_end_1pm,
        };
        Self {
            name: course.name().into(),
            lane_width: course.lane_width_m(),
            segment: course.segments().iter().map(segment).collect(),
        }
    }

    /// The course, checked as one from a file of its own.
    fn checked(&self, file: &str) -> Result<Course, InputError> {
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
    speed: f64,
    condition: Condition,
    sensors: Sensors,
    seed: u64,
    driver: DriverFile,
    vehicle: VehicleParameters,
    guidance: GuidanceFile,
    failure: Failure,
    driver_change: Option<DriverChange>,
}

impl Default for ScenarioFile {
    fn default() -> Self {
        Self {
            course: CourseField::Named(PAPER_COURSE.into()),
            speed: DEFAULT_SPEED_KMH,
            condition: Condition::Mid,
            sensors: Sensors::default(),
            seed: 1,
            driver: DriverFile::default(),
            vehicle: VehicleParameters::default(),
            guidance: GuidanceFile::default(),
            failure: Failure::default(),
            driver_change: None,
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
    remnant_sd: f64,
    remnant_corner: f64,
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
            remnant_sd: remnant_sd_nm,
            remnant_corner: remnant_corner_hz,
        }
    }
}

#[derive(Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
struct GuidanceFile {
    #[serde(rename = "K_1", alias = "k_1")]
    k_1: f64,
    #[serde(alias = "a1")]
    a_1: f64,
    #[serde(alias = "a2")]
    a_2: f64,
    #[serde(alias = "a3")]
    a_3: f64,
    #[serde(alias = "a4")]
    a_4: f64,
    t_n: f64,
    t_f: f64,
    rate_corner_hz: f64,
    torque_limit_nm: f64,
    wind_up_nm_per_s: f64,
    reduction_nm_per_s: f64,
    #[serde(alias = "least_speed_mps")]
    least_speed_m_per_s: f64,
    probe: bool,
    probe_amplitude_nm: f64,
    probe_frequency_hz: f64,
}

impl Default for GuidanceFile {
    fn default() -> Self {
        let GuidanceParameters {
            controller: c,
            t_n,
            t_f,
            probe,
        } = GuidanceParameters::default();
        Self {
            k_1: c.k_1,
            a_1: c.a_1,
            a_2: c.a_2,
            a_3: c.a_3,
            a_4: c.a_4,
            t_n,
            t_f,
            rate_corner_hz: c.rate_corner_hz,
            torque_limit_nm: c.torque_limit_nm,
            wind_up_nm_per_s: c.wind_up_nm_per_s,
            reduction_nm_per_s: c.reduction_nm_per_s,
            least_speed_m_per_s: c.least_speed_m_per_s,
            probe,
            probe_amplitude_nm: c.probe_amplitude_nm,
            probe_frequency_hz: c.probe_frequency_hz,
        }
    }
}
