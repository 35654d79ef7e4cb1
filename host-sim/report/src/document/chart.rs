//! A figure as data for the chart library that makes it live in a browser (uPlot, MIT, in `assets/uplot`).
//!
//! The script stands in the page itself; the page's policy names its hash, so the browser runs this script and no
//! other. The values are those of the figure, thinned without losing a peak and rounded to six digits.

use std::sync::OnceLock;

use base64::{Engine, engine::general_purpose::STANDARD};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use crate::plot::{Figure, Mark, Series, colour, dash, units, width};

pub(super) const SCRIPT: &str = concat!(
    include_str!("../../assets/uplot/uPlot.iife.min.js"),
    "\n",
    include_str!("chart.js")
);
pub(super) const STYLE: &str = include_str!("../../assets/uplot/uPlot.min.css");

/// The script's hash, as a content security policy writes it.
pub(super) fn script_hash() -> &'static str {
    static HASH: OnceLock<String> = OnceLock::new();
    HASH.get_or_init(|| format!("sha256-{}", STANDARD.encode(Sha256::digest(SCRIPT))))
}

/// The figure's data as JSON that can stand in a page; none for a figure of rows and for a map, whose drawing says it all.
pub(super) fn data(figure: &Figure) -> Option<String> {
    let is_map = figure.has(|mark| matches!(mark, Mark::Fields { .. }));
    if !figure.rows.is_empty() || figure.panels.is_empty() || is_map {
        return None;
    }
    let figure = figure.clone().thinned();
    let x_limits = figure.x_limits();
    let panels = figure
        .panels
        .iter()
        .zip(figure.y_limits())
        .map(|(panel, limits)| {
            // The browser finds the limits of lines again when it zooms in; it knows nothing of stems and intervals.
            let lines = panel.series.iter().all(|s| matches!(s.mark, Mark::Line));
            let fixed = figure.same_y || panel.y.limits.is_some() || !lines;
            let series = panel.series.iter().map(series);
            json!({
                "title": panel.title,
                "label": units(&panel.y.label),
                "limits": fixed.then_some(limits),
                "series": series.collect::<Vec<_>>(),
            })
        });
    let data = json!({
        "x": units(&figure.x.label),
        "whole": figure.x.whole,
        "limits": x_limits,
        "panels": panels.collect::<Vec<_>>(),
        "markers": figure.markers.iter().map(|m| json!({ "label": m.label, "x": m.x })).collect::<Vec<_>>(),
        "bands": figure.bands.iter()
            .map(|b| json!({ "label": b.label, "from": b.from, "to": b.to, "shade": b.shade, "panel": b.panel }))
            .collect::<Vec<_>>(),
    });
    // Nothing that a browser could take for the end of the script.
    Some(data.to_string().replace('<', "\\u003c"))
}

fn series(series: &Series) -> Value {
    let mut value = json!({
        "label": series.label,
        "colour": colour(series.style),
        "dash": dash(series.style),
        "width": width(series.style),
        "joined": series.joined,
    });
    let mark = match &series.mark {
        Mark::Line => "line",
        Mark::Dots | Mark::Fields { .. } => "dots",
        Mark::Stems => "stems",
        Mark::Bounds => "bounds",
        Mark::Ends => "ends",
        Mark::Whiskers(ends) => {
            value["ends"] = ends.iter().map(|ends| json!(ends.map(rounded))).collect();
            "whiskers"
        }
        Mark::Interval(upper) => {
            value["high"] = upper.iter().map(|v| json!(rounded(*v))).collect();
            "interval"
        }
    };
    value["mark"] = mark.into();
    value["x"] = series.points.iter().map(|p| rounded(p.0)).collect();
    // What is not finite becomes null, and the line breaks there.
    value["y"] = series.points.iter().map(|p| json!(rounded(p.1))).collect();
    value
}

/// Six digits.
fn rounded(value: f64) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    let decimals = 5 - value.abs().log10().floor() as i32;
    let power = 10_f64.powi(decimals.abs());
    match decimals {
        0..=22 => (value * power).round() / power,
        -22..0 => (value / power).round() * power,
        // No power of ten beyond the 22nd is exact.
        _ => value,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::{Axis, Panel};

    #[test]
    fn the_data_of_the_page_are_those_of_the_figure() {
        let points = vec![(0.0, 0.123_456_789), (1.0, f64::NAN), (2.0, -4.0), (9.0, 5.0)];
        let whiskers = Mark::Whiskers(vec![[0.5, 1.5]]);
        let figure = Figure {
            x: Axis::new("Distance", "m").within(0.0, 3.0),
            panels: vec![Panel {
                series: vec![
                    Series::line("a", 1, points),
                    Series::with_mark("b", 0, whiskers, vec![(2.0, 1.0)]),
                ],
                ..Panel::default()
            }],
            ..Figure::default()
        };
        let data: Value = serde_json::from_str(&data(&figure).unwrap()).unwrap();
        let [line, dots] = [0, 1].map(|i| &data["panels"][0]["series"][i]);
        // 9 is out of view, and is where the line runs to.
        assert_eq!(line["x"], json!([0.0, 2.0, 2.0, 9.0]));
        assert_eq!(line["y"], json!([0.123457, null, -4.0, 5.0]));
        assert_eq!(
            (&line["colour"], &line["mark"]),
            (&json!("#0072b2"), &json!("line"))
        );
        assert_eq!((&dots["y"], &dots["ends"]), (&json!([1.0]), &json!([[0.5, 1.5]])));
    }
}
