//! What of a curve is drawn: cut at the limits, and thinned to what the eye can tell apart.

type Point = (f64, f64);

/// The stretches of a curve within the limits, ends on the border included; cut where a value is not finite.
pub(super) fn clip(points: &[Point], x: (f64, f64), y: (f64, f64)) -> Vec<Vec<Point>> {
    let mut pieces: Vec<Vec<Point>> = Vec::new();
    let mut joined = false;
    for pair in points.windows(2) {
        let Some((from, to)) = clip_segment(pair[0], pair[1], x, y) else {
            joined = false;
            continue;
        };
        match pieces.last_mut() {
            Some(piece) if joined => piece.push(to),
            _ => pieces.push(vec![from, to]),
        }
        joined = to == pair[1];
    }
    pieces
}

/// The part of a segment within the limits (Liang and Barsky 1984).
fn clip_segment(a: Point, b: Point, x: (f64, f64), y: (f64, f64)) -> Option<(Point, Point)> {
    if ![a.0, a.1, b.0, b.1].iter().all(|v| v.is_finite()) {
        return None;
    }
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for (step, room) in [
        (-dx, a.0 - x.0),
        (dx, x.1 - a.0),
        (-dy, a.1 - y.0),
        (dy, y.1 - a.1),
    ] {
        if step == 0.0 {
            if room < 0.0 {
                return None;
            }
        } else if step < 0.0 {
            enter = enter.max(room / step);
        } else {
            leave = leave.min(room / step);
        }
    }
    let at = |t: f64| (a.0 + t * dx, a.1 + t * dy);
    (enter <= leave).then(|| {
        (
            if enter > 0.0 { at(enter) } else { a },
            if leave < 1.0 { at(leave) } else { b },
        )
    })
}

/// At most `most` (4 or more) of the points: both ends, and the lowest and highest of every stretch between, so
/// that no peak is lost.
pub(super) fn thin(points: &[Point], most: usize) -> Vec<Point> {
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
/// Peucker 1973). Long straight pieces also draw smoother than many short ones on whole units.
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

    const UNIT: (f64, f64) = (0.0, 1.0);

    #[test]
    fn a_curve_is_cut_at_the_border() {
        let pieces = clip(&[(0.0, 0.5), (0.5, 1.5), (1.0, 0.5), (2.0, 0.5)], UNIT, UNIT);
        assert_eq!(
            pieces,
            [
                vec![(0.0, 0.5), (0.25, 1.0)],
                vec![(0.75, 1.0), (1.0, 0.5), (1.0, 0.5)]
            ]
        );
    }

    #[test]
    fn a_curve_breaks_where_it_is_not_a_number() {
        let pieces = clip(
            &[(0.0, 0.1), (0.1, 0.2), (0.2, f64::NAN), (0.3, 0.4), (0.4, 0.5)],
            UNIT,
            UNIT,
        );
        assert_eq!(
            pieces,
            [vec![(0.0, 0.1), (0.1, 0.2)], vec![(0.3, 0.4), (0.4, 0.5)]]
        );
    }

    #[test]
    fn a_segment_that_crosses_the_whole_view_is_kept_and_one_beside_it_dropped() {
        assert_eq!(
            clip(&[(-1.0, 0.5), (3.0, 0.5)], UNIT, UNIT),
            [vec![(0.0, 0.5), (1.0, 0.5)]]
        );
        assert!(clip(&[(-1.0, 0.5), (0.5, 2.5)], UNIT, UNIT).is_empty());
        assert!(clip(&[(0.0, 2.0), (1.0, 2.0)], UNIT, UNIT).is_empty());
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
