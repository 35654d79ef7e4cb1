//! A driver who changed in mid-drive: what changed, when and by how much, as the record says it.

use std::fmt;

use serde::Serialize;

/// The names of changes that are sensors'.
pub(crate) const T_D: &str = "driver_torque_nm";
pub(crate) const E_Y: &str = "e_y_m";

/// Shortest piece between two changes that is fitted, s.
pub(crate) const SHORTEST_S: f64 = 10.0;

/// How constant the driver of a record was.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Constancy {
    /// The most that a change of one parameter at one instant adds to twice the log likelihood, less where the scores scatter more
    /// than the prediction errors say.
    pub deviance: f64,
    /// What that has to exceed before the driver is said to have changed.
    pub level: f64,
    /// The likeliest change, if it exceeds the level and is large enough to matter.
    pub change: Option<Change>,
}

/// A change of the driver.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Change {
    /// Key of what changed: k_hg, k_d (all gains by one factor) or t_p; driver_torque_nm or e_y_m for the offset of a sensor.
    pub parameter: &'static str,
    /// First and last instant of the change, s: the same for a step.
    pub at_s: [f64; 2],
    /// 95 % intervals of these instants, s.
    pub at_95_s: [[f64; 2]; 2],
    /// By how much; of k_d the share of the gains, of e_y_m the slope that it makes of the torque, N.m/s.
    pub by: f64,
    /// What the change adds to twice the log likelihood.
    pub deviance: f64,
}

impl Change {
    /// Whether it took longer than the record can tell from a step.
    pub fn is_drift(&self) -> bool {
        self.at_s[1] > self.at_s[0]
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
            E_Y => "the slope of driver_torque_nm",
            name => name,
        };
        let by = match self.parameter {
            "k_d" => format!("{:+.0} %", 100.0 * self.by),
            "t_p" => format!("{:+.3} s", self.by),
            T_D => format!("{:+.3} N.m", self.by),
            E_Y => format!("{:+.4} N.m/s", self.by),
            _ => format!("{:+.2}", self.by),
        };
        let [from, to] = self.at_s;
        let [[first, _], [_, last]] = self.at_95_s;
        if self.is_drift() {
            write!(f, "{name} drifted by {by} from {from:.0} to {to:.0} s")?;
        } else {
            write!(f, "{name} changed by {by} at {from:.0} s")?;
        }
        write!(f, " ({first:.0} to {last:.0} s, 95 %)")
    }
}
