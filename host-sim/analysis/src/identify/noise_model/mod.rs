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
//! The loss, its gradient and its Gauss-Newton matrix are summed in one pass over the rows ([`sums`]), without storing a
//! Jacobian; the gradient is exact. What is not here: reading logs, the search itself, and the verdict on where it
//! ended ([`report`]).

mod change_score;
mod constancy;
mod delays;
mod doubts;
mod evidence;
mod finite;
mod information;
mod judge;
mod muscle;
mod report;
mod restricted;
mod rows;
mod sums;
mod uncertainty;

use std::ops::Range;

use delays::Delays;
pub use information::{INFORMED, Information, Truth, information};

use super::log::DriveLog;
use super::options::Options;
use super::prepare::{Prepared, prepare};
use super::result::{Identification, Start};
use super::search::{Bounds, Optimum, Quadratic, minimise, resume, step};
use super::signals::{Muscle, Signals};

/// Longest delay that is searched, s: twice table 4's, to hold the paper's inattentive driver (0.5 s).
pub const LONGEST_DELAY_S: f64 = 0.6;

/// Places in the parameter vector; 0, 1, 2 are `gain_i`.
const K_HG: usize = 3;
/// How many come first that the torque is linear in.
const LINEAR: usize = 4;
const T_P: usize = 4;
const RHO: usize = 5;
const THETA: usize = 6;
/// What is always searched, unless it is given.
const CORE: usize = 7;
/// What is taken as known unless the caller asks for an estimate ([`Extra`]).
const K_NMS: usize = 7;
const T_NMS: usize = 8;
const H_LATE: usize = 9;
const D_LATE: usize = 10;
const COUNT: usize = 11;
/// Keys of the parameters that are the driver's and the sensors', by place. The constants of the stretches follow.
const NAMES: [Option<&str>; COUNT] = [
    Some("gain_1"),
    Some("gain_2"),
    Some("gain_3"),
    Some("k_hg"),
    Some("t_p"),
    None,
    None,
    Some("k_nms"),
    Some("t_nms"),
    Some("t_h_late"),
    Some("t_d_late"),
];

/// Widths of the variation intervals (see [`super::result`]): table 4 times the default K_d + K_nms = 4.
const VARIATION_WIDTHS: [f64; COUNT] = [
    4.0 * 0.5,
    4.0 * 0.1,
    4.0 * 2.0,
    1.0,
    LONGEST_DELAY_S,
    f64::NAN,
    f64::NAN,
    2.0,
    0.2,
    0.1,
    0.1,
];

/// Defaults of table 4 for `gain_i` and K_hg.
const START: [f64; 4] = [0.4, 0.04, 14.8, 0.5];
/// Delays that the search is started from, s.
const START_DELAYS_S: [f64; 5] = [0.02, 0.1, 0.2, 0.32, 0.48];
/// Corners that the disturbance is started from, Hz: a driver's remnant, and the errors that interpolation leaves
/// in a record without remnant. The best delay of each is followed to the end.
const START_CORNERS_HZ: [f64; 2] = [0.5, 5.0];

/// What is known of t_nms where nobody says more: the range of drivers, s, and its standard deviation about the value
/// assumed, s. Published arms have 0.06 to 0.15 s.
const T_NMS_RANGE_S: [f64; 2] = [0.06, 0.15];
const T_NMS_SD_S: f64 = 0.03;
/// Where it is searched once it is freed, s.
const T_NMS_SEARCHED_S: [f64; 2] = [0.03, 0.3];

/// Expected improvement, as a share of the loss, below which the search ends. With tens of thousands of rows
/// this leaves the estimate within two hundredths of a standard error of the optimum.
const TOLERANCE: f64 = 1e-8;
/// The same where it is only to be seen which of two ends is the better one.
const COMPARED: f64 = 1e-5;
/// Prediction errors below this, N.m, are those of interpolation in a record without noise: no sensor resolves
/// them, and no share of them is worth an iteration. They are systematic, so that the rows do not average them out
/// as if they were noise: the standard errors are never taken from smaller ones.
const SMALLEST_ERROR_NM: f64 = 1e-5;

/// Identifies the driver of `log`.
pub fn identify(log: &DriveLog, options: &Options) -> Identification {
    identify_prepared(&prepare(log, options), options)
}

/// Identifies the driver of a log that was prepared.
pub(crate) fn identify_prepared(prepared: &Prepared, options: &Options) -> Identification {
    let mut problem = Problem::new(prepared, options);
    let (mut optimum, starts) = problem.search();
    problem.assume_muscle(&optimum.point);
    let drawn = if options.t_nms_known {
        None
    } else {
        problem.drawn_t_nms(&optimum)
    };
    if drawn.is_some() {
        optimum = problem.free_t_nms(&optimum);
    }
    optimum = problem.restrict(optimum);
    problem.report(prepared, options, &optimum, starts)
}

struct Problem<'a> {
    log: &'a DriveLog,
    muscle: Muscle,
    /// Where a search for t_nms begins.
    assumed_t_nms_s: f64,
    signals: Signals,
    bounds: Vec<Bounds>,
    /// Rows that the loss is taken over.
    stretches: Vec<Range<usize>>,
    /// Whether anything beyond [`CORE`] is searched.
    extended: bool,
    /// Standard deviation of t_nms about what is assumed, s, where it is estimated although nobody asked for it.
    t_nms_prior_s: Option<f64>,
    /// Whether the disturbance's corner was estimated by restricted likelihood, and then held.
    corner_restricted: bool,
}

impl<'a> Problem<'a> {
    fn new(prepared: &'a Prepared, options: &Options) -> Self {
        let log = &prepared.log;
        let muscle = options.muscle;
        let signals = Signals::new(log, muscle);
        let first_rows = ((LONGEST_DELAY_S + 5.0 * signals.t_nms_s) / signals.dt_s).ceil() as usize;
        let stretches: Vec<Range<usize>> = prepared
            .stretches
            .iter()
            .map(|s| s.start + first_rows..s.end)
            .filter(|s| s.len() > first_rows)
            .collect();
        let mut bounds = vec![Bounds::FREE; COUNT + stretches.len()];
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
        let known = [muscle.k_nms, muscle.t_nms_s, options.late_s[0], options.late_s[1]];
        for (i, (&value, range)) in known.iter().zip(&options.estimate).enumerate() {
            bounds[K_NMS + i] = range.map_or(Bounds::new(value, value), |[low, high]| Bounds::new(low, high));
        }
        Self {
            log,
            muscle,
            assumed_t_nms_s: muscle.t_nms_s,
            signals,
            bounds,
            stretches,
            extended: options.estimate.iter().any(Option::is_some) || options.late_s != [0.0; 2],
            t_nms_prior_s: None,
            corner_restricted: false,
        }
    }

    /// The optimum with t_nms free, held near what was assumed by what is known of it, from the one without.
    fn free_t_nms(&mut self, from: &Optimum) -> Optimum {
        self.bounds[T_NMS] = Bounds::new(T_NMS_SEARCHED_S[0], T_NMS_SEARCHED_S[1]);
        self.t_nms_prior_s = Some(T_NMS_SD_S);
        self.extended = true;
        let bounds = self.bounds.clone();
        let freed = minimise(&from.point, &bounds, TOLERANCE, |p| self.evaluate(p));
        self.assume_muscle(&freed.point);
        freed
    }

    fn is_free(&self, i: usize) -> bool {
        self.bounds[i].low < self.bounds[i].high
    }

    fn row_count(&self) -> usize {
        self.stretches.iter().map(|s| s.len()).sum()
    }

    /// Size of the parameter vector.
    fn size(&self) -> usize {
        self.bounds.len()
    }

    /// Makes the signals those of the muscle at `p`.
    fn assume_muscle(&mut self, p: &[f64]) {
        if p[T_NMS] != self.signals.t_nms_s {
            self.muscle.t_nms_s = p[T_NMS];
            self.signals = Signals::new(self.log, self.muscle);
        }
    }

    /// Loss, gradient and Gauss-Newton matrix at `p`, after what is linear was solved for.
    fn evaluate(&mut self, p: &mut [f64]) -> Quadratic {
        self.assume_muscle(p);
        let linear = self.light_sums(p, false);
        let solution = step(p, &self.bounds, &linear, 0.0);
        for (x, d) in p.iter_mut().zip(solution.iter()) {
            *x += d;
        }
        if self.extended {
            self.all_sums(p)
        } else {
            self.core_sums(p)
        }
    }

    /// The loss with what is known of t_nms beside the record, where it is estimated although nobody asked for it; and how far
    /// t_nms is from what is assumed, in standard deviations.
    fn with_prior(&self, p: &[f64], mut quadratic: Quadratic) -> (Quadratic, f64) {
        // As so much more of a likelihood whose variance is the loss's own: L (1 + d^2/rows).
        let d = self
            .t_nms_prior_s
            .map_or(0.0, |sd| (p[T_NMS] - self.assumed_t_nms_s) / sd);
        quadratic.loss *= 1.0 + d * d / self.row_count().max(1) as f64;
        (quadratic, d)
    }

    /// The same with the derivatives by t_nms: only for sums that have those of the record too.
    fn with_prior_by_t_nms(&self, p: &[f64], quadratic: Quadratic) -> Quadratic {
        let loss = quadratic.loss;
        let (mut quadratic, d) = self.with_prior(p, quadratic);
        if let Some(sd) = self.t_nms_prior_s {
            let rows = self.row_count().max(1) as f64;
            quadratic.gradient[T_NMS] += loss * 2.0 * d / (rows * sd);
            quadratic.hessian[(T_NMS, T_NMS)] += loss * 2.0 / (rows * sd * sd);
        }
        quadratic
    }

    /// Solves for everything that is linear at each starting delay and corner, then follows the best delay of
    /// each corner to its end.
    fn search(&mut self) -> (Optimum, Vec<Start>) {
        let bounds = self.bounds.clone();
        let mut ends = START_CORNERS_HZ.map(|corner_hz| {
            let start = self.start(corner_hz);
            (
                start[T_P],
                minimise(&start, &bounds, COMPARED, |p| self.evaluate(p)),
            )
        });
        ends.sort_by(|a, b| a.1.quadratic.loss.total_cmp(&b.1.quadratic.loss));
        let mut starts: Vec<Start> = ends
            .iter()
            .map(|(from, o)| Start {
                from_t_p_s: *from,
                to_t_p_s: o.point[T_P],
                loss: o.quadratic.loss,
            })
            .collect();
        let [(_, near), _] = ends;
        self.assume_muscle(&near.point);
        let best = resume(near, &bounds, TOLERANCE, |p| self.evaluate(p));
        starts[0].to_t_p_s = best.point[T_P];
        starts[0].loss = best.quadratic.loss;
        (best, starts)
    }

    /// The best start of a corner: that of the delay with the least loss after what is linear is solved for.
    fn start(&mut self, corner_hz: f64) -> Vec<f64> {
        let mut point = vec![0.0; self.size()];
        point[..LINEAR].copy_from_slice(&START);
        point[K_NMS] = self.muscle.k_nms;
        point[T_NMS] = self.assumed_t_nms_s;
        point[RHO] = (-std::f64::consts::TAU * corner_hz * self.signals.dt_s).exp();
        for (x, b) in point.iter_mut().zip(&self.bounds) {
            *x = x.clamp(b.low, b.high);
        }
        self.assume_muscle(&point);
        let Bounds { low, high } = self.bounds[T_P];
        let delays = START_DELAYS_S.map(|t_p| t_p.clamp(low, high));
        let best = Delays::new(self, &point)
            .at(&delays)
            .into_iter()
            .map(|linear| {
                let solution = step(&point, &self.bounds, &linear, 0.0);
                let gain =
                    -linear.gradient.dot(&solution) - 0.5 * solution.dot(&(&linear.hessian * &solution));
                linear.loss - gain
            })
            .zip(delays)
            .min_by(|a, b| a.0.total_cmp(&b.0));
        point[T_P] = best.map_or(low, |(_, t_p)| t_p);
        point
    }
}

/// `u` at row `k + shift`, on the line between rows and level beyond the ends.
fn at(u: &[f64], k: usize, shift: f64) -> f64 {
    let place = (k as f64 + shift).clamp(0.0, (u.len() - 1) as f64);
    let (whole, share) = (place as usize, place.fract());
    u[whole] + share * (u[(whole + 1).min(u.len() - 1)] - u[whole])
}
