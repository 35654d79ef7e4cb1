//! The monitor's own FDCA, in whole milli-newton-metres and micro-radians per second, from frames that it decodes itself:
//! `T = c*v*(g*(k_y*e_y' + k_psi*e_theta') + LoHS*(r + de_theta'/dt))`.
//!
//! It is computed with each picture. The rate of the yaw error has the law's filter, because this law stands on it: a rate over
//! 50 ms would be wrong by as much as a torque. What an honest law may do otherwise makes a band of it, with zero in it:
//!
//! - r may be the measured yaw rate or what wheel angle and speed say. Where the frame says that the measured one is not believed, or
//!   there is none, r is the latter, with what the two differed by in the long run ([`WHEEL_BIAS_URPS`]).
//! - Until the next picture the errors go on at their rates, and r changes, as it has since this picture was taken
//!   ([`YAW_ACCELERATION`]).
//! - After a silence of the camera, and where pictures are left aside, the law's rate comes from the lane as it was expected to go on:
//!   for [`UNSETTLED_US`] it may be wrong by [`UNSETTLED_URPS`].
//!
//! It is kept twice, and compared where it is read.

use super::{Evidence, MonitorState, UNSEEN_US, field, says_aside};
use crate::safety::redundant::words;

words! {
    /// The choices and the vehicle, and what is remembered of the pictures.
    pub struct Fdca {
        /// SoHF*k_y, 2^-8 urad/mm; SoHF*k_psi, 2^-8; LoHS, 2^-16.
        pub(crate) k_y: i32,
        pub(crate) k_psi: i32,
        pub(crate) lohs: i32,
        /// c, in 2^20 urad per mN.m and m/s: 1.048576 mN.m.s2/m.
        pub(crate) aligning: i32,
        /// G, 2^-18 1/m; A, 2^-26 s2/m2.
        pub(crate) curvature: i32,
        pub(crate) stability: i32,
        /// Time constant of the filter, 0.1 ms.
        pub(crate) filter: i32,
        /// Speed, 2^-8 m/s.
        pub(crate) speed: i32,
        /// e_theta' of the last picture, and its filtered rate, urad/s.
        pub(crate) e_theta_urad: i32,
        pub(crate) rate_urps: i32,
        /// How far apart the last two pictures were.
        pub(crate) apart_us: i32,
        /// For how long pictures may not be what the law goes by.
        pub(crate) unsettled_us: i32,
    }
}

/// Two speeds further apart than this are not both right: 2 m/s.
const SPREAD: i32 = 512;
/// By how much wheel angle and speed may be wrong about the rate of turn for long: a bank of 8 %, 1.5 deg of the wheel.
const WHEEL_BIAS_URPS: i32 = 25_000;
/// How fast the rate of turn changes on a road, urad/s in a millisecond.
const YAW_ACCELERATION: i32 = 1000;
/// For so long it may have changed unseen, which the band around all has room for.
const FRESH_MS: i32 = 20;
/// Where pictures were left aside or did not come, the law's rate comes from the lane as it goes on, and for so long a camera's noise
/// of 1 mrad makes the monitor's differ by so much.
const UNSETTLED_US: i32 = 200_000;
const UNSETTLED_URPS: i32 = 100_000;
/// Two pictures further apart than this share no rate.
const GAP_US: i32 = 100_000;
/// The place of the fault YawRate in a guidance frame.
const YAW_RATE_FAULT: u32 = 57;

impl Fdca {
    /// Takes a picture that came so long after the last one. Returns between what torques, mN.m, the law's is.
    pub(super) fn see(&mut self, state: &MonitorState, evidence: &Evidence<'_>, apart_us: i32) -> (i32, i32) {
        let is_silence = apart_us > UNSEEN_US && apart_us / 3 > self.apart_us / 2;
        self.unsettled_us = if is_silence || says_aside(evidence.guidance) {
            UNSETTLED_US
        } else {
            self.unsettled_us.saturating_sub(apart_us).max(0)
        };
        self.filter(state.lane_state.lane.e_theta_urad, apart_us);
        self.apart_us = apart_us;
        let turning_gain = self.turning_gain(&evidence.frames.vehicle);
        let turning = range_of_turning(turning_gain, evidence);
        self.range(state, turning_gain, turning)
    }

    /// Between what torques the law's is.
    fn range(&self, state: &MonitorState, turning_gain: i32, (right, left): (i32, i32)) -> (i32, i32) {
        let picture = &state.lane_state;
        let asked = |e_y_mm: i32, e_theta_urad: i32| {
            let angle = times(self.k_y, e_y_mm, 8).saturating_add(times(self.k_psi, e_theta_urad, 8));
            times(turning_gain, angle, 16)
        };
        let unseen_ms = picture.came_us.saturating_add(self.apart_us) / 1000;
        let (e_y_mmps, e_theta_urps) = state.rates();
        let now = asked(picture.lane.e_y_mm, picture.lane.e_theta_urad);
        let later = now.saturating_add((asked(e_y_mmps, e_theta_urps) / 1000).saturating_mul(unseen_ms));
        let mut doubt = unseen_ms
            .saturating_sub(FRESH_MS)
            .max(0)
            .saturating_mul(YAW_ACCELERATION);
        if self.unsettled_us > 0 {
            doubt = doubt.saturating_add(UNSETTLED_URPS);
        }
        let path = |turning: i32| times(self.lohs, turning.saturating_add(self.rate_urps), 16);
        let sideways = times(self.aligning, self.speed, 8);
        let torque = |urps: i32| times(sideways, urps, 20);
        (
            torque(now.min(later).saturating_add(path(right.saturating_sub(doubt)))),
            torque(now.max(later).saturating_add(path(left.saturating_add(doubt)))),
        )
    }

    /// The rate of the yaw error, by the filter of the law.
    #[expect(clippy::arithmetic_side_effects, reason = "the divisor is at least one")]
    fn filter(&mut self, e_theta_urad: i32, apart_us: i32) {
        let moved = e_theta_urad.saturating_sub(self.e_theta_urad);
        let apart = apart_us.max(0) / 100;
        let change = moved
            .saturating_mul(10_000)
            .saturating_sub(self.rate_urps.saturating_mul(apart))
            .saturating_div(self.filter.saturating_add(apart).max(1));
        self.rate_urps = if apart_us > GAP_US {
            0
        } else {
            self.rate_urps.saturating_add(change)
        };
        self.e_theta_urad = e_theta_urad;
    }

    /// g, 2^-16 1/s, at the speed of a vehicle frame, where both of its sources agree.
    #[expect(clippy::arithmetic_side_effects, reason = "the divisor is at least one")]
    fn turning_gain(&mut self, vehicle: &[u8; 8]) -> i32 {
        let (speed, other) = (field(vehicle, 12, 16), field(vehicle, 28, 16));
        if speed.saturating_sub(other).saturating_abs() < SPREAD {
            self.speed = speed;
        }
        // 1 + A*v^2 in 2^-16.
        let slip = times(self.stability, self.speed.saturating_mul(self.speed), 26);
        let divisor = slip.saturating_add(1 << 16);
        self.curvature
            .saturating_mul(self.speed)
            .saturating_div((divisor >> 6).max(1))
    }
}

/// From where to where the rate of turn may be, urad/s.
fn range_of_turning(turning_gain: i32, evidence: &Evidence<'_>) -> (i32, i32) {
    let (vehicle, column) = (&evidence.frames.vehicle, &evidence.frames.column);
    // 0.01 deg are 174.53 urad, 2^-12 rad/s are 15625/64 urad/s.
    let wheel_urad = field(column, 30, 18).saturating_mul(11_170) / 64;
    let by_wheel = times(turning_gain, wheel_urad, 16);
    let is_measured = field(vehicle, 58, 1) != 0 && field(evidence.guidance, YAW_RATE_FAULT, 1) == 0;
    if is_measured {
        let measured = field(vehicle, 44, 14).saturating_mul(15_625) / 64;
        (by_wheel.min(measured), by_wheel.max(measured))
    } else {
        (
            by_wheel.saturating_sub(WHEEL_BIAS_URPS),
            by_wheel.saturating_add(WHEEL_BIAS_URPS),
        )
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
