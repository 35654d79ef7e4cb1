//! Steering wheel reversals: how often the driver turns the wheel back by more than a gap.
//!
//! Markkula and Engstroem 2006 (also SAE J2944:2015). The wheel angle is low-passed, its turning points are
//! found (the first sample counts as one), and a reversal is a rise from one turning point to a later one by
//! more than the gap, counted from the lowest turning point since the last counted rise; falls likewise.
//! The filter is in `filters`.

/// Number of reversals larger than `gap` (same unit as the angle) in a filtered wheel angle.
pub fn count_reversals(filtered_angle: &[f64], gap: f64) -> usize {
    let points = turning_points(filtered_angle);
    rises(points.iter().copied(), gap) + rises(points.iter().map(|x| -x), gap)
}

/// The first sample and every local extremum; a plateau gives its first sample.
fn turning_points(signal: &[f64]) -> Vec<f64> {
    let mut points: Vec<f64> = signal.first().copied().into_iter().collect();
    let mut last_step = 0.0;
    let mut candidate = 0.0;
    for pair in signal.windows(2) {
        let step = pair[1] - pair[0];
        if step != 0.0 {
            if step * last_step < 0.0 {
                points.push(candidate);
            }
            last_step = step.signum();
            candidate = pair[1];
        }
    }
    points
}

fn rises(mut points: impl Iterator<Item = f64>, gap: f64) -> usize {
    let Some(mut lowest) = points.next() else { return 0 };
    let mut count = 0;
    for x in points {
        if x - lowest > gap {
            count += 1;
            lowest = x;
        } else {
            lowest = lowest.min(x);
        }
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_by_hand() {
        // Turning points 0, 4, 1, 5, 0 (the last sample is no turning point: the wheel may still go on).
        let angle = [0.0, 2.0, 4.0, 3.0, 1.0, 3.0, 5.0, 0.0, 1.0];
        assert_eq!(count_reversals(&angle, 2.9), 4, "0-4, 4-1, 1-5, 5-0");
        assert_eq!(
            count_reversals(&angle, 3.0),
            3,
            "4-1 is not more than 3; the fall counts from 5"
        );
        assert_eq!(
            count_reversals(&angle, 4.5),
            2,
            "the rise 0-5 spans the dip at 1; the fall 5-0"
        );
        assert_eq!(count_reversals(&angle, 5.0), 0);
    }

    #[test]
    fn a_plateau_is_one_turning_point() {
        assert_eq!(count_reversals(&[0.0, 1.0, 2.0, 2.0, 2.0, 1.0, 0.0, 1.0], 1.5), 2);
    }

    #[test]
    fn nothing_to_count() {
        assert_eq!(count_reversals(&[], 1.0), 0);
        assert_eq!(count_reversals(&[1.0; 5], 0.0), 0);
        assert_eq!(
            count_reversals(&[0.0, 1.0, 2.0, 9.0], 1.0),
            0,
            "a wheel that only turns one way"
        );
    }
}
