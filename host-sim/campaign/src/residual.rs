//! When a fault can be seen: the plausibility checks a second time, in f64 and from unrounded values.
//!
//! A frozen lateral error on a straight is an honest one, so a reaction can only be asked for from the moment
//! in which what arrives contradicts itself. This file decides that moment without the core: the change of the
//! near-point error that speed, yaw error and wheel angle predict against the change seen, and the column's
//! torques against its movement, each through a memory of 1 s. Vehicle and margins are the documented ones
//! (`docs/safety.md`), from table 9. A sample further away than a vehicle can move is passed over; when there is
//! nothing else for 30 ms, that is seen.

use haptic_sim::models::vehicle::VehicleParameters;

/// Share of a margin from which on sensors cannot hide it: a wheel angle of 0.1 deg is worth up to 1.2 %.
const SURELY_SEEN: f64 = 1.02;

/// A movement that was predicted and did not come, m.
pub(super) const LANE_MARGIN_M: f64 = 0.4;
/// Momentum on the column that did not show in the wheel, N.m.s.
pub(super) const COLUMN_MARGIN_NM_S: f64 = 0.6;
/// Further than the near-point error can go between two samples, m.
pub(super) const LANE_STEP_M: f64 = 0.3;
/// Further than the far-point yaw error can go between two samples, rad.
pub(super) const YAW_STEP_RAD: f64 = 0.1;
/// Ends of the signals' ranges on the bus.
const LANE_RANGE_M: f64 = 4.0;
const YAW_RANGE_RAD: f64 = 0.5;
/// Further than a motor may be from what it was told, N.m, and as a share of it.
pub(super) const MOTOR_MARGIN_NM: f64 = 0.1;
const MOTOR_ERROR: f64 = 0.125;
/// For this long a motor may echo an older command, steps; and its lag, steps.
const MOTOR_ECHO: usize = 8;
const MOTOR_LAG: f64 = 64.0 / 3.0;
/// Slowest speed that is guided, m/s.
const LEAST_SPEED_M_PER_S: f64 = 5.0;
const MEMORY_S: f64 = 1.0;
const TIMEOUT_S: f64 = 0.030;
const HALF_STEP_S: f64 = 0.0005;
/// t'_f, s.
const FAR_TIME_S: f64 = 0.7;

/// What a fault can be seen by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Seen {
    /// It needs no movement to be seen.
    AtOnce,
    /// The lane errors contradict the vehicle's movement, or the driver torque the wheel's.
    Contradiction,
    /// The motor's torque is none that it was told lately.
    Motor,
    /// A speed below the slowest guided.
    Speed,
}

impl Seen {
    /// Since when a reaction is due, in words.
    pub(super) fn since(self) -> &'static str {
        match self {
            Self::AtOnce => "of the fault",
            Self::Contradiction => "of the contradiction",
            Self::Motor => "of the motor's deviation",
            Self::Speed => "of the speed below 5 m/s",
        }
    }
}

/// The checks' sums and last values.
#[derive(Debug, Clone)]
pub(super) struct Residual {
    curvature_gain_per_m: f64,
    stability_factor_s2_per_m2: f64,
    aligning_gain_nm_s2_per_m: f64,
    damping_nm_s: f64,
    speeds_m_per_s: [f64; 2],
    wheel_rad: f64,
    lane: Option<(f64, f64, f64)>,
    predicted_m: f64,
    moved_m: f64,
    now_s: f64,
    column_at_s: Option<f64>,
    momentum_nm_s: f64,
    commands_nm: [f64; MOTOR_ECHO],
    /// Least and largest torque that an honest motor may deliver.
    motor_band_nm: [f64; 2],
    motor_nm: f64,
    /// Steps in a row in which the motor was surely away from what it was told.
    astray: u32,
}

impl Residual {
    /// At rest, for a vehicle at a speed.
    pub(super) fn new(vehicle: &VehicleParameters, v_m_per_s: f64) -> Self {
        let VehicleParameters {
            m,
            l_f,
            l_r,
            k_f,
            k_r,
            b_s,
            k_t,
            ..
        } = *vehicle;
        let l = l_f + l_r;
        Self {
            curvature_gain_per_m: k_t / l,
            stability_factor_s2_per_m2: m * (l_r * k_r - l_f * k_f) / (2.0 * l * l * k_f * k_r),
            aligning_gain_nm_s2_per_m: vehicle.aligning_stiffness() * m * l_r / (2.0 * l * k_f),
            damping_nm_s: b_s,
            speeds_m_per_s: [v_m_per_s; 2],
            wheel_rad: 0.0,
            lane: None,
            predicted_m: 0.0,
            moved_m: 0.0,
            now_s: 0.0,
            column_at_s: None,
            momentum_nm_s: 0.0,
            commands_nm: [0.0; MOTOR_ECHO],
            motor_band_nm: [0.0; 2],
            motor_nm: 0.0,
            astray: 0,
        }
    }

    /// Rate of the direction of movement, rad/s.
    fn turning_rad_per_s(&self) -> f64 {
        let v = self.speeds_m_per_s[0];
        v * self.curvature_gain_per_m * self.wheel_rad / (1.0 + self.stability_factor_s2_per_m2 * v * v)
    }

    /// Another step.
    pub(super) fn at(&mut self, time_s: f64) {
        self.now_s = time_s;
    }

    /// Takes the speeds that arrive.
    pub(super) fn speeds(&mut self, speeds_m_per_s: [f64; 2]) {
        self.speeds_m_per_s = speeds_m_per_s;
    }

    /// Takes the column's values that arrive, and the guidance torque that was applied.
    pub(super) fn column(&mut self, time_s: f64, driver_nm: f64, wheel_rad: f64, applied_nm: f64) {
        if let Some(before_s) = self.column_at_s {
            let dt = time_s - before_s;
            let aligning = self.aligning_gain_nm_s2_per_m * self.speeds_m_per_s[0] * self.turning_rad_per_s();
            let damped = self.damping_nm_s * (wheel_rad - self.wheel_rad);
            self.momentum_nm_s = self.momentum_nm_s * (-dt / MEMORY_S).exp()
                + (driver_nm + applied_nm - aligning) * dt
                - damped;
        }
        (self.column_at_s, self.wheel_rad) = (Some(time_s), wheel_rad);
    }

    /// Takes the lane errors that arrive: a sender saturates at the ends of the signals' ranges.
    pub(super) fn lane(&mut self, time_s: f64, e_y_m: f64, e_theta_rad: f64) {
        let e_y_m = e_y_m.clamp(-LANE_RANGE_M, LANE_RANGE_M);
        let e_theta_rad = e_theta_rad.clamp(-YAW_RANGE_RAD, YAW_RANGE_RAD);
        if let Some((before_s, y, theta)) = self.lane {
            let dt = time_s - before_s;
            if (e_y_m - y).abs() > LANE_STEP_M || (e_theta_rad - theta).abs() > YAW_STEP_RAD {
                return;
            }
            let v = self.speeds_m_per_s[0];
            let rate = v * 0.5 * (theta + e_theta_rad) - v * FAR_TIME_S * self.turning_rad_per_s();
            let kept = (-dt / MEMORY_S).exp();
            self.predicted_m = self.predicted_m * kept + rate * dt;
            self.moved_m = self.moved_m * kept + e_y_m - y;
        }
        self.lane = Some((time_s, e_y_m, e_theta_rad));
    }

    /// Takes what the motor was told and what it gave.
    pub(super) fn motor(&mut self, commanded_nm: f64, delivered_nm: f64) {
        self.commands_nm.rotate_right(1);
        let oldest = std::mem::replace(&mut self.commands_nm[0], commanded_nm);
        let [low, high] = &mut self.motor_band_nm;
        *low = (*low + (commanded_nm.min(oldest) - *low) / MOTOR_LAG).min(commanded_nm.min(oldest));
        *high = (*high + (commanded_nm.max(oldest) - *high) / MOTOR_LAG).max(commanded_nm.max(oldest));
        self.motor_nm = delivered_nm;
        self.astray = if self.used(Seen::Motor) >= SURELY_SEEN {
            self.astray + 1
        } else {
            0
        };
    }

    /// Since which step the fault can be seen, if it can be in this one.
    pub(super) fn seen_since(&self, by: Seen, step: u32) -> Option<u32> {
        match by {
            Seen::Motor => (self.astray > 0).then(|| step + 1 - self.astray),
            _ => (self.used(by) >= SURELY_SEEN).then_some(step),
        }
    }

    /// Share of the lane's margin that is used: 1 and more can be seen.
    pub(super) fn lane_used(&self) -> f64 {
        // No possible sample for 30 ms.
        let silence_s = self.lane.map_or(0.0, |(at_s, ..)| self.now_s - at_s);
        if silence_s > TIMEOUT_S + HALF_STEP_S {
            return f64::INFINITY;
        }
        let missing = (self.predicted_m - self.moved_m) * self.predicted_m.signum();
        // Half the margin has to be predicted: a movement that nothing predicts proves nothing.
        (missing / LANE_MARGIN_M).min(self.predicted_m.abs() / (0.5 * LANE_MARGIN_M))
    }

    /// Share of the column's margin that is used.
    pub(super) fn column_used(&self) -> f64 {
        self.momentum_nm_s.abs() / COLUMN_MARGIN_NM_S
    }

    /// Share of a margin that is used; at 1 a fault can be seen.
    pub(super) fn used(&self, by: Seen) -> f64 {
        match by {
            Seen::AtOnce => f64::INFINITY,
            Seen::Contradiction => self.lane_used().max(self.column_used()),
            Seen::Motor => {
                let [low, high] = self.motor_band_nm;
                let margin = |end: f64| MOTOR_MARGIN_NM + MOTOR_ERROR * end.abs();
                f64::max(
                    (self.motor_nm - high) / margin(high),
                    (low - self.motor_nm) / margin(low),
                )
            }
            Seen::Speed => LEAST_SPEED_M_PER_S / self.speeds_m_per_s[0].min(self.speeds_m_per_s[1]).max(1e-9),
        }
    }
}
