//! The loss over the delay with the disturbance given: what a start is chosen by, and the profile of the likelihood.
//!
//! The filter of the disturbance and the delay may change places, so every signal is filtered once for all delays. The
//! filter starts anew with each stretch, as if its first row had gone on for ever; the difference to a filter that has run
//! through the whole record dies away with theta, and is added.

use nalgebra::{DMatrix, DVector};

use super::sums::Products;
use super::{COUNT, D_LATE, H_LATE, K_HG, K_NMS, Line, OWN_BEND, OWN_OFFSET, Problem, RHO, T_P, THETA, at};
use crate::identify::search::Quadratic;
use crate::identify::signals::{Delay, Lagged};
use crate::identify::wide::BLOCK;

/// A remainder of the filter's start below this is none.
const NOTHING: f64 = 1e-30;

/// A point of the search whose delay varies.
pub(super) struct Delays<'a> {
    problem: &'a Problem<'a>,
    point: Vec<f64>,
    /// What is seen, and the driver's line in bends, through the filter, over the whole record; and before it.
    seen: [[Lagged; 2]; 4],
    /// What does not depend on the delay, in the rows of the loss: T_h through the arm, the driver's offset; and T_d less all that is seen.
    fixed: [Vec<f64>; 2],
    rest: Vec<f64>,
}

/// Places of what is seen and of what does not depend on the delay.
const SEEN: [usize; 4] = [0, 1, 2, OWN_BEND];
const FIXED: [usize; 2] = [K_HG, OWN_OFFSET];

impl<'a> Delays<'a> {
    /// Holds all at `point` but the delay.
    pub(super) fn new(problem: &'a Problem<'a>, point: &[f64], line: Line) -> Self {
        let (p, s) = (point, &problem.signals);
        let mix = |parts: &[(f64, &Lagged)], ramp: f64| {
            let of = |pick: fn(&Lagged) -> &Vec<f64>| -> Vec<f64> {
                let sum = |k: usize| parts.iter().map(|(w, u)| w * pick(u)[k]).sum::<f64>();
                (0..s.torque.len())
                    .map(|k| sum(k) + ramp * k as f64 * s.dt_s)
                    .collect()
            };
            Lagged {
                raw: of(|u| &u.raw),
                lagged: of(|u| &u.lagged),
            }
        };
        let ([e_y, whole, e_theta], [turn, heading], bend) = (&s.visual, &s.road, p[OWN_BEND]);
        let of_bends: &[(f64, &Lagged)] = match line {
            Line::Torques => &[(1.0, heading)],
            Line::Size => &[(p[0], turn), (p[1], heading)],
        };
        let raw = [
            mix(&[(1.0, e_y), (bend, turn)], 0.0),
            mix(&[(1.0, whole), (bend, heading)], p[OWN_OFFSET]),
            e_theta.clone(),
            mix(of_bends, 0.0),
        ];
        let whole = |u: &Lagged| {
            let mut out = u.clone();
            filter(&mut out.raw, p[RHO], p[THETA]);
            filter(&mut out.lagged, p[RHO], p[THETA]);
            out
        };
        let by_offset = if line == Line::Size { p[1] } else { 1.0 };
        let rows = problem.row_count();
        let mut fixed = [Vec::with_capacity(rows), Vec::with_capacity(rows)];
        let mut rest = Vec::with_capacity(rows);
        let late = [p[H_LATE] - p[D_LATE], -p[D_LATE]].map(|t| t / s.dt_s);
        let read = |u: &[f64], k: usize, late: f64| if late == 0.0 { u[k] } else { at(u, k, late) };
        for (number, stretch) in problem.stretches.iter().enumerate() {
            let from = rest.len();
            for k in stretch.clone() {
                let h = -read(&s.guidance, k, late[0]);
                let arm = p[K_HG] * h - p[K_NMS] * read(&s.wheel.lagged, k, late[1]);
                fixed[0].push(h);
                fixed[1].push(by_offset * k as f64 * s.dt_s);
                rest.push(s.torque[k] - arm - p[COUNT + number]);
            }
            for column in fixed.iter_mut().chain([&mut rest]) {
                filter(&mut column[from..], p[RHO], p[THETA]);
            }
        }
        Self {
            problem,
            point: point.to_vec(),
            seen: raw.map(|u| [whole(&u), u]),
            fixed,
            rest,
        }
    }

    /// Loss, and its derivatives by what it is a quadratic of, at each of the delays `t_p_s`: exact.
    pub(super) fn at(&self, t_p_s: &[f64]) -> Vec<Quadratic> {
        t_p_s.iter().map(|&t_p| self.at_one(t_p)).collect()
    }

    fn at_one(&self, t_p_s: f64) -> Quadratic {
        let (problem, p) = (self.problem, &self.point);
        let size = problem.size();
        let mut out = Quadratic {
            loss: 0.0,
            scale: 0.0,
            gradient: DVector::zeros(size),
            hessian: DMatrix::zeros(size, size),
        };
        let delay = problem.signals.delay((t_p_s + p[D_LATE]).max(0.0));
        let mut used = 0;
        for (number, stretch) in problem.stretches.iter().enumerate() {
            let mut sums = Products::default();
            // What the filter's start adds.
            let mut more = [0, 1, 2, 3].map(|i| {
                let [through, raw] = self.seen[i].each_ref().map(|u| delay.read(u, stretch.start).0);
                self.gain() * raw - through
            });
            for first in stretch.clone().step_by(BLOCK) {
                let count = BLOCK.min(stretch.end - first);
                self.add_block(&mut sums, &delay, &mut more, [first, used, count]);
                used += count;
            }
            let [a, b, c, d] = SEEN;
            let [e, f] = FIXED;
            sums.add_to(&mut out, [a, b, c, d, e, f, COUNT + number]);
        }
        out.hessian.fill_upper_triangle_with_lower_triangle();
        out.scale = out.loss.max(problem.least_loss());
        let mut point = p.clone();
        point[T_P] = t_p_s;
        problem.with_prior(&point, out)
    }

    /// Adds a block of so many rows from the record's row `first`, the loss's row `used` on.
    fn add_block(
        &self,
        sums: &mut Products<7>,
        delay: &Delay,
        more: &mut [f64; 4],
        [first, used, count]: [usize; 3],
    ) {
        let (p, theta) = (&self.point, self.point[THETA]);
        let mut columns = [[0.0; BLOCK]; 7];
        let mut errors = [0.0; BLOCK];
        for (([through, _], column), more) in self.seen.iter().zip(&mut columns).zip(more) {
            delay.read_block(through, first, column, &mut [0.0; BLOCK]);
            if more.abs() > NOTHING {
                for x in column.iter_mut() {
                    *x += *more;
                    *more *= theta;
                }
            }
        }
        for (column, u) in columns[4..6]
            .iter_mut()
            .chain([&mut errors])
            .zip(self.fixed.iter().chain([&self.rest]))
        {
            column[..count].copy_from_slice(&u[used..used + count]);
        }
        columns[6] = [self.gain(); BLOCK];
        for (i, e) in errors.iter_mut().enumerate() {
            *e -= p[0] * columns[0][i] + p[1] * columns[1][i] + p[2] * columns[2][i];
        }
        for column in columns.iter_mut().chain([&mut errors]) {
            column[count..].fill(0.0);
        }
        sums.add(&columns, &errors);
    }

    /// What the filter leaves of a constant.
    fn gain(&self) -> f64 {
        (1.0 - self.point[RHO]) / (1.0 - self.point[THETA])
    }
}

/// `(1 - rho/q)/(1 - theta/q)` applied to `u`, as if its first value had gone on for ever.
pub(super) fn filter(u: &mut [f64], rho: f64, theta: f64) {
    let Some(&first) = u.first() else { return };
    let mut last = first;
    let mut out = (1.0 - rho) / (1.0 - theta) * first;
    for x in u {
        out = theta * out + (*x - rho * last);
        last = std::mem::replace(x, out);
    }
}
