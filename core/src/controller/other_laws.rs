//! The laws beside (9), FDCA and driver activity, as a step sees them: what they remember, and what they make of a new speed.
//!
//! Both work once for each vehicle frame, a step later and where no lane sample is checked, so that no step with most of the frames
//! does more. Driver activity then is a factor of the share of the law at this speed; FDCA has new gains.
//!
//! Not here: the equations ([`crate::law`]), and what a step makes of them (`step`).

use super::Memory;
use crate::controller::config::{Config, OtherLaws};
use crate::controller::inputs::Inputs;
use crate::law::Choice;
use crate::law::activity::Activity;
use crate::law::fdca::Gains;
use crate::quantity::{Ratio, Torque};
use crate::safety::redundant::Redundant;

/// What they remember.
#[derive(Debug, Clone)]
pub(crate) struct OtherState {
    /// Of FDCA, at the speed in use. Compared where it is read: (9) does not pay for it.
    pub(crate) gains: Redundant<Gains>,
    /// What driver activity leaves of (9).
    pub(crate) share: Redundant<Ratio>,
    /// Not kept twice (`law::activity` says why).
    activity: Activity,
}

impl OtherState {
    pub(super) fn new() -> Self {
        Self {
            gains: Redundant::new(Gains::NONE),
            share: Redundant::new(Ratio::ONE),
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
        let laws = laws.get()?;
        if config.law.is(Choice::Fdca) {
            let motion = &memory.plausibility;
            let gains = laws.fdca.gains(motion.speed(), motion.turning_gain());
            return self.gains.change(|kept| *kept = gains);
        }
        if let Some(column) = inputs.column.value() {
            let (at, torques) = (memory.input_times.column, [column.driver_torque, applied]);
            self.activity.update(&config.law, at, column.wheel_angle, torques);
        }
        let share = Ratio::ONE.minus(self.activity.taken(laws.least_share));
        self.share.change(|kept| *kept = share)
    }
}
