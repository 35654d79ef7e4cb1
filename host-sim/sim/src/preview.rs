//! The points ahead that a driver or a camera looks at (section 2.4).

use std::f64::consts::FRAC_PI_2;

use crate::guidance::LaneErrors;
use crate::models::road::{Centreline, Tracker};
use crate::models::wrapped;
use crate::parts::{DriverVehicle, Motion};

/// A near and a far point along the direction of movement.
#[derive(Debug, Clone)]
pub(crate) struct PreviewPoints {
    /// How far ahead they are, s.
    times_s: [f64; 2],
    near_m: f64,
    far_m: f64,
    near: Tracker,
    far: Tracker,
    /// Steps between the last two looks.
    apart: u32,
}

impl PreviewPoints {
    /// Points as far ahead as these times at a speed.
    pub(crate) fn new(road: &Centreline, times_s: [f64; 2], v_m_per_s: f64) -> Self {
        let [near_m, far_m] = times_s.map(|time_s| v_m_per_s * time_s);
        Self {
            times_s,
            near_m,
            far_m,
            near: road.tracker(near_m),
            far: road.tracker(far_m),
            apart: 1,
        }
    }

    /// Moves them to where they are at another speed.
    pub(crate) fn at_speed(&mut self, v_m_per_s: f64) {
        [self.near_m, self.far_m] = self.times_s.map(|time_s| v_m_per_s * time_s);
    }

    /// So many steps have passed since the last look: the points are looked for where they have got to by now.
    #[inline]
    pub(crate) fn after(&mut self, steps: u32) {
        if steps != self.apart {
            let longer = f64::from(steps) / f64::from(self.apart);
            self.near.advance_m *= longer;
            self.far.advance_m *= longer;
            self.apart = steps;
        }
    }

    /// The errors, and the arc lengths of both points, m; `None` where there is no road to look at.
    #[inline]
    pub(crate) fn see(
        &mut self,
        road: &Centreline,
        from: &impl DriverVehicle,
        motion: &Motion,
    ) -> Option<(LaneErrors, [f64; 2])> {
        let [x, y] = from.ahead_m(self.near_m);
        let near = road.project(x, y, &mut self.near)?;
        let [x, y] = from.ahead_m(self.far_m);
        let far = road.project(x, y, &mut self.far)?;
        // The target line lies to the left of a point that lies to the right of it.
        let e_y_m = -near.offset_m;
        let e_theta_rad = wrapped(far.heading_rad - motion.direction_rad);
        let errors = LaneErrors { e_y_m, e_theta_rad };
        (e_theta_rad.abs() < FRAC_PI_2).then_some((errors, [near.s_m, far.s_m]))
    }
}
