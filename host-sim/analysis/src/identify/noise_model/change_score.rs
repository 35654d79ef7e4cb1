//! What freeing a change along one direction adds, for every instant and shape: the sums behind [`super::constancy`].

use nalgebra::{DMatrix, DVector};

use super::T_P;
use crate::identify::change::Change;

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

/// The driver's parameters, and behind them a stretch's constant.
pub(super) const OWN: usize = T_P + 1;
pub(super) const LOCAL: usize = OWN + 1;

pub(super) type Local = [f64; LOCAL];

/// Sums over the rows of a block.
pub(super) struct Block {
    pub(super) stretch: usize,
    pub(super) from_s: f64,
    pub(super) to_s: f64,
    pub(super) score: Local,
    pub(super) gram: [Local; LOCAL],
}

/// A block's part in a change along one direction.
struct Part {
    score: f64,
    /// Products with all regressors.
    with: Local,
    square: f64,
}

/// Every block's part in a change along one direction.
pub(super) struct Along {
    parts: Vec<Part>,
    direction: Local,
}

impl Along {
    /// Whether an offset of T_d may change beside it: not if it is that offset itself.
    fn beside_offset(&self) -> bool {
        self.direction[OWN] == 0.0
    }
}

/// What is fitted whatever changes.
pub(super) struct Fitted<'a> {
    pub(super) blocks: &'a [Block],
    pub(super) size: usize,
    pub(super) inverse: DMatrix<f64>,
    /// What the parameters would still move by.
    pub(super) step: DVector<f64>,
    pub(super) variance: f64,
}

/// Sums over the blocks, each as far as the change has come there.
#[derive(Clone)]
pub(super) struct Shaped {
    score: [f64; 2],
    with: [DVector<f64>; 2],
    /// The change's square, its product with the offset, the offset's square.
    products: [f64; 3],
    beside_offset: bool,
}

impl Shaped {
    /// What of the offset a change takes along, from what is left of the products.
    fn slope(&self, [_, mixed, offset]: [f64; 3]) -> f64 {
        if self.beside_offset && offset > 1e-9 * self.products[2] {
            mixed / offset
        } else {
            0.0
        }
    }
}

/// What freeing a change does.
#[derive(Clone, Copy)]
pub(super) struct Freed {
    pub(super) by: f64,
    pub(super) information: f64,
    pub(super) deviance: f64,
}

impl Block {
    pub(super) fn place(&self, i: usize) -> usize {
        if i < OWN { i } else { OWN + self.stretch }
    }

    /// The part of `v` that these rows have a share in.
    fn own(&self, v: &DVector<f64>) -> Local {
        std::array::from_fn(|i| v[self.place(i)])
    }
}

fn times(a: &Local, b: &Local) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

pub(super) fn largest(steps: &[Option<Freed>]) -> Option<(usize, Freed)> {
    let found = steps.iter().enumerate().filter_map(|(k, s)| Some((k, (*s)?)));
    found.max_by(|a, b| a.1.deviance.total_cmp(&b.1.deviance))
}

impl Fitted<'_> {
    pub(super) fn along(&self, direction: Local) -> Along {
        let one = |b: &Block| {
            let with: Local = std::array::from_fn(|i| times(&b.gram[i], &direction));
            Part {
                score: times(&b.score, &direction),
                square: times(&with, &direction),
                with,
            }
        };
        Along {
            parts: self.blocks.iter().map(one).collect(),
            direction,
        }
    }

    fn nothing(&self, along: &Along) -> Shaped {
        Shaped {
            beside_offset: along.beside_offset(),
            score: [0.0; 2],
            with: [DVector::zeros(self.size), DVector::zeros(self.size)],
            products: [0.0; 3],
        }
    }

    fn add(&self, sum: &mut Shaped, number: usize, along: &Along, share: f64) {
        let (block, along) = (&self.blocks[number], &along.parts[number]);
        sum.score[0] += share * along.score;
        sum.score[1] += share * block.score[OWN];
        for i in 0..LOCAL {
            sum.with[0][block.place(i)] += share * along.with[i];
            sum.with[1][block.place(i)] += share * block.gram[OWN][i];
        }
        let square = share * share;
        sum.products[0] += square * along.square;
        sum.products[1] += square * along.with[OWN];
        sum.products[2] += square * block.gram[OWN][OWN];
    }

    /// The change and the offset with what the parameters take up taken out: scores, and the three products.
    fn left(&self, sum: &Shaped) -> ([f64; 2], [f64; 3]) {
        let taken = [0, 1].map(|i| &self.inverse * &sum.with[i]);
        let score = [0, 1].map(|i| sum.score[i] - sum.with[i].dot(&self.step));
        let products = [(0, 0), (0, 1), (1, 1)].map(|(i, j)| sum.with[i].dot(&taken[j]));
        (score, std::array::from_fn(|i| sum.products[i] - products[i]))
    }

    /// What freeing the change does beside the offset.
    fn freed(&self, sum: &Shaped) -> Option<Freed> {
        let (score, left) = self.left(sum);
        let ([square, mixed, _], slope) = (left, sum.slope(left));
        let (score, information) = (score[0] - slope * score[1], square - slope * mixed);
        (information > 1e-6 * sum.products[0]).then(|| Freed {
            by: score / information,
            information,
            deviance: score * score / (information * self.variance),
        })
    }

    /// A step at the beginning of each block.
    pub(super) fn steps(&self, along: &Along) -> Vec<Option<Freed>> {
        let mut sum = self.nothing(along);
        let mut out = vec![None; self.blocks.len()];
        for k in (1..self.blocks.len()).rev() {
            self.add(&mut sum, k, along, 1.0);
            out[k] = self.freed(&sum);
        }
        let most = out.iter().flatten().map(|f| f.information).fold(0.0, f64::max);
        for step in &mut out {
            *step = step.filter(|s| s.information >= LEAST_SHARE * most);
        }
        out
    }

    /// How far a change between the beginnings of two blocks has come in each.
    pub(super) fn shares(&self, [from, to]: [usize; 2]) -> Vec<f64> {
        let share = |k: usize| {
            if k < from {
                0.0
            } else if k >= to {
                1.0
            } else {
                (k as f64 + 0.5 - from as f64) / (to - from) as f64
            }
        };
        (0..self.blocks.len()).map(share).collect()
    }

    fn shaped(&self, along: &Along, shares: &[f64]) -> Shaped {
        let mut sum = self.nothing(along);
        for (k, &share) in shares.iter().enumerate().filter(|x| *x.1 != 0.0) {
            self.add(&mut sum, k, along, share);
        }
        sum
    }

    /// The factor by which the scatter of the blocks' scores, less what the change explains, is wider than the prediction errors
    /// say.
    pub(super) fn wider(&self, along: &Along, shares: &[f64], found: Freed) -> f64 {
        let sum = self.shaped(along, shares);
        let (score, left) = self.left(&sum);
        let ([_, mixed, offset], slope) = (left, sum.slope(left));
        let by = [
            found.by,
            if slope == 0.0 {
                0.0
            } else {
                (score[1] - found.by * mixed) / offset
            },
        ];
        let taken = [0, 1].map(|i| &self.inverse * &sum.with[i]);
        let mut scatter = 0.0;
        for (block, &share) in self.blocks.iter().zip(shares) {
            let [change, offset] = [0, 1].map(|i| {
                let mut own = block.own(&taken[i]).map(|x| -x);
                if i == 0 {
                    own.iter_mut()
                        .zip(along.direction)
                        .for_each(|(o, d)| *o += share * d);
                } else {
                    own[OWN] += share;
                }
                own
            });
            let moved = block.own(&self.step);
            let moved: Local = std::array::from_fn(|i| moved[i] + by[0] * change[i] + by[1] * offset[i]);
            let left: Local = std::array::from_fn(|i| block.score[i] - times(&block.gram[i], &moved));
            let regressor: Local = std::array::from_fn(|i| change[i] - slope * offset[i]);
            scatter += times(&regressor, &left).powi(2);
        }
        (scatter / (self.variance * found.information)).max(1.0)
    }

    /// The change as a step or, if that is much likelier, as a drift.
    pub(super) fn change(
        &self,
        parameter: &'static str,
        along: &Along,
        steps: &[Option<Freed>],
        (at, step): (usize, Freed),
        wider: f64,
    ) -> Change {
        let mut tried: Vec<([usize; 2], Freed)> = Vec::new();
        for length in DRIFTS_S.map(|s| (s / BLOCK_S).round() as usize) {
            for from in (0..self.blocks.len().saturating_sub(length)).step_by(1 + length / 16) {
                let ends = [from, from + length];
                let freed = self.freed(&self.shaped(along, &self.shares(ends)));
                tried.extend(freed.map(|f| (ends, f)));
            }
        }
        let drift = tried.iter().max_by(|a, b| a.1.deviance.total_cmp(&b.1.deviance));
        let drift = drift.filter(|d| d.1.deviance > step.deviance + BEYOND_STEP * wider);
        let (ends, found) = drift.copied().unwrap_or(([at, at], step));
        let enough = found.deviance - WITHIN_95 * wider;
        let known: Vec<usize> = (0..steps.len()).filter(|&k| steps[k].is_some()).collect();
        let ends_of_known = [
            known.first().copied().unwrap_or(at),
            known.last().copied().unwrap_or(at),
        ];
        let within = |end: usize| {
            let drifts = tried.iter().map(|(ends, f)| (ends[end], f.deviance));
            let steps = steps.iter().enumerate();
            let steps = steps.filter_map(|(k, s)| Some((k, (*s)?.deviance)));
            let near = drifts.chain(steps).filter(|x| x.1 >= enough).map(|x| x.0);
            let (low, high) = near.fold((ends[end], ends[end]), |(l, h), k| (l.min(k), h.max(k)));
            [
                if low > ends_of_known[0] {
                    self.before(low)
                } else {
                    self.blocks[0].from_s
                },
                if high < ends_of_known[1] {
                    self.after(high)
                } else {
                    self.blocks[self.blocks.len() - 1].to_s
                },
            ]
        };
        Change {
            parameter,
            at_s: ends.map(|k| self.instant(k)),
            at_95_s: [within(0), within(1)],
            by: found.by,
            deviance: found.deviance,
        }
    }

    /// The end of the block before, and the beginning of this one, s: they differ where rows were left out.
    fn between(&self, k: usize) -> [f64; 2] {
        let begin = self.blocks[k].from_s;
        let end = k.checked_sub(1).map_or(begin, |k| self.blocks[k].to_s);
        [end.min(begin), begin]
    }

    /// The instant of a change at the beginning of this block, s.
    fn instant(&self, k: usize) -> f64 {
        let [from, to] = self.between(k);
        0.5 * (from + to)
    }

    /// The earliest instant that it may stand for, s.
    fn before(&self, k: usize) -> f64 {
        self.between(k)[0] - 0.5 * BLOCK_S
    }

    /// The latest one, s.
    fn after(&self, k: usize) -> f64 {
        self.between(k)[1] + 0.5 * BLOCK_S
    }
}
