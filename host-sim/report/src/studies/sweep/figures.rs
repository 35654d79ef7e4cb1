//! The figures of a sweep.

use super::super::place;
use super::words::{OWN_UNIT, by_weight, label, lower, metric, share};
use crate::plot::{Axis, Figure, Marker, Series};
use haptic_batch::sweep::{Compared, Drives, Effect, SobolIndex, Summary};

/// Fields that are drawn: of more, those that matter most.
const DRAWN: usize = 6;

/// A figure with the name of its file and its caption.
pub(super) type Named = (String, String, Figure);

/// Share of the drives over the value of the metric that judges.
pub(super) fn distribution(summary: &Summary) -> Named {
    let (name, unit) = metric(summary.judge);
    let of = summary.distributions.iter().find(|of| of.metric == summary.judge);
    let points = of.map(|of| of.cumulative.clone()).unwrap_or_default();
    let markers = summary.limit.map(|x| Marker::new("limit", x));
    let share = Axis::new("Share of the drives", "-").within(0.0, 1.0);
    let figure = Figure {
        markers: markers.into_iter().collect(),
        ..Axis::new(&name, unit).figure([share.panel([Series::line("", 0, points)])])
    };
    let caption = "Share of the drives at or below each value.";
    ("distribution".into(), caption.into(), figure)
}

/// A row for each field.
pub(super) fn influence(summary: &Summary) -> Option<Named> {
    let judge = label(summary.judge);
    let axis = Axis::new("Share of the variance", "-").within(-0.03, 1.03);
    let (caption, figure) = if summary.sobol.is_empty() {
        let effects = summary.effects.iter();
        let shares = effects
            .clone()
            .map(|effect| share(effect, summary.judge).unwrap_or(f64::NAN));
        let points = shares.enumerate().map(|(i, share)| (place(i), share));
        let panel = axis.panel([Series::dots("by itself", 1, points.collect())]);
        (
            format!("Share of the variance of {judge} that each field explains by itself."),
            Figure::of_rows(effects.map(|effect| &effect.field), [panel]),
        )
    } else {
        let own = || summary.sobol.iter().filter(|index| index.metric == summary.judge);
        let of = |label: &str, style, aside: f64, value: fn(&SobolIndex) -> [f64; 2]| {
            let half = |error: f64| summary.level.normal() * error;
            let ends = |(i, [x, error]): (usize, [f64; 2])| {
                ((place(i) + aside, x), [x - half(error), x + half(error)])
            };
            Series::whiskers(label, style, own().map(value).enumerate().map(ends))
        };
        let panel = axis.panel([
            of("first order", 1, -0.1, |i| i.first),
            of("total", 2, 0.1, |i| i.total),
        ]);
        (
            format!(
                "Sobol indices of {judge} with {} % intervals of their standard errors.",
                summary.level
            ),
            Figure::of_rows(own().map(|index| &index.field), [panel]),
        )
    };
    (!figure.rows.is_empty()).then(|| ("influence".into(), caption, figure))
}

/// The metric that judges along each field in which a level is told apart, those that matter most first.
pub(super) fn responses(summary: &Summary) -> Vec<Named> {
    let mut fields = by_weight(summary);
    fields.retain(|effect| effect.levels.len() > 1 && (!effect.best.is_empty() || has_compared(effect)));
    fields.truncate(DRAWN);
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "._-".contains(c);
    let named = |effect: &Effect| {
        let name = effect.field.replace(|c| !is_plain(c), "_");
        let by = match effect.sliced {
            true => ", by sixteenths of its distribution",
            false => "",
        };
        let caption = format!("Along {}{by}.", effect.field);
        (format!("response-{name}"), caption, response(summary, effect))
    };
    fields.into_iter().map(named).collect()
}

fn response(summary: &Summary, effect: &Effect) -> Figure {
    let numbers = effect.levels.iter().all(|level| level.x.is_some());
    let places: Vec<f64> = match numbers {
        true => effect.levels.iter().filter_map(|level| level.x).collect(),
        false => (0..effect.levels.len()).map(place).collect(),
    };
    let (name, unit) = metric(summary.judge);
    let mean = Axis::new(&format!("Mean {}", lower(&name)), unit);
    let known: Known = |drives| (drives.mean, drives.interval);
    let mut panels = vec![mean.panel(series(summary, effect, &places, numbers, known))];
    if summary.limit.is_some() {
        let known: Known = |drives| {
            let ends = drives.beyond_interval.map(|ends| ends.map(|share| 100.0 * share));
            (drives.beyond.map(|share| 100.0 * share), ends)
        };
        let bad = Axis::new("Bad drives", "%");
        panels.push(bad.panel(series(summary, effect, &places, numbers, known)));
    }
    let x = Axis::new(&effect.field, effect.unit.as_deref().unwrap_or(OWN_UNIT));
    let levels = effect.levels.iter();
    if !numbers {
        let rows = Figure::of_rows(levels.map(|level| &level.label), panels);
        return Figure { x, ..rows };
    }
    let diverged = levels.zip(&places).filter(|(level, _)| level.drives.diverged > 0);
    let label = "drives diverged: their metrics end early";
    Figure {
        markers: diverged.map(|(_, x)| Marker::new(label, *x)).collect(),
        ..x.figure(panels)
    }
}

/// A value and its interval.
type Known = fn(&Drives) -> (Option<f64>, Option<[f64; 2]>);

/// Series of all drives, or of those with each value of the field that is compared; and the best levels.
fn series(summary: &Summary, effect: &Effect, places: &[f64], joined: bool, known: Known) -> Vec<Series> {
    let line = |label: &str, style: usize, values: Vec<(f64, Option<&Drives>)>| {
        let known = |(x, drives): (f64, Option<&Drives>)| {
            let (value, interval) = known(drives?);
            let value = value?;
            Some(((x, value), interval.unwrap_or([value; 2])))
        };
        let line = Series::whiskers(label, style, values.into_iter().filter_map(known));
        if joined { line.joined() } else { line }
    };
    let levels = || places.iter().copied().zip(&effect.levels);
    if let Some(compare) = summary.compare.as_ref().filter(|_| has_compared(effect)) {
        let parts = effect.levels.iter().map(|level| &level.compared);
        let longest = parts.max_by_key(|parts| parts.len());
        let part = |(i, own): (usize, &Compared)| {
            let values = levels().map(|(x, level)| {
                let same = level.compared.iter().find(|other| other.label == own.label);
                (x, same.map(|own| &own.drives))
            });
            line(&format!("{compare} {}", own.label), i + 1, values.collect())
        };
        return longest.into_iter().flatten().enumerate().map(part).collect();
    }
    let all = levels().map(|(x, level)| (x, Some(&level.drives))).collect();
    let best = levels().filter(|(_, level)| effect.best.contains(&level.label));
    let best = best.filter_map(|(x, level)| Some((x, known(&level.drives).0?)));
    vec![
        line(&format!("mean, with its {} % interval", summary.level), 1, all),
        Series::dots("best, with what is not told apart from it", 3, best.collect()),
    ]
}

fn has_compared(effect: &Effect) -> bool {
    effect.levels.iter().any(|level| !level.compared.is_empty())
}
