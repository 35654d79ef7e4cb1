//! What freeing a change along one direction adds, for every instant and shape: the sums behind [`super::constancy`].

use std::ops::Range;

use nalgebra::{DMatrix, DVector, SMatrix, SVector};

use super::DRIVER;
use crate::identify::change::{BLIP_S, Change, Power, Shape};

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
struct Sum {
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

    /// The sums where these blocks have all of a change.
    fn over(&self, changed: Range<usize>) -> Sum {
        let mut sum = self.nothing();
        for k in changed {
            self.add(&mut sum, k, 1.0);
        }
        sum
    }

    /// What the parameters take up of a change along each column.
    fn taken(&self, sum: &Sum) -> DMatrix<f64> {
        &self.inverse * &sum.with
    }

    /// What the parameters change by where these blocks are changed, as vectors: outside of them, and in them, from what they
    /// are throughout.
    pub(super) fn sides(&self, freed: &Freed, changed: Range<usize>) -> [DVector<f64>; 2] {
        let before = -(self.taken(&self.over(changed)) * freed.changes);
        let mut after = before.clone();
        for i in 0..OFFSET {
            after[i] += freed.changes[i];
        }
        [before, after]
    }

    /// What freeing the change does beside an offset of T_d, which may change with it unless it is that offset itself.
    fn freed(&self, sum: &Sum, direction: &Local) -> Option<Freed> {
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

    fn drift(&self, ends: [usize; 2], direction: &Local) -> Option<([usize; 2], Freed)> {
        let mut sum = self.nothing();
        for (k, share) in self.shares(ends).enumerate().filter(|x| x.1 != 0.0) {
            self.add(&mut sum, k, share);
        }
        Some((ends, self.freed(&sum, direction)?))
    }

    /// A change for some seconds that then goes back, at each of some instants.
    pub(super) fn blips(&self, direction: &Local) -> Vec<([usize; 2], Freed)> {
        let count = self.blocks.len();
        let lengths = BLIPS_S.map(|s| (s / BLOCK_S).round() as usize);
        let windows = lengths.into_iter().flat_map(|length| {
            let begins = (0..count.saturating_sub(length)).step_by((length / 4).max(1));
            begins.map(move |from| [from, from + length])
        });
        let windows = windows.filter_map(|ends| Some((ends, self.blip(ends, direction)?)));
        let mut out: Vec<_> = windows.collect();
        let most = out.iter().map(|f| f.1.information).fold(0.0, f64::max);
        out.retain(|f| f.1.information >= LEAST_SHARE * most);
        out
    }

    fn blip(&self, [from, to]: [usize; 2], direction: &Local) -> Option<Freed> {
        self.freed(&self.over(from..to), direction)
    }

    /// What a test at this `level` of twice the log likelihood, and one for blips at `blip_level`, sees of a change.
    pub(super) fn power(
        &self,
        parameter: &'static str,
        direction: &Local,
        [level, blip_level]: [f64; 2],
    ) -> Power {
        let middle = self.blocks.len() / 2;
        let least = |freed: Option<Freed>, level: f64| {
            let information = freed?.information / self.variance;
            (information > 0.0).then(|| (level.sqrt() + NINE_OF_TEN) / information.sqrt())
        };
        let half = self.over(middle..self.blocks.len());
        let blip = [
            middle,
            (middle + (BLIP_S / BLOCK_S) as usize).min(self.blocks.len()),
        ];
        Power {
            parameter,
            step: least(self.freed(&half, direction), level),
            blip: least(self.blip(blip, direction), blip_level),
        }
    }

    /// A blip as a change.
    pub(super) fn change_of_blip(
        &self,
        parameter: &'static str,
        ([from, to], freed): &([usize; 2], Freed),
    ) -> Change {
        let at_s = [*from, *to].map(|k| {
            let last = self.blocks.len() - 1;
            if k > last {
                self.blocks[last].to_s
            } else {
                self.blocks[k].from_s
            }
        });
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
    pub(super) fn wider(&self, at: usize, found: &Freed) -> f64 {
        let taken = self.taken(&self.over(at..self.blocks.len()));
        let [along, changes] = [found.along, found.changes].map(|v| (v, &taken * v));
        let regressor =
            |block: &Block, share: f64, (v, taken): &(Local, DVector<f64>)| v * share - block.own(taken);
        let blocks = self.blocks.iter().zip(self.shares([at, at]));
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
        let drifts: Vec<_> = drifts.filter_map(|ends| self.drift(ends, direction)).collect();
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
        let power = fitted.power("k_hg", &unit, [16.0, 25.0]);
        assert!(
            (power.step.unwrap() - 5.28 / 10.0_f64.sqrt()).abs() < 1e-9,
            "{power:?}"
        );
        assert!(
            (power.blip.unwrap() - (5.0 + 1.28) / 6.4_f64.sqrt()).abs() < 1e-9,
            "{power:?}"
        );
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
        let [before, after] = fitted.sides(freed, *at..10).map(|side| side[K_HG]);
        let found = [freed.by, freed.deviance, before, after];
        for (found, expected) in found.into_iter().zip([0.4, 0.4, -0.2, 0.2]) {
            assert!((found - expected).abs() < 1e-12, "{found} for {expected}");
        }
        assert_eq!(*at, 5);
        assert_eq!(fitted.wider(*at, freed), 1.0);
        let change = fitted.change("k_hg", &unit, &steps, 1.0).unwrap();
        assert_eq!(change.at_s, [5.0; 2]);
    }
}
