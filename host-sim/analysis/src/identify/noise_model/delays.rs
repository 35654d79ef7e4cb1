//! The loss over the delay with the disturbance given: what a start is chosen by, and the profile of the likelihood.
//!
//! The filter of the disturbance and the delay may change places, so every signal is filtered once for all delays. The
//! filter starts anew with each stretch, as if its first row had gone on for ever; the difference to a filter that has run
//! through the whole record dies away with theta, and is added.

use std::ops::Range;

use multiversion::multiversion;
use nalgebra::{DMatrix, DVector};

use super::{COUNT, D_LATE, H_LATE, K_HG, K_NMS, LINEAR, Problem, RHO, SMALLEST_ERROR_NM, T_P, THETA, at};
use crate::identify::search::Quadratic;
use crate::identify::signals::{Delay, Lagged};
use crate::identify::wide::BLOCK;

/// Partial sums of each product.
const PARTS: usize = 8;
/// A remainder of the filter's start below this is none.
const NOTHING: f64 = 1e-30;

/// Columns of a block: the three visual ones, the error, and what does not depend on the delay.
struct Block {
    visual: [[f64; BLOCK]; 3],
    error: [f64; BLOCK],
    guidance: [f64; BLOCK],
    ones: [f64; BLOCK],
}

/// Sums of products: visual by visual; visual and the error by the error; those by the guidance; all by one.
#[derive(Clone, Default)]
struct Products {
    visual: [[f64; PARTS]; 6],
    error: [[f64; PARTS]; 4],
    guidance: [[f64; PARTS]; 5],
    ones: [[f64; PARTS]; 5],
}

// What is compiled for several processors has plain loops: iterators and closures would stay calls there.

/// Adds to each of the `sums` the products of a pair of columns.
#[inline(always)]
fn add<const N: usize>(sums: &mut [[f64; PARTS]; N], pairs: [[&[f64; BLOCK]; 2]; N]) {
    let mut here = *sums;
    for part in 0..BLOCK / PARTS {
        for n in 0..N {
            let [a, b] = pairs[n];
            for i in 0..PARTS {
                here[n][i] += a[part * PARTS + i] * b[part * PARTS + i];
            }
        }
    }
    *sums = here;
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn add_products(to: &mut Products, b: &Block) {
    let ([x, y, z], e, h, one) = (&b.visual, &b.error, &b.guidance, &b.ones);
    add(&mut to.visual, [[x, x], [y, x], [y, y], [z, x], [z, y], [z, z]]);
    add(&mut to.error, [[x, e], [y, e], [z, e], [e, e]]);
    add(&mut to.guidance, [[x, h], [y, h], [z, h], [e, h], [h, h]]);
    add(&mut to.ones, [[x, one], [y, one], [z, one], [e, one], [h, one]]);
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn read(delay: &Delay, u: &Lagged, first: usize, value: &mut [f64; BLOCK]) {
    delay.read_block(u, first, value, &mut [0.0; BLOCK]);
}

/// A point of the search whose delay varies.
pub(super) struct Delays<'a> {
    problem: &'a Problem<'a>,
    point: Vec<f64>,
    /// The visual signals through the filter, over the whole record.
    visual: [Lagged; 3],
    /// Of the rows of the loss: T_h through the arm, and the torque without the visual part.
    guidance: Vec<f64>,
    rest: Vec<f64>,
}

impl<'a> Delays<'a> {
    /// With all at `point` but the delay.
    pub(super) fn new(problem: &'a Problem<'a>, point: &[f64]) -> Self {
        let (rho, theta) = (point[RHO], point[THETA]);
        let whole = |u: &[f64]| {
            let mut out = u.to_vec();
            filter(&mut out, rho, theta);
            out
        };
        let visual = problem.signals.visual.each_ref().map(|u| Lagged {
            raw: whole(&u.raw),
            lagged: whole(&u.lagged),
        });
        let rows = problem.row_count();
        let (mut guidance, mut rest) = (Vec::with_capacity(rows), Vec::with_capacity(rows));
        let s = &problem.signals;
        let late = [point[H_LATE] - point[D_LATE], -point[D_LATE]].map(|t| t / s.dt_s);
        let read = |u: &[f64], k: usize, late: f64| if late == 0.0 { u[k] } else { at(u, k, late) };
        for (number, stretch) in problem.stretches.iter().enumerate() {
            let from = rest.len();
            for k in stretch.clone() {
                let h = -read(&s.guidance, k, late[0]);
                let arm = point[K_HG] * h - point[K_NMS] * read(&s.wheel.lagged, k, late[1]);
                guidance.push(h);
                rest.push(s.torque[k] - arm - point[COUNT + number]);
            }
            filter(&mut guidance[from..], rho, theta);
            filter(&mut rest[from..], rho, theta);
        }
        Self {
            problem,
            point: point.to_vec(),
            visual,
            guidance,
            rest,
        }
    }

    /// Loss, and its derivatives by what is linear, at each of the delays `t_p_s`: exact.
    pub(super) fn at(&self, t_p_s: &[f64]) -> Vec<Quadratic> {
        let (problem, p) = (self.problem, &self.point);
        let size = problem.size();
        let delay = |t_p: &f64| problem.signals.delay((t_p + p[D_LATE]).max(0.0));
        let delays: Vec<Delay> = t_p_s.iter().map(delay).collect();
        let empty = Quadratic {
            loss: 0.0,
            scale: 0.0,
            gradient: DVector::zeros(size),
            hessian: DMatrix::zeros(size, size),
        };
        let mut all = vec![empty; delays.len()];
        let mut used = 0;
        for (number, stretch) in problem.stretches.iter().enumerate() {
            for (out, sums) in all.iter_mut().zip(self.products(&delays, stretch, used)) {
                sums.add_to(out, COUNT + number, self.gain(), stretch.len());
            }
            used += stretch.len();
        }
        let least = 0.5 * SMALLEST_ERROR_NM.powi(2) * problem.row_count() as f64;
        let finished = |(mut out, t_p): (Quadratic, &f64)| {
            out.hessian.fill_upper_triangle_with_lower_triangle();
            out.scale = out.loss.max(least);
            let mut point = p.clone();
            point[T_P] = *t_p;
            problem.with_prior(&point, out).0
        };
        all.into_iter().zip(t_p_s).map(finished).collect()
    }

    /// What the filter leaves of a constant.
    fn gain(&self) -> f64 {
        (1.0 - self.point[RHO]) / (1.0 - self.point[THETA])
    }

    /// The sums over a stretch at each of the `delays`; `used` rows of the loss come before it. Block by block: what is read
    /// for one delay is still near for the next.
    fn products(&self, delays: &[Delay], stretch: &Range<usize>, used: usize) -> Vec<Products> {
        let (p, theta) = (&self.point, self.point[THETA]);
        // What the filter's start adds.
        let started = |delay: &Delay| -> [f64; 3] {
            std::array::from_fn(|i| {
                let of = |u: &Lagged| delay.read(u, stretch.start).0;
                self.gain() * of(&self.problem.signals.visual[i]) - of(&self.visual[i])
            })
        };
        let mut added: Vec<[f64; 3]> = delays.iter().map(started).collect();
        let mut sums = vec![Products::default(); delays.len()];
        let mut block = Block {
            visual: [[0.0; BLOCK]; 3],
            error: [0.0; BLOCK],
            guidance: [0.0; BLOCK],
            ones: [0.0; BLOCK],
        };
        let mut rest = [0.0; BLOCK];
        for start in stretch.clone().step_by(BLOCK) {
            let (count, place) = (BLOCK.min(stretch.end - start), used + start - stretch.start);
            block.guidance[..count].copy_from_slice(&self.guidance[place..place + count]);
            rest[..count].copy_from_slice(&self.rest[place..place + count]);
            block.ones[..count].fill(1.0);
            for column in [&mut block.guidance, &mut rest, &mut block.ones] {
                column[count..].fill(0.0);
            }
            for ((delay, sums), added) in delays.iter().zip(&mut sums).zip(&mut added) {
                for ((u, value), more) in self.visual.iter().zip(&mut block.visual).zip(added) {
                    read(delay, u, start, value);
                    if more.abs() > NOTHING {
                        for x in value.iter_mut() {
                            *x += *more;
                            *more *= theta;
                        }
                    }
                    value[count..].fill(0.0);
                }
                let [x, y, z] = &block.visual;
                for (i, (e, rest)) in block.error.iter_mut().zip(&rest).enumerate() {
                    *e = rest - (p[0] * x[i] + p[1] * y[i] + p[2] * z[i]);
                }
                add_products(sums, &block);
            }
        }
        sums
    }
}

impl Products {
    /// Adds a stretch of so many `rows`, whose constant is parameter `o`, to the lower triangle.
    fn add_to(&self, out: &mut Quadratic, o: usize, gain: f64, rows: usize) {
        let sum = |parts: &[f64; PARTS]| parts.iter().sum::<f64>();
        for i in 0..3 {
            out.gradient[i] -= sum(&self.error[i]);
            for j in 0..=i {
                out.hessian[(i, j)] += sum(&self.visual[i * (i + 1) / 2 + j]);
            }
            out.hessian[(K_HG, i)] += sum(&self.guidance[i]);
            out.hessian[(o, i)] = gain * sum(&self.ones[i]);
        }
        out.loss += 0.5 * sum(&self.error[3]);
        out.gradient[K_HG] -= sum(&self.guidance[3]);
        out.gradient[o] = -gain * sum(&self.ones[3]);
        out.hessian[(K_HG, K_HG)] += sum(&self.guidance[4]);
        out.hessian[(o, K_HG)] = gain * sum(&self.ones[4]);
        out.hessian[(o, o)] = gain * gain * rows as f64;
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

const _: () = assert!(LINEAR == 4 && K_HG == 3, "the sums are written out by hand");
