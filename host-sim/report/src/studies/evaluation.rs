//! What an evaluation shows: figures 8 and 9, figure 9 beside a handover, and its tables; its time series.

use std::path::Path;

use super::{LEFT_THE_ROAD, curves, ended};
use crate::document::{
    Block, Cell, Provenance, Report, Section, SeriesFormat, Table, WriteError, definitions_table,
    metrics_table, write_trace,
};
use crate::plot::{Axis, Band, Figure, Marker, Panel, Series, Shade};
use haptic_batch::RunRecord;
use haptic_batch::evaluate::{DRIVERS_T_P, Evaluation, EvaluationResults};
use haptic_metrics::{DEFINITIONS, Definition};
use haptic_sim::models::road::PAPER_COURSE;
use haptic_sim::models::vehicle::VehicleParameters;
use haptic_sim::scenario::{Condition, FailureKind, Scenario};
use haptic_sim::simulation::Run;
use haptic_sim::unguided::stretches;

/// Metrics of the short table; the report's second table has all of them.
const IN_SHORT: [&str; 7] = [
    "peak_lateral_error_m",
    "mean_abs_lateral_error_m",
    "sdlp_m",
    "time_out_of_lane_s",
    "min_time_to_lane_crossing_s",
    "peak_guidance_torque_nm",
    "peak_driver_torque_nm",
];

/// Writes the time series of the 30 runs, if they are asked for.
///
/// # Errors
/// What could not be written.
pub fn write_series(
    evaluation: &Evaluation,
    series: SeriesFormat,
    directory: &Path,
) -> Result<(), WriteError> {
    for (scenario, run) in &evaluation.runs {
        let name = format!(
            "t_p_{}_{}_failure_{}",
            scenario.driver().t_p,
            scenario.condition(),
            scenario.failure().kind
        );
        write_trace(&directory.join("runs"), &name, &run.trace, series)?;
    }
    Ok(())
}

/// One of the runs stands for all: they differ in t_p, condition and kind of failure alone.
fn provenance(evaluation: &Evaluation) -> Provenance {
    let mut runs = evaluation.runs.iter();
    let one = runs.find(|(s, _)| s.condition() == Condition::Mid && s.failure().kind == FailureKind::Torque);
    Provenance::new(one.map(|(scenario, _)| scenario.to_toml()))
}

/// The main metrics of each run.
fn table(results: &EvaluationResults) -> Table {
    let in_short = |d: &Definition| IN_SHORT.contains(&d.name);
    table_of(results, "The main metrics of each run.", in_short)
}

fn nominal_figure(evaluation: &Evaluation) -> Figure {
    let shown = |s: &Scenario| s.failure().kind == FailureKind::None;
    let title = "Lateral error by reliance on the guidance";
    panels(evaluation, title, &[("", &shown)])
}

/// The manual run has no guidance to fail; it is drawn as what the others fall back to.
fn failure_figure(evaluation: &Evaluation) -> Figure {
    let title = format!(
        "Lateral error when the guidance fails at {} s",
        evaluation.results.failure_time_s
    );
    let shown = |s: &Scenario| s.failure().kind == FailureKind::Torque || s.condition() == Condition::Manual;
    let mut figure = panels(evaluation, &title, &[("", &shown)]);
    figure.markers.extend(failure_marker(evaluation));
    figure
}

/// The sudden loss above the handover, driver by driver, on the same axes.
fn handover_figure(evaluation: &Evaluation) -> Figure {
    let title = format!(
        "Lateral error: guidance torque lost, and input lost and handed over, at {} s",
        evaluation.results.failure_time_s
    );
    let fails = |kind| move |s: &Scenario| s.failure().kind == kind || s.condition() == Condition::Manual;
    let (lost, handed_over) = (fails(FailureKind::Torque), fails(FailureKind::Input));
    let kinds: [Shown; 2] = [(": torque lost", &lost), (": handed over", &handed_over)];
    let mut figure = panels(evaluation, &title, &kinds);
    figure.markers.extend(failure_marker(evaluation));
    figure
}

/// Where the guidance fails, if that is in the figure.
fn failure_marker(evaluation: &Evaluation) -> Option<Marker> {
    let mut runs = evaluation.runs.iter();
    let (scenario, run) = runs.find(|(s, _)| s.failure().kind == FailureKind::Torque)?;
    let [from, to] = evaluation.results.window_m;
    super::failure_marker(scenario, &run.trace.samples).filter(|marker| (from..=to).contains(&marker.x))
}

/// What a panel's title ends with, and which runs it shows.
type Shown<'a> = (&'a str, &'a dyn Fn(&Scenario) -> bool);

/// For each driver one panel for each of `kinds`: lateral error along the road, a line for each condition, the same
/// axes for all.
fn panels(evaluation: &Evaluation, title: &str, kinds: &[Shown]) -> Figure {
    let (mut panels, mut absences) = (Vec::new(), Vec::new());
    for (number, t_p) in DRIVERS_T_P.iter().enumerate() {
        for (ending, shown) in kinds {
            let runs = evaluation.runs.iter();
            let runs = runs.filter(|(s, _)| s.driver().t_p == *t_p && shown(s));
            absences.extend(absent(runs.clone(), panels.len()));
            // A condition has the same style in all figures.
            let style = |condition| Condition::ALL.iter().position(|c| *c == condition).unwrap_or(0);
            let lines = runs.flat_map(|(s, run)| {
                let path = run.trace.samples.iter().map(|s| (s.s_m, s.lateral_error_m));
                let line = Series::line(label(s.condition()), style(s.condition()), path.collect());
                ended(line, run.diverged().then_some(LEFT_THE_ROAD))
            });
            let title = format!("Driver {} (t_p {t_p} s){ending}", number + 1);
            panels.push(Panel::new(title, Axis::new("Lateral error", "m"), lines));
        }
    }
    let [from, to] = evaluation.results.window_m;
    let course = evaluation.runs.first().map(|(scenario, _)| scenario.course());
    let bands = course.map(curves::bands).unwrap_or_default().into_iter();
    let bands = bands.chain(absences);
    let x = Axis::new("Distance along the road", "m").within(from, to);
    Figure {
        title: title.into(),
        same_y: true,
        bands: bands.filter(|band| band.from < to && band.to > from).collect(),
        ..x.figure(panels)
    }
}

/// Where the ECU ended guidance by itself in some run of a panel; what the scenario lets fail is what the figure is about.
fn absent<'a>(runs: impl Iterator<Item = &'a (Scenario, Run)>, panel: usize) -> Vec<Band> {
    let guided = runs.filter(|(scenario, _)| scenario.condition() != Condition::Manual);
    let stretches = guided.flat_map(|(_, run)| stretches(&run.trace).unwrap_or_default());
    let mut left: Vec<_> = stretches.filter(|stretch| !stretch.asked_for).collect();
    left.sort_by(|a, b| a.from_m.total_cmp(&b.from_m));
    let mut bands: Vec<Band> = Vec::new();
    for stretch in left {
        let why = format!("no guidance in some run: {}", stretch.why);
        let touches = |band: &&mut Band| band.label == why && band.to >= stretch.from_m;
        // Shaded once, however many runs there are.
        match bands.iter_mut().find(touches) {
            Some(band) => band.to = band.to.max(stretch.to_m),
            None => bands.push(Band {
                panel: Some(panel),
                ..Band::new(why, [stretch.from_m, stretch.to_m], Shade::Alert)
            }),
        }
    }
    bands
}

fn label(condition: Condition) -> &'static str {
    match condition {
        Condition::Manual => "manual",
        Condition::High => "high reliance",
        Condition::Mid => "mid reliance",
        Condition::Low => "low reliance",
        Condition::Custom => "other gains",
    }
}

/// What a reader of the table cannot guess.
const LEGEND: &str = "t_p: the driver's delay. Condition: how much the driver relies on the guidance.
Failure: none, the guidance torque lost at once, or its input lost and the torque handed over.";

/// The document of an evaluation.
pub fn report(evaluation: &Evaluation) -> Report {
    let results = &evaluation.results;
    let failure_s = results.failure_time_s;
    // All runs have the same.
    let first = evaluation.runs.first();
    let speed = first.map_or_else(String::new, |(scenario, _)| scenario.speed().to_string());
    let course = match results.course == PAPER_COURSE {
        true => "The course is this project's own: the paper prints no numbers for its own. ",
        false => "",
    };
    let [from, to] = results.window_m;
    let nominal = "Lateral error from the centreline, left positive, without failure.";
    let after_s = first.map_or(f64::NAN, |(scenario, _)| scenario.driver().takes_over_after_s);
    let lost = format!(
        "The guidance torque drops to zero at {failure_s} s; {after_s} s later the driver steers as manually. The manual run has \
         no failure and is drawn for comparison."
    );
    let handed_over = format!(
        "Torque lost: it drops to zero at {failure_s} s. Handed over: the lane preview stops at {failure_s} s, and the ECU takes \
         the torque to zero over 2 s. {after_s} s after either the driver steers as manually. Other instants cost more: `host-sim \
         handover` has the worst."
    );
    let figure = |name, figure, caption| vec![Block::figure(name, figure, caption)];
    // So many at a time that paper can hold the table.
    let some = |metrics: &[Definition]| {
        let shown = |d: &Definition| metrics.iter().any(|of| of.name == d.name);
        Block::Table(table_of(results, "", shown)).on_page()
    };
    let all = DEFINITIONS.chunks(9).map(some);
    let all = all.chain([Block::Table(definitions_table()).on_page()]);
    let vehicle = first.map_or_else(String::new, |(scenario, _)| vehicle(scenario));
    let summary = format!(
        "Three drivers under four conditions on {}, {speed}, {vehicle}the shipping controller in the loop, sensors: {}. {course}Metrics \
         are taken over {from} to {to} m of {:.0} m of road, failure at {failure_s} s.",
        results.course,
        format!("{:?}", results.sensors).to_lowercase(),
        results.course_length_m,
    );
    let figure8 = figure("figure8", nominal_figure(evaluation), nominal.into());
    let figure9 = figure("figure9", failure_figure(evaluation), lost);
    let handover = figure("figure9_handover", handover_figure(evaluation), handed_over);
    let in_short = vec![Block::Table(table(results)), Block::Text(LEGEND.into())];
    let sections = vec![
        Section::new("Reliance on the guidance (figure 8)", figure8),
        Section::new("Failure of the guidance (figure 9)", figure9),
        Section::new("Failure of the guidance's input", handover),
        Section::new("Results", in_short),
        Section::of_table("What it must show", claims_table(results)),
        Section::new("All metrics", all.collect()),
    ];
    Report {
        notes: results.notes.clone(),
        provenance: provenance(evaluation),
        ..Report::new("Evaluation of shared steering control", summary, sections)
    }
}

/// The vehicle in a word, if it is not that of the paper.
fn vehicle(scenario: &Scenario) -> String {
    let vehicle = scenario.vehicle();
    if *vehicle == VehicleParameters::default() {
        return String::new();
    }
    format!("another vehicle than that of table 9 (m {} kg), ", vehicle.m)
}

/// What the evaluation must show, and whether it does.
fn claims_table(results: &EvaluationResults) -> Table {
    let caption = if results.claims.len() > 1 {
        "The independent implementation's numbers, and the paper's claims as orderings. The paper has no thresholds: \
         each number that a claim is judged by is this project's."
    } else {
        "What an evaluation on any course rests on."
    };
    let rows = results.claims.iter().map(|claim| {
        let holds = if claim.holds { "holds" } else { "BROKEN" };
        let cells = [holds, &claim.claim, &claim.evidence].map(Cell::text);
        ["Verdict", "Claim", "Evidence"].into_iter().zip(cells)
    });
    Table::of_rows(caption, rows)
}

fn table_of(results: &EvaluationResults, caption: &str, shown: impl Fn(&Definition) -> bool) -> Table {
    // A column of its own only where the ECU ended guidance in a run.
    let some_left = results.runs.iter().any(|r| r.away.is_by_itself());
    let left = |r: &RunRecord| {
        let told = r.away.when_and_why().filter(|_| r.away.is_by_itself());
        some_left.then(|| Cell::Text(told.unwrap_or_default()))
    };
    let keys = |r: &RunRecord| {
        let ended = if r.diverged {
            format!("diverged at {:.0} m", r.end_m)
        } else {
            "end of course".into()
        };
        let texts = [r.condition.to_string(), r.failure.to_string(), ended].map(Cell::Text);
        let t_p = [Cell::number(r.t_p, 1)].into_iter();
        t_p.chain(texts).chain(left(r)).collect()
    };
    let rows: Vec<(Vec<Cell>, _)> = results.runs.iter().map(|r| (keys(r), r.metrics)).collect();
    let keys = ["t_p (s)", "Condition", "Failure", "Ended", "Guidance ended"];
    let keys = &keys[..keys.len() - usize::from(!some_left)];
    metrics_table(caption, keys, &rows, shown)
}
