//! The default estimator: prediction errors of the driver with an exact delay and a disturbance model.
//!
//! Measured torque = driver (see [`super::signals`]) + constant + n, where the disturbance n is a first-order
//! low-passed Gaussian (the remnant) plus white sensor noise. Sampled, that is exactly an ARMA(1,1) process,
//! `n_k = rho n_{k-1} + e_k - theta e_{k-1}` with rho and theta not negative. The sum of squared one-step
//! prediction errors e is minimised over driver and disturbance together.
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
//! Jacobian; the gradient is exact. What is not here: reading logs, the search itself, and the verdict on where it
//! ended ([`report`]).

mod report;

use nalgebra::{DMatrix, DVector};

use super::log::DriveLog;
use super::options::Options;
use super::result::{Identification, Start};
use super::search::{Bounds, Optimum, Quadratic, minimise, step};
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
/// them, and no share of them is worth an iteration. They are systematic, so that the rows do not average them out
/// as if they were noise: the standard errors are never taken from smaller ones.
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
        // A driver who steers away from the target line is none.
        bounds[..3].fill(Bounds::new(0.0, f64::INFINITY));
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
}
