//! Whether the line moves as the vehicle does.
//!
//! Between two samples the near-point error must move as the vehicle does:
//! `de_y'/dt = v*theta_n - L_n*psi_dot`. Here `theta_n` is the direction of the line at the near point relative to
//! the vehicle, `L_n` the distance to that point, and `psi_dot` the yaw rate. With a measured yaw rate both are
//! known: the near point is where the far point was `t'_f - t'_n` earlier, so `theta_n` is the direction that the far
//! point had at that time, minus the angle that the vehicle has turned since ([`crate::safety::motion_history`]).
//! What then remains of a correct preview are constant errors: the mounting angle of the camera and the offset of the
//! yaw rate. A slow estimate, the *bias*, removes them. It is bounded so that it cannot absorb a false lane. Where no
//! trusted yaw rate exists ([`crate::safety::yaw`]), it is computed from wheel angle and speed by the steady-state
//! bicycle model, plus the long-run difference between measurement and model. Gusts, banked roads and worn tyres make
//! this value less accurate, so the margins are then 2.5 times as wide.
//!
//! The predicted change and the observed change are each summed with a time constant of 1 s. The preview is
//! implausible when the predicted sum exceeds the observed one, in the direction of the prediction, by more than the
//! margin. So an error that is frozen, has the wrong sign or is too small is found as soon as it should have moved.
//! An error that moves *more* than predicted (by a gust, by noise, by the camera's scale) may be real and is limited
//! by the envelope alone, but only up to `UNREAL`: with a measured yaw rate, an error that moves further than that
//! beyond the prediction belongs to a line that slides away. A yaw error that is frozen or has the wrong sign
//! predicts a movement that does not happen, and is found in the same way.

use fixed::types::I8F24;

use super::{Plausibility, PlausibilityState, lane_step_is_possible};
use crate::lane::LaneSample;
use crate::quantity::{
    Instant, Metres, Radians, Speed, TurningRate, leak, per_second, product, product_below, saturate,
};
use crate::safety::motion_history::MotionHistory;
use crate::safety::redundant::words;
use crate::safety::yaw::BIAS_SHIFT;

/// The part of the motion predicted within a second that may be missing.
pub const LANE_MARGIN: Metres = Metres::from_m(0.4);
/// Within a second no vehicle moves this much further than its yaw rate predicts.
pub const UNREAL: Metres = Metres::from_m(0.8);
/// The margins where the prediction comes from wheel angle and speed.
const LANE_MARGIN_BY_WHEEL: Metres = Metres::from_m(1.0);
const UNREAL_BY_WHEEL: Metres = Metres::from_m(2.0);
/// A line that was adopted is doubted until this much movement was predicted of it, or the vehicle turned its near point by as
/// much, within a second, and no more than a quarter of that is missing.
const SHOWS: Metres = Metres::from_m(0.2);
/// Bounds of the long-run error of the lane's prediction. With a yaw rate: 5 mrad of camera mounting at 30 m/s; by
/// wheel angle and speed: 1.5 deg of wheel offset and a bank of 5 %.
pub const LANE_BIAS: Speed = Speed::from_m_per_s(0.15);
const LANE_BIAS_BY_WHEEL: Speed = Speed::from_m_per_s(0.5);

words! {
    /// The part that a check of the lane changes.
    pub(crate) struct LaneState {
        pub(super) is_known: u32,
        /// 1 if the last picture differed from the one before. A picture that repeats itself is no evidence against
        /// another sensor.
        pub(super) is_alive: u32,
        pub(super) last: LaneSample,
        /// The movement of the near point that was predicted and the one that was observed, each summed with a time constant of 1 s.
        pub(super) predicted: Metres,
        pub(super) seen: Metres,
        /// The long-run error of the prediction, which corrects it.
        pub(super) bias: Speed,
        /// Another line that pictures show: whether there is one, and its last sample.
        pub(super) other_is_known: u32,
        pub(super) other: LaneSample,
        /// 1 since another line was adopted, until it moved as the vehicle does; and how far the vehicle turned the near
        /// point meanwhile, summed as the movements are.
        pub(super) is_doubted: u32,
        pub(super) turned: Metres,
    }
}

impl LaneState {
    pub(super) const NEW: Self = Self {
        is_known: 0,
        is_alive: 0,
        last: LaneSample {
            e_y: Metres::ZERO,
            e_theta: Radians::ZERO,
            at: Instant::from_us(0),
        },
        predicted: Metres::ZERO,
        seen: Metres::ZERO,
        bias: Speed::ZERO,
        other_is_known: 0,
        other: LaneSample {
            e_y: Metres::ZERO,
            e_theta: Radians::ZERO,
            at: Instant::from_us(0),
        },
        is_doubted: 0,
        turned: Metres::ZERO,
    };

    fn swap_lines(&mut self) {
        core::mem::swap(&mut self.last, &mut self.other);
        core::mem::swap(&mut self.is_known, &mut self.other_is_known);
    }
}

/// How the near-point error moved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LaneMotion {
    /// It moved as predicted.
    Consistent,
    /// It moved as wheel angle and speed predict, but not as the yaw rate does.
    ContradictsYawRate,
    /// Neither as the yaw rate predicts nor as wheel angle and speed do.
    Inconsistent,
}

impl PlausibilityState {
    /// The part of the predicted movement that was not observed, positive in its direction; negative where more was
    /// observed than predicted.
    pub(super) fn missing(&self) -> Metres {
        let missing = self.lane.predicted.minus(self.lane.seen);
        if self.lane.predicted < Metres::ZERO {
            missing.opposite()
        } else {
            missing
        }
    }

    /// Takes the extrapolated lane in place of a picture.
    pub(crate) fn accept_extrapolation(
        &mut self,
        motion_history: &mut MotionHistory,
        now: Instant,
        sample: LaneSample,
    ) {
        motion_history.record_line(now, sample.at, sample.e_theta);
        self.lane.last = sample;
    }

    /// Forgets the lane, which was lost: the next sample is compared with nothing.
    pub fn forget_lane(&mut self) {
        (self.lane.is_known, self.lane.predicted, self.lane.seen) = (0, Metres::ZERO, Metres::ZERO);
        (self.lane.other_is_known, self.lane.is_doubted) = (0, 0);
    }

    /// Forgets the other line: pictures agree with the one that is followed.
    pub(crate) fn forget_other_line(&mut self) {
        self.lane.other_is_known = 0;
    }

    /// Follows the other line, which is doubted until it has moved as the vehicle does. What was summed up is kept: a line
    /// that lied before it jumped has not become another camera's.
    pub(crate) fn adopt_other_line(&mut self, motion_history: &mut MotionHistory) {
        motion_history.swap_lines();
        self.lane.swap_lines();
        (self.lane.other_is_known, self.lane.is_doubted, self.lane.turned) = (0, 1, Metres::ZERO);
    }

    /// Whether the line has not yet moved as the vehicle does since it was adopted.
    pub(crate) const fn is_line_doubted(&self) -> bool {
        self.lane.is_doubted != 0
    }
}

impl Plausibility {
    /// Takes a sample of another line, whose movements are summed with those of the line before it.
    #[must_use]
    // A call more or less must not depend on a feature: `cargo xtask gate` compares the code.
    #[inline(always)]
    pub(crate) fn other_lane(
        &self,
        state: &mut PlausibilityState,
        motion_history: &mut MotionHistory,
        now: Instant,
        sample: LaneSample,
    ) -> LaneMotion {
        motion_history.swap_lines();
        state.lane.swap_lines();
        // It may have jumped where no picture came.
        if state.lane.is_known == 0 || !lane_step_is_possible(&state.lane.last, &sample) {
            state.lane.is_known = 0;
            motion_history.forget_line();
        }
        let moved = self.lane(state, motion_history, now, sample);
        motion_history.swap_lines();
        state.lane.swap_lines();
        moved
    }

    /// Whether the other line has been watched for long enough to be compared with the vehicle's movement, and used no more
    /// than half of the margin.
    #[must_use]
    pub(crate) fn other_line_follows(
        &self,
        state: &PlausibilityState,
        motion_history: &mut MotionHistory,
        now: Instant,
    ) -> bool {
        motion_history.swap_lines();
        let known = motion_history.line_direction(now, state.lane.other.at, self.between);
        motion_history.swap_lines();
        let margin = if state.motion.has_yaw_rate != 0 {
            LANE_MARGIN
        } else {
            LANE_MARGIN_BY_WHEEL
        };
        let is_known = state.lane.other_is_known != 0 && known.is_some();
        is_known && state.missing().abs().fixed() <= margin.fixed().wrapping_shr(1)
    }

    /// Takes a lane sample that arrived in this step, and says whether its error moved as predicted. Not inlined, for
    /// the reason given at [`Self::column`].
    #[must_use]
    #[inline(never)]
    pub fn lane(
        &self,
        state: &mut PlausibilityState,
        motion_history: &mut MotionHistory,
        now: Instant,
        sample: LaneSample,
    ) -> LaneMotion {
        motion_history.record_line(now, sample.at, sample.e_theta);
        let measured = state.motion.has_yaw_rate != 0;
        // Predicted from wheel angle and speed, a movement may be missing because of a bank, a gust or a tyre.
        let (margin, unreal, most_bias) = if measured {
            (LANE_MARGIN, UNREAL, LANE_BIAS)
        } else {
            (LANE_MARGIN_BY_WHEEL, UNREAL_BY_WHEEL, LANE_BIAS_BY_WHEEL)
        };
        let unreal = if state.lane.is_doubted != 0 {
            Metres::from_fixed(unreal.fixed().wrapping_shr(1))
        } else {
            unreal
        };
        let dt = sample.at.since(state.lane.last.at);
        if state.lane.is_known != 0 && dt.us() != 0 {
            let seen = sample.e_y.minus(state.lane.last.e_y).fixed();
            let rate = self.line_rate(state, motion_history, now, state.lane.last.at);
            // Where the line has not been known for long enough, the observed change counts as the prediction.
            let predicted = rate.map_or(seen, |rate| per_second(rate, dt));
            let bias = state.lane.bias.fixed();
            let predicted = predicted.saturating_add(per_second(bias, dt));
            let learnt = seen.saturating_sub(predicted).wrapping_shr(BIAS_SHIFT);
            state.lane.bias = Speed::from_fixed(bias.saturating_add(learnt)).within(most_bias);
            let summed = |sum: Metres, change: I8F24| Metres::from_fixed(leak(sum.fixed(), change, dt));
            state.lane.predicted = summed(state.lane.predicted, predicted);
            state.lane.seen = summed(state.lane.seen, seen);
            state.lane.is_alive = u32::from(seen != I8F24::ZERO || sample.e_theta != state.lane.last.e_theta);
            if state.lane.is_doubted != 0 {
                let turned = self.turning_rate(state, motion_history.heading(now, sample.at).rate);
                state.lane.turned = summed(state.lane.turned, per_second(turned, dt));
            }
        }
        (state.lane.is_known, state.lane.last) = (1, sample);
        // A missing movement counts only if more than half the margin was predicted. A movement that was not
        // predicted proves a fault only where it is larger than any vehicle's.
        let (predicted, missing) = (state.lane.predicted, state.missing());
        if state.lane.is_doubted != 0 {
            let moved = predicted.abs().max(state.lane.turned.abs());
            let follows = missing.abs().fixed() <= moved.fixed().wrapping_shr(2);
            state.lane.is_doubted = u32::from(moved < SHOWS || !follows);
        }
        let is_missing = missing > margin && predicted.abs().fixed() > margin.fixed().wrapping_shr(1);
        if !is_missing && missing.abs() <= unreal {
            return LaneMotion::Consistent;
        }
        // A yaw rate that is too large makes the predicted movement smaller, through the distance to the far point.
        // This effect is complete only 0.4 s later, so it is enough if the yaw rate explains a quarter of the
        // discrepancy.
        let far = saturate(product(self.far_time.fixed(), state.motion.speed.fixed()));
        let less = product_below(far, state.motion.yaw.sum.fixed());
        let is_too_much = predicted >= state.lane.seen;
        let explained = if is_too_much {
            I8F24::ZERO.saturating_sub(less)
        } else {
            less
        };
        if measured && state.lane.is_alive != 0 && explained > missing.abs().fixed().wrapping_shr(2) {
            (state.lane.predicted, state.lane.seen) = (Metres::ZERO, Metres::ZERO);
            return LaneMotion::ContradictsYawRate;
        }
        LaneMotion::Inconsistent
    }

    /// The rate that the near-point error must have at an instant, m/s, by the measured yaw rate and the direction of
    /// the line.
    fn line_rate(
        &self,
        state: &PlausibilityState,
        motion_history: &MotionHistory,
        now: Instant,
        at: Instant,
    ) -> Option<I8F24> {
        let near = motion_history.line_direction(now, at, self.between)?;
        let turning = motion_history.heading(now, at).rate;
        let along = saturate(product(state.motion.speed.fixed(), near.fixed()));
        Some(along.saturating_sub(self.turning_rate(state, turning)))
    }

    /// The rate at which a yaw rate moves the near point aside, m/s.
    fn turning_rate(&self, state: &PlausibilityState, turning: TurningRate) -> I8F24 {
        let reach = saturate(product(self.near_time.fixed(), state.motion.speed.fixed()));
        product_below(reach, turning.fixed())
    }

    /// The rate that the near-point error must have where the line's direction is not known: the line is assumed to bend as
    /// the vehicle turns.
    fn bend_rate(&self, state: &PlausibilityState, e_theta: Radians) -> I8F24 {
        let heading = saturate(product(state.motion.speed.fixed(), e_theta.fixed()));
        let far = saturate(product(self.far_time.fixed(), state.motion.speed.fixed()));
        heading.saturating_sub(product_below(far, state.turning().fixed()))
    }

    /// The lane that a missing picture would show: the last sample, moved to a later instant along the known line and
    /// by the yaw rate.
    #[must_use]
    pub fn extrapolated_lane(
        &self,
        state: &PlausibilityState,
        motion_history: &MotionHistory,
        now: Instant,
        last: &LaneSample,
        at: Instant,
    ) -> LaneSample {
        let rate = self.line_rate(state, motion_history, now, last.at);
        let rate = rate.unwrap_or_else(|| self.bend_rate(state, last.e_theta));
        let moved = per_second(rate, at.since(last.at));
        let turned = motion_history.direction_change(now, last.at, at);
        LaneSample {
            e_y: last.e_y.plus(Metres::from_fixed(moved)),
            e_theta: last.e_theta.plus(turned),
            at,
        }
    }
}
