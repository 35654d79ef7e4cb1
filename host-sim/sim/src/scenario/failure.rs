//! What happens in mid-drive: a failure, and a driver who changes.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::models::driver::ArmGains;
use crate::models::step_of;

/// When the paper lets the guidance fail, s.
pub const DEFAULT_FAILURE_TIME_S: f64 = 70.0;
/// How long the driver takes to notice a failure, s (section 5.2).
pub const FAILURE_REACTION_S: f64 = 1.0;

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
    /// For how long, s; without it until the run ends.
    #[serde(rename = "duration", skip_serializing_if = "Option::is_none")]
    pub duration_s: Option<f64>,
}

impl Failure {
    /// The first step of the failure, and the first behind it.
    pub(crate) fn steps(&self) -> [u32; 2] {
        let end = |duration_s| step_of(self.time_s + duration_s);
        let steps = [step_of(self.time_s), self.duration_s.map_or(u32::MAX, end)];
        self.at_s().map_or([u32::MAX; 2], |_| steps)
    }

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
            duration_s: None,
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
