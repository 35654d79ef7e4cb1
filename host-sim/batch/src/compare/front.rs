//! What a law trades: peak, effort and conflict of the sets of its front, over those of the first law, on the judged drives. The judgement is
//! of the fronts, so that no law wins by where its tuning landed.

use crate::several::holm;
use serde::Serialize;

use super::tune::Tuned;
use super::{Compare, Driven, Faults, Mean, Set, Stage, StudyError, Watch, by_unit, mean_of};
use crate::metrics::TRADED;
use crate::statistics::p_of_zero;

/// A set of a law's front, on the judged drives.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FrontPoint {
    /// Place of the law.
    pub law: usize,
    /// Its parameters.
    pub values: Vec<(&'static str, f64)>,
    /// Whether it is the set that the law is judged with elsewhere.
    pub is_judged: bool,
    /// Peak, effort and conflict, means over the drivers and their places, over those of the first law; none if a drive left the road.
    pub ratios: Option<[Mean; 3]>,
    /// The law one of whose sets has clearly less of all three, and how probable so clear a difference is where there is none, corrected by
    /// Holm's method for all pairs of sets of two laws.
    pub beaten_by: Option<(usize, f64)>,
}

/// The ratios of each unit.
type Ratios = [Vec<f64>; 3];

pub(super) fn fronts(
    compare: &Compare,
    tuned: &[Tuned],
    judged: &[Driven],
    watch: &Watch<'_>,
) -> Result<Vec<FrontPoint>, StudyError> {
    let drivers = compare.drivers.len();
    let mut sets: Vec<Set> = Vec::new();
    for (law, tuned) in tuned.iter().enumerate() {
        let others = tuned.front.iter().filter(|values| **values != tuned.values[0]);
        sets.extend(others.map(|values| Set {
            law,
            values: values.clone(),
            drivers: 0..drivers,
        }));
    }
    let adapted = compare.behind_days(&sets, watch)?;
    let driven = compare.drive(&sets, Stage::Judged(&adapted, Faults::default()), watch)?;
    let each = judged.len() / compare.laws.len();
    let laws = (0..compare.laws.len()).map(|law| (law, &tuned[law].values[0], true));
    let others = sets.iter().map(|set| (set.law, &set.values, false));
    let mut found: Vec<(Shown, &[Driven])> = laws
        .chain(others)
        .zip(judged.chunks(each).chain(driven.chunks(each)))
        .collect();
    found.sort_by_key(|((law, ..), _)| *law);
    let first = figures(compare, &judged[..each]);
    let ratios: Vec<Option<Ratios>> = found
        .iter()
        .map(|(_, driven)| over(&figures(compare, driven)?, first.as_ref()?))
        .collect();
    let laws: Vec<usize> = found.iter().map(|((law, ..), _)| *law).collect();
    let beaten = beaten(&laws, &ratios, 1.0 - compare.level.share());
    let point = |(((law, values, is_judged), _), (ratios, beaten_by)): (_, (&Option<Ratios>, _))| {
        let (law, values): (usize, &Vec<f64>) = (law, values);
        let names = compare.laws[law].kind.parameters.iter().map(|p| p.name);
        let mean = |ratios: &Vec<f64>| mean_of(ratios, compare.level);
        FrontPoint {
            law,
            // An oracle has as many sets as there are drivers.
            values: names
                .zip(values.iter().copied())
                .filter(|_| !compare.oracles[law])
                .collect(),
            is_judged,
            ratios: ratios
                .as_ref()
                .and_then(|[a, b, c]| Some([mean(a)?, mean(b)?, mean(c)?])),
            beaten_by,
        }
    };
    let mut points: Vec<FrontPoint> = found
        .into_iter()
        .zip(ratios.iter().zip(beaten))
        .map(point)
        .collect();
    let peak = |point: &FrontPoint| point.ratios.map_or(f64::INFINITY, |[peak, ..]| peak.mean);
    points.sort_by(|a, b| (a.law.cmp(&b.law)).then(peak(a).total_cmp(&peak(b))));
    Ok(points)
}

/// A law, its values, and whether they are those that are judged.
type Shown<'a> = (usize, &'a Vec<f64>, bool);

/// Peak, effort and conflict of each unit; none if a drive left the road. A drive without guidance has no conflict.
fn figures(compare: &Compare, driven: &[Driven]) -> Option<Ratios> {
    let stayed = !driven.iter().any(|driven| driven.off_road);
    let value = |driven: &Driven, metric: usize| Some(driven.values[metric].unwrap_or(0.0));
    let of = |metric: usize| by_unit(compare.units(), driven.iter().map(|driven| value(driven, metric)));
    stayed.then(|| TRADED.map(of))
}

fn over(own: &Ratios, first: &Ratios) -> Option<Ratios> {
    let ratio = |metric: usize| -> Vec<f64> {
        let pairs = own[metric].iter().zip(&first[metric]);
        pairs.map(|(own, first)| own / first).collect()
    };
    let found = [0, 1, 2].map(ratio);
    found
        .iter()
        .flatten()
        .all(|ratio| ratio.is_finite())
        .then_some(found)
}

/// The law that beats each set the most clearly. A set is beaten where another has less of all three: the probability is the largest
/// of three one-sided ones.
fn beaten(laws: &[usize], ratios: &[Option<Ratios>], at_most: f64) -> Vec<Option<(usize, f64)>> {
    let pairs = || (0..laws.len()).flat_map(|a| (0..laws.len()).map(move |b| (a, b)));
    let pairs: Vec<(usize, usize)> = pairs().filter(|(a, b)| laws[*a] != laws[*b]).collect();
    let is_less = |a: &[f64], b: &[f64]| {
        let less: Vec<f64> = a.iter().zip(b).map(|(a, b)| b - a).collect();
        let is_all = less.iter().sum::<f64>() < 0.0;
        p_of_zero(&less).filter(|_| is_all).map_or(1.0, |p| 0.5 * p)
    };
    let p = |(a, b): &(usize, usize)| match (&ratios[*a], &ratios[*b]) {
        (Some(a), Some(b)) => (0..3)
            .map(|metric| is_less(&a[metric], &b[metric]))
            .fold(0.0, f64::max),
        _ => 1.0,
    };
    let corrected = holm(&pairs.iter().map(p).collect::<Vec<_>>());
    let by = |a: usize| {
        let own = pairs.iter().zip(&corrected).filter(|((own, _), _)| *own == a);
        let best = own.min_by(|a, b| a.1.total_cmp(b.1))?;
        (*best.1 < at_most).then_some((laws[best.0.1], *best.1))
    };
    (0..laws.len()).map(by).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four units, by hand: the second law's set has less of all three than the first's; the third's less of two, more of one.
    #[test]
    fn a_set_is_beaten_where_another_law_has_less_of_all_three() {
        let set = |peak: f64, effort: f64, conflict: f64| {
            let noise = [-0.01, 0.0, 0.01, 0.005];
            let of = |mean: f64, times: f64| noise.map(|noise| mean + times * noise).to_vec();
            Some([of(peak, 1.0), of(effort, 2.0), of(conflict, -1.0)])
        };
        let sets = [set(1.0, 1.0, 1.0), set(0.8, 0.8, 0.8), set(0.5, 0.5, 1.2), None];
        // The pairs scatter alike: a little noise of their own, or nothing would have an interval.
        let mut sets = sets;
        for (number, set) in sets.iter_mut().flatten().enumerate() {
            set.iter_mut().for_each(|of| of[number] += 0.002);
        }
        let found = beaten(&[0, 1, 2, 3], &sets, 0.05);
        let by: Vec<Option<usize>> = found.iter().map(|by| by.map(|(law, _)| law)).collect();
        assert_eq!(by, [Some(1), None, None, None]);
        // A law does not beat its own sets.
        assert_eq!(beaten(&[0, 0, 0, 0], &sets, 0.05), vec![None; 4]);
    }
}
