//! The truth of an instant, channel by channel.

use haptic_log::trace::Sample;

use crate::guidance::{Actuation, LaneErrors};
use crate::models::road::Projection;
use crate::models::{STEP_S, STEPS_PER_SECOND, wrapped};
use crate::parts::{BarState, Motion};
use crate::unguided::Cause;

/// Samples per second of a trace.
pub const SAMPLE_RATE_HZ: u32 = 200;
/// Steps from one sample of a trace to the next.
pub const STEPS_PER_SAMPLE: u32 = STEPS_PER_SECOND / SAMPLE_RATE_HZ;

/// What is true in a step.
pub(super) struct Truth {
    pub(super) motion: Motion,
    /// Lane errors at the driver's and at the guidance's points.
    pub(super) seen: [LaneErrors; 2],
    pub(super) speed_m_per_s: f64,
    pub(super) hands_nm: f64,
    pub(super) bar: Option<BarState>,
    pub(super) applied: Actuation,
}

#[inline]
pub(super) fn record(step: u32, of: &Truth, projection: &Projection, unguided: Option<Cause>) -> Sample {
    let (motion, [preview, camera]) = (&of.motion, of.seen);
    Sample {
        time_s: f64::from(step) * STEP_S,
        s_m: projection.s_m,
        lateral_error_m: projection.offset_m,
        heading_error_rad: wrapped(motion.direction_rad - projection.heading_rad),
        curvature_1pm: projection.curvature_1pm,
        e_y_m: preview.e_y_m,
        e_theta_rad: preview.e_theta_rad,
        guidance_e_y_m: camera.e_y_m,
        guidance_e_theta_rad: camera.e_theta_rad,
        wheel_angle_rad: motion.wheel_angle_rad,
        wheel_rate_rad_per_s: motion.wheel_rate_rad_per_s,
        yaw_rate_rad_per_s: motion.yaw_rate_rad_per_s,
        sideslip_rad: motion.sideslip_rad,
        speed_m_per_s: of.speed_m_per_s,
        driver_torque_nm: of.hands_nm,
        guidance_torque_nm: of.applied.torque_nm,
        guidance_limited: of.applied.limited,
        unguided_cause: unguided.map_or(0.0, Cause::code),
        bar_torque_nm: of.bar.map(|bar| bar.torque_nm),
        assist_torque_nm: of.bar.map(|bar| bar.assist_nm),
    }
}
