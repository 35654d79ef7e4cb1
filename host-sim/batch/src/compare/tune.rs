//! Every law has one budget: its untuned set, and points of Sobol's sequence in the box of what tuning may vary. The set with the
//! least objective is judged; the objective is a weighted sum of metrics, averaged over the training drives.

use super::{Compare, Driven, Faults, METRICS, StudyError, Watch};
use crate::sobol::Dimension;

/// A law after tuning.
#[derive(Debug, Clone)]
pub(super) struct Tuned {
    /// The values of its parameters with each driver; the same with all but of an oracle.
    pub(super) values: Vec<Vec<f64>>,
    /// The objective before and after, over the drivers, if there was anything to tune.
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

pub(super) fn tune(compare: &Compare, watch: &Watch<'_>) -> Result<Vec<Tuned>, StudyError> {
    let all: Vec<Vec<Vec<f64>>> = (0..compare.laws.len()).map(|law| sets(compare, law)).collect();
    let untuned = |law: usize| Tuned {
        values: vec![compare.laws[law].untuned(); compare.drivers.len()],
        objective: None,
    };
    let Some(tuning) = &compare.tuning else {
        return Ok((0..all.len()).map(untuned).collect());
    };
    let jobs = compare.jobs(&tuning.drives, |law| all[law].len());
    let driven = compare.drive(&jobs, &all, &tuning.drives, "tuning", Faults::default(), watch)?;
    let drivers = compare.drivers.len();
    let of_driver = tuning.drives.places.len() * tuning.drives.seeds as usize;
    let mean = |group: &[Driven]| {
        let sum: f64 = group
            .iter()
            .map(|driven| objective(driven, &tuning.weights))
            .sum();
        sum / group.len() as f64
    };
    let mut groups = driven.chunks(of_driver);
    let of_law = |(law, sets): (usize, &Vec<Vec<f64>>)| {
        // By set, then driver.
        let objectives: Vec<Vec<f64>> = sets
            .iter()
            .map(|_| groups.by_ref().take(drivers).map(mean).collect())
            .collect();
        let best = |objective: &dyn Fn(&[f64]) -> f64| {
            (0..sets.len()).min_by(|a, b| objective(&objectives[*a]).total_cmp(&objective(&objectives[*b])))
        };
        let over_all = |of_drivers: &[f64]| of_drivers.iter().sum::<f64>() / drivers as f64;
        let Some(best_of_all) = best(&over_all) else {
            return untuned(law);
        };
        let chosen: Vec<usize> = (0..drivers)
            .map(|driver| match compare.oracles[law] {
                true => best(&|of_drivers| of_drivers[driver]).unwrap_or(best_of_all),
                false => best_of_all,
            })
            .collect();
        let after = chosen
            .iter()
            .enumerate()
            .map(|(driver, set)| objectives[*set][driver]);
        Tuned {
            values: chosen.iter().map(|set| sets[*set].clone()).collect(),
            objective: Some([over_all(&objectives[0]), after.sum::<f64>() / drivers as f64]),
        }
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
