//! A scenario: everything that decides a run, from a TOML file in which every field has a default.
//!
//! Fields bear the paper's symbols; defaults are tables 7 to 9. Terms: *condition*, how much the driver relies
//! on the guidance (section 5.1): a name for a pair of arm gains, or manual driving. *Failure*: the guidance
//! torque drops to zero, or its lane preview stops; the driver keeps his gains for one more second before he
//! drives as manually.

mod file;
mod names;
#[cfg(test)]
mod tests;

use std::fmt;

use haptic_core::params::{Params, Setup, VehicleParams};
use serde::{Deserialize, Serialize};

use crate::input::{InputError, in_range};
use crate::models::driver::{ArmGains, DriverParameters};
use crate::models::road::{Course, LaneChoice};
use crate::models::vehicle::VehicleParameters;

/// Speeds that a scenario may have, km/h. The controller guides from 5 m/s on.
pub const SPEED_KMH: std::ops::RangeInclusive<f64> = 20.0..=250.0;
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
    /// When the driver changes how he weighs vision against guidance, if he does.
    pub driver_change: Option<DriverChange>,
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
            driver_change: None,
            seed: 1,
        }
    }
}

impl Scenario {
    /// Checks the text of a scenario file; `name` stands for the file in errors, `course` opens a course by the
    /// name that the file gives it, unless that is the built-in one.
    ///
    /// # Errors
    /// A syntax error (with its line), an unknown field (by name), a value out of range (by field, value and
    /// range), a manual driver with something that takes guidance, a course with less than a second to drive; what
    /// `course` says.
    pub fn from_toml(
        name: &str,
        text: &str,
        course: impl FnOnce(&str, &LaneChoice) -> Result<Course, InputError>,
    ) -> Result<Self, InputError> {
        let scenario = file::parse(name, text, course)?;
        let checked = scenario.check().and_then(|()| scenario.check_manual());
        checked.map_err(|e| InputError::new(name, e))?;
        Ok(scenario)
    }

    /// Whether the scenario can be simulated.
    ///
    /// # Errors
    /// The first field out of range, with its value and range; a course with less than a second to drive.
    pub fn check(&self) -> Result<(), String> {
        let within = |table: &'static str| move |e: String| format!("{table}.{e}");
        in_range("speed", self.speed_kmh, SPEED_KMH, "km/h")?;
        self.driver.check().map_err(within("driver"))?;
        check_gains(self.gains).map_err(within("driver"))?;
        self.vehicle.check().map_err(within("vehicle"))?;
        in_range("t_n", self.guidance.t_n, 0.0..=5.0, "s").map_err(within("guidance"))?;
        // The controller's range: its plausibility checks divide by it.
        in_range("t_f", self.guidance.t_f, 0.1..=3.0, "s").map_err(within("guidance"))?;
        self.setup()?;
        in_range("time", self.failure.time_s, 0.0..=1e6, "s").map_err(within("failure"))?;
        if let Some(change) = &self.driver_change {
            in_range("time", change.time_s, 0.0..=1e6, "s").map_err(within("driver_change"))?;
            check_gains(change.gains()).map_err(within("driver_change"))?;
        }
        if self.duration_s() < LEAST_DURATION_S {
            return Err(format!(
                "course {} is {:.1} m long, but at {} km/h it needs {:.1} m: {:.1} m of look-ahead ({:.2} s) and \
                 {LEAST_DURATION_S} s to drive",
                self.course.name(),
                self.course.length_m(),
                self.speed_kmh,
                self.look_ahead_m() + self.speed_mps() * LEAST_DURATION_S,
                self.look_ahead_m(),
                self.longest_look_ahead_s(),
            ));
        }
        Ok(())
    }

    /// Whether what is to happen in mid-drive happens before the run ends.
    ///
    /// # Errors
    /// The field whose time is too late, with its value and range.
    pub fn check_times(&self) -> Result<(), String> {
        let change_s = self.driver_change.map(|change| change.time_s);
        let times = [
            ("failure.time", self.failure.at_s()),
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
    pub fn check_time(&self, field: &str, time_s: f64) -> Result<(), String> {
        // Whole tenths, for people to read.
        let end_s = (10.0 * self.duration_s()).floor() / 10.0;
        in_range(field, time_s, 0.0..=end_s, "s").map_err(|e| format!("{e}: the run ends there"))
    }

    /// A manual driver has no guidance that could fail, probe or be weighed.
    fn check_manual(&self) -> Result<(), String> {
        if self.condition != Condition::Manual {
            return Ok(());
        }
        let refused = |what: String| Err(format!("condition = \"manual\" has no guidance, but {what}"));
        if self.failure.kind != FailureKind::None {
            return refused(format!("failure.kind = \"{}\"; leave it out", self.failure.kind));
        }
        if self.guidance.probe {
            return refused("guidance.probe = true; leave it out".into());
        }
        let changed = self.driver_change.map_or(0.0, |change| change.k_hg);
        for (field, k_hg) in [("driver.K_hg", self.gains.k_hg), ("driver_change.K_hg", changed)] {
            if k_hg != 0.0 {
                return refused(format!("{field} = {k_hg}; it can only be 0"));
            }
        }
        Ok(())
    }

    /// The controller's checked parameters.
    ///
    /// # Errors
    /// The first parameter out of range, with its value and range.
    pub fn setup(&self) -> Result<Setup, String> {
        Setup::new(&self.controller_params()).map_err(|e| names::in_words_of_the_file(&e))
    }

    /// The controller's parameters with what it knows of the vehicle.
    pub fn controller_params(&self) -> Params {
        Params {
            vehicle: self.vehicle_for_plausibility(),
            ..self.guidance.controller
        }
    }

    /// The vehicle as the controller's plausibility checks know it: the true one, from tables 8 and 9.
    fn vehicle_for_plausibility(&self) -> VehicleParams {
        let far_time_s = self.guidance.t_f;
        if self.vehicle == VehicleParameters::default() {
            // The constants of the shipped image, so that host and target hold the same bits.
            return VehicleParams {
                far_time_s,
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
        VehicleParams {
            curvature_gain_1pm: k_t / l,
            stability_factor_s2pm2: m * (l_r * k_r - l_f * k_f) / (2.0 * l * l * k_f * k_r),
            aligning_gain_nms2pm: self.vehicle.aligning_stiffness() * m * l_r / (2.0 * l * k_f),
            column_damping_nms: b_s,
            far_time_s,
        }
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

    /// Arc length that the centre of gravity reaches in a run that does not diverge, m: the course's, less the
    /// look-ahead.
    pub fn reach_m(&self) -> f64 {
        self.course.length_m() - self.look_ahead_m()
    }

    /// How long a run lasts that does not diverge, s. In curves the points ahead lie a little further along
    /// the road than their distance, so a run may end some hundredths of a second earlier.
    pub fn duration_s(&self) -> f64 {
        self.reach_m() / self.speed_mps()
    }

    fn longest_look_ahead_s(&self) -> f64 {
        let DriverParameters { t_n, t_f, .. } = self.driver;
        t_n.max(t_f).max(self.guidance.t_n).max(self.guidance.t_f)
    }
}

fn check_gains(gains: ArmGains) -> Result<(), String> {
    in_range("K_d", gains.k_d, 0.0..=50.0, "N.m/rad")?;
    in_range("K_hg", gains.k_hg, 0.0..=10.0, "")
}
