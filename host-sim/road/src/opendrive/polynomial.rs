//! Geometry by cubic polynomials of a parameter (poly3, paramPoly3), along arc length.
//!
//! A table of arc lengths finds the parameter. Where a polynomial's true length differs from the one that its element
//! states, arc length is stretched by the small rest, so that both ends are met.

use super::error::{RoadError, refuse};
use crate::centreline::quadrature;
use crate::piece::Pose;

/// A point of the reference line.
#[derive(Debug, Clone, Copy)]
pub(super) struct CurvePoint {
    pub(super) pose: Pose,
    pub(super) curvature_1pm: f64,
    /// Change of the curvature with arc length, 1/m^2.
    pub(super) curvature_slope_1pm2: f64,
    /// Arc length per s; 1 but for polynomials whose stated length is not theirs.
    pub(super) stretch: f64,
}

/// Distance between two entries of a table, m.
const TABLE_STEP_M: f64 = 0.25;
/// A polynomial's length over the one that its element states.
const LENGTH_RATIO: std::ops::RangeInclusive<f64> = 0.9..=1.1;

/// `u` and `v` over a parameter from 0 on, with the arc length at equal steps of the parameter.
#[derive(Debug, Clone)]
pub(super) struct Polynomial {
    u: [f64; 4],
    v: [f64; 4],
    step: f64,
    arc_m: Vec<f64>,
    stretch: f64,
}

/// Value and three derivatives of a cubic.
fn derivatives([a, b, c, d]: [f64; 4], p: f64) -> [f64; 4] {
    [
        a + p * (b + p * (c + p * d)),
        b + p * (2.0 * c + 3.0 * d * p),
        2.0 * c + 6.0 * d * p,
        6.0 * d,
    ]
}

impl Polynomial {
    /// `v` over `u` itself, as far as the arc length goes.
    pub(super) fn of_length(v: [f64; 4], length_m: f64, place: &str) -> Result<Self, RoadError> {
        let u = [0.0, 1.0, 0.0, 0.0];
        // The arc is at least as long as u.
        let whole = Self::tabulated(u, v, length_m, length_m);
        let end = whole.parameter(length_m);
        Self::new(u, v, end, length_m, place)
    }

    pub(super) fn new(
        u: [f64; 4],
        v: [f64; 4],
        end: f64,
        length_m: f64,
        place: &str,
    ) -> Result<Self, RoadError> {
        let mut polynomial = Self::tabulated(u, v, end, length_m);
        let true_m = polynomial.arc_m[polynomial.arc_m.len() - 1];
        polynomial.stretch = true_m / length_m;
        if !LENGTH_RATIO.contains(&polynomial.stretch) {
            return refuse(format!(
                "{place}: the polynomial is {true_m:.2} m long over its parameter's range, not {length_m} m; is \
                 pRange right?"
            ));
        }
        Ok(polynomial)
    }

    fn tabulated(u: [f64; 4], v: [f64; 4], end: f64, length_m: f64) -> Self {
        let count = (length_m / TABLE_STEP_M).ceil().max(8.0);
        let step = end / count;
        let mut polynomial = Self {
            u,
            v,
            step,
            arc_m: vec![0.0],
            stretch: 1.0,
        };
        for i in 0..count as usize {
            let from = i as f64 * step;
            let arc = polynomial.arc_m[i] + polynomial.arc_between(from, from + step);
            polynomial.arc_m.push(arc);
        }
        polynomial
    }

    fn speed(&self, p: f64) -> f64 {
        derivatives(self.u, p)[1].hypot(derivatives(self.v, p)[1])
    }

    fn arc_between(&self, from: f64, to: f64) -> f64 {
        quadrature(to - from, |p| (self.speed(from + p), 0.0)).0
    }

    /// The parameter at an arc length, by Newton's method from the table.
    fn parameter(&self, arc_m: f64) -> f64 {
        let after = self.arc_m.partition_point(|arc| *arc <= arc_m);
        let index = after.clamp(1, self.arc_m.len() - 1) - 1;
        let (from, known) = (index as f64 * self.step, self.arc_m[index]);
        let mut p =
            from + self.step * (arc_m - known) / (self.arc_m[index + 1] - known).max(f64::MIN_POSITIVE);
        for _ in 0..8 {
            let rest = arc_m - known - self.arc_between(from, p);
            if rest.abs() < 1e-12 {
                break;
            }
            p += rest / self.speed(p).max(1e-9);
        }
        p
    }

    pub(super) fn at(&self, ds: f64) -> CurvePoint {
        let p = self.parameter(ds * self.stretch);
        let ([u, u1, u2, u3], [v, v1, v2, v3]) = (derivatives(self.u, p), derivatives(self.v, p));
        let square = u1 * u1 + v1 * v1;
        let speed = square.sqrt();
        let cross = u1 * v2 - v1 * u2;
        let curvature_1pm = cross / (square * speed);
        let by_parameter =
            (u1 * v3 - v1 * u3) / (square * speed) - 3.0 * curvature_1pm * (u1 * u2 + v1 * v2) / square;
        CurvePoint {
            pose: Pose {
                x_m: u,
                y_m: v,
                heading_rad: v1.atan2(u1),
            },
            curvature_1pm,
            curvature_slope_1pm2: by_parameter / speed,
            stretch: self.stretch,
        }
    }
}
