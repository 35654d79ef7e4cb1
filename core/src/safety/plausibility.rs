//! Checks whether the inputs can be true together. A CRC cannot see that: a frame may be intact and its values wrong.
//!
//! **Lane.** Between two samples the near-point error must move as the vehicle does:
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
//!
//! **Column.** The torques on the steering column balance: `T_d + T_a + T_h = c_a*v*psi_dot + B_s*dphi/dt`. Not all
//! of them are known exactly. The power assist `T_a` acts in the direction of `T_d` and is at most [`ASSIST`] times
//! as large; the aligning torque `c_a*v*psi_dot` may be wrong by 30 % (trail, tyres, load); and there is friction. So
//! the imbalance is an interval. Its value nearest to zero is summed with a time constant of 1 s: the sum is the
//! least momentum that is unaccounted for, whatever assist, friction and aligning torque were. A short push by the
//! hand that the column answers later cancels in this sum. The inertia (0.11 kg.m2, 0.02 N.m.s at the speeds of a
//! hand) is far below the margin. A constant torque (a banked road, a pull to one side, the offset of the sensor) is
//! estimated slowly, within bounds.
//!
//! **Steps.** A sample that jumps further than a vehicle can move is rejected like a damaged frame. If the jump
//! persists, the input times out; in Active the last lane is then extrapolated ([`crate::safety::coast`]).
//!
//! Fault-free driving stays below the margins: the participants of the paper's tables 5 and 6, and lane changes of 1
//! m/s at 40 to 120 km/h (`tests/plausibility.rs` prints by how much).

use fixed::types::{I0F32, I8F24, I40F24};

use crate::lane::LaneSample;
use crate::quantity::{
    AngularImpulse, CurvaturePerAngle, Instant, Metres, Micros, Radians, Ratio, Seconds, Speed,
    StabilityFactor, Torque, TorquePerAcceleration, TorquePerTurningRate, TurningRate, TurningRatePerAngle,
    leak, per_second, product, product_below, product_of_three, product_within, saturate, signed_quotient,
};
use crate::safety::motion_history::MotionHistory;
use crate::safety::redundant::words;
use crate::safety::yaw::{BIAS_SHIFT, YawState};

words! {
    /// The parameters of the vehicle that the checks use; immutable once validated by [`crate::controller::params`].
    pub struct Plausibility {
        /// K_t/l: front wheel angle per wheel angle, over the wheelbase.
        pub(crate) curvature_gain: CurvaturePerAngle,
        /// Stability factor A of the steady-state bicycle, in 2^-24 s2/m2.
        pub(crate) stability_factor: StabilityFactor,
        /// Aligning torque on the column per lateral acceleration, N.m per m/s2.
        pub(crate) aligning_gain: TorquePerAcceleration,
        /// B_s, N.m.s/rad.
        pub(crate) column_damping: TorquePerTurningRate,
        /// t'_f, s.
        pub(crate) far_time: Seconds,
        /// t'_n, s.
        pub(crate) near_time: Seconds,
        /// The time that the vehicle needs from the near point to the far point, at least 0.
        pub(crate) between: Micros,
    }
}

words! {
    /// Sums and last samples. What one message changes is a struct of its own, so that only that struct is copied.
    pub struct PlausibilityState {
        pub(crate) motion: MotionState,
        pub(crate) lane: LaneState,
        pub(crate) column: ColumnState,
    }
}

words! {
    /// The part that a Vehicle message changes.
    pub(crate) struct MotionState {
        speed: Speed,
        /// Yaw rate per wheel angle at this speed by the bicycle model, 1/s.
        turning_gain: TurningRatePerAngle,
        /// The measured yaw rate, if there is one.
        yaw_rate: TurningRate,
        has_yaw_rate: u32,
        pub(crate) yaw: YawState,
        /// For how long the two speeds have disagreed.
        apart: Micros,
    }
}

words! {
    /// The part that a check of the lane changes.
    pub(crate) struct LaneState {
        is_known: u32,
        /// 1 if the last picture differed from the one before. A picture that repeats itself is no evidence against
        /// another sensor.
        is_alive: u32,
        last: LaneSample,
        predicted: Metres,
        seen: Metres,
        /// The long-run error of the prediction, which corrects it.
        bias: Speed,
    }
}

words! {
    /// The part that a Column message changes.
    pub(crate) struct ColumnState {
        is_known: u32,
        at: Instant,
        wheel: Radians,
        /// The wheel's angle at the last check.
        checked: Radians,
        sum: AngularImpulse,
        /// The long-run imbalance of the torques, which is subtracted.
        bias: Torque,
    }
}

impl PlausibilityState {
    /// Nothing heard yet.
    pub const NEW: Self = Self {
        motion: MotionState {
            speed: Speed::ZERO,
            turning_gain: TurningRatePerAngle::ZERO,
            yaw_rate: TurningRate::ZERO,
            has_yaw_rate: 0,
            yaw: YawState::NEW,
            apart: Micros::from_us(0),
        },
        lane: LaneState {
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
        },
        column: ColumnState {
            is_known: 0,
            at: Instant::from_us(0),
            wheel: Radians::ZERO,
            checked: Radians::ZERO,
            sum: AngularImpulse::ZERO,
            bias: Torque::ZERO,
        },
    };

    /// The yaw rate: the measured one, or else that of the bicycle model plus the long-run difference between the
    /// two.
    #[must_use]
    pub fn turning(&self) -> TurningRate {
        if self.motion.has_yaw_rate != 0 {
            self.motion.yaw_rate
        } else {
            self.turning_by_wheel().plus(self.motion.yaw.bias)
        }
    }

    /// The yaw rate to use, if any, when `measured` arrives `passed` after the last one.
    pub(crate) fn accepted_yaw_rate(&mut self, measured: TurningRate, passed: Micros) -> Option<TurningRate> {
        let by_wheel = self.turning_by_wheel();
        let m = &mut self.motion;
        let last = (m.has_yaw_rate != 0).then_some(m.yaw_rate);
        m.yaw.judge(measured, last, by_wheel, m.speed, passed)
    }

    /// Distrusts the yaw rate, because the lane moves as wheel angle and speed predict and the yaw rate does not.
    pub(crate) fn distrust_yaw_rate(&mut self) {
        self.motion.yaw.distrust();
        self.motion.has_yaw_rate = 0;
    }

    /// The yaw rate by wheel angle and speed alone, without wind or bank.
    fn turning_by_wheel(&self) -> TurningRate {
        TurningRate::from_wide(product(
            self.motion.turning_gain.fixed(),
            self.column.wheel.fixed(),
        ))
    }

    /// The time since the column was last checked; zero if it never was.
    pub(crate) fn since_column(&self, now: Instant) -> Micros {
        if self.column.is_known != 0 {
            now.since(self.column.at)
        } else {
            Micros::from_us(0)
        }
    }

    /// Stores a wheel angle that arrived in this step and is checked in the next.
    pub(crate) fn set_wheel_angle(&mut self, wheel: Radians) {
        self.column.wheel = wheel;
    }

    /// The speed in use.
    #[must_use]
    pub const fn speed(&self) -> Speed {
        self.motion.speed
    }

    /// Compares two speeds that arrive `passed` after the last ones. Returns whether they agree, and whether they
    /// have agreed at some time within `SPEEDS_PATIENCE`.
    #[must_use]
    pub fn speeds_agree(&mut self, [a, b]: [Speed; 2], elapsed: Micros) -> (bool, bool) {
        let agree = speeds_agree(a, b);
        let apart = if agree {
            0
        } else {
            self.motion.apart.us().saturating_add(elapsed.us())
        };
        self.motion.apart = Micros::from_us(apart);
        (agree, apart <= SPEEDS_PATIENCE.us())
    }

    /// The part of the predicted movement that was not observed, positive in its direction; negative where more was
    /// observed than predicted.
    fn missing(&self) -> Metres {
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
    }

    /// Forgets the column, which was lost.
    pub fn forget_column(&mut self) {
        (self.column.is_known, self.column.sum) = (0, AngularImpulse::ZERO);
    }
}

/// Largest change of the near-point error between two samples that is accepted: 0.3 m, nine times the change in 8.3
/// ms at 40 m/s and a yaw error of 0.1 rad.
pub const LANE_STEP: Metres = Metres::from_m(0.3);
/// Likewise for the yaw error: 0.1 rad in 8.3 ms would be 12 rad/s.
pub const YAW_STEP: Radians = Radians::from_rad(0.1);
/// Largest change of a speed between two messages that is accepted: 1 m/s in 10 ms is 10 g.
pub const SPEED_STEP: Speed = Speed::from_m_per_s(1.0);
/// Largest change of a vehicle's speed in a second.
pub(crate) const BRAKES: Speed = Speed::from_m_per_s(12.0);
/// How long a wheel may slip: anti-lock brakes release it within 0.1 s, and on ice within 0.3 s.
pub(crate) const SPEEDS_PATIENCE: Micros = Micros::from_ms(300);
/// Two sources of the speed that differ by this much cannot both be right.
const SPEED_SPREAD: Speed = Speed::from_m_per_s(2.0);

/// Whether a new lane sample is no further from the last than a vehicle can move.
#[must_use]
pub fn lane_step_is_possible(last: &LaneSample, new: &LaneSample) -> bool {
    last.e_y.is_near(new.e_y, LANE_STEP) && last.e_theta.is_near(new.e_theta, YAW_STEP)
}

/// Whether a vehicle can have reached the new speed from the last one, which has been held for the time `held`.
#[must_use]
pub fn speed_step_is_possible(last: Speed, new: Speed, held: Micros) -> bool {
    let braked = Speed::from_fixed(per_second(BRAKES.fixed(), held));
    last.is_near(new, SPEED_STEP.plus(braked))
}

/// Whether two sources of speed agree: less than 2 m/s apart.
#[must_use]
pub fn speeds_agree(a: Speed, b: Speed) -> bool {
    a.fixed().unsigned_dist(b.fixed()) < SPEED_SPREAD.fixed().unsigned_abs()
}

/// The part of the motion predicted within a second that may be missing.
pub const LANE_MARGIN: Metres = Metres::from_m(0.4);
/// The momentum that may be unaccounted for within a second.
pub const COLUMN_MARGIN: AngularImpulse = AngularImpulse::from_nm_s(0.6);
/// Within a second no vehicle moves this much further than its yaw rate predicts.
pub const UNREAL: Metres = Metres::from_m(0.8);
/// The margins where the prediction comes from wheel angle and speed.
const LANE_MARGIN_BY_WHEEL: Metres = Metres::from_m(1.0);
const UNREAL_BY_WHEEL: Metres = Metres::from_m(2.0);
/// Driver torque and power assist together are at most this many times the driver torque.
pub const ASSIST: i32 = 5;
/// Friction of the column, and other torques whose direction is not known.
pub const FRICTION: Torque = Torque::from_nm(0.5);
/// Driver torque, aligning torque and the impulse of the damping between two checks are cut to these values; anything
/// larger is as implausible as they are. With these bounds, and a guidance of 5 N.m that its frame has room for, no
/// sum of the column check reaches 128, the end of an I8F24: 100 + 5 + 16.3 at most before the time, which at least
/// halves it, and 60.7 + 60 + 0.3 + 2.7 after.
const MOST_DRIVER: Torque = Torque::from_nm(20.0);
const MOST_ALIGNING: I8F24 = Torque::from_nm(16.0).fixed();
const MOST_DAMPED: I8F24 = AngularImpulse::from_nm_s(60.0).fixed();
/// The aligning torques by yaw rate and by wheel angle may differ by this much because of wind or bank.
pub const PUSHED: Torque = Torque::from_nm(0.3);
/// The share of the aligning torque that may be wrong: 77/256, 30 %.
pub const ALIGNING_ERROR: Ratio = Ratio::from_si(77.0 / 256.0);
const ALIGNING_SHARE: I0F32 = I0F32::from_bits(ALIGNING_ERROR.bits() << 8);
/// Inertia of column and wheel: 2^-3 kg.m2, a little more than the 0.11 of table 9.
const INERTIA_SHIFT: u32 = 3;
/// Bound of the long-run imbalance of the column: a bank of 5 %, or a pull to one side.
pub const COLUMN_BIAS: Torque = Torque::from_nm(0.5);
/// Bounds of the long-run error of the lane's prediction. With a yaw rate: 5 mrad of camera mounting at 30 m/s; by
/// wheel angle and speed: 1.5 deg of wheel offset and a bank of 5 %.
pub const LANE_BIAS: Speed = Speed::from_m_per_s(0.15);
const LANE_BIAS_BY_WHEEL: Speed = Speed::from_m_per_s(0.5);

impl Plausibility {
    /// Takes the speed in use and the trusted yaw rate. It returns nothing, as neither is checked here. The yaw rate
    /// per wheel angle at this speed, `chi_dot/phi = v*K_t / (l*(1 + A*v^2))`, is the steady state of the bicycle
    /// model.
    pub fn motion(&self, state: &mut PlausibilityState, speed: Speed, yaw_rate: Option<TurningRate>) {
        let is_known = speed == state.motion.speed;
        state.motion.has_yaw_rate = u32::from(yaw_rate.is_some());
        state.motion.yaw_rate = yaw_rate.unwrap_or(TurningRate::ZERO);
        state.motion.speed = speed;
        if is_known {
            return;
        }
        let v = speed.fixed();
        let slip = product_of_three(product(v, v), self.stability_factor.fixed());
        // At most 82, which it reaches at 90 m/s with the largest stability factor.
        let divisor = u32::try_from(slip.saturating_add(I40F24::ONE).to_bits()).unwrap_or(0);
        let gain = self.curvature_gain.fixed().wide_mul(v).to_bits();
        state.motion.turning_gain = TurningRatePerAngle::from_bits(signed_quotient(gain, divisor));
    }

    /// Takes driver torque, wheel angle and the guidance torque applied; `false` when they cannot belong
    /// together. A function of its own, so that its many words do not push a step's out of the registers.
    #[must_use]
    #[inline(never)]
    pub fn column(
        &self,
        state: &mut PlausibilityState,
        now: Instant,
        driver: Torque,
        wheel: Radians,
        applied: Torque,
    ) -> bool {
        let moved = wheel.minus(state.column.checked).fixed();
        let dt = now.since(state.column.at);
        if state.column.is_known != 0 {
            // Steady-state aligning torque: c_a * v * chi_dot.
            let aligning_at = |turning: TurningRate| {
                let lateral = saturate(product(state.motion.speed.fixed(), turning.fixed()));
                product_within(lateral, self.aligning_gain.fixed(), MOST_ALIGNING)
            };
            let aligning = aligning_at(state.turning());
            // A yaw rate that contradicts both pictures and wheel angle may be wrong by its whole value.
            let pushed = if state.lane.is_alive != 0 && state.motion.yaw.is_suspect() {
                MOST_ALIGNING
            } else {
                PUSHED.fixed()
            };
            let by_wheel = aligning_at(state.turning_by_wheel())
                .max(aligning.wrapping_sub(pushed))
                .min(aligning.wrapping_add(pushed));
            let applied = applied.fixed();
            // From here on: the range of driver torque and power assist together.
            let driver = driver.within(MOST_DRIVER).fixed();
            let assisted = driver.wrapping_mul_int(ASSIST);
            let least = applied
                .wrapping_add(driver.min(assisted))
                .wrapping_sub(aligning.max(by_wheel));
            let most = applied
                .wrapping_add(driver.max(assisted))
                .wrapping_sub(aligning.min(by_wheel));
            let damped = product_within(moved, self.column_damping.fixed(), MOST_DAMPED);
            // Torques are multiplied by dt, because the movement of the wheel is that within dt.
            let impulse = |torque: I8F24| per_second(torque, dt);
            let (least, most) = (
                impulse(least).wrapping_sub(damped),
                impulse(most).wrapping_sub(damped),
            );
            let learnt = impulse(state.column.bias.fixed());
            let lacking = nearest_to_zero(least, most).wrapping_sub(learnt);
            let bias = (state.column.bias.fixed()).wrapping_add(lacking.wrapping_shr(BIAS_SHIFT));
            state.column.bias = Torque::from_fixed(bias).within(COLUMN_BIAS);
            let tolerance =
                I8F24::wrapping_from_num(aligning.max(aligning.wrapping_neg()).wide_mul(ALIGNING_SHARE));
            let tolerance = impulse(tolerance.wrapping_add(FRICTION.fixed()));
            // The tolerance is that of the sum: the part that is not needed between two pushes may explain a part of
            // the earlier one.
            let sum = state.column.sum.fixed();
            let (least, most) = (
                leak(sum, lacking.wrapping_sub(tolerance), dt),
                leak(sum, lacking.wrapping_add(tolerance), dt),
            );
            state.column.sum = AngularImpulse::from_fixed(nearest_to_zero(least, most));
        }
        (state.column.is_known, state.column.at) = (1, now);
        (state.column.wheel, state.column.checked) = (wheel, wheel);
        let sum = state.column.sum;
        let above = sum.abs().fixed().wrapping_sub(COLUMN_MARGIN.fixed());
        // Inertia times angle over time is the momentum of the wheel, counted in the direction of the sum.
        let along = if sum < AngularImpulse::ZERO {
            I8F24::ZERO.saturating_sub(moved)
        } else {
            moved
        };
        above <= I8F24::ZERO || per_second(above, dt) <= along.wrapping_shr(INERTIA_SHIFT)
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
        let (margin, unreal, most) = if measured {
            (LANE_MARGIN, UNREAL, LANE_BIAS)
        } else {
            (LANE_MARGIN_BY_WHEEL, UNREAL_BY_WHEEL, LANE_BIAS_BY_WHEEL)
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
            state.lane.bias = Speed::from_fixed(bias.saturating_add(learnt)).within(most);
            let summed = |sum: Metres, change: I8F24| Metres::from_fixed(leak(sum.fixed(), change, dt));
            state.lane.predicted = summed(state.lane.predicted, predicted);
            state.lane.seen = summed(state.lane.seen, seen);
            state.lane.is_alive = u32::from(seen != I8F24::ZERO || sample.e_theta != state.lane.last.e_theta);
        }
        (state.lane.is_known, state.lane.last) = (1, sample);
        // A missing movement counts only if more than half the margin was predicted. A movement that was not
        // predicted proves a fault only where it is larger than any vehicle's.
        let (predicted, missing) = (state.lane.predicted, state.missing());
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
        let reach = saturate(product(self.near_time.fixed(), state.motion.speed.fixed()));
        Some(along.saturating_sub(product_below(reach, turning.fixed())))
    }

    /// The same rate where the line's direction is not known: it is assumed to bend as the vehicle turns.
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

    /// How much of the margins is used up: lane (m), column (N.m.s).
    #[must_use]
    pub fn used_margins(state: &PlausibilityState) -> (Metres, AngularImpulse) {
        (state.missing(), state.column.sum)
    }
}

/// How the near-point error moved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LaneMotion {
    /// As predicted.
    Consistent,
    /// As wheel angle and speed predict, but not as the yaw rate does.
    ContradictsYawRate,
    /// As neither predicts.
    Inconsistent,
}

/// The value of an interval that is nearest to zero; zero itself if the interval contains it.
fn nearest_to_zero(least: I8F24, most: I8F24) -> I8F24 {
    least.max(I8F24::ZERO).wrapping_add(most.min(I8F24::ZERO))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Table 9's vehicle by hand, as docs/parameters.md has it.
    const CURVATURE_GAIN_PER_M: f64 = 1.0 / (17.0 * 2.635);
    const STABILITY_FACTOR_S2_PER_M2: f64 = 0.001_752_9;
    const CHECKS: Plausibility = Plausibility {
        curvature_gain: CurvaturePerAngle::from_per_m(CURVATURE_GAIN_PER_M),
        stability_factor: StabilityFactor::from_s2_per_m2(STABILITY_FACTOR_S2_PER_M2),
        aligning_gain: TorquePerAcceleration::from_nm_s2_per_m(0.987_4),
        column_damping: TorquePerTurningRate::from_nm_s_per_rad(0.57),
        far_time: Seconds::from_s(0.7),
        near_time: Seconds::from_s(0.3),
        between: Micros::from_us(400_000),
    };

    #[test]
    fn a_wheel_angle_turns_the_vehicle_before_it_is_checked() {
        for speed in [8.0, 20.0, 35.0] {
            let mut state = PlausibilityState::NEW;
            CHECKS.motion(&mut state, Speed::from_m_per_s(speed), None);
            state.set_wheel_angle(Radians::from_rad(-0.2));
            // The bicycle model in steady state.
            let steady = CURVATURE_GAIN_PER_M * speed / (1.0 + STABILITY_FACTOR_S2_PER_M2 * speed * speed);
            let turning = state.turning().rad_per_s();
            assert!(
                (turning + 0.2 * steady).abs() < 1e-4,
                "{speed}: {turning} {steady}"
            );
        }
    }

    /// A yaw rate of 0.02 rad/s more than the wheel's, as on a bank: learnt with a lag of 16 s.
    #[test]
    fn without_a_yaw_rate_the_wheel_turns_by_what_it_was_more() {
        let wheel = 0.05 / (CURVATURE_GAIN_PER_M * 20.0) * (1.0 + STABILITY_FACTOR_S2_PER_M2 * 400.0);
        for (sign, by_wheel) in [(1.0, 0.0), (-1.0, 0.0), (1.0, 0.05), (-1.0, 0.05)] {
            let mut state = PlausibilityState::NEW;
            let (speed, passed) = (Speed::from_m_per_s(20.0), Micros::from_ms(10));
            CHECKS.motion(&mut state, speed, None);
            state.set_wheel_angle(Radians::from_rad(wheel * by_wheel / 0.05));
            let measured = TurningRate::from_rad_per_s(by_wheel + sign * 0.02);
            // The first may be any: nothing came before that it could have stepped from.
            let swerve = TurningRate::from_rad_per_s(sign * 0.4);
            assert_eq!({ state }.accepted_yaw_rate(swerve, passed), Some(swerve));
            for _ in 0..2000 {
                let accepted = state.accepted_yaw_rate(measured, passed);
                assert_eq!(accepted, Some(measured));
                CHECKS.motion(&mut state, speed, accepted);
                assert_eq!(state.turning(), measured);
            }
            let expected = by_wheel + sign * 0.02 * (1.0 - f64::exp(-20.0 / 16.0));
            // In the step in which the lane denies it, and from the next message on.
            state.distrust_yaw_rate();
            for _ in 0..2 {
                let turning = state.turning().rad_per_s();
                assert!((turning - expected).abs() < 1e-3, "{turning}, not {expected}");
                CHECKS.motion(&mut state, speed, None);
            }
        }
    }

    #[test]
    fn a_sample_that_comes_twice_says_nothing_new() {
        let (mut state, mut motion_history) = (PlausibilityState::NEW, MotionHistory::new());
        CHECKS.motion(&mut state, Speed::from_m_per_s(20.0), None);
        let at = |ms: u32, e_y: f64| LaneSample {
            e_y: Metres::from_m(e_y),
            e_theta: Radians::ZERO,
            at: Instant::from_us(1000 * ms),
        };
        for sample in [at(10, 0.0), at(20, 0.01)] {
            let moved = CHECKS.lane(&mut state, &mut motion_history, sample.at, sample);
            assert_eq!(moved, LaneMotion::Consistent);
        }
        let before = state;
        let moved = CHECKS.lane(
            &mut state,
            &mut motion_history,
            Instant::from_us(21_000),
            at(20, 0.01),
        );
        assert_eq!(moved, LaneMotion::Consistent);
        assert_eq!(state, before);
    }

    #[test]
    fn a_torque_that_the_column_lacks_is_learnt_within_sixteen_seconds() {
        let mut state = PlausibilityState::NEW;
        CHECKS.motion(&mut state, Speed::from_m_per_s(20.0), None);
        let lacking = Torque::from_nm(0.4);
        for ms in 0..16_000 {
            let now = Instant::from_us(2000 * ms);
            assert!(CHECKS.column(&mut state, now, Torque::ZERO, Radians::ZERO, lacking));
            // A first-order lag of 16 s.
            let learnt = 0.4 * (1.0 - (-2e-3 * f64::from(ms) / 16.0).exp());
            let found = state.column.bias.nm();
            assert!((found - learnt).abs() < 0.01, "{ms}: {found} {learnt}");
        }
    }

    /// A line that drifts aside by 0.1 m/s where the yaw rate says nothing of it.
    #[test]
    fn a_drift_of_the_line_is_learnt_within_sixteen_seconds() {
        let (mut state, mut motion_history) = (PlausibilityState::NEW, MotionHistory::new());
        CHECKS.motion(&mut state, Speed::from_m_per_s(20.0), Some(TurningRate::ZERO));
        for step in 0..1600_u32 {
            let now = Instant::from_us(10_000 * step);
            let seconds = 0.01 * f64::from(step);
            let sample = LaneSample {
                e_y: Metres::from_m(0.1 * seconds - 0.8),
                e_theta: Radians::ZERO,
                at: now,
            };
            let moved = CHECKS.lane(&mut state, &mut motion_history, now, sample);
            assert_eq!(moved, LaneMotion::Consistent);
            // A first-order lag of 16 s, once the line is known for 0.4 s.
            let learnt = 0.1 * (1.0 - (-(seconds - 0.4).max(0.0) / 16.0).exp());
            let found = state.lane.bias.m_per_s();
            assert!((found - learnt).abs() < 0.001, "{seconds}: {found} {learnt}");
        }
    }

    /// 0.125 kg.m2 at 2 rad/s are 0.25 N.m.s beside the margin of 0.6, in the wheel's direction. A check takes 3 mN.m.s away.
    #[test]
    fn the_column_check_allows_the_momentum_of_the_wheel_and_no_more() {
        let judged = |sum_nm_s: f64, rad_per_s: f64| {
            let mut state = PlausibilityState::NEW;
            CHECKS.motion(&mut state, Speed::from_m_per_s(20.0), None);
            (state.column.is_known, state.column.at) = (1, Instant::from_us(0));
            state.column.sum = AngularImpulse::from_nm_s(sum_nm_s);
            let wheel = Radians::from_rad(2e-3 * rad_per_s);
            // As soon as it comes, a step before its check.
            state.set_wheel_angle(wheel);
            CHECKS.column(
                &mut state,
                Instant::from_us(2000),
                Torque::ZERO,
                wheel,
                Torque::ZERO,
            )
        };
        for sign in [1.0, -1.0] {
            assert!(judged(sign * 0.59, 0.0));
            assert!(!judged(sign * 0.61, 0.0));
            assert!(judged(sign * 0.84, sign * 2.0));
            assert!(!judged(sign * 0.86, sign * 2.0));
            assert!(!judged(sign * 0.61, sign * -2.0));
        }
    }

    /// At its margin a movement may be missing, and half of it has to be predicted; a count further it is not honest.
    #[test]
    fn the_lane_check_keeps_its_margins_to_the_count() {
        for (yaw_rate, margin, unreal) in [(Some(TurningRate::ZERO), 0.4, 0.8), (None, 1.0, 2.0)] {
            let [margin, unreal] = [margin, unreal].map(|m| Metres::from_m(m).bits());
            let judged = |predicted: i32, seen: i32| {
                let (mut state, mut motion_history) = (PlausibilityState::NEW, MotionHistory::new());
                CHECKS.motion(&mut state, Speed::from_m_per_s(20.0), yaw_rate);
                state.lane.predicted = Metres::from_bits(predicted);
                state.lane.seen = Metres::from_bits(seen);
                let sample = LaneSample::default();
                CHECKS.lane(&mut state, &mut motion_history, sample.at, sample) == LaneMotion::Consistent
            };
            for sign in [1, -1] {
                assert!(judged(sign * 3 * margin / 2, sign * margin / 2));
                assert!(!judged(sign * (3 * margin / 2 + 1), sign * margin / 2));
                assert!(judged(sign * (margin / 2), sign * -(margin / 2)));
                assert!(!judged(sign * (margin / 2 + 1), sign * -(margin / 2)));
                assert!(judged(0, sign * unreal));
                assert!(!judged(0, sign * (unreal + 1)));
            }
        }
    }

    /// 0.1 rad/s too much on a straight at 20 m/s: what is summed of it explains 14 m/s for each rad that is missing of the lane.
    #[test]
    fn a_lane_that_moves_as_the_wheel_says_is_not_blamed() {
        for (sum_rad, is_alive, moved) in [
            (0.011, 1, LaneMotion::ContradictsYawRate),
            // The same picture again, less than a quarter, and the wrong way.
            (0.011, 0, LaneMotion::Inconsistent),
            (0.009, 1, LaneMotion::Inconsistent),
            (-0.04, 1, LaneMotion::Inconsistent),
        ] {
            for sign in [1.0, -1.0] {
                let (mut state, mut motion_history) = (PlausibilityState::NEW, MotionHistory::new());
                CHECKS.motion(
                    &mut state,
                    Speed::from_m_per_s(20.0),
                    Some(TurningRate::from_rad_per_s(sign * 0.1)),
                );
                state.motion.yaw.sum = Radians::from_rad(sign * sum_rad);
                state.lane.predicted = Metres::from_m(sign * -0.56);
                state.lane.is_alive = is_alive;
                let sample = LaneSample::default();
                assert_eq!(
                    CHECKS.lane(&mut state, &mut motion_history, sample.at, sample),
                    moved,
                    "{sum_rad}, {is_alive}"
                );
                // What a wrong yaw rate predicted is not held against the lane.
                let used = Plausibility::used_margins(&state).0;
                assert_eq!(used == Metres::ZERO, moved == LaneMotion::ContradictsYawRate);
            }
        }
    }

    /// A quarter of the yaw rate's margin is 7.5 mrad: beyond it, and where the pictures move, the column may go by the wheel alone.
    #[test]
    fn a_column_that_turns_as_the_wheel_says_is_not_blamed_for_a_doubtful_yaw_rate() {
        // A wheel that stands straight for half a second, and a yaw rate of 0.15 rad/s: 2.96 N.m of aligning torque at 20 m/s.
        let lacking = |sum_rad: f64, is_alive: u32, yaw_rate: f64| {
            let mut state = PlausibilityState::NEW;
            CHECKS.motion(
                &mut state,
                Speed::from_m_per_s(20.0),
                Some(TurningRate::from_rad_per_s(yaw_rate)),
            );
            (state.motion.yaw.sum, state.lane.is_alive) = (Radians::from_rad(sum_rad), is_alive);
            for ms in 0..500 {
                let now = Instant::from_us(1000 * ms);
                let _ = CHECKS.column(&mut state, now, Torque::ZERO, Radians::ZERO, Torque::ZERO);
            }
            state.column.sum.nm_s().abs()
        };
        for sign in [1.0, -1.0] {
            let rate = 0.15 * sign;
            assert!(lacking(sign * 0.0074, 1, rate) > 0.4 && lacking(sign * 0.0076, 0, rate) > 0.4);
            assert!(lacking(sign * 0.0076, 1, rate) < 1e-6);
        }
    }
}
