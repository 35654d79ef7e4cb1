//! A scenario: everything that decides a run, from a TOML file in which every field has a default.
//!
//! Fields bear the paper's symbols; defaults are tables 7 to 9. Terms: *condition*, how much the driver relies
//! on the guidance (section 5.1): a name for a pair of arm gains, or manual driving. *Failure*: the guidance
//! torque drops to zero, and the driver keeps his gains for one more second before he drives as manually.

use std::fmt;
use std::path::{Path, PathBuf};

use haptic_core::params::{Config, Params};
use serde::{Deserialize, Serialize};

use crate::input::{self, InputError, in_range};
use crate::models::driver::{ArmGains, DriverParameters};
use crate::models::road::{Course, PAPER_COURSE};
use crate::models::vehicle::VehicleParameters;

/// Speeds that a scenario may have, km/h. Below, the bicycle model's 1/v terms lose their meaning.
const SPEED_KMH: std::ops::RangeInclusive<f64> = 10.0..=250.0;
/// Speed of the paper's experiment and evaluation, km/h.
pub const DEFAULT_SPEED_KMH: f64 = 60.0;
/// When the paper lets the guidance fail, s.
pub const DEFAULT_FAILURE_TIME_S: f64 = 70.0;
/// How long the driver takes to notice a failure, s (section 5.2).
pub const FAILURE_REACTION_S: f64 = 1.0;

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
}

impl fmt::Display for FailureKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::None => "none",
            Self::Torque => "torque",
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

/// The controller and the camera that feeds it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GuidanceParameters {
    /// The controller's own parameters; the default is table 8.
    pub controller: Params,
    /// t'_n, look-ahead time of the camera's near point, s.
    pub t_n: f64,
    /// t'_f, look-ahead time of its far point, s.
    pub t_f: f64,
}

impl Default for GuidanceParameters {
    fn default() -> Self {
        Self {
            controller: Params::PAPER,
            t_n: 0.3,
            t_f: 0.7,
        }
    }
}

/// Everything that decides a run. Checked: whoever holds one may simulate it.
#[derive(Debug, Clone, PartialEq)]
pub struct Scenario {
    /// The road.
    pub course: Course,
    /// Constant speed, km/h.
    pub speed_kmh: f64,
    /// How the driver drives; follows from `gains` and from whether there is guidance.
    pub condition: Condition,
    /// The driver's vision, delay, arm and remnant.
    pub driver: DriverParameters,
    /// How the driver's arm weighs vision against guidance, until a failure is noticed.
    pub gains: ArmGains,
    /// The vehicle.
    pub vehicle: VehicleParameters,
    /// The guidance.
    pub guidance: GuidanceParameters,
    /// What the controller sees.
    pub sensors: Sensors,
    /// What fails.
    pub failure: Failure,
    /// Seed of the remnant's noise.
    pub seed: u64,
}

impl Default for Scenario {
    /// Driver 1 with medium reliance on the evaluation's course, tables 7 to 9.
    fn default() -> Self {
        Self {
            course: Course::paper(),
            speed_kmh: DEFAULT_SPEED_KMH,
            condition: Condition::Mid,
            driver: DriverParameters::default(),
            gains: Condition::Mid.gains(),
            vehicle: VehicleParameters::default(),
            guidance: GuidanceParameters::default(),
            sensors: Sensors::default(),
            failure: Failure::default(),
            seed: 1,
        }
    }
}

impl Scenario {
    /// Reads and checks a scenario file. A course file named in it is looked for beside the scenario.
    ///
    /// # Errors
    /// An unreadable file, a syntax error (with its line), an unknown field (by name), a value out of range
    /// (by field, value and range), a course shorter than the look-ahead.
    pub fn load(path: &Path) -> Result<Self, InputError> {
        let folder = path.parent().unwrap_or(Path::new(""));
        Self::from_toml(&path.display().to_string(), &input::read(path)?, folder)
    }

    /// Checks the text of a scenario file; `name` stands for the file in errors, `folder` is where course files
    /// are looked for.
    ///
    /// # Errors
    /// As [`Scenario::load`].
    pub fn from_toml(name: &str, text: &str, folder: &Path) -> Result<Self, InputError> {
        let file: ScenarioFile = toml::from_str(text).map_err(|e| InputError::new(name, e))?;
        let course = if file.course == Path::new(PAPER_COURSE) {
            Course::paper()
        } else {
            Course::load(&folder.join(&file.course))?
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
        let scenario = Self {
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
                },
                t_n: g.t_n,
                t_f: g.t_f,
            },
            sensors: file.sensors,
            failure: file.failure,
            seed: file.seed,
        };
        scenario.check().map_err(|e| InputError::new(name, e))?;
        Ok(scenario)
    }

    /// Whether the scenario can be simulated.
    ///
    /// # Errors
    /// The first field out of range, with its value and range; a course shorter than the look-ahead.
    pub fn check(&self) -> Result<(), String> {
        let within = |table: &'static str| move |e: String| format!("{table}.{e}");
        in_range("speed", self.speed_kmh, SPEED_KMH, "km/h")?;
        self.driver.check().map_err(within("driver"))?;
        in_range("K_d", self.gains.k_d, 0.0..=50.0, "N.m/rad").map_err(within("driver"))?;
        in_range("K_hg", self.gains.k_hg, 0.0..=10.0, "").map_err(within("driver"))?;
        self.vehicle.check().map_err(within("vehicle"))?;
        in_range("t_n", self.guidance.t_n, 0.0..=5.0, "s").map_err(within("guidance"))?;
        in_range("t_f", self.guidance.t_f, 0.0..=5.0, "s").map_err(within("guidance"))?;
        self.config()?;
        in_range("time", self.failure.time_s, 0.0..=1e6, "s").map_err(within("failure"))?;
        let (length, look_ahead) = (self.course.length_m(), self.look_ahead_m());
        if length <= look_ahead {
            return Err(format!(
                "course {} is {length:.1} m long, not longer than the look-ahead of {look_ahead:.1} m \
                 ({:.2} s at {} km/h)",
                self.course.name(),
                self.longest_look_ahead_s(),
                self.speed_kmh
            ));
        }
        Ok(())
    }

    /// The controller's checked configuration.
    ///
    /// # Errors
    /// The first parameter out of range, with its value and range.
    pub fn config(&self) -> Result<Config, String> {
        Config::new(&self.guidance.controller).map_err(|e| format!("guidance.{e}"))
    }

    /// Speed, m/s.
    pub fn speed_mps(&self) -> f64 {
        self.speed_kmh / 3.6
    }

    /// Distance of the farthest point that anybody looks at, m: the run ends when it reaches the end of the
    /// course. With table 8 it is the driver's far point.
    pub fn look_ahead_m(&self) -> f64 {
        self.speed_mps() * self.longest_look_ahead_s()
    }

    fn longest_look_ahead_s(&self) -> f64 {
        let DriverParameters { t_n, t_f, .. } = self.driver;
        t_n.max(t_f).max(self.guidance.t_n).max(self.guidance.t_f)
    }
}

#[derive(Deserialize)]
#[serde(default, deny_unknown_fields)]
struct ScenarioFile {
    course: PathBuf,
    speed: f64,
    condition: Condition,
    sensors: Sensors,
    seed: u64,
    driver: DriverFile,
    vehicle: VehicleParameters,
    guidance: GuidanceFile,
    failure: Failure,
}

impl Default for ScenarioFile {
    fn default() -> Self {
        Self {
            course: PAPER_COURSE.into(),
            speed: DEFAULT_SPEED_KMH,
            condition: Condition::Mid,
            sensors: Sensors::default(),
            seed: 1,
            driver: DriverFile::default(),
            vehicle: VehicleParameters::default(),
            guidance: GuidanceFile::default(),
            failure: Failure::default(),
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
}

impl Default for GuidanceFile {
    fn default() -> Self {
        let GuidanceParameters { controller, t_n, t_f } = GuidanceParameters::default();
        let Params {
            k_1,
            a_1,
            a_2,
            a_3,
            a_4,
            rate_corner_hz,
            torque_limit_nm,
        } = controller;
        Self {
            k_1,
            a1: a_1,
            a2: a_2,
            a3: a_3,
            a4: a_4,
            t_n,
            t_f,
            rate_corner_hz,
            torque_limit_nm,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Scenario, InputError> {
        Scenario::from_toml("s.toml", text, Path::new(""))
    }

    #[test]
    fn an_empty_file_is_tables_4_8_and_9() {
        let s = parse("").unwrap();
        assert_eq!(s, Scenario::default());
        let d = s.driver;
        assert_eq!((d.a1, d.a2, d.a3), (0.1, 0.05, 3.7));
        assert_eq!((d.t_n, d.t_f, d.t_nms, d.k_nms), (0.3, 1.0, 0.1, 1.0));
        let g = s.guidance;
        assert_eq!(
            (g.controller.k_1, g.controller.a_1, g.controller.a_2),
            (0.25, 2.0, 0.05)
        );
        assert_eq!(
            (g.controller.a_3, g.controller.a_4, g.t_n, g.t_f),
            (40.0, 1.0, 0.3, 0.7)
        );
        let v = s.vehicle;
        assert_eq!((v.m, v.i, v.l_f, v.l_r), (1100.0, 2940.0, 1.0, 1.635));
        assert_eq!(
            (v.k_f, v.k_r, v.k_s, v.e_t),
            (53_300.0, 117_000.0, 48_510.0, 0.026)
        );
        assert_eq!((v.b_s, v.j_s, v.k_t), (0.57, 0.11, 1.0 / 17.0));
        assert_eq!((s.gains.k_d, s.gains.k_hg, s.speed_kmh), (3.0, 0.5, 60.0));
    }

    #[test]
    fn every_field_can_be_set() {
        let s = parse(
            "course = 'paper-course'\nspeed = 80\ncondition = 'high'\nsensors = 'exact'\nseed = 9\n\
             [driver]\nt_p = 0.3\nK_hg = 0.25\nremnant_sd = 0.1\n[vehicle]\nm = 1500\nI = 3000\n\
             [guidance]\nK_1 = 0.5\na2 = 0.1\nt_f = 0.8\ntorque_limit_nm = 3\n\
             [failure]\nkind = 'torque'\ntime = 50",
        )
        .unwrap();
        assert_eq!((s.speed_kmh, s.sensors, s.seed), (80.0, Sensors::Exact, 9));
        assert_eq!((s.driver.t_p, s.driver.remnant_sd_nm), (0.3, 0.1));
        assert_eq!(
            (s.gains.k_d, s.gains.k_hg, s.condition),
            (2.0, 0.25, Condition::Custom)
        );
        assert_eq!((s.vehicle.m, s.vehicle.i), (1500.0, 3000.0));
        assert_eq!(
            (
                s.guidance.controller.k_1,
                s.guidance.controller.a_2,
                s.guidance.t_f
            ),
            (0.5, 0.1, 0.8)
        );
        assert_eq!(s.failure.at_s(), Some(50.0));
        assert_eq!(
            parse("condition = 'low'").unwrap().gains,
            ArmGains { k_d: 4.0, k_hg: 1.0 }
        );
        assert_eq!(
            parse("[driver]\nK_d = 2\nK_hg = 0").unwrap().condition,
            Condition::High
        );
    }

    #[test]
    fn every_bad_field_is_named_with_its_value_and_range() {
        let cases = [
            ("sped = 50", "sped"),
            ("[driver]\nkd = 3", "kd"),
            ("[guidance]\nt_x = 3", "t_x"),
            ("[failure]\nwhen = 3", "when"),
            ("[vehicle]\nmass = 3", "mass"),
            ("speed = 0", "speed = 0 km/h is outside 10 to 250 km/h"),
            ("speed = nan", "speed = NaN"),
            ("speed = 'fast'", "line 1"),
            ("condition = 'custom'", "custom"),
            ("sensors = 'perfect'", "perfect"),
            ("[failure]\nkind = 'brakes'", "brakes"),
            ("[driver]\nt_p = 0", "driver.t_p = 0 s is outside 0.001 to 2 s"),
            (
                "[driver]\nK_d = -1",
                "driver.K_d = -1 N.m/rad is outside 0 to 50 N.m/rad",
            ),
            ("[driver]\nremnant_sd = -1", "driver.remnant_sd = -1"),
            ("[vehicle]\nm = 0", "vehicle.m = 0 kg"),
            ("[guidance]\nK_1 = 50", "guidance.k_1 = 50"),
            ("[guidance]\nt_n = -0.1", "guidance.t_n = -0.1"),
            ("[failure]\ntime = -3", "failure.time = -3"),
            (
                "[driver]\nt_f = 5\n[guidance]\nt_f = 5.5",
                "guidance.t_f = 5.5 s is outside 0 to 5 s",
            ),
        ];
        for (text, expected) in cases {
            let error = parse(text).unwrap_err().to_string();
            assert!(error.starts_with("s.toml: "), "{error}");
            assert!(
                error.contains(expected),
                "{text:?} gave {error:?}, not {expected:?}"
            );
        }
        assert!(
            parse("course = 'nowhere.toml'")
                .unwrap_err()
                .to_string()
                .starts_with("nowhere.toml: ")
        );
    }

    #[test]
    fn a_course_shorter_than_the_look_ahead_is_refused() {
        let course = |length| Course::from_toml("c", &format!("[[segment]]\nlength = {length}")).unwrap();
        // 1.0 s at 60 km/h is 16.667 m.
        let short = Scenario {
            course: course(16.6),
            ..Default::default()
        }
        .check()
        .unwrap_err();
        assert!(
            short.contains("16.6 m long") && short.contains("16.7 m"),
            "{short}"
        );
        assert_eq!(
            Scenario {
                course: course(16.7),
                ..Default::default()
            }
            .check(),
            Ok(())
        );
    }
}
