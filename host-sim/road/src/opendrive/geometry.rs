//! The reference line of a road: the elements of its plan view, each evaluated from its own start.
//!
//! Lines, arcs and clothoids are evaluated along their arc length here, polynomials along their parameter in
//! `polynomial`.

use roxmltree::Node;

use super::error::{RoadError, refuse};
use super::polynomial::{CurvePoint, Polynomial};
use super::xml::{cubic, number, text};
use crate::centreline::quadrature;
use crate::piece::MAX_COURSE_M;
use crate::piece::Pose;

/// Elements that may stand beside a kind of geometry and mean nothing for it.
const ADDITIONAL: [&str; 3] = ["userData", "include", "dataQuality"];
/// Shortest element that is looked at, m: some tools write elements of no length.
const LEAST_LENGTH_M: f64 = 1e-6;
/// Most that elements may overlap or leave open along s, m: files are rounded.
const GAP_ALONG_M: f64 = 0.01;
/// Most that the end of an element may lie beside the start of the next, m.
const GAP_M: f64 = 0.1;
/// Most that an element may turn, rad: a spiral of a hundred and sixty circles.
const MOST_TURN_RAD: f64 = 1000.0;

/// An element of the plan view.
#[derive(Debug, Clone)]
pub(super) struct Geometry {
    pub(super) start_m: f64,
    pub(super) length_m: f64,
    pub(super) start: Pose,
    pub(super) kind: Kind,
}

#[derive(Debug, Clone)]
pub(super) enum Kind {
    /// Curvature linear in arc length: straight, arc, clothoid. Poses in the element's frame every `step_m`.
    Clothoid {
        curvature_1pm: [f64; 2],
        step_m: f64,
        table: Vec<Pose>,
    },
    /// Cubic polynomials of a parameter.
    Polynomial(Polynomial),
}

/// The reference line of a road.
///
/// # Errors
/// An element that is broken or unknown, or that does not begin where the one before ends.
pub(super) fn read(road: &str, plan_view: Node) -> Result<Vec<Geometry>, RoadError> {
    let mut line: Vec<Geometry> = Vec::new();
    for node in plan_view.children().filter(|n| n.tag_name().name() == "geometry") {
        let start_m = number(node, "s", &format!("road {road}: planView"))?;
        let place = format!("road {road}: geometry at s = {start_m} m");
        let length_m = number(node, "length", &place)?;
        if length_m < 0.0 || start_m < 0.0 {
            let (what, value) = if length_m < 0.0 {
                ("length", length_m)
            } else {
                ("s", start_m)
            };
            return refuse(format!("{place}: {what} = {value} m is negative"));
        }
        if start_m + length_m > MAX_COURSE_M {
            return refuse(format!(
                "{place}: length = {length_m} m makes the road longer than {MAX_COURSE_M} m"
            ));
        }
        if length_m < LEAST_LENGTH_M {
            continue;
        }
        let start = Pose {
            x_m: number(node, "x", &place)?,
            y_m: number(node, "y", &place)?,
            heading_rad: number(node, "hdg", &place)?,
        };
        if let Some(last) = line.last() {
            joins(last, start_m, start).map_err(|e| format!("{place}: {e}"))?;
        } else if start_m > GAP_ALONG_M {
            return refuse(format!("{place}: the first geometry has to begin at s = 0"));
        }
        line.push(Geometry {
            start_m,
            length_m,
            start,
            kind: kind(node, length_m, &place)?,
        });
    }
    if line.is_empty() {
        return refuse(format!("road {road}: <planView> has no geometry"));
    }
    Ok(line)
}

fn joins(last: &Geometry, start_m: f64, start: Pose) -> Result<(), RoadError> {
    let end_m = last.start_m + last.length_m;
    if (start_m - end_m).abs() > GAP_ALONG_M {
        return refuse(format!(
            "the geometry before it begins at s = {} m and is {} m long, so it ends at {end_m} m",
            last.start_m, last.length_m
        ));
    }
    let end = last.at(end_m).pose;
    let gap_m = (start.x_m - end.x_m).hypot(start.y_m - end.y_m);
    if gap_m > GAP_M {
        return refuse(format!(
            "it begins {gap_m:.2} m beside the end of the geometry before it"
        ));
    }
    Ok(())
}

fn kind(node: Node, length_m: f64, place: &str) -> Result<Kind, RoadError> {
    let elements = node.children().filter(Node::is_element);
    let mut kinds = elements.filter(|child| !ADDITIONAL.contains(&child.tag_name().name()));
    let known = ["line", "arc", "spiral", "poly3", "paramPoly3"];
    let Some(shape) = kinds
        .clone()
        .find(|n| known.contains(&n.tag_name().name()))
        .or(kinds.next())
    else {
        return refuse(format!(
            "{place}: it has no kind of geometry inside (line, arc, spiral, poly3, paramPoly3)"
        ));
    };
    match shape.tag_name().name() {
        "line" => clothoid([0.0; 2], length_m, place),
        "arc" => clothoid([number(shape, "curvature", place)?; 2], length_m, place),
        "spiral" => {
            let ends = [
                number(shape, "curvStart", place)?,
                number(shape, "curvEnd", place)?,
            ];
            clothoid(ends, length_m, place)
        }
        "poly3" => {
            let v = cubic(shape, "", place)?;
            Polynomial::of_length(v, length_m, place).map(Kind::Polynomial)
        }
        "paramPoly3" => {
            let end = match text(shape, "pRange") {
                Some("arcLength") => length_m,
                Some("normalized") | None => 1.0,
                Some(other) => {
                    return refuse(format!(
                        "{place}: pRange=\"{other}\" of <paramPoly3> is neither arcLength nor normalized"
                    ));
                }
            };
            let (u, v) = (cubic(shape, "U", place)?, cubic(shape, "V", place)?);
            Polynomial::new(u, v, end, length_m, place).map(Kind::Polynomial)
        }
        unknown => refuse(format!(
            "{place}: <{unknown}> is not supported; line, arc, spiral, poly3 and paramPoly3 are"
        )),
    }
}

fn clothoid(curvature_1pm: [f64; 2], length_m: f64, place: &str) -> Result<Kind, RoadError> {
    let [start, end] = curvature_1pm;
    // Short enough for the quadrature: a twentieth of a radian a step.
    let turn = start.abs().max(end.abs()) * length_m;
    if turn > MOST_TURN_RAD {
        return refuse(format!(
            "{place}: with a curvature of {start} to {end} 1/m it turns by up to {turn:.0} rad, more than {MOST_TURN_RAD}"
        ));
    }
    let count = if start == end {
        1.0
    } else {
        (length_m / 2.0).max(turn / 0.05).ceil().max(1.0)
    };
    let step_m = length_m / count;
    let slope = (end - start) / length_m;
    let mut table = vec![Pose::default()];
    for i in 0..count as usize {
        let last = table[i];
        let curvature = start + slope * (i as f64 * step_m);
        table.push(last.of_local(along(curvature, slope, step_m)));
    }
    Ok(Kind::Clothoid {
        curvature_1pm,
        step_m,
        table,
    })
}

/// The end of a short clothoid that begins at the origin, along x; any arc exactly.
fn along(curvature: f64, slope: f64, length_m: f64) -> Pose {
    let heading_rad = length_m * (curvature + 0.5 * slope * length_m);
    if slope == 0.0 {
        // sin(x)/x without its hole at zero.
        let half = 0.5 * heading_rad;
        let chord = if half.abs() < 1e-4 {
            1.0 - half * half / 6.0
        } else {
            half.sin() / half
        };
        return Pose {
            x_m: length_m * chord * half.cos(),
            y_m: length_m * chord * half.sin(),
            heading_rad,
        };
    }
    let (x_m, y_m) = quadrature(length_m, |s| {
        let (sin, cos) = (s * (curvature + 0.5 * slope * s)).sin_cos();
        (cos, sin)
    });
    Pose {
        x_m,
        y_m,
        heading_rad,
    }
}

impl Geometry {
    /// The point at an s of the road. Meant for s of this element; beyond it the curve is continued.
    pub(super) fn at(&self, s_m: f64) -> CurvePoint {
        let ds = s_m - self.start_m;
        match &self.kind {
            Kind::Clothoid {
                curvature_1pm: [start, end],
                step_m,
                table,
            } => {
                let slope = (end - start) / self.length_m;
                let index = ((ds / step_m).max(0.0) as usize).min(table.len() - 2);
                let from = index as f64 * step_m;
                let local = table[index].of_local(along(start + slope * from, slope, ds - from));
                CurvePoint {
                    pose: self.start.of_local(local),
                    curvature_1pm: start + slope * ds,
                    curvature_slope_1pm2: slope,
                    stretch: 1.0,
                }
            }
            Kind::Polynomial(polynomial) => {
                let mut point = polynomial.at(ds);
                point.pose = self.start.of_local(point.pose);
                point
            }
        }
    }
}
