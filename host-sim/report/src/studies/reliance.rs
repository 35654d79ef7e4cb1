//! The files of the study, and the panel of estimate and truth that a single run shares with it.

use std::path::Path;

use super::OutputError;
use super::files::{write_figure, write_report};
use crate::document::{Block, Cell, Report, Section, Table, write_json};
use crate::plot::{Axis, Figure, Line, Panel};
use haptic_batch::reliance::{Example, NEAR, REMNANT, Reading, Results, SETTLING_S};

/// Most examples in the figure.
const EXAMPLES: usize = 4;

/// The ECU's estimate with two deviations on each side, and the truth: value from an abscissa on. `x` is the
/// abscissa of a time, s.
pub(super) fn panel(
    title: String,
    readings: &[Reading],
    truth: &[(f64, f64)],
    x: impl Fn(f64) -> f64,
) -> Panel {
    let line = |label: &str, style, value: &dyn Fn([f64; 2]) -> f64| Line {
        label: label.into(),
        style,
        // A line breaks where a value is not finite: no estimate, no line.
        points: readings
            .iter()
            .map(|r| (x(r.time_s), r.estimate.map_or(f64::NAN, value)))
            .collect(),
    };
    let bound = "estimate \u{b1} 2 deviations";
    Panel {
        title,
        y: Axis {
            label: "K_hg".into(),
            limits: Some((-0.5, 1.5)),
        },
        lines: vec![
            line(bound, 3, &|[k_hg, deviation]| k_hg - 2.0 * deviation),
            line(bound, 3, &|[k_hg, deviation]| k_hg + 2.0 * deviation),
            line("estimate", 1, &|[k_hg, _]| k_hg),
            Line {
                label: "truth".into(),
                style: 0,
                points: truth.to_vec(),
            },
        ],
    }
}

/// Writes the figure (SVG, PNG), the results (JSON) and a report (HTML).
///
/// # Errors
/// What could not be written or drawn.
pub fn write(results: &Results, directory: &Path) -> Result<(), OutputError> {
    let figure = figure(results);
    write_figure(directory, "reliance", &figure)?;
    write_json(&directory.join("results.json"), results)?;
    write_report(directory, &report(results, figure))
}

/// Changing drives, spread over the participants.
fn figure(results: &Results) -> Figure {
    let stride = results.examples.len().div_ceil(EXAMPLES).max(1);
    Figure {
        title: String::new(),
        x: Axis {
            label: "Time (s)".into(),
            limits: None,
        },
        same_y: true,
        panels: results
            .examples
            .iter()
            .step_by(stride)
            .map(example_panel)
            .collect(),
        markers: Vec::new(),
        bands: Vec::new(),
    }
}

fn report(results: &Results, figure: Figure) -> Report {
    let number = |value: f64, decimals: usize| Cell::Text(format!("{value:.decimals$}"));
    let pooled = results.pooled.iter().map(|a| {
        vec![
            number(a.after_s, 0),
            number(a.bias, 3),
            number(a.rms, 3),
            number(a.deviation, 3),
            number(a.coverage, 3),
        ]
    });
    let each = results.participants.iter().map(|p| {
        let bias = p.accuracy.iter().map(|a| number(a.bias, 3));
        let rms = p.accuracy.iter().map(|a| number(a.rms, 3));
        let head = [Cell::Text(p.participant.to_string()), number(p.truth, 3)];
        head.into_iter().chain(bias).chain(rms).collect()
    });
    let times = |what: &'static str| {
        results
            .pooled
            .iter()
            .map(move |a| format!("{what} after {} s", a.after_s))
    };
    let columns = ["Participant", "True K_hg"].map(String::from);
    let settling = &results.settling;
    Report {
        title: "The driver's reliance, read live".into(),
        summary: format!(
            "A probe of {} N.m at {} Hz; drivers of table 6 with a remnant of {} N.m below {} Hz, {} seeds \
             each, on the built-in course, the ECU behind its bus.",
            results.amplitude_nm, results.frequency_hz, REMNANT.0, REMNANT.1, results.seeds
        ),
        sections: vec![
            Section {
                heading: "A driver who changes".into(),
                blocks: vec![
                    Block::Figure {
                        figure,
                        caption: "What the ECU says of K_hg while the driver takes over another's gains."
                            .into(),
                    },
                    Block::Text(format!(
                        "Of {} changes {:.1} % of the estimates are within {NEAR} of the new truth after \
                         {SETTLING_S} s; of those by more than 0.3, {:.1} %. RMS error then: {:.3}.",
                        settling.count,
                        100.0 * settling.near,
                        100.0 * settling.near_after_large,
                        settling.rms
                    )),
                ],
            },
            Section {
                heading: "A steady driver".into(),
                blocks: vec![
                    Block::Table(Table {
                        caption: "All participants pooled".into(),
                        columns: [
                            "Time (s)",
                            "Bias",
                            "RMS error",
                            "Deviation reported",
                            "Coverage of 95 %",
                        ]
                        .map(String::from)
                        .to_vec(),
                        rows: pooled.collect(),
                    }),
                    Block::Table(Table {
                        caption: "Each participant".into(),
                        columns: columns
                            .into_iter()
                            .chain(times("Bias"))
                            .chain(times("RMS"))
                            .collect(),
                        rows: each.collect(),
                    }),
                ],
            },
        ],
    }
}

fn example_panel(example: &Example) -> Panel {
    let (time_s, [before, after]) = example.truth;
    let end_s = example.readings.last().map_or(time_s, |r| r.time_s);
    let truth = [(0.0, before), (time_s, before), (time_s, after), (end_s, after)];
    let title = format!("Participant {}", example.participant);
    panel(title, &example.readings, &truth, |time_s| time_s)
}
