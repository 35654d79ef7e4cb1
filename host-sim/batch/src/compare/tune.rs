//! The same budget for every law: its untuned set, and points of Sobol's sequence in the box of what tuning may vary. The set with the
//! least objective is judged; the objective is a weighted sum of metrics, averaged over the training drives.

use super::drive::{Driven, METRICS};
use super::{Compare, Faults, ScenarioError};
use crate::sweep::sobol::Dimension;

/// A law after tuning.
#[derive(Debug, Clone)]
pub(super) struct Tuned {
    /// The values of its parameters.
    pub(super) values: Vec<f64>,
    /// The objective before and after, if there was anything to tune.
    pub(super) objective: Option<[f64; 2]>,
}

/// The sets that are tried for a law: none if nothing of it may vary.
pub(super) fn sets(compare: &Compare, law: usize) -> Vec<Vec<f64>> {
    let (law, budget) = (
        &compare.laws[law],
        compare.tuning.as_ref().map_or(0, |t| t.budget),
    );
    let untuned = law.untuned();
    let free: Vec<(usize, [f64; 2])> = law
        .kind
        .parameters
        .iter()
        .enumerate()
        .filter(|(place, _)| law.values[*place].is_none())
        .filter_map(|(place, p)| Some((place, p.tuned?)))
        .collect();
    if free.is_empty() {
        return Vec::new();
    }
    let set = |number: u32| {
        let mut values = untuned.clone();
        // Point 0 of the sequence is a corner; the untuned set stands in its place.
        for (dimension, (place, [low, high])) in free.iter().enumerate().filter(|_| number > 0) {
            let share = f64::from(Dimension::new(dimension).at(number)) / f64::from(u32::MAX);
            values[*place] = low + share * (high - low);
        }
        values
    };
    (0..budget).map(set).collect()
}

pub(super) fn tune(compare: &Compare, progress: &(impl Fn() + Sync)) -> Result<Vec<Tuned>, ScenarioError> {
    let all: Vec<Vec<Vec<f64>>> = (0..compare.laws.len()).map(|law| sets(compare, law)).collect();
    let untuned = |law: usize| Tuned {
        values: compare.laws[law].untuned(),
        objective: None,
    };
    let Some(tuning) = &compare.tuning else {
        return Ok((0..all.len()).map(untuned).collect());
    };
    let jobs = compare.jobs(&tuning.drives, |law| all[law].len());
    let driven = compare.drive(&jobs, &all, &tuning.drives, "tuning", Faults::NONE, progress)?;
    let mut places = driven.iter();
    let each = compare.drivers.len() * tuning.drives.places.len() * tuning.drives.seeds as usize;
    let of_law = |(law, sets): (usize, &Vec<Vec<f64>>)| {
        let objectives: Vec<f64> = sets
            .iter()
            .map(|_| {
                places
                    .by_ref()
                    .take(each)
                    .map(|driven| objective(driven, &tuning.weights))
                    .sum::<f64>()
                    / each as f64
            })
            .collect();
        let best = (0..sets.len()).min_by(|a, b| objectives[*a].total_cmp(&objectives[*b]));
        best.map_or_else(
            || untuned(law),
            |best| Tuned {
                values: sets[best].clone(),
                objective: Some([objectives[0], objectives[best]]),
            },
        )
    };
    Ok(all.iter().enumerate().map(of_law).collect())
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
