//! What one closed-loop run leaves behind: evenly spaced samples of the truth, not of the sensors.
//!
//! Signs and frames are ISO 8855 (y left, yaw counter-clockwise); "lateral error" is the offset of the
//! centre of gravity from the centreline, left positive.

use serde::Serialize;

/// One instant of a run. SI units.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Sample {
    /// Time since the start of the run, s.
    pub time_s: f64,
    /// Arc length of the centre of gravity's projection on the centreline, m.
    pub s_m: f64,
    /// Offset of the centre of gravity from the centreline, m, left positive.
    pub lateral_error_m: f64,
    /// Direction of movement minus the centreline's heading at `s_m`, rad.
    pub heading_error_rad: f64,
    /// Curvature of the centreline at `s_m`, 1/m, left positive.
    pub curvature_1pm: f64,
    /// e_y at the driver's near point, m.
    pub e_y_m: f64,
    /// e_theta at the driver's far point, rad.
    pub e_theta_rad: f64,
    /// e_y' at the guidance's near point, m.
    pub guidance_e_y_m: f64,
    /// e_theta' at the guidance's far point, rad.
    pub guidance_e_theta_rad: f64,
    /// Steering wheel angle phi, rad.
    pub wheel_angle_rad: f64,
    /// Steering wheel rate, rad/s.
    pub wheel_rate_rad_s: f64,
    /// Yaw rate r, rad/s.
    pub yaw_rate_rad_s: f64,
    /// Side-slip angle beta, rad.
    pub sideslip_rad: f64,
    /// Driver torque T_d on the column (with the remnant, if any), N.m.
    pub driver_torque_nm: f64,
    /// Guidance torque T_h really applied, N.m.
    pub guidance_torque_nm: f64,
    /// Whether a limit held the guidance torque back.
    pub guidance_limited: bool,
}

/// A run's samples, evenly spaced in time.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Trace {
    /// Samples per second.
    pub sample_rate_hz: f64,
    /// The samples in order of time; the first is at t = 0.
    pub samples: Vec<Sample>,
}
