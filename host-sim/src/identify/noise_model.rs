//! The default estimator: prediction errors of the driver with an exact delay and a disturbance model.
//!
//! Measured torque = driver (see [`super::signals`]) + constant + n, where the disturbance n is a first-order
//! low-passed Gaussian (the remnant) plus white sensor noise. Sampled, that is exactly an ARMA(1,1) process,
//! `n_k = rho n_{k-1} + e_k - theta e_{k-1}` with rho and theta not negative. The sum of squared one-step prediction errors e is minimised over
//! driver and disturbance together.
//!
//! Why not simply fit the torque: in a closed loop the remnant turns the wheel, the car and so the inputs. A fit
//! of the simulated torque sees inputs that carry the remnant of seconds ago, whose correlation with the
//! remnant of now it takes for a reaction of the driver. The prediction error is what is new at each sample; no
//! input of that or an earlier instant can carry it, so the estimate is consistent and its standard errors,
//! from the Gauss-Newton matrix, hold (Ljung, "System Identification", sections 8.3 and 13.4).
//!
//! The constant is (K_d + K_nms)*a_2 times what Int e_y was before the record began. The rows before
//! [`LONGEST_DELAY_S`] + 5 t_nms are not used: there the delayed inputs, or what the muscle still remembers of
//! the time before them, are not in the record.
//!
//! The loss, its gradient and its Gauss-Newton matrix are summed in one pass over the rows, without storing a
//! Jacobian; the gradient is exact. What is not here: reading logs, and the search itself.

use nalgebra::{DMatrix, DVector};

use super::diagnostics;
use super::log::DriveLog;
use super::options::Options;
use super::result::{
    Combination, Correlation, Identification, Parameter, Parameters, Remnant, STANDARD_NORMAL_95, Start,
    Traces,
};
use super::search::{Bounds, Optimum, Quadratic, covariance, minimise, pull_of_bounds, step};
use super::signals::Signals;

/// Longest delay that is searched, s: twice table 4's, to hold the paper's inattentive driver (0.5 s).
pub const LONGEST_DELAY_S: f64 = 0.6;

/// Places in the parameter vector; 0, 1, 2 are `gain_i`.
const K_HG: usize = 3;
const OFFSET: usize = 4;
/// How many come first that the torque is linear in.
const LINEAR: usize = 5;
const T_P: usize = 5;
const RHO: usize = 6;
const THETA: usize = 7;
const COUNT: usize = 8;
/// Keys of the parameters that are the driver's, by place.
const NAMES: [Option<&str>; COUNT] = [
    Some("gain_1"),
    Some("gain_2"),
    Some("gain_3"),
    Some("k_hg"),
    None,
    Some("t_p"),
    None,
    None,
];

/// Widths of the variation intervals (see [`super::result`]): table 4 times the default K_d + K_nms = 4.
const VARIATION_WIDTHS: [f64; T_P + 1] = [4.0 * 0.5, 4.0 * 0.1, 4.0 * 2.0, 1.0, f64::NAN, LONGEST_DELAY_S];

/// Defaults of table 4 for `gain_i` and K_hg.
const START: [f64; 4] = [0.4, 0.04, 14.8, 0.5];
/// Delays that the search is started from, s.
const START_DELAYS_S: [f64; 5] = [0.02, 0.1, 0.2, 0.32, 0.48];
/// Corners that the disturbance is started from, Hz: a driver's remnant, and the errors that interpolation leaves
/// in a record without remnant. The best delay of each is followed to the end.
const START_CORNERS_HZ: [f64; 2] = [0.5, 5.0];

/// Expected improvement, as a share of the loss, below which the search ends. With tens of thousands of rows
/// this leaves the estimate within two hundredths of a standard error of the optimum.
const TOLERANCE: f64 = 1e-8;
/// Prediction errors below this, N.m, are those of interpolation in a record without noise: no sensor resolves
/// them, and no share of them is worth an iteration.
const SMALLEST_ERROR_NM: f64 = 1e-5;

/// Identifies the driver of `log`.
pub fn identify(log: &DriveLog, options: &Options) -> Identification {
    let signals = Signals::new(log, options.muscle);
    let problem = Problem::new(&signals, options);
    let (optimum, starts) = problem.search();
    problem.report(log, options, &optimum, starts)
}

struct Problem<'a> {
    signals: &'a Signals,
    bounds: [Bounds; COUNT],
    first_row: usize,
}

impl<'a> Problem<'a> {
    fn new(signals: &'a Signals, options: &Options) -> Self {
        let mut bounds = [Bounds::FREE; COUNT];
        bounds[K_HG] = Bounds::new(0.0, 1.0);
        bounds[T_P] = Bounds::new(0.0, LONGEST_DELAY_S);
        bounds[RHO] = Bounds::new(0.0, 0.999_99);
        bounds[THETA] = Bounds::new(0.0, 0.99);
        let pin = |b: &mut Bounds, value: Option<f64>| {
            if let Some(v) = value {
                *b = Bounds::new(v, v);
            }
        };
        for (i, bound) in bounds.iter_mut().enumerate().take(3) {
            let both = options.a[i]
                .zip(options.k_d)
                .map(|(a, k_d)| a * (k_d + options.muscle.k_nms));
            pin(bound, options.gain[i].or(both));
        }
        pin(&mut bounds[K_HG], options.k_hg.or(options.manual.then_some(0.0)));
        pin(&mut bounds[T_P], options.t_p_s);
        let first_row = ((LONGEST_DELAY_S + 5.0 * signals.t_nms_s) / signals.dt_s).ceil() as usize;
        Self {
            signals,
            bounds,
            first_row,
        }
    }

    fn is_free(&self, i: usize) -> bool {
        self.bounds[i].low < self.bounds[i].high
    }

    /// Hands each row's disturbance `n` and its negative derivatives (the regressors) to `visit`.
    #[inline]
    fn rows(&self, p: &[f64], mut visit: impl FnMut(f64, [f64; T_P + 1])) {
        let s = self.signals;
        let delay = s.delay(p[T_P]);
        for k in self.first_row..s.len() {
            let (m1, d1) = delay.read(&s.visual[0], k);
            let (m2, d2) = delay.read(&s.visual[1], k);
            let (m3, d3) = delay.read(&s.visual[2], k);
            let h = -s.guidance[k];
            let model = p[0] * m1 + p[1] * m2 + p[2] * m3 + p[K_HG] * h + p[OFFSET];
            let slope = p[0] * d1 + p[1] * d2 + p[2] * d3;
            visit(s.target[k] - model, [m1, m2, m3, h, 1.0, slope]);
        }
    }

    /// Loss, gradient and Gauss-Newton matrix at `p`, after what is linear was solved for.
    fn evaluate(&self, p: &mut [f64]) -> Quadratic {
        let linear = self.pass::<false>(p);
        let solution = step(p, &self.bounds, &linear, 0.0);
        for (x, d) in p.iter_mut().zip(solution.iter()) {
            *x += d;
        }
        self.pass::<true>(p)
    }

    /// One pass over the rows; without `ALL`, the derivatives by t_p, rho and theta are left at zero, and the
    /// quadratic is exact.
    fn pass<const ALL: bool>(&self, p: &[f64]) -> Quadratic {
        if ALL {
            self.sums::<COUNT>(p)
        } else {
            self.sums::<LINEAR>(p)
        }
    }

    fn sums<const N: usize>(&self, p: &[f64]) -> Quadratic {
        let (rho, theta) = (p[RHO], p[THETA]);
        // Row of the Jacobian of -e, in the order of the parameters, and what its filters remember.
        let mut row = [0.0; N];
        let mut last = [0.0; N];
        let (mut e, mut last_n) = (0.0, 0.0);
        let mut loss = 0.0;
        let mut gradient = [0.0; N];
        let mut hessian = [[0.0; N]; N];
        let regressed = N.min(T_P + 1);
        let mut started = false;
        self.rows(p, |n, regressors| {
            if !started {
                // The filters start as if the first row had gone on for ever: for the slow signals here that
                // is nearer to the truth than silence, and the first innovation is not the whole disturbance.
                (last_n, started) = (n, true);
                let gain = (1.0 - rho) / (1.0 - theta);
                for i in 0..regressed {
                    last[i] = regressors[i];
                    row[i] = gain * regressors[i];
                }
                e = gain * n;
            }
            if N == COUNT {
                row[RHO] = theta * row[RHO] + last_n;
                row[THETA] = theta * row[THETA] - e;
            }
            e = theta * e + n - rho * last_n;
            last_n = n;
            for i in 0..regressed {
                row[i] = theta * row[i] + regressors[i] - rho * last[i];
                last[i] = regressors[i];
            }
            loss += e * e;
            for i in 0..N {
                gradient[i] -= e * row[i];
                for j in 0..=i {
                    hessian[i][j] += row[i] * row[j];
                }
            }
        });
        Quadratic {
            loss: 0.5 * loss,
            scale: 0.5 * loss.max(SMALLEST_ERROR_NM.powi(2) * (self.signals.len() - self.first_row) as f64),
            gradient: DVector::from_fn(COUNT, |i, _| if i < N { gradient[i] } else { 0.0 }),
            hessian: DMatrix::from_fn(COUNT, COUNT, |i, j| {
                if i.max(j) < N {
                    hessian[i.max(j)][i.min(j)]
                } else {
                    0.0
                }
            }),
        }
    }

    /// Solves for everything that is linear at each starting delay and corner, then follows the best delay of
    /// each corner to its end.
    fn search(&self) -> (Optimum, Vec<Start>) {
        let mut ends = START_CORNERS_HZ.map(|corner_hz| {
            let start = START_DELAYS_S
                .map(|t_p| self.start(t_p, corner_hz))
                .into_iter()
                .min_by(|a, b| a.0.total_cmp(&b.0))
                .map_or_else(Vec::new, |(_, point)| point);
            (
                start[T_P],
                minimise(&start, &self.bounds, TOLERANCE, |p| self.evaluate(p)),
            )
        });
        ends.sort_by(|a, b| a.1.quadratic.loss.total_cmp(&b.1.quadratic.loss));
        let starts = ends
            .iter()
            .map(|(from, o)| Start {
                from_t_p_s: *from,
                to_t_p_s: o.point[T_P],
                loss: o.quadratic.loss,
            })
            .collect();
        let [(_, best), _] = ends;
        (best, starts)
    }

    /// A start, and the loss there after the linear part is solved for.
    fn start(&self, t_p_s: f64, corner_hz: f64) -> (f64, Vec<f64>) {
        let mut point = vec![START[0], START[1], START[2], START[3], 0.0, t_p_s, 0.0, 0.0];
        point[RHO] = (-std::f64::consts::TAU * corner_hz * self.signals.dt_s).exp();
        for (x, b) in point.iter_mut().zip(&self.bounds) {
            *x = x.clamp(b.low, b.high);
        }
        let linear = self.pass::<false>(&point);
        let solution = step(&point, &self.bounds, &linear, 0.0);
        let gain = -linear.gradient.dot(&solution) - 0.5 * solution.dot(&(&linear.hessian * &solution));
        (linear.loss - gain, point)
    }

    fn report(
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
