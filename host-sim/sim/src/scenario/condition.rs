//! How much the driver relies on the guidance, and what the controller sees of the world.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::models::driver::ArmGains;

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
    /// Other gains than the paper's.
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
