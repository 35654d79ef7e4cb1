//! What else the record says of the model that was fitted: its likelihood over the delay, the scatter of its scores, and
//! how much better it would be if what was taken as known were free.

use nalgebra::{DMatrix, DVector};

use super::delays::{Delays, Line};
use super::sums::Rows;
use super::{
    COUNT, D_LATE, DAMPING, H_LATE, K_HG, K_NMS, LONGEST_DELAY_S, OWN_BEND, OWN_OFFSET, Problem, T_NMS, T_P,
    WHEEL,
};
use crate::identify::search::{Quadratic, covariance, step};

/// Steps of the delay's profile over the whole range.
const PROFILE_STEPS: usize = 20;
/// Length of the blocks over which scores are taken as independent, s.
const BLOCK_S: f64 = 2.0;

/// What freeing one assumption would do, to first order.
#[derive(Debug, Clone)]
pub(super) struct Alternative {
    /// Place of what was assumed.
    pub place: usize,
    /// How far from the assumed value the record draws it.
    pub step: f64,
    /// That in its standard errors.
    pub z: f64,
    /// What the other parameters move by for each unit of it.
    pub slopes: DVector<f64>,
    /// What the record knows of it, as a standard error.
    pub error: f64,
}

impl Alternative {
    /// What it would move parameter `i` by.
    pub(super) fn moves(&self, i: usize) -> f64 {
        self.slopes[i] * self.step
    }
}

impl Problem<'_> {
    /// Minus twice the log likelihood over t_p above the optimum, with what is linear solved for at each.
    pub(super) fn profile(&self, p: &[f64], loss: f64, variance: f64, error: f64) -> Vec<[f64; 2]> {
        if !self.is_free(T_P) {
            return Vec::new();
        }
        let mut delays: Vec<f64> = (0..=PROFILE_STEPS)
            .map(|i| LONGEST_DELAY_S * i as f64 / PROFILE_STEPS as f64)
            .collect();
        // Finer where the interval ends.
        let error = if error.is_finite() { error } else { 0.0 };
        delays.extend((-4..=4).map(|i| (p[T_P] + 0.5 * f64::from(i) * error).clamp(0.0, LONGEST_DELAY_S)));
        delays.sort_by(f64::total_cmp);
        delays.dedup();
        let along = Delays::new(self, p, Line::Size).at(&delays);
        delays
            .into_iter()
            .zip(along)
            .map(|(t_p, linear)| {
                let d = step(p, &self.bounds, &linear, 0.0);
                let gain = -linear.gradient.dot(&d) - 0.5 * d.dot(&(&linear.hessian * &d));
                [t_p, 2.0 * (linear.loss - gain - loss) / variance]
            })
            .collect()
    }

    /// Covariance of the estimate from the scatter of the scores over blocks of neighbouring rows, which holds
    /// where the prediction errors are not quite white or even; by `free` parameters.
    pub(super) fn scattered(&self, rows: &Rows, hessian: &DMatrix<f64>, free: &[usize]) -> DMatrix<f64> {
        let size = self.size();
        let block = (BLOCK_S / self.signals.dt_s) as usize;
        let bread = covariance(hessian, free);
        let mut meat = DMatrix::zeros(size, size);
        let mut from = 0;
        for (number, stretch) in self.stretches.iter().enumerate() {
            let of = from..from + stretch.len();
            from = of.end;
            let blocks = rows.columns[of.clone()].chunks(block);
            for (columns, errors) in blocks.zip(rows.errors[of].chunks(block)) {
                let mut sum: DVector<f64> = DVector::zeros(size);
                for (columns, error) in columns.iter().zip(errors) {
                    for (i, x) in columns.iter().enumerate() {
                        sum[i] += error * x;
                    }
                    sum[COUNT + number] += error * rows.by_constant;
                }
                meat += &sum * sum.transpose();
            }
        }
        &bread * meat * &bread
    }

    /// What freeing each assumption would do: a score test of each, with the `free` parameters following.
    pub(super) fn alternatives(&self, p: &[f64], free: &[usize], variance: f64) -> Vec<Alternative> {
        let full = self.all_sums(p);
        [K_NMS, T_NMS, H_LATE, D_LATE, WHEEL, DAMPING, OWN_OFFSET, OWN_BEND]
            .into_iter()
            .filter(|&x| !(self.is_free(x) || x == H_LATE && p[K_HG] == 0.0))
            .filter_map(|place| freed(&full, free, place, variance))
            .collect()
    }
}

fn freed(full: &Quadratic, free: &[usize], place: usize, variance: f64) -> Option<Alternative> {
    let inverse = covariance(&full.hessian, free);
    let mixed = DVector::from_fn(full.hessian.nrows(), |i, _| {
        if free.contains(&i) {
            full.hessian[(i, place)]
        } else {
            0.0
        }
    });
    let follow = &inverse * &mixed;
    let curvature = full.hessian[(place, place)] - mixed.dot(&follow);
    let least = 1e-9 * full.hessian[(place, place)];
    if curvature.is_nan() || curvature <= least || !follow.iter().all(|x| x.is_finite()) {
        return None;
    }
    let score = full.gradient[place] - follow.dot(&full.gradient);
    let step = -score / curvature;
    Some(Alternative {
        place,
        step,
        z: step * (curvature / variance).sqrt(),
        error: (variance / curvature).sqrt(),
        slopes: -follow,
    })
}
