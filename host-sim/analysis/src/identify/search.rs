//! The search that both estimators share: Gauss-Newton with projected bounds and Levenberg-Marquardt damping.
//!
//! A parameter at a bound that the gradient pushes outwards is held there and the step is solved for the
//! others; a step that would cross a bound stops that parameter on it and is solved again for the rest. Bounds
//! made by a change of variables are not used: they let a search come to rest anywhere near the bound.
//!
//! Terms: the *expected improvement* is what the undamped Gauss-Newton step would take off the loss if the
//! quadratic model were exact; the search ends when that is a small share of the loss.

use std::fmt;

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

/// Loss, gradient and Gauss-Newton matrix at one point.
#[derive(Debug, Clone)]
pub struct Quadratic {
    /// The loss.
    pub loss: f64,
    /// What the loss is compared with to call an improvement small; the loss itself for a sum of squares.
    pub scale: f64,
    /// Gradient of the loss.
    pub gradient: DVector<f64>,
    /// Gauss-Newton approximation of the Hessian.
    pub hessian: DMatrix<f64>,
}

/// Closed interval that a parameter is searched in; infinite ends mean free.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Least value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
}

impl Bounds {
    /// None.
    pub const FREE: Self = Self {
        low: f64::NEG_INFINITY,
        high: f64::INFINITY,
    };

    /// From one value to another.
    #[must_use]
    pub const fn new(low: f64, high: f64) -> Self {
        Self { low, high }
    }

    pub(crate) fn touches(&self, value: f64) -> bool {
        value <= self.low || value >= self.high
    }
}

/// Why a search ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Termination {
    /// The next Gauss-Newton step promises less than the tolerated share of the loss.
    ExpectedImprovement,
    /// Damped steps still lower the loss, but by less than the tolerated share: a direction that the data hardly
    /// determine.
    SmallDecrease,
    /// No step however short lowers the loss: rounding error is reached.
    NoFurtherDecrease,
    /// The limit on iterations was reached; the result is not an optimum.
    IterationLimit,
}

impl fmt::Display for Termination {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::ExpectedImprovement => "the next step promises less than the tolerated share of the loss",
            Self::SmallDecrease => "a step lowers the loss by less than the tolerated share",
            Self::NoFurtherDecrease => "no step lowers the loss",
            Self::IterationLimit => "limit on iterations: this is no optimum",
        })
    }
}

/// Where a search ended.
#[derive(Debug, Clone)]
pub struct Optimum {
    /// The parameters.
    pub point: Vec<f64>,
    /// The loss there.
    pub quadratic: Quadratic,
    /// Loss at the start and after every accepted step.
    pub history: Vec<f64>,
    /// Why there.
    pub termination: Termination,
}

const MAX_ITERATIONS: usize = 60;
/// Beyond this damping a step is lost in rounding.
const MAX_DAMPING: f64 = 1e12;

/// Minimises the loss that `evaluate` describes, from `start`, until the expected improvement is below
/// `tolerance` times the scale. `evaluate` may move the point that it is given to a better one (solve for what is
/// linear, say) and then describes the loss there.
pub fn minimise(
    start: &[f64],
    bounds: &[Bounds],
    tolerance: f64,
    mut evaluate: impl FnMut(&mut [f64]) -> Quadratic,
) -> Optimum {
    let mut point: Vec<f64> = start
        .iter()
        .zip(bounds)
        .map(|(&p, b)| p.clamp(b.low, b.high))
        .collect();
    let quadratic = evaluate(&mut point);
    let began = Optimum {
        history: vec![quadratic.loss],
        point,
        quadratic,
        termination: Termination::IterationLimit,
    };
    resume(began, bounds, tolerance, evaluate)
}

/// Goes on from where a search ended, to another `tolerance`.
pub(crate) fn resume(
    from: Optimum,
    bounds: &[Bounds],
    tolerance: f64,
    mut evaluate: impl FnMut(&mut [f64]) -> Quadratic,
) -> Optimum {
    let Optimum {
        mut point,
        quadratic: mut here,
        mut history,
        ..
    } = from;
    let mut damping = 0.0;
    let mut termination = Termination::IterationLimit;
    for _ in 0..MAX_ITERATIONS {
        let newton = step(&point, bounds, &here, 0.0);
        let improvement = -here.gradient.dot(&newton) - 0.5 * newton.dot(&(&here.hessian * &newton));
        if improvement <= tolerance * here.scale {
            termination = Termination::ExpectedImprovement;
            break;
        }
        let accepted = loop {
            let delta = if damping == 0.0 {
                newton.clone()
            } else {
                step(&point, bounds, &here, damping)
            };
            let mut trial: Vec<f64> = point
                .iter()
                .zip(delta.iter())
                .zip(bounds)
                .map(|((&p, &d), b)| (p + d).clamp(b.low, b.high))
                .collect();
            let there = evaluate(&mut trial);
            if there.loss < here.loss {
                damping = if damping < 1e-6 { 0.0 } else { damping * 0.1 };
                break Some((trial, there));
            }
            damping = if damping == 0.0 { 1e-3 } else { damping * 10.0 };
            if damping > MAX_DAMPING {
                break None;
            }
        };
        match accepted {
            Some((trial, there)) => {
                let decrease = here.loss - there.loss;
                point = trial;
                here = there;
                history.push(here.loss);
                if decrease <= tolerance * here.scale {
                    termination = Termination::SmallDecrease;
                    break;
                }
            }
            None => {
                termination = Termination::NoFurtherDecrease;
                break;
            }
        }
    }
    Optimum {
        point,
        quadratic: here,
        history,
        termination,
    }
}

/// Damped step that respects the bounds to first order: without damping, the minimum of the quadratic model as
/// far as the bounds let it.
pub(crate) fn step(point: &[f64], bounds: &[Bounds], q: &Quadratic, damping: f64) -> DVector<f64> {
    let n = point.len();
    let mut delta = DVector::zeros(n);
    // A parameter without any effect on the loss stays where it is.
    let mut free: Vec<bool> = (0..n)
        .map(|i| {
            let outwards = (point[i] <= bounds[i].low && q.gradient[i] > 0.0)
                || (point[i] >= bounds[i].high && q.gradient[i] < 0.0);
            !outwards && q.hessian[(i, i)] > 0.0
        })
        .collect();
    loop {
        let chosen: Vec<usize> = (0..n).filter(|&i| free[i]).collect();
        let mut right = DVector::from_iterator(chosen.len(), chosen.iter().map(|&i| -q.gradient[i]));
        for (r, &i) in chosen.iter().enumerate() {
            for j in (0..n).filter(|&j| !free[j]) {
                right[r] -= q.hessian[(i, j)] * delta[j];
            }
        }
        let solution = solve_scaled(&q.hessian, &chosen, &right, damping);
        let mut stopped = false;
        for (r, &i) in chosen.iter().enumerate() {
            let target = point[i] + solution[r];
            if target < bounds[i].low || target > bounds[i].high {
                delta[i] = target.clamp(bounds[i].low, bounds[i].high) - point[i];
                free[i] = false;
                stopped = true;
            } else {
                delta[i] = solution[r];
            }
        }
        if !stopped {
            return delta;
        }
    }
}

/// Solves the chosen rows of `(H + damping diag H) x = right` with the unknowns scaled by `sqrt(diag H)`: the
/// parameters differ by orders of magnitude.
fn solve_scaled(h: &DMatrix<f64>, chosen: &[usize], right: &DVector<f64>, damping: f64) -> DVector<f64> {
    let n = chosen.len();
    let scale = DVector::from_iterator(n, chosen.iter().map(|&i| h[(i, i)].sqrt()));
    let matrix = DMatrix::from_fn(n, n, |r, c| {
        let damped = if r == c { damping } else { 0.0 };
        h[(chosen[r], chosen[c])] / (scale[r] * scale[c]) + damped
    });
    let scaled = right.component_div(&scale);
    // Singular to rounding: the smallest correction that makes it solvable, which leaves the direction that
    // the data say nothing about where it is.
    let solution = match matrix.clone().cholesky() {
        Some(c) => c.solve(&scaled),
        None => {
            let eigen = matrix.symmetric_eigen();
            let floor = 1e-12 * eigen.eigenvalues.max();
            let mut along = eigen.eigenvectors.transpose() * scaled;
            for (a, &l) in along.iter_mut().zip(eigen.eigenvalues.iter()) {
                *a = if l > floor { *a / l } else { 0.0 };
            }
            eigen.eigenvectors * along
        }
    };
    solution.component_div(&scale)
}

/// Inverse of a Gauss-Newton matrix over the `chosen` parameters, as a full-size matrix with NaN-free zeros for
/// the others; a parameter that the data do not determine has an infinite variance.
pub(crate) fn covariance(h: &DMatrix<f64>, chosen: &[usize]) -> DMatrix<f64> {
    let size = h.nrows();
    let mut out = DMatrix::zeros(size, size);
    let (dead, live): (Vec<usize>, Vec<usize>) = chosen.iter().partition(|&&i| h[(i, i)] <= 0.0);
    for i in dead {
        out[(i, i)] = f64::INFINITY;
    }
    let n = live.len();
    // Everything given, or without effect: nalgebra has no eigenvalues of an empty matrix.
    if n == 0 {
        return out;
    }
    let scale: Vec<f64> = live.iter().map(|&i| h[(i, i)].sqrt()).collect();
    let eigen =
        DMatrix::from_fn(n, n, |r, c| h[(live[r], live[c])] / (scale[r] * scale[c])).symmetric_eigen();
    let floor = 1e-13 * eigen.eigenvalues.max();
    for r in 0..n {
        for c in 0..n {
            let mut sum = 0.0;
            let mut lost = 0.0;
            for (k, &l) in eigen.eigenvalues.iter().enumerate() {
                let product = eigen.eigenvectors[(r, k)] * eigen.eigenvectors[(c, k)];
                if l > floor {
                    sum += product / l;
                } else {
                    lost += product;
                }
            }
            let undetermined = r == c && lost > 1e-6;
            out[(live[r], live[c])] = if undetermined {
                f64::INFINITY
            } else {
                sum / (scale[r] * scale[c])
            };
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rosenbrock's valley as a sum of two squares, r = (10 (y - x^2), 1 - x): the minimum is at (1, 1), and
    /// on the edge x = 0.5 of a box at (0.5, 0.25), both by hand.
    fn valley(p: &mut [f64]) -> Quadratic {
        let r = DVector::from_vec(vec![10.0 * (p[1] - p[0] * p[0]), 1.0 - p[0]]);
        let j = DMatrix::from_row_slice(2, 2, &[-20.0 * p[0], 10.0, -1.0, 0.0]);
        let loss = 0.5 * r.norm_squared();
        Quadratic {
            loss,
            scale: 1.0,
            gradient: j.transpose() * &r,
            hessian: j.transpose() * j,
        }
    }

    #[test]
    fn a_curved_valley_is_followed_to_its_end_and_to_the_edge_of_a_box() {
        let free = minimise(&[-1.2, 1.0], &[Bounds::FREE; 2], 1e-16, valley);
        assert!(
            (free.point[0] - 1.0).abs() < 1e-6 && (free.point[1] - 1.0).abs() < 1e-6,
            "{:?}",
            free.point
        );
        assert_eq!(free.termination, Termination::ExpectedImprovement);
        assert!(free.history.windows(2).all(|w| w[1] < w[0]));
        let boxed = minimise(
            &[-1.2, 1.0],
            &[Bounds::new(-2.0, 0.5), Bounds::FREE],
            1e-16,
            valley,
        );
        assert!(
            (boxed.point[0] - 0.5).abs() < 1e-9 && (boxed.point[1] - 0.25).abs() < 1e-9,
            "{:?}",
            boxed.point
        );
    }

    /// min (x + y - 3)^2 + 0.01 (x - y)^2 over x <= 1: on the bound y minimises with x = 1 held, so
    /// (y - 2) + 0.01 (y - 1) = 0, y = 2.01 / 1.01. Clamping the free step alone would stop at y = 1.5.
    #[test]
    fn a_step_stopped_by_a_bound_is_solved_again_for_the_others() {
        let evaluate = |p: &mut [f64]| {
            let r = DVector::from_vec(vec![p[0] + p[1] - 3.0, 0.1 * (p[0] - p[1])]);
            let j = DMatrix::from_row_slice(2, 2, &[1.0, 1.0, 0.1, -0.1]);
            let loss = 0.5 * r.norm_squared();
            Quadratic {
                loss,
                scale: loss,
                gradient: j.transpose() * &r,
                hessian: j.transpose() * j,
            }
        };
        let found = minimise(
            &[0.0, 0.0],
            &[Bounds::new(-9.0, 1.0), Bounds::FREE],
            1e-14,
            evaluate,
        );
        assert_eq!(found.point[0], 1.0);
        assert!((found.point[1] - 2.01 / 1.01).abs() < 1e-9);
        assert_eq!(found.history.len(), 2);
    }

    /// H = [[4, 2], [2, 2]] has the inverse [[0.5, -0.5], [-0.5, 1]] by hand; a third parameter without effect
    /// and two that only act together have no variance that the data could bound.
    #[test]
    fn covariance_is_the_inverse_where_there_is_one_and_infinite_where_not() {
        let h = DMatrix::from_row_slice(3, 3, &[4.0, 2.0, 0.0, 2.0, 2.0, 0.0, 0.0, 0.0, 0.0]);
        let c = covariance(&h, &[0, 1, 2]);
        for (i, j, want) in [(0, 0, 0.5), (0, 1, -0.5), (1, 1, 1.0)] {
            assert!((c[(i, j)] - want).abs() < 1e-12);
        }
        assert_eq!(c[(2, 2)], f64::INFINITY);
        let together = DMatrix::from_row_slice(2, 2, &[1.0, 3.0, 3.0, 9.0]);
        let c = covariance(&together, &[0, 1]);
        assert_eq!((c[(0, 0)], c[(1, 1)]), (f64::INFINITY, f64::INFINITY));
        assert_eq!(covariance(&together, &[]), DMatrix::zeros(2, 2));
    }
}
