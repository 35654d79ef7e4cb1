//! The disturbance's corner by restricted likelihood.
//!
//! The driver's parameters and the constants take up part of the slow disturbance, so the residuals have less of it than
//! there was, and the corner of the largest likelihood comes out too high: standard errors then are too small, most for
//! drivers whose inputs are slow too. The restricted likelihood is that of what the regressors cannot take up,
//! `(n - k) ln L + ln |X' X|` less the filter's own determinant, with X the filtered regressors (Harville, "Maximum
//! likelihood approaches to variance component estimation", 1977; Cheang and Reinsel, "Bias reduction of autoregressive
//! estimates in time series regression model through restricted maximum likelihood", 2000).

use nalgebra::DMatrix;

use super::{COUNT, DRIVER, Problem, RHO, THETA, TOLERANCE};
use crate::identify::search::{Bounds, Optimum, minimise, step};

/// Step in ln(1 - rho) of the parabola through the criterion: about two of its standard errors.
const STEP: f64 = 0.1;
/// rho outside of these is no driver's remnant: interpolation, or a walk.
const USUAL_RHO: [f64; 2] = [0.5, 0.9999];

impl Problem<'_> {
    /// `optimum` with the corner of the restricted likelihood, and all else best for that.
    pub(super) fn restrict(&mut self, optimum: Optimum) -> Optimum {
        let rho = optimum.point[RHO];
        if !(USUAL_RHO[0]..USUAL_RHO[1]).contains(&rho) {
            return optimum;
        }
        let mut centre = (1.0 - rho).ln();
        for _ in 0..3 {
            let [below, here, above] =
                [-STEP, 0.0, STEP].map(|d| self.restricted(&optimum.point, 1.0 - (centre + d).exp()));
            let bend = below - 2.0 * here + above;
            if bend.is_nan() || bend <= 0.0 {
                return optimum;
            }
            let moved = (0.5 * STEP * (below - above) / bend).clamp(-3.0 * STEP, 3.0 * STEP);
            centre += moved;
            if moved.abs() < STEP {
                break;
            }
        }
        let rho = (1.0 - centre.exp()).clamp(USUAL_RHO[0], USUAL_RHO[1]);
        self.bounds[RHO] = Bounds::new(rho, rho);
        self.corner_restricted = true;
        let bounds = self.bounds.clone();
        let history = optimum.history;
        let mut found = minimise(&optimum.point, &bounds, TOLERANCE, |p| self.evaluate(p));
        self.assume_muscle(&found.point);
        found.history.splice(0..0, history);
        found
    }

    /// Minus twice the restricted log likelihood of `rho`, up to a constant.
    fn restricted(&self, p: &[f64], rho: f64) -> f64 {
        let mut point = p.to_vec();
        point[RHO] = rho;
        let q = self.driver_sums(&point);
        let d = step(&point, &self.bounds, &q, 0.0);
        let loss = q.loss + q.gradient.dot(&d) + 0.5 * d.dot(&(&q.hessian * &d));
        let free: Vec<usize> = (0..self.size())
            .filter(|i| !(DRIVER..COUNT).contains(i))
            .filter(|&i| self.is_free(i) && !self.bounds[i].touches(p[i]) && q.hessian[(i, i)] > 0.0)
            .collect();
        let k = free.len();
        let information = DMatrix::from_fn(k, k, |r, c| q.hessian[(free[r], free[c])]);
        let scale: f64 = (0..k).map(|i| information[(i, i)].ln()).sum();
        let correlation = DMatrix::from_fn(k, k, |r, c| {
            information[(r, c)] / (information[(r, r)] * information[(c, c)]).sqrt()
        });
        let determinant = scale + correlation.determinant().max(f64::MIN_POSITIVE).ln();
        let filter = ((1.0 - rho) / (1.0 - p[THETA])).ln() * self.stretches.len() as f64;
        let rows = self.row_count().saturating_sub(k) as f64;
        rows * loss.ln() + determinant - 2.0 * filter
    }
}
