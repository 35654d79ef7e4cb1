//! The published estimator, section 4.1: equations (10) to (13), as a baseline.
//!
//! Two outputs, T_d and phi_target, are simulated from the inputs through the state space (11) (with its
//! misprints put right: `a_4` is `a_3`), with the delay as the first-order Pade form (12), sampled with a
//! zero-order hold (13). The noise is taken as white. The paper does not say what phi_target is compared with;
//! the nearest that is measured is the wheel angle. Nor does it say how the two outputs are weighted: here the
//! loss is the plain sum of squares of both, N.m and rad alike. The search begins at table 4's defaults, stays in
//! its intervals, and ends when the next Gauss-Newton step promises to lower the loss by less than 0.01 %. x(0)
//! is the steady state of the first row's inputs.
//!
//! Phi_target depends on a_i and not on K_d, so the second output gives the gains their scale: this is what
//! makes K_d "identifiable" here. What it costs, the studies show.

use nalgebra::{DMatrix, DVector, SMatrix, SVector};

use super::diagnostics;
use super::options::{FixError, Options};
use super::result::{Correlation, Identification, Parameter, Parameters, Start, Traces};
use super::search::{Bounds, Optimum, Quadratic, covariance, minimise};
use haptic_recording::DriveLog;

const T_P: usize = 3;
const K_D: usize = 4;
const K_HG: usize = 5;
const COUNT: usize = 6;
const NAMES: [Option<&str>; COUNT] = [
    Some("a_1"),
    Some("a_2"),
    Some("a_3"),
    Some("t_p"),
    Some("k_d"),
    Some("k_hg"),
];

/// Table 4: default value and variation interval, in the order of `NAMES`.
pub const TABLE_4: [(f64, f64, f64); COUNT] = [
    (0.1, 0.0, 0.5),
    (0.01, 0.0, 0.1),
    (3.7, 3.0, 5.0),
    (0.1, 0.01, 0.3),
    (3.0, 1.0, 5.0),
    (0.5, 0.0, 1.0),
];

/// The stop rule: 0.01 %.
const TOLERANCE: f64 = 1e-4;

/// Identifies the driver of `log` as the paper does.
///
/// # Errors
/// A fixed `gain_i`, which is no parameter of this method; a fixed value outside table 4.
pub fn identify(log: &DriveLog, options: &Options) -> Result<Identification, FixError> {
    if options
        .wheel_inertia
        .or(options.wheel_damping)
        .or(options.bar_stiffness)
        .is_some()
    {
        return Err(FixError(
            "the paper's method knows no wheel above a torsion bar: --method noise-model".to_owned(),
        ));
    }
    if let Some(i) = options.gain.iter().position(Option::is_some) {
        return Err(FixError(format!(
            "gain_{n} is no parameter of the paper's method: fix a_{n} and k_d instead",
            n = i + 1
        )));
    }
    for ((name, value), (_, low, high)) in NAMES.iter().zip(known(options)).zip(TABLE_4) {
        if let (Some(name), Some(v)) = (name, value)
            && !(low..=high).contains(&v)
        {
            return Err(FixError(format!(
                "--fix {name}: {v} is outside {low} to {high}, the interval of table 4 that the paper's method keeps to"
            )));
        }
    }
    let problem = Problem::new(log, options);
    let start = TABLE_4.map(|(default, ..)| default);
    let optimum = minimise(&start, &problem.bounds, TOLERANCE, |p| problem.evaluate(p));
    Ok(problem.report(options, &optimum))
}

/// What the caller knows of each parameter, in the order of [`NAMES`].
fn known(options: &Options) -> [Option<f64>; COUNT] {
    let [a_1, a_2, a_3] = options.a;
    [a_1, a_2, a_3, options.t_p_s, options.k_d, options.k_hg]
}

struct Problem<'a> {
    log: &'a DriveLog,
    k_nms: f64,
    t_nms_s: f64,
    bounds: [Bounds; COUNT],
    /// The muscle's lag of phi and T_h, held between samples.
    lagged_phi: Vec<f64>,
    lagged_guidance: Vec<f64>,
}

/// Unit response to one of the three parts of w, and its derivative by t_p: `[x1, x2, x3, dx2, dx3]` as in (11)
/// for a_i = 1 and K_d + K_nms = 1.
type Unit = SVector<f64, 5>;

impl<'a> Problem<'a> {
    fn new(log: &'a DriveLog, options: &Options) -> Self {
        let mut bounds = TABLE_4.map(|(_, low, high)| Bounds::new(low, high));
        for (bound, value) in bounds.iter_mut().zip(known(options)) {
            if let Some(v) = value {
                *bound = Bounds::new(v, v);
            }
        }
        if options.manual {
            bounds[K_HG] = Bounds::new(0.0, 0.0);
        }
        let decay = (-log.dt_s / options.muscle.t_nms_s).exp();
        let lag = |u: &[f64]| {
            let mut x = u[0];
            u.iter()
                .map(|&input| {
                    let now = x;
                    x = decay * x + (1.0 - decay) * input;
                    now
                })
                .collect()
        };
        Self {
            log,
            k_nms: options.muscle.k_nms,
            t_nms_s: options.muscle.t_nms_s,
            bounds,
            lagged_phi: lag(&log.wheel_angle_rad),
            lagged_guidance: lag(&log.guidance_torque_nm),
        }
    }

    /// Hands each row's residuals (T_d, phi_target against phi) and their negative derivatives to `visit`.
    fn rows(&self, p: &[f64], mut visit: impl FnMut(usize, [f64; 2], &[[f64; COUNT]; 2])) {
        let t_p = p[T_P];
        let (step, input) = discretise(t_p, self.t_nms_s, self.log.dt_s);
        let sum = p[K_D] + self.k_nms;
        // Int e_y is the state x1; e_y and e_theta enter directly.
        let mut units =
            [self.log.e_y_m[0], 0.0, self.log.e_theta_rad[0]].map(|w| Unit::new(0.0, w, w, 0.0, 0.0));
        for k in 0..self.log.len() {
            let (e_y, e_theta) = (self.log.e_y_m[k], self.log.e_theta_rad[k]);
            let w = [e_y, units[1][0], e_theta];
            let (mut target, mut target_slope, mut lagged, mut lagged_slope) = (0.0, 0.0, 0.0, 0.0);
            let mut row = [[0.0; COUNT]; 2];
            for i in 0..3 {
                let unit = &units[i];
                let phi_target = 2.0 * unit[1] - w[i];
                target += p[i] * phi_target;
                target_slope += p[i] * 2.0 * unit[3];
                lagged += p[i] * unit[2];
                lagged_slope += p[i] * unit[4];
                row[0][i] = sum * unit[2];
                row[1][i] = phi_target;
            }
            row[0][T_P] = sum * lagged_slope;
            row[0][K_D] = lagged;
            row[0][K_HG] = -self.lagged_guidance[k];
            row[1][T_P] = target_slope;
            let torque = sum * lagged - self.k_nms * self.lagged_phi[k] - p[K_HG] * self.lagged_guidance[k];
            let residual = [
                self.log.driver_torque_nm[k] - torque,
                self.log.wheel_angle_rad[k] - target,
            ];
            visit(k, residual, &row);
            units[0] = step.fixed_view::<5, 5>(0, 0) * units[0] + input[0] * e_y;
            units[1] = step.fixed_view::<5, 5>(0, 0) * units[1] + input[1] * e_y;
            units[2] = step.fixed_view::<5, 5>(0, 0) * units[2] + input[0] * e_theta;
            // Only the unit of Int e_y is driven by x1.
            units[0][0] = 0.0;
            units[2][0] = 0.0;
        }
    }

    /// Half the sum of squares of both outputs.
    fn evaluate(&self, p: &mut [f64]) -> Quadratic {
        let mut loss = 0.0;
        let mut gradient = [0.0; COUNT];
        let mut hessian = [[0.0; COUNT]; COUNT];
        self.rows(p, |_, e, row| {
            loss += e[0] * e[0] + e[1] * e[1];
            for i in 0..COUNT {
                gradient[i] -= row[0][i] * e[0] + row[1][i] * e[1];
                for j in 0..=i {
                    hessian[i][j] += row[0][i] * row[0][j] + row[1][i] * row[1][j];
                }
            }
        });
        Quadratic {
            loss: 0.5 * loss,
            scale: 0.5 * loss,
            gradient: DVector::from_column_slice(&gradient),
            hessian: DMatrix::from_fn(COUNT, COUNT, |i, j| hessian[i.max(j)][i.min(j)]),
        }
    }

    fn report(&self, options: &Options, optimum: &Optimum) -> Identification {
        let p = &optimum.point;
        // A parameter on a bound has no standard error, and the others have theirs with it held there.
        let free: Vec<usize> = (0..COUNT).filter(|&i| !self.bounds[i].touches(p[i])).collect();
        let variance = 2.0 * optimum.quadratic.loss / (2 * self.log.len() - free.len()) as f64;
        let errors = covariance(&optimum.quadratic.hessian, &free) * variance;
        let mut parameters = self.parameters(options, p, &free, &errors);
        let mut residual = Vec::with_capacity(self.log.len());
        let mut target = Vec::with_capacity(self.log.len());
        self.rows(p, |k, e, _| {
            residual.push(e[0]);
            target.push(self.log.wheel_angle_rad[k] - e[1]);
        });
        let measured = &self.log.driver_torque_nm;
        let simulated: Vec<f64> = measured.iter().zip(&residual).map(|(y, e)| y - e).collect();
        let inputs = [
            ("e_y_m", self.log.e_y_m.as_slice()),
            ("e_theta_rad", &self.log.e_theta_rad),
            ("wheel_angle_rad", &self.log.wheel_angle_rad),
            ("guidance_torque_nm", &self.log.guidance_torque_nm),
        ];
        let whiteness = diagnostics::whiteness(&residual, 0);
        let input_correlation = diagnostics::input_correlation(&residual, &inputs, self.log.dt_s);
        let is_white = whiteness.white && input_correlation.iter().all(|input| input.independent);
        let notes = notes(&mut parameters, is_white);
        Identification {
            method: "paper",
            fit_percent: diagnostics::fit_percent(measured, simulated.iter().copied()),
            fit_percent_predicted: None,
            fit_percent_wheel_angle: Some(diagnostics::fit_percent(
                &self.log.wheel_angle_rad,
                target.into_iter(),
            )),
            parameters,
            at_t_nms: None,
            combinations: Vec::new(),
            correlation: Correlation::new(&NAMES, &errors, &free),
            remnant: None,
            whiteness,
            input_correlation,
            preflight: None,
            balance: None,
            torques: None,
            constancy: None,
            delay_profile: Vec::new(),
            refuted: Vec::new(),
            assumed: Vec::new(),
            line: None,
            beyond: Vec::new(),
            starts: vec![Start {
                from_t_p_s: TABLE_4[T_P].0,
                to_t_p_s: p[T_P],
                loss: optimum.quadratic.loss,
            }],
            loss_history: optimum.history.clone(),
            termination: optimum.termination,
            rows: self.log.len(),
            notes,
            traces: Traces {
                time_s: (0..self.log.len()).map(|k| self.log.time_s(k)).collect(),
                measured_nm: measured.clone(),
                simulated_nm: simulated,
                residual_nm: residual,
                ..Traces::default()
            },
        }
    }

    /// The parameters with their errors; those that were given are fixed.
    fn parameters(&self, options: &Options, p: &[f64], free: &[usize], errors: &DMatrix<f64>) -> Parameters {
        let is_given = |i: usize| self.bounds[i].low == self.bounds[i].high;
        let parameter = |i: usize| {
            let (_, low, high) = TABLE_4[i];
            if is_given(i) {
                Parameter::fixed(p[i])
            } else {
                let variance = if free.contains(&i) {
                    errors[(i, i)]
                } else {
                    f64::INFINITY
                };
                Parameter::estimated(p[i], 0.0, variance, 0.0, self.bounds[i], high - low)
            }
        };
        let sum = p[K_D] + self.k_nms;
        let gain = |i: usize| {
            // gain = a (K_d + K_nms), to first order in the errors.
            let variance = sum * sum * errors[(i, i)]
                + 2.0 * sum * p[i] * errors[(i, K_D)]
                + p[i] * p[i] * errors[(K_D, K_D)];
            let (_, low, high) = TABLE_4[i];
            let mut g =
                Parameter::estimated(sum * p[i], 0.0, variance, 0.0, Bounds::FREE, 4.0 * (high - low));
            let (a, k_d) = (parameter(i), parameter(K_D));
            g.identified &= a.identified && k_d.identified;
            g.estimate = g.estimate.filter(|_| g.identified);
            g.on_bound = a.on_bound || k_d.on_bound;
            g
        };
        Parameters {
            a_1: parameter(0),
            a_2: parameter(1),
            a_3: parameter(2),
            t_p: parameter(T_P),
            k_d: parameter(K_D),
            k_hg: if options.manual {
                Parameter::ABSENT
            } else {
                parameter(K_HG)
            },
            gain_1: gain(0),
            gain_2: gain(1),
            gain_3: gain(2),
        }
    }
}

/// Zero-order hold of the unit system: the transition matrix, and the input vectors for an input that enters w
/// directly (e_y, e_theta) and for one that enters x1 (e_y into its integral).
fn discretise(t_p: f64, t_nms: f64, dt: f64) -> (SMatrix<f64, 5, 5>, [Unit; 2]) {
    // x1' = v; x2' = 2/t_p (w - x2); x3' = (2 x2 - w - x3)/t_nms; the last two are the derivatives of x2 and x3
    // by t_p: s2' = -2/t_p s2 - 2/t_p^2 (w - x2), s3' = (2 s2 - s3)/t_nms. w = x1 or the input itself.
    let (c, m) = (2.0 / t_p, 1.0 / t_nms);
    let d = c / t_p;
    let by_w = [0.0, c, -m, -d, 0.0];
    let mut a = SMatrix::<f64, 7, 7>::zeros();
    for r in 0..5 {
        a[(r, 0)] = by_w[r];
        a[(r, 5)] = by_w[r];
    }
    a[(0, 5)] = 0.0;
    a[(1, 1)] = -c;
    a[(2, 1)] = 2.0 * m;
    a[(2, 2)] = -m;
    a[(3, 1)] = d;
    a[(3, 3)] = -c;
    a[(4, 3)] = 2.0 * m;
    a[(4, 4)] = -m;
    a[(0, 6)] = 1.0;
    let e = (a * dt).exp();
    let column = |c: usize| Unit::from_fn(|r, _| e[(r, c)]);
    (e.fixed_view::<5, 5>(0, 0).into_owned(), [column(5), column(6)])
}

/// What has to be said of the values; where the residuals are not what the method takes them for, no value is identified.
fn notes(parameters: &mut Parameters, is_white: bool) -> Vec<String> {
    let list = parameters.list();
    let on_bound: Vec<&str> = list
        .iter()
        .filter(|(_, _, p)| p.on_bound)
        .map(|(n, ..)| *n)
        .collect();
    let mut notes = Vec::new();
    if !is_white {
        parameters.disown();
        notes.push(
            "The published method takes its residuals as white and independent of the inputs, and they are not: its standard \
             errors are too small, and its values biased by the closed loop. They are shown as it prints them; nothing is \
             identified."
                .to_owned(),
        );
    }
    if !on_bound.is_empty() {
        notes.push(format!("on a bound of table 4: {}", on_bound.join(", ")));
    }
    notes
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The zero-order hold of (11) against the step response that its transfer functions have by hand:
    /// for w a unit step, x2 = 1 - e^{-2t/t_p}, and x3 with phi_target = (1 - s t_p/2)/(1 + s t_p/2) w through
    /// 1/(1 + s t_nms) is 1 - A e^{-t/t_nms} - (1 - A) e^{-2t/t_p}, A = (2 t_nms + t_p)/(2 t_nms - t_p)
    /// (partial fractions).
    #[test]
    fn step_response_of_the_unit_system() {
        let (t_p, t_nms, dt) = (0.13, 0.1, 1.0 / 120.0);
        let response = |t_p: f64| {
            let (step, input) = discretise(t_p, t_nms, dt);
            let mut x = Unit::zeros();
            for _ in 0..24 {
                x = step * x + input[0];
                x[0] = 0.0;
            }
            x
        };
        let by_hand = |t_p: f64| {
            let t: f64 = 0.2;
            let a = (2.0 * t_nms + t_p) / (2.0 * t_nms - t_p);
            [
                1.0 - (-2.0 * t / t_p).exp(),
                1.0 - a * (-t / t_nms).exp() - (1.0 - a) * (-2.0 * t / t_p).exp(),
            ]
        };
        let (x, want) = (response(t_p), by_hand(t_p));
        assert!(
            (x[1] - want[0]).abs() < 1e-12 && (x[2] - want[1]).abs() < 1e-12,
            "{x} {want:?}"
        );
        // The derivatives by t_p, from differences of the hand formula.
        let (up, down) = (by_hand(t_p + 1e-5), by_hand(t_p - 1e-5));
        assert!((x[3] - (up[0] - down[0]) / 2e-5).abs() < 1e-6);
        assert!((x[4] - (up[1] - down[1]) / 2e-5).abs() < 1e-6);
    }
}
