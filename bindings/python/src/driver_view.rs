//! What a driver perceives, for one who is stepped from outside.

use haptic_sim::parts;
use pyo3::prelude::*;

/// What a driver sees and feels in the next step.
#[pyclass(frozen, get_all, module = "haptic_guidance")]
pub(crate) struct DriverView {
    /// Number of the step.
    step: u32,
    /// Time since the start of the run, s.
    time_s: f64,
    /// Lateral error at the near point, to the middle of the lane, m; positive: the middle is to the left.
    e_y_m: f64,
    /// Yaw error at the far point, rad.
    e_theta_rad: f64,
    /// Arc length of the near point, m.
    near_m: f64,
    /// Arc length of the far point, m.
    far_m: f64,
    /// Angle of the steering wheel, rad.
    wheel_angle_rad: f64,
    /// Its rate, rad/s.
    wheel_rate_rad_per_s: f64,
    /// Speed, m/s.
    speed_m_per_s: f64,
    /// Yaw rate, rad/s.
    yaw_rate_rad_per_s: f64,
    /// T_h that the hands feel, N.m: that of the last step.
    guidance_torque_nm: f64,
    /// Whether the ECU's warning lamp is on.
    warning: bool,
    /// Whether the ECU guides and asks for a hand on the wheel, which it does not feel.
    asks_for_hands: bool,
}

impl From<parts::DriverView> for DriverView {
    fn from(view: parts::DriverView) -> Self {
        Self {
            step: view.step,
            time_s: view.time_s(),
            e_y_m: view.lane.e_y_m,
            e_theta_rad: view.lane.e_theta_rad,
            near_m: view.points_m[0],
            far_m: view.points_m[1],
            wheel_angle_rad: view.wheel_angle_rad,
            wheel_rate_rad_per_s: view.wheel_rate_rad_per_s,
            speed_m_per_s: view.speed_m_per_s,
            yaw_rate_rad_per_s: view.yaw_rate_rad_per_s,
            guidance_torque_nm: view.guidance_torque_nm,
            warning: view.warning,
            asks_for_hands: view.asks_for_hands,
        }
    }
}
