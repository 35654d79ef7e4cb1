//! The bias of a finite record of a closed loop.
//!
//! The prediction error e_t of a row knows nothing of the regressors x_t of that row, but later regressors know of e_t: what is
//! new in the driver's torque turns the wheel, and so moves what the driver sees. To first order the estimate misses the
//! truth by `H^-1 sum_t x_t e_t` with `H = sum_t x_t x_t'`. The sum has mean zero, but H holds the same e_t, so their product
//! has not. Let `h_k` be what an error of one unit adds to the regressors k rows later. For Gaussian errors of variance s^2
//! Stein's lemma, `E[f e_t] = s^2 E[df/de_t]`, gives the mean exactly:
//!
//! `E[H^-1 sum_t x_t e_t] = -s^2 E[H^-1 sum_k (h_k tr(H^-1 C_k) + C_k' H^-1 h_k)]` with `C_k = sum_t x_t x_(t+k)'`.
//!
//! Where the only regressor is the record's own past this is the bias of an autoregression (Marriott and Pope, "Bias in the
//! estimation of autocorrelations", Biometrika 41, 1954). All of it is in the record: `s^2 h_k` is the covariance of the
//! errors with the regressors k rows later, since the road and the probe know nothing of the errors. The constants of the
//! stretches are regressors that no error moves. They are taken out of the others, and each adds to `tr(H^-1 C_k)` the share of
//! its rows that have a row k later.
//!
//! Regressors are averaged over [`BLOCK_S`]: a driver's error does nothing faster to them.

use std::ops::Range;

use nalgebra::{Cholesky, DMatrix, DVector};

use super::sums::Rows;
use super::{CORE, K_HG, OWN_BEND, OWN_OFFSET, Problem, RHO, T_P};
use crate::identify::wide::{add_times, dot};

/// Rows are averaged over so long, s.
const BLOCK_S: f64 = 0.1;
/// Longest time after which an error of the driver's is still seen in what the driver sees, s.
const REMEMBERED_S: f64 = 20.0;
/// What the errors may move.
const PLACES: [usize; 8] = [0, 1, 2, K_HG, T_P, OWN_OFFSET, OWN_BEND, RHO];

/// Means of regressors and errors over blocks of rows of one stretch.
#[derive(Debug, Clone, Default)]
struct Blocks {
    /// By regressor.
    regressors: Vec<Vec<f64>>,
    errors: Vec<f64>,
}

impl Problem<'_> {
    /// By how much the estimates are too high in the mean of records like this one; `inverse` is that of H over what is
    /// estimated.
    pub(super) fn bias(&self, kept: &Rows, inverse: &DMatrix<f64>) -> DVector<f64> {
        let mut bias = DVector::zeros(self.size());
        let estimated = |i: &usize| inverse[(*i, *i)] > 0.0 && inverse[(*i, *i)].is_finite();
        let places: Vec<usize> = PLACES.into_iter().filter(estimated).collect();
        let part = DMatrix::from_fn(places.len(), places.len(), |r, c| inverse[(places[r], places[c])]);
        let Some(root) = Cholesky::new(part) else {
            return bias;
        };
        let rows = ((BLOCK_S / self.signals.dt_s).round() as usize).max(1);
        let lags = (REMEMBERED_S / (rows as f64 * self.signals.dt_s)) as usize;
        let by_place = mean_miss(self.blocks(kept, &places, rows), &root.l(), rows, lags);
        for (&i, &b) in places.iter().zip(&by_place) {
            bias[i] = b;
        }
        bias
    }

    /// The regressors at `places` and the errors, by stretch.
    fn blocks(&self, kept: &Rows, places: &[usize], rows: usize) -> Vec<Blocks> {
        let mut from = 0;
        let of_stretch = |stretch: &Range<usize>| {
            let of = from..from + stretch.len();
            from = of.end;
            let (columns, errors) = (&kept.columns[of.clone()], &kept.errors[of]);
            let share = 1.0 / rows as f64;
            Blocks {
                regressors: places
                    .iter()
                    .map(|&i| {
                        let mean = |c: &[[f64; CORE]]| share * c.iter().map(|x| x[i]).sum::<f64>();
                        columns.chunks_exact(rows).map(mean).collect()
                    })
                    .collect(),
                errors: errors
                    .chunks_exact(rows)
                    .map(|e| share * e.iter().sum::<f64>())
                    .collect(),
            }
        };
        self.stretches.iter().map(of_stretch).collect()
    }
}

/// The mean of what the estimates miss the truth by. `root` times its transpose is the inverse of H; a block is the mean of so
/// many `rows`.
fn mean_miss(mut stretches: Vec<Blocks>, root: &DMatrix<f64>, rows: usize, lags: usize) -> Vec<f64> {
    let count = root.nrows();
    for s in &mut stretches {
        s.regressors.iter_mut().for_each(|x| without_constant(x));
        // Times the root, H is one.
        let turned = |j: usize| {
            let mut column = vec![0.0; s.errors.len()];
            for (i, x) in s.regressors.iter().enumerate().skip(j) {
                add_times(&mut column, root[(i, j)], x);
            }
            column
        };
        s.regressors = (0..count).map(turned).collect();
    }
    let rows = rows as f64;
    let mut miss: DVector<f64> = DVector::zeros(count);
    for lag in 0..lags {
        let long_enough = || stretches.iter().filter(|s| s.errors.len() > lag);
        let (mut pairs, mut trace) = (0.0, 0.0);
        let mut answer: DVector<f64> = DVector::zeros(count);
        for s in long_enough() {
            let both = s.errors.len() - lag;
            pairs += both as f64;
            trace += both as f64 / s.errors.len() as f64;
            for (a, x) in answer.iter_mut().zip(&s.regressors) {
                *a += dot(&s.errors[..both], &x[lag..]);
                trace += rows * dot(&x[..both], &x[lag..]);
            }
        }
        miss -= &answer * (rows * trace / pairs.max(1.0));
        // C_k' times the answer, without C_k: each row's product with the answer, and that with the later rows.
        for s in long_enough() {
            let mut through = vec![0.0; s.errors.len() - lag];
            for (a, x) in answer.iter().zip(&s.regressors) {
                add_times(&mut through, *a, x);
            }
            for (miss, x) in miss.iter_mut().zip(&s.regressors) {
                *miss -= rows * rows * dot(&through, &x[lag..]) / pairs.max(1.0);
            }
        }
    }
    (root * miss).as_slice().to_vec()
}

fn without_constant(x: &mut [f64]) {
    let mean = x.iter().sum::<f64>() / x.len().max(1) as f64;
    x.iter_mut().for_each(|x| *x -= mean);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An autoregression of order one, fitted with a constant to n rows, is too low by (1 + 3 a)/n (Marriott and Pope 1954).
    /// What a record says of that varies; 400 records agree with it to a few per cent.
    #[test]
    fn an_autoregression_has_the_bias_of_marriott_and_pope() {
        let (a, n, records) = (0.6, 400, 400);
        let mut state: u64 = 3;
        let mut normal = || -> f64 {
            let mut sum = -6.0;
            for _ in 0..12 {
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1_442_695_040_888_963_407);
                sum += (state >> 11) as f64 / (1_u64 << 53) as f64;
            }
            sum
        };
        let mut mean = 0.0;
        for _ in 0..records {
            let mut blocks = Blocks {
                regressors: vec![Vec::new()],
                ..Blocks::default()
            };
            let mut x = normal() / (1.0_f64 - a * a).sqrt();
            for _ in 0..n {
                let e = normal();
                blocks.regressors[0].push(x);
                blocks.errors.push(e);
                x = a * x + e;
            }
            let mut centred = blocks.regressors[0].clone();
            without_constant(&mut centred);
            let h: f64 = centred.iter().map(|x| x * x).sum();
            let root = DMatrix::from_element(1, 1, 1.0 / h.sqrt());
            mean += mean_miss(vec![blocks], &root, 1, 25)[0] / f64::from(records);
        }
        let published = -(1.0 + 3.0 * a) / f64::from(n);
        assert!((mean / published - 1.0).abs() < 0.1, "{mean} for {published}");
    }
}
