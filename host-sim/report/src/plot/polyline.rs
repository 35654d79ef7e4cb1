//! What of a thinned curve is drawn: its pieces, without points that lie on the line between others.

type Point = (f64, f64);

/// The pieces of a curve, which is cut where a value is not finite.
pub(super) fn pieces(points: &[Point]) -> impl Iterator<Item = &[Point]> {
    let pieces = points.split(|p| !(p.0.is_finite() && p.1.is_finite()));
    pieces.filter(|piece| !piece.is_empty())
}

/// `[place, low, high]` of an area, cut where a value is not finite.
pub(super) fn pieces_of_area(lows: &[Point], highs: &[f64]) -> Vec<Vec<[f64; 3]>> {
    let rows: Vec<_> = lows
        .iter()
        .zip(highs)
        .map(|((x, low), high)| [*x, *low, *high])
        .collect();
    let finite = |row: &[f64; 3]| row.iter().all(|v| v.is_finite());
    let pieces = rows.split(|row| !finite(row)).filter(|piece| piece.len() > 1);
    pieces.map(<[_]>::to_vec).collect()
}

/// Length of a path.
pub(super) fn length(path: &[Point]) -> f64 {
    path.windows(2)
        .map(|p| f64::hypot(p[1].0 - p[0].0, p[1].1 - p[0].1))
        .sum()
}

/// The points without those that lie within `tolerance` of the curve through the rest (Ramer 1972; Douglas and
/// Peucker 1973). It keeps the SVG small.
pub(super) fn simplify(points: &[Point], tolerance: f64) -> Vec<Point> {
    let mut kept: Vec<Point> = points.first().copied().into_iter().collect();
    let mut stretches = vec![(0, points.len().saturating_sub(1))];
    while let Some((from, to)) = stretches.pop() {
        let far = (from + 1..to).map(|i| (i, distance(points[i], points[from], points[to])));
        match far.max_by(|a, b| a.1.total_cmp(&b.1)) {
            // The later half waits below the earlier one, so that points come out in order.
            Some((i, off)) if off > tolerance => stretches.extend([(i, to), (from, i)]),
            _ if to > from => kept.push(points[to]),
            _ => {}
        }
    }
    kept
}

/// Distance of `p` from the segment from `a` to `b`.
fn distance(p: Point, a: Point, b: Point) -> f64 {
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    let length_squared = dx * dx + dy * dy;
    let along = ((p.0 - a.0) * dx + (p.1 - a.1) * dy) / length_squared;
    let t = if length_squared > 0.0 {
        along.clamp(0.0, 1.0)
    } else {
        0.0
    };
    f64::hypot(p.0 - a.0 - t * dx, p.1 - a.1 - t * dy)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_breaks_where_it_is_not_a_number() {
        let points = [(0.0, 0.1), (0.1, 0.2), (0.2, f64::NAN), (0.3, 0.4), (0.4, 0.5)];
        assert!(pieces(&points).eq([&points[..2], &points[3..]]));
        let highs = [1.0, f64::INFINITY, 1.0, 1.0, 1.0];
        assert_eq!(
            pieces_of_area(&points, &highs),
            [vec![[0.3, 0.4, 1.0], [0.4, 0.5, 1.0]]]
        );
    }

    #[test]
    fn simplifying_drops_what_lies_on_a_line_and_nothing_else() {
        let corner = [
            (0.0, 0.0),
            (1.0, 0.1),
            (2.0, 0.0),
            (3.0, 3.0),
            (4.0, 6.0),
            (4.0, 6.0),
            (4.0, 0.0),
        ];
        assert_eq!(
            simplify(&corner, 0.2),
            [(0.0, 0.0), (2.0, 0.0), (4.0, 6.0), (4.0, 0.0)]
        );
        assert_eq!(simplify(&corner[..3], 0.05), &corner[..3]);
        assert_eq!(simplify(&corner[..1], 0.2), &corner[..1]);
        // There and back again: the turning point is off the segment, though on its line.
        assert_eq!(simplify(&[(0.0, 0.0), (5.0, 0.0), (1.0, 0.0)], 0.2).len(), 3);
    }
}
