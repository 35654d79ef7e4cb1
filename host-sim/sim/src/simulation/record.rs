//! The truth of an instant, channel by channel.

use haptic_log::trace::Sample;

use crate::guidance::{Actuation, LaneErrors, Observation};
use crate::models::road::Projection;
use crate::models::{STEP_S, STEPS_PER_SECOND, wrapped};
use crate::parts::Motion;
use crate::unguided::Cause;

/// Samples per second of a trace.
pub const SAMPLE_RATE_HZ: u32 = 200;
/// Steps from one sample of a trace to the next.
pub const STEPS_PER_SAMPLE: u32 = STEPS_PER_SECOND / SAMPLE_RATE_HZ;

#[inline]
pub(super) fn record(
    motion: &Motion,
    projection: &Projection,
    observation: &Observation,
    [preview, camera]: [LaneErrors; 2],
    applied: Actuation,
    unguided: Option<Cause>,
) -> Sample {
    Sample {
        time_s: f64::from(observation.step) * STEP_S,
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
        speed_m_per_s: observation.speed_m_per_s,
        driver_torque_nm: observation.driver_torque_nm,
        guidance_torque_nm: applied.torque_nm,
        guidance_limited: applied.limited,
        unguided_cause: unguided.map_or(0.0, Cause::code),
    }
}
