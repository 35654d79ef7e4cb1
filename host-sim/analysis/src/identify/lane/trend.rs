//! A smooth course under white noise: its likelihood, and its best estimate from the whole record.
//!
//! The course is a random walk that was integrated `N - 1` times: its state is its level, its slope and so on. Beside it a
//! signal may follow known regressors with unknown constant weights. A Kalman filter gives the likelihood for any ratio of
//! the walk's intensity to the noise, the weights by generalised least squares on what the filter leaves over; a backward
//! pass turns the filter's estimates into those from the whole record (Durbin and Koopman, "Time Series Analysis by
//! State Space Methods", sections 4.4 and 6.2). Samples that are missing or out of line have no part in either.

use nalgebra::{DMatrix, DVector};

/// State covariance before the first sample, in units of the noise variance: nothing is known.
const BEFORE: f64 = 1e12;

/// Relative change of the state covariance below which it is taken as settled.
const SETTLED: f64 = 1e-10;

/// The signal and its regressors side by side, so that the filter takes them all at once.
pub(super) const COLUMNS: usize = 8;
pub(super) type Row = [f64; COLUMNS];

/// A matrix of the state.
type Matrix<const N: usize> = [[f64; N]; N];

/// The gain and the variances of a step, in units of the noise variance.
#[derive(Debug, Clone, Copy)]
struct Gain<const N: usize> {
    state: [f64; N],
    /// Variance of the innovation; infinite where the sample has no part.
    innovation: f64,
    /// Predicted covariance of the level with the state.
    level: [f64; N],
}

impl<const N: usize> Gain<N> {
    fn precision(&self) -> f64 {
        if self.innovation.is_finite() {
            1.0 / self.innovation
        } else {
            0.0
        }
    }
}

/// The filter of one ratio over one set of samples: gains and variances, which do not depend on the values.
#[derive(Debug, Clone)]
pub(super) struct Filter<const N: usize> {
    /// What the state is a sample later.
    transition: Matrix<N>,
    /// The gains that differ: in a long record few do, for the filter settles.
    different: Vec<Gain<N>>,
    /// Which of them each sample has.
    of_sample: Vec<u32>,
}

pub(super) fn factorial(n: usize) -> f64 {
    (1..=n).map(|i| i as f64).product()
}

fn times<const N: usize>(a: &Matrix<N>, b: &Matrix<N>) -> Matrix<N> {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..N).map(|k| a[i][k] * b[k][j]).sum()))
}

fn transposed<const N: usize>(a: &Matrix<N>) -> Matrix<N> {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}

impl<const N: usize> Filter<N> {
    /// `ratio` is the intensity of the walk over the noise variance; `weight[k]` the precision of sample k
    /// relative to the usual, zero for one that has no part.
    pub(super) fn new(dt: f64, ratio: f64, weight: &[f64]) -> Self {
        let power = |n: usize| (0..n).fold(1.0, |x, _| x * dt);
        let transition: Matrix<N> = std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                if j < i {
                    0.0
                } else {
                    power(j - i) / factorial(j - i)
                }
            })
        });
        let walk: Matrix<N> = std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let (a, b) = (N - 1 - i, N - 1 - j);
                ratio * power(a + b + 1) / ((a + b + 1) as f64 * factorial(a) * factorial(b))
            })
        });
        let back = transposed(&transition);
        let mut p: Matrix<N> =
            std::array::from_fn(|i| std::array::from_fn(|j| if i == j { BEFORE } else { 0.0 }));
        let mut different: Vec<Gain<N>> = Vec::new();
        let mut of_sample = Vec::with_capacity(weight.len());
        // How many samples the filter has been settled for.
        let mut settled = None;
        let mut last_weight = f64::NAN;
        for &w in weight {
            settled = settled.filter(|_| w == last_weight);
            last_weight = w;
            if let Some(samples) = settled {
                if samples == 0 {
                    let level = p[0];
                    different.push(Gain {
                        level,
                        ..different[different.len() - 1]
                    });
                }
                settled = Some(samples + 1);
                of_sample.push((different.len() - 1) as u32);
                continue;
            }
            let innovation = if w > 0.0 { p[0][0] + 1.0 / w } else { f64::INFINITY };
            let gain = Gain {
                state: std::array::from_fn(|i| p[i][0] / innovation),
                innovation,
                level: p[0],
            };
            let updated: Matrix<N> =
                std::array::from_fn(|i| std::array::from_fn(|j| p[i][j] - gain.state[i] * p[0][j]));
            let moved = times(&times(&transition, &updated), &back);
            let next: Matrix<N> = std::array::from_fn(|i| {
                std::array::from_fn(|j| 0.5 * (moved[i][j] + moved[j][i]) + walk[i][j])
            });
            let is_settled =
                w > 0.0 && (0..N).all(|i| (next[i][i] - p[i][i]).abs() <= SETTLED * p[i][i].abs());
            settled = is_settled.then_some(0);
            p = next;
            different.push(gain);
            of_sample.push((different.len() - 1) as u32);
        }
        Self {
            transition,
            different,
            of_sample,
        }
    }

    /// The gain of each sample.
    fn gains(&self) -> impl DoubleEndedIterator<Item = &Gain<N>> + ExactSizeIterator {
        self.of_sample
            .iter()
            .map(|&place| &self.different[place as usize])
    }

    /// Innovations of the columns of `rows` over their standard deviation, zero where a sample has no part.
    #[expect(
        clippy::needless_range_loop,
        reason = "plain loops over the columns, which the compiler takes side by side"
    )]
    pub(super) fn whitened(&self, rows: &[Row]) -> Vec<Row> {
        let mut state = [[0.0; COLUMNS]; N];
        state[0] = rows[0];
        let mut out = Vec::with_capacity(rows.len());
        for (row, gain) in rows.iter().zip(self.gains()) {
            let share = gain.precision().sqrt();
            let used = if share > 0.0 { 1.0 } else { 0.0 };
            let mut innovation = [0.0; COLUMNS];
            for c in 0..COLUMNS {
                innovation[c] = used * (row[c] - state[0][c]);
            }
            for i in 0..N {
                for c in 0..COLUMNS {
                    state[i][c] += gain.state[i] * innovation[c];
                }
            }
            for i in 0..N {
                for j in i + 1..N {
                    for c in 0..COLUMNS {
                        state[i][c] += self.transition[i][j] * state[j][c];
                    }
                }
            }
            out.push(innovation.map(|v| v * share));
        }
        out
    }

    /// Sum of the logarithms of the innovation variances over the samples that count, and their number; the first `N`, from
    /// which the state is found, do not.
    fn log_determinant(&self) -> (f64, usize) {
        self.gains()
            .filter(|g| g.innovation.is_finite())
            .skip(N)
            .fold((0.0, 0), |(sum, n), g| (sum + g.innovation.ln(), n + 1))
    }

    /// The course under each column of `rows`, from the whole record.
    #[expect(
        clippy::needless_range_loop,
        reason = "plain loops over the columns, which the compiler takes side by side"
    )]
    pub(super) fn smoothed(&self, rows: &[Row]) -> Vec<Row> {
        let mut state = [[0.0; COLUMNS]; N];
        state[0] = rows[0];
        // The filter's level at each sample, and behind the way back the course's.
        let mut course = Vec::with_capacity(rows.len());
        let innovation = |row: &Row, level: &Row, gain: &Gain<N>| {
            let used = if gain.innovation.is_finite() { 1.0 } else { 0.0 };
            let mut innovation = [0.0; COLUMNS];
            for c in 0..COLUMNS {
                innovation[c] = used * (row[c] - level[c]);
            }
            innovation
        };
        for (row, gain) in rows.iter().zip(self.gains()) {
            course.push(state[0]);
            let innovation = innovation(row, &state[0], gain);
            for i in 0..N {
                for c in 0..COLUMNS {
                    state[i][c] += gain.state[i] * innovation[c];
                }
                for j in i + 1..N {
                    for c in 0..COLUMNS {
                        state[i][c] += self.transition[i][j] * (state[j][c] + gain.state[j] * innovation[c]);
                    }
                }
            }
        }
        // r of the backward recursion: r_{k-1} = z v/F + L' r_k with L = T (1 - K z').
        let mut r = [[0.0; COLUMNS]; N];
        for ((row, level), gain) in rows.iter().zip(&mut course).zip(self.gains()).rev() {
            let innovation = innovation(row, level, gain);
            let mut moved = [[0.0; COLUMNS]; N];
            for j in 0..N {
                for i in 0..=j {
                    for c in 0..COLUMNS {
                        moved[j][c] += self.transition[i][j] * r[i][c];
                    }
                }
            }
            let precision = gain.precision();
            for c in 0..COLUMNS {
                let mut taken = 0.0;
                for i in 0..N {
                    taken += gain.state[i] * moved[i][c];
                }
                moved[0][c] += precision * innovation[c] - taken;
            }
            r = moved;
            for i in 0..N {
                for c in 0..COLUMNS {
                    level[c] += gain.level[i] * r[i][c];
                }
            }
        }
        course
    }

    /// The variance of the course's error in units of the noise variance.
    pub(super) fn variances(&self) -> Vec<f64> {
        let mut big_n = [[0.0; N]; N];
        let mut out = vec![0.0; self.of_sample.len()];
        for (out, gain) in out.iter_mut().zip(self.gains()).rev() {
            let mut through = self.transition;
            for row in &mut through {
                let taken: f64 = row.iter().zip(&gain.state).map(|(t, g)| t * g).sum();
                row[0] -= taken;
            }
            big_n = times(&transposed(&through), &times(&big_n, &through));
            big_n[0][0] += gain.precision();
            let along = |m: &[f64; N]| -> f64 { m.iter().zip(&gain.level).map(|(a, b)| a * b).sum() };
            *out = (gain.level[0] - along(&std::array::from_fn(|i| along(&big_n[i])))).max(0.0);
        }
        out
    }
}

/// What a ratio makes of a signal: minus twice the log likelihood, the noise variance and the regressors' weights.
#[derive(Debug, Clone)]
pub(super) struct Likelihood {
    pub deviance: f64,
    pub noise_variance: f64,
    pub weights: DVector<f64>,
    /// Covariance of the weights' errors.
    pub covariance: DMatrix<f64>,
    /// Standardised innovations.
    pub innovations: Vec<f64>,
}

/// Likelihood of the signal, the first column of `rows`, on the `regressors` behind it under `filter`, at the best noise
/// variance that is not below `floor`'s square.
pub(super) fn likelihood<const N: usize>(
    filter: &Filter<N>,
    rows: &[Row],
    regressors: usize,
    floor: f64,
) -> Likelihood {
    let whitened = filter.whitened(rows);
    let m = regressors;
    // The first samples find the state; what they leave over says nothing.
    let first = filter
        .gains()
        .enumerate()
        .filter(|(_, g)| g.innovation.is_finite())
        .nth(N)
        .map_or(rows.len(), |(k, _)| k);
    let mut products = [[0.0; COLUMNS]; COLUMNS];
    for row in &whitened[first..] {
        for i in 0..COLUMNS {
            for j in 0..COLUMNS {
                products[i][j] += row[i] * row[j];
            }
        }
    }
    let mut weights = DVector::zeros(m);
    let mut covariance = DMatrix::zeros(m, m);
    if m > 0 {
        let scale: Vec<f64> = (1..=m).map(|i| products[i][i].sqrt().max(1e-300)).collect();
        let gram = DMatrix::from_fn(m, m, |i, j| {
            let ridge = if i == j { 1e-9 } else { 0.0 };
            products[i + 1][j + 1] / (scale[i] * scale[j]) + ridge
        });
        let right = DVector::from_fn(m, |i, _| products[i + 1][0] / scale[i]);
        if let Some(c) = gram.cholesky() {
            weights = c.solve(&right);
            covariance = c.inverse();
            for i in 0..m {
                weights[i] /= scale[i];
                for j in 0..m {
                    covariance[(i, j)] /= scale[i] * scale[j];
                }
            }
        }
    }
    let mut left: Vec<f64> = whitened
        .iter()
        .map(|row| row[0] - weights.iter().zip(&row[1..]).map(|(w, x)| w * x).sum::<f64>())
        .collect();
    let (log_determinant, count) = filter.log_determinant();
    let n = count.max(1) as f64;
    let squares = left[first..].iter().map(|l| l * l).sum::<f64>() / n;
    let noise_variance = squares.max(floor * floor).max(f64::MIN_POSITIVE);
    let sd = noise_variance.sqrt();
    left[..first].fill(0.0);
    left[first..].iter_mut().for_each(|l| *l /= sd);
    Likelihood {
        deviance: n * (noise_variance.ln() + squares / noise_variance) + log_determinant,
        noise_variance,
        weights,
        covariance: covariance * noise_variance,
        innovations: left,
    }
}
