//! The centre of a lane in a lane section, as fine pieces.
//!
//! The centre lies beside the reference line by t = laneOffset + the widths of the lanes between + half of its own,
//! measured on the superelevated road: its plan is t*cos(superelevation). As t changes along the road, the centre
//! has another heading, curvature and length than the reference line; all three follow from t and its two
//! derivatives.

use super::error::{RoadError, refuse};
use super::geometry::Geometry;
use super::profile::{Cubic, Profile};
use super::road::{Road, Section};
use crate::Segment;
use crate::centreline::quadrature;
use crate::piece::{Piece, Pose};

/// Longest piece, m.
const MAX_PIECE_M: f64 = 0.5;
/// Largest turn in a piece, rad; `centreline` has as much.
const MAX_TURN_RAD: f64 = 0.005;
/// The turn is looked at anew after so many metres.
const BLOCK_M: f64 = 2.0;
/// Widths below zero by less than this are rounding, m.
const ROUNDING_M: f64 = 0.01;
/// Two places along s that are the same, m.
const SAME_M: f64 = 1e-9;
/// The lane's centre may not come nearer to the centre of curvature than this share of the radius.
const LEAST_SHARE: f64 = 0.02;
/// Most that a centre may turn in a block, rad.
const MOST_TURN_RAD: f64 = 50.0;
/// Most pieces of a course: 200 km have 400,000 where they are straight.
pub(super) const MOST_PIECES: usize = 1_000_000;

/// A lane's centre along s.
#[derive(Debug, Default)]
pub(super) struct Stretch {
    pub(super) pieces: Vec<Piece>,
    /// One an element of the reference line.
    pub(super) segments: Vec<Segment>,
}

/// All polynomials that are valid between two breakpoints.
struct Interval<'r> {
    road: &'r Road<'r>,
    geometry: &'r Geometry,
    /// 1 on the left side, -1 on the right.
    sign: f64,
    lane_offset: Cubic,
    inner: Vec<Cubic>,
    own: Cubic,
    superelevation: Cubic,
    elevation: Cubic,
    is_level: bool,
    middle_m: f64,
}

/// A point of the lane's centre.
struct CentrePoint {
    pose: Pose,
    curvature_1pm: f64,
    /// Its arc length per s.
    speed: f64,
    bank_rad: f64,
    grade: f64,
    width_m: f64,
}

/// # Errors
/// What is broken or missing.
pub(super) fn stretch(road: &Road, section: &Section, id: i32) -> Result<Stretch, RoadError> {
    let sign = if id < 0 { -1 } else { 1 };
    let widths = |id: i32| section.need(road.id, id)?.widths(road.id, section);
    let inner: Vec<Profile> = (1..id.abs())
        .map(|n| widths(sign * n))
        .collect::<Result<_, _>>()?;
    let own = widths(id)?;
    let is_level = section.need(road.id, id)?.is_level();

    let mut stretch = Stretch::default();
    let mut last_geometry = None;
    for [from_m, to_m] in breakpoints(road, section, inner.iter().chain([&own])) {
        let middle_m = 0.5 * (from_m + to_m);
        let after = road.line.partition_point(|g| g.start_m <= middle_m);
        let index = after.max(1) - 1;
        let interval = Interval {
            road,
            geometry: &road.line[index],
            sign: f64::from(sign),
            lane_offset: road.lane_offset.piece_at(middle_m),
            inner: inner.iter().map(|profile| profile.piece_at(middle_m)).collect(),
            own: own.piece_at(middle_m),
            superelevation: road.superelevation.piece_at(middle_m),
            elevation: road.elevation.piece_at(middle_m),
            is_level,
            middle_m,
        };
        let first = stretch.pieces.len();
        let ends = interval
            .cut(from_m, to_m, &mut stretch.pieces)
            .map_err(|e| format!("road {}: lane {id} {e}", road.id))?;
        let length_m: f64 = stretch.pieces[first..].iter().map(|piece| piece.length_m).sum();
        let [start, end] = ends;
        match stretch.segments.last_mut() {
            Some(segment) if last_geometry == Some(index) => {
                segment.length_m += length_m;
                segment.curvature_end_1pm = end.curvature_1pm;
                segment.bank_rad[1] = end.bank_rad;
                segment.grade[1] = end.grade;
            }
            _ => stretch.segments.push(Segment {
                length_m,
                curvature_start_1pm: start.curvature_1pm,
                curvature_end_1pm: end.curvature_1pm,
                bank_rad: [start.bank_rad, end.bank_rad],
                grade: [start.grade, end.grade],
            }),
        }
        last_geometry = Some(index);
    }
    Ok(stretch)
}

/// The stretches of a section in which every polynomial stays the same.
fn breakpoints<'p>(
    road: &'p Road,
    section: &Section,
    widths: impl Iterator<Item = &'p Profile>,
) -> Vec<[f64; 2]> {
    let [left, right] = &road.crossfall;
    let profiles = [
        &road.lane_offset,
        &road.superelevation,
        &road.elevation,
        left,
        right,
    ];
    let mut places: Vec<f64> = profiles
        .into_iter()
        .chain(widths)
        .flat_map(Profile::starts_m)
        .collect();
    places.extend(road.line.iter().map(|geometry| geometry.start_m));
    places.extend(road.shapes.iter().map(|(s_m, _)| *s_m));
    let (from_m, to_m) = (section.start_m, section.end_m);
    places.retain(|s_m| *s_m > from_m + SAME_M && *s_m < to_m - SAME_M);
    places.extend([from_m, to_m]);
    places.sort_by(f64::total_cmp);
    places.dedup_by(|b, a| *b - *a < SAME_M);
    places.windows(2).map(|pair| [pair[0], pair[1]]).collect()
}

impl Interval<'_> {
    fn at(&self, s_m: f64) -> Result<CentrePoint, RoadError> {
        let reference = self.geometry.at(s_m);
        let own = self.own.at(s_m);
        let mut t = self.lane_offset.at(s_m);
        for cubic in &self.inner {
            add(&mut t, self.sign, cubic.at(s_m));
        }
        add(&mut t, 0.5 * self.sign, own);
        if own[0] < -ROUNDING_M {
            return refuse(format!(
                "has a negative width of {:.3} m at s = {s_m:.2} m",
                own[0]
            ));
        }
        let [roll, roll1, roll2] = self.superelevation.at(s_m);
        let (sin, cos) = roll.sin_cos();
        let stretch = reference.stretch;
        let plan = t[0] * cos;
        let plan1 = (t[1] * cos - t[0] * sin * roll1) / stretch;
        let plan2 = (t[2] * cos - 2.0 * t[1] * sin * roll1 - t[0] * (cos * roll1 * roll1 + sin * roll2))
            / (stretch * stretch);

        let (k, k1) = (reference.curvature_1pm, reference.curvature_slope_1pm2);
        let along = 1.0 - k * plan;
        if along < LEAST_SHARE {
            let radius = 1.0 / k.abs();
            return refuse(format!(
                "lies {:.2} m beside the reference line at s = {s_m:.2} m, where the radius is {radius:.2} m: \
                 its centre folds back",
                plan.abs()
            ));
        }
        let along1 = -k1 * plan - k * plan1;
        let square = along * along + plan1 * plan1;
        let speed = square.sqrt();
        let (heading_sin, heading_cos) = reference.pose.heading_rad.sin_cos();
        let bank = if self.is_level {
            0.0
        } else {
            roll + self.road.cross_slope(s_m, self.middle_m, t[0])
        };
        Ok(CentrePoint {
            pose: Pose {
                x_m: reference.pose.x_m - plan * heading_sin,
                y_m: reference.pose.y_m + plan * heading_cos,
                heading_rad: reference.pose.heading_rad + plan1.atan2(along),
            },
            curvature_1pm: (k + (plan2 * along - along1 * plan1) / square) / speed,
            speed: speed * stretch,
            bank_rad: bank,
            grade: self.elevation.at(s_m)[1] / (speed * stretch),
            width_m: own[0].max(0.0),
        })
    }

    /// Adds the pieces from one place to another; returns the points there.
    fn cut(&self, from_m: f64, to_m: f64, pieces: &mut Vec<Piece>) -> Result<[CentrePoint; 2], RoadError> {
        let first = self.at(from_m)?;
        let blocks = ((to_m - from_m) / BLOCK_M).ceil().max(1.0);
        let block_m = (to_m - from_m) / blocks;
        let mut last = self.at(from_m)?;
        for block in 0..blocks as usize {
            let start_m = from_m + block as f64 * block_m;
            let inside = [0.5, 1.0].map(|share| self.at(start_m + share * block_m));
            let [middle, end] = inside;
            let (middle, end) = (middle?, end?);
            let points = [&last, &middle, &end];
            let sharpest = points.iter().map(|p| p.curvature_1pm.abs()).fold(0.0, f64::max);
            let longest = points.iter().map(|p| p.speed).fold(0.0, f64::max) * block_m;
            let turns = longest * sharpest / MAX_TURN_RAD;
            if longest * sharpest > MOST_TURN_RAD || longest > MOST_TURN_RAD * BLOCK_M {
                return refuse(format!(
                    "cannot be followed at s = {start_m:.2} m: it turns as no road does"
                ));
            }
            let count = (longest / MAX_PIECE_M).max(turns).ceil().max(1.0);
            let step_m = block_m / count;
            if pieces.len() as f64 + count > MOST_PIECES as f64 {
                return refuse(format!(
                    "has more than {MOST_PIECES} pieces at s = {start_m:.2} m"
                ));
            }
            for i in 0..count as usize {
                let at_m = start_m + i as f64 * step_m;
                let next = self.at(at_m + step_m)?;
                pieces.push(self.piece(at_m, step_m, &last, &next)?);
                last = next;
            }
        }
        Ok([first, last])
    }

    fn piece(
        &self,
        from_m: f64,
        step_m: f64,
        start: &CentrePoint,
        end: &CentrePoint,
    ) -> Result<Piece, RoadError> {
        let length_m = quadrature(step_m, |ds| {
            (self.at(from_m + ds).map_or(f64::NAN, |p| p.speed), 0.0)
        })
        .0;
        if length_m.is_nan() {
            return refuse(format!("cannot be followed at s = {from_m:.2} m"));
        }
        // Half of the arc length lies a little beside half of the step where the speed changes.
        let middle_m = from_m + 0.5 * step_m;
        let shift_m = (end.speed - start.speed) * step_m / (8.0 * start.speed);
        let middle = self.at(middle_m + shift_m)?;
        Ok(Piece {
            length_m,
            middle: middle.pose,
            curvature_1pm: middle.curvature_1pm,
            curvature_slope_1pm2: (end.curvature_1pm - start.curvature_1pm) / length_m,
            bank_rad: [start.bank_rad, end.bank_rad],
            grade: [start.grade, end.grade],
            width_m: [start.width_m, end.width_m],
        })
    }
}

fn add(sum: &mut [f64; 3], factor: f64, value: [f64; 3]) {
    for (slot, part) in sum.iter_mut().zip(value) {
        *slot += factor * part;
    }
}

impl Stretch {
    /// The stretch that is met when this one is driven against its s.
    pub(super) fn reversed(mut self) -> Self {
        let swapped = |[start, end]: [f64; 2], sign: f64| [sign * end, sign * start];
        self.pieces.reverse();
        for piece in &mut self.pieces {
            piece.middle.heading_rad += std::f64::consts::PI;
            piece.curvature_1pm = -piece.curvature_1pm;
            piece.bank_rad = swapped(piece.bank_rad, -1.0);
            piece.grade = swapped(piece.grade, -1.0);
            piece.width_m = swapped(piece.width_m, 1.0);
        }
        self.segments.reverse();
        for segment in &mut self.segments {
            let ends = [segment.curvature_start_1pm, segment.curvature_end_1pm];
            [segment.curvature_start_1pm, segment.curvature_end_1pm] = swapped(ends, -1.0);
            segment.bank_rad = swapped(segment.bank_rad, -1.0);
            segment.grade = swapped(segment.grade, -1.0);
        }
        self
    }
}
