//! The loss at a point, with its derivatives, summed over the rows; and every row of a point.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::rows::{
    Block, FEW, Filtered, Gram, MANY, OfErrors, Point, add_errors, add_products, fill, filter_block,
};
use super::{CORE, COUNT, D_LATE, H_LATE, K_HG, K_NMS, Problem, RHO, SMALLEST_ERROR_NM, T_P, THETA};
use crate::identify::search::Quadratic;
use crate::identify::wide::BLOCK;

/// Every row at one point: the error, its negative derivatives by the parameters of [`CORE`], and the disturbance.
pub(super) struct Rows {
    pub(super) columns: Vec<[f64; CORE]>,
    pub(super) errors: Vec<f64>,
    pub(super) disturbance: Vec<f64>,
    /// The negative derivative by the stretch's constant, the same in all rows.
    pub(super) by_constant: f64,
}

impl Problem<'_> {
    fn point(&self, p: &[f64], stretch: usize) -> Point {
        let s = &self.signals;
        Point {
            // T_d is recorded late: all that it answers to is as much longer ago.
            delay: s.delay((p[T_P] + p[D_LATE]).max(0.0)),
            gains: [p[0], p[1], p[2]],
            k_hg: p[K_HG],
            k_nms: p[K_NMS],
            late: [(p[H_LATE] - p[D_LATE]) / s.dt_s, -p[D_LATE] / s.dt_s],
            rho: p[RHO],
            theta: p[THETA],
            constant: p[COUNT + stretch],
        }
    }

    fn blocks_of(&self, stretch: usize) -> impl Iterator<Item = Range<usize>> {
        let Range { start, end } = self.stretches[stretch];
        (start..end).step_by(BLOCK).map(move |k| k..(k + BLOCK).min(end))
    }

    /// Loss, and its derivatives by gains, K_hg, the constants and, `with_delay`, t_p, at `p`; those by the others are left at
    /// zero. By all but t_p the quadratic is exact.
    pub(super) fn light_sums(&self, p: &[f64], with_delay: bool) -> Quadratic {
        let sums = self.sums::<FEW>(p, if with_delay { T_P + 1 } else { T_P });
        self.with_prior(p, sums).0
    }

    /// Loss, and its derivatives by the parameters of [`CORE`] and the constants, at `p`; those by the others are left at zero.
    pub(super) fn core_sums(&self, p: &[f64]) -> Quadratic {
        self.with_prior(p, self.sums::<FEW>(p, CORE)).0
    }

    /// Loss, gradient and Gauss-Newton matrix by all parameters at `p`.
    pub(super) fn all_sums(&self, p: &[f64]) -> Quadratic {
        self.with_prior_by_t_nms(p, self.sums::<MANY>(p, COUNT))
    }

    /// Of the record alone, by the first `parameters` and the constants.
    fn sums<const L: usize>(&self, p: &[f64], parameters: usize) -> Quadratic {
        let mut sums = Sums::new(self, parameters);
        let (mut block, mut filtered) = (Block::EMPTY, Filtered::SILENT);
        for stretch in 0..self.stretches.len() {
            let point = self.point(p, stretch);
            let mut gram: Gram<L> = [[0.0; L]; L];
            let mut of_errors = OfErrors::NONE;
            let mut slow = None;
            filtered.begun = false;
            for rows in self.blocks_of(stretch) {
                let count = rows.len();
                fill(&self.signals, &point, rows.clone(), &mut block);
                if L == MANY {
                    block.fill_sensors(&self.signals, &point, rows, &mut slow);
                }
                filter_block(&point, &block, count, &mut filtered);
                add_products(&mut gram, &filtered.columns[..count]);
                add_errors(&mut of_errors, &filtered, count);
            }
            sums.add(stretch, &gram, if L == MANY { COUNT } else { CORE }, &of_errors);
        }
        sums.quadratic
    }

    /// Every row at `p`, kept.
    pub(super) fn kept_rows(&self, p: &[f64]) -> Rows {
        let rows = self.row_count();
        let mut out = Rows {
            columns: Vec::with_capacity(rows),
            errors: Vec::with_capacity(rows),
            disturbance: Vec::with_capacity(rows),
            by_constant: (1.0 - p[RHO]) / (1.0 - p[THETA]),
        };
        let (mut block, mut filtered) = (Block::EMPTY, Filtered::<FEW>::SILENT);
        for stretch in 0..self.stretches.len() {
            let point = self.point(p, stretch);
            filtered.begun = false;
            for rows in self.blocks_of(stretch) {
                let count = rows.len();
                fill(&self.signals, &point, rows, &mut block);
                filter_block(&point, &block, count, &mut filtered);
                for [a, b, c, d, e, f, g, _] in &filtered.columns[..count] {
                    out.columns.push([*a, *b, *c, *d, *e, *f, *g]);
                }
                out.errors.extend_from_slice(&filtered.errors[..count]);
                out.disturbance.extend_from_slice(&block.disturbance[..count]);
            }
        }
        out
    }
}

/// The quadratic that the sums of the stretches add up to.
struct Sums {
    quadratic: Quadratic,
    least: f64,
    parameters: usize,
}

impl Sums {
    fn new(problem: &Problem<'_>, parameters: usize) -> Self {
        let size = problem.size();
        Self {
            quadratic: Quadratic {
                loss: 0.0,
                scale: 0.0,
                gradient: DVector::zeros(size),
                hessian: DMatrix::zeros(size, size),
            },
            least: 0.5 * SMALLEST_ERROR_NM.powi(2) * problem.row_count() as f64,
            parameters,
        }
    }

    /// Adds those of a stretch, whose `constant` is that column.
    fn add<const L: usize>(&mut self, stretch: usize, gram: &Gram<L>, constant: usize, errors: &OfErrors<L>) {
        let q = &mut self.quadratic;
        q.loss += 0.5 * errors.squares;
        q.scale = q.loss.max(self.least);
        let o = COUNT + stretch;
        for i in 0..self.parameters {
            q.gradient[i] -= errors.by_column[i];
            let mixed = gram[i.max(constant)][i.min(constant)];
            (q.hessian[(o, i)], q.hessian[(i, o)]) = (mixed, mixed);
            for j in 0..self.parameters {
                q.hessian[(i, j)] += gram[i.max(j)][i.min(j)];
            }
        }
        q.gradient[o] = -errors.by_column[constant];
        q.hessian[(o, o)] = gram[constant][constant];
    }
}
