//! The advisory part of a step: the live estimate of K_hg, and the telemetry that reports it with
//! the probe. The ECU fills it in every step; it works when the torque is already on its way.
//!
//! It moves nothing, so that it may use f32, and its state is not kept twice: a flipped bit spoils an
//! estimate at most until the next probe.

use crate::bus::Frame;
use crate::bus::messages::{Message, Telemetry};
use crate::estimator::{Estimator, EstimatorState, Sample};
use crate::quantity::Torque;

/// Telemetry comes every so many steps, or up to [`PATIENCE`] later.
const TURN: u32 = 20;
/// See [`TURN`].
const PATIENCE: u32 = 3;

/// What the last step left to think about, and what came of it so far.
#[derive(Debug, Clone)]
pub(crate) struct Background {
    estimator: Estimator,
    /// While there is a probe.
    k_hg: Option<EstimatorState>,
    /// What the last step saw, and the one before.
    samples: [Option<Sample>; 2],
    probe: Option<Torque>,
    steps: u32,
    /// The telemetry's turn has come.
    due: bool,
}

impl Background {
    /// Nothing seen yet.
    pub(crate) const fn new(estimator: Estimator) -> Self {
        Self {
            estimator,
            k_hg: None,
            samples: [None; 2],
            probe: None,
            steps: 0,
            due: false,
        }
    }

    /// Takes what a step saw: the column's sample, if it was new, and the probe, if there is one.
    pub(crate) fn take(&mut self, sample: Option<Sample>, probe: Option<Torque>) {
        let [new, before] = &mut self.samples;
        *before = *new;
        *new = sample;
        self.probe = probe;
    }

    /// The work for one step, and the telemetry when it is its turn. A step that took a new sample has decoded and
    /// checked it: the estimator gets it one step later, and the telemetry stands back for up to [`PATIENCE`].
    #[expect(clippy::as_conversions, reason = "a counter is cut to its four bits")]
    pub(crate) fn step(&mut self) -> Option<Frame> {
        let [new, sample] = &self.samples;
        let mut is_free = new.is_none();
        match (&mut self.k_hg, self.probe) {
            (Some(state), Some(_)) => self.estimator.step(state, sample.as_ref()),
            // To begin is work enough for a step.
            (none, Some(_)) => {
                *none = Some(self.estimator.start());
                is_free = false;
            }
            // What a driver did before is no evidence of what the driver does now.
            (state, None) => *state = None,
        }
        let steps = self.steps;
        self.steps = steps.wrapping_add(1);
        let (turn, place) = (steps / TURN, steps % TURN);
        self.due |= place == 0;
        let now = self.due && (is_free || place == PATIENCE);
        self.due &= !now;
        now.then(|| {
            let telemetry = Telemetry {
                probe: self.probe,
                k_hg: self.k_hg.as_ref().and_then(EstimatorState::reading),
            };
            telemetry.encode(turn as u8)
        })
    }
}
