//! The reference line of a road: the elements of its plan view, each evaluated from its own start.
//!
//! Lines, arcs and clothoids are evaluated along their arc length; polynomials along their parameter, which a table
//! of arc lengths finds. Where a polynomial's true length differs from the one that its element states, arc length
//! is stretched by the small rest, so that both ends are met.

use roxmltree::Node;

use super::xml::{cubic, number, text};
use crate::models::road::piece::Pose;

/// Elements that may stand beside a kind of geometry and mean nothing for it.
const ADDITIONAL: [&str; 3] = ["userData", "include", "dataQuality"];
/// Shortest element that is looked at, m: some tools write elements of no length.
const LEAST_LENGTH_M: f64 = 1e-6;
/// Most that elements may overlap or leave open along s, m: files are rounded.
const GAP_ALONG_M: f64 = 0.01;
/// Most that the end of an element may lie beside the start of the next, m.
const GAP_M: f64 = 0.1;
/// Distance between two entries of a table, m.
const TABLE_STEP_M: f64 = 0.25;
/// A polynomial's length over the one that its element states.
const LENGTH_RATIO: std::ops::RangeInclusive<f64> = 0.9..=1.1;

/// A point of the reference line.
#[derive(Debug, Clone, Copy)]
pub(super) struct Point {
    pub(super) pose: Pose,
    pub(super) curvature_1pm: f64,
    /// Change of the curvature with arc length, 1/m^2.
    pub(super) curvature_slope_1pm2: f64,
    /// Arc length per s; 1 but for polynomials whose stated length is not theirs.
    pub(super) stretch: f64,
}

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

/// `u` and `v` over a parameter from 0 on, with the arc length at equal steps of the parameter.
#[derive(Debug, Clone)]
pub(super) struct Polynomial {
    u: [f64; 4],
    v: [f64; 4],
    step: f64,
    arc_m: Vec<f64>,
    stretch: f64,
}

/// The reference line of a road.
///
/// # Errors
/// An element that is broken or unknown, or that does not begin where the one before ends.
pub(super) fn read(road: &str, plan_view: Node) -> Result<Vec<Geometry>, String> {
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
            return Err(format!("{place}: {what} = {value} m is negative"));
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
            return Err(format!("{place}: the first geometry has to begin at s = 0"));
        }
        line.push(Geometry {
            start_m,
            length_m,
            start,
            kind: kind(node, length_m, &place)?,
        });
    }
    if line.is_empty() {
        return Err(format!("road {road}: <planView> has no geometry"));
    }
    Ok(line)
}

fn joins(last: &Geometry, start_m: f64, start: Pose) -> Result<(), String> {
    let end_m = last.start_m + last.length_m;
    if (start_m - end_m).abs() > GAP_ALONG_M {
        return Err(format!(
            "the geometry before it begins at s = {} m and is {} m long, so it ends at {end_m} m",
            last.start_m, last.length_m
        ));
    }
    let end = last.at(end_m).pose;
    let gap_m = (start.x_m - end.x_m).hypot(start.y_m - end.y_m);
    if gap_m > GAP_M {
        return Err(format!(
            "it begins {gap_m:.2} m beside the end of the geometry before it"
        ));
    }
    Ok(())
}

fn kind(node: Node, length_m: f64, place: &str) -> Result<Kind, String> {
    let elements = node.children().filter(Node::is_element);
    let mut kinds = elements.filter(|child| !ADDITIONAL.contains(&child.tag_name().name()));
    let known = ["line", "arc", "spiral", "poly3", "paramPoly3"];
    let Some(shape) = kinds
        .clone()
        .find(|n| known.contains(&n.tag_name().name()))
        .or(kinds.next())
    else {
        return Err(format!(
            "{place}: it has no kind of geometry inside (line, arc, spiral, poly3, paramPoly3)"
        ));
    };
    match shape.tag_name().name() {
        "line" => Ok(clothoid([0.0; 2], length_m)),
        "arc" => Ok(clothoid([number(shape, "curvature", place)?; 2], length_m)),
        "spiral" => {
            let ends = [
                number(shape, "curvStart", place)?,
                number(shape, "curvEnd", place)?,
            ];
            Ok(clothoid(ends, length_m))
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
                    return Err(format!(
                        "{place}: pRange=\"{other}\" of <paramPoly3> is neither arcLength nor normalized"
                    ));
                }
            };
            let (u, v) = (cubic(shape, "U", place)?, cubic(shape, "V", place)?);
            Polynomial::new(u, v, end, length_m, place).map(Kind::Polynomial)
        }
        unknown => Err(format!(
            "{place}: <{unknown}> is not supported; line, arc, spiral, poly3 and paramPoly3 are"
        )),
    }
}

fn clothoid(curvature_1pm: [f64; 2], length_m: f64) -> Kind {
    let [start, end] = curvature_1pm;
    // Short enough for the quadrature: a twentieth of a radian a step.
    let turn = start.abs().max(end.abs()) * length_m;
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
    Kind::Clothoid {
        curvature_1pm,
        step_m,
        table,
    }
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

impl Geometry {
    /// The point at an s of the road. Meant for s of this element; beyond it the curve is continued.
    pub(super) fn at(&self, s_m: f64) -> Point {
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
                Point {
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
    fn of_length(v: [f64; 4], length_m: f64, place: &str) -> Result<Self, String> {
        let u = [0.0, 1.0, 0.0, 0.0];
        // The arc is at least as long as u.
        let whole = Self::tabulated(u, v, length_m, length_m);
        let end = whole.parameter(length_m);
        Self::new(u, v, end, length_m, place)
    }

    fn new(u: [f64; 4], v: [f64; 4], end: f64, length_m: f64, place: &str) -> Result<Self, String> {
        let mut polynomial = Self::tabulated(u, v, end, length_m);
        let true_m = polynomial.arc_m[polynomial.arc_m.len() - 1];
        polynomial.stretch = true_m / length_m;
        if !LENGTH_RATIO.contains(&polynomial.stretch) {
            return Err(format!(
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

    fn at(&self, ds: f64) -> Point {
        let p = self.parameter(ds * self.stretch);
        let ([u, u1, u2, u3], [v, v1, v2, v3]) = (derivatives(self.u, p), derivatives(self.v, p));
        let square = u1 * u1 + v1 * v1;
        let speed = square.sqrt();
        let cross = u1 * v2 - v1 * u2;
        let curvature_1pm = cross / (square * speed);
        let by_parameter =
            (u1 * v3 - v1 * u3) / (square * speed) - 3.0 * curvature_1pm * (u1 * u2 + v1 * v2) / square;
        Point {
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
