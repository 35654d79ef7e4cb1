//! What of a curve is drawn: what is in view, thinned to what the eye can tell apart.

type Point = (f64, f64);

/// The stretches of a curve that are to be drawn between two places: cut where a value is not finite, and with one
/// point beyond each end, so that the line runs to the border.
pub(super) fn in_view(points: &[Point], (left, right): (f64, f64)) -> Vec<&[Point]> {
    let mut pieces = Vec::new();
    for piece in points.split(|p| !(p.0.is_finite() && p.1.is_finite())) {
        let inside = |p: &Point| (left..=right).contains(&p.0);
        let crosses = |pair: &[Point]| pair[0].0.min(pair[1].0) <= right && pair[0].0.max(pair[1].0) >= left;
        let first = piece
            .windows(2)
            .position(crosses)
            .or_else(|| piece.iter().position(inside));
        let last = piece.windows(2).rposition(crosses).map(|i| i + 1);
        if let (Some(first), Some(last)) = (first, last.or_else(|| piece.iter().rposition(inside))) {
            pieces.push(&piece[first..=last]);
        }
    }
    pieces
}

/// `[place, low, high]` of an area, cut where a value is not finite.
pub(super) fn pieces(lows: &[Point], highs: &[f64]) -> Vec<Vec<[f64; 3]>> {
    let rows: Vec<_> = lows
        .iter()
        .zip(highs)
        .map(|((x, low), high)| [*x, *low, *high])
        .collect();
    let finite = |row: &[f64; 3]| row.iter().all(|v| v.is_finite());
    let pieces = rows.split(|row| !finite(row)).filter(|piece| piece.len() > 1);
    pieces.map(<[_]>::to_vec).collect()
}

/// An area of at most `most` rows: of each stretch the whole height, so that it never looks narrower than it is.
pub(super) fn thin_area(area: Vec<[f64; 3]>, most: usize) -> Vec<[f64; 3]> {
    if area.len() <= most {
        return area;
    }
    let last = area.last().copied();
    let widest = |stretch: &[[f64; 3]]| {
        let low = stretch.iter().map(|row| row[1]).fold(f64::INFINITY, f64::min);
        let high = stretch.iter().map(|row| row[2]).fold(f64::NEG_INFINITY, f64::max);
        [stretch[0][0], low, high]
    };
    area.chunks(area.len().div_ceil(most - 1))
        .map(widest)
        .chain(last)
        .collect()
}

/// Length of a path.
pub(super) fn length(path: &[Point]) -> f64 {
    path.windows(2)
        .map(|p| f64::hypot(p[1].0 - p[0].0, p[1].1 - p[0].1))
        .sum()
}

/// At most `most` (4 or more) of the points: both ends, and the lowest and highest of every stretch between, so
/// that no peak is lost.
pub(crate) fn thin(points: &[Point], most: usize) -> Vec<Point> {
    if points.len() <= most {
        return points.to_vec();
    }
    let inner = &points[1..points.len() - 1];
    let stretches = (most - 2) / 2;
    let mut thinned = vec![points[0]];
    for i in 0..stretches {
        let stretch = &inner[inner.len() * i / stretches..inner.len() * (i + 1) / stretches];
        let by_y = |a: &usize, b: &usize| stretch[*a].1.total_cmp(&stretch[*b].1);
        let lowest = (0..stretch.len()).min_by(by_y);
        let highest = (0..stretch.len()).max_by(by_y);
        if let (Some(lowest), Some(highest)) = (lowest, highest) {
            thinned.push(stretch[lowest.min(highest)]);
            if lowest != highest {
                thinned.push(stretch[lowest.max(highest)]);
            }
        }
    }
    thinned.push(points[points.len() - 1]);
    thinned
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
    fn a_curve_runs_to_the_border_and_no_further() {
        let points = [(0.0, 5.0), (1.0, 6.0), (2.0, 7.0), (3.0, 8.0), (4.0, 9.0)];
        assert_eq!(in_view(&points, (1.5, 2.5)), [&points[1..4]]);
        assert_eq!(
            in_view(&points, (1.2, 1.8)),
            [&points[1..3]],
            "no point lies within"
        );
        assert!(in_view(&points, (5.0, 6.0)).is_empty());
        assert_eq!(in_view(&points[..1], (0.0, 1.0)), [&points[..1]]);
    }

    #[test]
    fn a_curve_breaks_where_it_is_not_a_number() {
        let points = [(0.0, 0.1), (0.1, 0.2), (0.2, f64::NAN), (0.3, 0.4), (0.4, 0.5)];
        assert_eq!(in_view(&points, (0.0, 1.0)), [&points[..2], &points[3..]]);
        let highs = [1.0, f64::INFINITY, 1.0, 1.0, 1.0];
        assert_eq!(pieces(&points, &highs), [vec![[0.3, 0.4, 1.0], [0.4, 0.5, 1.0]]]);
    }

    #[test]
    fn a_thinned_area_holds_the_whole_one() {
        let area: Vec<_> = (0..1000)
            .map(f64::from)
            .map(|x| [x, -x.sin(), 2.0 + x.cos()])
            .collect();
        let thinned = thin_area(area.clone(), 60);
        assert!(thinned.len() <= 60 && thinned[0][0] == 0.0 && thinned[thinned.len() - 1] == area[999]);
        for [x, low, high] in &area[..999] {
            let held = thinned.iter().rev().find(|row| row[0] <= *x).unwrap();
            assert!(held[1] <= *low && held[2] >= *high);
        }
        assert_eq!(thin_area(area[..60].to_vec(), 60), &area[..60]);
    }

    #[test]
    fn thinning_keeps_ends_order_and_every_peak() {
        // One spike up and one down in 10,000 flat samples.
        let mut points: Vec<Point> = (0..10_000).map(|i| (f64::from(i), 0.0)).collect();
        points[1234].1 = 7.0;
        points[8765].1 = -7.0;
        let thinned = thin(&points, 200);
        assert!(thinned.len() <= 200, "{}", thinned.len());
        assert_eq!(
            (thinned[0], thinned[thinned.len() - 1]),
            (points[0], points[9999])
        );
        assert!(thinned.contains(&(1234.0, 7.0)) && thinned.contains(&(8765.0, -7.0)));
        assert!(thinned.windows(2).all(|p| p[0].0 < p[1].0));
        assert_eq!(thin(&points[..200], 200), &points[..200]);
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
