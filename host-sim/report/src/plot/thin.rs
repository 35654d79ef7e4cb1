//! A curve with no more points than a screen can show: of each column of pixels the lowest and the highest.
//!
//! Every figure passes through [`Figure::thinned`] before it is drawn, so neither its SVG nor the data of its live chart grow with
//! the length of a drive. A peak is never lost, a line begins and ends where its data do, and a gap stays one: at most one gap
//! begins in a column.

use std::ops::Range;

use super::{Figure, Mark};

type Point = (f64, f64);

/// Columns that a figure is divided into: one for each point of the page's width.
const COLUMNS: f64 = 900.0;

/// Neighbouring points of one column, with nothing missing between this column and what is before it.
struct Stretch {
    rows: Range<usize>,
    column: i64,
    /// Whether a gap is before it.
    is_first: bool,
    /// Whether the gap before it is in the same column.
    in_gap: bool,
}

impl Stretch {
    fn is_out(&self) -> bool {
        self.column < 0 || self.column as f64 >= COLUMNS
    }
}

impl Figure {
    /// The figure with as many points as can be told apart. What is each for itself, a dot or a row, stays.
    #[must_use]
    pub fn thinned(mut self) -> Self {
        if !self.rows.is_empty() {
            return self;
        }
        let limits = self.x_limits();
        for series in self.panels.iter_mut().flat_map(|panel| &mut panel.series) {
            match &mut series.mark {
                Mark::Line => series.points = line(&series.points, limits),
                Mark::Interval(upper) => (series.points, *upper) = area(&series.points, upper, limits),
                _ => {}
            }
        }
        self
    }
}

/// Points by columns; those left and right of the limits are a column each. A point that is not known belongs to none.
fn stretches(points: &[Point], limits: (f64, f64), is_known: impl Fn(usize) -> bool) -> Vec<Stretch> {
    let (left, right) = limits;
    let scale = COLUMNS / (right - left);
    let mut all: Vec<Stretch> = Vec::new();
    let mut after_gap = true;
    let mut row = 0;
    while row < points.len() {
        let x = points[row].0;
        if !x.is_finite() || !is_known(row) {
            after_gap = true;
        } else {
            // Beyond the limits it does not matter how far.
            let column = ((x - left) * scale).floor().clamp(-1.0, COLUMNS) as i64;
            match all.last_mut() {
                Some(last) if last.column == column && (!after_gap || last.in_gap) => last.rows.end = row + 1,
                last => {
                    let in_gap = after_gap && last.is_some_and(|last| last.column == column);
                    all.push(Stretch {
                        rows: row..row + 1,
                        column,
                        is_first: after_gap,
                        in_gap,
                    });
                }
            }
            after_gap = false;
        }
        row += 1;
    }
    all
}

/// A line with the lowest and the highest point of each column, and both ends of each piece; a value that is no number between two pieces. Of
/// what is out of view the nearest points, so that the line runs to the border.
fn line(points: &[Point], limits: (f64, f64)) -> Vec<Point> {
    let all = stretches(points, limits, |row| points[row].1.is_finite());
    let mut kept = Vec::new();
    for (number, stretch) in all.iter().enumerate() {
        let (first, last) = (stretch.rows.start, stretch.rows.end - 1);
        let (mut lowest, mut highest) = (first, first);
        for row in stretch.rows.clone() {
            // A comparison with what is no number is false.
            if points[row].1 < points[lowest].1 {
                lowest = row;
            }
            if points[row].1 > points[highest].1 {
                highest = row;
            }
        }
        if stretch.is_first && !kept.is_empty() {
            kept.push((points[first].0, f64::NAN));
        }
        let is_out = stretch.is_out();
        let ends_piece = all.get(number + 1).is_none_or(|next| next.is_first);
        let mut rows = [
            if is_out || stretch.is_first { first } else { lowest },
            if is_out { first } else { lowest },
            if is_out { last } else { highest },
            if is_out || ends_piece { last } else { highest },
        ];
        rows.sort_unstable();
        let mut before = None;
        for row in rows {
            if before != Some(row) {
                kept.push(points[row]);
            }
            before = Some(row);
        }
    }
    kept
}

/// An area with the whole height of each column, so that it never looks narrower than it is; a value that is no number between two pieces.
fn area(lows: &[Point], highs: &[f64], limits: (f64, f64)) -> (Vec<Point>, Vec<f64>) {
    let is_known = |row: usize| lows[row].1.is_finite() && highs.get(row).is_some_and(|v| v.is_finite());
    let all = stretches(lows, limits, is_known);
    let (mut kept_lows, mut kept_highs) = (Vec::new(), Vec::new());
    let mut push = |x: f64, low: f64, high: f64| {
        kept_lows.push((x, low));
        kept_highs.push(high);
    };
    for (number, stretch) in all.iter().enumerate() {
        let (first, last) = (stretch.rows.start, stretch.rows.end - 1);
        if stretch.is_first && number > 0 {
            push(lows[first].0, f64::NAN, f64::NAN);
        }
        let (mut low, mut high) = (lows[first].1, highs[first]);
        if !stretch.is_out() {
            for row in stretch.rows.clone().filter(|row| is_known(*row)) {
                low = low.min(lows[row].1);
                high = high.max(highs[row]);
            }
        }
        push(lows[first].0, low, high);
        let ends_piece = all.get(number + 1).is_none_or(|next| next.is_first);
        if last > first && (ends_piece || stretch.is_out()) {
            push(lows[last].0, lows[last].1, highs[last]);
        }
    }
    (kept_lows, kept_highs)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 900 columns over 0 to 900: one for each whole number.
    const VIEW: (f64, f64) = (0.0, 900.0);

    fn values(points: &[Point]) -> Vec<(f64, Option<f64>)> {
        points
            .iter()
            .map(|p| (p.0, Some(p.1).filter(|v| v.is_finite())))
            .collect()
    }

    #[test]
    fn a_long_line_keeps_its_ends_its_order_and_every_peak() {
        // One spike up and one down in 100,000 flat samples.
        let mut points: Vec<Point> = (0..100_000).map(|i| (f64::from(i) * 0.009, 0.0)).collect();
        points[12_345].1 = 7.0;
        points[87_654].1 = -7.0;
        let thinned = line(&points, VIEW);
        assert!(thinned.len() <= 1802, "{}", thinned.len());
        assert_eq!(
            (thinned[0], thinned[thinned.len() - 1]),
            (points[0], points[99_999])
        );
        assert!(thinned.contains(&points[12_345]) && thinned.contains(&points[87_654]));
        assert!(thinned.windows(2).all(|p| p[0].0 < p[1].0));
        assert_eq!(line(&thinned, VIEW), thinned, "there is nothing left to thin");
    }

    #[test]
    fn of_a_column_the_lowest_and_the_highest_are_kept_in_their_order() {
        let points = [
            (0.5, 0.0),
            (7.1, 1.0),
            (7.2, 9.0),
            (7.3, 2.0),
            (7.4, -3.0),
            (7.5, 1.0),
            (8.5, 4.0),
        ];
        assert_eq!(line(&points, VIEW), [points[0], points[2], points[4], points[6]]);
    }

    #[test]
    fn a_line_runs_to_the_border_and_no_further() {
        let points = [
            (-20.0, 5.0),
            (-10.0, 6.0),
            (1.0, 7.0),
            (905.0, 8.0),
            (906.0, 9.0),
            (990.0, 3.0),
        ];
        let seen = line(&points, VIEW);
        assert_eq!(seen, [points[0], points[1], points[2], points[3], points[5]]);
        assert_eq!(line(&points[..2], VIEW).len(), 2);
    }

    #[test]
    fn a_line_breaks_where_it_is_not_a_number_once_in_a_column() {
        let nan = f64::NAN;
        let points = [
            (1.1, 1.0),
            (1.2, nan),
            (1.3, 2.0),
            (1.4, nan),
            (1.5, 3.0),
            (2.5, nan),
            (3.5, 4.0),
        ];
        let expected = [
            (1.1, Some(1.0)),
            (1.3, None),
            (1.3, Some(2.0)),
            (1.5, Some(3.0)),
            (3.5, None),
            (3.5, Some(4.0)),
        ];
        assert_eq!(values(&line(&points, VIEW)), expected);
        assert!(line(&points[1..2], VIEW).is_empty());
        // A record of nothing but gaps is no longer than one without.
        let gaps: Vec<Point> = (0..100_000)
            .map(|i| (f64::from(i) * 0.009, if i % 2 == 0 { 1.0 } else { nan }))
            .collect();
        assert!(line(&gaps, VIEW).len() <= 5 * 900, "{}", line(&gaps, VIEW).len());
    }

    #[test]
    fn a_thinned_area_holds_the_whole_one() {
        let lows: Vec<Point> = (0..9000)
            .map(|i| f64::from(i) * 0.1)
            .map(|x| (x, -x.sin()))
            .collect();
        let highs: Vec<f64> = lows.iter().map(|(x, _)| 2.0 + x.cos()).collect();
        let (thin_lows, thin_highs) = area(&lows, &highs, VIEW);
        assert!(thin_lows.len() <= 901, "{}", thin_lows.len());
        for ((x, low), high) in lows.iter().zip(&highs) {
            let held = thin_lows
                .iter()
                .position(|row| row.0.floor() == x.floor())
                .unwrap();
            assert!(thin_lows[held].1 <= *low && thin_highs[held] >= *high, "{x}");
        }
        // What is out of view does not widen what is in view.
        let (lows, highs) = area(
            &[(-9.0, -50.0), (-5.0, -1.0), (5.0, -1.0)],
            &[50.0, 1.0, 1.0],
            VIEW,
        );
        assert_eq!((lows[1], highs[1]), ((-5.0, -1.0), 1.0));
        let broken = area(
            &[(1.0, 0.1), (2.0, 0.2), (3.0, 0.3)],
            &[1.0, f64::INFINITY, 1.0],
            VIEW,
        );
        assert_eq!(
            values(&broken.0),
            [(1.0, Some(0.1)), (3.0, None), (3.0, Some(0.3))]
        );
    }

    #[test]
    fn what_stands_each_for_itself_stays() {
        let points: Vec<Point> = (0..5000).map(|i| (f64::from(i), 0.0)).collect();
        let dots = super::super::Series::dots("", 1, points.clone());
        let figure = super::super::Axis::default().panel([dots]);
        let figure = super::super::Axis::default().figure([figure]).thinned();
        assert_eq!(figure.panels[0].series[0].points, points);
    }
}
