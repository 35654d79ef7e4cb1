//! The points ahead that a driver or a camera looks at (section 2.4).

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use crate::guidance::LaneErrors;
use crate::models::plant::Plant;
use crate::models::road::{Centreline, Tracker};

/// A near and a far point along the direction of movement.
#[derive(Debug, Clone)]
pub(crate) struct PreviewPoints {
    pub(crate) near_m: f64,
    pub(crate) far_m: f64,
    pub(crate) near: Tracker,
    pub(crate) far: Tracker,
}

impl PreviewPoints {
    pub(crate) fn new(road: &Centreline, near_m: f64, far_m: f64) -> Self {
        Self {
            near_m,
            far_m,
            near: road.tracker(near_m),
            far: road.tracker(far_m),
        }
    }

    /// The errors and the far point's arc length; `None` where there is no road to look at.
    #[inline]
    pub(crate) fn look(&mut self, road: &Centreline, plant: &Plant) -> Option<(LaneErrors, f64)> {
        let [x, y] = plant.ahead_m(self.near_m);
        let near = road.project(x, y, &mut self.near)?;
        let [x, y] = plant.ahead_m(self.far_m);
        let far = road.project(x, y, &mut self.far)?;
        // The target line lies to the left of a point that lies to the right of it.
        let e_y_m = -near.offset_m;
        let e_theta_rad = wrapped(far.heading_rad - plant.direction_rad());
        (e_theta_rad.abs() < FRAC_PI_2).then_some((LaneErrors { e_y_m, e_theta_rad }, far.s_m))
    }
}

/// An angle in (-pi, pi].
#[inline]
pub(crate) fn wrapped(angle: f64) -> f64 {
    if angle > -PI && angle <= PI {
        return angle;
    }
    let positive = angle.rem_euclid(TAU);
    if positive > PI { positive - TAU } else { positive }
}
