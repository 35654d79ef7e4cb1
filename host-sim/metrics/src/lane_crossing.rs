//! Time to lane crossing on a curved road, for a vehicle on a curved path, in closed form.
//!
//! Sources: van Winsum, Brookhuis and de Waard 2000 (the curved path from yaw rate and speed); Mammar, Glaser
//! and Netto 2006 (circular path and circular road). Both are taken as they are now: the centre of gravity
//! goes on along the circle of curvature k = r/v, tangent to the direction of movement; the road goes on with
//! its present curvature K. The vehicle crosses when its side, half its width from the centre of gravity,
//! reaches a boundary.
//!
//! In axes along and across the centreline at the vehicle, the function y - K/2 (x^2 + y^2) has the value
//! n - K n^2/2 at every point with offset n from the centreline, straight road included. Put in the point
//! that the vehicle reaches after the distance L, in terms of the tangent length t = (2/k) tan(k L/2), and the
//! condition "offset n" is a quadratic in t. No case for straight roads or straight paths is needed.

/// The vehicle in its lane at one instant.
#[derive(Debug, Clone, Copy)]
pub struct Placement {
    /// Offset of the centre of gravity from the centreline, m, left positive.
    pub offset_m: f64,
    /// Direction of movement minus the centreline's heading, rad.
    pub heading_error_rad: f64,
    /// Curvature k of the vehicle's path, 1/m, left positive: yaw rate over speed.
    pub path_curvature_1pm: f64,
    /// Curvature K of the centreline, 1/m, left positive; its radius is larger than the lane's width.
    pub road_curvature_1pm: f64,
}

/// Distance to travel until the offset reaches `+-half_room_m`, m; half the room is half the lane's width less
/// half the vehicle's.
///
/// Zero if the vehicle is out of its lane, infinite if nothing is reached within half a turn of its circle.
pub fn distance_to_lane_crossing_m(at: &Placement, half_room_m: f64) -> f64 {
    let Placement {
        offset_m: e,
        path_curvature_1pm: k,
        road_curvature_1pm: road,
        ..
    } = *at;
    if e.abs() >= half_room_m {
        return 0.0;
    }
    let level = |n: f64| n - road / 2.0 * n * n;
    let (sin, cos) = at.heading_error_rad.sin_cos();
    let across = sin * (1.0 - road * e);
    let bend = k * cos * (1.0 - road * e) - road;
    let nearest = [half_room_m, -half_room_m]
        .into_iter()
        .fold(f64::INFINITY, |nearest, n| {
            let to_go = level(n) - level(e);
            nearest.min(smallest_positive_root(
                bend / 2.0 - to_go * k * k / 4.0,
                across,
                -to_go,
            ))
        });
    if nearest.is_infinite() || k == 0.0 {
        nearest
    } else {
        2.0 / k * (k * nearest / 2.0).atan()
    }
}

/// Smallest positive t with a t^2 + b t + c = 0, infinite if there is none; without cancellation.
fn smallest_positive_root(a: f64, b: f64, c: f64) -> f64 {
    let discriminant = b * b - 4.0 * a * c;
    if discriminant < 0.0 {
        return f64::INFINITY;
    }
    let q = -0.5 * (b + discriminant.sqrt().copysign(b));
    let positive = |t: f64| if t > 0.0 { t } else { f64::INFINITY };
    // Where a or q is zero the quotient is infinite or no number: neither is the least positive root.
    positive(q / a).min(positive(c / q))
}

#[cfg(test)]
mod tests {
    use super::*;

    const STRAIGHT: Placement = Placement {
        offset_m: 0.0,
        heading_error_rad: 0.0,
        path_curvature_1pm: 0.0,
        road_curvature_1pm: 0.0,
    };

    fn assert_close(got: f64, want: f64) {
        assert!((got - want).abs() <= 1e-9 * want.abs(), "{got} instead of {want}");
    }

    #[test]
    fn straight_path_on_straight_road() {
        let at = Placement {
            offset_m: 0.2,
            heading_error_rad: 0.03,
            ..STRAIGHT
        };
        assert_close(distance_to_lane_crossing_m(&at, 0.95), 0.75 / 0.03_f64.sin());
        let at = Placement {
            offset_m: 0.2,
            heading_error_rad: -0.03,
            ..STRAIGHT
        };
        assert_close(distance_to_lane_crossing_m(&at, 0.95), 1.15 / 0.03_f64.sin());
        assert_eq!(distance_to_lane_crossing_m(&STRAIGHT, 0.95), f64::INFINITY);
    }

    /// A circle of radius R leaves its tangent by d after the angle acos(1 - d/R).
    #[test]
    fn circular_path_on_straight_road() {
        for side in [1.0, -1.0] {
            let at = Placement {
                path_curvature_1pm: side / 200.0,
                ..STRAIGHT
            };
            assert_close(
                distance_to_lane_crossing_m(&at, 0.95),
                200.0 * (1.0_f64 - 0.95 / 200.0).acos(),
            );
        }
    }

    /// A tangent meets the outer boundary, a circle of radius R + d, after sqrt((R + d)^2 - R^2).
    #[test]
    fn straight_path_on_curved_road() {
        for side in [1.0, -1.0] {
            let at = Placement {
                road_curvature_1pm: side / 300.0,
                ..STRAIGHT
            };
            let want = (300.95_f64 * 300.95 - 300.0 * 300.0).sqrt();
            assert_close(distance_to_lane_crossing_m(&at, 0.95), want);
        }
    }

    #[test]
    fn a_path_that_follows_the_road_never_crosses() {
        // 0.4 m inside a left curve of 300 m: a circle of 299.6 m about the same centre.
        let at = Placement {
            offset_m: 0.4,
            path_curvature_1pm: 1.0 / 299.6,
            road_curvature_1pm: 1.0 / 300.0,
            ..STRAIGHT
        };
        assert!(distance_to_lane_crossing_m(&at, 0.95) > 1e4);
    }

    #[test]
    fn out_of_lane_is_zero() {
        let at = Placement {
            offset_m: -0.95,
            ..STRAIGHT
        };
        assert_eq!(distance_to_lane_crossing_m(&at, 0.95), 0.0);
    }

    /// Oracle: walk along the circle in steps of 1 mm and watch the distance to the road's own centre.
    #[test]
    fn agrees_with_walking_the_circle() {
        let walk = |at: &Placement| {
            let (mut x, mut y, mut heading) = (0.0, at.offset_m, at.heading_error_rad);
            let mut steps = 0.0;
            loop {
                let offset = if at.road_curvature_1pm == 0.0 {
                    y
                } else {
                    let radius = 1.0 / at.road_curvature_1pm;
                    radius - radius.signum() * f64::hypot(x, y - radius)
                };
                if f64::abs(offset) >= 0.95 {
                    return steps * 1e-3;
                }
                heading += at.path_curvature_1pm * 0.5e-3;
                x += 1e-3 * f64::cos(heading);
                y += 1e-3 * f64::sin(heading);
                heading += at.path_curvature_1pm * 0.5e-3;
                steps += 1.0;
            }
        };
        for road_curvature_1pm in [0.0, 1.0 / 300.0, -1.0 / 120.0] {
            for path_curvature_1pm in [1.0 / 150.0, -1.0 / 500.0, 0.0] {
                for offset_m in [-0.6, 0.0, 0.3] {
                    for heading_error_rad in [-0.02, 0.004, 0.05] {
                        let at = Placement {
                            offset_m,
                            heading_error_rad,
                            path_curvature_1pm,
                            road_curvature_1pm,
                        };
                        let got = distance_to_lane_crossing_m(&at, 0.95);
                        let want = walk(&at);
                        assert!((got - want).abs() < 2e-3, "{at:?}: {got} instead of {want}");
                    }
                }
            }
        }
    }
}
