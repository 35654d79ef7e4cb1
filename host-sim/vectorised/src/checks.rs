//! The checks of the shipping ECU that could end guidance, in float64 and a little stricter.
//!
//! `haptic-core`'s plausibility of lane and column are sums that leak: a step's error is forgotten within a second (16 s
//! for what is learnt slowly). Here the same sums are taken without the roundings of fixed point. These are some counts of
//! 2^-24 a step, and no term of a sum amplifies them: over all that a sum remembers they come to less than
//! 0.005 N.m.s, and less than 0.001 m. The margins here are smaller by several times as much, so that whoever stays within
//! them stays within core's. The other way a run is driven anew without need. A picture is checked with the speed heard last,
//! which in one of six core knows a message later: at 8 m/s2 that is 0.08 m/s, and less than 0.002 m in the sum.

use haptic_core::controller::params::Params;
use haptic_core::safety::frozen_torque;
use haptic_core::safety::plausibility::{self, ALIGNING_ERROR, PUSHED, UNREAL};
use haptic_core::safety::yaw::{self, BIAS_SHIFT};

use super::counts::{ONE, flag, ms, speed_heard};
use super::lanes::lanes;
use super::rejected::Reason;
use super::{ALIVE, either};
use haptic_sim::scenario::Scenario;

/// So much narrower than core's are the margins here, N.m.s and m.
const NARROWER: f64 = 0.02;
const COLUMN_MARGIN: f64 = plausibility::COLUMN_MARGIN.nm_s() - NARROWER;
const LANE_MARGIN: f64 = plausibility::LANE_MARGIN.m() - NARROWER;
/// Core asks for half of the margin.
const LANE_MOVED: f64 = 0.5 * plausibility::LANE_MARGIN.m() - NARROWER;
const LANE_UNREAL: f64 = UNREAL.m() - NARROWER;
const COLUMN_BIAS: f64 = plausibility::COLUMN_BIAS.nm();
const LANE_BIAS: f64 = plausibility::LANE_BIAS.m_per_s();
const LEARNS: f64 = 1.0 / (1 << BIAS_SHIFT) as f64;
const FRICTION: f64 = plausibility::FRICTION.nm();
const TOLERANCE: f64 = ALIGNING_ERROR.si();
const ASSIST: f64 = plausibility::ASSIST as f64;
const PUSHED_NM: f64 = PUSHED.nm();
const MOST_ALIGNING_NM: f64 = 16.0;
/// Far inside what the frames carry, rad and rad/s.
const LARGEST_WHEEL: f64 = 12.0;
const LARGEST_YAW_RATE: f64 = 1.9;
/// A yaw rate's step and the acceleration to the side with it, m/s2, a little less than core's.
const YAW_RATE_STEP: f64 = yaw::STEP.rad_per_s() - 0.001;
const LARGEST_SIDEWAYS: f64 = yaw::MOST_SIDEWAYS as f64 - 0.1;
/// What yaw rate and wheel angle may differ by, in a second and in the long run; and with the first frames, which come apart.
const YAW_MARGIN: f64 = 0.9 * yaw::MARGIN.rad();
const YAW_BIAS: f64 = yaw::BIAS.rad_per_s();
/// Up to this core compares them, m/s2, and from this on it doubts the yaw rate.
const MOST_BY_WHEEL: f64 = yaw::ORDINARY_SIDEWAYS as f64;
const DOUBTFUL: f64 = 0.25 * yaw::MARGIN.rad();
/// Counts of a yaw rate on the bus, per rad/s.
const YAW_RATE_COUNTS: f64 = 4096.0;
/// A driver torque is still for so long, ms, a little shorter than core's; so far the wheel turns meanwhile, less a step of its
/// sensor.
const STILL_MS: f64 = ms(frozen_torque::LASTS) as f64 - 10.0;
const STILL_WITHIN_MS: f64 = ms(frozen_torque::WITHIN) as f64;
const TURNED: f64 = frozen_torque::MOST_TURN.rad() - 0.002;
const TURNED_WHEN_ASKED: f64 = frozen_torque::MOST_TURN_WHEN_TESTED.rad() - 0.002;
/// Times in s: between frames of the column, and of the vehicle.
const COLUMN_S: f64 = 0.002;
const COLUMN_MS: f64 = 2.0;
const VEHICLE_S: f64 = 0.010;
/// Directions of the line are kept, one every 25 ms.
const LINES: usize = 32;
const LINE_US: i32 = 25_000;

lanes! {
    /// The sums of several runs.
    pub(super) struct Checks {
        speed: f64 = 0.0,
        near_m: f64 = 0.0,
        aligning_gain: f64 = 0.0,
        /// The aligning torque of a vehicle that turns as its wheel says, N.m/rad.
        per_wheel: f64 = 0.0,
        damping: f64 = 0.0,
        /// How fast the vehicle turns by its wheel, 1/s; what the yaw rate is more in the long run, and summed.
        turns: f64 = 0.0,
        yaw_bias: f64 = 0.0,
        yaw_sum: f64 = 0.0,
        /// 0 until the first frames came, then 1.
        began: f64 = 0.0,
        yaw_rate: f64 = 0.0,
        aligning: f64 = 0.0,
        heading: f64 = 0.0,
        wheel: f64 = 0.0,
        column_bias: f64 = 0.0,
        column_sum: f64 = 0.0,
        /// The driver torque, for how long it has been the same, ms, between which wheel angles, and what these may differ by.
        torque: f64 = 0.0,
        still_ms: f64 = 0.0,
        least: f64 = 0.0,
        most: f64 = 0.0,
        may_turn: f64 = 0.0,
        /// The last picture, and whether it differed from the one before.
        e_y: f64 = 0.0,
        e_theta: f64 = 0.0,
        is_alive: f64 = 0.0,
        /// Heading and yaw rate at the last picture.
        heading_then: f64 = 0.0,
        yaw_rate_then: f64 = 0.0,
        lane_bias: f64 = 0.0,
        predicted: f64 = 0.0,
        seen: f64 = 0.0,
        between_us: i32 = 0,
    } beside {
        lines: [[f64; N]; LINES] = [[0.0; N]; LINES],
    }
}

/// What of an interval is nearest to zero.
#[inline(always)]
fn nearest_to_zero(least: f64, most: f64) -> f64 {
    least.max(0.0) + most.min(0.0)
}

impl<const N: usize> Checks<N> {
    pub(super) fn begin(&mut self, lane: usize, scenario: &Scenario) {
        self.clear(lane);
        let params = scenario.controller_params();
        self.hear_speed(lane, &params, speed_heard(scenario));
        let vehicle = params.vehicle;
        self.aligning_gain[lane] = vehicle.aligning_gain_nm_s2_per_m;
        self.damping[lane] = vehicle.column_damping_nm_s;
        self.may_turn[lane] = if scenario.guidance().probe {
            TURNED_WHEN_ASKED
        } else {
            TURNED
        };
        let between_s = (vehicle.far_time_s - vehicle.near_time_s).max(0.0);
        self.between_us[lane] = (between_s * 1e6 + 0.5) as i32;
    }

    /// A speed that is another than before is heard.
    pub(super) fn hear_speed(&mut self, lane: usize, p: &Params, speed: i32) {
        let (vehicle, speed) = (&p.vehicle, f64::from(speed) * (1.0 / ONE));
        self.speed[lane] = speed;
        self.near_m[lane] = vehicle.near_time_s * speed;
        let turning =
            vehicle.curvature_gain_per_m * speed / (1.0 + vehicle.stability_factor_s2_per_m2 * speed * speed);
        self.turns[lane] = turning;
        self.per_wheel[lane] = speed * turning * vehicle.aligning_gain_nm_s2_per_m;
    }

    /// A frame of the vehicle.
    #[inline(always)]
    pub(super) fn vehicle(&mut self, yaw_rate: &[f64; N], matters: &[i32; N], suspect: &mut [i32; N]) {
        for l in 0..N {
            let sideways = yaw_rate[l].abs() * self.speed[l];
            let is_possible = (yaw_rate[l].abs() <= LARGEST_YAW_RATE)
                & (sideways <= LARGEST_SIDEWAYS)
                & ((yaw_rate[l] - self.yaw_rate[l]).abs() <= YAW_RATE_STEP);
            suspect[l] |= !flag(is_possible) & matters[l] & Reason::SensorRange.bit();
            self.heading[l] += self.yaw_rate[l] * VEHICLE_S;
            self.yaw_rate[l] = (yaw_rate[l] * YAW_RATE_COUNTS).round() * (1.0 / YAW_RATE_COUNTS);
            self.aligning[l] = self.speed[l] * self.yaw_rate[l] * self.aligning_gain[l];
            let by_wheel = self.turns[l] * self.wheel[l];
            let differs = self.yaw_rate[l] - by_wheel - self.yaw_bias[l];
            let is_ordinary = by_wheel.abs() * self.speed[l] <= MOST_BY_WHEEL;
            let dt = if is_ordinary { VEHICLE_S } else { 0.0 };
            let sum = self.yaw_sum[l] * (1.0 - dt) + differs * dt;
            self.yaw_sum[l] = sum;
            let bias = self.yaw_bias[l] + differs * (dt * LEARNS);
            self.yaw_bias[l] = bias.min(YAW_BIAS).max(-YAW_BIAS);
            let is_believed = sum.abs() <= YAW_MARGIN + 0.22 * self.yaw_rate[l].abs();
            suspect[l] |= !flag(is_believed) & matters[l] & Reason::YawRate.bit();
        }
    }

    /// The speed heard last, m/s.
    pub(super) fn speed(&self, lane: usize) -> f64 {
        self.speed[lane]
    }

    /// A frame of the column: driver torque and the guidance torque applied as the ECU has them, N.m, and the wheel angle
    /// before its sensor rounds it, rad.
    #[inline(always)]
    pub(super) fn column(
        &mut self,
        driver: &[f64; N],
        applied: &[f64; N],
        wheel: &[f64; N],
        matters: &[i32; N],
        suspect: &mut [i32; N],
    ) {
        const RESOLUTION: f64 = haptic_sim::models::sensors::ANGLE_RESOLUTION_DEG;
        for l in 0..N {
            let dt = COLUMN_S * self.began[l];
            let begins = (driver[l] != self.torque[l]) | (self.still_ms[l] >= STILL_WITHIN_MS);
            self.torque[l] = driver[l];
            let begins = if begins { ALIVE } else { 0 };
            self.still_ms[l] = either(begins, 0.0, self.still_ms[l] + COLUMN_MS);
            let sensed = (wheel[l].to_degrees() / RESOLUTION).round() * RESOLUTION.to_radians();
            let damped = (sensed - self.wheel[l]) * self.damping[l];
            self.wheel[l] = sensed;
            self.least[l] = either(begins, sensed, self.least[l].min(sensed));
            self.most[l] = either(begins, sensed, self.most[l].max(sensed));
            let turned = self.most[l] - self.least[l];
            let is_still = (self.still_ms[l] >= STILL_MS) & (turned >= self.may_turn[l]);
            suspect[l] |= flag(is_still) & matters[l] & Reason::ColumnCheck.bit();
            let aligning = self.aligning[l];
            let is_doubtful = (self.yaw_sum[l].abs() > DOUBTFUL) & (self.is_alive[l] != 0.0);
            let pushed = if is_doubtful { MOST_ALIGNING_NM } else { PUSHED_NM };
            let by_wheel = (self.per_wheel[l] * sensed)
                .max(aligning - pushed)
                .min(aligning + pushed);
            let assisted = ASSIST * driver[l];
            let least = (applied[l] + driver[l].min(assisted) - aligning.max(by_wheel)) * dt - damped;
            let most = (applied[l] + driver[l].max(assisted) - aligning.min(by_wheel)) * dt - damped;
            let bias = self.column_bias[l];
            let lacking = nearest_to_zero(least, most) - bias * dt;
            self.column_bias[l] = (bias + lacking * LEARNS).min(COLUMN_BIAS).max(-COLUMN_BIAS);
            let tolerance = (aligning.abs() * TOLERANCE + FRICTION) * dt;
            let sum = self.column_sum[l];
            let kept = sum - sum * dt + lacking;
            let sum = nearest_to_zero(kept - tolerance, kept + tolerance);
            self.column_sum[l] = sum;
            suspect[l] |= !flag(sum.abs() <= COLUMN_MARGIN) & matters[l] & Reason::ColumnCheck.bit();
            suspect[l] |= !flag(wheel[l].abs() <= LARGEST_WHEEL) & matters[l] & Reason::SensorRange.bit();
        }
    }

    /// A picture that came `dt_ms` after the one before and `since_ms` after the last frame of the vehicle; `own` is the
    /// number of the step in each run, and `keeps` every 25 ms.
    #[inline(always)]
    pub(super) fn picture(
        &mut self,
        [e_y, e_theta]: &[[f64; N]; 2],
        [dt_ms, since_ms]: [u32; 2],
        own: &[i32; N],
        keeps: bool,
        matters: &[i32; N],
        suspect: &mut [i32; N],
    ) {
        let (dt, since) = (f64::from(dt_ms) * 1e-3, f64::from(since_ms) * 1e-3);
        let mut heading = [0.0; N];
        for l in 0..N {
            heading[l] = self.heading[l] + self.yaw_rate[l] * since;
        }
        if keeps {
            for l in 0..N {
                self.lines[(own[l] / 25) as usize % LINES][l] = heading[l] + e_theta[l];
            }
        }
        let (mut near, mut known) = ([0.0; N], [0.0; N]);
        for l in 0..N {
            // Where the far point was `between` before the last picture.
            let wanted_us = (own[l] - dt_ms as i32) * 1000 - self.between_us[l];
            let (place, newest) = (wanted_us / LINE_US, own[l] / 25);
            if wanted_us >= 0 && newest - place < LINES as i32 {
                let from = self.lines[place as usize % LINES][l];
                let to = self.lines[(place + 1).min(newest) as usize % LINES][l];
                let share = f64::from(wanted_us % LINE_US) * (1.0 / f64::from(LINE_US));
                (near[l], known[l]) = (from + (to - from) * share - self.heading_then[l], 1.0);
            }
        }
        for l in 0..N {
            let began = self.began[l];
            let dt = dt * began;
            let seen = (e_y[l] - self.e_y[l]) * began;
            let rate = self.speed[l] * near[l] - self.near_m[l] * self.yaw_rate_then[l];
            let predicted = if known[l] != 0.0 { rate * dt } else { seen };
            let bias = self.lane_bias[l];
            let predicted = predicted + bias * dt;
            let learnt = bias + (seen - predicted) * LEARNS * began;
            self.lane_bias[l] = learnt.min(LANE_BIAS).max(-LANE_BIAS);
            let (sum_predicted, sum_seen) = (self.predicted[l], self.seen[l]);
            let sum_predicted = sum_predicted - sum_predicted * dt + predicted;
            let sum_seen = sum_seen - sum_seen * dt + seen;
            (self.predicted[l], self.seen[l]) = (sum_predicted, sum_seen);
            let missing = sum_predicted - sum_seen;
            // The sign is beyond doubt where the first rule asks for it, and the second does not.
            let missing = if sum_predicted < 0.0 { -missing } else { missing };
            let is_missing = (missing > LANE_MARGIN) & (sum_predicted.abs() > LANE_MOVED);
            let is_same = (e_y[l] == self.e_y[l]) & (e_theta[l] == self.e_theta[l]);
            self.is_alive[l] = if is_same { 0.0 } else { began };
            suspect[l] |=
                flag(is_missing | (missing.abs() > LANE_UNREAL)) & matters[l] & Reason::LaneCheck.bit();
            (self.e_y[l], self.e_theta[l]) = (e_y[l], e_theta[l]);
            (self.heading_then[l], self.yaw_rate_then[l]) = (heading[l], self.yaw_rate[l]);
        }
    }

    /// The first frames of every run have come.
    #[inline(always)]
    pub(super) fn let_time_pass(&mut self) {
        self.began = [1.0; N];
    }
}
