//! How far the estimates may be wrong: their covariance, widened by what the optimum alone does not show, and what the bounds did.

use nalgebra::{DMatrix, DVector};

use super::evidence::{Alternative, Told};
use super::sums::Rows;
use super::{
    COUNT, DRIVER, K_HG, K_NMS, Line, Problem, RHO, SMALLEST_ERROR_NM, T_NMS, T_P, THETA, VARIATION_WIDTHS,
    WHEEL,
};
use crate::identify::change::Constancy;
use crate::identify::prepare::Prepared;
use crate::identify::result::AtTNms;
use crate::identify::search::{Optimum, covariance};

/// Standard errors by which a bound may move an optimum; beyond, the data contradict it.
pub(super) const TRIMMED_AT_MOST: f64 = 3.0;

/// Share of its variation interval by which a parameter may pass a bound all the same: in a record without noise,
/// standard errors are that small.
const TRIMMED_SHARE: f64 = 0.01;

/// What is known of the errors of an optimum.
pub(super) struct Uncertainty {
    /// Variance of the prediction errors, N.m squared.
    pub(super) variance: f64,
    /// Parameters that were estimated.
    pub(super) free: Vec<usize>,
    /// Covariance of the estimates.
    pub(super) errors: DMatrix<f64>,
    /// Loss over t_p.
    pub(super) delay_profile: Vec<[f64; 2]>,
    /// How the estimates change if one assumption more is dropped.
    pub(super) alternatives: Vec<Alternative>,
    /// The estimates less the bias of a finite record.
    pub(super) unbiased: Vec<f64>,
    pub(super) active: ActiveBounds,
    pub(super) constancy: Option<Constancy>,
    /// How far what the record says of the muscle moves each estimate.
    pub(super) drawn: DVector<f64>,
    /// The intervals if all is as assumed, if that is not known.
    pub(super) at_t_nms: Option<AtTNms>,
    /// What is known of a wheel's inertia that is sought.
    pub(super) told: Option<Told>,
}

/// What the verdict is made of beside the results.
pub(super) struct Doubts<'a> {
    pub(super) alternatives: &'a [Alternative],
    pub(super) errors: &'a DMatrix<f64>,
    pub(super) active: &'a ActiveBounds,
    pub(super) told: Option<&'a Told>,
}

impl Uncertainty {
    pub(super) fn doubts(&self) -> Doubts<'_> {
        Doubts {
            alternatives: &self.alternatives,
            errors: &self.errors,
            active: &self.active,
            told: self.told.as_ref(),
        }
    }
}

/// What the driver's bounds did to the optimum.
pub(super) struct ActiveBounds {
    /// How far the unbounded optimum is from the bounded one, to first order.
    pub(super) pull: DVector<f64>,
    /// Parameters on a bound that the data contradict, and where they would be without it.
    pub(super) bounds: Vec<(usize, f64)>,
    /// Parameters on a contradicted bound, and all that move with them.
    pub(super) contradicted: [bool; COUNT],
}

impl Problem<'_> {
    /// The errors of an optimum, and its rows.
    pub(super) fn uncertainty(
        &self,
        prepared: &Prepared,
        manual: bool,
        optimum: &Optimum,
    ) -> (Uncertainty, Rows) {
        let p = &optimum.point;
        // A disturbance on its bound (no sensor noise, say) is taken as known: only the driver's own bounds may
        // have held the estimate back.
        let known =
            |i: usize| !self.is_free(i) || ([RHO, THETA].contains(&i) && self.bounds[i].touches(p[i]));
        let free: Vec<usize> = (0..self.size()).filter(|&i| !known(i)).collect();
        let variance =
            2.0 * optimum.quadratic.loss / self.row_count().saturating_sub(free.len()).max(1) as f64;
        let error_variance = variance.max(SMALLEST_ERROR_NM.powi(2));
        // The corner that the restricted likelihood gave was estimated too.
        let corner = (self.corner_restricted).then_some(RHO);
        let estimated: Vec<usize> = free.iter().copied().chain(corner).collect();
        let inverse = covariance(&optimum.quadratic.hessian, &estimated);
        let mut errors = &inverse * error_variance;
        let delay_profile = self.profile(
            p,
            optimum.quadratic.loss,
            error_variance,
            errors[(T_P, T_P)].sqrt(),
        );
        let kept = self.kept_rows(p, Line::Size);
        self.widen(
            &mut errors,
            p,
            &optimum.quadratic.hessian,
            &estimated,
            &delay_profile,
            &kept,
        );
        let core: Vec<usize> = free
            .iter()
            .copied()
            .filter(|&i| i >= COUNT || i == K_HG && self.is_inertia_sought || !self.bounds[i].touches(p[i]))
            .collect();
        let doubted = self.doubted(&prepared.lane_doubts, p, &kept, &inverse);
        let slow_variance = error_variance * self.log.slow_noise();
        let mut alternatives = self.alternatives(p, &core, slow_variance);
        let drawn_with = alternatives
            .iter_mut()
            .find(|a| a.place == T_NMS)
            .map(|a| doubted.widen(a, slow_variance));
        // What else may be estimated (the muscle, delays of sensors, the share of white noise) counts as known there.
        let within: Vec<usize> = core
            .iter()
            .copied()
            .chain(corner)
            .filter(|&i| i <= RHO || i >= COUNT)
            .collect();
        let unbiased = self.unbiased(p, &within, &optimum.quadratic.hessian, &kept);
        let active = self.active_bounds(optimum, &free, &errors, error_variance);
        errors += doubted.covariance(self.size());
        let constancy = self.constancy(p, error_variance, manual, &mut errors);
        let mut told = self
            .is_inertia_sought
            .then(|| self.inertia_told(optimum))
            .flatten();
        if let Some(told) = &mut told {
            let by_arm = self.moves_by_arm(optimum, told);
            with_inertia(told, by_arm, &mut errors, &mut alternatives);
        }
        let (mut drawn, mut at_t_nms) = (DVector::zeros(self.size()), None);
        if self.assumed.iter().any(|a| !self.is_free(a.place)) {
            at_t_nms = Some(self.as_assumed(&unbiased, &errors, &active.pull));
            drawn = self.widen_by_assumed(&mut errors, &alternatives, drawn_with.as_ref());
        }
        let found = Uncertainty {
            variance,
            free,
            errors,
            delay_profile,
            alternatives,
            unbiased,
            active,
            constancy,
            drawn,
            at_t_nms,
            told,
        };
        (found, kept)
    }

    /// The driver's parameters less the bias of a finite record, within their bounds.
    fn unbiased(&self, p: &[f64], estimated: &[usize], hessian: &DMatrix<f64>, rows: &Rows) -> Vec<f64> {
        let bias = self.bias(rows, &covariance(hessian, estimated));
        let mut out = p.to_vec();
        for i in estimated.iter().copied().filter(|&i| i < DRIVER) {
            out[i] = (p[i] - bias[i]).clamp(self.bounds[i].low, self.bounds[i].high);
        }
        out
    }

    /// What the driver's bounds did to the optimum.
    fn active_bounds(
        &self,
        optimum: &Optimum,
        free: &[usize],
        errors: &DMatrix<f64>,
        variance: f64,
    ) -> ActiveBounds {
        let held: Vec<usize> = free
            .iter()
            .copied()
            .filter(|&i| self.bounds[i].touches(optimum.point[i]))
            .collect();
        let pull = if held.is_empty() {
            DVector::zeros(errors.nrows())
        } else {
            let mut gradient = optimum.quadratic.gradient.clone();
            if self.corner_restricted {
                // No bound holds it: the restricted likelihood has its own gradient.
                gradient[RHO] = 0.0;
            }
            -(errors * gradient) / variance
        };
        let beyond = |i: usize, errors: &DMatrix<f64>| {
            pull[i].is_finite() && pull[i].abs() > TRIMMED_AT_MOST * errors[(i, i)].sqrt()
        };
        let bounds: Vec<usize> = held
            .into_iter()
            .filter(|&i| beyond(i, errors) && pull[i].abs() > TRIMMED_SHARE * VARIATION_WIDTHS[i])
            .collect();
        let contradicted = if bounds.is_empty() {
            [false; COUNT]
        } else {
            let others: Vec<usize> = free.iter().copied().filter(|i| !bounds.contains(i)).collect();
            let with_bounds = covariance(&optimum.quadratic.hessian, &others) * variance;
            // A delay that is none's may be another optimum's: no gain of it is a driver's.
            let is_no_delay = bounds.contains(&T_P);
            std::array::from_fn(|i| beyond(i, &with_bounds) || is_no_delay && i < K_HG)
        };
        ActiveBounds {
            bounds: bounds
                .into_iter()
                .map(|i| (i, optimum.point[i] + pull[i]))
                .collect(),
            contradicted,
            pull,
        }
    }
}

/// Widens the errors by what the disturbance makes of a wheel's inertia, and lets the inertia follow what else is assumed: of the arm the
/// record then says nothing.
fn with_inertia(
    told: &mut Told,
    by_arm: Option<DVector<f64>>,
    errors: &mut DMatrix<f64>,
    alternatives: &mut [Alternative],
) {
    let by_inertia = alternatives.iter().find(|a| a.place == WHEEL);
    let Some(by_inertia) = by_inertia.map(|a| a.slopes.clone()) else {
        return;
    };
    *errors += told.variance * &by_inertia * by_inertia.transpose();
    for a in alternatives.iter_mut().filter(|a| a.place != WHEEL) {
        a.slopes += told.slopes[a.place] * &by_inertia;
        if [K_NMS, T_NMS].contains(&a.place) {
            a.error = f64::INFINITY;
        }
        if let Some(by_arm) = by_arm.as_ref().filter(|_| a.place == T_NMS) {
            told.slopes[T_NMS] = by_arm[WHEEL];
            a.slopes.clone_from(by_arm);
        }
    }
}
