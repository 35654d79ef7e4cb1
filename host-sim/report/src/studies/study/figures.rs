//! The participants under each condition, and what differs between two conditions.

use haptic_batch::statistics;
use haptic_batch::study::{Difference, StudyResults, of_participants};
use haptic_metrics::{DEFINITIONS, Definition};

use super::super::place;
use super::SHOWN;
use crate::plot::{Axis, Figure, Panel, Series};

/// The metrics that are shown, in order.
fn shown() -> impl Iterator<Item = &'static Definition> {
    DEFINITIONS.iter().filter(|d| SHOWN.contains(&d.name))
}

/// A line through the conditions for each participant, and one for the mean.
pub(super) fn conditions(results: &StudyResults) -> Figure {
    let panels = shown().map(|metric| {
        let of = |condition: &String| of_participants(&results.sessions, condition, metric);
        let by_condition: Vec<Vec<Option<f64>>> = results.conditions.iter().map(of).collect();
        let participants = by_condition.iter().map(Vec::len).max().unwrap_or(0);
        let rows = |value: &dyn Fn(&Vec<Option<f64>>) -> Option<f64>| {
            let values = by_condition.iter().enumerate();
            let known = values.filter_map(|(row, values)| Some((place(row), value(values)?)));
            known.collect::<Vec<_>>()
        };
        let each = (0..participants).map(|number| {
            let own = rows(&|values| *values.get(number)?);
            Series::dots("a participant", 5, own).joined()
        });
        let mean = rows(&|values| statistics::mean(values.iter().flatten().copied()));
        let mean = Series::dots("mean", 0, mean).joined();
        Axis::new(metric.label, metric.unit).panel(each.chain([mean]))
    });
    let panels: Vec<Panel> = panels.collect();
    Figure::of_rows(results.conditions.clone(), panels)
}

/// Each pair of conditions with the mean difference and its interval, beside no difference.
pub(super) fn differences(results: &StudyResults) -> Figure {
    let pair = |d: &Difference| format!("{} - {}", d.to, d.from);
    let mut pairs: Vec<String> = results.differences.iter().map(pair).collect();
    pairs.dedup();
    let ends = [0.5, pairs.len() as f64 + 0.5];
    let panels = shown().map(|metric| {
        let own = results.differences.iter().filter(|d| d.metric == metric.name);
        let own = own.filter_map(|difference| {
            let row = pairs.iter().position(|name| *name == pair(difference))?;
            Some(((place(row), difference.mean.mean), difference.mean.ends()))
        });
        let none = Series::line("no difference", 3, ends.map(|row| (row, 0.0)).to_vec());
        let found = Series::whiskers("mean difference", 0, own);
        Axis::new(metric.label, metric.unit).panel([none, found])
    });
    let panels: Vec<Panel> = panels.collect();
    Figure::of_rows(pairs, panels)
}
