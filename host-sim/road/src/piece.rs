//! The smallest parts of a road: a place on it, what the surface is like there, and a fine piece of a lane's centre; and how
//! long a road may be.

/// Longest course, m: keeps the centreline's table below 20 MB on straights.
pub(super) const MAX_COURSE_M: f64 = 200_000.0;

/// A place and a direction in the plane.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Pose {
    /// East in the frame of the road's file, m.
    pub x_m: f64,
    /// North, m.
    pub y_m: f64,
    /// Counter-clockwise from x, rad, not wrapped.
    pub heading_rad: f64,
}

impl Pose {
    /// The pose that has `local` as its place in the frame of this one.
    #[must_use]
    pub fn of_local(&self, local: Pose) -> Pose {
        let (sin, cos) = self.heading_rad.sin_cos();
        Pose {
            x_m: self.x_m + local.x_m * cos - local.y_m * sin,
            y_m: self.y_m + local.x_m * sin + local.y_m * cos,
            heading_rad: self.heading_rad + local.heading_rad,
        }
    }

    /// The pose in the frame of this one: the inverse of [`Pose::of_local`].
    #[must_use]
    pub fn to_local(&self, pose: Pose) -> Pose {
        let (sin, cos) = self.heading_rad.sin_cos();
        let (dx, dy) = (pose.x_m - self.x_m, pose.y_m - self.y_m);
        Pose {
            x_m: dx * cos + dy * sin,
            y_m: dy * cos - dx * sin,
            heading_rad: pose.heading_rad - self.heading_rad,
        }
    }
}

/// What the road is like at a place of a lane's centre.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Surface {
    /// Bank, rad, positive where the left edge is the higher one.
    pub bank_rad: f64,
    /// Rise per distance, positive uphill.
    pub grade: f64,
    /// Width of the lane, m.
    pub width_m: f64,
}

/// A fine piece of a lane's centre: its pose at the middle, all else linear in arc length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Piece {
    pub(super) length_m: f64,
    pub(super) middle: Pose,
    pub(super) curvature_1pm: f64,
    pub(super) curvature_slope_1pm2: f64,
    pub(super) bank_rad: [f64; 2],
    pub(super) grade: [f64; 2],
    pub(super) width_m: [f64; 2],
}

impl Piece {
    /// The pose at a distance from the middle, by the same expansion as `centreline`'s cells.
    pub(super) fn pose_at(&self, sigma: f64) -> Pose {
        let (k0, k1) = (self.curvature_1pm, self.curvature_slope_1pm2);
        let sigma2 = sigma * sigma;
        self.middle.of_local(Pose {
            x_m: sigma - sigma2 * sigma * (k0 * k0 / 6.0 + k1 * sigma * (k0 / 8.0 + k1 * sigma / 40.0)),
            y_m: sigma2 * (0.5 * k0 + k1 * sigma / 6.0 - k0 * k0 * k0 * sigma2 / 24.0),
            heading_rad: sigma * (k0 + 0.5 * k1 * sigma),
        })
    }
}
