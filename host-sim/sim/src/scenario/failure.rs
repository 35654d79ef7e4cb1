//! What happens in mid-drive: a failure, and a driver who changes.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::fields::{FieldValue, fields};
use crate::models::driver::ArmGains;
use crate::models::{STEP_S, step_of};

/// When the paper lets the guidance fail, s.
pub const DEFAULT_FAILURE_TIME_S: f64 = 70.0;

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

impl FieldValue for FailureKind {}

fields! {
    /// A failure and its time.
    #[derive(Copy)]
    Failure, "failure" {
        /// what fails: nothing, the torque drops to zero, or the lane preview stops and the ECU hands over
        kind: FailureKind = FailureKind::None, "kind", "", "", OneOf(&["none", "torque", "input"]);
        /// when, before the run ends; `driver.takes_over_after_s` later the driver has `driver.manual_k_d_nm_per_rad`
        time_s: f64 = DEFAULT_FAILURE_TIME_S, "time_s", "", "s", Between(0.0, 1e6);
        /// for how long; without it until the run ends. As long after its end the driver relies on guidance again, and asks
        /// for it anew where the ECU has handed over
        duration_s: Option<f64> = None, "duration_s", "", "s", Between(STEP_S, 1e6);
    }
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

fields! {
    /// A driver who changes in mid-drive, before a failure is noticed.
    #[derive(Copy)]
    DriverChange, "driver_change", complete {
        /// when the driver changes, before the run ends
        time_s: f64 = 0.0, "time_s", "", "s", Between(0.0, 1e6);
        /// K_d from then on
        k_d: f64 = 0.0, "k_d_nm_per_rad", "K_d", "N.m/rad", ArmGains::K_D;
        /// K_hg from then on
        k_hg: f64 = 0.0, "k_hg", "K_hg", "", ArmGains::K_HG;
    }
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
