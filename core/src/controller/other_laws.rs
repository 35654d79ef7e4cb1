//! The laws beside (9), FDCA and driver activity, as a step sees them: what they remember, and what they make of a new speed.
//!
//! Both work once for each vehicle frame, a step later and where no lane sample is checked, so that no step with most of the frames
//! does more. Driver activity then is a factor of the share of the law at this speed; FDCA has new gains.
//!
//! Not here: the equations ([`crate::law`]), and what a step makes of them (`step`).

use super::Memory;
use crate::controller::config::{Config, OtherLaws};
use crate::controller::inputs::Inputs;
use crate::law::activity::Activity;
use crate::law::fdca::Gains;
use crate::quantity::{Ratio, Torque};
use crate::safety::redundant::Redundant;

/// What they remember.
#[derive(Debug, Clone)]
pub(crate) struct OtherState {
    /// Of FDCA, at the speed in use. Compared where it is read: (9) does not pay for it.
    pub(crate) gains: Redundant<Gains>,
    /// Not kept twice (`law::activity` says why).
    activity: Activity,
}

impl OtherState {
    pub(super) fn new() -> Self {
        Self {
            gains: Redundant::new(Gains::NONE),
            activity: Activity::NEW,
        }
    }

    /// What a new speed calls for; `None` where the copies of what it needs do not agree.
    #[cold]
    #[inline(never)]
    pub(super) fn work(
        &mut self,
        laws: &Redundant<OtherLaws>,
        config: &Config,
        memory: &Memory,
        applied: Torque,
        inputs: &Inputs,
    ) -> Option<()> {
        if config.is_fdca() {
            let (laws, motion) = (laws.get()?, &memory.plausibility);
            let gains = laws.fdca.gains(motion.speed(), motion.turning_gain());
            return self.gains.change(|kept| *kept = gains);
        }
        if let Some(column) = inputs.column.value() {
            let (at, torques) = (memory.input_times.column, [column.driver_torque, applied]);
            self.activity.update(&config.law, at, column.wheel_angle, torques);
        }
        Some(())
    }

    /// The share of (9) that driver activity leaves, where it may leave so little: of that alone is more than one copy.
    pub(super) fn share(&self, least: Ratio) -> Ratio {
        let taken = self.activity.taken(least);
        Ratio::ONE.minus(taken).max(least).min(Ratio::ONE)
    }
}
