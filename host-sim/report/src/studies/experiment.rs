//! What the experiment shows: truth beside estimate, the paths driven and driven again (as the paper's figure 7), trajectory
//! errors beside the paper's; its recorded drives.

use std::path::Path;

use super::{LEFT_THE_ROAD, ended};
use crate::document::{Block, Cell, Report, Section, Table, WriteError, write_file};
use crate::plot::{Axis, Figure, Panel, Series};
use haptic_analysis::identify::{Parameter, Parameters};
use haptic_batch::experiment::{Drive, Experiment, Finding};
use haptic_batch::left_by_themselves;

/// What the agreement with the paper's fits rests on.
const FIT_IS_CALIBRATED: &str = "No agreement can be read from these fits: the size of the remnant was chosen so that \
    they come out so";

/// Writes what was recorded of each drive, a CSV file each, as `identify` reads them.
///
/// # Errors
/// What could not be written.
pub fn write_logs(experiment: &Experiment, directory: &Path) -> Result<(), WriteError> {
    for drive in &experiment.drives {
        let kind = if drive.guided { "guided" } else { "manual" };
        let name = format!("participant-{:02}-{kind}.csv", drive.participant);
        write_file(&directory.join(name), |f| drive.log.write(f))?;
    }
    Ok(())
}

/// The guided drive whose fit is the middle one, as the paper shows "a typical participant".
fn typical(experiment: &Experiment) -> Option<&Drive> {
    let mut guided: Vec<&Drive> = experiment.drives.iter().filter(|d| d.guided).collect();
    let fit = |d: &Drive| d.noise_model.identification.fit_percent;
    guided.sort_by(|a, b| fit(a).total_cmp(&fit(b)));
    guided.get(guided.len() / 2).copied()
}

fn paths(drive: &Drive) -> Figure {
    let again = |label: &str, style, found: &Finding| {
        // Without an error there is no whole path to take it from.
        let left = found.trajectory_error_m.is_none().then_some(LEFT_THE_ROAD);
        ended(Series::line(label, style, found.path.clone()), left)
    };
    let lines = [Series::line("measured", 0, drive.path.clone())]
        .into_iter()
        .chain(again("identified driver", 1, &drive.noise_model))
        .chain(again("identified driver, published method", 3, &drive.paper));
    let panel = Axis::new("Lateral error", "m").panel(lines);
    Figure {
        title: format!("Participant {}, guided", drive.participant),
        ..Axis::new("Distance along the road", "m").figure([panel])
    }
}

fn torque(drive: &Drive) -> Figure {
    let t = &drive.noise_model.identification.traces;
    let panel = Axis::new("Driver torque", "N.m").panel([
        Series::through("measured", 0, &t.time_s, &t.measured_nm),
        Series::through("simulated", 3, &t.time_s, &t.simulated_nm),
    ]);
    Figure {
        title: format!("Participant {}, guided", drive.participant),
        ..Axis::new("Time", "s").figure([panel])
    }
}

/// Beside each other, so that dots of one participant do not hide one another.
const ASIDE: f64 = 0.15;

fn trajectory_errors(experiment: &Experiment) -> Figure {
    let dots = |label: &str, style, aside, guided: bool, of: fn(&Drive) -> &Finding| {
        let drives = experiment.drives.iter().filter(|d| d.guided == guided);
        let points =
            drives.filter_map(|d| Some((f64::from(d.participant) + aside, of(d).trajectory_error_m?)));
        Series::dots(label, style, points.collect())
    };
    let numbers = || experiment.drives.iter().map(|d| f64::from(d.participant));
    let ends = [
        numbers().fold(f64::INFINITY, f64::min) - 0.5,
        numbers().fold(0.0, f64::max) + 0.5,
    ];
    let [low, mean, high] = experiment.published_trajectory_error_m;
    let panels = [("Guided", true), ("Manual", false)].map(|(title, guided)| {
        let mut series = Vec::new();
        if guided {
            series.push(Series::interval("the paper's range", 5, &ends, &[[low, high]; 2]));
            series.push(Series::line(
                "the paper's mean",
                5,
                ends.map(|x| (x, mean)).to_vec(),
            ));
        }
        series.push(dots("noise model", 0, -ASIDE, guided, |d| &d.noise_model));
        series.push(dots("published method", 3, ASIDE, guided, |d| &d.paper));
        Panel::new(title, Axis::new("Trajectory error", "m"), series)
    });
    Figure {
        same_y: true,
        ..Axis::counting("Participant")
            .within(ends[0], ends[1])
            .figure(panels)
    }
}

/// K_hg of every guided drive: the truth, and both estimates, that of the noise model with its interval.
fn estimates(experiment: &Experiment) -> Figure {
    let guided = || experiment.drives.iter().filter(|d| d.guided);
    let truth = guided().filter_map(|d| Some((f64::from(d.participant) - ASIDE, d.truth.k_hg?)));
    let found = guided().filter_map(|d| {
        let k_hg = &d.noise_model.identification.parameters.k_hg;
        Some((
            (f64::from(d.participant), k_hg.estimate?),
            k_hg.interval(experiment.level.normal())?,
        ))
    });
    let published = guided().filter_map(|d| {
        let k_hg = &d.paper.identification.parameters.k_hg;
        Some((f64::from(d.participant) + ASIDE, k_hg.optimum?))
    });
    let panel = Axis::new("K_hg", "-").panel([
        Series::dots("truth", 0, truth.collect()),
        Series::whiskers(&format!("noise model, {} % interval", experiment.level), 1, found),
        Series::dots("published method", 3, published.collect()),
    ]);
    Axis::counting("Participant").figure([panel])
}

/// The document of the experiment. Every drive follows from the published drivers, the probe and the seed.
pub fn report(experiment: &Experiment) -> Report {
    let errors =
        "Mean distance between the path of the drive and that of the identified driver without remnant.";
    let k_hg = "K_hg of the guided drives. A driver without an estimate by the noise model is one whose data do not identify it.";
    let path = "A typical participant: the path of the drive, and of the drivers identified from it.";
    let simulated = "The same participant: driver torque, measured and simulated by the default method.";
    let mut again = vec![
        Block::Table(trajectory_table(experiment)),
        Block::Text(means(experiment)),
        Block::figure("trajectory_errors", trajectory_errors(experiment), errors),
        Block::figure("k_hg", estimates(experiment), k_hg),
    ];
    if let Some(drive) = typical(experiment) {
        again.push(Block::figure("paths", paths(drive), path));
        again.push(Block::figure("torque", torque(drive), simulated));
    }
    let truth = |guided| vec![Block::Table(truth_table(experiment, guided))];
    let summary = format!(
        "The participants of tables 5 and 6 as drivers with a remnant on {}, which is ours; probe {} N.m, seed {}. Truth beside \
         estimate; a dash where the data do not identify a parameter. {FIT_IS_CALIBRATED}.",
        experiment.course, experiment.probe_nm, experiment.seed,
    );
    let sections = vec![
        Section::new("Manual", truth(false)),
        Section::new("With guidance", truth(true)),
        Section::new("The identified drivers drive again", again),
    ];
    let title = format!("{} drives, identified", experiment.drives.len());
    Report::new(title, summary, sections).with_notes(left(experiment).into_iter().collect())
}

/// Mean fits and errors, beside the paper's.
fn means(experiment: &Experiment) -> String {
    let mean = |guided: bool, value: fn(&Drive) -> Option<f64>| -> String {
        let drives = experiment.drives.iter().filter(|d| d.guided == guided);
        let values: Vec<f64> = drives.filter_map(value).collect();
        match values.len() {
            0 => "-".into(),
            count => format!("{:.3}", values.iter().sum::<f64>() / count as f64),
        }
    };
    let fit = |d: &Drive| Some(d.paper.identification.fit_percent);
    let [low, middle, high] = experiment.published_trajectory_error_m;
    format!(
        "Mean fit of the published method: manual {} % (the paper: 76), guided {} % (69). {FIT_IS_CALIBRATED}.\n\
         Mean trajectory error, guided: noise model {} m, published method {} m (the paper, of people: {middle}, {low} to \
         {high}; these drivers are the model and a remnant, so less is left over).",
        mean(false, fit),
        mean(true, fit),
        mean(true, |d| d.noise_model.trajectory_error_m),
        mean(true, |d| d.paper.trajectory_error_m),
    )
}

/// Truth beside estimates, of the guided or the manual drives.
fn truth_table(experiment: &Experiment, guided: bool) -> Table {
    let sum = |d: &Drive| d.truth.k_d + haptic_analysis::identify::Muscle::default().k_nms;
    type ParameterColumn = (&'static str, fn(&Parameters) -> &Parameter, usize);
    let columns: [ParameterColumn; 5] = [
        ("gain_1", |p| &p.gain_1, 3),
        ("gain_2", |p| &p.gain_2, 3),
        ("gain_3", |p| &p.gain_3, 2),
        ("t_p", |p| &p.t_p, 3),
        ("K_hg", |p| &p.k_hg, 3),
    ];
    let shown = &columns[..if guided { 5 } else { 4 }];
    let mut rows = Vec::new();
    for drive in experiment.drives.iter().filter(|d| d.guided == guided) {
        let t = &drive.truth;
        let truths = [
            t.a_1 * sum(drive),
            t.a_2 * sum(drive),
            t.a_3 * sum(drive),
            t.t_p,
            t.k_hg.unwrap_or(0.0),
        ];
        let start = |method: &str, fit: f64| {
            vec![
                ("Participant".into(), Cell::Text(drive.participant.to_string())),
                ("Method".into(), Cell::text(method)),
                ("Fit %".into(), Cell::number(fit, 1)),
            ]
        };
        let both = |name: &str, value, error| [(name.into(), value), (format!("{name} error"), error)];
        let mut row = start("truth", t.fitness);
        for (value, (name, _, decimals)) in truths.into_iter().zip(shown) {
            row.extend(both(name, Cell::number(value, *decimals), Cell::text("")));
        }
        rows.push(row);
        for found in [&drive.noise_model, &drive.paper].map(|finding| &finding.identification) {
            let mut row = start(found.method, found.fit_percent);
            for (name, parameter, decimals) in shown {
                let p = parameter(&found.parameters);
                // The published method names a number whatever the data say; it is shown as it would be printed.
                let value = if found.method == "paper" {
                    p.optimum
                } else {
                    p.estimate
                };
                let error = Cell::number(p.standard_error, *decimals);
                row.extend(both(name, Cell::number(value, *decimals), error));
            }
            rows.push(row);
        }
    }
    Table::of_rows(
        "Parameters with their standard errors; the truth's fit is the paper's. The published method's \
                  come as it would print them, on a bound or not, with errors that are too small where its residuals are not white.",
        rows,
    )
}

/// How far the identified drivers drive from those that they were identified from.
fn trajectory_table(experiment: &Experiment) -> Table {
    let [low, mean, high] = experiment.published_trajectory_error_m;
    let row = |d: &Drive| {
        [
            ("Participant", Cell::Text(d.participant.to_string())),
            ("Drive", Cell::text(if d.guided { "guided" } else { "manual" })),
            ("Noise model", Cell::number(d.noise_model.trajectory_error_m, 3)),
            ("Published method", Cell::number(d.paper.trajectory_error_m, 3)),
        ]
    };
    let caption = format!(
        "Mean absolute trajectory error, m. The paper's, of people with guidance: {low} to {high}, mean {mean}."
    );
    Table::of_rows(caption, experiment.drives.iter().map(row))
}

/// Which drives, recorded or driven again, were not guided throughout; none if all were.
fn left(experiment: &Experiment) -> Option<String> {
    let drives = experiment.drives.iter().filter(|d| d.guided).flat_map(|d| {
        let name = |what: &str| format!("participant {}, {what},", d.participant);
        [
            (&d.away, name("recorded")),
            (&d.noise_model.away, name("by the noise model")),
            (&d.paper.away, name("by the published method")),
        ]
    });
    left_by_themselves(drives)
}
