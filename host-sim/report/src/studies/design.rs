//! The answer to "which experiment": its table, its picture and its report.

use std::path::Path;

use super::OutputError;
use super::files::{write_figure, write_report};
use crate::document::{Block, Cell, Provenance, Report, Section, Stamped, Table, write_json};
use crate::plot::{Axis, Figure, Panel, Series};
use haptic_analysis::identify::INFORMED;
use haptic_batch::design::{Answer, Design};

/// Writes the figure (SVG, PNG), the results (JSON) and a report (HTML).
///
/// # Errors
/// What could not be written or drawn.
pub fn write(answer: &Answer, directory: &Path) -> Result<(), OutputError> {
    let figure = figure(answer);
    write_figure(directory, "design", &figure)?;
    write_json(&directory.join("results.json"), &stamped(answer))?;
    let mut blocks: Vec<Block> = sentences(answer).into_iter().map(Block::Text).collect();
    blocks.push(Block::Figure {
        figure,
        caption: "How long they have to drive, over the frequency of the probe. The level is the length without a probe."
            .into(),
    });
    blocks.push(Block::Table(table(answer)));
    let report = Report {
        title: format!("Which experiment tells {}", answer.parameter),
        summary: format!(
            "Wanted: a standard error of {} of {}.",
            answer.error, answer.parameter
        ),
        sections: vec![Section {
            heading: "Designs".into(),
            blocks,
        }],
        provenance: Some(Provenance::of(None)),
    };
    write_report(directory, &report)
}

/// The answer as JSON holds it.
pub fn stamped(answer: &Answer) -> Stamped<'_, Answer> {
    Provenance::of(None).stamp(answer)
}

fn form(design: &Design) -> String {
    match design.frequencies_hz[..] {
        [] => "none".to_owned(),
        [f] => format!("sine of {f} Hz"),
        [f, g] => format!("half {f} Hz, half {g} Hz"),
        _ => "several".to_owned(),
    }
}

/// Every design, the best one marked.
pub fn table(answer: &Answer) -> Table {
    let row = |(i, d): (usize, &Design)| {
        let mut cells = vec![
            Cell::Text(if answer.best == Some(i) {
                "best".into()
            } else {
                String::new()
            }),
            Cell::Text(d.course.clone()),
            Cell::Text(form(d)),
            Cell::number(d.amplitude_nm, 2),
        ];
        cells.extend(d.standard_errors.iter().map(|&e| Cell::Number {
            value: e.is_finite().then_some(e),
            decimals: 4,
        }));
        cells.push(Cell::Number {
            value: d.needed_s.map(|s| s / 60.0),
            decimals: 1,
        });
        cells
    };
    let mut columns: Vec<String> = ["", "Course", "Probe", "N.m"].map(String::from).to_vec();
    columns.extend(INFORMED.map(|n| format!("error {n}")));
    columns.push("Minutes needed".into());
    let once = answer.designs.first().map_or(0.0, |d| d.span_s);
    Table {
        caption: format!(
            "Least standard errors after once over the course (the first: {once:.0} s), and how long {} takes to {}.",
            answer.parameter, answer.error
        ),
        columns,
        rows: answer.designs.iter().enumerate().map(row).collect(),
    }
}

/// The answer in words.
pub fn sentences(answer: &Answer) -> Vec<String> {
    let Some(best) = answer.best.map(|i| &answer.designs[i]) else {
        return vec![format!(
            "No design here tells {} to {} within two hours.",
            answer.parameter, answer.error
        )];
    };
    let needed_s = best.needed_s.unwrap_or_default();
    let probe = match best.frequencies_hz[..] {
        [] => "without a probe".to_owned(),
        _ => format!("with a probe of {} N.m ({})", best.amplitude_nm, form(best)),
    };
    let mut out = vec![format!(
        "{} to {}: drive {:.1} minutes on {} {probe}.",
        answer.parameter,
        answer.error,
        needed_s / 60.0,
        best.course
    )];
    if best.left_by_itself > 0 {
        out.push(format!(
            "It rests on {} drives in which the ECU ended guidance by itself, and does not hold for guided driving.",
            best.left_by_itself
        ));
    }
    if let Some(c) = &answer.confirmation {
        out.push(format!(
            "Confirmed by {} simulated records of {:.0} s: predicted error {:.4}, RMS error {:.4}; {:.0} % of the 95 % intervals \
             hold the truth.",
            c.fits,
            c.length_s,
            c.predicted,
            c.rms,
            100.0 * c.coverage
        ));
    }
    out
}

/// Minutes over the frequency, a line for each amplitude, a panel for each course.
fn figure(answer: &Answer) -> Figure {
    let mut courses: Vec<&str> = answer.designs.iter().map(|d| d.course.as_str()).collect();
    courses.dedup();
    let minutes = |d: &Design| d.needed_s.map_or(f64::NAN, |s| s / 60.0);
    let panels = courses.into_iter().map(|course| {
        let here = || answer.designs.iter().filter(move |d| d.course == course);
        let single = || here().filter(|d| d.frequencies_hz.len() == 1);
        let mut amplitudes: Vec<f64> = single().map(|d| d.amplitude_nm).collect();
        amplitudes.dedup();
        let mut series: Vec<Series> = amplitudes
            .into_iter()
            .enumerate()
            .map(|(i, a)| {
                let points = single().filter(|d| d.amplitude_nm == a);
                let points = points.map(|d| (d.frequencies_hz[0], minutes(d))).collect();
                Series::line(&format!("{a} N.m"), i + 1, points)
            })
            .collect();
        let halves: Vec<(f64, f64)> = here()
            .filter(|d| d.frequencies_hz.len() == 2)
            .map(|d| (0.5 * (d.frequencies_hz[0] + d.frequencies_hz[1]), minutes(d)))
            .collect();
        if !halves.is_empty() {
            series.push(Series::dots("two sines, at their middle", 6, halves));
        }
        Panel {
            title: course.to_owned(),
            y: Axis {
                label: "Minutes needed".into(),
                limits: None,
                ..Axis::default()
            },
            series,
        }
    });
    Figure {
        x: Axis::of("Frequency of the probe (Hz)"),
        panels: panels.collect(),
        ..Figure::default()
    }
}
