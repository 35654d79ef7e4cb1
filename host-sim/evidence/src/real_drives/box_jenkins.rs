//! Box-Jenkins models of the torque: T_d = sum of inputs times weights + n, with n an ARMA(2,1) process (Box and Jenkins, "Time
//! Series Analysis", chapter 11; Ljung, "System Identification", section 4.2).
//!
//! `n_k = d_1 n_(k-1) + d_2 n_(k-2) + e_k + c e_(k-1)`: weights, d and c together minimise the squared errors e of the prediction by
//! one row, on the condition that e is 0 in the first two rows of a series. The transfer functions of the inputs are finite: each lag of an
//! input is one of its own.

use haptic_analysis::identify::{Bounds, Quadratic, minimise};
use nalgebra::{DMatrix, DVector};

use super::linear::{dot, weights};

/// Rows that the noise remembers.
const ORDER: usize = 2;
/// Parameters of the noise: d_1, d_2, c.
const NOISE: usize = ORDER + 1;
/// Beyond, the errors would not forget the start of a series.
const LARGEST_C: f64 = 0.98;
/// Share of the loss below which the search ends.
const TOLERANCE: f64 = 1e-9;

/// Inputs and torque of consecutive rows.
pub(super) type Series = Vec<(Vec<f64>, f64)>;

/// A fitted model.
pub(super) struct BoxJenkins {
    /// What each input is multiplied by.
    pub(super) weights: Vec<f64>,
    /// d_1, d_2 and c.
    pub(super) noise: [f64; NOISE],
}

impl BoxJenkins {
    /// Fits all series together; none of too few rows.
    pub(super) fn fitted(series: &[&Series]) -> Option<Self> {
        let rows: Vec<(&[f64], f64)> = series
            .iter()
            .flat_map(|s| s.iter().map(|(x, y)| (&x[..], *y)))
            .collect();
        let mut start = weights(&rows)?;
        // The torque of a hand changes within some tenths of a second.
        start.extend([0.9, 0.0, 0.0]);
        let mut bounds = vec![Bounds::FREE; start.len()];
        bounds[start.len() - 1] = Bounds::new(-LARGEST_C, LARGEST_C);
        let found = minimise(&start, &bounds, TOLERANCE, |p| squares(&Self::of(p), series));
        Some(Self::of(&found.point))
    }

    fn of(parameters: &[f64]) -> Self {
        let (weights, noise) = parameters.split_at(parameters.len() - NOISE);
        Self {
            weights: weights.into(),
            noise: [noise[0], noise[1], noise[2]],
        }
    }

    fn disturbance(&self, series: &Series) -> Vec<f64> {
        series.iter().map(|(x, y)| y - dot(x, &self.weights)).collect()
    }

    /// The torque of each row from the `ORDER + rows`th on, by the torque of `rows` rows before it and by its own inputs.
    pub(super) fn ahead(&self, series: &Series, rows: usize) -> Vec<f64> {
        let n = self.disturbance(series);
        let [d_1, d_2, c] = self.noise;
        let mut error = 0.0;
        (ORDER..n.len().saturating_sub(rows))
            .map(|k| {
                error = n[k] - d_1 * n[k - 1] - d_2 * n[k - 2] - c * error;
                let next = [d_1 * n[k] + d_2 * n[k - 1] + c * error, n[k]];
                let [then, _] = (1..rows).fold(next, |[last, before], _| [d_1 * last + d_2 * before, last]);
                then + dot(&series[k + rows].0, &self.weights)
            })
            .collect()
    }
}

/// The squared errors of the prediction by one row, with their slopes.
fn squares(model: &BoxJenkins, series: &[&Series]) -> Quadratic {
    let inputs = model.weights.len();
    let size = inputs + NOISE;
    let [d_1, d_2, c] = model.noise;
    let (mut loss, mut gradient, mut hessian) = (0.0, DVector::zeros(size), DMatrix::zeros(size, size));
    for series in series {
        let n = model.disturbance(series);
        let mut error = 0.0;
        let mut slope = DVector::zeros(size);
        for k in ORDER..n.len() {
            // The error before holds the parameters too: its slope goes on, by -c.
            slope *= -c;
            let [x, last, before] = [0, 1, 2].map(|lag| &series[k - lag].0);
            for i in 0..inputs {
                slope[i] -= x[i] - d_1 * last[i] - d_2 * before[i];
            }
            for (i, past) in [n[k - 1], n[k - 2], error].into_iter().enumerate() {
                slope[inputs + i] -= past;
            }
            error = n[k] - d_1 * n[k - 1] - d_2 * n[k - 2] - c * error;
            loss += error * error;
            gradient.axpy(2.0 * error, &slope, 1.0);
            // Gauss and Newton's: the curvature of the errors themselves is left out.
            hessian.ger(2.0, &slope, &slope, 1.0);
        }
    }
    Quadratic {
        loss,
        scale: loss,
        gradient,
        hessian,
    }
}

#[cfg(test)]
mod tests;
