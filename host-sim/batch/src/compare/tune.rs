//! Tuning in rounds, until the objective stops moving: the untuned set and points of Sobol's sequence in the box of what tuning may vary,
//! then in ever smaller boxes around the best set. The objective is a weighted sum of metrics, averaged over the training drives; all sets
//! are driven with the same draws, so that they are compared pair by pair.

use std::ops::Range;

use serde::Serialize;

use super::{
    Compare, Confidence, Driven, METRICS, Mean, Set, Stage, StudyError, Tuning, Watch, by_unit, mean_of,
};
use crate::metrics::TRADED;
use crate::sobol::Dimension;
use crate::statistics::mean;

/// Sets of the first round for each parameter that is free.
const FIRST: u32 = 8;
/// Sets of each later round, likewise.
const LATER: u32 = 4;
/// Sides of a later round's box, over those of the one before it: a minimum that the first round missed by less than its spacing is inside.
const NARROWS: f64 = 0.6;
/// What must not have moved for tuning to end: one round in a box that missed the minimum does not end it.
const STEADY_ROUNDS: usize = 2;

/// How a law's tuning ended.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TunedBy {
    /// Sets that were tried.
    pub sets: u32,
    /// Whether the objective stopped moving before the budget was used up.
    pub settled: bool,
    /// By how much the last rounds lowered the objective.
    pub moved: Mean,
    /// The objective, untuned and tuned.
    pub objective: [Mean; 2],
}

/// A law after tuning.
#[derive(Debug, Clone)]
pub(super) struct Tuned {
    /// The values of its parameters with each driver; the same with all but of an oracle.
    pub(super) values: Vec<Vec<f64>>,
    /// How it was tuned, if there was anything to tune.
    pub(super) by: Option<TunedBy>,
    /// Sets that no other beats in peak, effort and conflict on the training drives, by their peak; none of an oracle.
    pub(super) front: Vec<Vec<f64>>,
}

/// A set that was tried.
struct Tried {
    values: Vec<f64>,
    /// The objective of each unit.
    objective: Vec<f64>,
    /// Peak, effort and conflict; none if a drive left the road.
    traded: Option<[f64; 3]>,
}

/// The tuning of a law with some drivers.
struct Search {
    law: usize,
    drivers: Range<usize>,
    /// What may vary, and between what.
    free: Vec<(usize, [f64; 2])>,
    tried: Vec<Tried>,
    /// Points of the sequence that were taken.
    points: u32,
    /// How many sets had been tried when each round ended.
    rounds: Vec<usize>,
    settled: bool,
}

impl Search {
    fn new(compare: &Compare, law: usize, drivers: Range<usize>) -> Self {
        let chosen = &compare.laws[law];
        let free = chosen.kind.parameters.iter().zip(&chosen.values).enumerate();
        let free = free.filter(|(_, (_, value))| value.is_none());
        Self {
            law,
            drivers,
            free: free
                .filter_map(|(place, (p, _))| Some((place, p.tuned?)))
                .collect(),
            tried: Vec::new(),
            points: 0,
            rounds: Vec::new(),
            settled: false,
        }
    }

    /// The sets of the next round: none if the tuning is over.
    fn next(&mut self, compare: &Compare, budget: u32) -> Vec<Set> {
        let room = (budget as usize).saturating_sub(self.tried.len());
        if self.settled || self.free.is_empty() || room == 0 {
            return Vec::new();
        }
        let mut sets = Vec::new();
        let begin = if self.rounds.is_empty() {
            sets.push(compare.laws[self.law].untuned());
            sets[0].clone()
        } else {
            self.best(self.tried.len()).values.clone()
        };
        let each = if self.rounds.is_empty() { FIRST } else { LATER };
        for _ in 0..each * self.free.len() as u32 {
            // Point 0 of the sequence is a corner.
            self.points += 1;
            let mut values = begin.clone();
            for (dimension, (place, [low, high])) in self.free.iter().enumerate() {
                let share = f64::from(Dimension::new(dimension).at(self.points)) / f64::from(u32::MAX);
                let side = (high - low) * NARROWS.powi(self.rounds.len() as i32);
                // The box stays within what tuning may vary.
                let from = (begin[*place] - 0.5 * side).min(high - side).max(*low);
                values[*place] = from + share * side;
            }
            sets.push(values);
        }
        let set = |values| Set {
            law: self.law,
            values,
            drivers: self.drivers.clone(),
        };
        sets.into_iter().take(room).map(set).collect()
    }

    /// Takes what came of a round's sets.
    fn take(&mut self, sets: Vec<Set>, driven: &[Driven], tuning: &Tuning, level: Confidence) {
        if sets.is_empty() {
            return;
        }
        let each = driven.len() / sets.len();
        for (set, driven) in sets.into_iter().zip(driven.chunks(each)) {
            let objectives = driven
                .iter()
                .map(|driven| Some(objective(driven, &tuning.weights)));
            // A drive without guidance has no conflict.
            let traded = |metric: usize| mean(driven.iter().map(|d| d.values[metric].unwrap_or(0.0)));
            let stayed = !driven.iter().any(|driven| driven.off_road);
            self.tried.push(Tried {
                values: set.values,
                objective: by_unit(tuning.drives.units(1), objectives),
                traded: stayed.then(|| TRADED.map(|metric| traded(metric).unwrap_or(0.0))),
            });
        }
        self.rounds.push(self.tried.len());
        let now = mean(self.best(self.tried.len()).objective.iter().copied()).unwrap_or(0.0);
        let moved = self.moved(level);
        let most = moved.interval.map_or(moved.mean, |[_, high]| high);
        self.settled = self.rounds.len() > STEADY_ROUNDS && most <= tuning.settles * now.abs();
    }

    /// The best of the first sets.
    fn best(&self, of_first: usize) -> &Tried {
        let by = |tried: &&Tried| mean(tried.objective.iter().copied()).unwrap_or(f64::INFINITY);
        let first = self.tried[..of_first].iter();
        first
            .min_by(|a, b| by(a).total_cmp(&by(b)))
            .expect("the untuned set was tried")
    }

    /// By how much the last rounds lowered the objective, pair by pair.
    fn moved(&self, level: Confidence) -> Mean {
        let before = self.rounds.len().checked_sub(1 + STEADY_ROUNDS);
        let before = self.best(before.map_or(1, |round| self.rounds[round]));
        let now = self.best(self.tried.len());
        let lowered: Vec<f64> = before
            .objective
            .iter()
            .zip(&now.objective)
            .map(|(a, b)| a - b)
            .collect();
        mean_of(&lowered, level).expect("there is a unit")
    }

    /// The sets that no other one beats, by the peak; at most so many, of which the ends are two.
    fn front(&self, most: u32) -> Vec<Vec<f64>> {
        let stayed: Vec<&Tried> = self.tried.iter().filter(|tried| tried.traded.is_some()).collect();
        let points: Vec<[f64; 3]> = stayed.iter().filter_map(|tried| tried.traded).collect();
        let mut front = crate::statistics::front(&points);
        front.sort_by(|a, b| points[*a][0].total_cmp(&points[*b][0]));
        let (last, most) = (front.len().saturating_sub(1), (most as usize).min(front.len()));
        let place = |number: usize| front[number * last / most.saturating_sub(1).max(1)];
        (0..most)
            .map(|number| stayed[place(number)].values.clone())
            .collect()
    }
}

pub(super) fn tune(compare: &Compare, watch: &Watch<'_>) -> Result<Vec<Tuned>, StudyError> {
    let drivers = compare.drivers.len();
    let mut searches = Vec::new();
    for law in 0..compare.laws.len() {
        if compare.oracles[law] {
            searches.extend((0..drivers).map(|driver| Search::new(compare, law, driver..driver + 1)));
        } else {
            searches.push(Search::new(compare, law, 0..drivers));
        }
    }
    if let Some(tuning) = &compare.tuning {
        let of_set = tuning.drives.places.len() * tuning.drives.seeds as usize;
        loop {
            let rounds: Vec<Vec<Set>> = (searches.iter_mut())
                .map(|search| search.next(compare, tuning.budget))
                .collect();
            let sets = rounds.concat();
            if sets.is_empty() {
                break;
            }
            let driven = compare.drive(&sets, Stage::Tuning(&tuning.drives), watch)?;
            let mut rest = &driven[..];
            for (search, sets) in searches.iter_mut().zip(rounds) {
                let (own, behind) = rest.split_at(sets.len() * search.drivers.len() * of_set);
                search.take(sets, own, tuning, compare.level);
                rest = behind;
            }
        }
    }
    let of_law = |law: usize| {
        let own: Vec<&Search> = searches.iter().filter(|search| search.law == law).collect();
        tuned(compare, law, &own)
    };
    Ok((0..compare.laws.len()).map(of_law).collect())
}

/// What came of a law's searches: one, or one for each driver.
fn tuned(compare: &Compare, law: usize, own: &[&Search]) -> Tuned {
    let drivers = compare.drivers.len();
    let Some(tuning) = compare.tuning.as_ref().filter(|_| !own[0].tried.is_empty()) else {
        return Tuned {
            values: vec![compare.laws[law].untuned(); drivers],
            by: None,
            front: Vec::new(),
        };
    };
    let level = compare.level;
    // Over the searches, unit by unit.
    let objective = |tried: &dyn Fn(&Search) -> Vec<f64>| {
        let all: Vec<f64> = own.iter().flat_map(|search| tried(search)).collect();
        let units = all.len() / own.len();
        mean_of(&by_unit(units, all.into_iter().map(Some)), level).expect("there is a unit")
    };
    let most_moved = own.iter().map(|search| search.moved(level));
    let sets: usize = own.iter().map(|search| search.tried.len()).sum();
    Tuned {
        values: (0..drivers)
            .map(|driver| {
                let search = own.iter().find(|search| search.drivers.contains(&driver));
                let search = search.expect("each driver has a search");
                search.best(search.tried.len()).values.clone()
            })
            .collect(),
        by: Some(TunedBy {
            sets: sets as u32,
            settled: own.iter().all(|search| search.settled),
            moved: most_moved
                .max_by(|a, b| a.mean.total_cmp(&b.mean))
                .expect("there is a search"),
            objective: [
                objective(&|search| search.tried[0].objective.clone()),
                objective(&|search| search.best(search.tried.len()).objective.clone()),
            ],
        }),
        front: match own {
            [search] if !compare.oracles[law] => search.front(tuning.front),
            _ => Vec::new(),
        },
    }
}

/// A metric without a value counts nothing: a drive off the road has a peak of 10 m.
fn objective(driven: &Driven, weights: &[f64]) -> f64 {
    let terms = driven.values.iter().zip(weights).zip(METRICS);
    terms
        .map(|((value, weight), metric)| {
            let sign = if metric.more_is_better { -1.0 } else { 1.0 };
            sign * weight * value.unwrap_or(0.0)
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compare::file::from_text;
    use crate::compare::{Confidence, Kinds};
    use crate::files::Source;

    const FILE: &str = "name = 't'\nseeds = 1\nroads = ['paper-course']\nspeeds_kmh = [60]\n[tuning]\nbudget = 200\nseeds = 4\nroads = \
                        ['paper-course']\nspeeds_kmh = [60]\nweights = { peak_lateral_error_m = 1 }\n[[law]]\nkind = 'paper'\n[[driver]]\nkind = 'paper'\n";

    /// A bowl whose lowest place is known, with noise that all sets share: the tuning ends there long before its budget; and with a
    /// budget of one round it says that it did not settle.
    #[test]
    fn tuning_ends_where_the_objective_is_least() {
        let kinds = Kinds::default();
        for (budget, lowest) in [(200, [0.31, 4.4]), (200, [0.25, 6.0]), (17, [0.31, 4.4])] {
            let text = FILE.replace("budget = 200", &format!("budget = {budget}"));
            let compare = from_text(&Source::new("t", std::path::Path::new("")), &text, &kinds).unwrap();
            let tuning = compare.tuning.as_ref().unwrap();
            let mut search = Search::new(&compare, 0, 0..1);
            loop {
                let sets = search.next(&compare, budget);
                if sets.is_empty() {
                    break;
                }
                let driven: Vec<Driven> = (sets.iter())
                    .flat_map(|set| {
                        let away = ((set.values[0] - lowest[0]) / 0.2).powi(2)
                            + ((set.values[1] - lowest[1]) / 4.0).powi(2);
                        [0.1, 0.0, -0.1, 0.05].map(|noise| {
                            let mut values = [Some(0.0); METRICS.len()];
                            values[0] = Some(1.0 + away + noise * (1.0 + 0.1 * away));
                            Driven {
                                values,
                                off_road: false,
                                left_by_itself: false,
                                failed_off_road: 0,
                            }
                        })
                    })
                    .collect();
                search.take(sets, &driven, tuning, Confidence::USUAL);
            }
            assert_eq!(search.settled, budget > 17);
            assert!(search.tried.len() <= budget as usize && (budget == 17 || search.tried.len() < 100));
            let best = &search.best(search.tried.len()).values;
            let tolerance = if search.settled { 0.1 } else { 0.3 };
            assert!(((best[0] - lowest[0]) / 0.2).abs() < tolerance, "{best:?}");
            assert!(((best[1] - lowest[1]) / 4.0).abs() < tolerance, "{best:?}");
        }
    }
}
