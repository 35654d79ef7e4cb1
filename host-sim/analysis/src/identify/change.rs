//! A driver who changed in mid-drive: what changed, when and by how much, as the record says it.

use std::fmt;

use serde::Serialize;

/// The names of changes that are sensors'.
pub(crate) const T_D: &str = "driver_torque_nm";
pub(crate) const E_Y: &str = "e_y_m";

/// Shortest piece between two changes that is fitted, s.
pub(crate) const SHORTEST_S: f64 = 10.0;

/// How a change goes on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Shape {
    /// At one instant, and it stays.
    Step,
    /// From the first instant to the last one, and it stays.
    Drift,
    /// From the first instant to the last one only.
    Blip,
    /// To and fro throughout the record, each way as long as from the first instant to the last one.
    Swing,
}

/// The least change of a parameter that a record would show in nine of ten drives.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Power {
    /// Key of what changes, as in [`Change`].
    pub parameter: &'static str,
    /// A step in the middle of the record; none if no step is seen.
    pub step: Option<f64>,
    /// A change for [`BLIP_S`] that then goes back; none if none is seen.
    pub blip: Option<f64>,
    /// A change to and fro, each way for about 15 s; none if none is seen.
    pub swing: Option<f64>,
}

/// Length of the blip that the power is told of, s.
pub const BLIP_S: f64 = 8.0;
/// How long each way lasts of the swing that the power is told of, s.
pub(crate) const SWING_S: f64 = 15.0;

/// How constant the driver of a record was.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Constancy {
    /// The most that a change of one parameter at one instant adds to twice the log likelihood, less where the scores scatter more
    /// than the prediction errors say.
    pub deviance: f64,
    /// What that has to exceed before the driver is said to have changed.
    pub level: f64,
    /// What the test would see.
    pub power: Vec<Power>,
    /// The likeliest change, if it exceeds the level and is large enough to matter.
    pub change: Option<Change>,
}

/// A change of the driver.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Change {
    /// Key of what changed: k_hg, k_d (all gains by one factor), gain_1 (alone) or t_p; driver_torque_nm for the offset of that sensor; e_y_m
    /// for the driver's line or the offset of that sensor.
    pub parameter: &'static str,
    /// How it goes on.
    pub shape: Shape,
    /// First and last instant of the change, s: the same for a step, and of a swing those of its first way out.
    pub at_s: [f64; 2],
    /// 95 % intervals of these instants, s; of a swing the whole record, for no part of it is of one driver.
    pub at_95_s: [[f64; 2]; 2],
    /// By how much; of k_d the share of the gains, of e_y_m (the driver's line or the camera's offset, which no log tells apart)
    /// the slope that it makes of the torque, N.m/s.
    pub by: f64,
    /// What the change adds to twice the log likelihood.
    pub deviance: f64,
}

impl Change {
    /// When it was, in words.
    pub(crate) fn when(&self) -> String {
        let [from, to] = self.at_s;
        match self.shape {
            Shape::Step => format!("at {from:.0} s"),
            Shape::Drift => format!("from {from:.0} to {to:.0} s"),
            Shape::Blip => format!("between {from:.0} and {to:.0} s"),
            Shape::Swing => format!("to and fro, each way for {:.0} s", to - from),
        }
    }

    /// The time in which the driver is neither the one before nor the one after, s.
    pub fn within_s(&self) -> [f64; 2] {
        [self.at_95_s[0][0], self.at_95_s[1][1]]
    }
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = match self.parameter {
            "k_d" => "k_d (all gains)",
            T_D => "the offset of driver_torque_nm",
            E_Y => "the driver's line, or the offset of e_y_m,",
            name => name,
        };
        let by = match self.parameter {
            "k_d" => format!("{:+.0} %", 100.0 * self.by),
            "gain_1" => format!("{:+.2} N.m/m", self.by),
            "t_p" => format!("{:+.3} s", self.by),
            T_D => format!("{:+.3} N.m", self.by),
            E_Y => format!("what makes {:+.4} N.m/s of the driver's integral", self.by),
            _ => format!("{:+.2}", self.by),
        };
        let [[first, _], [_, last]] = self.at_95_s;
        let verb = match self.shape {
            Shape::Step => "changed",
            Shape::Drift => "drifted",
            Shape::Blip => "differed",
            Shape::Swing => return write!(f, "{name} swung by {by} {}", self.when()),
        };
        write!(f, "{name} {verb} by {by} {}", self.when())?;
        write!(f, " ({first:.0} to {last:.0} s, 95 %)")
    }
}
