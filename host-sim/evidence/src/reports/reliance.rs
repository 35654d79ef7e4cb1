//! What the study of the live estimate shows.

use haptic_evidence::reliance::{
    Accuracy, Example, NEAR, ParticipantResult, REMNANT, RelianceResults, SETTLING_S,
};
use haptic_report::document::{Block, Cell, Report, Section, Table};
use haptic_report::plot::{Axis, Figure, Panel};
use haptic_report::studies::run::reliance_panel;

/// Most examples in the figure.
const EXAMPLES: usize = 4;

/// The errors of all participants together, by time.
fn pooled_table(results: &RelianceResults) -> Table {
    let row = |a: &Accuracy| {
        [
            ("Time (s)", Cell::number(a.after_s, 0)),
            ("Estimates", Cell::count(a.count)),
            ("Bias", Cell::number(a.bias, 4)),
            ("RMS error", Cell::number(a.rms, 4)),
            ("Deviation reported", Cell::number(a.deviation, 4)),
            ("Coverage of 95 %", Cell::number(a.coverage, 3)),
        ]
    };
    Table::of_rows("All participants pooled", results.pooled.iter().map(row))
}

/// The errors of each participant, by time.
fn participants_table(results: &RelianceResults) -> Table {
    let row = |p: &ParticipantResult| {
        let name = |what: &str, a: &Accuracy| format!("{what} after {} s", a.after_s);
        let bias = p
            .accuracy
            .iter()
            .map(|a| (name("Bias", a), Cell::number(a.bias, 3)));
        let rms = p
            .accuracy
            .iter()
            .map(|a| (name("RMS", a), Cell::number(a.rms, 3)));
        let head = [
            ("Participant".into(), Cell::count(p.participant)),
            ("True K_hg".into(), Cell::number(p.truth, 3)),
            ("Estimate".into(), Cell::number(p.estimate, 3)),
        ];
        head.into_iter().chain(bias).chain(rms).collect::<Vec<_>>()
    };
    Table::of_rows("Each participant", results.participants.iter().map(row))
}

/// How many estimates are near after a change, and what limited or ended the drives.
fn settling(results: &RelianceResults) -> String {
    let (settling, [limited, steps]) = (&results.settling, results.limited_steps);
    format!(
        "Of {} changes {:.1} % of the estimates are within {NEAR} of the new truth after {SETTLING_S} s; of those by \
         more than 0.3, {:.1} %. RMS error then: {:.3}. A limit held back {limited} of {steps} steps; {} drives \
         diverged.{}",
        settling.count,
        100.0 * settling.near,
        100.0 * settling.near_after_large,
        settling.rms,
        results.diverged,
        match results.left_by_itself {
            0 => String::new(),
            count => format!(" In {count} drives the ECU ended guidance by itself."),
        }
    )
}

/// Changing drives, spread over the participants.
fn figure(results: &RelianceResults) -> Figure {
    let stride = results.examples.len().div_ceil(EXAMPLES).max(1);
    let examples = results.examples.iter().step_by(stride);
    Figure {
        same_y: true,
        ..Axis::new("Time", "s").figure(examples.map(example_panel))
    }
}

/// The study's document. Every drive follows from the published drivers, the probe and the seeds.
pub(crate) fn report(results: &RelianceResults) -> Report {
    let caption = "What the ECU says of K_hg while the driver takes over another's gains.";
    let summary = format!(
        "A probe of {} N.m at {} Hz; drivers of table 6 with a remnant of {} N.m below {} Hz, {} seeds each, on the built-in \
         course, the ECU behind its bus.",
        results.amplitude_nm, results.frequency_hz, REMNANT.0, REMNANT.1, results.seeds
    );
    let changing = vec![
        Block::figure("reliance", figure(results), caption),
        Block::Text(settling(results)),
    ];
    let steady = vec![
        Block::Table(pooled_table(results)),
        Block::Table(participants_table(results)),
    ];
    let sections = vec![
        Section::new("A driver who changes", changing),
        Section::new("A steady driver", steady),
    ];
    Report::new("The driver's reliance, read live", summary, sections)
}

fn example_panel(example: &Example) -> Panel {
    let (time_s, [before, after]) = example.truth;
    let end_s = example.readings.last().map_or(time_s, |r| r.time_s);
    let truth = [(0.0, before), (time_s, before), (time_s, after), (end_s, after)];
    let title = format!("Participant {}", example.participant);
    reliance_panel(&title, &example.readings, &truth, |time_s| time_s)
}
