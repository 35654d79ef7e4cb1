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
//! A driver's own line lies beside the target line by an offset and by a part in proportion to the road's turn. The integral of
//! e_y takes up both, and a fit without them has no gain_2; so both are estimated where the record shows a line, and held in
//! the errors where it does not.
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

use super::options::{BEND_RAD_S, Inertia, Options};
use super::prepare::{Prepared, prepare};
use super::result::{Identification, SAME_LINE, Start};
use super::search::{Bounds, Optimum, Quadratic, minimise, resume, step};
use super::signals::{Muscle, Signals};
use super::switches::Switches;
use super::wheel::WheelMotion;
use haptic_recording::DriveLog;

/// Longest delay that is searched, s: twice table 4's, to hold the paper's inattentive driver (0.5 s).
pub const LONGEST_DELAY_S: f64 = 0.6;

/// What the derivatives by the driver's own line are: by the torques that it makes, a slope and one in proportion to the road's
/// heading, in which no gain has a part; or by its size, with the gains as they are.
#[derive(Clone, Copy, PartialEq)]
enum Line {
    Torques,
    Size,
}

/// Places in the parameter vector; 0, 1, 2 are `gain_i`.
const K_HG: usize = 3;
/// How many come first that the torque is linear in.
const LINEAR: usize = 4;
const T_P: usize = 4;
/// The line that the driver takes beside the target line: an offset, m, and a part in proportion to the road's turn, m by rad/s.
const OWN_OFFSET: usize = 5;
const OWN_BEND: usize = 6;
/// How many are the driver's.
const DRIVER: usize = 7;
const RHO: usize = 7;
const THETA: usize = 8;
/// What is always searched, unless it is given.
const CORE: usize = 9;
/// What is taken as known unless the caller asks for an estimate, or the record draws it away.
const K_NMS: usize = 9;
const T_NMS: usize = 10;
const H_LATE: usize = 11;
const D_LATE: usize = 12;
/// Inertia of the wheel above a torsion bar.
const WHEEL: usize = 13;
/// Its damping.
const DAMPING: usize = 14;
const COUNT: usize = 15;
/// Keys of the parameters that are the driver's and the sensors', by place. The constants of the stretches follow.
const NAMES: [Option<&str>; COUNT] = [
    Some("gain_1"),
    Some("gain_2"),
    Some("gain_3"),
    Some("k_hg"),
    Some("t_p"),
    Some("line_offset"),
    Some("line_bend"),
    None,
    None,
    Some("k_nms"),
    Some("t_nms"),
    Some("t_h_late"),
    Some("t_d_late"),
    Some("wheel_inertia"),
    Some("wheel_damping"),
];

/// Widths of the variation intervals (see [`super::result`]): table 4 times the default K_d + K_nms = 4.
const VARIATION_WIDTHS: [f64; COUNT] = [
    4.0 * 0.5,
    4.0 * 0.1,
    4.0 * 2.0,
    1.0,
    LONGEST_DELAY_S,
    1.0,
    1.0 / BEND_RAD_S,
    f64::NAN,
    f64::NAN,
    2.0,
    0.2,
    0.1,
    0.1,
    SOUGHT_KG_M2[1] - SOUGHT_KG_M2[0],
    0.05,
];

/// What is known of a driver's own line where the record does not show one, m: its standard deviation about the target line on a
/// straight road, and that of its part in a bend.
const LINE_SD_M: f64 = 0.05;
/// What a line has to add to twice the log likelihood before it is estimated: where gain_2 is weak, some line always adds a few.
const LINE_LEVEL: f64 = 16.0;
/// A driver's own line is within so much of the target line, m: the target line is in the same lane.
const LARGEST_LINE_M: f64 = 1.5;
/// A gain_2 below this, N.m/(m.s), does not tell where a driver's line is: the search then starts on the target line.
const LEAST_GAIN_2: f64 = 0.01;

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
/// The standard deviation of K_nms about the value assumed, N.m/rad: stiffnesses from half of table 4's to half as much again
/// are usual.
const K_NMS_SD: f64 = 0.25;
/// The standard deviation of a wheel's inertia about what the caller says, as a share: a wheel is seldom weighed.
pub(super) const WHEEL_SHARE: f64 = 0.1;
/// Inertia of steering wheels, in which one is sought, kg.m2.
pub(crate) const SOUGHT_KG_M2: [f64; 2] = [0.005, 0.1];
/// Most rounds of the search for an inertia.
const MOST_ROUNDS: usize = 8;
/// A round that moves it by less than this share of its standard error is the last.
const SETTLED: f64 = 0.05;
/// Where both are searched once they are freed, N.m/rad and s.
const K_NMS_SEARCHED: [f64; 2] = [0.0, 4.0];
const T_NMS_SEARCHED_S: [f64; 2] = [0.03, 0.3];

/// Expected improvement, as a share of the loss, below which the search ends. With tens of thousands of rows
/// this leaves the estimate within two hundredths of a standard error of the optimum.
const TOLERANCE: f64 = 1e-8;
/// The share of the loss below which a search ends that only has to show which of two ends is the better one.
const COMPARED: f64 = 1e-5;
/// Prediction errors below this, N.m, are those of interpolation in a record without noise: no sensor resolves
/// them, and no share of them is worth an iteration. They are systematic, so that the rows do not average them out
/// as if they were noise: the standard errors are never taken from smaller ones.
const SMALLEST_ERROR_NM: f64 = 1e-5;

/// Identifies the driver of `log`.
pub fn identify(log: &DriveLog, options: &Options) -> Identification {
    let (prepared, options) = with_inertia_sought(options, |options| prepare(log, options));
    identify_prepared(&prepared, &options)
}

/// A drive as `prepared` with the inertia of the wheel that it tells, and the options with that inertia in them; where none is sought,
/// both as they are.
pub(crate) fn with_inertia_sought(
    options: &Options,
    prepared: impl Fn(&Options) -> Prepared,
) -> (Prepared, Options) {
    let mut options = options.clone();
    let mut found = prepared(&options);
    for _ in 0..MOST_ROUNDS {
        let mut problem = Problem::new(&found, &options);
        if !problem.is_inertia_sought {
            break;
        }
        let (optimum, _) = problem.search();
        problem.assume_muscle(&optimum.point);
        let Some(told) = problem.inertia_told(&optimum) else {
            break;
        };
        let inertia = optimum.point[WHEEL];
        let next = (inertia + told.moves[WHEEL]).clamp(SOUGHT_KG_M2[0], SOUGHT_KG_M2[1]);
        if (next - inertia).abs() < SETTLED * told.variance.sqrt() {
            break;
        }
        options.wheel_inertia = Some(next);
        found = prepared(&options);
    }
    (found, options)
}

/// Identifies the driver of a log that was prepared.
pub(crate) fn identify_prepared(prepared: &Prepared, options: &Options) -> Identification {
    let mut problem = Problem::new(prepared, options);
    let (optimum, starts) = problem.search();
    problem.assume_muscle(&optimum.point);
    let is_line = problem.line_is_evident(&optimum);
    let variance = problem.error_variance(&optimum);
    if is_line && !problem.torque_moves(&optimum.point, variance, options.manual) {
        return problem.with_line(prepared, options);
    }
    let found = problem.found(prepared, options, optimum, starts);
    // Before a line is said to move, it may be another one than the target line throughout; and one that is evident is left out only
    // where something else is refuted in its place.
    let moves = found.refuted.iter().any(|r| r.assumption == SAME_LINE);
    let is_left_out = is_line && found.refuted.is_empty();
    if (moves || is_left_out) && problem.line_may_be_freed() {
        return Problem::new(prepared, options).with_line(prepared, options);
    }
    found
}

/// Something that is not known exactly although nobody asked for an estimate.
#[derive(Clone, Copy)]
struct Assumed {
    place: usize,
    value: f64,
    /// Standard deviation about that value.
    sd: f64,
}

#[derive(Clone)]
struct Problem<'a> {
    log: &'a DriveLog,
    muscle: Muscle,
    /// What is taken as known give or take something: K_nms, t_nms, a wheel's inertia, the instants of a probe's switches, the driver's
    /// line.
    assumed: Vec<Assumed>,
    signals: Signals,
    /// The motion of the wheel above a torsion bar, where there is one.
    wheel: Option<&'a WheelMotion>,
    bounds: Vec<Bounds>,
    /// Whether the inertia of that wheel is sought.
    is_inertia_sought: bool,
    /// Rows that the loss is taken over.
    stretches: Vec<Range<usize>>,
    /// Whether anything beyond [`CORE`] is searched.
    extended: bool,
    /// Whether the disturbance's corner was estimated by restricted likelihood, and then held.
    corner_restricted: bool,
}

impl<'a> Problem<'a> {
    /// The identification with a line of the driver's own.
    fn with_line(&mut self, prepared: &Prepared, options: &Options) -> Identification {
        self.free_line();
        let (optimum, starts) = self.search();
        self.assume_muscle(&optimum.point);
        self.found(prepared, options, optimum, starts)
    }

    /// The identification from where the search ended: with what the record draws away from what was assumed, and the
    /// disturbance's corner.
    fn found(
        &mut self,
        prepared: &Prepared,
        options: &Options,
        mut optimum: Optimum,
        starts: Vec<Start>,
    ) -> Identification {
        // Once for K_nms and once for t_nms, at most.
        for _ in 0..2 {
            let Some(place) = self.drawn(&optimum) else { break };
            optimum = self.freed(place, &optimum);
        }
        optimum = self.restrict(optimum);
        self.report(prepared, options, &optimum, starts)
    }

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
        let is_inertia_sought = options.wheel_inertia_is == Inertia::Sought;
        // Beside an inertia that is sought, a quicker arm than the one assumed looks like more than 1.
        bounds[K_HG] = Bounds::new(0.0, if is_inertia_sought { 2.0 } else { 1.0 });
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
        // The target line, unless the record shows another one.
        pin(&mut bounds[OWN_OFFSET], options.line[0].or(Some(0.0)));
        pin(&mut bounds[OWN_BEND], options.line[1].or(Some(0.0)));
        let known = [muscle.k_nms, muscle.t_nms_s, options.late_s[0], options.late_s[1]];
        for (i, (&value, range)) in known.iter().zip(&options.estimate).enumerate() {
            bounds[K_NMS + i] = range.map_or(Bounds::new(value, value), |[low, high]| Bounds::new(low, high));
        }
        let inertia = options.wheel_inertia.unwrap_or(0.0);
        let damping = options.wheel_damping();
        bounds[WHEEL] = Bounds::new(inertia, inertia);
        bounds[DAMPING] = Bounds::new(damping, damping);
        let untimed = Switches::of(log).are_untimed();
        // Anywhere in a row: its standard deviation is that over the root of twelve.
        let of_row_s = log.dt_s / 12.0_f64.sqrt();
        let [offset, bend] = options.line.map(|l| l.is_none());
        let is_about = inertia > 0.0 && options.wheel_inertia_is == Inertia::About;
        let is_undamped = inertia > 0.0 && options.wheel_damping.is_none();
        let assumed = [
            (!options.k_nms_known, K_NMS, muscle.k_nms, K_NMS_SD),
            (!options.t_nms_known, T_NMS, muscle.t_nms_s, T_NMS_SD_S),
            (is_about, WHEEL, inertia, WHEEL_SHARE * inertia),
            (is_undamped, DAMPING, damping, damping),
            (
                untimed && options.estimate[2].is_none(),
                H_LATE,
                options.late_s[0],
                of_row_s,
            ),
            (offset, OWN_OFFSET, 0.0, LINE_SD_M),
            (bend, OWN_BEND, 0.0, LINE_SD_M / BEND_RAD_S),
        ];
        let assumed = assumed.into_iter().filter(|a| a.0);
        Self {
            log,
            muscle,
            assumed: assumed
                .map(|(_, place, value, sd)| Assumed { place, value, sd })
                .collect(),
            signals,
            wheel: prepared.wheel.as_ref(),
            is_inertia_sought,
            bounds,
            stretches,
            extended: options.estimate.iter().any(Option::is_some) || options.late_s != [0.0; 2],
            corner_restricted: false,
        }
    }

    /// The optimum with something free that was assumed, held near that by what is known of it, from the one without.
    fn freed(&mut self, place: usize, from: &Optimum) -> Optimum {
        let [low, high] = if place == T_NMS {
            T_NMS_SEARCHED_S
        } else {
            K_NMS_SEARCHED
        };
        self.bounds[place] = Bounds::new(low, high);
        self.extended = true;
        let bounds = self.bounds.clone();
        let freed = minimise(&from.point, &bounds, TOLERANCE, |p| self.evaluate(p));
        self.assume_muscle(&freed.point);
        freed
    }

    /// Whether a line of the driver's own explains more than chance does, with all else that is linear following.
    fn line_is_evident(&self, optimum: &Optimum) -> bool {
        let p = &optimum.point;
        let mut bounds = self.bounds.clone();
        let own = || {
            self.assumed
                .iter()
                .map(|a| a.place)
                .filter(|i| [OWN_OFFSET, OWN_BEND].contains(i))
        };
        own().for_each(|i| bounds[i] = Bounds::FREE);
        // Without its bound: gain_2 rests on it where there is a line.
        bounds[1].low = f64::NEG_INFINITY;
        let quadratics = Delays::new(self, p, Line::Torques).at(&[p[T_P]]);
        let gain: f64 = quadratics
            .iter()
            .map(|q| {
                let d = step(p, &bounds, q, 0.0);
                -q.gradient.dot(&d) - 0.5 * d.dot(&(&q.hessian * &d))
            })
            .sum();
        self.line_may_be_freed() && 2.0 * gain / self.error_variance(optimum) > LINE_LEVEL
    }

    fn error_variance(&self, optimum: &Optimum) -> f64 {
        (2.0 * optimum.quadratic.loss / self.row_count().max(1) as f64).max(SMALLEST_ERROR_NM.powi(2))
    }

    /// Whether the driver may have a line of his own: it is not given, and e_y is a signal that he could keep beside.
    fn line_may_be_freed(&self) -> bool {
        let e_y = &self.log.e_y_m;
        e_y.iter().any(|y| *y != e_y[0])
            && self
                .assumed
                .iter()
                .any(|a| [OWN_OFFSET, OWN_BEND].contains(&a.place))
    }

    /// Lets the driver have a line of his own, of which nothing is known but that it is in the lane.
    fn free_line(&mut self) {
        for (i, scale) in [(OWN_OFFSET, 1.0), (OWN_BEND, 1.0 / BEND_RAD_S)] {
            if self.assumed.iter().any(|a| a.place == i) {
                self.bounds[i] = Bounds::new(-LARGEST_LINE_M * scale, LARGEST_LINE_M * scale);
            }
        }
        self.assumed
            .retain(|a| ![OWN_OFFSET, OWN_BEND].contains(&a.place));
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
        let linear = self.linear_sums(p);
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

    /// What was assumed and is estimated all the same.
    fn held(&self) -> impl Iterator<Item = &Assumed> {
        self.assumed.iter().filter(|a| self.is_free(a.place))
    }

    /// The loss with what is known beside the record of what is [`Self::held`].
    fn with_prior(&self, p: &[f64], mut quadratic: Quadratic) -> Quadratic {
        // As so much more of a likelihood whose variance is the loss's own: L (1 + d^2/rows).
        let squares: f64 = self.held().map(|a| ((p[a.place] - a.value) / a.sd).powi(2)).sum();
        quadratic.loss *= 1.0 + squares / self.row_count().max(1) as f64;
        quadratic
    }

    /// [`Self::with_prior`] with the derivatives by what is held too, for sums that have those of the record.
    fn with_prior_by_muscle(&self, p: &[f64], quadratic: Quadratic) -> Quadratic {
        let loss = quadratic.loss;
        let mut quadratic = self.with_prior(p, quadratic);
        let rows = self.row_count().max(1) as f64;
        for a in self.held() {
            let per_sd = loss * 2.0 / (rows * a.sd);
            quadratic.gradient[a.place] += per_sd * (p[a.place] - a.value) / a.sd;
            quadratic.hessian[(a.place, a.place)] += per_sd / a.sd;
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
        point[T_NMS] = self.muscle.t_nms_s;
        for i in [WHEEL, DAMPING] {
            point[i] = self.bounds[i].low;
        }
        point[RHO] = (-std::f64::consts::TAU * corner_hz * self.signals.dt_s).exp();
        for (x, b) in point.iter_mut().zip(&self.bounds) {
            *x = x.clamp(b.low, b.high);
        }
        self.assume_muscle(&point);
        let Bounds { low, high } = self.bounds[T_P];
        let delays = START_DELAYS_S.map(|t_p| t_p.clamp(low, high));
        // The torques of a line of the driver's own need no gain_2, which a fit without them would lose.
        let mut bounds = self.bounds.clone();
        for i in [OWN_OFFSET, OWN_BEND].into_iter().filter(|&i| self.is_free(i)) {
            bounds[i] = Bounds::FREE;
            point[i] = 0.0;
        }
        let best = Delays::new(self, &point, Line::Torques)
            .at(&delays)
            .into_iter()
            .map(|linear| {
                let solution = step(&point, &bounds, &linear, 0.0);
                let gain =
                    -linear.gradient.dot(&solution) - 0.5 * solution.dot(&(&linear.hessian * &solution));
                (linear.loss - gain, solution)
            })
            .zip(delays)
            .min_by(|a, b| a.0.0.total_cmp(&b.0.0));
        let Some(((_, solution), t_p)) = best else {
            return point;
        };
        point[T_P] = t_p;
        let gain_2 = point[1] + solution[1];
        for i in [OWN_OFFSET, OWN_BEND] {
            if self.is_free(i) && gain_2 > LEAST_GAIN_2 {
                point[i] = (solution[i] / gain_2).clamp(self.bounds[i].low, self.bounds[i].high);
            }
        }
        point
    }
}

/// `u` at row `k + shift`, on the line between rows and level beyond the ends.
fn at(u: &[f64], k: usize, shift: f64) -> f64 {
    let place = (k as f64 + shift).clamp(0.0, (u.len() - 1) as f64);
    let (whole, share) = (place as usize, place.fract());
    u[whole] + share * (u[(whole + 1).min(u.len() - 1)] - u[whole])
}
