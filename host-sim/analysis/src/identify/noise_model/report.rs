//! The result of an identification, from the end of the search to the verdict: which parameters are identified, what is determined
//! instead, the disturbance, and the residuals with their tests. Standard errors are in `uncertainty`.
//!
//! What a parameter needs to be called identified is said in [`crate::identify`]'s result; the loss, and what was
//! searched, are the parent module's.

use nalgebra::{DMatrix, DVector};

use super::delays::filter;
use super::sums::Rows;
use super::uncertainty::{ActiveBounds, Uncertainty};
use super::{
    COUNT, D_LATE, H_LATE, K_HG, K_NMS, NAMES, OWN_BEND, OWN_OFFSET, Problem, RHO, T_NMS, T_P, THETA,
    VARIATION_WIDTHS,
};
use crate::identify::balance::balance;
use crate::identify::diagnostics;
use crate::identify::options::{BEND_RAD_S, FixError, Options};
use crate::identify::paper::TABLE_4;
use crate::identify::prepare::Prepared;
use crate::identify::result::{
    Combination, Correlation, Identification, InputCorrelation, OwnLine, Parameter, Parameters, Remnant,
    Start, Traces,
};
use crate::identify::search::{Bounds, Optimum};
use crate::identify::verdict;
use haptic_recording::DriveLog;

/// Place of K_d in table 4.
const TABLE_4_K_D: usize = 4;

/// The driver's parameters, and what else was estimated, as a result names them.
struct Named {
    parameters: Parameters,
    /// What the muscle and the delays of the sensors came to, where they were estimated.
    beyond: Vec<(&'static str, Parameter)>,
    line: OwnLine,
    /// Why the gains could not be split, if they could not.
    not_split: Option<FixError>,
}

impl Problem<'_> {
    pub(super) fn report(
        &self,
        prepared: &Prepared,
        options: &Options,
        optimum: &Optimum,
        starts: Vec<Start>,
    ) -> Identification {
        let (log, p) = (&prepared.log, &optimum.point);
        let (found, kept) = self.uncertainty(prepared, options.manual, optimum);
        let Named {
            parameters,
            beyond,
            line,
            not_split,
        } = self.named_parameters(p, options, &found);
        let balance = balance(log, &prepared.stretches, options.manual);
        let mut notes = self.notes(log, options, &parameters, &found.active, &starts);
        notes.extend(not_split.map(|e| e.0));
        let combinations = self.combinations_of_ridge(options, &parameters, &found);
        if !combinations.is_empty() {
            notes.push(
                "The guidance torque moves with the driver's own inputs: k_hg and the gains can be traded for each \
                 other without changing the loss. What is determined are the combinations."
                    .to_owned(),
            );
        }
        let (traces, predicted) = self.traces(log, kept);
        let fit = |model: &[f64]| diagnostics::fit_percent(&traces.measured_nm, model.iter().copied());
        let mut identification = Identification {
            method: "noise-model",
            fit_percent: fit(&traces.simulated_nm),
            fit_percent_predicted: Some(fit(&predicted)),
            fit_percent_wheel_angle: None,
            parameters,
            at_t_nms: found.at_t_nms.clone(),
            combinations,
            correlation: Correlation::new(&NAMES, &found.errors, &found.free),
            remnant: Some(remnant(p[RHO], p[THETA], found.variance, self.signals.dt_s)),
            whiteness: diagnostics::whiteness(&traces.residual_nm, 2),
            input_correlation: self.input_correlation(log, p, &traces),
            preflight: Some(prepared.preflight.clone()),
            torques: (!options.manual).then(|| verdict::torques(balance.as_ref(), options.assisted)),
            balance,
            constancy: found.constancy.clone(),
            delay_profile: found.delay_profile.clone(),
            refuted: Vec::new(),
            assumed: Vec::new(),
            beyond,
            line: Some(line),
            starts,
            loss_history: optimum.history.clone(),
            termination: optimum.termination,
            rows: self.row_count(),
            notes,
            traces,
        };
        self.judge(&mut identification, options, optimum, &found.doubts());
        identification
    }

    /// Each parameter with its estimate and interval, or as not identified.
    fn named_parameters(&self, p: &[f64], options: &Options, found: &Uncertainty) -> Named {
        let parameter = |i: usize| {
            if !self.is_free(i) {
                Parameter::fixed(p[i])
            } else if found.active.contradicted[i] {
                Parameter::not_identified(found.unbiased[i], self.bounds[i])
            } else {
                Parameter::estimated(
                    found.unbiased[i],
                    found.active.pull[i],
                    found.errors[(i, i)],
                    found.drawn[i],
                    self.bounds[i],
                    VARIATION_WIDTHS[i],
                )
            }
        };
        let gains = [0, 1, 2].map(parameter);
        let spread = Spread {
            pull: &found.active.pull,
            errors: &found.errors,
            drawn: &found.drawn,
        };
        let split = split_scale(&gains, &spread, p[K_NMS], options);
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
        if let Some(at_t_nms) = &found.at_t_nms {
            parameters.hold(at_t_nms);
        }
        let beyond = [K_NMS, T_NMS, H_LATE, D_LATE]
            .into_iter()
            .filter(|&i| self.is_free(i))
            .filter_map(|i| Some((NAMES[i]?, parameter(i))));
        let wheel = self
            .is_inertia_sought
            .then(|| ("wheel_inertia", self.inertia(p, found.told.as_ref())));
        Named {
            parameters,
            beyond: beyond.chain(wheel).collect(),
            line: OwnLine {
                offset: self
                    .own_line(OWN_OFFSET, found)
                    .unwrap_or_else(|| parameter(OWN_OFFSET)),
                bend: self
                    .own_line(OWN_BEND, found)
                    .unwrap_or_else(|| parameter(OWN_BEND))
                    .scaled(BEND_RAD_S),
            },
            not_split: split.err(),
        }
    }

    /// What the record says of a line that it does not show, beside what is known of it; none of one that is estimated or given.
    fn own_line(&self, place: usize, found: &Uncertainty) -> Option<Parameter> {
        let known = self.assumed.iter().find(|a| a.place == place)?;
        let Some(a) = found.alternatives.iter().find(|a| a.place == place) else {
            return Some(Parameter::not_identified(known.value, Bounds::FREE));
        };
        let share = known.sd.powi(2) / (known.sd.powi(2) + a.error.powi(2));
        let (step, variance) = (a.step * share, a.error.powi(2) * share);
        Some(Parameter::estimated(
            step,
            0.0,
            variance,
            0.0,
            Bounds::FREE,
            VARIATION_WIDTHS[place],
        ))
    }

    /// The combinations that are determined where K_hg alone is not.
    fn combinations_of_ridge(
        &self,
        options: &Options,
        parameters: &Parameters,
        found: &Uncertainty,
    ) -> Vec<Combination> {
        let along_k_hg = found.active.bounds.iter().all(|&(i, _)| i == K_HG);
        if !options.manual && !parameters.k_hg.identified && along_k_hg {
            self.combinations(&found.unbiased, &found.errors)
        } else {
            Vec::new()
        }
    }

    /// Correlation of the residuals with each filtered input.
    fn input_correlation(&self, log: &DriveLog, p: &[f64], traces: &Traces) -> Vec<InputCorrelation> {
        let filtered = |u: &[f64]| self.filtered(p, u);
        let inputs = [
            ("e_y_m", filtered(&log.e_y_m)),
            ("e_theta_rad", filtered(&log.e_theta_rad)),
            ("wheel_angle_rad", filtered(&log.wheel_angle_rad)),
            ("guidance_torque_nm", filtered(&log.guidance_torque_nm)),
        ];
        let inputs: Vec<(&'static str, &[f64])> = inputs.iter().map(|(n, u)| (*n, u.as_slice())).collect();
        diagnostics::input_correlation(&traces.residual_nm, &inputs, self.signals.dt_s)
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
        active: &ActiveBounds,
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
        } else if !options.manual && !found.k_hg.identified && !active.contradicted[K_HG] {
            notes.push(
                "k_hg is not identified: the standard error is too large a share of its range. A probe \
                 torque makes it readable; beside a probe, a longer drive or a stronger one does."
                    .to_owned(),
            );
        }
        for &(i, unbounded) in &active.bounds {
            let moved: Vec<&str> = (0..COUNT)
                .filter(|&j| active.contradicted[j])
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

/// What is known of the estimates together.
struct Spread<'a> {
    /// How far the unbounded optimum is from the bounded one.
    pull: &'a DVector<f64>,
    /// Their covariance, that of K_nms with them among it.
    errors: &'a DMatrix<f64>,
    /// How far what the record says of the muscle moves each of them.
    drawn: &'a DVector<f64>,
}

/// Splits the gains with what the caller knows of the scale: K_d, or one a_i.
///
/// # Errors
/// The a_i given would need a K_d that is not above zero.
fn split_scale(
    gains: &[Parameter; 3],
    &Spread { pull, errors, drawn }: &Spread<'_>,
    k_nms: f64,
    options: &Options,
) -> Result<(Parameter, [Parameter; 3]), FixError> {
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
    let k_d = if gains[known].standard_error.is_none() {
        Parameter::not_identified(k_d, Bounds::FREE)
    } else {
        // A stiffer arm takes more of K_d + K_nms, and makes the gain larger by nearly as much.
        let with_k_nms = errors[(known, known)] / (a * a) - 2.0 * errors[(known, K_NMS)] / a;
        let (_, low, high) = TABLE_4[TABLE_4_K_D];
        Parameter::estimated(
            k_d,
            pull[known] / a,
            with_k_nms + errors[(K_NMS, K_NMS)],
            drawn[known] / a - drawn[K_NMS],
            Bounds::new(0.0, f64::INFINITY),
            high - low,
        )
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
        let known_arm = errors.clone();
        // K_nms known to 0.25: gain_3 rises by 3 for each unit, so gain_3 has 0.75^2 more, and K_d =
        // gain_3/3.75 - K_nms falls by 0.2 for each unit: 0.05^2 beside 0.09/3.75^2 = 0.08^2.
        errors[(2, 2)] = 0.09 + 0.75 * 0.75;
        errors[(K_NMS, K_NMS)] = 0.0625;
        errors[(2, K_NMS)] = 0.1875;
        errors[(K_NMS, 2)] = 0.1875;
        let none = DVector::zeros(COUNT);
        let spread = |errors| Spread {
            pull: &none,
            errors,
            drawn: &none,
        };
        let (k_d, _) = split_scale(&gains, &spread(&errors), 1.0, &options).unwrap();
        assert!((k_d.standard_error.unwrap() - 0.05_f64.hypot(0.08)).abs() < 1e-9 && k_d.identified);

        let (k_d, [a_1, _, a_3]) = split_scale(&gains, &spread(&known_arm), 1.0, &options).unwrap();
        assert!((k_d.optimum.unwrap() - 3.0).abs() < 1e-12 && a_3.fixed);
        assert!((k_d.standard_error.unwrap() - 0.08).abs() < 1e-9);
        assert!((a_1.optimum.unwrap() - 0.1).abs() < 1e-12);
        assert!((a_1.standard_error.unwrap() - 0.002_404_f64.sqrt()).abs() < 1e-9);
    }

    /// 15/50 - 1 = -0.7 N.m/rad is no driver's.
    #[test]
    fn an_a_that_would_need_a_negative_k_d_is_contradicted() {
        let mut options = Options::default();
        options.fix("a_3=50").unwrap();
        let gains = [gain(0.4), gain(0.04), gain(15.0)];
        let (none, errors) = (DVector::zeros(COUNT), DMatrix::zeros(COUNT, COUNT));
        let spread = Spread {
            pull: &none,
            errors: &errors,
            drawn: &none,
        };
        let FixError(error) = split_scale(&gains, &spread, 1.0, &options).unwrap_err();
        assert!(
            error.contains("a_3 = 50") && error.contains("k_d -0.7"),
            "{error}"
        );
    }
}
