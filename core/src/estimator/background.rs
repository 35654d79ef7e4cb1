//! The advisory part of a step: the live estimate of K_hg, and the telemetry that reports it with the probe. Every
//! step hands over its sample; the work is done after the torque has left.
//!
//! No torque depends on it, so it may use f32, and its state is not kept twice: a flipped bit spoils an estimate at
//! most until the next probe.

use crate::bus::Frame;
use crate::bus::messages::{Message, Telemetry};
use crate::estimator::{Estimator, EstimatorState, Sample};
use crate::quantity::Torque;

/// Steps between two telemetry frames; a frame may be up to [`PATIENCE`] steps late.
const TURN: u32 = 20;
/// See [`TURN`].
const PATIENCE: u32 = 3;

/// The samples that the last steps handed over, and the estimate so far.
#[derive(Debug, Clone)]
pub(crate) struct Background {
    estimator: Estimator,
    /// The state of the estimate, while there is a probe.
    k_hg: Option<EstimatorState>,
    /// The sample of the last step, and that of the step before.
    samples: [Option<Sample>; 2],
    probe: Option<Torque>,
    steps: u32,
    /// Whether a telemetry frame is due.
    due: bool,
}

impl Background {
    /// The state before the first step.
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

    /// Takes the column's sample of a step, if it was new, and the probe, if there is one.
    pub(crate) fn take(&mut self, sample: Option<Sample>, probe: Option<Torque>) {
        let [new, before] = &mut self.samples;
        *before = *new;
        *new = sample;
        self.probe = probe;
    }

    /// Does the work for one step, and returns a telemetry frame when one is due. A step with a new sample has
    /// decoded and checked it already, so the estimator takes it one step later, and telemetry waits for up to
    /// [`PATIENCE`] steps.
    #[expect(clippy::as_conversions, reason = "a counter is cut to its four bits")]
    pub(crate) fn step(&mut self) -> Option<Frame> {
        let [new, sample] = &self.samples;
        let mut is_free = new.is_none();
        match (&mut self.k_hg, self.probe) {
            (Some(state), Some(_)) => self.estimator.step(state, sample.as_ref()),
            // Starting the estimate is all that this step does.
            (none, Some(_)) => {
                *none = Some(self.estimator.start());
                is_free = false;
            }
            // Earlier readings are no evidence of how the driver drives now.
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
