//! The monitor's own FDCA: what lane, vehicle and wheel ask for, in whole milli-newton-metres and micro-radians.
//!
//! `T = (K + LoHA)*d_fb + (LoHS*c*v + LoHA/g)*(r + de_theta'/dt) - LoHA*phi`, from frames that the monitor decodes itself. The rate
//! of the yaw error has the law's filter, because this law stands on it: a rate over 50 ms would be wrong by as much as a torque.
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

use super::{Lane, PROMPT_LANE_US, UNSEEN_US, field};
use crate::safety::redundant::words;

words! {
    /// The choices. Torques per angle are in 1.048576 mN.m/rad, so that their product with urad is 2^20 mN.m.
    pub(crate) struct Fdca {
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
    pub(crate) struct Car {
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
        /// From where to where the torque may be, as long as nothing came.
        least_mnm: i32,
        most_mnm: i32,
        /// 1 where something came since.
        has_news: i32,
    }
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

impl Car {
    pub(crate) const NEW: Self = Self {
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
        least_mnm: 0,
        most_mnm: 0,
        has_news: 1,
    };

    /// Time passes; `is_aside` says that the law leaves pictures aside.
    pub(super) fn pass(&mut self, elapsed_us: i32, is_aside: bool) {
        self.unsettled_us = if is_aside {
            UNSETTLED_US
        } else {
            self.unsettled_us.saturating_sub(elapsed_us).max(0)
        };
    }

    /// Something came that moves the torque.
    pub(super) fn hear(&mut self) {
        self.has_news = 1;
    }

    pub(super) fn turn_wheel(&mut self, column: &[u8; 8]) {
        // 0.01 deg are 174.53 urad.
        self.wheel_urad = field(column, 30, 18).saturating_mul(11_170) / 64;
    }
}

impl Fdca {
    /// None, for another law.
    pub(crate) const NONE: Self = Self {
        k_y: 0,
        k_psi: 0,
        path: 0,
        aligning: 0,
        loha: 0,
        curvature: 0,
        stability: 0,
        filter: 0,
    };

    /// Takes a vehicle frame: the gains at its speed, and its yaw rate.
    #[expect(clippy::arithmetic_side_effects, reason = "every divisor is at least one")]
    #[inline(never)]
    pub(super) fn drive(&self, car: &mut Car, vehicle: &[u8; 8], is_distrusted: bool) {
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

    /// Takes a picture, so long after the last.
    #[expect(clippy::arithmetic_side_effects, reason = "every divisor is at least one")]
    pub(super) fn see(&self, car: &mut Car, from: &Lane, to: &Lane, apart_us: i32) {
        let moved = to.e_theta_urad.saturating_sub(from.e_theta_urad);
        let apart = (apart_us / 100).max(0);
        let span = self.filter.saturating_add(apart).max(1);
        let filtered = |rate: i32| {
            let change = moved
                .saturating_mul(10_000)
                .saturating_sub(rate.saturating_mul(apart))
                .saturating_div(span);
            rate.saturating_add(change)
        };
        // A slow camera is no silence.
        let is_silence = apart_us > UNSEEN_US && apart_us / 3 > car.apart_us / 2;
        car.apart_us = apart_us;
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

    /// From where to where the torque may be, mN.m: `lane` moves at `e_y_mmps`, is `late_us` older than prompt, and was `came_us`
    /// old when it came.
    pub(super) fn range(
        &self,
        car: &mut Car,
        lane: &Lane,
        e_y_mmps: i32,
        [late_us, came_us]: [i32; 2],
        is_distrusted: bool,
    ) -> (i32, i32) {
        let is_usual = late_us <= 0 && car.unsettled_us <= 0;
        if is_usual && car.has_news == 0 {
            return (car.least_mnm, car.most_mnm);
        }
        // What is unusual changes with time.
        car.has_news = i32::from(!is_usual);
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
            let late_ms = late_us.max(0) / 1000;
            let moved = |per_s: i32| (per_s / 1000).saturating_mul(late_ms);
            let went_on = position(angle(
                lane.e_y_mm.saturating_add(moved(e_y_mmps)),
                lane.e_theta_urad.saturating_add(moved(car.theta_urps)),
            ));
            least = least.min(went_on.saturating_add(low)).min(car.held_mnm);
            most = most.max(went_on.saturating_add(high)).max(car.held_mnm);
        }
        (car.least_mnm, car.most_mnm) = (least.min(0), most.max(0));
        (car.least_mnm, car.most_mnm)
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
