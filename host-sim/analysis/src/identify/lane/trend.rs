//! A smooth course under white noise: its likelihood, and its best estimate from the whole record.
//!
//! The course is an integrated random walk of order two: its slope is a random walk. Beside it a signal may follow
//! known regressors with unknown constant weights. A Kalman filter gives the likelihood for any ratio of the walk's
//! intensity to the noise, the weights by generalised least squares on what the filter leaves over; a backward
//! pass turns the filter's estimates into those from the whole record (Durbin and Koopman, "Time Series Analysis by
//! State Space Methods", sections 4.4 and 6.2). Samples that are missing or out of line have no part in either.

use nalgebra::{DMatrix, DVector};

/// State covariance before the first sample, in units of the noise variance: nothing is known.
const BEFORE: f64 = 1e12;

/// Relative change of the state covariance below which it is taken as settled.
const SETTLED: f64 = 1e-10;

/// The gain and innovation variance of a step, in units of the noise variance.
#[derive(Debug, Clone, Copy)]
struct Gain {
    level: f64,
    slope: f64,
    /// Variance of the innovation; infinite where the sample has no part.
    innovation: f64,
}

/// The filter of one ratio over one set of samples: gains and variances, which do not depend on the values.
#[derive(Debug, Clone)]
pub(super) struct Filter {
    dt: f64,
    gains: Vec<Gain>,
    /// Predicted covariance at each sample: level, both, slope.
    predicted: Vec<[f64; 3]>,
}

impl Filter {
    /// `ratio` is the intensity of the slope's walk over the noise variance; `weight[k]` the precision of sample k
    /// relative to the usual, zero for one that has no part.
    pub(super) fn new(dt: f64, ratio: f64, weight: &[f64]) -> Self {
        let [q11, q12, q22] = [ratio * dt.powi(3) / 3.0, ratio * dt * dt / 2.0, ratio * dt];
        let mut p = [BEFORE, 0.0, BEFORE];
        let mut gains = Vec::with_capacity(weight.len());
        let mut predicted = Vec::with_capacity(weight.len());
        let mut settled = false;
        let mut last_weight = f64::NAN;
        for &w in weight {
            settled &= w == last_weight;
            last_weight = w;
            predicted.push(p);
            if settled {
                gains.push(gains[gains.len() - 1]);
                continue;
            }
            let gain = if w > 0.0 {
                let innovation = p[0] + 1.0 / w;
                Gain {
                    level: p[0] / innovation,
                    slope: p[1] / innovation,
                    innovation,
                }
            } else {
                Gain {
                    level: 0.0,
                    slope: 0.0,
                    innovation: f64::INFINITY,
                }
            };
            let updated = [
                p[0] * (1.0 - gain.level),
                p[1] * (1.0 - gain.level),
                p[2] - gain.slope * p[1],
            ];
            let next = [
                updated[0] + 2.0 * dt * updated[1] + dt * dt * updated[2] + q11,
                updated[1] + dt * updated[2] + q12,
                updated[2] + q22,
            ];
            settled = w > 0.0 && (0..3).all(|i| (next[i] - p[i]).abs() <= SETTLED * p[i].abs());
            p = next;
            gains.push(gain);
        }
        Self { dt, gains, predicted }
    }

    /// Innovations of `u` over their standard deviation, zero where a sample has no part.
    pub(super) fn whitened(&self, u: &[f64]) -> Vec<f64> {
        let (mut level, mut slope) = (u[0], 0.0);
        u.iter()
            .zip(&self.gains)
            .map(|(&x, gain)| {
                if gain.innovation.is_infinite() {
                    level += self.dt * slope;
                    return 0.0;
                }
                let v = x - level;
                slope += gain.slope * v;
                level += gain.level * v + self.dt * slope;
                v / gain.innovation.sqrt()
            })
            .collect()
    }

    /// Sum of the logarithms of the innovation variances over the samples that count, and their number; the first
    /// two, from which the state is found, do not.
    pub(super) fn log_determinant(&self) -> (f64, usize) {
        self.gains
            .iter()
            .filter(|g| g.innovation.is_finite())
            .skip(2)
            .fold((0.0, 0), |(sum, n), g| (sum + g.innovation.ln(), n + 1))
    }

    /// The course under `u` from the whole record, and its variance in units of the noise variance.
    pub(super) fn smoothed(&self, u: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let n = u.len();
        let (mut level, mut slope) = (u[0], 0.0);
        let mut states = Vec::with_capacity(n);
        let mut innovations = Vec::with_capacity(n);
        for (&x, gain) in u.iter().zip(&self.gains) {
            states.push((level, slope));
            let v = if gain.innovation.is_finite() {
                x - level
            } else {
                0.0
            };
            innovations.push(v);
            slope += gain.slope * v;
            level += gain.level * v + self.dt * slope;
        }
        // r and N of the backward recursion.
        let (mut r, mut big_n) = ([0.0, 0.0], [0.0, 0.0, 0.0]);
        let mut course = vec![0.0; n];
        let mut variance = vec![0.0; n];
        for k in (0..n).rev() {
            let (gain, p) = (self.gains[k], self.predicted[k]);
            // r_{k-1} = z v/F + L' r_k with L = T - T K z, T = [1 dt; 0 1].
            let (kl, ks) = (gain.level + self.dt * gain.slope, gain.slope);
            let (l11, l12, l21, l22) = (1.0 - kl, self.dt, -ks, 1.0);
            let inverse = if gain.innovation.is_finite() {
                1.0 / gain.innovation
            } else {
                0.0
            };
            r = [
                inverse * innovations[k] + l11 * r[0] + l21 * r[1],
                l12 * r[0] + l22 * r[1],
            ];
            let [a, b, c] = big_n;
            let (x1, x2) = (a * l11 + b * l21, b * l11 + c * l21);
            let (y1, y2) = (a * l12 + b * l22, b * l12 + c * l22);
            big_n = [
                inverse + l11 * x1 + l21 * x2,
                l11 * y1 + l21 * y2,
                l12 * y1 + l22 * y2,
            ];
            course[k] = states[k].0 + p[0] * r[0] + p[1] * r[1];
            let along = p[0] * p[0] * big_n[0] + 2.0 * p[0] * p[1] * big_n[1] + p[1] * p[1] * big_n[2];
            variance[k] = (p[0] - along).max(0.0);
        }
        (course, variance)
    }
}

/// What a ratio makes of a signal: minus twice the log likelihood, the noise variance and the regressors' weights.
#[derive(Debug, Clone)]
pub(super) struct Likelihood {
    pub deviance: f64,
    pub noise_variance: f64,
    pub weights: DVector<f64>,
    /// Standardised innovations.
    pub innovations: Vec<f64>,
}

/// Likelihood of `signal` on `regressors` under `filter`, at the best noise variance that is not below `floor`'s square.
pub(super) fn likelihood(filter: &Filter, signal: &[f64], regressors: &[Vec<f64>], floor: f64) -> Likelihood {
    let mut left = filter.whitened(signal);
    let columns: Vec<Vec<f64>> = regressors.iter().map(|x| filter.whitened(x)).collect();
    let m = columns.len();
    // The first samples find the state; what they leave over says nothing.
    let first = filter
        .gains
        .iter()
        .enumerate()
        .filter(|(_, g)| g.innovation.is_finite())
        .nth(2)
        .map_or(signal.len(), |(k, _)| k);
    let dot = |a: &[f64], b: &[f64]| -> f64 { a[first..].iter().zip(&b[first..]).map(|(x, y)| x * y).sum() };
    let mut weights = DVector::zeros(m);
    if m > 0 {
        let scale: Vec<f64> = columns.iter().map(|c| dot(c, c).sqrt().max(1e-300)).collect();
        let gram = DMatrix::from_fn(m, m, |i, j| {
            let ridge = if i == j { 1e-9 } else { 0.0 };
            dot(&columns[i], &columns[j]) / (scale[i] * scale[j]) + ridge
        });
        let right = DVector::from_fn(m, |i, _| dot(&columns[i], &left) / scale[i]);
        if let Some(c) = gram.cholesky() {
            weights = c.solve(&right);
            for (w, s) in weights.iter_mut().zip(&scale) {
                *w /= s;
            }
        }
        for (column, w) in columns.iter().zip(weights.iter()) {
            for (l, x) in left.iter_mut().zip(column) {
                *l -= w * x;
            }
        }
    }
    let (log_determinant, count) = filter.log_determinant();
    let n = count.max(1) as f64;
    let squares = dot(&left, &left) / n;
    let noise_variance = squares.max(floor * floor).max(f64::MIN_POSITIVE);
    let sd = noise_variance.sqrt();
    for l in &mut left[first..] {
        *l /= sd;
    }
    for l in &mut left[..first] {
        *l = 0.0;
    }
    Likelihood {
        deviance: n * (noise_variance.ln() + squares / noise_variance) + log_determinant,
        noise_variance,
        weights,
        innovations: left,
    }
}
