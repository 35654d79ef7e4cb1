//! The paper's figures 8 and 9: lateral error along the road, one panel per driver, one line per condition,
//! the same axes for all panels.

use super::{Axis, Band, Figure, Line, Marker, Panel};
use haptic_log::trace::Trace;

/// One driver's panel.
#[derive(Debug, Clone)]
pub struct DriverPanel<'a> {
    /// Title of the panel.
    pub title: String,
    /// The runs: condition, line style (the same condition has the same style in all figures), record.
    pub runs: Vec<(String, usize, &'a Trace)>,
}

/// Lateral error of the centre of gravity over the stretch `from_m` to `to_m` of the road.
pub fn figure(
    title: &str,
    drivers: &[DriverPanel],
    (from_m, to_m): (f64, f64),
    markers: Vec<Marker>,
    bands: Vec<Band>,
) -> Figure {
    let panel = |driver: &DriverPanel| Panel {
        title: driver.title.clone(),
        y: Axis {
            label: "Lateral error (m)".into(),
            limits: None,
        },
        lines: driver
            .runs
            .iter()
            .map(|(condition, style, trace)| Line {
                label: condition.clone(),
                style: *style,
                points: trace.samples.iter().map(|s| (s.s_m, s.lateral_error_m)).collect(),
            })
            .collect(),
    };
    Figure {
        title: title.into(),
        x: Axis {
            label: "Distance along the road (m)".into(),
            limits: Some((from_m, to_m)),
        },
        same_y: true,
        panels: drivers.iter().map(panel).collect(),
        markers,
        bands,
    }
}
