//! Slopes, swings of a series, and the linear loop.

use std::f64::consts::PI;

use serde::Serialize;

use crate::statistics::halved_by_ratio;

/// The largest slope in size between neighbours, over what of a stretch of x they cover; 0 of fewer than two points.
pub fn steepest(points: &[(f64, f64)], [low, high]: [f64; 2]) -> f64 {
    let pairs = points.iter().zip(points.iter().skip(1));
    let inside = pairs.filter(|(a, b)| b.0 >= low && a.0 <= high);
    inside
        .map(|(a, b)| ((b.1 - a.1) / (b.0 - a.0)).abs())
        .fold(0.0, f64::max)
}

/// How a series moves about its mean.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Swing {
    /// Standard deviation.
    pub deviation: f64,
    /// Time between two rises, s; none with fewer than two.
    pub period_s: Option<f64>,
}

/// A swing of a series with a value each second. A rise is a way from half a deviation below the mean to half a deviation above it, so that
/// noise on a swing is none.
pub fn of_series(values: &[f64]) -> Swing {
    let count = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / count;
    let square: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    let deviation = (square / count).sqrt();
    let (mut below, mut rises) = (false, Vec::new());
    for (second, value) in values.iter().enumerate() {
        if *value < mean - 0.5 * deviation {
            below = true;
        } else if below && *value > mean + 0.5 * deviation {
            below = false;
            rises.push(second as f64);
        }
    }
    let period_s = match rises[..] {
        [first, .., last] => Some((last - first) / (rises.len() - 1) as f64),
        _ => None,
    };
    Swing { deviation, period_s }
}

/// Where a loop of first-order lags and a delay with a negative product of static slopes begins to swing: the product's size, and the
/// period, s; none if it never does.
///
/// There the phase, the sum of the arctangents of w*lag and of w*delay, is half a turn, and the gain, the product over the roots of
/// 1 + (w*lag)^2, is 1. With a positive product a loop does not swing: beyond 1 it leaves its equilibrium.
pub fn swings(lags_s: &[f64], delay_s: f64) -> Option<[f64; 2]> {
    let phase = |w: f64| lags_s.iter().map(|lag| (w * lag).atan()).sum::<f64>() + w * delay_s;
    let ends = [1e-6, 1e3];
    if phase(ends[1]) < PI {
        return None;
    }
    // 60 times is far below the digits of f64.
    let [low, _] = halved_by_ratio(ends, 60, |w| phase(w) < PI);
    let product = lags_s
        .iter()
        .map(|lag| (1.0 + (low * lag).powi(2)).sqrt())
        .product();
    Some([product, 2.0 * PI / low])
}
