//! The centreline as a curve to project onto.
//!
//! The course is divided into cells; each stores the exact position, heading and curvature at its middle. Inside a
//! cell the clothoid is replaced by its Taylor expansion about the middle, so a projection needs no trigonometry.
//! Cells are so short (`MAX_CELL_M`, `MAX_CELL_TURN_RAD`) that the neglected terms stay below 1e-9 m. The foot of the
//! perpendicular from a point is found by Newton's method, starting where the
//! point has got to since it was projected last. A `Tracker` holds that start and moves along with its point, so a course may
//! cross itself.

use super::piece::{Piece, Pose, Surface};
use super::{Course, Segment};

/// Longest cell, m.
const MAX_CELL_M: f64 = 1.0;
/// Largest change of heading within a cell, rad. Half of it is the largest angle in the expansion, whose
/// first neglected terms are of fifth order: 0.0025^4 * 0.5 m / 120 is 2e-13 m.
const MAX_CELL_TURN_RAD: f64 = 0.005;
/// A Newton step below this ends the search, m. Convergence is quadratic with a factor below 1 per metre, so
/// the foot is then within 1e-8 m along the curve, and its distance within 1e-16 m.
pub const CONVERGED_M: f64 = 1e-4;
/// A point that needs more steps has left the region where its perpendicular is unique.
const MAX_NEWTON_STEPS: usize = 20;
/// The projection is refused where 1 - curvature * offset falls below this: so close to the centre of the
/// curve that the foot of the perpendicular is not unique any more.
pub const MIN_DETERMINANT: f64 = 0.1;
/// How far beyond its ends the centreline is continued, m: enough for the step that finds the end.
pub const OVERRUN_M: f64 = 2.0;
/// The centre of a lane from a file may have kinks. There a point has no foot on one side and two on the other, and
/// the search jumps to and fro across the kink. Its steps are then limited to this length, m, and the kink is taken
/// as the foot.
const KINK_M: f64 = 0.5;
/// The expansion multiplies with a sixth, as a division takes several times as long.
pub const SIXTH: f64 = 1.0 / 6.0;
/// See [`SIXTH`].
pub const FORTIETH: f64 = 1.0 / 40.0;

/// A piece of the centreline, expanded about its middle.
#[derive(Debug, Clone, Copy)]
pub struct Cell {
    /// Arc length at the middle, m.
    pub s_m: f64,
    /// Arc lengths of its start and its end, m.
    pub ends_m: [f64; 2],
    /// Position of the middle, m.
    pub x_m: f64,
    /// See `x_m`.
    pub y_m: f64,
    /// Unit tangent.
    pub tangent: [f64; 2],
    /// Heading at the middle, rad.
    pub heading_rad: f64,
    /// Curvature at the middle, 1/m.
    pub curvature_1pm: f64,
    /// Change of curvature with arc length, 1/m^2.
    pub curvature_slope_1pm2: f64,
    /// A sixth of the curvature's square, and a 24th of its third power, which each projection needs.
    pub curvature_powers: [f64; 2],
    /// Which of the terms vanish.
    pub shape: Shape,
}

/// What a cell is: the less bent it is, the fewer terms its expansion has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// Without curvature.
    Straight,
    /// One curvature all along.
    Arc,
    /// A curvature that changes.
    Clothoid,
}

/// A point in the frame of a place on the centreline.
struct Near {
    /// Heading of the place against the cell's middle, rad.
    theta: f64,
    /// Curvature there, 1/m.
    curvature: f64,
    /// How far ahead of the place the point lies, m.
    distance_to_foot: f64,
    /// How far to its left, m.
    offset_m: f64,
}

impl Cell {
    /// `middle` at an arc length of `s_m`, and what follows from a curvature, its slope and half a length.
    fn new(s_m: f64, half_m: f64, middle: Pose, k: f64, slope: f64) -> Self {
        Self {
            s_m,
            ends_m: [s_m - half_m, s_m + half_m],
            x_m: middle.x_m,
            y_m: middle.y_m,
            tangent: [middle.heading_rad.cos(), middle.heading_rad.sin()],
            heading_rad: middle.heading_rad,
            curvature_1pm: k,
            curvature_slope_1pm2: slope,
            curvature_powers: [k * k / 6.0, k * k * k / 24.0],
            shape: match (slope != 0.0, k != 0.0) {
                (true, _) => Shape::Clothoid,
                (false, true) => Shape::Arc,
                (false, false) => Shape::Straight,
            },
        }
    }

    /// Where a step of Newton's leads from an arc length, and how long it is, m; `None` close to the centre of curvature.
    #[inline(always)]
    fn newton(&self, s_m: f64, x_m: f64, y_m: f64) -> Option<(Projection, f64)> {
        let near = self.near(s_m - self.s_m, x_m, y_m);
        let determinant = 1.0 - near.curvature * near.offset_m;
        // A determinant that is not a number is refused, too.
        let is_sound = determinant >= MIN_DETERMINANT;
        if !is_sound {
            return None;
        }
        let step = if near.curvature == 0.0 {
            near.distance_to_foot
        } else {
            near.distance_to_foot / determinant
        };
        let foot = Projection {
            s_m: s_m + step,
            offset_m: near.offset_m,
            heading_rad: self.heading_rad + near.theta + near.curvature * step,
            curvature_1pm: near.curvature,
        };
        Some((foot, step))
    }

    /// The point `(x_m, y_m)` as the place at `sigma` behind the cell's middle sees it.
    #[inline]
    fn near(&self, sigma: f64, x_m: f64, y_m: f64) -> Near {
        let (k0, k1) = (self.curvature_1pm, self.curvature_slope_1pm2);
        let [tx, ty] = self.tangent;
        let (dx, dy) = (x_m - self.x_m, y_m - self.y_m);
        if self.shape == Shape::Straight {
            // The expansion below without the terms that vanish, to the same bits. What is left of them
            // keeps the signs of zeros and lets nothing pass that is not a number.
            let (ahead, left) = (dx * tx + dy * ty - sigma, dy * tx - dx * ty);
            return Near {
                theta: sigma * 0.0,
                curvature: 0.0,
                distance_to_foot: ahead,
                offset_m: left - ahead * 0.0,
            };
        }
        // The clothoid in the frame of the cell's middle: heading theta, position (along, across).
        let sigma2 = sigma * sigma;
        let [square_over_6, cube_over_24] = self.curvature_powers;
        let (theta, along, across, curvature) = if self.shape == Shape::Arc {
            // Without the terms that vanish, to the same bits.
            let along = sigma - sigma2 * sigma * square_over_6;
            (sigma * k0, along, sigma2 * (0.5 * k0 - cube_over_24 * sigma2), k0)
        } else {
            let along =
                sigma - sigma2 * sigma * (square_over_6 + k1 * sigma * (k0 / 8.0 + k1 * sigma * FORTIETH));
            let across = sigma2 * (0.5 * k0 + k1 * sigma * SIXTH - cube_over_24 * sigma2);
            (sigma * (k0 + 0.5 * k1 * sigma), along, across, k0 + k1 * sigma)
        };
        let (cos, sin) = (1.0 - 0.5 * theta * theta, theta - theta * theta * theta * SIXTH);
        let (ahead, left) = (dx * tx + dy * ty - along, dy * tx - dx * ty - across);
        Near {
            theta,
            curvature,
            distance_to_foot: ahead * cos + left * sin,
            offset_m: left * cos - ahead * sin,
        }
    }
}

/// What the surface is like in a cell: values at its middle and their change with arc length, per m.
#[derive(Debug, Clone, Copy)]
struct Ground {
    middle: Surface,
    slope: Surface,
}

impl Ground {
    /// Between the ends of a stretch, at a distance from its start.
    fn within(at_m: f64, length_m: f64, bank_rad: [f64; 2], grade: [f64; 2], width_m: [f64; 2]) -> Self {
        let slope = |[start, end]: [f64; 2]| (end - start) / length_m;
        let value = |ends: [f64; 2]| ends[0] + slope(ends) * at_m;
        Self {
            middle: Surface {
                bank_rad: value(bank_rad),
                grade: value(grade),
                width_m: value(width_m),
            },
            slope: Surface {
                bank_rad: slope(bank_rad),
                grade: slope(grade),
                width_m: slope(width_m),
            },
        }
    }

    fn at(&self, sigma: f64) -> Surface {
        let Self { middle, slope } = self;
        Surface {
            bank_rad: middle.bank_rad + slope.bank_rad * sigma,
            grade: middle.grade + slope.grade * sigma,
            width_m: middle.width_m + slope.width_m * sigma,
        }
    }
}

/// A course turned into a curve that starts at the origin, heading along x.
#[derive(Debug, Clone)]
pub struct Centreline {
    cells: Vec<Cell>,
    /// One for each cell; apart from them, because only some ask for it.
    grounds: Vec<Ground>,
    length_m: f64,
    /// Largest arc length of a foot, m.
    last_m: f64,
    lane_width_m: f64,
    /// Where the start is in the frame of the course's file.
    start: Pose,
    has_kinks: bool,
}

/// The foot of the perpendicular from a point to the centreline.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Projection {
    /// Arc length, m. May lie up to 2 m beyond the ends of the course.
    pub s_m: f64,
    /// Signed distance of the point from the centreline, m, positive when the point lies to the left.
    pub offset_m: f64,
    /// Heading of the centreline, rad, not wrapped: it counts full turns.
    pub heading_rad: f64,
    /// Curvature of the centreline, 1/m, left positive.
    pub curvature_1pm: f64,
}

/// Where a moving point was last projected, and how far it is expected to come until the next time.
#[derive(Debug, Clone, Copy)]
pub struct Tracker {
    /// Number of the cell.
    pub cell: usize,
    /// Arc length, m.
    pub s_m: f64,
    /// How far it is expected to come, m: as far as before the last projection, unless the times between are not the same.
    pub advance_m: f64,
}

impl Centreline {
    /// The curve of a course, moved to start at the origin, heading along x.
    pub fn new(course: &Course) -> Self {
        match course.pieces() {
            Some(pieces) => Self::of_pieces(course, pieces),
            None => Self::of_segments(course),
        }
    }

    fn of_pieces(course: &Course, pieces: &[Piece]) -> Self {
        let start = pieces[0].pose_at(-0.5 * pieces[0].length_m);
        let mut s = 0.0;
        let (mut cells, mut grounds) = (Vec::with_capacity(pieces.len()), Vec::with_capacity(pieces.len()));
        for piece in pieces {
            let half_m = 0.5 * piece.length_m;
            let middle = start.to_local(piece.middle);
            let (curvature, slope) = (piece.curvature_1pm, piece.curvature_slope_1pm2);
            cells.push(Cell::new(s + half_m, half_m, middle, curvature, slope));
            let ends = (piece.bank_rad, piece.grade, piece.width_m);
            grounds.push(Ground::within(half_m, piece.length_m, ends.0, ends.1, ends.2));
            s += piece.length_m;
        }
        Self {
            start,
            has_kinks: true,
            ..Self::of_cells(course, cells, grounds, s)
        }
    }

    /// A smooth curve that starts at the origin of its file.
    fn of_cells(course: &Course, cells: Vec<Cell>, grounds: Vec<Ground>, length_m: f64) -> Self {
        Self {
            cells,
            grounds,
            length_m,
            last_m: length_m + OVERRUN_M,
            lane_width_m: course.lane_width_m(),
            start: Pose::default(),
            has_kinks: false,
        }
    }

    fn of_segments(course: &Course) -> Self {
        let (mut cells, mut grounds) = (Vec::new(), Vec::new());
        let width_m = [course.lane_width_m(); 2];
        let (mut x, mut y, mut heading, mut s) = (0.0, 0.0, 0.0, 0.0);
        for segment in course.segments() {
            let Segment {
                length_m,
                curvature_start_1pm: start,
                curvature_end_1pm: end,
                bank_rad,
                grade,
            } = *segment;
            let turn = start.abs().max(end.abs()) * length_m;
            let count = (length_m / MAX_CELL_M)
                .max(turn / MAX_CELL_TURN_RAD)
                .ceil()
                .max(1.0);
            let half_m = 0.5 * length_m / count;
            let slope = (end - start) / length_m;
            for i in 0..count as usize {
                let middle = (2 * i + 1) as f64 * half_m;
                let curvature = start + slope * middle;
                let entry_curvature = curvature - slope * half_m;
                let (dx, dy) = arc(heading, entry_curvature, slope, half_m);
                let heading_mid = heading + (entry_curvature + 0.5 * slope * half_m) * half_m;
                let pose = Pose {
                    x_m: x + dx,
                    y_m: y + dy,
                    heading_rad: heading_mid,
                };
                cells.push(Cell::new(s + middle, half_m, pose, curvature, slope));
                grounds.push(Ground::within(middle, length_m, bank_rad, grade, width_m));
                let (dx2, dy2) = arc(heading_mid, curvature, slope, half_m);
                (x, y) = (x + dx + dx2, y + dy + dy2);
                heading = heading_mid + (curvature + 0.5 * slope * half_m) * half_m;
            }
            s += length_m;
        }
        Self::of_cells(course, cells, grounds, s)
    }

    /// Where the start of the curve is in the frame of the course's file.
    pub fn start(&self) -> Pose {
        self.start
    }

    /// The place at an arc length, its curvature (1/m) and surface; beyond the ends the curve is continued.
    pub fn at(&self, s_m: f64) -> (Pose, f64, Surface) {
        let index = self.tracker(s_m).cell;
        let cell = &self.cells[index];
        let sigma = s_m - cell.s_m;
        let piece = Piece {
            length_m: cell.ends_m[1] - cell.ends_m[0],
            middle: Pose {
                x_m: cell.x_m,
                y_m: cell.y_m,
                heading_rad: cell.heading_rad,
            },
            curvature_1pm: cell.curvature_1pm,
            curvature_slope_1pm2: cell.curvature_slope_1pm2,
            bank_rad: [0.0; 2],
            grade: [0.0; 2],
            width_m: [0.0; 2],
        };
        let curvature = cell.curvature_1pm + cell.curvature_slope_1pm2 * sigma;
        (piece.pose_at(sigma), curvature, self.grounds[index].at(sigma))
    }

    /// What the road is like where a point was last projected.
    pub fn surface(&self, tracker: &Tracker) -> Surface {
        self.grounds[tracker.cell].at(tracker.s_m - self.cells[tracker.cell].s_m)
    }

    /// Arc length of the whole course, m.
    pub fn length_m(&self) -> f64 {
        self.length_m
    }

    /// Its cells in order.
    pub fn cells(&self) -> &[Cell] {
        &self.cells
    }

    /// Width of the lane whose middle is the centreline, m.
    pub fn lane_width_m(&self) -> f64 {
        self.lane_width_m
    }

    /// A tracker for a point that is first seen near arc length `s_m`.
    pub fn tracker(&self, s_m: f64) -> Tracker {
        let cell = self
            .cells
            .partition_point(|c| c.ends_m[1] < s_m)
            .min(self.cells.len() - 1);
        Tracker {
            cell,
            s_m,
            advance_m: 0.0,
        }
    }

    /// The foot of the perpendicular from `(x_m, y_m)` that continues the tracker's last one; distances are
    /// within 1e-8 m. `None` where there is no unique foot nearby: more than 2 m beyond the ends, or close
    /// to the centre of curvature.
    #[inline]
    pub fn project(&self, x_m: f64, y_m: f64, tracker: &mut Tracker) -> Option<Projection> {
        let s = tracker.s_m + tracker.advance_m;
        let cell = &self.cells[tracker.cell];
        if s > cell.ends_m[1] || s < cell.ends_m[0] {
            return self.search(x_m, y_m, s, tracker, MAX_NEWTON_STEPS);
        }
        // Mostly the first step, in the cell of the time before, finds the foot.
        let (foot, step) = cell.newton(s, x_m, y_m)?;
        if step.abs() < CONVERGED_M {
            return self.take(foot, tracker.cell, tracker);
        }
        let s = foot.s_m.clamp(-OVERRUN_M, self.last_m);
        self.search(x_m, y_m, s, tracker, MAX_NEWTON_STEPS - 1)
    }

    /// Searches from an arc length on, in so many steps at most. Compiled apart, as a loop takes registers.
    #[inline(never)]
    fn search(&self, x_m: f64, y_m: f64, s: f64, tracker: &mut Tracker, steps: usize) -> Option<Projection> {
        let mut s = s;
        let mut index = tracker.cell;
        for left in (0..steps).rev() {
            index = self.walk(index, s);
            let (foot, step) = self.cells[index].newton(s, x_m, y_m)?;
            let at_kink = left == 0 && self.has_kinks && step.abs() < KINK_M;
            if step.abs() < CONVERGED_M || at_kink {
                return self.take(foot, index, tracker);
            }
            s = foot.s_m.clamp(-OVERRUN_M, self.last_m);
        }
        None
    }

    /// The cell of an arc length, looked for from a cell nearby.
    #[inline]
    pub fn walk(&self, mut index: usize, s_m: f64) -> usize {
        while s_m > self.cells[index].ends_m[1] && index + 1 < self.cells.len() {
            index += 1;
        }
        while s_m < self.cells[index].ends_m[0] && index > 0 {
            index -= 1;
        }
        index
    }

    /// A foot that was found, unless it lies beyond the ends.
    #[inline]
    fn take(&self, foot: Projection, cell: usize, tracker: &mut Tracker) -> Option<Projection> {
        let s_m = foot.s_m;
        if s_m < -OVERRUN_M || s_m > self.last_m {
            return None;
        }
        let advance_m = s_m - tracker.s_m;
        *tracker = Tracker { cell, s_m, advance_m };
        Some(foot)
    }
}

/// Displacement along a clothoid that starts with `heading` and `curvature`: exact to rounding for the small turn of half a
/// cell.
fn arc(heading: f64, curvature: f64, slope: f64, length: f64) -> (f64, f64) {
    if curvature == 0.0 && slope == 0.0 {
        // A straight has one direction.
        let direction = (heading.cos(), heading.sin());
        return quadrature(length, |_| direction);
    }
    quadrature(length, |s| {
        let theta = heading + s * (curvature + 0.5 * slope * s);
        (theta.cos(), theta.sin())
    })
}

/// Integral over `[0, end]` by Gauss and Legendre with five points.
pub(super) fn quadrature(end: f64, f: impl Fn(f64) -> (f64, f64)) -> (f64, f64) {
    const NODES: [(f64, f64); 5] = [
        (0.0, 0.568_888_888_888_888_9),
        (0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
        (-0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
        (0.906_179_845_938_664, 0.236_926_885_056_189_08),
        (-0.906_179_845_938_664, 0.236_926_885_056_189_08),
    ];
    let half = 0.5 * end;
    NODES.iter().fold((0.0, 0.0), |(x, y), (node, weight)| {
        let (fx, fy) = f(half * (1.0 + node));
        (x + half * weight * fx, y + half * weight * fy)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn centreline(text: &str) -> Centreline {
        Centreline::new(&Course::from_toml("t.toml", text).unwrap())
    }

    /// Projects a point near arc length `s`, as a fresh tracker sees it.
    fn foot(line: &Centreline, x: f64, y: f64, s: f64) -> Option<Projection> {
        line.project(x, y, &mut line.tracker(s))
    }

    #[test]
    fn a_circle_is_a_circle() {
        let radius = 50.0;
        let line = centreline("[[segment]]\nlength_m = 300\ncurvature_per_m = 0.02");
        for (s, offset) in [(0.0, 0.0), (10.0, 3.0), (77.7, -4.0), (299.0, 0.5), (150.0, 20.0)] {
            let angle: f64 = s / radius;
            let (x, y) = (
                (radius - offset) * angle.sin(),
                radius - (radius - offset) * angle.cos(),
            );
            let found = foot(&line, x, y, s - 3.0).unwrap();
            assert!((found.s_m - s).abs() < 1e-8, "{found:?}");
            assert!((found.offset_m - offset).abs() < 1e-9, "{found:?}");
            assert!((found.heading_rad - angle).abs() < 1e-9, "{found:?}");
            assert_eq!(found.curvature_1pm, 0.02);
        }
    }

    #[test]
    fn a_clothoid_ends_where_the_fresnel_integrals_say() {
        // Curvature pi*s/a^2 gives x = a*C(s/a), y = a*S(s/a); C(1), S(1) from Abramowitz and Stegun, table 7.7.
        let (c1, s1) = (0.779_893_400_376_822_8, 0.438_259_147_390_354_8);
        let a = 100.0;
        let end_curvature = std::f64::consts::PI / a;
        let line = centreline(&format!(
            "[[segment]]\nlength_m = 100\ncurvature_start_per_m = 0\ncurvature_end_per_m = {end_curvature}\n\
             [[segment]]\nlength_m = 10"
        ));
        let found = foot(&line, a * c1, a * s1, 99.0).unwrap();
        assert!((found.s_m - 100.0).abs() < 1e-8, "{found:?}");
        assert!(found.offset_m.abs() < 1e-9, "{found:?}");
        assert!(
            (found.heading_rad - std::f64::consts::FRAC_PI_2).abs() < 1e-9,
            "{found:?}"
        );
    }

    /// Points at known arc length and offset of a sharp S-bend, by brute-force quadrature (midpoint rule with
    /// 1e-5 m steps).
    #[test]
    fn a_point_beside_any_clothoid_projects_back() {
        let line = centreline(
            "[[segment]]\nlength_m = 8\ncurvature_start_per_m = -0.1\ncurvature_end_per_m = 0.1\n\
             [[segment]]\nlength_m = 12\ncurvature_per_m = 0.1",
        );
        let curvature = |s: f64| if s < 8.0 { -0.1 + 0.2 * s / 8.0 } else { 0.1 };
        let ds = 1e-5;
        let (mut x, mut y, mut heading) = (0.0, 0.0, 0.0_f64);
        let mut tracker = line.tracker(0.0);
        for i in 0..2_000_000_u32 {
            let s = f64::from(i) * ds;
            if i % 50_021 == 0 {
                let offset = 3.0 * (f64::from(i) * 1e-4).sin();
                let (px, py) = (x - offset * heading.sin(), y + offset * heading.cos());
                let found = line.project(px, py, &mut tracker).unwrap();
                assert!((found.s_m - s).abs() < 1e-8, "{s}: {found:?}");
                assert!((found.offset_m - offset).abs() < 1e-8, "{s}, {offset}: {found:?}");
                assert!((found.heading_rad - heading).abs() < 1e-8, "{s}: {found:?}");
            }
            let middle = heading + 0.5 * ds * curvature(s + 0.25 * ds);
            x += ds * middle.cos();
            y += ds * middle.sin();
            heading += ds * curvature(s + 0.5 * ds);
        }
    }

    #[test]
    fn a_point_without_a_foot_is_refused() {
        let line = centreline("[[segment]]\nlength_m = 30\ncurvature_per_m = 0.1");
        // The centre of the circle is (0, 10): every point of the arc is equally near.
        assert_eq!(foot(&line, 0.0, 10.0, 5.0), None);
        let straight = centreline("[[segment]]\nlength_m = 30");
        assert_eq!(foot(&straight, 33.0, 0.0, 29.0), None, "3 m beyond the end");
        assert_eq!(foot(&straight, -3.0, 0.0, 1.0), None, "3 m before the start");
        assert_eq!(foot(&straight, f64::NAN, 0.0, 1.0), None);
        let beyond = foot(&straight, 31.0, 0.5, 29.0).unwrap();
        assert_eq!(
            (beyond.s_m, beyond.offset_m),
            (31.0, 0.5),
            "the end itself can be overrun"
        );
    }
}
