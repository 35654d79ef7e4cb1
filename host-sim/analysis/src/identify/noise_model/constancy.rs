//! Tests whether the driver is the same throughout a recording: a score test for a change at an unknown instant.
//!
//! Let x_t be the regressors of row t: the negative derivatives of its prediction error e_t with respect to gains,
//! K_hg, t_p and constants. A change of the parameters by delta in the direction d, of which the share r_t has
//! happened at row t, acts like one more regressor, `z_t = r_t d' x_t`. The part of z that the other parameters can
//! explain is removed, and so is the part that a simultaneous change of the offset of T_d explains, because a
//! drifting sensor is not a changed driver. A change of that offset alone is tested too, and a change of the offset
//! of e_y, which acts as a slope of T_d. With z the remainder, estimating delta adds
//! `(sum e_t z_t)^2/(s^2 sum z_t^2)` to twice the log likelihood, to first order (Andrews, "Tests for parameter
//! instability and structural change with unknown change point", Econometrica 61, 1993). The largest value over all
//! instants and directions is compared with [`LEVEL`]. Everything is computed from sums over blocks of [`BLOCK_S`].
//!
//! The interval of the instant is where the value is below its maximum by at most `WITHIN_95` of
//! [`super::change_score`] (Hansen, "Sample splitting and threshold estimation", Econometrica 68, 2000).

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::change_score::{BLOCK_S, Block, Fitted, Freed, LOCAL, Local, OFFSET, most};
use super::delays::Line;
use super::sums::Rows;
use super::{K_HG, LONGEST_DELAY_S, OWN_OFFSET, Problem, T_P};
use crate::identify::balance::{Balance, balance};
use crate::identify::change::{Change, Constancy, E_Y, T_D};
use crate::identify::result::Refutation;
use crate::identify::search::covariance;
use crate::identify::verdict;

/// How much a change has to add to twice the log likelihood to be declared: at most two in a hundred constant drivers are then
/// declared changed, whatever else their logs have.
const LEVEL: f64 = 20.0;
/// The level of a change that goes back: it has a length besides, and more of them are tried.
const BLIP_LEVEL: f64 = 24.0;
/// Above this value a change is not declared yet, but widens the errors of the estimates.
const DOUBT: f64 = 10.0;
/// What a changed delay may lie beyond its bounds, s.
const DELAY_SLACK_S: f64 = 0.05;

/// Counts of changes of a delay only what delays can do: the likelihood is a parabola about one optimum, and its top may lie where no
/// delay is.
fn hold_possible<T>(t_p_s: f64, tried: &mut [(T, Freed)]) {
    let room_s = |by: f64| DELAY_SLACK_S + if by > 0.0 { LONGEST_DELAY_S - t_p_s } else { t_p_s };
    for (_, freed) in tried {
        let share = |by: f64| (room_s(by) / by.abs()).min(1.0);
        let share = freed.sides_of(T_P).map(share).into_iter().fold(1.0, f64::min);
        freed.deviance *= share * (2.0 - share);
    }
}

impl Problem<'_> {
    /// Whether the driver was the same throughout; `None` if there is nothing to estimate. A change that is likely
    /// but not certain widens `errors` by the mean squared distance of the changed driver from the estimate over the
    /// recording.
    pub(super) fn constancy(
        &self,
        p: &[f64],
        variance: f64,
        manual: bool,
        errors: &mut DMatrix<f64>,
    ) -> Option<Constancy> {
        // By torques: where a line moves, gain_2 is lost, and a line by its size with it.
        let fitted = self.fitted(&self.kept_rows(p, Line::Torques), variance);
        let unit = |i: usize| Local::from_fn(|j, _| f64::from(i == j && (i > T_P || self.is_free(i))));
        let gains = (0..3).map(|i| unit(i) * p[i]).sum();
        let directions: [(&'static str, f64, Local); 5] = [
            ("k_d", 0.1, gains),
            ("k_hg", 0.05, unit(K_HG)),
            ("t_p", 0.015, unit(T_P)),
            (T_D, 0.02, unit(OFFSET)),
            (E_Y, 0.0005, unit(OWN_OFFSET)),
        ];
        let levels = [LEVEL, BLIP_LEVEL];
        let power = directions
            .iter()
            .map(|(name, _, d)| fitted.power(name, d, levels))
            .collect();
        let mut best: Option<(Constancy, [DVector<f64>; 2], f64)> = None;
        let blocks = fitted.blocks.len();
        let mut take = |found: Constancy, freed: &Freed, changed: Range<usize>| {
            if best.as_ref().is_none_or(|b| b.0.beyond() < found.beyond()) {
                let share = changed.len() as f64 / blocks as f64;
                best = Some((found, fitted.sides(freed, changed), share));
            }
        };
        for (parameter, enough, direction) in &directions {
            let mut steps = fitted.steps(direction);
            if *parameter == "t_p" {
                hold_possible(p[T_P], &mut steps);
            }
            let Some((at, step)) = most(&steps) else {
                continue;
            };
            let wider = fitted.wider(*at, step);
            let deviance = step.deviance / wider;
            let changed = deviance > LEVEL && step.by.abs() > *enough;
            let change = changed.then(|| fitted.change(parameter, direction, &steps, wider));
            let change = change.flatten();
            if change.as_ref().is_some_and(|c| self.is_no_sensor(c, manual)) {
                continue;
            }
            let found = Constancy {
                deviance,
                level: LEVEL,
                power: Vec::new(),
                change,
            };
            take(found, step, *at..blocks);
            // A slow remnant looks like an offset that comes and goes.
            let mut blips = if [T_D, E_Y].contains(parameter) {
                Vec::new()
            } else {
                fitted.blips(direction)
            };
            if *parameter == "t_p" {
                hold_possible(p[T_P], &mut blips);
            }
            let Some(found @ ([from, to], blip)) = most(&blips) else {
                continue;
            };
            // Its own few blocks would not tell by how much the scores scatter.
            let deviance = blip.deviance / wider;
            let changed = deviance > BLIP_LEVEL && blip.by.abs() > *enough;
            let constancy = Constancy {
                deviance,
                level: BLIP_LEVEL,
                power: Vec::new(),
                change: changed.then(|| fitted.change_of_blip(parameter, found)),
            };
            take(constancy, blip, *from..*to);
        }
        let (mut constancy, sides, after) = best?;
        constancy.power = power;
        if constancy.deviance - constancy.level > DOUBT - LEVEL {
            for (side, share) in sides.iter().zip([1.0 - after, after]) {
                for i in 0..=T_P {
                    for j in 0..=T_P {
                        errors[(i, j)] += share * side[i] * side[j];
                    }
                }
            }
        }
        Some(constancy)
    }

    /// Whether the balance of the column's torques shows that a sensor changed, before against after the middle of a
    /// change.
    pub(super) fn changed_sensor(&self, change: &Change, manual: bool) -> Option<Refutation> {
        let [before, after] = &self.balances(change, manual)?;
        verdict::of_changed_sensor(change, self.span_s(), [before, after])
    }

    /// Whether the torque sensor's offset changed, rather than that the driver keeps a line of his own: a line is a slope of the
    /// torque, and looks like an offset that drifts. The balance of the column's torques tells one from the other, for whatever
    /// torque a driver makes turns the wheel; where it cannot be weighed, nothing does, and it is a line.
    pub(super) fn torque_moves(&self, p: &[f64], variance: f64, manual: bool) -> bool {
        let mut unused = DMatrix::zeros(self.size(), self.size());
        let change = self
            .constancy(p, variance, manual, &mut unused)
            .and_then(|c| c.change);
        let Some(change) = change.filter(|c| c.parameter == T_D) else {
            return false;
        };
        let weighed = |b: &Balance| b.explained >= verdict::BALANCE_SEEN;
        let sides = self.balances(&change, manual);
        sides.filter(|s| s.iter().all(weighed)).is_some_and(|sides| {
            let [[was, error_was], [is, error]] = sides.map(|b| b.offset_nm);
            let moved = is - was;
            moved * change.by > 0.0 && moved.abs() > verdict::CERTAIN * error.hypot(error_was)
        })
    }

    /// Whether the balance of the column's torques denies that the torque sensor's offset changed: what the torque on the wheel did, a
    /// driver did.
    fn is_no_sensor(&self, change: &Change, manual: bool) -> bool {
        let Some(sides) = Some(change)
            .filter(|c| c.parameter == T_D)
            .and_then(|c| self.balances(c, manual))
        else {
            return false;
        };
        let is_weighed = sides.iter().all(Balance::is_close);
        let [[was, error_was], [is, error]] = sides.map(|b| b.offset_nm);
        let (moved, said) = ((is - was) * change.by.signum(), change.by.abs());
        is_weighed && moved < 0.5 * said && said - moved > verdict::CERTAIN * error.hypot(error_was)
    }

    /// The balances of the column's torques before and after the middle of a change.
    fn balances(&self, change: &Change, manual: bool) -> Option<[Balance; 2]> {
        let middle_s = 0.5 * (change.at_s[0] + change.at_s[1]);
        let side = |rows: Range<usize>| {
            let cut = |s: &Range<usize>| s.start.max(rows.start)..s.end.min(rows.end);
            let cut = self.stretches.iter().map(cut).filter(|s| s.start < s.end);
            balance(self.log, &cut.collect::<Vec<_>>(), manual)
        };
        let middle = ((middle_s - self.log.start_s) / self.log.dt_s).max(0.0) as usize;
        Some([side(0..middle)?, side(middle..self.log.len())?])
    }

    /// First and last time of the rows in use, s.
    pub(super) fn span_s(&self) -> [f64; 2] {
        let ends = self.stretches.first().zip(self.stretches.last());
        ends.map_or([0.0; 2], |(first, last)| {
            [first.start, last.end].map(|k| self.log.time_s(k))
        })
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
                    score: Local::zeros(),
                    gram: Default::default(),
                };
                let rows = kept.columns[row..row + count].iter().zip(&kept.errors[row..]);
                for (columns, error) in rows {
                    let mut x = Local::repeat(kept.by_constant);
                    x.as_mut_slice()[..OFFSET].copy_from_slice(&columns[..OFFSET]);
                    block.score += x * *error;
                    block.gram += x * x.transpose();
                }
                row += count;
                out.push(block);
            }
        }
        out
    }

    fn fitted(&self, kept: &Rows, variance: f64) -> Fitted {
        let blocks = self.blocks_in_time(kept);
        let size = OFFSET + self.stretches.len();
        let (mut hessian, mut score) = (DMatrix::zeros(size, size), DVector::zeros(size));
        for block in &blocks {
            for i in 0..LOCAL {
                score[block.place(i)] += block.score[i];
                for j in 0..LOCAL {
                    hessian[(block.place(i), block.place(j))] += block.gram[(i, j)];
                }
            }
        }
        let chosen: Vec<usize> = (0..size).filter(|&i| i >= OFFSET || self.is_free(i)).collect();
        let inverse = covariance(&hessian, &chosen).map(|x| if x.is_finite() { x } else { 0.0 });
        Fitted {
            blocks,
            step: &inverse * score,
            inverse,
            variance,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Forty blocks of information 1 each on t_p, fitted as constant at 0.1 s, of which either side lies off by half of `by`. Of 0.2 s all
    /// counts; of 0.4 s the lower side would lie at -0.1 s, of which -0.05 s are left to it: three quarters, and so 1 - (1/4)^2 of the
    /// deviance, whichever side comes first.
    #[test]
    fn a_delay_changes_by_what_a_delay_can() {
        let unit = Local::from_fn(|j, _| f64::from(j == T_P));
        let deviances = |by: f64| {
            let half = |k: usize| if k < 20 { -0.5 * by } else { 0.5 * by };
            let block = |k: usize| Block {
                stretch: 0,
                from_s: k as f64,
                to_s: k as f64 + 1.0,
                score: unit * half(k),
                gram: unit * unit.transpose(),
            };
            let mut inverse = DMatrix::zeros(LOCAL, LOCAL);
            inverse[(T_P, T_P)] = 1.0 / 40.0;
            let fitted = Fitted {
                blocks: (0..40).map(block).collect(),
                inverse,
                step: DVector::zeros(LOCAL),
                variance: 1.0,
            };
            let mut steps = fitted.steps(&unit);
            let before = most(&steps).unwrap().1.deviance;
            hold_possible(0.1, &mut steps);
            [before, steps.iter().find(|s| s.0 == 20).unwrap().1.deviance]
        };
        for sign in [1.0, -1.0] {
            let [before, held] = deviances(0.2 * sign);
            assert!(
                (before - 0.4).abs() < 1e-9 && (held - 0.4).abs() < 1e-9,
                "{before} {held}"
            );
            let [before, held] = deviances(0.4 * sign);
            assert!(
                (before - 1.6).abs() < 1e-9 && (held - 1.5).abs() < 1e-9,
                "{before} {held}"
            );
        }
    }
}
