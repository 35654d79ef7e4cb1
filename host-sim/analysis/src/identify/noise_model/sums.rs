//! The loss at a point, with its derivatives, summed over the rows; and every row of a point.

use nalgebra::{DMatrix, DVector};

use super::{CORE, COUNT, DRIVER, LINEAR, Line, Problem, RHO, SMALLEST_ERROR_NM, THETA};
use crate::identify::search::Quadratic;
use crate::identify::wide::{BLOCK, add_products_of_columns};

/// Every row at one point: the error, its negative derivatives by the parameters of [`CORE`], and the disturbance.
pub(super) struct Rows {
    pub(super) columns: Vec<[f64; CORE]>,
    pub(super) errors: Vec<f64>,
    pub(super) disturbance: Vec<f64>,
    /// The negative derivative by the stretch's constant, the same in all rows.
    pub(super) by_constant: f64,
}

impl Problem<'_> {
    /// Loss, and its derivatives by gains, K_hg and the constants at `p`, of which the loss is an exact quadratic; those by
    /// the others are left at zero.
    pub(super) fn linear_sums(&self, p: &[f64]) -> Quadratic {
        self.with_prior(p, self.sums::<{ LINEAR + 1 }>(p))
    }

    /// Loss, and its derivatives by all that is the driver's, at `p`; those by the others are left at zero.
    pub(super) fn driver_sums(&self, p: &[f64]) -> Quadratic {
        self.with_prior(p, self.sums::<{ DRIVER + 1 }>(p))
    }

    /// Loss, and its derivatives by the parameters of [`CORE`] and the constants, at `p`; those by the others are left at zero.
    pub(super) fn core_sums(&self, p: &[f64]) -> Quadratic {
        self.with_prior(p, self.sums::<{ CORE + 1 }>(p))
    }

    /// Loss, gradient and Gauss-Newton matrix by all parameters at `p`.
    pub(super) fn all_sums(&self, p: &[f64]) -> Quadratic {
        self.with_prior_by_muscle(p, self.sums::<{ COUNT + 1 }>(p))
    }

    /// Loss and derivatives of the record alone, by the first `N - 1` parameters and the constants.
    fn sums<const N: usize>(&self, p: &[f64]) -> Quadratic {
        let size = self.size();
        let mut all = Quadratic {
            loss: 0.0,
            scale: 0.0,
            gradient: DVector::zeros(size),
            hessian: DMatrix::zeros(size, size),
        };
        let mut here = Products::<N>::default();
        let mut stretch = 0;
        let place = |stretch: usize| -> [usize; N] {
            std::array::from_fn(|i| if i + 1 < N { i } else { COUNT + stretch })
        };
        self.walk::<N>(p, Line::Size, |number, block| {
            if number != stretch {
                std::mem::take(&mut here).add_to(&mut all, place(stretch));
                stretch = number;
            }
            here.add(&block.columns, &block.errors);
        });
        // A record of which nothing is used has no constant either.
        if !self.stretches.is_empty() {
            here.add_to(&mut all, place(stretch));
        }
        all.hessian.fill_upper_triangle_with_lower_triangle();
        all.scale = all.loss.max(self.least_loss());
        all
    }

    /// Half the sum of squares of errors that no sensor resolves.
    pub(super) fn least_loss(&self) -> f64 {
        0.5 * SMALLEST_ERROR_NM.powi(2) * self.row_count() as f64
    }

    /// Every row at `p`, kept.
    pub(super) fn kept_rows(&self, p: &[f64], line: Line) -> Rows {
        let rows = self.row_count();
        let mut out = Rows {
            columns: Vec::with_capacity(rows),
            errors: Vec::with_capacity(rows),
            disturbance: Vec::with_capacity(rows),
            by_constant: (1.0 - p[RHO]) / (1.0 - p[THETA]),
        };
        self.walk::<{ CORE + 1 }>(p, line, |_, block| {
            let row = |k: usize| std::array::from_fn(|i| block.columns[i][k]);
            out.columns.extend((0..block.count).map(row));
            out.errors.extend_from_slice(&block.errors[..block.count]);
            out.disturbance
                .extend_from_slice(&block.disturbance[..block.count]);
        });
        out
    }
}

/// Sums over a stretch: products of the columns, of those and the errors, and the errors' squares.
pub(super) struct Products<const N: usize> {
    gram: [[f64; N]; N],
    with_errors: [f64; N],
    squares: f64,
}

impl<const N: usize> Default for Products<N> {
    fn default() -> Self {
        Self {
            gram: [[0.0; N]; N],
            with_errors: [0.0; N],
            squares: 0.0,
        }
    }
}

impl<const N: usize> Products<N> {
    pub(super) fn add(&mut self, columns: &[[f64; BLOCK]; N], errors: &[f64; BLOCK]) {
        add_products_of_columns(columns, errors, &mut self.gram, &mut self.with_errors);
        self.squares += errors.iter().map(|e| e * e).sum::<f64>();
    }

    /// Adds them where the columns' parameters are, to the lower triangle.
    pub(super) fn add_to(self, q: &mut Quadratic, places: [usize; N]) {
        q.loss += 0.5 * self.squares;
        for i in 0..N {
            q.gradient[places[i]] -= self.with_errors[i];
            for j in 0..=i {
                let (row, column) = (places[i].max(places[j]), places[i].min(places[j]));
                q.hessian[(row, column)] += self.gram[i][j];
            }
        }
    }
}

const _: () = assert!(BLOCK.is_power_of_two() && LINEAR < DRIVER && DRIVER < CORE && CORE < COUNT);
