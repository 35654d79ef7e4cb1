//! Decides from when on a fault can be detected: a second implementation of the plausibility checks, in f64, from unrounded values.
//!
//! On a straight a frozen lateral error is also the true one. So a reaction can only be required from the moment at which the
//! inputs contradict each other. This file finds that moment without the core: it compares the change of the near-point error
//! that speed, yaw error and yaw rate predict with the observed one, and the torques on the column with its movement, each
//! summed with a time constant of 1 s. A sample that is further from the last one than a vehicle can move belongs to another
//! line, whose movements are compared in the same way until it is adopted; after four seconds of nothing else the fault counts
//! as detected. Margins are those of `docs/explanation/plausibility.md`, the vehicle that of table 9.
//!
//! `core/tests/reference/checks.rs` has the same checks and shares nothing with this: it repeats what the ECU decides, with the
//! core's rounding, thinned history and doubts of the yaw rate, and says yes or no. Here time is continuous, nothing follows from
//! what the ECU believes, and the answer is a used share of a margin. What one misreads in the documents the other does not repeat.

use std::collections::VecDeque;

use haptic_sim::models::vehicle::{SteadyCornering, VehicleParameters};

/// From this share of a margin on, the resolution of the sensors cannot hide a contradiction: a wheel angle of 0.1
/// deg makes up to 1.2 %.
const SURELY_SEEN: f64 = 1.02;

/// Margin of a movement that was predicted and did not happen, m.
pub(super) const LANE_MARGIN_M: f64 = 0.4;
/// Margin of a movement that was not predicted; no vehicle moves further, m.
pub(super) const UNREAL_M: f64 = 0.8;
/// Margin of the momentum of the column's torques that the wheel's movement does not show, N.m.s.
pub(super) const COLUMN_MARGIN_NM_S: f64 = 0.6;
/// Largest change of the near-point error between two samples, m.
pub(super) const LANE_STEP_M: f64 = 0.3;
/// Largest change of the far-point yaw error between two samples, rad.
pub(super) const YAW_STEP_RAD: f64 = 0.1;
/// Ends of the signals' ranges on the bus.
const LANE_RANGE_M: f64 = 4.0;
const YAW_RANGE_RAD: f64 = 0.5;
/// Largest error of a motor's torque: a constant part, N.m, and a share of the command.
pub(super) const MOTOR_MARGIN_NM: f64 = 0.1;
const MOTOR_ERROR: f64 = 0.125;
/// For how many steps a motor may still answer an older command; and its lag in steps.
const MOTOR_ECHO: usize = 8;
const MOTOR_LAG: f64 = 64.0 / 3.0;
/// Slowest speed that is guided, m/s.
const LEAST_SPEED_M_PER_S: f64 = 5.0;
const MEMORY_S: f64 = 1.0;
/// How long samples may show a line elsewhere, s; when the old line is given up, with the three frames of a time-out,
/// s; and how near a new line must be to be adopted.
const ELSEWHERE_S: f64 = 4.0;
const LET_GO_S: f64 = 0.55;
const NEAR_M: f64 = 0.8;
const NEAR_RAD: f64 = 0.2;
/// A line elsewhere is seen after the three frames of a time-out, s. A line that was adopted is doubted until so much movement was
/// predicted of it, or turned by the vehicle, and no more than a quarter is missing, m.
const SEEN_ELSEWHERE_S: f64 = 0.03;
const SHOWS_M: f64 = 0.2;
/// t'_n, and the time that the vehicle needs from the near point to the far point, s.
const NEAR_TIME_S: f64 = 0.3;
const BETWEEN_S: f64 = 0.4;
/// Time constant of the slowly learnt errors, s, and their bounds: of the line's prediction, m/s, and of the column's
/// torques, N.m.
const LEARNT_WITHIN_S: f64 = 16.0;
const LANE_BIAS_M_PER_S: f64 = 0.15;
const COLUMN_BIAS_NM: f64 = 0.5;
/// Friction, the uncertain share of the aligning torque, and how many times the driver torque driver and power assist
/// together are at most.
const FRICTION_NM: f64 = 0.5;
const ALIGNING_SHARE: f64 = 77.0 / 256.0;
const ASSIST: f64 = 5.0;
/// Wind or bank may make the aligning torques by yaw rate and by wheel angle differ by this much.
const PUSHED_NM: f64 = 0.3;
/// A driver torque counts as stuck if it has not changed for this time, s, in which the wheel turned by [`STILL_TURN_RAD`].
const STILL_S: f64 = 1.0;
/// The turn of the wheel is measured anew when the torque changes, and after this time, s.
const STILL_WITHIN_S: f64 = 2.0;
/// How far the wheel has to turn, beside the probe and without it, rad.
const STILL_TURN_RAD: [f64; 2] = [0.0087, 0.14];
/// Inertia of column and wheel.
const INERTIA_KG_M2: f64 = 0.125;

/// The value of an interval that is nearest to zero.
fn nearest_to_zero([least, most]: [f64; 2]) -> f64 {
    least.max(0.0) + most.min(0.0)
}

/// Whether lane errors are further from the last ones than a vehicle can move.
fn is_a_step(last: [f64; 2], new: [f64; 2]) -> bool {
    (new[0] - last[0]).abs() > LANE_STEP_M || (new[1] - last[1]).abs() > YAW_STEP_RAD
}

/// Whether another line may be adopted: it is near and runs along the road.
fn is_near([e_y_m, e_theta_rad]: [f64; 2]) -> bool {
    e_y_m.abs() <= NEAR_M && e_theta_rad.abs() <= NEAR_RAD
}

/// By what a fault can be detected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Detectability {
    /// It can be detected at once, without any movement.
    AtOnce,
    /// The lane errors contradict the vehicle's movement, or the driver torque the wheel's.
    Contradiction,
    /// The motor's torque is further from zero than any recent command, or on the other side of zero.
    MotorAstray,
    /// The motor's torque is smaller than the recent commands.
    MotorWeak,
    /// A speed below the slowest guided.
    Speed,
}

impl Detectability {
    /// Whether it is the motor's torque that shows it.
    pub(super) fn is_of_motor(self) -> bool {
        matches!(self, Self::MotorAstray | Self::MotorWeak)
    }

    /// Since when a reaction is due, in words.
    pub(super) fn since(self) -> &'static str {
        match self {
            Self::AtOnce => "of the fault",
            Self::Contradiction => "of the contradiction",
            Self::MotorAstray | Self::MotorWeak => "of the motor's deviation",
            Self::Speed => "of the speed below 5 m/s",
        }
    }
}

/// The checks' sums and last values.
#[derive(Debug, Clone, Default)]
pub(super) struct Residual {
    vehicle: SteadyCornering,
    damping_nm_s: f64,
    speeds_m_per_s: [f64; 2],
    yaw_rate_rad_per_s: f64,
    wheel_rad: f64,
    wheel_rate_rad_per_s: f64,
    lane: Option<(f64, f64, f64)>,
    /// When, the heading, and the rate of turn since.
    headings: VecDeque<[f64; 3]>,
    /// When, and the line's direction at the far point in the frame of the headings.
    lines: VecDeque<[f64; 2]>,
    /// When, and the direction of a line elsewhere; below it that line's last sample.
    other_lines: VecDeque<[f64; 2]>,
    other: Option<(f64, f64, f64)>,
    /// A line was adopted and has shown no movement yet; the way by which the vehicle turned its near point.
    is_doubted: bool,
    turned_m: f64,
    lane_bias_m_per_s: f64,
    column_bias_nm: f64,
    predicted_m: f64,
    moved_m: f64,
    now_s: f64,
    column_at_s: Option<f64>,
    /// The driver torque, the time from which on it has not changed, and the least and largest wheel angle since.
    still: (f64, f64, [f64; 2]),
    momentum_nm_s: f64,
    commands_nm: [f64; MOTOR_ECHO],
    /// Least and largest torque that a working motor may deliver.
    motor_band_nm: [f64; 2],
    motor_nm: f64,
    /// Steps in a row in which the motor certainly deviated from its command, and in which it certainly delivered a
    /// torque that was not commanded.
    off: u32,
    astray: u32,
}

impl Residual {
    /// At rest, for a vehicle at a speed.
    pub(super) fn new(vehicle: &VehicleParameters, v_m_per_s: f64) -> Self {
        Self {
            vehicle: vehicle.steady_cornering(),
            damping_nm_s: vehicle.b_s,
            speeds_m_per_s: [v_m_per_s; 2],
            still: (f64::NAN, 0.0, [0.0; 2]),
            ..Self::default()
        }
    }

    /// Begins another step.
    pub(super) fn at(&mut self, time_s: f64) {
        self.now_s = time_s;
    }

    /// Takes the speeds and the yaw rate that arrive. Speeds that contradict each other are ignored.
    pub(super) fn motion(&mut self, time_s: f64, speeds_m_per_s: [f64; 2], yaw_rate_rad_per_s: f64) {
        let apart = speeds_m_per_s[0] - speeds_m_per_s[1];
        if apart.abs() < 2.0 {
            self.speeds_m_per_s = speeds_m_per_s;
            self.yaw_rate_rad_per_s = yaw_rate_rad_per_s;
        }
        let psi = self.heading(time_s);
        self.headings.push_back([time_s, psi, self.yaw_rate_rad_per_s]);
        while self.headings.len() > 64 {
            self.headings.pop_front();
        }
    }

    /// The heading at a time not long ago.
    fn heading(&self, time_s: f64) -> f64 {
        let known = self.headings.iter().rev().find(|[at, ..]| *at <= time_s + 1e-9);
        known.map_or(0.0, |[at, psi, rate]| psi + rate * (time_s - at))
    }

    /// Takes the column's values that arrive, and the guidance torque that was applied.
    pub(super) fn column(&mut self, time_s: f64, driver_nm: f64, wheel_rad: f64, applied_nm: f64) {
        let (same_nm, since_s, [least, most]) = self.still;
        let goes_on = driver_nm == same_nm && time_s - since_s < STILL_WITHIN_S;
        self.still = if goes_on {
            (same_nm, since_s, [least.min(wheel_rad), most.max(wheel_rad)])
        } else {
            (driver_nm, time_s, [wheel_rad; 2])
        };
        if let Some(before_s) = self.column_at_s {
            let dt = time_s - before_s;
            let v = self.speeds_m_per_s[0];
            let aligning_at = |turning: f64| self.vehicle.aligning_gain_nm_s2_per_m * v * turning;
            let aligning = aligning_at(self.yaw_rate_rad_per_s);
            // The aligning torque for the yaw rate that the wheel angle alone would cause.
            let by_wheel = aligning_at(
                v * self.vehicle.curvature_gain_per_m * self.wheel_rad
                    / (1.0 + self.vehicle.stability_factor_s2_per_m2 * v * v),
            );
            let by_wheel = by_wheel.clamp(aligning - PUSHED_NM, aligning + PUSHED_NM);
            self.wheel_rate_rad_per_s = (wheel_rad - self.wheel_rad) / dt;
            let moving = applied_nm - self.damping_nm_s * self.wheel_rate_rad_per_s;
            let ends = [
                moving + driver_nm.min(ASSIST * driver_nm) - aligning.max(by_wheel),
                moving + driver_nm.max(ASSIST * driver_nm) - aligning.min(by_wheel),
            ];
            // The least imbalance of the torques, and how much of it friction and the uncertain aligning torque may
            // explain.
            let bias = self.column_bias_nm;
            let missing = nearest_to_zero(ends) - bias;
            let tolerance = FRICTION_NM + ALIGNING_SHARE * aligning.abs();
            let kept = self.momentum_nm_s * (-dt / MEMORY_S).exp();
            let possible = [missing - tolerance, missing + tolerance].map(|torque| kept + torque * dt);
            self.momentum_nm_s = nearest_to_zero(possible);
            let learnt = bias + missing * dt / LEARNT_WITHIN_S;
            self.column_bias_nm = learnt.clamp(-COLUMN_BIAS_NM, COLUMN_BIAS_NM);
        }
        (self.column_at_s, self.wheel_rad) = (Some(time_s), wheel_rad);
    }

    /// Takes the lane errors that arrive: a sender saturates at the ends of the signals' ranges.
    pub(super) fn lane(&mut self, time_s: f64, e_y_m: f64, e_theta_rad: f64) {
        let e_y_m = e_y_m.clamp(-LANE_RANGE_M, LANE_RANGE_M);
        let e_theta_rad = e_theta_rad.clamp(-YAW_RANGE_RAD, YAW_RANGE_RAD);
        let sample = (time_s, e_y_m, e_theta_rad);
        if let Some((before_s, y, theta)) = self.lane
            && (is_a_step([y, theta], [e_y_m, e_theta_rad]) || time_s - before_s >= LET_GO_S)
        {
            self.swap_lines();
            if self
                .lane
                .is_none_or(|(_, y, theta)| is_a_step([y, theta], [e_y_m, e_theta_rad]))
            {
                self.lines.clear();
                self.lane = None;
            }
            // Its movements count from the time-out on, when the ECU sees it.
            if time_s - before_s >= SEEN_ELSEWHERE_S {
                self.compare(sample);
            }
            let is_watched =
                self.line_rate(time_s).is_some() && self.missing_m().abs() <= 0.5 * LANE_MARGIN_M;
            if time_s - before_s >= LET_GO_S && is_near([e_y_m, e_theta_rad]) && is_watched {
                (self.other, self.is_doubted, self.turned_m) = (None, true, 0.0);
            } else {
                self.swap_lines();
            }
            return;
        }
        self.other = None;
        self.compare(sample);
    }

    fn swap_lines(&mut self) {
        std::mem::swap(&mut self.lines, &mut self.other_lines);
        std::mem::swap(&mut self.lane, &mut self.other);
    }

    /// Compares a sample with the last one of its line.
    fn compare(&mut self, (time_s, e_y_m, e_theta_rad): (f64, f64, f64)) {
        if let Some((before_s, y, _)) = self.lane {
            let dt = time_s - before_s;
            let moved = e_y_m - y;
            let predicted = self.line_rate(before_s).map_or(moved, |rate| rate * dt);
            let predicted = predicted + self.lane_bias_m_per_s * dt;
            let learnt = self.lane_bias_m_per_s + (moved - predicted) / LEARNT_WITHIN_S;
            self.lane_bias_m_per_s = learnt.clamp(-LANE_BIAS_M_PER_S, LANE_BIAS_M_PER_S);
            let kept = (-dt / MEMORY_S).exp();
            self.predicted_m = self.predicted_m * kept + predicted;
            self.moved_m = self.moved_m * kept + moved;
            let turned = self.speeds_m_per_s[0] * NEAR_TIME_S * self.yaw_rate_rad_per_s * dt;
            self.turned_m = self.turned_m * kept + turned;
            let shown = self.predicted_m.abs().max(self.turned_m.abs());
            self.is_doubted &= shown < SHOWS_M || self.missing_m().abs() > 0.25 * shown;
        }
        let direction = self.heading(time_s) + e_theta_rad;
        self.lines.push_back([time_s, direction]);
        while self.lines.len() > 128 {
            self.lines.pop_front();
        }
        self.lane = Some((time_s, e_y_m, e_theta_rad));
    }

    /// The part of the predicted movement that was not seen, positive in its direction, m.
    fn missing_m(&self) -> f64 {
        (self.predicted_m - self.moved_m) * self.predicted_m.signum()
    }

    /// How fast the near-point error must move at a time, if the line is known for long enough.
    fn line_rate(&self, at_s: f64) -> Option<f64> {
        let wanted_s = at_s - BETWEEN_S;
        let after = self.lines.iter().position(|[at, _]| *at > wanted_s)?;
        let ([from_s, from], [to_s, to]) = (self.lines.get(after.checked_sub(1)?)?, self.lines[after]);
        let direction = from + (to - from) * (wanted_s - from_s) / (to_s - from_s);
        let v = self.speeds_m_per_s[0];
        Some(v * (direction - self.heading(at_s)) - v * NEAR_TIME_S * self.yaw_rate_rad_per_s)
    }

    /// Takes the command to the motor and the torque that it delivered.
    pub(super) fn motor(&mut self, commanded_nm: f64, delivered_nm: f64) {
        self.commands_nm.rotate_right(1);
        let oldest = std::mem::replace(&mut self.commands_nm[0], commanded_nm);
        let [low, high] = &mut self.motor_band_nm;
        *low = (*low + (commanded_nm.min(oldest) - *low) / MOTOR_LAG).min(commanded_nm.min(oldest));
        *high = (*high + (commanded_nm.max(oldest) - *high) / MOTOR_LAG).max(commanded_nm.max(oldest));
        self.motor_nm = delivered_nm;
        let count = |so_far: u32, used: f64| if used >= SURELY_SEEN { so_far + 1 } else { 0 };
        self.off = count(self.off, self.used(Detectability::MotorWeak));
        self.astray = count(self.astray, self.used(Detectability::MotorAstray));
    }

    /// The step from which on the fault can be detected, if it can be in this one.
    pub(super) fn detectable_since(&self, by: Detectability, step: u32) -> Option<u32> {
        match by {
            Detectability::MotorWeak => (self.off > 0).then(|| step + 1 - self.off),
            Detectability::MotorAstray => (self.astray > 0).then(|| step + 1 - self.astray),
            _ => (self.used(by) >= SURELY_SEEN).then_some(step),
        }
    }

    /// Used share of the lane's margin: from 1 on a fault can be detected.
    pub(super) fn lane_used(&self) -> f64 {
        // No possible sample for as long as guidance goes on without.
        let silence_s = self.lane.map_or(0.0, |(at_s, ..)| self.now_s - at_s);
        if silence_s > ELSEWHERE_S {
            return f64::INFINITY;
        }
        let missing = self.missing_m();
        // A missing movement counts only if at least half the margin was predicted.
        let slow = (missing / LANE_MARGIN_M).min(self.predicted_m.abs() / (0.5 * LANE_MARGIN_M));
        let unreal_m = if self.is_doubted { 0.5 * UNREAL_M } else { UNREAL_M };
        slow.max(missing.abs() / unreal_m)
    }

    /// Share of the column's margin that is used.
    pub(super) fn column_used(&self) -> f64 {
        // The wheel's own momentum, in the direction of the sum, is allowed beside the margin.
        let turning = INERTIA_KG_M2 * self.wheel_rate_rad_per_s * self.momentum_nm_s.signum();
        self.momentum_nm_s.abs() / (COLUMN_MARGIN_NM_S + turning.max(0.0))
    }

    /// Used share of the turn from which on a driver torque counts as stuck. A reaction is allowed then, and not required.
    pub(super) fn still_used(&self, is_probed: bool) -> f64 {
        let (_, since_s, [least, most]) = self.still;
        let allowed = STILL_TURN_RAD[usize::from(!is_probed)];
        if self.now_s - since_s < STILL_S {
            0.0
        } else {
            (most - least) / allowed
        }
    }

    /// Share of the motor's margin that its torque is beyond a band.
    fn beyond(&self, [low, high]: [f64; 2]) -> f64 {
        let margin = |end: f64| MOTOR_MARGIN_NM + MOTOR_ERROR * end.abs();
        f64::max(
            (self.motor_nm - high) / margin(high),
            (low - self.motor_nm) / margin(low),
        )
    }

    /// Used share of a margin; at 1 a fault can be detected.
    pub(super) fn used(&self, by: Detectability) -> f64 {
        match by {
            Detectability::AtOnce => f64::INFINITY,
            Detectability::Contradiction => self.lane_used().max(self.column_used()),
            Detectability::MotorWeak => self.beyond(self.motor_band_nm),
            // A torque that is too small is weak; it is astray only beyond zero, or above the band.
            Detectability::MotorAstray => {
                let [low, high] = self.motor_band_nm;
                self.beyond([low.min(0.0), high.max(0.0)])
            }
            Detectability::Speed => {
                LEAST_SPEED_M_PER_S / self.speeds_m_per_s[0].min(self.speeds_m_per_s[1]).max(1e-9)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Told 1 N.m for long, an honest motor may deliver 0.775 to 1.225 N.m: 0.1 N.m and an eighth of it off. Less is missing. Beyond
    /// zero by 0.1 N.m, or beyond 1.225, a torque is there that should not be.
    #[test]
    fn a_missing_torque_is_told_from_one_that_should_not_be_there() {
        for (delivered_nm, weak, astray) in [
            (1.0, false, false),
            (0.79, false, false),
            (0.76, true, false),
            (0.0, true, false),
            (-0.09, true, false),
            (-0.11, true, true),
            (1.21, false, false),
            (1.24, true, true),
        ] {
            for sign in [1.0, -1.0] {
                let mut residual = Residual::new(&VehicleParameters::default(), 20.0);
                for _ in 0..1000 {
                    residual.motor(sign, sign * delivered_nm);
                }
                let seen =
                    [Detectability::MotorWeak, Detectability::MotorAstray].map(|by| residual.used(by) > 1.0);
                assert_eq!(seen, [weak, astray], "{delivered_nm} {sign}");
            }
        }
    }
}
