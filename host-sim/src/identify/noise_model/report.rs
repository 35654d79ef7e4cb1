//! From the end of the search to the verdict: standard errors, what is identified, what is determined instead, the
//! disturbance, and the residuals with their tests.
//!
//! What a parameter needs to be called identified is said in [`crate::identify`]'s result; the loss, and what was
//! searched, are the parent module's.

use nalgebra::{DMatrix, DVector};

use super::{COUNT, K_HG, NAMES, Problem, RHO, T_P, THETA, VARIATION_WIDTHS};
use crate::identify::diagnostics;
use crate::identify::log::DriveLog;
use crate::identify::options::Options;
use crate::identify::result::{
    Combination, Correlation, Identification, Parameter, Parameters, Remnant, STANDARD_NORMAL_95, Start,
    Traces,
};
use crate::identify::search::{Optimum, covariance, pull_of_bounds};

impl Problem<'_> {
    pub(super) fn report(
        &self,
        log: &DriveLog,
        options: &Options,
        optimum: &Optimum,
        starts: Vec<Start>,
    ) -> Identification {
        let p = &optimum.point;
        // A disturbance on its bound (no sensor noise, say) is taken as known: only the driver's own bounds may
        // have held the estimate back.
        let known =
            |i: usize| !self.is_free(i) || ([RHO, THETA].contains(&i) && self.bounds[i].touches(p[i]));
        let free: Vec<usize> = (0..COUNT).filter(|&i| !known(i)).collect();
        let rows = self.signals.len() - self.first_row;
        let variance = 2.0 * optimum.quadratic.loss / rows.saturating_sub(free.len()).max(1) as f64;
        let errors = covariance(&optimum.quadratic.hessian, &free) * variance;
        // Where the search would have gone without bounds, if it came to rest on one.
        let held = [K_HG, T_P]
            .into_iter()
            .any(|i| self.is_free(i) && self.bounds[i].touches(p[i]));
        let pull = if held {
            pull_of_bounds(&errors, &optimum.quadratic.gradient, variance)
        } else {
            DVector::zeros(COUNT)
        };
        let parameter = |i: usize| {
            if self.is_free(i) {
                Parameter::estimated(
                    p[i],
                    p[i] + pull[i],
                    errors[(i, i)],
                    self.bounds[i],
                    VARIATION_WIDTHS[i],
                )
            } else {
                Parameter::fixed(p[i])
            }
        };
        let gains = [0, 1, 2].map(parameter);
        let (k_d, a) = split_scale(&gains, options);
        let k_hg = if options.manual {
            Parameter::ABSENT
        } else {
            parameter(K_HG)
        };
        let parameters = Parameters {
            a_1: a[0],
            a_2: a[1],
            a_3: a[2],
            t_p: parameter(T_P),
            k_d,
            k_hg,
            gain_1: gains[0],
            gain_2: gains[1],
            gain_3: gains[2],
        };
        let mut notes = self.notes(log, options, &parameters, &starts);
        let combinations = if !k_hg.identified && k_hg.standard_error.is_some_and(|s| s > 0.0) {
            self.combinations(p, &errors)
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
        let (traces, predicted) = self.traces(log, p);
        let fit = |model: &[f64]| diagnostics::fit_percent(&traces.measured_nm, model.iter().copied());
        let filtered = |u: &[f64]| self.filtered(p, u);
        let inputs = [
            ("e_y_m", filtered(&log.e_y_m)),
            ("e_theta_rad", filtered(&log.e_theta_rad)),
            ("wheel_angle_rad", filtered(&log.wheel_angle_rad)),
            ("guidance_torque_nm", filtered(&log.guidance_torque_nm)),
        ];
        let inputs: Vec<(&'static str, &[f64])> = inputs.iter().map(|(n, u)| (*n, u.as_slice())).collect();
        Identification {
            method: "noise-model",
            fit_percent: fit(&traces.simulated_nm),
            fit_percent_predicted: Some(fit(&predicted)),
            fit_percent_wheel_angle: None,
            parameters,
            combinations,
            correlation: Correlation::new(&NAMES, &errors, &free),
            remnant: Some(remnant(p[RHO], p[THETA], variance, self.signals.dt_s)),
            whiteness: diagnostics::whiteness(&traces.residual_nm, 2),
            input_correlation: diagnostics::input_correlation(
                &traces.residual_nm,
                &inputs,
                self.signals.dt_s,
            ),
            starts,
            loss_history: optimum.history.clone(),
            termination: optimum.termination,
            rows,
            notes,
            traces,
        }
    }

    /// What stays put along the ridge of K_hg: each other parameter minus its regression on K_hg.
    fn combinations(&self, p: &[f64], errors: &DMatrix<f64>) -> Vec<Combination> {
        let spread = errors[(K_HG, K_HG)];
        [0, 1, 2, T_P]
            .into_iter()
            .filter(|&i| self.is_free(i) && errors[(i, i)].is_finite() && spread.is_finite())
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

    fn notes(&self, log: &DriveLog, options: &Options, found: &Parameters, starts: &[Start]) -> Vec<String> {
        let mut notes = Vec::new();
        if !found.k_d.identified {
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
        } else if !options.manual && !found.k_hg.identified {
            notes.push(
                "k_hg is not identified: the standard error is too large a share of its range 0 to 1. A probe \
                 torque makes it readable."
                    .to_owned(),
            );
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
    fn traces(&self, log: &DriveLog, p: &[f64]) -> (Traces, Vec<f64>) {
        let mut disturbance = Vec::with_capacity(self.signals.len() - self.first_row);
        self.rows(p, |n, _| disturbance.push(n));
        let residual = self.filter(p, &disturbance);
        let measured = &log.driver_torque_nm[self.first_row..];
        let without = |part: &[f64]| {
            measured
                .iter()
                .zip(part)
                .map(|(y, d)| y - d)
                .collect::<Vec<f64>>()
        };
        let traces = Traces {
            time_s: (self.first_row..log.len()).map(|k| log.time_s(k)).collect(),
            measured_nm: measured.to_vec(),
            simulated_nm: without(&disturbance),
            residual_nm: residual,
        };
        let predicted = without(&traces.residual_nm);
        (traces, predicted)
    }

    fn filtered(&self, p: &[f64], u: &[f64]) -> Vec<f64> {
        self.filter(p, &u[self.first_row..])
    }

    /// `(1 - rho/q)/(1 - theta/q)` applied to `u`, begun as in [`Problem::evaluate`].
    fn filter(&self, p: &[f64], u: &[f64]) -> Vec<f64> {
        let (rho, theta) = (p[RHO], p[THETA]);
        let mut last = u[0];
        let mut out = (1.0 - rho) / (1.0 - theta) * last;
        u.iter()
            .map(|&x| {
                out = theta * out + x - rho * last;
                last = x;
                out
            })
            .collect()
    }
}

/// Splits the gains with what the caller knows of the scale: K_d, or one a_i.
fn split_scale(gains: &[Parameter; 3], options: &Options) -> (Parameter, [Parameter; 3]) {
    let k_nms = options.muscle.k_nms;
    if let Some(k_d) = options.k_d {
        return (
            Parameter::fixed(k_d),
            gains.map(|g| g.scaled(1.0 / (k_d + k_nms))),
        );
    }
    let Some((known, a)) = options.a.iter().enumerate().find_map(|(i, a)| a.map(|a| (i, a))) else {
        return (Parameter::ABSENT, [Parameter::ABSENT; 3]);
    };
    // K_d = gain / a - K_nms; the other a_i = gain_i / (K_d + K_nms), with the error of both gains as if
    // independent.
    let sum = gains[known].scaled(1.0 / a);
    let k_d = Parameter {
        estimate: sum.estimate.map(|x| x - k_nms),
        interval_95: sum.interval_95.map(|i| i.map(|x| x - k_nms)),
        optimum: sum.optimum.map(|x| x - k_nms),
        ..sum
    };
    let split = |i: usize| {
        if i == known {
            return Parameter::fixed(a);
        }
        let (Some(s), Some(g)) = (sum.optimum, gains[i].optimum) else {
            return Parameter::ABSENT;
        };
        if s == 0.0 {
            return Parameter::ABSENT;
        }
        let value = g / s;
        let standard_error = gains[i]
            .standard_error
            .zip(sum.standard_error)
            .map(|(e_g, e_s)| (e_g.powi(2) + (value * e_s).powi(2)).sqrt() / s.abs());
        let identified = gains[i].identified && sum.identified;
        Parameter {
            estimate: identified.then_some(value),
            standard_error,
            interval_95: standard_error.map(|e| [-1.0, 1.0].map(|z| value + z * STANDARD_NORMAL_95 * e)),
            identified,
            on_bound: false,
            fixed: false,
            optimum: Some(value),
        }
    };
    (k_d, [split(0), split(1), split(2)])
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
