//! What smoothed lane signals add to the standard errors.
//!
//! The vehicle's answer to the wheel angle is estimated from the lane signals, with an error that stays the same throughout the
//! record. It makes a torque of its own in the model, and the estimates move by their regression on that torque. The
//! answer to a probe is small beside the camera's noise, so K_hg and t_p move most.

use nalgebra::{DMatrix, DVector};

use super::delays::filter;
use super::evidence::Alternative;
use super::sums::Rows;
use super::{COUNT, D_LATE, Problem, RHO, T_NMS, T_P, THETA};
use crate::identify::lane::LaneDoubt;
use crate::identify::wide::{dot, integral};

/// What the doubts of the lane signals do to the estimates.
pub(super) struct Doubted {
    /// Products of each doubt's torque, through the filter of the disturbance, with the regressors, t_nms's among them.
    scores: Vec<DVector<f64>>,
    /// What each moves the estimates by.
    moved: Vec<DVector<f64>>,
}

impl Doubted {
    /// Covariance of the estimates: the doubts are independent of each other.
    pub(super) fn covariance(&self, size: usize) -> DMatrix<f64> {
        let mut sum = DMatrix::zeros(size, size);
        for moved in &self.moved {
            sum += moved * moved.transpose();
        }
        sum
    }

    /// Widens what the record knows of what was taken as known, and gives the covariance of that with the estimates.
    pub(super) fn widen(&self, a: &mut Alternative, variance: f64) -> DVector<f64> {
        let curvature = variance / (a.error * a.error);
        let mut mixed = DVector::zeros(a.slopes.len());
        let mut more = 0.0;
        for (score, moved) in self.scores.iter().zip(&self.moved) {
            let drawn = (score[a.place] + a.slopes.dot(score)) / curvature;
            more += drawn * drawn;
            mixed += moved * drawn;
        }
        a.z *= a.error / a.error.hypot(more.sqrt());
        a.error = a.error.hypot(more.sqrt());
        mixed
    }
}

impl Problem<'_> {
    /// What `doubts` do; `inverse` is that of the Gauss-Newton matrix over what is estimated.
    pub(super) fn doubted(
        &self,
        doubts: &[LaneDoubt],
        p: &[f64],
        kept: &Rows,
        inverse: &DMatrix<f64>,
    ) -> Doubted {
        let by_t_nms = if doubts.is_empty() {
            Vec::new()
        } else {
            self.by_t_nms(p, kept)
        };
        let all = doubts.iter().map(|d| self.score_of(d, p, kept, &by_t_nms));
        let (scores, moved) = all
            .map(|score| {
                let moved = inverse * &score;
                (score, moved)
            })
            .filter(|(_, moved)| moved.iter().all(|x| x.is_finite()))
            .unzip();
        Doubted { scores, moved }
    }

    /// The negative derivative of the errors by t_nms, as the columns of [`Rows`]: the arm's torque through one more lag.
    fn by_t_nms(&self, p: &[f64], kept: &Rows) -> Vec<f64> {
        let decay = (-self.signals.dt_s / self.signals.t_nms_s).exp();
        let mut out = Vec::with_capacity(kept.errors.len());
        for (number, stretch) in self.stretches.iter().enumerate() {
            let from = out.len();
            let mut slow: Option<f64> = None;
            for k in stretch.clone() {
                let arm = self.signals.torque[k] - kept.disturbance[out.len()] - p[COUNT + number];
                let lagged = slow.map_or(arm, |slow| decay * slow + (1.0 - decay) * arm);
                slow = Some(lagged);
                out.push((lagged - arm) / self.signals.t_nms_s);
            }
            filter(&mut out[from..], p[RHO], p[THETA]);
        }
        out
    }

    /// Products of the doubt's torque, through the filter of the disturbance, with the regressors.
    fn score_of(&self, doubt: &LaneDoubt, p: &[f64], kept: &Rows, by_t_nms: &[f64]) -> DVector<f64> {
        let dt_s = self.signals.dt_s;
        let weighed: Vec<f64> = if doubt.lane == 0 {
            let whole = integral(&doubt.signal, dt_s);
            let pairs = doubt.signal.iter().zip(&whole);
            pairs.map(|(y, whole)| p[0] * y + p[1] * whole).collect()
        } else {
            doubt.signal.iter().map(|theta| p[2] * theta).collect()
        };
        let seen = self.signals.seen(&weighed);
        let delay = self.signals.delay((p[T_P] + p[D_LATE]).max(0.0));
        let mut score = DVector::zeros(self.size());
        let mut row = 0;
        for (number, stretch) in self.stretches.iter().enumerate() {
            let rows = row..row + stretch.len();
            row = rows.end;
            if stretch.start < doubt.from || stretch.end > doubt.from + doubt.signal.len() {
                continue;
            }
            let read = |k: usize| delay.read(&seen, k - doubt.from).0;
            let mut torque: Vec<f64> = stretch.clone().map(read).collect();
            filter(&mut torque, p[RHO], p[THETA]);
            for (columns, x) in kept.columns[rows.clone()].iter().zip(&torque) {
                for (s, column) in score.iter_mut().zip(columns) {
                    *s += column * x;
                }
            }
            score[T_NMS] += dot(&by_t_nms[rows], &torque);
            score[COUNT + number] += kept.by_constant * torque.iter().sum::<f64>();
        }
        score
    }
}
