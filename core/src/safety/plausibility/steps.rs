//! How far a value may go from one message to the next.
//!
//! A sample that jumps further than a vehicle can move is rejected like a damaged frame. If the jump
//! persists, the input times out; in Active the last lane is then extrapolated ([`crate::safety::coast`]).

use crate::lane::LaneSample;
use crate::quantity::{Metres, Micros, Radians, Speed, per_second};

/// Largest change of the near-point error between two samples that is accepted: 0.3 m, nine times the change in 8.3
/// ms at 40 m/s and a yaw error of 0.1 rad.
pub const LANE_STEP: Metres = Metres::from_m(0.3);
/// Largest change of the yaw error between two samples that is accepted: 0.1 rad in 8.3 ms would be 12 rad/s.
pub const YAW_STEP: Radians = Radians::from_rad(0.1);
/// Largest change of a speed between two messages that is accepted: 1 m/s in 10 ms is 10 g.
pub const SPEED_STEP: Speed = Speed::from_m_per_s(1.0);
/// Largest change of a vehicle's speed in a second.
pub(crate) const BRAKES: Speed = Speed::from_m_per_s(12.0);
/// How long a wheel may slip: anti-lock brakes release it within 0.1 s, and on ice within 0.3 s.
pub(crate) const SPEEDS_PATIENCE: Micros = Micros::from_ms(300);
/// Two sources of the speed that differ by this much cannot both be right.
const SPEED_SPREAD: Speed = Speed::from_m_per_s(2.0);

/// Whether a new lane sample is no further from the last than a vehicle can move.
#[must_use]
pub fn lane_step_is_possible(last: &LaneSample, new: &LaneSample) -> bool {
    last.e_y.is_near(new.e_y, LANE_STEP) && last.e_theta.is_near(new.e_theta, YAW_STEP)
}

/// Whether a vehicle can have reached the new speed from the last one, which has been held for the time `held`.
#[must_use]
pub fn speed_step_is_possible(last: Speed, new: Speed, held: Micros) -> bool {
    let braked = Speed::from_fixed(per_second(BRAKES.fixed(), held));
    last.is_near(new, SPEED_STEP.plus(braked))
}

/// Whether two sources of speed agree: less than 2 m/s apart.
#[must_use]
pub fn speeds_agree(a: Speed, b: Speed) -> bool {
    a.fixed().unsigned_dist(b.fixed()) < SPEED_SPREAD.fixed().unsigned_abs()
}
