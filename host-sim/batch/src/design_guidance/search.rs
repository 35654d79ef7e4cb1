//! CMA-ES over the logarithms of the gains, once for each stretch; the front of all sets that it evaluated; the judgement.

use cmaes::{CMAESOptions, DVector};
use haptic_sim::seeds::named;
use serde::Serialize;

use super::evaluate::{CONFLICT, EFFORT, LOSS, NOISE, PEAK};
use super::{DesignGuidance, Evaluated, Figures, Gains, Member, Stage, published};
use crate::engine::{StudyError, Watch};
use crate::statistics::{Confidence, Mean, front, mean};

/// What a set is held to: a figure over that of the paper's gains.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Bar {
    /// Its name in a file.
    pub name: &'static str,
    /// What it is, in words.
    pub label: &'static str,
    /// The most that it may be, if a file says nothing.
    pub limit: f64,
    /// Whether the search makes it small; the others it keeps within their limits.
    pub is_goal: bool,
}

const fn bar(name: &'static str, label: &'static str, limit: f64) -> Bar {
    Bar {
        name,
        label,
        limit,
        is_goal: limit < 1.0,
    }
}

/// Every bar, in the order of the ratios. Effort and conflict are those of the drivers with lines of their own, of all if there are none.
pub const BARS: [Bar; 7] = [
    bar("peak", "Mean peak", 0.75),
    bar("worst_four", "Worst four", 0.85),
    bar("loss", "Mean loss", 1.02),
    bar("loss_each", "Worst loss", 1.05),
    bar("effort", "Effort", 1.2),
    bar("conflict", "Conflict", 1.2),
    bar("noise", "Noise", 1.5),
];

/// A set that the search tried.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SetRow {
    /// a_1' to a_4'.
    pub gains: Gains,
    /// In the order of [`BARS`], on the training drives.
    pub ratios: [f64; BARS.len()],
    /// How many speeds are unstable: [`Evaluated::unstable`].
    pub unstable: u32,
    /// Whether no stable set is better in the peak, in effort or conflict and in the loss.
    pub on_front: bool,
}

impl SetRow {
    /// Peak, the larger of effort and conflict, loss.
    pub fn objectives(&self) -> [f64; 3] {
        let [peak, _, loss, _, effort, conflict, _] = self.ratios;
        [peak, effort.max(conflict), loss]
    }
}

/// A set to choose: the best of a stretch.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Choice {
    /// How far it may go beyond the bars of the loss, and beyond the others: 1 not at all, 2 twice as far; none: as far as it likes.
    pub stretch: [Option<f64>; 2],
    /// On the training drives.
    pub training: SetRow,
    /// The ratios on the held-out drives, with intervals over the draws of their noise; none where there is one draw.
    pub held_out: [Mean; BARS.len()],
    /// The ratios with intervals of 95 %, by which a bar is held or missed.
    #[serde(skip)]
    pub judged: [Mean; BARS.len()],
    /// Driver by driver there.
    pub drivers: Vec<Figures>,
}

/// What a design found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DesignResults {
    /// Its name.
    pub name: String,
    /// The bars with their limits.
    pub bars: Vec<Bar>,
    /// What it was searched on, and judged on.
    pub stages: [Stage; 2],
    /// The paper's gains: their figures on the held-out drives.
    pub published: Evaluated,
    /// The sets in the order of the search; the first are the paper's gains.
    pub sets: Vec<SetRow>,
    /// By stretch.
    pub choices: Vec<Choice>,
    /// How often intervals hold.
    #[serde(skip_serializing_if = "Confidence::is_usual")]
    pub level: Confidence,
}

/// Step of the search at its start, in logarithms of gains.
const FIRST_STEP: f64 = 0.4;
/// What a ratio beyond its limit counts, where one of a goal counts 1: hardly anything is bought with it.
const BEYOND: f64 = 10.0;

impl DesignGuidance {
    /// Searches and judges. `known` was evaluated by an earlier run; `keep` gets what is evaluated anew.
    ///
    /// # Errors
    /// As an evaluation; what `keep` says.
    pub fn run(
        &self,
        known: &[Evaluated],
        mut keep: impl FnMut(&Evaluated) -> Result<(), StudyError>,
        watch: &Watch<'_>,
    ) -> Result<DesignResults, StudyError> {
        watch.begin(self.sets(), known.len() as u64)?;
        let mut all = known.to_vec();
        let mut evaluated = |gains: Gains, held_out: bool| {
            let is_it = |set: &&Evaluated| set.held_out == held_out && set.gains == gains;
            if let Some(set) = all.iter().find(is_it) {
                return Ok(set.clone());
            }
            let set = self.evaluate(gains, held_out)?;
            keep(&set)?;
            watch.done(1)?;
            all.push(set.clone());
            Ok(set)
        };
        let mut sets = vec![evaluated(published(), false)?];
        for number in 0..self.stretches.len() {
            self.search(number, &mut sets, |gains| evaluated(gains, false))?;
        }
        let mut rows: Vec<SetRow> = sets.iter().map(|set| self.row_of(set, &sets[0])).collect();
        let stable: Vec<usize> = (0..rows.len()).filter(|row| rows[*row].unstable == 0).collect();
        let objectives: Vec<[f64; 3]> = stable.iter().map(|row| rows[*row].objectives()).collect();
        for place in front(&objectives) {
            rows[stable[place]].on_front = true;
        }
        let published = evaluated(published(), true)?;
        let choice = |stretch: &[f64; 2]| {
            let training = rows[self.best(*stretch, &sets)].clone();
            let own = evaluated(training.gains, true)?;
            Ok(Choice {
                stretch: stretch.map(|stretch| stretch.is_finite().then_some(stretch)),
                training,
                held_out: self.judged(&own, &published, self.level),
                judged: self.judged(&own, &published, Confidence::USUAL),
                drivers: own.drivers,
            })
        };
        let choices = self
            .stretches
            .iter()
            .map(choice)
            .collect::<Result<_, StudyError>>()?;
        let bars = BARS
            .iter()
            .zip(self.bars)
            .map(|(bar, limit)| Bar { limit, ..*bar });
        Ok(DesignResults {
            name: self.name.clone(),
            bars: bars.collect(),
            stages: self.stages.clone(),
            published,
            sets: rows,
            choices,
            level: self.level,
        })
    }

    /// Adds the sets of a stretch. The search begins with the best set so far.
    fn search(
        &self,
        number: usize,
        sets: &mut Vec<Evaluated>,
        mut evaluated: impl FnMut(Gains) -> Result<Evaluated, StudyError>,
    ) -> Result<(), StudyError> {
        let stretch = self.stretches[number];
        let begin = sets[self.best(stretch, sets)].gains.map(f64::ln).to_vec();
        let mut failed = None;
        let objective = |x: &DVector<f64>| {
            if failed.is_some() {
                return f64::INFINITY;
            }
            let mut gains = [0.0; 4];
            let mut outside = 0.0;
            for (place, gain) in gains.iter_mut().enumerate() {
                let [low, high] = [0, 1].map(|end| self.range[end][place]);
                *gain = rounded(x[place].exp().clamp(low, high));
                outside += (x[place] - x[place].clamp(low.ln(), high.ln())).powi(2);
            }
            let there = sets.iter().position(|set| set.gains == gains);
            let place = there.map_or_else(
                || {
                    evaluated(gains).map(|set| {
                        sets.push(set);
                        sets.len() - 1
                    })
                },
                Ok,
            );
            match place {
                Ok(place) => outside + self.score(stretch, &sets[place], &sets[0]),
                Err(error) => {
                    failed = Some(error);
                    f64::INFINITY
                }
            }
        };
        let options = CMAESOptions::new(begin, FIRST_STEP)
            .max_function_evals(self.budget as usize)
            .seed(named(self.seed, &format!("search {number}")));
        let search = options.build(objective).map(|mut search| drop(search.run()));
        search.map_err(|e| format!("{e:?}"))?;
        failed.map_or(Ok(()), Err)
    }

    /// The place of the set with the least score.
    fn best(&self, stretch: [f64; 2], sets: &[Evaluated]) -> usize {
        let score = |place: &usize| self.score(stretch, &sets[*place], &sets[0]);
        (0..sets.len())
            .min_by(|a, b| score(a).total_cmp(&score(b)))
            .unwrap_or(0)
    }

    /// The mean of the goals, and what lies beyond the stretched limits.
    fn score(&self, stretch: [f64; 2], set: &Evaluated, paper: &Evaluated) -> f64 {
        let row = self.row_of(set, paper);
        let (mut goals, mut beyond) = (0.0, 0.0);
        for ((ratio, limit), bar) in row.ratios.iter().zip(self.bars).zip(BARS) {
            let stretch = stretch[usize::from(!bar.name.starts_with("loss"))];
            if bar.is_goal {
                goals += 0.5 * ratio;
            } else if stretch.is_finite() {
                beyond += (ratio - 1.0 - stretch * (limit - 1.0)).max(0.0);
            }
        }
        goals + BEYOND * beyond + f64::from(row.unstable)
    }

    /// The ratios of held-out drives, with intervals of a level.
    pub(super) fn judged(&self, set: &Evaluated, paper: &Evaluated, level: Confidence) -> [Mean; BARS.len()] {
        let drivers = &self.stages[1].drivers;
        let whole = ratios(&set.drivers, &paper.drivers, drivers);
        let without = |left_out: usize| {
            let [own, other] = [set, paper].map(|of| means_without(&of.draws, left_out));
            ratios(&own, &other, drivers)
        };
        let count = set.draws.len();
        let left: Vec<[f64; BARS.len()]> = match count {
            0 | 1 => Vec::new(),
            _ => (0..count).map(without).collect(),
        };
        std::array::from_fn(|bar| {
            let left: Vec<f64> = left.iter().map(|left| left[bar]).collect();
            Mean::tukey(whole[bar], &left, level)
        })
    }

    fn row_of(&self, set: &Evaluated, paper: &Evaluated) -> SetRow {
        let drivers = &self.stages[usize::from(set.held_out)].drivers;
        SetRow {
            gains: set.gains,
            ratios: ratios(&set.drivers, &paper.drivers, drivers),
            unstable: set.unstable,
            on_front: false,
        }
    }
}

/// Driver by driver, the means of all draws but one.
fn means_without(draws: &[Vec<Figures>], left_out: usize) -> Vec<Figures> {
    let kept: Vec<&Vec<Figures>> = (draws.iter().enumerate())
        .filter_map(|(number, draw)| (number != left_out).then_some(draw))
        .collect();
    let of_driver = |driver: usize| {
        std::array::from_fn(|figure| mean(kept.iter().map(|draw| draw[driver][figure])).unwrap_or(f64::NAN))
    };
    (0..draws[0].len()).map(of_driver).collect()
}

/// Four digits: what a file says is what was driven.
fn rounded(gain: f64) -> f64 {
    format!("{gain:.3e}").parse().unwrap_or(gain)
}

/// A set over the paper's, in the order of [`BARS`].
pub(super) fn ratios(set: &[Figures], paper: &[Figures], drivers: &[Member]) -> [f64; BARS.len()] {
    let all = |_: &usize| true;
    let has_lines = drivers.iter().any(|driver| driver.line_m != 0.0);
    let with_line = |place: &usize| !has_lines || drivers[*place].line_m != 0.0;
    let sum = |figures: &[Figures], figure: usize, counts: &dyn Fn(&usize) -> bool| -> f64 {
        let places = (0..figures.len()).filter(counts);
        places.map(|place| figures[place][figure]).sum()
    };
    let ratio =
        |figure, counts: &dyn Fn(&usize) -> bool| sum(set, figure, counts) / sum(paper, figure, counts);
    let worst_four = |figures: &[Figures]| {
        let mut peaks: Vec<f64> = figures.iter().map(|figures| figures[PEAK]).collect();
        peaks.sort_by(|a, b| b.total_cmp(a));
        peaks.iter().take(4).sum::<f64>()
    };
    let losses = set.iter().zip(paper).map(|(set, paper)| set[LOSS] / paper[LOSS]);
    [
        ratio(PEAK, &all),
        worst_four(set) / worst_four(paper),
        ratio(LOSS, &all),
        losses.fold(0.0, f64::max),
        ratio(EFFORT, &with_line),
        ratio(CONFLICT, &with_line),
        ratio(NOISE, &all),
    ]
}
