//! Checks whether the inputs can be true together. A CRC cannot see that: a frame may be intact and its values wrong.
//!
//! - `lane`: the line moves as the vehicle does.
//! - `column`: the torques on the steering column balance.
//! - `motion`: the speed and the yaw rate that both are judged by; whether two speeds agree.
//! - `steps`: no value jumps further than a vehicle can move.
//!
//! Fault-free driving stays below the margins: the participants of the paper's tables 5 and 6, and lane changes of 1
//! m/s at 40 to 120 km/h (`tests/plausibility.rs` prints by how much).

mod column;
mod lane;
mod motion;
mod steps;

use crate::quantity::{
    AngularImpulse, CurvaturePerAngle, Metres, Micros, Seconds, StabilityFactor, TorquePerAcceleration,
    TorquePerTurningRate,
};
use crate::safety::redundant::words;

pub use column::{ALIGNING_ERROR, ASSIST, COLUMN_BIAS, COLUMN_MARGIN, FRICTION, PUSHED};
pub use lane::{LANE_BIAS, LANE_MARGIN, LaneMotion, UNREAL};
pub use steps::{
    LANE_STEP, SPEED_STEP, YAW_STEP, lane_step_is_possible, speed_step_is_possible, speeds_agree,
};

pub(crate) use steps::{BRAKES, SPEEDS_PATIENCE};

use column::ColumnState;
use lane::LaneState;
use motion::MotionState;

words! {
    /// The parameters of the vehicle that the checks use; immutable once validated by [`crate::controller::params`].
    pub struct Plausibility {
        /// K_t/l: front wheel angle per wheel angle, over the wheelbase.
        pub(crate) curvature_gain: CurvaturePerAngle,
        /// Stability factor A of the steady-state bicycle, in 2^-24 s2/m2.
        pub(crate) stability_factor: StabilityFactor,
        /// Aligning torque on the column per lateral acceleration, N.m per m/s2.
        pub(crate) aligning_gain: TorquePerAcceleration,
        /// B_s, N.m.s/rad.
        pub(crate) column_damping: TorquePerTurningRate,
        /// t'_f, s.
        pub(crate) far_time: Seconds,
        /// t'_n, s.
        pub(crate) near_time: Seconds,
        /// The time that the vehicle needs from the near point to the far point, at least 0.
        pub(crate) between: Micros,
    }
}

words! {
    /// Sums and last samples. What one message changes is a struct of its own, so that only that struct is copied.
    pub struct PlausibilityState {
        pub(crate) motion: MotionState,
        pub(crate) lane: LaneState,
        pub(crate) column: ColumnState,
    }
}

impl PlausibilityState {
    /// Nothing heard yet.
    pub const NEW: Self = Self {
        motion: MotionState::NEW,
        lane: LaneState::NEW,
        column: ColumnState::NEW,
    };
}

impl Plausibility {
    /// How much of the margins is used up: lane (m), column (N.m.s).
    #[must_use]
    pub fn used_margins(state: &PlausibilityState) -> (Metres, AngularImpulse) {
        (state.missing(), state.column.sum)
    }
}

#[cfg(test)]
mod tests;
