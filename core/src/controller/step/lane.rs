//! The lane that the law goes by: the picture's, or where pictures are missing or show another line, the last one, extrapolated; and
//! how the vehicle has moved since a picture that was old when it arrived.

use super::Step;
use crate::controller::injection::Injection;
use crate::controller::inputs::Input;
use crate::controller::memory::ChangedParts;
use crate::lane::LaneSample;
use crate::law::{EgoMotion, LawState};
use crate::quantity::{Instant, Metres, Micros, Radians, Torque, TurningRate, per_second, product};
use crate::safety::coast::{Compared, EXTRAPOLATION_PERIOD, PictureVerdict};
use crate::safety::faults::{Fault, FaultSet};
use crate::safety::plausibility::lane_step_is_possible;

/// A lane sample no older than this when it arrives is continued at its own rates; an older one is also corrected by how the
/// vehicle has turned since.
const PROMPT: Micros = Micros::from_ms(10);
/// A span longer than half a wrap of the clock is negative: the other instant is the later one.
const HALF_WRAP: Micros = Micros::from_us(u32::MAX / 2);
/// Faults that do not end guidance while the lane is extrapolated.
const BRIDGED: FaultSet = FaultSet::NONE
    .with(Fault::LaneTimeout)
    .with(Fault::LaneInvalid)
    .with(Fault::LaneStep);

impl<I: Injection> Step<'_, I> {
    /// Bridges a lane whose picture is missing or contradicts the last one: extrapolates it, and lets the trust in it fall. Returns
    /// the faults that do not end guidance meanwhile, and the faults to report about the pictures.
    pub(super) fn coast(&mut self) -> [FaultSet; 2] {
        let Some(last) = self.memory.law.last() else {
            return [FaultSet::NONE; 2];
        };
        let is_older = |sample: LaneSample| sample.at.since(last.at) > HALF_WRAP;
        // The trust falls from what the law asked for by the last picture, before any share is taken of it.
        let demanded = self.demanded_by_paper(last, self.came_late(last));
        match self.inputs.lane {
            Input::Lost => self.memory.coast.picture_missing(demanded),
            Input::New(sample) if !is_older(sample) => self.compare_picture(&last, sample, demanded),
            _ => {}
        }
        let is_line_doubted = self.memory.plausibility.is_line_doubted();
        self.memory.coast.advance(self.elapsed, is_line_doubted);
        let mut reported = FaultSet::NONE;
        reported.insert_if(self.memory.coast.sees_other_line(), Fault::LaneStep);
        if !self.memory.coast.is_extrapolating() {
            return [FaultSet::NONE, reported];
        }
        let passed = self.now.since(self.memory.input_times.lane);
        // A picture that is older than the extrapolation cannot be compared with it: no further extrapolation until it has caught up.
        let waits = self.inputs.lane.value().is_some_and(is_older);
        // Until then it counts as missing.
        reported.insert_if(waits && !self.memory.coast.sees_other_line(), Fault::LaneTimeout);
        self.lane = if passed < EXTRAPOLATION_PERIOD || waits {
            Input::Held(last)
        } else {
            // Extrapolated to the age that pictures have when they arrive.
            Input::New(self.extrapolated_lane(&last, last.at.after(passed)))
        };
        [BRIDGED, reported]
    }

    /// What a picture after a silence, or beside a line that it does not show, makes of the lane.
    fn compare_picture(&mut self, last: &LaneSample, sample: LaneSample, demanded: Torque) {
        let compared = self.compared(last, &sample);
        match self.memory.coast.picture_arrived(&sample, compared, demanded) {
            // From the extrapolated line to the picture is a jump, and no rate.
            PictureVerdict::Returned => {
                self.memory.law.relocate(sample);
                self.memory.plausibility.forget_other_line();
            }
            PictureVerdict::Adopted => {
                self.memory.law = LawState::NEW;
                self.memory
                    .plausibility
                    .adopt_other_line(&mut self.once.motion_history);
            }
            PictureVerdict::Expected | PictureVerdict::Elsewhere => {}
        }
        self.changed.add(ChangedParts::LAW);
        self.changed.add(ChangedParts::LANE);
    }

    /// How a picture compares with the line that was extrapolated, and with another line that was watched.
    fn compared(&mut self, last: &LaneSample, sample: &LaneSample) -> Compared {
        if self.memory.coast.may_agree()
            && lane_step_is_possible(&self.extrapolated_lane(last, sample.at), sample)
        {
            return Compared::Agrees;
        }
        let (checks, motion_history) = (&self.config.plausibility, &mut self.once.motion_history);
        if checks.other_line_follows(&self.memory.plausibility, motion_history, self.now) {
            Compared::OtherLineFollows
        } else {
            Compared::OtherLine
        }
    }

    fn extrapolated_lane(&self, last: &LaneSample, at: Instant) -> LaneSample {
        let (state, motion_history) = (&self.memory.plausibility, &self.once.motion_history);
        self.config
            .plausibility
            .extrapolated_lane(state, motion_history, self.now, last, at)
    }

    /// How far the vehicle has turned since the lane sample in use, where that was old when it arrived.
    pub(super) fn compensate_age(&mut self) {
        let Some(sample) = self.lane.value() else {
            return;
        };
        self.is_late = self.came_late(sample);
        let fast = &mut self.memory.fast;
        if !self.is_late {
            (fast.turned, fast.rate_then) = (Radians::ZERO, TurningRate::ZERO);
        } else if let Input::New(_) = self.lane {
            (fast.turned, fast.rate_then) = self.once.motion_history.turned(self.now, sample.at);
        } else {
            let turned = per_second(self.memory.plausibility.turning().fixed(), self.elapsed);
            fast.turned = fast.turned.plus(Radians::from_fixed(turned));
        }
    }

    /// Whether a sample was old when it arrived.
    fn came_late(&self, sample: LaneSample) -> bool {
        let [age, held] = [sample.at, self.memory.input_times.lane].map(|at| self.now.since(at).us());
        age.saturating_sub(held) > PROMPT.us()
    }

    /// How the vehicle's motion since an old sample differs from going on at the rate of turn that it had then.
    pub(super) fn ego_motion(&self, sample: LaneSample) -> EgoMotion {
        let (fast, plausibility) = (&self.memory.fast, &self.memory.plausibility);
        let age = self.now.since(sample.at);
        let went_on = per_second(fast.rate_then.fixed(), age);
        let speed = plausibility.speed();
        let near = product(self.config.plausibility.near_time.fixed(), speed.fixed());
        EgoMotion::new(
            fast.turned.minus(Radians::from_fixed(went_on)),
            plausibility.turning().minus(fast.rate_then),
            speed,
            Metres::from_wide(near),
        )
    }
}
