//! The advisory part of a step: the estimate of the driver's reliance, and the telemetry that reports it with
//! the probe. The ECU fills it in every step; it works when the torque is already on its way.
//!
//! It moves nothing, so that it may use f32, and its state is not kept twice: a flipped bit spoils an
//! estimate at most until the next probe.

use crate::bus::Frame;
use crate::bus::messages::{Message, Telemetry};
use crate::quantity::Torque;
use crate::reliance::{Reliance, RelianceState, Sample};

/// Telemetry comes every so many steps, or one later.
const TURN: u32 = 20;

/// What the last step left to think about, and what came of it so far.
#[derive(Debug, Clone)]
pub(crate) struct Advice {
    estimator: Reliance,
    /// While there is a probe.
    reliance: Option<RelianceState>,
    sample: Option<Sample>,
    probe: Option<Torque>,
    steps: u32,
    /// The telemetry stood back for a sample.
    postponed: bool,
}

impl Advice {
    /// Nothing seen yet.
    pub(crate) const fn new(estimator: Reliance) -> Self {
        Self {
            estimator,
            reliance: None,
            sample: None,
            probe: None,
            steps: 0,
            postponed: false,
        }
    }

    /// Takes what a step saw: the column's sample, if it was new, and the probe, if there is one.
    pub(crate) fn take(&mut self, sample: Option<Sample>, probe: Option<Torque>) {
        (self.sample, self.probe) = (sample, probe);
    }

    /// The work for one step, and the telemetry when it is its turn.
    pub(crate) fn step(&mut self) -> Option<Frame> {
        let sample = self.sample.take();
        if self.probe.is_some() {
            let state = self.reliance.get_or_insert_with(|| self.estimator.start());
            self.estimator.step(state, sample.as_ref());
        } else {
            // What a driver did before is no evidence of what he does now.
            self.reliance = None;
        }
        let steps = self.steps;
        self.steps = steps.wrapping_add(1);
        // A sample is the most work there is; its step is spared the telemetry.
        let due = steps.is_multiple_of(TURN);
        let now = if due { sample.is_none() } else { self.postponed };
        self.postponed = due && !now;
        now.then(|| {
            let telemetry = Telemetry {
                probe: self.probe,
                reliance: self.reliance.as_ref().and_then(RelianceState::reading),
            };
            telemetry.encode((steps / TURN) as u8)
        })
    }
}
