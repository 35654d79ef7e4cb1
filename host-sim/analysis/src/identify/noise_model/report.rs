//! From the end of the search to the verdict: standard errors, what is identified, what is determined instead, the
//! disturbance, and the residuals with their tests.
//!
//! What a parameter needs to be called identified is said in [`crate::identify`]'s result; the loss, and what was
//! searched, are the parent module's.

use nalgebra::{DMatrix, DVector};

use super::delays::filter;
use super::sums::Rows;
use super::{
    COUNT, D_LATE, H_LATE, K_HG, K_NMS, NAMES, Problem, RHO, SMALLEST_ERROR_NM, T_NMS, T_P, THETA,
    VARIATION_WIDTHS,
};
use crate::identify::balance::balance;
use crate::identify::diagnostics;
use crate::identify::log::DriveLog;
use crate::identify::options::{FixError, Options};
use crate::identify::paper::TABLE_4;
use crate::identify::prepare::Prepared;
use crate::identify::result::{
    Combination, Correlation, Identification, Parameter, Parameters, Remnant, Start, Traces,
};
use crate::identify::search::{Bounds, Optimum, covariance};

/// Standard errors by which a bound may trim an optimum; beyond, the data contradict it.
const TRIMMED_AT_MOST: f64 = 3.0;

/// Share of its variation interval by which a parameter may pass a bound all the same: in a record without noise,
/// standard errors are that small.
const TRIMMED_SHARE: f64 = 0.01;

impl Problem<'_> {
    #[expect(
        clippy::too_many_lines,
        reason = "one value with many fields, each from what stands above it"
    )]
    pub(super) fn report(
        &self,
        prepared: &Prepared,
        options: &Options,
        optimum: &Optimum,
        starts: Vec<Start>,
    ) -> Identification {
        let log = &prepared.log;
        let p = &optimum.point;
        // A disturbance on its bound (no sensor noise, say) is taken as known: only the driver's own bounds may
        // have held the estimate back.
        let known =
            |i: usize| !self.is_free(i) || ([RHO, THETA].contains(&i) && self.bounds[i].touches(p[i]));
        let free: Vec<usize> = (0..self.size()).filter(|&i| !known(i)).collect();
        let rows = self.row_count();
        let variance = 2.0 * optimum.quadratic.loss / rows.saturating_sub(free.len()).max(1) as f64;
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
        let kept = self.kept_rows(p);
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
            .filter(|&i| i >= COUNT || !self.bounds[i].touches(p[i]))
            .collect();
        let doubted = self.doubted(&prepared.lane_doubts, p, &kept, &inverse);
        let mut alternatives = self.alternatives(p, &core, error_variance);
        let drawn_with = alternatives
            .iter_mut()
            .find(|a| a.place == T_NMS)
            .map(|a| doubted.widen(a, error_variance));
        // What else may be estimated (the muscle, delays of sensors, the share of white noise) counts as known there.
        let within: Vec<usize> = core
            .iter()
            .copied()
            .chain(corner)
            .filter(|&i| i <= RHO || i >= COUNT)
            .collect();
        let unbiased = self.unbiased(p, &within, &optimum.quadratic.hessian, &kept);
        let trim = self.trim(optimum, &free, &errors, error_variance);
        errors += doubted.covariance(self.size());
        let constancy = self.constancy(p, &kept, error_variance, &mut errors);
        let (mut drawn, mut at_t_nms) = (DVector::zeros(self.size()), None);
        if !options.t_nms_known && !self.is_free(T_NMS) {
            at_t_nms = Some(self.at_t_nms(&unbiased, &errors, &trim.pull));
            drawn = self.widen_by_t_nms(&mut errors, &alternatives, drawn_with.as_ref());
        }
        let parameter = |i: usize| {
            if !self.is_free(i) {
                Parameter::fixed(p[i])
            } else if trim.contradicted[i] {
                Parameter::not_identified(unbiased[i], self.bounds[i])
            } else {
                Parameter::estimated(
                    unbiased[i],
                    trim.pull[i],
                    errors[(i, i)],
                    drawn[i],
                    self.bounds[i],
                    VARIATION_WIDTHS[i],
                )
            }
        };
        let gains = [0, 1, 2].map(parameter);
        let split = split_scale(&gains, &trim.pull, &errors, options);
        let (k_d, a) = split
            .clone()
            .unwrap_or((Parameter::ABSENT, [Parameter::ABSENT; 3]));
        let k_hg = if options.manual {
            Parameter::ABSENT
        } else {
            parameter(K_HG)
        };
        // Where the search was stopped is no value; the interval says how much it is at most. K_hg may be 0 or 1.
        let named = |mut p: Parameter| {
            p.estimate = p.estimate.filter(|_| p.fixed || !p.on_bound);
            p
        };
        let mut parameters = Parameters {
            a_1: a[0],
            a_2: a[1],
            a_3: a[2],
            t_p: named(parameter(T_P)),
            k_d,
            k_hg,
            gain_1: named(gains[0]),
            gain_2: named(gains[1]),
            gain_3: named(gains[2]),
        };
        if let Some(at_t_nms) = &at_t_nms {
            parameters.hold(at_t_nms);
        }
        let balance = balance(log, &prepared.stretches, options.manual);
        let mut notes = self.notes(log, options, &parameters, &trim, &starts);
        notes.extend(split.err().map(|e| e.0));
        let along_k_hg = trim.bounds.iter().all(|&(i, _)| i == K_HG);
        let combinations = if !options.manual && !k_hg.identified && along_k_hg {
            self.combinations(&unbiased, &errors)
        } else {
            Vec::new()
        };
        if !combinations.is_empty() {
            notes.push(
                "The guidance torque moves with the driver's own inputs: k_hg and the gains can be traded for each \
                 other without changing the loss. What is determined are the combinations."
                    .to_owned(),
            );
        }
        let (traces, predicted) = self.traces(log, kept);
        let fit = |model: &[f64]| diagnostics::fit_percent(&traces.measured_nm, model.iter().copied());
        let filtered = |u: &[f64]| self.filtered(p, u);
        let inputs = [
            ("e_y_m", filtered(&log.e_y_m)),
            ("e_theta_rad", filtered(&log.e_theta_rad)),
            ("wheel_angle_rad", filtered(&log.wheel_angle_rad)),
            ("guidance_torque_nm", filtered(&log.guidance_torque_nm)),
        ];
        let inputs: Vec<(&'static str, &[f64])> = inputs.iter().map(|(n, u)| (*n, u.as_slice())).collect();
        let mut found = Identification {
            method: "noise-model",
            fit_percent: fit(&traces.simulated_nm),
            fit_percent_predicted: Some(fit(&predicted)),
            fit_percent_wheel_angle: None,
            parameters,
            at_t_nms,
            combinations,
            correlation: Correlation::new(&NAMES, &errors, &free),
            remnant: Some(remnant(p[RHO], p[THETA], variance, self.signals.dt_s)),
            whiteness: diagnostics::whiteness(&traces.residual_nm, 2),
            input_correlation: diagnostics::input_correlation(
                &traces.residual_nm,
                &inputs,
                self.signals.dt_s,
            ),
            preflight: Some(prepared.preflight.clone()),
            balance,
            constancy,
            delay_profile,
            refuted: Vec::new(),
            assumed: Vec::new(),
            beyond: [K_NMS, T_NMS, H_LATE, D_LATE]
                .into_iter()
                .filter(|&i| self.is_free(i))
                .filter_map(|i| Some((NAMES[i]?, parameter(i))))
                .collect(),
            starts,
            loss_history: optimum.history.clone(),
            termination: optimum.termination,
            rows,
            notes,
            traces,
        };
        self.judge(&mut found, options, optimum, &alternatives, &errors);
        found
    }

    /// The driver's parameters less the bias of a finite record, within their bounds.
    fn unbiased(&self, p: &[f64], estimated: &[usize], hessian: &DMatrix<f64>, rows: &Rows) -> Vec<f64> {
        let bias = self.bias(rows, &covariance(hessian, estimated));
        let mut out = p.to_vec();
        for i in estimated.iter().copied().filter(|&i| i <= T_P) {
            out[i] = (p[i] - bias[i]).clamp(self.bounds[i].low, self.bounds[i].high);
        }
        out
    }

    /// What the driver's bounds did to the optimum.
    fn trim(&self, optimum: &Optimum, free: &[usize], errors: &DMatrix<f64>, variance: f64) -> Trim {
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
            std::array::from_fn(|i| beyond(i, &with_bounds))
        };
        Trim {
            bounds: bounds
                .into_iter()
                .map(|i| (i, optimum.point[i] + pull[i]))
                .collect(),
            contradicted,
            pull,
        }
    }

    /// What stays put along the ridge of K_hg: each other parameter minus its regression on K_hg.
    fn combinations(&self, p: &[f64], errors: &DMatrix<f64>) -> Vec<Combination> {
        let spread = errors[(K_HG, K_HG)];
        [0, 1, 2, T_P]
            .into_iter()
            .filter(|&i| self.is_free(i) && errors[(i, i)].is_finite() && spread.is_finite() && spread > 0.0)
            .map(|i| {
                let slope = errors[(i, K_HG)] / spread;
                let left = errors[(i, i)] - slope * errors[(i, K_HG)];
                let sign = if slope < 0.0 { '+' } else { '-' };
                Combination {
                    name: format!("{} {sign} {:.4}*k_hg", NAMES[i].unwrap_or_default(), slope.abs()),
                    estimate: p[i] - slope * p[K_HG],
                    standard_error: left.max(0.0).sqrt(),
                }
            })
            .collect()
    }

    fn notes(
        &self,
        log: &DriveLog,
        options: &Options,
        found: &Parameters,
        trim: &Trim,
        starts: &[Start],
    ) -> Vec<String> {
        let mut notes = Vec::new();
        if options.k_d.is_none() && options.a.iter().all(Option::is_none) {
            notes.push(
                "k_d and a_1, a_2, a_3 cannot be told apart: the torque depends on gain_i = (k_d + k_nms)*a_i alone. \
                 Give one of them with --fix to split the gains."
                    .to_owned(),
            );
        }
        if !options.manual && !self.signals.guided {
            notes.push(
                "guidance_torque_nm is zero throughout: k_hg has no effect; was it a --manual drive?"
                    .to_owned(),
            );
        } else if !options.manual && !found.k_hg.identified && !trim.contradicted[K_HG] {
            notes.push(
                "k_hg is not identified: the standard error is too large a share of its range 0 to 1. A probe \
                 torque makes it readable; beside a probe, a longer drive or a stronger one does."
                    .to_owned(),
            );
        }
        for &(i, unbounded) in &trim.bounds {
            let moved: Vec<&str> = (0..COUNT)
                .filter(|&j| trim.contradicted[j])
                .filter_map(|j| NAMES[j])
                .collect();
            notes.push(format!(
                "{} rests on a bound that the data contradict: without it the optimum is at {:.4}. No driver of this \
                 model made this record, so nothing that the bound moves is identified: {}.",
                NAMES[i].unwrap_or_default(),
                unbounded,
                moved.join(", ")
            ));
        }
        if options.manual && log.guidance_torque_nm.iter().any(|&t| t != 0.0) {
            notes.push("guidance_torque_nm is not zero, and was ignored as for a manual drive".to_owned());
        }
        if let [best, .., worst] = starts
            && (worst.loss - best.loss) > 1e-3 * best.loss
        {
            notes.push(format!(
                "starts ended in different places: t_p {:.3} s is better than {:.3} s",
                best.to_t_p_s, worst.to_t_p_s
            ));
        }
        notes
    }

    /// Traces for plots, and the one-step prediction.
    fn traces(&self, log: &DriveLog, rows: Rows) -> (Traces, Vec<f64>) {
        let measured = self.used(&log.driver_torque_nm);
        let without = |part: &[f64]| {
            measured
                .iter()
                .zip(part)
                .map(|(y, d)| y - d)
                .collect::<Vec<f64>>()
        };
        let mut is_used = vec![false; log.len()];
        for stretch in &self.stretches {
            is_used[stretch.clone()].fill(true);
        }
        let unused = || (0..log.len()).filter(|&k| !is_used[k]);
        let traces = Traces {
            unused_s: unused().map(|k| log.time_s(k)).collect(),
            unused_nm: unused().map(|k| log.driver_torque_nm[k]).collect(),
            time_s: self
                .stretches
                .iter()
                .cloned()
                .flatten()
                .map(|k| log.time_s(k))
                .collect(),
            measured_nm: measured.clone(),
            simulated_nm: without(&rows.disturbance),
            residual_nm: rows.errors,
        };
        let predicted = without(&traces.residual_nm);
        (traces, predicted)
    }

    /// The rows of `u` that the loss is taken over.
    fn used(&self, u: &[f64]) -> Vec<f64> {
        self.stretches
            .iter()
            .flat_map(|s| u[s.clone()].iter().copied())
            .collect()
    }

    /// `u` through the filter of the disturbance over each stretch.
    fn filtered(&self, p: &[f64], u: &[f64]) -> Vec<f64> {
        let mut all = self.used(u);
        let mut rest = all.as_mut_slice();
        for stretch in &self.stretches {
            let (here, behind) = rest.split_at_mut(stretch.len());
            filter(here, p[RHO], p[THETA]);
            rest = behind;
        }
        all
    }
}

/// What the driver's bounds did to the optimum.
struct Trim {
    /// How far the unbounded optimum is from the bounded one, to first order.
    pull: DVector<f64>,
    /// Parameters on a bound that the data contradict, and where they would be without it.
    bounds: Vec<(usize, f64)>,
    /// Those, and all that move with them.
    contradicted: [bool; COUNT],
}

/// Splits the gains with what the caller knows of the scale: K_d, or one a_i.
///
/// # Errors
/// The a_i given would need a K_d that is not above zero.
fn split_scale(
    gains: &[Parameter; 3],
    pull: &DVector<f64>,
    errors: &DMatrix<f64>,
    options: &Options,
) -> Result<(Parameter, [Parameter; 3]), FixError> {
    let k_nms = options.muscle.k_nms;
    if let Some(k_d) = options.k_d {
        return Ok((
            Parameter::fixed(k_d),
            gains.map(|g| g.scaled(1.0 / (k_d + k_nms))),
        ));
    }
    let Some((known, a)) = options.a.iter().enumerate().find_map(|(i, a)| a.map(|a| (i, a))) else {
        return Ok((Parameter::ABSENT, [Parameter::ABSENT; 3]));
    };
    // K_d = gain / a - K_nms; the other a_i are a times the ratio of their gain to the known one's.
    let optimum = [0, 1, 2].map(|i| gains[i].optimum.unwrap_or(0.0));
    let k_d = optimum[known] / a - k_nms;
    if k_d <= 0.0 {
        return Err(FixError(format!(
            "a_{n} = {a} contradicts the data: gain_{n} = {:.4} would make k_d {k_d:.4}, which is not above 0; \
             k_d, and the a_i with it, stay unknown.",
            optimum[known],
            n = known + 1
        )));
    }
    let sum = gains[known].scaled(1.0 / a);
    let k_d = Parameter {
        estimate: sum.estimate.map(|x| x - k_nms),
        interval_95: sum.interval_95.map(|i| i.map(|x| x - k_nms)),
        optimum: Some(k_d),
        ..sum
    };
    let split = |i: usize| {
        if i == known {
            return Parameter::fixed(a);
        }
        let ratio = optimum[i] / optimum[known];
        let unbounded_ratio = (optimum[i] + pull[i]) / (optimum[known] + pull[known]);
        if gains[i].standard_error.is_none() || gains[known].standard_error.is_none() {
            return Parameter::not_identified(a * ratio, Bounds::FREE);
        }
        let relative =
            errors[(i, i)] - 2.0 * ratio * errors[(i, known)] + ratio * ratio * errors[(known, known)];
        let (_, low, high) = TABLE_4[i];
        Parameter::estimated(
            a * ratio,
            a * (unbounded_ratio - ratio),
            (a / optimum[known]).powi(2) * relative,
            0.0,
            Bounds::FREE,
            high - low,
        )
    };
    Ok((k_d, [split(0), split(1), split(2)]))
}

/// Splits the ARMA(1,1) disturbance into a low-passed and a white part. From the autocovariances of
/// `(1 - rho/q) n = w + (1 - rho/q) v`: `rho sd_v^2 = theta sd_e^2` and
/// `sd_w^2 + (1 + rho^2) sd_v^2 = (1 + theta^2) sd_e^2`.
fn remnant(rho: f64, theta: f64, variance: f64, dt_s: f64) -> Remnant {
    let low_passed = rho > 0.0 && rho < 1.0;
    let white = if low_passed {
        (theta * variance / rho).max(0.0)
    } else {
        variance
    };
    let driving = ((1.0 + theta * theta) * variance - (1.0 + rho * rho) * white).max(0.0);
    Remnant {
        corner_hz: low_passed.then(|| -rho.ln() / (std::f64::consts::TAU * dt_s)),
        sd_nm: low_passed.then(|| (driving / (1.0 - rho * rho)).sqrt()),
        white_sd_nm: white.sqrt(),
        innovation_sd_nm: variance.sqrt(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gain(estimate: f64) -> Parameter {
        Parameter::estimated(estimate, 0.0, 0.01, 0.0, Bounds::FREE, 8.0)
    }

    /// gain_1 = 0.4, gain_3 = 15 with variances 0.04 and 0.09 and covariance 0.03; a_3 = 3.75 makes the scale 4, so
    /// K_d = 3 and a_1 = 0.1. By hand: r = 0.4/15, var a_1 = (0.04 - 2 r 0.03 + r^2 0.09)/4^2 = 0.002404.
    #[test]
    fn gains_are_split_with_the_covariance_of_their_errors() {
        let mut errors = DMatrix::zeros(COUNT, COUNT);
        errors[(0, 0)] = 0.04;
        errors[(2, 2)] = 0.09;
        errors[(0, 2)] = 0.03;
        errors[(2, 0)] = 0.03;
        let mut options = Options::default();
        options.fix("a_3=3.75").unwrap();
        let gains = [gain(0.4), gain(0.04), gain(15.0)];
        let pull = DVector::zeros(COUNT);
        let (k_d, [a_1, _, a_3]) = split_scale(&gains, &pull, &errors, &options).unwrap();
        assert!((k_d.optimum.unwrap() - 3.0).abs() < 1e-12 && a_3.fixed);
        assert!((a_1.optimum.unwrap() - 0.1).abs() < 1e-12);
        assert!((a_1.standard_error.unwrap() - 0.002_404_f64.sqrt()).abs() < 1e-9);
    }

    /// 15/50 - 1 = -0.7 N.m/rad is no driver's.
    #[test]
    fn an_a_that_would_need_a_negative_k_d_is_contradicted() {
        let mut options = Options::default();
        options.fix("a_3=50").unwrap();
        let gains = [gain(0.4), gain(0.04), gain(15.0)];
        let (pull, errors) = (DVector::zeros(COUNT), DMatrix::zeros(COUNT, COUNT));
        let FixError(error) = split_scale(&gains, &pull, &errors, &options).unwrap_err();
        assert!(
            error.contains("a_3 = 50") && error.contains("k_d -0.7"),
            "{error}"
        );
    }
}
