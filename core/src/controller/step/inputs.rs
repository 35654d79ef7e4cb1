//! New inputs go through the plausibility checks, and what the checks know of lost ones is forgotten.

use super::Step;
use crate::controller::injection::Injection;
use crate::controller::inputs::{ColumnState, Input, Inputs, Motion};
use crate::controller::memory::ChangedParts;
use crate::law::probe::ProbeState;
use crate::observer::{self, Observer, Sensor};
use crate::quantity::{Radians, Torque};
use crate::safety::faults::{Fault, FaultSet};
use crate::safety::modes::Mode;
use crate::safety::plausibility::LaneMotion;

#[expect(clippy::as_conversions, reason = "a code is its discriminant")]
const STANDBY: u8 = Mode::Standby as u8;

impl<I: Injection> Step<'_, I> {
    /// Takes new inputs, and forgets lost ones. Returns the faults of lost inputs.
    pub(super) fn update_inputs(&mut self, fast_enough: Option<bool>) -> FaultSet {
        let inputs = self.inputs;
        let mut kept = self.memory.faults();
        self.hands = match self.sensor {
            Sensor::Hands => inputs.column.value().map(|column| column.driver_torque),
            Sensor::Bar(observer) => self.observed_hands(observer),
        };
        if let Input::New(motion) = &inputs.motion {
            self.update_motion(motion, &mut kept);
        }
        if fast_enough != Some(true) {
            self.changed.add(ChangedParts::LANE);
            self.changed.add(ChangedParts::COLUMN);
            // Neither model holds at a walking pace, let alone at an unknown one.
            self.memory.plausibility.forget_lane();
            self.memory.plausibility.forget_column();
        }
        match &inputs.column {
            Input::New(column) => {
                self.memory.input_times.column = self.now;
                self.changed.add(ChangedParts::INPUT_TIMES);
                self.changed.add(ChangedParts::COLUMN);
                // The rim of a free wheel answers the probe too: driver torques are compared where it passes zero.
                if let Some(hands) = self.hands.filter(|_| self.memory.fast.probe.is_passing_zero()) {
                    // How much of its friction a wheel that hardly turns has given, nobody sees.
                    let unsure = match self.sensor {
                        Sensor::Hands => Torque::ZERO,
                        Sensor::Bar(observer) => Torque::from_fixed(observer.friction),
                    };
                    self.memory.fast.hands.update(hands, unsure);
                }
                let angle = self.column_angle(column);
                self.memory.plausibility.set_wheel_angle(angle);
            }
            Input::Held(_) => {}
            Input::Lost => {
                self.changed.add(ChangedParts::COLUMN);
                self.memory.plausibility.forget_column();
                // Lost is no longer implausible: the time-out says what is wrong now.
                kept.set(false, Fault::ColumnImplausible);
            }
        }
        // The lane in use and not the input's: while it is extrapolated it is not lost.
        match self.lane {
            Input::New(_) => {
                self.memory.input_times.lane = self.now;
                self.changed.add(ChangedParts::INPUT_TIMES);
            }
            Input::Held(_) => {}
            Input::Lost => {
                self.changed.add(ChangedParts::LANE);
                self.memory.plausibility.forget_lane();
                self.once.motion_history.forget_line();
                kept.set(false, Fault::LaneImplausible);
            }
        }
        self.check_column(&mut kept);
        self.check_lane(&mut kept);
        self.compensate_age();
        if let Input::New(_) = inputs.request {
            self.memory.input_times.request = self.now;
            self.changed.add(ChangedParts::INPUT_TIMES);
        }
        self.memory.fast.kept = kept.bits();
        lost_inputs(inputs)
    }

    /// The hands' torque by the observer, which begins anew after a lost column.
    #[inline(never)]
    fn observed_hands(&mut self, observer: &Observer) -> Option<Torque> {
        let Some(column) = self.inputs.column.value() else {
            self.observer.set(observer::State::NEW);
            return None;
        };
        let is_new = matches!(self.inputs.column, Input::New(_));
        let angle = is_new.then_some(column.wheel_angle);
        let step = |state: &mut _| observer.step(state, column.driver_torque, angle);
        Some(self.observer.amend(step))
    }

    /// The angle of the column, which the road wheels follow.
    fn column_angle(&self, column: &ColumnState) -> Radians {
        match self.sensor {
            Sensor::Hands => column.wheel_angle,
            Sensor::Bar(observer) => observer.column_angle(column.wheel_angle, column.driver_torque),
        }
    }

    /// Takes speeds and yaw rate that came since the last step: judges them, and what follows from the speed.
    fn update_motion(&mut self, motion: &Motion, kept: &mut FaultSet) {
        let passed = self.now.since(self.memory.input_times.motion);
        self.memory.input_times.motion = self.now;
        self.changed.add(ChangedParts::INPUT_TIMES);
        self.changed.add(ChangedParts::MOTION);
        let plausibility = &mut self.memory.plausibility;
        let (agree, plausible) = plausibility.speeds_agree(motion.speeds, passed);
        kept.set(!plausible, Fault::SpeedImplausible);
        // Of two speeds that disagree nobody knows the right one: the last on which they agreed stays.
        let speed = if agree {
            motion.speeds[0]
        } else {
            plausibility.speed()
        };
        let measured = motion.yaw_rate();
        let yaw_rate = measured.and_then(|rate| plausibility.accepted_yaw_rate(rate, passed));
        let is_distrusted = measured.is_some() && plausibility.motion.yaw.is_distrusted();
        kept.set(is_distrusted, Fault::YawRate);
        self.config.plausibility.motion(plausibility, speed, yaw_rate);
        self.memory.share = self.config.schedule.share(plausibility.speed());
        let turning = plausibility.turning();
        self.once.motion_history.record_turning_rate(self.now, turning);
    }

    /// Checks the column where a sample of it is pending.
    fn check_column(&mut self, kept: &mut FaultSet) {
        let Some(column) = to_check(&self.inputs.column, &mut self.once.is_column_pending) else {
            return;
        };
        self.changed.add(ChangedParts::COLUMN);
        // Before guidance and beside the probe a torque that stays the same to the bit has less excuse.
        let is_tested =
            self.memory.fast.packed.mode == STANDBY || self.memory.fast.probe != ProbeState::SILENT;
        let passed = self.memory.plausibility.since_column(self.now);
        let is_alive = self.once.frozen_torque.is_alive(
            column.driver_torque,
            column.wheel_angle,
            self.memory.plausibility.speed(),
            passed,
            is_tested,
        );
        let angle = self.column_angle(&column);
        let plausible = self.config.plausibility.column(
            &mut self.memory.plausibility,
            self.now,
            column.driver_torque,
            angle,
            self.applied,
        );
        kept.set(!(is_alive && plausible), Fault::ColumnImplausible);
    }

    /// Checks the lane where a sample of it is pending.
    fn check_lane(&mut self, kept: &mut FaultSet) {
        let Some(sample) = to_check(&self.lane, &mut self.once.is_lane_pending) else {
            return;
        };
        self.changed.add(ChangedParts::LANE);
        let (checks, now) = (&self.config.plausibility, self.now);
        let (state, motion_history) = (&mut self.memory.plausibility, &mut self.once.motion_history);
        let moved = if self.memory.coast.is_extrapolating() {
            state.accept_extrapolation(motion_history, now, sample);
            // Pictures of another line are compared with themselves; where none comes, nothing is.
            let is_elsewhere = self.memory.coast.sees_other_line();
            let picture = self.inputs.lane.value().filter(|_| is_elsewhere);
            picture.map(|picture| checks.other_lane(state, motion_history, now, picture))
        } else {
            Some(checks.lane(state, motion_history, now, sample))
        };
        if let Some(moved) = moved {
            kept.set(moved == LaneMotion::Inconsistent, Fault::LaneImplausible);
        }
        if moved == Some(LaneMotion::ContradictsYawRate) {
            self.changed.add(ChangedParts::MOTION);
            state.distrust_yaw_rate();
            kept.insert(Fault::YawRate);
        }
    }

    /// Whether both speeds reach the slowest that is guided, if they are known.
    pub(super) fn is_fast_enough(&self) -> Option<bool> {
        let least = self.config.least_speed;
        let motion = self.inputs.motion.value();
        motion.map(|motion| motion.speeds.iter().all(|speed| *speed >= least))
    }
}

/// A time-out fault for each input without a usable value.
fn lost_inputs(inputs: &Inputs) -> FaultSet {
    let mut lost = FaultSet::NONE;
    // Where frames arrive and are refused, LaneStep or SpeedStep says so, and there is no time-out.
    let refused = |fault| inputs.faults.contains(fault);
    lost.insert_if(
        inputs.lane.value().is_none() && !refused(Fault::LaneStep),
        Fault::LaneTimeout,
    );
    lost.insert_if(inputs.column.value().is_none(), Fault::ColumnTimeout);
    lost.insert_if(
        inputs.motion.value().is_none() && !refused(Fault::SpeedStep),
        Fault::SpeedTimeout,
    );
    lost.insert_if(inputs.request.value().is_none(), Fault::RequestTimeout);
    lost
}

/// The value to check in this step: one that was new in the step before, so that a step with a new value, which costs most,
/// checks nothing. Where every step has a new value, every second one is checked, over the time of both.
fn to_check<T: Copy>(input: &Input<T>, is_pending: &mut bool) -> Option<T> {
    let was_pending = core::mem::replace(is_pending, matches!(input, Input::New(_)) && !*is_pending);
    if was_pending { input.value() } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each new value is checked once, in the step after it; where there is one in every step, in every other step.
    #[test]
    fn a_value_is_checked_in_the_step_after_it() {
        let mut pending = false;
        let inputs = [
            (Input::Lost, None),
            (Input::Held(1), None),
            (Input::New(2), None),
            (Input::Held(2), Some(2)),
            (Input::Held(2), None),
            (Input::New(3), None),
            (Input::New(4), Some(4)),
            (Input::New(5), None),
            (Input::New(6), Some(6)),
            (Input::New(7), None),
            (Input::Lost, None),
            (Input::Held(8), None),
        ];
        for (step, (input, checked)) in inputs.into_iter().enumerate() {
            assert_eq!(to_check(&input, &mut pending), checked, "{step}");
        }
    }
}
