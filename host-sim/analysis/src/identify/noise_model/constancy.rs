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
//! Changes that go back after some seconds have a level of their own, and so have those to and fro, which are looked for where nothing
//! else is found: `r_t` is then a square wave, of every length of a way and from four instants on, so that the values are a spectrum of the scores.
//!
//! The interval of the instant is where the value is below its maximum by at most `WITHIN_95` of
//! [`super::change_score`] (Hansen, "Sample splitting and threshold estimation", Econometrica 68, 2000).

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::change_score::{BLOCK_S, Block, Fitted, Freed, LOCAL, Local, OFFSET, most};
use super::sums::Rows;
use super::{K_HG, LONGEST_DELAY_S, Line, OWN_OFFSET, Problem, T_P};
use crate::identify::balance::{Balance, balance};
use crate::identify::change::{Change, Constancy, E_Y, T_D};
use crate::identify::result::Refutation;
use crate::identify::search::covariance;
use crate::identify::verdict;

/// How much a change has to add to twice the log likelihood to be declared: at most two in a hundred constant drivers are then
/// declared changed, whatever else their logs have.
const LEVEL: f64 = 20.0;
/// The level of a change that goes back: it has a length besides, and more of them are tried.
const LEVEL_OF_BLIP: f64 = 24.0;
/// The level of a change to and fro, of which more still are tried, in scores that scatter unevenly besides.
const LEVEL_OF_SWING: f64 = 30.0;
/// Above this value a change is not declared yet, but widens the errors of the estimates.
const DOUBT: f64 = 10.0;
/// What a changed delay may lie beyond its bounds, s.
const DELAY_SLACK_S: f64 = 0.05;

/// What may change: its key, the least change that matters, and the direction.
type Direction = (&'static str, f64, Local);

/// The likeliest change of a shape along a direction.
struct Tried {
    deviance: f64,
    level: f64,
    change: Option<Change>,
    freed: Freed,
    /// Share of the blocks that are changed.
    after: f64,
}

impl Tried {
    /// By how much it is beyond its level.
    fn beyond(&self) -> f64 {
        self.deviance - self.level
    }
}

/// Counts of changes of a delay only what delays can do: the likelihood is a parabola about one optimum, and its top may lie where no
/// delay is.
fn possible<T>(parameter: &str, t_p_s: f64, mut tried: Vec<(T, Freed)>) -> Vec<(T, Freed)> {
    let room_s = |by: f64| DELAY_SLACK_S + if by > 0.0 { LONGEST_DELAY_S - t_p_s } else { t_p_s };
    for (_, freed) in tried.iter_mut().filter(|_| parameter == "t_p") {
        let share = |by: f64| (room_s(by) / by.abs()).min(1.0);
        let share = freed.sides_of(T_P).map(share).into_iter().fold(1.0, f64::min);
        freed.deviance *= share * (2.0 - share);
    }
    tried
}

/// Whether what changes is a sensor's. A slow remnant looks like an offset that comes and goes.
fn is_offset(parameter: &str) -> bool {
    [T_D, E_Y].contains(&parameter)
}

/// The likeliest swing of each parameter of the driver.
fn swings(fitted: &Fitted, directions: &[Direction], t_p_s: f64) -> Vec<Tried> {
    let swings = fitted.swings();
    let of = |(parameter, enough, direction): &Direction| {
        let freed = swings
            .iter()
            .filter_map(|(swing, sum)| Some((*swing, fitted.freed(sum, direction)?)));
        let tried = possible(parameter, t_p_s, freed.collect());
        let found @ (swing, freed) = most(&tried)?;
        let deviance = freed.deviance / fitted.wider(|| fitted.swung(*swing), freed);
        let changed = deviance > LEVEL_OF_SWING && freed.by.abs() > *enough;
        Some(Tried {
            deviance,
            level: LEVEL_OF_SWING,
            change: changed.then(|| fitted.change_of_swing(parameter, found)),
            freed: freed.clone(),
            after: fitted.swung(*swing).sum::<f64>() / fitted.blocks.len() as f64,
        })
    };
    directions
        .iter()
        .filter(|d| !is_offset(d.0))
        .filter_map(of)
        .collect()
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
        let directions: [Direction; 6] = [
            ("k_d", 0.1, gains),
            ("k_hg", 0.05, unit(K_HG)),
            ("t_p", 0.015, unit(T_P)),
            (T_D, 0.02, unit(OFFSET)),
            (E_Y, 0.0005, unit(OWN_OFFSET)),
            ("gain_1", 0.1 * p[0], unit(0)),
        ];
        let power = directions
            .iter()
            .map(|(name, _, d)| fitted.power(name, d, [LEVEL, LEVEL_OF_BLIP, LEVEL_OF_SWING]))
            .collect();
        let mut tried = self.steps_and_blips(&fitted, &directions[..5], p[T_P], manual);
        if tried.iter().all(|t| t.change.is_none()) {
            let alone = self.steps_and_blips(&fitted, &directions[5..], p[T_P], manual);
            let more = swings(&fitted, &directions, p[T_P]).into_iter().chain(alone);
            // They refute and widen nothing: of so many, one is often nearly likely.
            tried.extend(more.filter(|t| t.change.is_some()));
        }
        let likelier = |a: Tried, b: Tried| if b.beyond() > a.beyond() { b } else { a };
        let best = tried.into_iter().reduce(likelier)?;
        if best.beyond() > DOUBT - LEVEL {
            let sides: [_; T_P + 1] = std::array::from_fn(|i| best.freed.sides_of(i));
            for (side, share) in [1.0 - best.after, best.after].into_iter().enumerate() {
                for i in 0..=T_P {
                    for j in 0..=T_P {
                        errors[(i, j)] += share * sides[i][side] * sides[j][side];
                    }
                }
            }
        }
        Some(Constancy {
            deviance: best.deviance,
            level: best.level,
            power,
            change: best.change,
        })
    }

    /// The likeliest step of everything that may change, and the likeliest blip of what is the driver's.
    fn steps_and_blips(
        &self,
        fitted: &Fitted,
        directions: &[Direction],
        t_p_s: f64,
        manual: bool,
    ) -> Vec<Tried> {
        let blocks = fitted.blocks.len();
        let mut out = Vec::new();
        for (parameter, enough, direction) in directions {
            let steps = possible(parameter, t_p_s, fitted.steps(direction));
            let Some((at, step)) = most(&steps) else {
                continue;
            };
            let stays = || fitted.within(*at..blocks);
            let wider = fitted.wider(stays, step);
            let deviance = step.deviance / wider;
            let changed = deviance > LEVEL && step.by.abs() > *enough;
            let change = changed.then(|| fitted.change(parameter, direction, &steps, wider));
            let change = change.flatten();
            if change.as_ref().is_some_and(|c| self.is_no_sensor(c, manual)) {
                continue;
            }
            out.push(Tried {
                deviance,
                level: LEVEL,
                change,
                freed: step.clone(),
                after: (blocks - at) as f64 / blocks as f64,
            });
            if is_offset(parameter) {
                continue;
            }
            let blips = possible(parameter, t_p_s, fitted.blips(direction));
            let Some(found @ ([from, to], blip)) = most(&blips) else {
                continue;
            };
            // Its own few blocks would not tell by how much the scores scatter.
            let deviance = blip.deviance / wider;
            let changed = deviance > LEVEL_OF_BLIP && blip.by.abs() > *enough;
            out.push(Tried {
                deviance,
                level: LEVEL_OF_BLIP,
                change: changed.then(|| fitted.change_of_blip(parameter, found)),
                freed: blip.clone(),
                after: (to - from) as f64 / blocks as f64,
            });
        }
        out
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
        let seen = |b: &Balance| b.explained >= verdict::BALANCE_SEEN;
        change.is_some_and(|c| {
            let moved = self.offset_moves(&c, manual, seen);
            moved.is_some_and(|[moved, error]| moved > verdict::CERTAIN * error)
        })
    }

    /// Whether the balance of the column's torques denies that the torque sensor's offset changed: what the torque on the wheel did, a
    /// driver did.
    fn is_no_sensor(&self, change: &Change, manual: bool) -> bool {
        let said = change.by.abs();
        let moved = self.offset_moves(change, manual, Balance::is_close);
        moved.is_some_and(|[moved, error]| moved < 0.5 * said && said - moved > verdict::CERTAIN * error)
    }

    /// By how much the offset of the balance of torques moved the way that the torque sensor's is said to, and its standard error;
    /// none of another change, and where the balance is not as `weighed`.
    fn offset_moves(&self, change: &Change, manual: bool, weighed: fn(&Balance) -> bool) -> Option<[f64; 2]> {
        let is_offset = change.parameter == T_D;
        let sides = is_offset.then(|| self.balances(change, manual)).flatten();
        let [[was, error_was], [is, error]] = sides.filter(|s| s.iter().all(weighed))?.map(|b| b.offset_nm);
        Some([(is - was) * change.by.signum(), error.hypot(error_was)])
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
            let steps = fitted.steps(&unit);
            let before = most(&steps).unwrap().1.deviance;
            let steps = possible("t_p", 0.1, steps);
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
