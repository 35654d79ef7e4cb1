//! What freeing a change along one direction adds, for every instant and shape: the sums behind [`super::constancy`].

use std::ops::Range;

use nalgebra::{DMatrix, DVector, SMatrix, SVector};

use super::DRIVER;
use crate::identify::change::{BLIP_S, Change, Power, SWING_S, Shape};

/// Length of the blocks, s: instants are not told finer.
pub(super) const BLOCK_S: f64 = 1.0;
/// An instant counts from this share of the largest information that any instant has on the change.
const LEAST_SHARE: f64 = 0.12;
/// 95 % point of the likelihood ratio of an instant.
const WITHIN_95: f64 = 7.35;
/// What a drift has to add beyond a step, for its length is one more unknown.
const BEYOND_STEP: f64 = 9.0;
/// Lengths of a drift that are tried, s.
const DRIFTS_S: [f64; 9] = [6.0, 10.0, 15.0, 22.0, 32.0, 45.0, 65.0, 95.0, 140.0];

/// Lengths of a blip that are tried, s.
const BLIPS_S: [f64; 5] = [5.0, 8.0, 12.0, 18.0, 27.0];
/// Fewest and most ways, to or fro, of a swing, and the shortest one, s; each number of ways is tried from so many instants of a way on.
const WAYS: [u32; 2] = [3, 150];
const SHORTEST_WAY_S: f64 = 6.0;
const PHASES: u32 = 4;
/// A change is seen in nine of ten drives if its deviance is beyond the level's root by so many standard deviations.
const NINE_OF_TEN: f64 = 1.28;

/// Columns of a row: the driver's parameters, and the stretch's constant, which is an offset of T_d. In the place of the driver's
/// offset is what it makes of the torque, a slope: gain_2 is lost where a line moves.
pub(super) const OFFSET: usize = DRIVER;
pub(super) const LOCAL: usize = OFFSET + 1;

pub(super) type Local = SVector<f64, LOCAL>;
type Square = SMatrix<f64, LOCAL, LOCAL>;

/// Sums over the rows of a block.
pub(super) struct Block {
    pub(super) stretch: usize,
    pub(super) from_s: f64,
    pub(super) to_s: f64,
    pub(super) score: Local,
    pub(super) gram: Square,
}

/// What is fitted whatever changes.
pub(super) struct Fitted {
    pub(super) blocks: Vec<Block>,
    pub(super) inverse: DMatrix<f64>,
    /// What the parameters would still move by.
    pub(super) step: DVector<f64>,
    pub(super) variance: f64,
}

/// Sums over the blocks, each as far as a change has come there.
pub(super) struct Sum {
    score: Local,
    square: Square,
    /// Products with what is fitted.
    with: DMatrix<f64>,
}

/// What freeing a change does. A night has as many of them as seconds: none keeps what grows with the recording.
#[derive(Clone)]
pub(super) struct Freed {
    pub(super) by: f64,
    information: f64,
    pub(super) deviance: f64,
    /// The direction less the offset of T_d beside it.
    along: Local,
    /// All that changes: the change and the offset of T_d beside it.
    changes: Local,
    /// What the driver's parameters change by before it, from what they are throughout.
    before: Local,
}

impl Freed {
    /// What a parameter of the driver changes by before the change and after it, from what it is throughout.
    pub(super) fn sides_of(&self, i: usize) -> [f64; 2] {
        [self.before[i], self.before[i] + self.changes[i]]
    }
}

impl Block {
    /// Where the columns that are fitted stand.
    pub(super) fn place(&self, i: usize) -> usize {
        if i < OFFSET { i } else { OFFSET + self.stretch }
    }

    /// The part of `v` that these rows have a share in.
    fn own(&self, v: &DVector<f64>) -> Local {
        Local::from_fn(|i, _| v[self.place(i)])
    }
}

/// The shape whose change is the most evident.
pub(super) fn most<T>(tried: &[(T, Freed)]) -> Option<&(T, Freed)> {
    tried.iter().max_by(|a, b| a.1.deviance.total_cmp(&b.1.deviance))
}

impl Fitted {
    fn add(&self, sum: &mut Sum, number: usize, share: f64) {
        let block = &self.blocks[number];
        sum.score += block.score * share;
        sum.square += block.gram * (share * share);
        for i in 0..LOCAL {
            let mut row = sum.with.row_mut(block.place(i));
            row += block.gram.row(i) * share;
        }
    }

    fn nothing(&self) -> Sum {
        Sum {
            score: Local::zeros(),
            square: Square::zeros(),
            with: DMatrix::zeros(self.step.len(), LOCAL),
        }
    }

    /// The sums where a change has come so far in each block.
    fn over(&self, shares: impl Iterator<Item = f64>) -> Sum {
        let mut sum = self.nothing();
        for (k, share) in shares.enumerate().filter(|x| x.1 != 0.0) {
            self.add(&mut sum, k, share);
        }
        sum
    }

    /// What the parameters take up of a change along each column.
    fn taken(&self, sum: &Sum) -> DMatrix<f64> {
        &self.inverse * &sum.with
    }

    /// What freeing the change does beside an offset of T_d, which may change with it unless it is that offset itself.
    pub(super) fn freed(&self, sum: &Sum, direction: &Local) -> Option<Freed> {
        let taken = self.taken(sum);
        let score = sum.score - Local::from_fn(|i, _| sum.with.column(i).dot(&self.step));
        let products = sum.with.transpose() * &taken;
        let left = sum.square - Square::from_fn(|i, j| products[(i, j)]);
        let mut beside = Local::zeros();
        let offset = left[(OFFSET, OFFSET)];
        if direction[OFFSET] == 0.0 && offset > 1e-9 * sum.square[(OFFSET, OFFSET)] {
            beside[OFFSET] = 1.0 / offset;
        }
        let along = direction - beside * left.row(OFFSET).transpose().dot(direction);
        let information = along.dot(&(left * along));
        let by = score.dot(&along) / information;
        let changes = along * by + beside * score[OFFSET];
        let before = |i: usize| {
            if i < OFFSET {
                -taken.row(i).transpose().dot(&changes)
            } else {
                0.0
            }
        };
        (information > 1e-6 * direction.dot(&(sum.square * direction))).then(|| Freed {
            by,
            information,
            deviance: by * by * information / self.variance,
            along,
            changes,
            before: Local::from_fn(|i, _| before(i)),
        })
    }

    /// Begin and end of the blocks, s.
    fn ends_s(&self) -> [f64; 2] {
        let ends = self.blocks.first().zip(self.blocks.last());
        ends.map_or([0.0; 2], |(first, last)| [first.from_s, last.to_s])
    }

    /// All of a change in these blocks, and nothing of it in the others.
    pub(super) fn within(&self, changed: Range<usize>) -> impl Iterator<Item = f64> {
        (0..self.blocks.len()).map(move |k| f64::from(changed.contains(&k)))
    }

    /// All of a change in every second way, from an instant on and back to the begin, of a length, s.
    pub(super) fn swung(&self, [from_s, way_s]: [f64; 2]) -> impl Iterator<Item = f64> {
        let ways = move |b: &Block| (0.5 * (b.from_s + b.to_s) - from_s) / way_s;
        let is_out = move |b| ways(b).floor().rem_euclid(2.0) == 0.0;
        self.blocks.iter().map(move |b| f64::from(is_out(b)))
    }

    /// The square waves that the scores are held against: the first instant of a way out and the length of the ways, s. They are a
    /// spectrum, whose lines are half a cycle in the record apart.
    pub(super) fn swings(&self) -> Vec<([f64; 2], Sum)> {
        let [begin_s, end_s] = self.ends_s();
        let (length_s, [fewest, most]) = (end_s - begin_s, WAYS);
        let ways = fewest..=most.min((length_s / SHORTEST_WAY_S) as u32);
        let tried = ways.flat_map(|ways| {
            let way_s = length_s / f64::from(ways);
            (0..PHASES).map(move |phase| [begin_s + way_s * f64::from(phase) / f64::from(PHASES), way_s])
        });
        tried.map(|swing| (swing, self.over(self.swung(swing)))).collect()
    }

    /// A step at the beginning of each block that tells enough of it.
    pub(super) fn steps(&self, direction: &Local) -> Vec<(usize, Freed)> {
        let mut sum = self.nothing();
        let mut out = Vec::new();
        for k in (1..self.blocks.len()).rev() {
            self.add(&mut sum, k, 1.0);
            out.extend(self.freed(&sum, direction).map(|freed| (k, freed)));
        }
        let most = out.iter().map(|f| f.1.information).fold(0.0, f64::max);
        out.retain(|f| f.1.information >= LEAST_SHARE * most);
        out
    }

    /// How far a change between the beginnings of two blocks has come in each.
    pub(super) fn shares(&self, [from, to]: [usize; 2]) -> impl Iterator<Item = f64> {
        let length = to.saturating_sub(from).max(1) as f64;
        let share = move |k: usize| match k {
            k if k >= to => 1.0,
            k => (k as f64 + 0.5 - from as f64).max(0.0) / length,
        };
        (0..self.blocks.len()).map(share)
    }

    /// A change for some seconds that then goes back, at each of some instants.
    pub(super) fn blips(&self, direction: &Local) -> Vec<([usize; 2], Freed)> {
        let count = self.blocks.len();
        let lengths = BLIPS_S.map(|s| (s / BLOCK_S).round() as usize);
        let windows = lengths.into_iter().flat_map(|length| {
            let begins = (0..count.saturating_sub(length)).step_by((length / 4).max(1));
            begins.map(move |from| [from, from + length])
        });
        let blip = |[from, to]: [usize; 2]| {
            Some((
                [from, to],
                self.freed(&self.over(self.within(from..to)), direction)?,
            ))
        };
        let mut out: Vec<_> = windows.filter_map(blip).collect();
        let most = out.iter().map(|f| f.1.information).fold(0.0, f64::max);
        out.retain(|f| f.1.information >= LEAST_SHARE * most);
        out
    }

    /// What tests of a step, of a blip and of a swing at these levels of twice the log likelihood see of a change.
    pub(super) fn power(
        &self,
        parameter: &'static str,
        direction: &Local,
        [of_step, of_blip, of_swing]: [f64; 3],
    ) -> Power {
        let middle = self.blocks.len() / 2;
        let least = |shares: &mut dyn Iterator<Item = f64>, level: f64| {
            let information = self.freed(&self.over(shares), direction)?.information / self.variance;
            (information > 0.0).then(|| (level.sqrt() + NINE_OF_TEN) / information.sqrt())
        };
        let blip = middle..middle + (BLIP_S / BLOCK_S) as usize;
        Power {
            parameter,
            step: least(&mut self.within(middle..self.blocks.len()), of_step),
            blip: least(&mut self.within(blip), of_blip),
            swing: least(&mut self.swung([self.ends_s()[0], SWING_S]), of_swing),
        }
    }

    /// A swing as a change.
    pub(super) fn change_of_swing(
        &self,
        parameter: &'static str,
        ([from_s, way_s], freed): &([f64; 2], Freed),
    ) -> Change {
        Change {
            parameter,
            shape: Shape::Swing,
            at_s: [*from_s, from_s + way_s],
            at_95_s: self.ends_s().map(|t| [t; 2]),
            by: freed.by,
            deviance: freed.deviance,
        }
    }

    /// A blip as a change.
    pub(super) fn change_of_blip(
        &self,
        parameter: &'static str,
        ([from, to], freed): &([usize; 2], Freed),
    ) -> Change {
        let at_s = [*from, *to].map(|k| self.blocks.get(k).map_or(self.ends_s()[1], |b| b.from_s));
        // No finer than the instants that are tried.
        let step_s = 0.25 * (at_s[1] - at_s[0]).max(4.0 * BLOCK_S);
        Change {
            parameter,
            shape: Shape::Blip,
            at_s,
            at_95_s: at_s.map(|t| [t - step_s, t + step_s]),
            by: freed.by,
            deviance: freed.deviance,
        }
    }

    /// The factor by which the scatter of the blocks' scores, less what the change explains, is wider than the prediction errors
    /// say.
    pub(super) fn wider<I: Iterator<Item = f64>>(&self, shares: impl Fn() -> I, found: &Freed) -> f64 {
        let taken = self.taken(&self.over(shares()));
        let [along, changes] = [found.along, found.changes].map(|v| (v, &taken * v));
        let regressor =
            |block: &Block, share: f64, (v, taken): &(Local, DVector<f64>)| v * share - block.own(taken);
        let blocks = self.blocks.iter().zip(shares());
        let scatter: f64 = blocks
            .map(|(block, share)| {
                let moved = block.own(&self.step) + regressor(block, share, &changes);
                let left = block.score - block.gram * moved;
                regressor(block, share, &along).dot(&left).powi(2)
            })
            .sum();
        (scatter / (self.variance * found.information)).max(1.0)
    }

    /// The change as a step or, if that is much likelier, as a drift.
    pub(super) fn change(
        &self,
        parameter: &'static str,
        direction: &Local,
        steps: &[(usize, Freed)],
        wider: f64,
    ) -> Option<Change> {
        let count = self.blocks.len();
        let lengths = DRIFTS_S.map(|s| (s / BLOCK_S).round() as usize);
        let drifts = lengths.into_iter().flat_map(|length| {
            let begins = (0..count.saturating_sub(length)).step_by(1 + length / 16);
            begins.map(move |from| [from, from + length])
        });
        let drift = |ends| Some((ends, self.freed(&self.over(self.shares(ends)), direction)?));
        let drifts: Vec<_> = drifts.filter_map(drift).collect();
        let steps: Vec<_> = steps.iter().map(|(k, f)| ([*k, *k], f.clone())).collect();
        let step = most(&steps)?;
        let drift = most(&drifts).filter(|d| d.1.deviance > step.1.deviance + BEYOND_STEP * wider);
        let (ends, found) = drift.unwrap_or(step);
        let enough = found.deviance - WITHIN_95 * wider;
        // Steps are listed from the last one on.
        let known = [steps.last()?.0[0], steps.first()?.0[0]];
        let within = |end: usize| {
            let near = drifts.iter().chain(&steps).filter(|t| t.1.deviance >= enough);
            let near = near.map(|t| t.0[end]);
            let (low, high) = near.fold((ends[end], ends[end]), |(l, h), k| (l.min(k), h.max(k)));
            [
                if low > known[0] {
                    self.between(low)[0] - 0.5 * BLOCK_S
                } else {
                    self.blocks[0].from_s
                },
                if high < known[1] {
                    self.between(high)[1] + 0.5 * BLOCK_S
                } else {
                    self.blocks[count - 1].to_s
                },
            ]
        };
        Some(Change {
            parameter,
            shape: if ends[1] > ends[0] {
                Shape::Drift
            } else {
                Shape::Step
            },
            at_s: ends.map(|k| self.between(k).iter().sum::<f64>() / 2.0),
            at_95_s: [within(0), within(1)],
            by: found.by,
            deviance: found.deviance,
        })
    }

    /// The end of the block before, and the beginning of this one, s: they differ where rows were left out.
    fn between(&self, k: usize) -> [f64; 2] {
        let begin = self.blocks[k].from_s;
        let end = k.checked_sub(1).map_or(begin, |k| self.blocks[k].to_s);
        [end.min(begin), begin]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identify::noise_model::K_HG;
    use statrs::distribution::{ChiSquared, ContinuousCDF};

    /// Forty blocks with one unit of information each on K_hg, which is 0.4 higher in eight of them and was fitted as constant.
    #[test]
    fn a_blip_is_told_from_a_step() {
        let unit = Local::from_fn(|i, _| f64::from(i == K_HG));
        let within = |k: usize| (10..18).contains(&k);
        // The mean of 0.4 over 8 of 40 blocks is 0.08.
        let block = |k: usize| Block {
            stretch: 0,
            from_s: k as f64,
            to_s: k as f64 + 1.0,
            score: unit * if within(k) { 0.32 } else { -0.08 },
            gram: unit * unit.transpose(),
        };
        let mut inverse = DMatrix::zeros(LOCAL, LOCAL);
        inverse[(K_HG, K_HG)] = 1.0 / 40.0;
        let fitted = Fitted {
            blocks: (0..40).map(block).collect(),
            inverse,
            step: DVector::zeros(LOCAL),
            variance: 1.0,
        };
        let blips = fitted.blips(&unit);
        let found = most(&blips).unwrap();
        let change = fitted.change_of_blip("k_hg", found);
        assert_eq!((change.at_s, change.shape), ([10.0, 18.0], Shape::Blip));
        // 8 blocks of information, less 8 * 8 / 40 that the constant takes.
        assert!(
            (change.by - 0.4).abs() < 1e-9 && (change.deviance - 0.16 * 6.4).abs() < 1e-9,
            "{change:?}"
        );
        let step = fitted.steps(&unit);
        assert!(most(&step).unwrap().1.deviance < change.deviance);
        // A step in the middle has 20 * 20 / 40 of it: (4 + 1.28) / sqrt(10).
        let power = fitted.power("k_hg", &unit, [16.0, 25.0, 36.0]);
        assert!(
            (power.step.unwrap() - 5.28 / 10.0_f64.sqrt()).abs() < 1e-9,
            "{power:?}"
        );
        assert!(
            (power.blip.unwrap() - (5.0 + 1.28) / 6.4_f64.sqrt()).abs() < 1e-9,
            "{power:?}"
        );
    }

    /// Sixty blocks with one unit of information each on K_hg, which is 0.4 higher in every second ten of them, to either side, and was fitted as
    /// constant: 0.2 too high or too low everywhere. A swing of ten blocks each way has 15 units beside the mean; one of another
    /// length, a step and a blip explain less.
    #[test]
    fn a_swing_is_told_from_a_step_and_from_a_blip() {
        let unit = Local::from_fn(|i, _| f64::from(i == K_HG));
        for sign in [1.0, -1.0] {
            let block = |k: usize| Block {
                stretch: 0,
                from_s: 100.0 + k as f64,
                to_s: 101.0 + k as f64,
                score: unit
                    * if (k / 10).is_multiple_of(2) {
                        0.2 * sign
                    } else {
                        -0.2 * sign
                    },
                gram: unit * unit.transpose(),
            };
            let mut inverse = DMatrix::zeros(LOCAL, LOCAL);
            inverse[(K_HG, K_HG)] = 1.0 / 60.0;
            let fitted = Fitted {
                blocks: (0..60).map(block).collect(),
                inverse,
                step: DVector::zeros(LOCAL),
                variance: 1.0,
            };
            let freed = fitted.swings().into_iter();
            let swings: Vec<_> = freed
                .map(|(swing, sum)| (swing, fitted.freed(&sum, &unit).unwrap()))
                .collect();
            let found = most(&swings).unwrap();
            let change = fitted.change_of_swing("k_hg", found);
            assert_eq!((change.shape, change.within_s()), (Shape::Swing, [100.0, 160.0]));
            let [from_s, to_s] = change.at_s;
            assert!(
                (to_s - from_s - 10.0).abs() < 1e-9 && (from_s - 100.0) % 10.0 == 0.0,
                "{change:?}"
            );
            assert!(
                (change.by.abs() - 0.4).abs() < 1e-9 && (change.deviance - 2.4).abs() < 1e-9,
                "{change:?}"
            );
            let mut out = found.1.sides_of(K_HG);
            out.sort_by(f64::total_cmp);
            assert!(
                (out[0] + 0.2).abs() < 1e-9 && (out[1] - 0.2).abs() < 1e-9,
                "{out:?}"
            );
            assert!(most(&fitted.steps(&unit)).unwrap().1.deviance < 0.5 * change.deviance);
            assert!(most(&fitted.blips(&unit)).unwrap().1.deviance < 0.5 * change.deviance);
            // Each way for 15 s, two of them out: 30 blocks of 60, and 15 units again.
            let power = fitted.power("k_hg", &unit, [16.0, 25.0, 36.0]);
            assert!(
                (power.swing.unwrap() - (6.0 + 1.28) / 15.0_f64.sqrt()).abs() < 1e-9,
                "{power:?}"
            );
        }
    }

    /// scipy.stats.chi2.sf(30, 1) is 4.3205e-8. Of 200 s, 31 lengths of a way and four instants that it begins at are tried of four
    /// parameters: 496 square waves pass 30 by chance in 2 of 100,000 records of a constant driver.
    #[test]
    fn a_spectrum_has_so_many_lines() {
        let block = |k: usize| Block {
            stretch: 0,
            from_s: k as f64,
            to_s: k as f64 + 1.0,
            score: Local::zeros(),
            gram: Square::identity(),
        };
        let fitted = Fitted {
            blocks: (0..200).map(block).collect(),
            inverse: DMatrix::zeros(LOCAL, LOCAL),
            step: DVector::zeros(LOCAL),
            variance: 1.0,
        };
        let tried = fitted.swings();
        assert_eq!(tried.len(), 4 * 31);
        let out: Vec<f64> = fitted.swung(tried[0].0).collect();
        // Three ways in 200 s, out, back and out: 67 blocks have their middle in the first one, and in the last one.
        assert_eq!(out.iter().sum::<f64>(), 134.0);
        let passes = ChiSquared::new(1.0).unwrap().sf(30.0);
        assert!((passes - 4.3205e-8).abs() < 1e-11 && (tried.len() * 4) as f64 * passes < 2.2e-5);
    }

    /// Ten blocks with one unit of information each on K_hg, which steps by 0.4 in the middle and was fitted as constant: it is 0.2
    /// too high before and 0.2 too low after. Freeing the step takes 10 * 0.2^2 off the sum of squares.
    #[test]
    fn a_step_in_the_middle_is_half_of_it_off_on_either_side() {
        let unit = Local::from_fn(|i, _| f64::from(i == K_HG));
        let block = |k: usize| Block {
            stretch: 0,
            from_s: k as f64,
            to_s: k as f64 + 1.0,
            score: unit * if k < 5 { -0.2 } else { 0.2 },
            gram: unit * unit.transpose(),
        };
        let mut inverse = DMatrix::zeros(LOCAL, LOCAL);
        inverse[(K_HG, K_HG)] = 0.1;
        let fitted = Fitted {
            blocks: (0..10).map(block).collect(),
            inverse,
            step: DVector::zeros(LOCAL),
            variance: 1.0,
        };
        let steps = fitted.steps(&unit);
        let (at, freed) = most(&steps).unwrap();
        let [before, after] = freed.sides_of(K_HG);
        let found = [freed.by, freed.deviance, before, after];
        for (found, expected) in found.into_iter().zip([0.4, 0.4, -0.2, 0.2]) {
            assert!((found - expected).abs() < 1e-12, "{found} for {expected}");
        }
        assert_eq!(*at, 5);
        assert_eq!(fitted.wider(|| fitted.within(*at..10), freed), 1.0);
        let change = fitted.change("k_hg", &unit, &steps, 1.0).unwrap();
        assert_eq!(change.at_s, [5.0; 2]);
    }
}
