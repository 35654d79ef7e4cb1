//! Is the driver the same throughout? A score test of a change at an unknown instant.
//!
//! With the regressors x_t of a row (the negative derivatives of its prediction error e_t by gains, K_hg, t_p and the constants),
//! a change by delta along the direction d, of which the share r_t has come at row t, is one more regressor,
//! `z_t = r_t d' x_t`. What the other parameters take up of it is taken out, and so is an offset of T_d that changes with it:
//! a sensor that drifts is no driver who changes. Such an offset is also tried alone. With `H = sum x x'` and z the rest, freeing delta adds
//! `(sum e_t z_t)^2/(s^2 sum z_t^2)` to twice the log likelihood, to first order (Andrews, "Tests for parameter instability and
//! structural change with unknown change point", Econometrica 61, 1993). The largest over instants and directions is held
//! against [`LEVEL`]. Sums over blocks of [`BLOCK_S`] hold all that this takes.
//!
//! An instant's interval is where that falls short of its largest by at most [`super::change_score`]'s `WITHIN_95` (Hansen, "Sample splitting and
//! threshold estimation", Econometrica 68, 2000).

use nalgebra::{DMatrix, DVector};

use std::ops::Range;

use super::change_score::{BLOCK_S, Block, Fitted, LOCAL, Local, OWN, largest};
use super::sums::Rows;
use super::{K_HG, Problem, T_P};
use crate::identify::balance::balance;
use crate::identify::change::{Change, Constancy, OFFSET};
use crate::identify::search::covariance;
use crate::identify::verdict::{self, Refutation};

/// What a change has to add to twice the log likelihood: two constant drivers in a hundred at most are said to have changed.
const LEVEL: f64 = 16.0;

impl Problem<'_> {
    /// Whether the driver was the same throughout; none if there is nothing to estimate.
    pub(super) fn constancy(&self, p: &[f64], kept: &Rows, variance: f64) -> Option<Constancy> {
        let blocks = self.blocks_in_time(kept);
        let fitted = self.fitted(&blocks, variance);
        let free = |i: usize| if self.is_free(i) { 1.0 } else { 0.0 };
        let mut directions: Vec<(&'static str, f64, Local)> = Vec::new();
        let mut gains = [0.0; LOCAL];
        for i in 0..3 {
            gains[i] = free(i) * p[i];
        }
        directions.push(("k_d", 0.1, gains));
        for (name, place, enough) in [("k_hg", K_HG, 0.05), ("t_p", T_P, 0.015)] {
            let mut one = [0.0; LOCAL];
            one[place] = free(place);
            directions.push((name, enough, one));
        }
        let mut offset = [0.0; LOCAL];
        offset[OWN] = 1.0;
        directions.push((OFFSET, 0.02, offset));
        let mut best: Option<Constancy> = None;
        for (parameter, enough, direction) in directions.iter().filter(|d| d.2.iter().any(|&x| x != 0.0)) {
            let along = fitted.along(*direction);
            let steps = fitted.steps(&along);
            let Some((at, step)) = largest(&steps) else {
                continue;
            };
            let wider = fitted.wider(&along, &fitted.shares([at, at]), step);
            let deviance = step.deviance / wider;
            if best.as_ref().is_some_and(|b| b.deviance >= deviance) {
                continue;
            }
            let changed = deviance > LEVEL && step.by.abs() > *enough;
            let change = changed.then(|| fitted.change(parameter, &along, &steps, (at, step), wider));
            best = Some(Constancy {
                deviance,
                level: LEVEL,
                change,
            });
        }
        best
    }

    /// What the torques on the column say of the sensors before and after the middle of a change.
    pub(super) fn changed_sensor(&self, change: &Change, manual: bool) -> Option<Refutation> {
        let middle_s = 0.5 * (change.at_s[0] + change.at_s[1]);
        let side = |rows: Range<usize>| {
            let cut = |s: &Range<usize>| s.start.max(rows.start)..s.end.min(rows.end);
            let stretches: Vec<Range<usize>> = self
                .stretches
                .iter()
                .map(cut)
                .filter(|s| s.start < s.end)
                .collect();
            balance(self.log, &stretches, manual)
        };
        let middle = ((middle_s - self.log.start_s) / self.log.dt_s).max(0.0) as usize;
        let sides = [side(0..middle), side(middle..self.log.len())];
        let [Some(before), Some(after)] = sides else {
            return None;
        };
        verdict::of_changed_sensor(change, &before, &after)
    }

    fn blocks_in_time(&self, kept: &Rows) -> Vec<Block> {
        let length = ((BLOCK_S / self.signals.dt_s).round() as usize).max(1);
        let mut out = Vec::new();
        let mut row = 0;
        for (stretch, rows) in self.stretches.iter().enumerate() {
            for from in rows.clone().step_by(length) {
                let count = length.min(rows.end - from);
                let mut block = Block {
                    stretch,
                    from_s: self.log.time_s(from),
                    to_s: self.log.time_s(from + count),
                    score: [0.0; LOCAL],
                    gram: [[0.0; LOCAL]; LOCAL],
                };
                for (columns, error) in kept.columns[row..row + count].iter().zip(&kept.errors[row..]) {
                    let mut x = [kept.by_constant; LOCAL];
                    x[..OWN].copy_from_slice(&columns[..OWN]);
                    for i in 0..LOCAL {
                        block.score[i] += error * x[i];
                        for j in 0..=i {
                            block.gram[i][j] += x[i] * x[j];
                        }
                    }
                }
                for i in 0..LOCAL {
                    for j in 0..i {
                        block.gram[j][i] = block.gram[i][j];
                    }
                }
                row += count;
                out.push(block);
            }
        }
        out
    }

    fn fitted<'a>(&self, blocks: &'a [Block], variance: f64) -> Fitted<'a> {
        let size = OWN + self.stretches.len();
        let (mut hessian, mut score) = (DMatrix::zeros(size, size), DVector::zeros(size));
        for block in blocks {
            for i in 0..LOCAL {
                score[block.place(i)] += block.score[i];
                for j in 0..LOCAL {
                    hessian[(block.place(i), block.place(j))] += block.gram[i][j];
                }
            }
        }
        let chosen: Vec<usize> = (0..size).filter(|&i| i >= OWN || self.is_free(i)).collect();
        let inverse = covariance(&hessian, &chosen).map(|x| if x.is_finite() { x } else { 0.0 });
        Fitted {
            blocks,
            size,
            step: &inverse * score,
            inverse,
            variance,
        }
    }
}
