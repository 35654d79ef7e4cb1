//! The figures of a sweep.

use super::words::{OWN_UNIT, by_weight, label, lower, metric};
use crate::plot::{Axis, Figure, Mark, Marker, Panel, Series};
use haptic_batch::sweep::{Compared, Drives, Effect, Summary};

/// Fields that are drawn: of more, those that matter most.
const DRAWN: usize = 6;

/// A figure with the name of its file and its caption.
pub(super) type Named = (String, String, Figure);

/// Share of the drives over the value of the metric that judges.
pub(super) fn distribution(summary: &Summary) -> Named {
    let (name, unit) = metric(summary.judge);
    let of = summary.distributions.iter().find(|of| of.metric == summary.judge);
    let points = of.map(|of| of.cumulative.clone()).unwrap_or_default();
    let markers = summary.limit.map(|x| Marker {
        label: "limit".into(),
        x,
    });
    let figure = Figure {
        x: Axis::new(&name, unit),
        panels: vec![Panel::new(
            "",
            Axis::new("Share of the drives", "-").within(0.0, 1.0),
            vec![Series::line("", 0, points)],
        )],
        markers: markers.into_iter().collect(),
        ..Figure::default()
    };
    let caption = "Share of the drives at or below each value.";
    ("distribution".into(), caption.into(), figure)
}

/// A row for each field.
pub(super) fn influence(summary: &Summary) -> Option<Named> {
    let at = |i: usize| (i + 1) as f64;
    let (rows, series): (Vec<String>, Vec<Series>) = if summary.sobol.is_empty() {
        let share = |effect: &Effect| {
            effect
                .shares
                .iter()
                .find(|(metric, _)| *metric == summary.judge)?
                .1
        };
        let points = summary
            .effects
            .iter()
            .enumerate()
            .map(|(i, effect)| (at(i), share(effect).unwrap_or(f64::NAN)));
        let rows = summary
            .effects
            .iter()
            .map(|effect| effect.field.clone())
            .collect();
        (rows, vec![Series::dots("by itself", 1, points.collect())])
    } else {
        let own: Vec<_> = summary
            .sobol
            .iter()
            .filter(|index| index.metric == summary.judge)
            .collect();
        let of = |label: &str, style, aside: f64, value: fn(&haptic_batch::sweep::SobolIndex) -> [f64; 2]| {
            let points = own
                .iter()
                .enumerate()
                .map(|(i, index)| (at(i) + aside, value(index)[0]))
                .collect();
            let ends = own
                .iter()
                .map(|index| value(index))
                .map(|[x, se]| [x - 1.96 * se, x + 1.96 * se])
                .collect();
            Series::with_mark(label, style, Mark::Whiskers(ends), points)
        };
        let rows = own.iter().map(|index| index.field.clone()).collect();
        (
            rows,
            vec![
                of("first order", 1, -0.1, |i| i.first),
                of("total", 2, 0.1, |i| i.total),
            ],
        )
    };
    let judge = label(summary.judge);
    let caption = if summary.sobol.is_empty() {
        format!("Share of the variance of {judge} that each field explains by itself.")
    } else {
        format!("Sobol indices of {judge} with their standard errors.")
    };
    let figure = Figure {
        panels: vec![Panel::new(
            "",
            Axis::new("Share of the variance", "-").within(-0.03, 1.03),
            series,
        )],
        rows,
        ..Figure::default()
    };
    (!figure.rows.is_empty()).then(|| ("influence".into(), caption, figure))
}

/// The metric that judges along each field in which a level is told apart, those that matter most first.
pub(super) fn responses(summary: &Summary) -> Vec<Named> {
    let mut fields = by_weight(summary);
    fields.retain(|effect| effect.levels.len() > 1 && (!effect.best.is_empty() || has_compared(effect)));
    fields.truncate(DRAWN);
    let plain = |c: char| {
        if c.is_ascii_alphanumeric() || "._-".contains(c) {
            c
        } else {
            '_'
        }
    };
    let named = |effect: &Effect| {
        let name = effect.field.chars().map(plain).collect::<String>();
        let by = if effect.sliced {
            ", by sixteenths of its distribution"
        } else {
            ""
        };
        let caption = format!("Along {}{by}.", effect.field);
        (format!("response-{name}"), caption, response(summary, effect))
    };
    fields.into_iter().map(named).collect()
}

fn response(summary: &Summary, effect: &Effect) -> Figure {
    let numbers = effect.levels.iter().all(|level| level.x.is_some());
    let places: Vec<f64> = if numbers {
        effect.levels.iter().filter_map(|level| level.x).collect()
    } else {
        (1..=effect.levels.len()).map(|i| i as f64).collect()
    };
    let (name, unit) = metric(summary.judge);
    let mut panels = vec![Panel::new(
        "",
        Axis::new(&format!("Mean {}", lower(&name)), unit),
        series(summary, effect, &places, numbers, |drives| {
            (drives.mean, drives.interval)
        }),
    )];
    if summary.limit.is_some() {
        panels.push(Panel::new(
            "",
            Axis::new("Bad drives", "%"),
            series(summary, effect, &places, numbers, |drives| {
                let ends = drives.beyond_interval.map(|ends| ends.map(|share| 100.0 * share));
                (drives.beyond.map(|share| 100.0 * share), ends)
            }),
        ));
    }
    let diverged = effect
        .levels
        .iter()
        .zip(&places)
        .filter(|(level, _)| numbers && level.drives.diverged > 0);
    let markers = diverged.map(|(_, x)| Marker {
        label: "drives diverged: their metrics end early".into(),
        x: *x,
    });
    Figure {
        x: Axis::new(&effect.field, effect.unit.as_deref().unwrap_or(OWN_UNIT)),
        rows: if numbers {
            Vec::new()
        } else {
            effect.levels.iter().map(|level| level.label.clone()).collect()
        },
        panels,
        markers: markers.collect(),
        ..Figure::default()
    }
}

/// A value and its interval.
type Known = fn(&Drives) -> (Option<f64>, Option<[f64; 2]>);

/// Of all drives, or of those with each value of the field that is compared; and the best levels.
fn series(summary: &Summary, effect: &Effect, places: &[f64], joined: bool, known: Known) -> Vec<Series> {
    let line = |label: &str, style: usize, values: Vec<(f64, Option<&Drives>)>| {
        let known = |(x, drives): (f64, Option<&Drives>)| {
            let (value, interval) = known(drives?);
            let value = value?;
            Some(((x, value), interval.unwrap_or([value; 2])))
        };
        let (points, ends): (Vec<_>, Vec<_>) = values.into_iter().filter_map(known).unzip();
        let line = Series::with_mark(label, style, Mark::Whiskers(ends), points);
        if joined { line.joined() } else { line }
    };
    let levels = || places.iter().copied().zip(&effect.levels);
    if let Some(compare) = summary.compare.as_ref().filter(|_| has_compared(effect)) {
        let longest = effect
            .levels
            .iter()
            .map(|level| &level.compared)
            .max_by_key(|parts| parts.len());
        let part = |(i, own): (usize, &Compared)| {
            let values = levels().map(|(x, level)| {
                let same = level.compared.iter().find(|other| other.label == own.label);
                (x, same.map(|own| &own.drives))
            });
            line(&format!("{compare} {}", own.label), i + 1, values.collect())
        };
        return longest.into_iter().flatten().enumerate().map(part).collect();
    }
    let all = line(
        "mean, with its 95 % interval",
        1,
        levels().map(|(x, level)| (x, Some(&level.drives))).collect(),
    );
    let best = levels().filter(|(_, level)| effect.best.contains(&level.label));
    let best = best
        .filter_map(|(x, level)| Some((x, known(&level.drives).0?)))
        .collect();
    vec![
        all,
        Series::dots("best, with what is not told apart from it", 3, best),
    ]
}

fn has_compared(effect: &Effect) -> bool {
    effect.levels.iter().any(|level| !level.compared.is_empty())
}
