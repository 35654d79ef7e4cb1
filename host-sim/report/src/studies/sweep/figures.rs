//! The figures of a sweep.

use super::words::{by_weight, heading, label};
use crate::plot::{Axis, Figure, Panel, Series};
use haptic_batch::sweep::{Effect, Summary};

/// Fields that are drawn: of more, those that matter most.
const DRAWN: usize = 6;

pub(super) fn caption(name: &str, summary: &Summary) -> String {
    match name {
        "distribution" => "Share of the drives at or below each value.".into(),
        "influence" if summary.sobol.is_empty() => {
            format!(
                "Share of the variance of {} that each field explains by itself.",
                label(summary.judge)
            )
        }
        "influence" => format!(
            "Sobol indices of {} with their standard errors.",
            label(summary.judge)
        ),
        _ => {
            let what = if summary.limit.is_some() {
                "Share of bad drives"
            } else {
                "Mean"
            };
            let apart = summary
                .compare
                .as_ref()
                .map_or(String::new(), |field| format!(", by {field}"));
            format!("{what} by value of each field, of a distribution by its sixteenths{apart}.")
        }
    }
}

/// Share of the drives over the value of the metric that judges.
pub(super) fn distribution(summary: &Summary) -> Figure {
    let of = summary.distributions.iter().find(|of| of.metric == summary.judge);
    let points = of.map(|of| of.cumulative.clone()).unwrap_or_default();
    let markers = summary.limit.map(|x| crate::plot::Marker {
        label: "limit".into(),
        x,
    });
    Figure {
        x: Axis::of(&heading(summary.judge)),
        panels: vec![Panel {
            title: String::new(),
            y: Axis {
                limits: Some((0.0, 1.0)),
                ..Axis::of("Share of the drives")
            },
            series: vec![Series::line("", 0, points)],
        }],
        markers: markers.into_iter().collect(),
        ..Figure::default()
    }
}

/// A row for each field.
pub(super) fn influence(summary: &Summary) -> Option<Figure> {
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
            Series::with_mark(label, style, crate::plot::Mark::Whiskers(ends), points)
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
    (!rows.is_empty()).then(|| Figure {
        x: Axis::of("Field"),
        rows,
        panels: vec![Panel {
            title: String::new(),
            y: Axis {
                limits: Some((-0.03, 1.03)),
                ..Axis::of("Share of the variance")
            },
            series,
        }],
        ..Figure::default()
    })
}

/// A panel for each field with numbers, those that matter most first; each over the range of its own field, as a
/// share of it, so that the panels can stand over one axis.
pub(super) fn response(summary: &Summary) -> Option<Figure> {
    let mut fields = by_weight(summary);
    fields.retain(|effect| effect.levels.len() > 1 && effect.levels.iter().all(|l| l.x.is_some()));
    fields.truncate(DRAWN);
    let panel = |effect: &&Effect| {
        let mut levels: Vec<(f64, &haptic_batch::sweep::Level)> = effect
            .levels
            .iter()
            .filter_map(|level| Some((level.x?, level)))
            .collect();
        levels.sort_by(|a, b| a.0.total_cmp(&b.0));
        let [low, high] = [levels.first(), levels.last()].map(|end| end.map_or(0.0, |end| end.0));
        let place = |x: f64| 100.0 * (x - low) / (high - low);
        let is_share = summary.limit.is_some();
        let value = |mean: Option<f64>, beyond: Option<f64>| {
            let value = if is_share { beyond.map(|b| 100.0 * b) } else { mean };
            value.unwrap_or(f64::NAN)
        };
        // Of all drives, or of those with each value of the field that is compared.
        let parts = levels.iter().map(|(_, level)| level.compared.len()).max();
        let series = match parts.unwrap_or(0) {
            0 => {
                let points = levels
                    .iter()
                    .map(|(x, level)| (place(*x), value(level.mean, level.beyond)));
                joined("", 1, points.collect())
            }
            parts => {
                let part = |i: usize| {
                    let own = levels
                        .iter()
                        .filter_map(|(x, level)| Some((*x, level.compared.get(i)?)));
                    let label = own.clone().next().map_or("", |(_, own)| own.label.as_str());
                    let points = own
                        .clone()
                        .map(|(x, own)| (place(x), value(own.mean, own.beyond)));
                    joined(label, i + 1, points.collect())
                };
                (0..parts).flat_map(part).collect()
            }
        };
        Panel {
            title: format!(
                "{}, {} to {}",
                effect.field,
                short_number(low),
                short_number(high)
            ),
            y: Axis::of(if is_share { "Bad (%)" } else { "Mean" }),
            series,
        }
    };
    (!fields.is_empty()).then(|| Figure {
        x: Axis {
            limits: Some((-2.0, 102.0)),
            ..Axis::of("Share of the field's range (%)")
        },
        same_y: true,
        panels: fields.iter().map(panel).collect(),
        ..Figure::default()
    })
}

/// Dots that a line joins; one entry in the legend.
fn joined(label: &str, style: usize, points: Vec<(f64, f64)>) -> Vec<Series> {
    vec![
        Series::line(label, style, points.clone()),
        Series::dots("", style, points),
    ]
}

fn short_number(x: f64) -> String {
    let text = format!("{x:.4}");
    text.trim_end_matches('0').trim_end_matches('.').into()
}
