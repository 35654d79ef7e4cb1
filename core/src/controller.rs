//! The controller's step: decoded inputs in, one torque command out. The only place that sees both the law
//! and the envelope.

use crate::envelope::LimitReason;
use crate::law::{LaneSample, LawState};
use crate::params::Config;
use crate::quantity::{Instant, Micros, Torque};

/// Older lane errors than this are not acted on.
pub const LANE_TIMEOUT: Micros = Micros::from_ms(30);

/// What the controller reads every millisecond.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Inputs {
    /// The latest lane errors that passed every check, if any.
    pub lane: Option<LaneSample>,
}

/// What the controller decides every millisecond.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Command {
    /// T_h, the guidance torque to apply.
    pub torque: Torque,
    /// Which limit held it back.
    pub limit: LimitReason,
}

/// The whole control law with its limits; immutable.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Controller {
    config: Config,
}

/// What the controller remembers from step to step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ControllerState {
    law: LawState,
}

impl ControllerState {
    /// Nothing seen yet.
    pub const NEW: Self = Self { law: LawState::NEW };
}

impl Controller {
    /// A controller with checked parameters.
    #[must_use]
    pub const fn new(config: Config) -> Self {
        Self { config }
    }

    /// One step of the 1 kHz loop.
    #[must_use]
    pub fn step(&self, state: &mut ControllerState, now: Instant, inputs: &Inputs) -> Command {
        let fresh = inputs.lane.filter(|sample| now.since(sample.at) <= LANE_TIMEOUT);
        let Some(sample) = fresh else {
            // An old sample must not meet a new one across a wrap of the clock.
            state.law = LawState::NEW;
            return Command {
                torque: Torque::ZERO,
                limit: LimitReason::NoLaneInput,
            };
        };
        let wanted = self.config.law.step(&mut state.law, sample);
        let (torque, limit) = self.config.envelope.limit(wanted);
        Command { torque, limit }
    }
}
