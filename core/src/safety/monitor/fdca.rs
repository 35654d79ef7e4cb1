//! The monitor's own FDCA: what lane, vehicle and wheel ask for, in whole milli-newton-metres and micro-radians.
//!
//! `T = (K + LoHA)*d_fb + (LoHS*c*v + LoHA/g)*(r + de_theta'/dt) - LoHA*phi`, from frames that the monitor decodes itself. The rate
//! of the yaw error has the law's filter, because this law stands on it: a rate over 50 ms would be wrong by as much as a torque.
//!
//! A picture moves the rate in the step in which it comes. The torque is computed a hundred times a second, with a vehicle frame, or a
//! step later where a picture came with that; without vehicle frames, with the third picture. What the law does between is less
//! than the time for which it may be astray.
//!
//! What an honest law may do otherwise makes a band of it, with zero in it:
//!
//! - r may be the measured yaw rate or, where that is not believed, what wheel angle and speed say, with what the two differed by in
//!   the long run ([`WHEEL_BIAS_URPS`]). A measured rate that jumps is left out until the frame says that it is not believed.
//! - Behind a silence of the camera the law goes on along the bend that it saw, with its own rate of turn, or takes the new rate. While
//!   pictures are missing or left aside, and [`UNSETTLED_US`] longer, the torque may also stand as it was before, and the rate of the
//!   yaw error may be wrong by [`UNSETTLED_URPS`].
//! - A sample older than [`super::PROMPT_LANE_US`] may go on at its rates, or the torque stands as it was before.
//! - A picture that was late when it came goes with the r of then: [`YAW_ACCELERATION`] times its age.
//!
//! All of it is kept twice, and compared where it is read.

use super::{
    Evidence, LONGEST_LATE_US, LaneState, MonitorState, PROMPT_LANE_US, StepState, UNSEEN_US, field, says_aside,
};
use crate::safety::redundant::{Redundant, words};

words! {
    /// The choices. Torques per angle are in 1.048576 mN.m/rad, so that their product with urad is 2^20 mN.m.
    pub struct Fdca {
        /// SoHF*k_y, 2^-8 urad/mm; SoHF*k_psi, 2^-8.
        pub(crate) k_y: i32,
        pub(crate) k_psi: i32,
        /// LoHS*c and c, per m/s of speed; LoHA.
        pub(crate) path: i32,
        pub(crate) aligning: i32,
        pub(crate) loha: i32,
        /// G, 2^-18 1/m; A, 2^-26 s2/m2.
        pub(crate) curvature: i32,
        pub(crate) stability: i32,
        /// Time constant of the filter, 0.1 ms.
        pub(crate) filter: i32,
    }
}

words! {
    /// What is remembered of vehicle, wheel and yaw error.
    struct Car {
        wheel_urad: i32,
        yaw_urps: i32,
        /// 1 where the last frame had a yaw rate.
        has_yaw: i32,
        /// g, 2^-16 1/s.
        turning: i32,
        /// K + LoHA, and what a rate of turn asks for.
        position: i32,
        rate: i32,
        /// de_theta'/dt, urad/s: with the step over the last silence, and without.
        theta_urps: i32,
        kept_urps: i32,
        /// r at the last picture.
        then_urps: i32,
        /// How far apart the last two pictures were.
        apart_us: i32,
        /// For how long pictures may not be what the law goes by.
        unsettled_us: i32,
        /// What was asked for when they last were, and prompt.
        held_mnm: i32,
        /// For how long pictures came without a vehicle frame.
        unjudged_us: i32,
    }
}

words! {
    /// What is kept twice.
    pub(crate) struct Kept {
        fdca: Fdca,
        car: Car,
    }
}

/// What the monitor needs beside [`super::MonitorState`] where the law is FDCA.
#[derive(Debug, Clone)]
pub struct Watch {
    pub(crate) kept: Redundant<Kept>,
    /// A vehicle frame that came with a picture.
    vehicle: Option<[u8; 8]>,
    /// What may be was computed in this step.
    pub(crate) has_judged: bool,
}

/// Two speeds further apart than this are not both right: 2 m/s.
const SPREAD: i32 = 512;
/// No vehicle's yaw rate changes more between two frames.
const YAW_STEP_URPS: i32 = 150_000;
/// By how much wheel angle and speed may be wrong about the rate of turn for long: a bank of 8 %, 1.5 deg of the wheel.
const WHEEL_BIAS_URPS: i32 = 25_000;
/// How fast the rate of turn changes on a road, urad/s in a millisecond.
const YAW_ACCELERATION: i32 = 1000;
/// A picture is late from here on, as for the law.
const LATE_US: i32 = 10_000;
/// Where pictures were left aside or did not come, the law's rate comes from the lane as it goes on, and for so long a camera's noise
/// of 1 mrad makes the monitor's differ by so much.
const UNSETTLED_US: i32 = 200_000;
const UNSETTLED_URPS: i32 = 100_000;
/// Two pictures further apart than this share no rate.
const GAP_US: i32 = 100_000;
/// Without a vehicle frame for so long, pictures have to do.
const UNJUDGED_US: i32 = 20_000;
/// The place of the fault YawRate in a guidance frame.
const YAW_RATE_FAULT: u32 = 57;

impl Car {
    const NEW: Self = Self {
        wheel_urad: 0,
        yaw_urps: 0,
        has_yaw: 0,
        turning: 0,
        position: 0,
        rate: 0,
        theta_urps: 0,
        kept_urps: 0,
        then_urps: 0,
        apart_us: 0,
        unsettled_us: 0,
        held_mnm: 0,
        unjudged_us: 0,
    };
}

impl Watch {
    /// Nothing seen.
    #[must_use]
    pub fn new(fdca: Fdca) -> Self {
        Self {
            kept: Redundant::new(Kept {
                fdca,
                car: Car::NEW,
            }),
            vehicle: None,
            has_judged: false,
        }
    }

    /// Takes what came; `false` where the copies of what it needs do not agree.
    #[inline(never)]
    pub(super) fn observe(
        &mut self,
        state: &mut MonitorState,
        evidence: &Evidence<'_>,
        elapsed_us: i32,
    ) -> bool {
        self.has_judged = false;
        let (before, age_us) = (state.lane_state.lane.e_theta_urad, state.step.age_us);
        let is_new = state.observe(evidence, elapsed_us);
        if let Some(bytes) = evidence.column {
            // 0.01 deg are 174.53 urad.
            let wheel_urad = field(bytes, 30, 18).saturating_mul(11_170) / 64;
            self.kept.put(|kept| &mut kept.car.wheel_urad, wheel_urad);
        }
        if evidence.vehicle.is_some() {
            self.vehicle = *evidence.vehicle;
        }
        if !is_new && self.vehicle.is_none() {
            return true;
        }
        let is_distrusted = field(evidence.guidance, YAW_RATE_FAULT, 1) != 0;
        let Self {
            kept,
            vehicle,
            has_judged,
        } = self;
        kept.change(|Kept { fdca, car }| {
                if is_new {
                    let apart_us = age_us.saturating_add(elapsed_us).saturating_sub(state.step.age_us);
                    let moved = state.lane_state.lane.e_theta_urad.saturating_sub(before);
                    fdca.see(car, moved, apart_us);
                    car.unjudged_us = car.unjudged_us.saturating_add(apart_us);
                    if car.unjudged_us <= UNJUDGED_US {
                        return;
                    }
                }
                if let Some(bytes) = vehicle.take() {
                    fdca.drive(car, &bytes, is_distrusted);
                }
                car.unjudged_us = 0;
                *has_judged = true;
                car.doubt(&state.step, &state.lane_state, says_aside(evidence.guidance));
                let (least, most) = fdca.range(car, state, is_distrusted);
                state.lane_state.position_mnm = least;
                state.lane_state.rate_mnm = most.saturating_sub(least);
            })
            .is_some()
    }
}

impl Car {
    /// Pictures are not what the law goes by where it says so, and where there is none for longer than usual.
    fn doubt(&mut self, step: &StepState, picture: &LaneState, is_aside: bool) {
        let unseen_us = step.age_us.saturating_sub(picture.came_us);
        if is_aside || self.is_silence(unseen_us) {
            self.unsettled_us = UNSETTLED_US;
        }
    }

    /// A slow camera is no silence.
    const fn is_silence(&self, unseen_us: i32) -> bool {
        unseen_us > UNSEEN_US && unseen_us / 3 > self.apart_us / 2
    }
}

impl Fdca {
    /// Takes a vehicle frame: the gains at its speed, and its yaw rate.
    #[expect(clippy::arithmetic_side_effects, reason = "every divisor is at least one")]
    fn drive(&self, car: &mut Car, vehicle: &[u8; 8], is_distrusted: bool) {
        let (speed, other) = (field(vehicle, 12, 16), field(vehicle, 28, 16));
        if speed.saturating_sub(other).saturating_abs() < SPREAD {
            // 1 + A*v^2 in 2^-16, and g.
            let slip = times(self.stability, speed.saturating_mul(speed), 26);
            let divisor = slip.saturating_add(1 << 16);
            car.turning = self
                .curvature
                .saturating_mul(speed)
                .saturating_div((divisor >> 6).max(1));
            let sideways = times(self.aligning, speed, 8);
            car.position = times(sideways, car.turning, 16).saturating_add(self.loha);
            let held = self
                .loha
                .saturating_mul(1 << 14)
                .saturating_div((car.turning >> 2).max(1));
            car.rate = times(self.path, speed, 8).saturating_add(held);
        }
        // 2^-12 rad/s are 15625/64 urad/s.
        let yaw_urps = field(vehicle, 44, 14).saturating_mul(15_625) / 64;
        let jumps = yaw_urps.saturating_sub(car.yaw_urps).saturating_abs() > YAW_STEP_URPS;
        if !jumps || is_distrusted || car.has_yaw == 0 {
            car.yaw_urps = yaw_urps;
        }
        car.has_yaw = i32::from(field(vehicle, 58, 1) != 0);
    }

    /// Takes a picture, so long after the last, in which the yaw error has moved.
    #[expect(clippy::arithmetic_side_effects, reason = "every divisor is at least one")]
    fn see(&self, car: &mut Car, moved: i32, apart_us: i32) {
        let apart = (apart_us / 100).max(0);
        let span = self.filter.saturating_add(apart).max(1);
        let filtered = |rate: i32| {
            let change = moved
                .saturating_mul(10_000)
                .saturating_sub(rate.saturating_mul(apart))
                .saturating_div(span);
            rate.saturating_add(change)
        };
        let is_silence = car.is_silence(apart_us);
        car.apart_us = apart_us;
        car.unsettled_us = car.unsettled_us.saturating_sub(apart_us).max(0);
        let now_urps = if car.has_yaw == 0 {
            times(car.turning, car.wheel_urad, 16)
        } else {
            car.yaw_urps
        };
        car.kept_urps = if is_silence {
            car.unsettled_us = UNSETTLED_US;
            let turned = now_urps.saturating_sub(car.then_urps);
            car.kept_urps.saturating_sub(turned)
        } else {
            filtered(car.kept_urps)
        };
        car.then_urps = now_urps;
        car.theta_urps = if apart_us > GAP_US {
            0
        } else {
            filtered(car.theta_urps)
        };
    }

    /// From where to where the torque may be, mN.m.
    fn range(&self, car: &mut Car, state: &MonitorState, is_distrusted: bool) -> (i32, i32) {
        let picture = &state.lane_state;
        let (lane, came_us) = (&picture.lane, picture.came_us);
        let late_us = state.step.age_us.saturating_sub(PROMPT_LANE_US).min(LONGEST_LATE_US);
        let is_usual = late_us <= 0 && car.unsettled_us <= 0;
        let angle = |e_y_mm: i32, e_theta_urad: i32| {
            times(self.k_y, e_y_mm, 8).saturating_add(times(self.k_psi, e_theta_urad, 8))
        };
        let held = times(self.loha, car.wheel_urad, 20);
        let position = |urad: i32| times(car.position, urad, 20).saturating_sub(held);
        let now = position(angle(lane.e_y_mm, lane.e_theta_urad));
        let slowest = car.theta_urps.min(car.kept_urps);
        let fastest = car.theta_urps.max(car.kept_urps);
        let wheel_urps = times(car.turning, car.wheel_urad, 16);
        let (mut right, mut left) = (wheel_urps, wheel_urps);
        if car.has_yaw == 0 || is_distrusted {
            right = right.saturating_sub(WHEEL_BIAS_URPS);
            left = left.saturating_add(WHEEL_BIAS_URPS);
        }
        if car.has_yaw != 0 {
            (right, left) = (right.min(car.yaw_urps), left.max(car.yaw_urps));
        }
        let turns = |urps: i32| times(car.rate, urps, 20);
        let late = turns(
            (came_us.saturating_sub(LATE_US) / 1000)
                .max(0)
                .saturating_mul(YAW_ACCELERATION),
        );
        let unsettled = if car.unsettled_us > 0 {
            turns(UNSETTLED_URPS)
        } else {
            0
        };
        let beside = late.saturating_add(unsettled);
        let low = turns(slowest.saturating_add(right)).saturating_sub(beside);
        let high = turns(fastest.saturating_add(left)).saturating_add(beside);
        let (mut least, mut most) = (now.saturating_add(low), now.saturating_add(high));
        if is_usual {
            car.held_mnm = least.saturating_add(most) / 2;
        } else {
            let (e_y_mmps, _) = state.rates();
            let late_ms = late_us.max(0) / 1000;
            let moved = |per_s: i32| (per_s / 1000).saturating_mul(late_ms);
            let went_on = position(angle(
                lane.e_y_mm.saturating_add(moved(e_y_mmps)),
                lane.e_theta_urad.saturating_add(moved(car.theta_urps)),
            ));
            least = least.min(went_on.saturating_add(low)).min(car.held_mnm);
            most = most.max(went_on.saturating_add(high)).max(car.held_mnm);
        }
        (least.min(0), most.max(0))
    }
}

/// `a*b/2^down`, rounded down, saturating.
#[expect(clippy::as_conversions, reason = "widened, and narrowed within its bounds")]
const fn times(a: i32, b: i32, down: u32) -> i32 {
    let wide = (a as i64).wrapping_mul(b as i64).wrapping_shr(down);
    if wide > i32::MAX as i64 {
        i32::MAX
    } else if wide < i32::MIN as i64 {
        i32::MIN
    } else {
        wide as i32
    }
}

const _: () = assert!(LATE_US < PROMPT_LANE_US);
