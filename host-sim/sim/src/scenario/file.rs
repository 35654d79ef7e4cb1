//! The form of a scenario in a TOML file: tables `driver`, `vehicle`, `guidance`, `failure` and
//! `driver_change`, every field with a default, an unknown one an error. docs/files.md lists them all. Ranges
//! are checked by the scenario itself.

use haptic_core::params::Params;
use serde::Deserialize;

use super::{Condition, DEFAULT_SPEED_KMH, DriverChange, Failure, GuidanceParameters, Scenario, Sensors};
use crate::input::{InputError, parse_toml};
use crate::models::driver::{ArmGains, DriverParameters};
use crate::models::road::{Course, LaneChoice, PAPER_COURSE};
use crate::models::vehicle::VehicleParameters;

/// Parses a scenario, unchecked but for its course.
pub(super) fn parse(
    name: &str,
    text: &str,
    course: impl FnOnce(&str, &LaneChoice) -> Result<Course, InputError>,
) -> Result<Scenario, InputError> {
    let file: ScenarioFile = parse_toml(name, text).map_err(|error| {
        if Course::from_toml(name, text).is_ok() {
            let hint = "this is a course, not a scenario: a scenario names it with `course = \"FILE\"`";
            return InputError::new(name, hint);
        }
        error
    })?;
    let choice = LaneChoice {
        road: file.road.clone(),
        lane: file.lane,
    };
    let course = if file.course == PAPER_COURSE {
        choice.check_none(PAPER_COURSE)?;
        Course::paper()
    } else {
        course(&file.course, &choice)?
    };
    let DriverFile {
        a1,
        a2,
        a3,
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
    let condition = match file.condition {
        Condition::Manual => Condition::Manual,
        _ => [Condition::High, Condition::Mid, Condition::Low]
            .into_iter()
            .find(|c| c.gains() == gains)
            .unwrap_or(Condition::Custom),
    };
    let g = file.guidance;
    Ok(Scenario {
        course,
        speed_kmh: file.speed,
        condition,
        driver: DriverParameters {
            a1,
            a2,
            a3,
            t_p,
            t_n,
            t_f,
            t_nms,
            k_nms,
            remnant_sd_nm: file.driver.remnant_sd,
            remnant_corner_hz: file.driver.remnant_corner,
        },
        gains,
        vehicle: file.vehicle,
        guidance: GuidanceParameters {
            controller: Params {
                k_1: g.k_1,
                a_1: g.a1,
                a_2: g.a2,
                a_3: g.a3,
                a_4: g.a4,
                rate_corner_hz: g.rate_corner_hz,
                torque_limit_nm: g.torque_limit_nm,
                wind_up_nm_per_s: g.wind_up_nm_per_s,
                reduction_nm_per_s: g.reduction_nm_per_s,
                least_speed_mps: g.least_speed_mps,
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
        },
        sensors: file.sensors,
        failure: file.failure,
        driver_change: file.driver_change,
        seed: file.seed,
    })
}

#[derive(Deserialize)]
#[serde(default, deny_unknown_fields)]
struct ScenarioFile {
    course: String,
    road: Option<String>,
    lane: Option<i32>,
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
            course: PAPER_COURSE.into(),
            road: None,
            lane: None,
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

#[derive(Deserialize)]
#[serde(default, deny_unknown_fields)]
struct DriverFile {
    a1: f64,
    a2: f64,
    a3: f64,
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
            a1,
            a2,
            a3,
            t_p,
            t_n,
            t_f,
            t_nms,
            k_nms,
            remnant_sd_nm,
            remnant_corner_hz,
        } = DriverParameters::default();
        Self {
            a1,
            a2,
            a3,
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

#[derive(Deserialize)]
#[serde(default, deny_unknown_fields)]
struct GuidanceFile {
    #[serde(rename = "K_1", alias = "k_1")]
    k_1: f64,
    #[serde(alias = "a_1")]
    a1: f64,
    #[serde(alias = "a_2")]
    a2: f64,
    #[serde(alias = "a_3")]
    a3: f64,
    #[serde(alias = "a_4")]
    a4: f64,
    t_n: f64,
    t_f: f64,
    rate_corner_hz: f64,
    torque_limit_nm: f64,
    wind_up_nm_per_s: f64,
    reduction_nm_per_s: f64,
    least_speed_mps: f64,
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
            a1: c.a_1,
            a2: c.a_2,
            a3: c.a_3,
            a4: c.a_4,
            t_n,
            t_f,
            rate_corner_hz: c.rate_corner_hz,
            torque_limit_nm: c.torque_limit_nm,
            wind_up_nm_per_s: c.wind_up_nm_per_s,
            reduction_nm_per_s: c.reduction_nm_per_s,
            least_speed_mps: c.least_speed_mps,
            probe,
            probe_amplitude_nm: c.probe_amplitude_nm,
            probe_frequency_hz: c.probe_frequency_hz,
        }
    }
}
