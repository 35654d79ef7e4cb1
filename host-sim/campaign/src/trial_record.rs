//! What a trial leaves: for the verdict, and, on request, everything that went into its ECU and came out of it.

use haptic_core::bus::Frame;
use haptic_core::controller::params::Params;
use haptic_core::quantity::Instant;
use haptic_sim::ecu_events::EcuEvents;

use super::invariants::Violation;

/// What a run leaves for the verdict. Steps are of the world, 1 ms.
#[derive(Debug, Clone, Default)]
pub(super) struct TrialRecord {
    /// Every mode with the step in which it began.
    pub(super) modes: Vec<(u32, u64)>,
    /// When the fault could first be seen.
    pub(super) seen_at: Option<u32>,
    /// When a motor that was not seen astray was first seen to deliver too little, for good.
    pub(super) weak_at: Option<u32>,
    /// Largest share of the margin used, up to the first change of mode after the onset.
    pub(super) used: f64,
    /// Largest part used of the margins that a contradiction uses, whatever the row looks at.
    pub(super) contradicted: f64,
    /// First step from the onset on with no torque in Active.
    pub(super) yielded_at: Option<u32>,
    /// Whether a limit acted for the driver's sake from the onset on.
    pub(super) overridden: bool,
    /// Largest torque from the onset on, N.m.
    pub(super) peak_nm: f64,
    /// Tampered frames that the ECU rejected.
    pub(super) rejected: u32,
    /// The first that it accepted.
    pub(super) accepted_bad_at: Option<u32>,
    /// Cause of the last reset, as the status frame has it.
    pub(super) reset: u64,
    pub(super) cycles: u64,
    /// Last step.
    pub(super) steps: u32,
    pub(super) violation: Option<Violation>,
    /// Whether the driver was off the road when the ECU left, with or without the fault.
    pub(super) driven_off: bool,
    /// What the ECU said.
    pub(super) ecu: EcuEvents,
}

/// Everything that went into an ECU and came out of it, so that another can be put in its place.
#[derive(Debug, Clone)]
pub(super) struct EcuTrace {
    pub(super) params: Params,
    pub(super) start: haptic_lockstep::Start,
    pub(super) ticks: Vec<Tick>,
}

/// One run of the ECU.
#[derive(Debug, Clone)]
pub(super) struct Tick {
    /// In the world, ms.
    pub(super) step: u32,
    /// On the ECU's clock.
    pub(super) now: Instant,
    /// What it received before, and whether it accepted it.
    pub(super) frames: Vec<(Frame, bool)>,
    /// What it sent: guidance first.
    pub(super) answer: Vec<Frame>,
}
