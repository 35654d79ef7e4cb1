//! `host-sim experiment`.

use std::path::PathBuf;

use clap::Args;
use haptic_batch::experiment::{Drive, Experiment, Plan, experiment};
use haptic_report::studies::experiment as files;

use super::output::Output;
use super::participants::{Participants, check_probe};
use super::{BadInput, Outcome, print, print_json, print_notes, progress, width};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    participants: Participants,
    /// Amplitude of the probe in the guided drives, N.m (0: none). The probe is a small torque added to the guidance;
    /// the driver's answer to it tells K_hg
    #[arg(long, value_name = "AMPLITUDE", default_value_t = 0.0)]
    probe: f64,
    /// Seed of the remnants
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Directory for figures, results and a report
    #[arg(long, value_name = "DIR", default_value = "out/experiment")]
    out: PathBuf,
    /// Write the recorded drives too, a CSV file each, into the directory's logs/
    #[arg(long)]
    logs: bool,
    /// Print the results as one JSON object instead of tables
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    check_probe("--probe", arguments.probe)?;
    let plan = Plan {
        participants: arguments.participants.numbers(),
        probe_nm: arguments.probe,
        seed: arguments.seed,
    };
    let output = Output::begin(&arguments.out, "experiment")?;
    let bar = progress::bar(2 * plan.participants.len() as u64, "drives");
    let result = experiment(&plan, || bar.inc(1))?;
    bar.finish_and_clear();
    output.finish(|place| {
        if arguments.logs {
            files::write_logs(&result, &place.join("logs"))?;
        }
        files::write(&result, place)
    })?;
    if arguments.json {
        print_json(&files::stamped(&result))?;
    } else {
        print(&readable(&result))?;
    }
    print_notes(files::left(&result).as_slice());
    eprintln!("Report: {}", arguments.out.join("report.html").display());
    Ok(Outcome::Good)
}

fn readable(result: &Experiment) -> String {
    let mean = |guided: bool, value: fn(&Drive) -> Option<f64>| -> String {
        let values: Vec<f64> = result
            .drives
            .iter()
            .filter(|d| d.guided == guided)
            .filter_map(value)
            .collect();
        match values.len() {
            0 => "-".into(),
            count => format!("{:.3}", values.iter().sum::<f64>() / count as f64),
        }
    };
    let [low, middle, high] = result.published_trajectory_error_m;
    format!(
        "{}, probe {} N.m, seed {}; a dash: not identified\n\nManual\n{}\nGuided\n{}\n{}\n\
         Mean fit of the published method: manual {} % (the paper: 76), guided {} % (69). {}\n\
         Mean trajectory error, guided: noise model {} m, published method {} m (the paper: {middle}, {low} to {high})",
        result.course,
        result.probe_nm,
        result.seed,
        files::truth_table(result, false).to_text(width()),
        files::truth_table(result, true).to_text(width()),
        files::trajectory_table(result).to_text(width()),
        mean(false, |d| Some(d.paper.identification.fit_percent)),
        mean(true, |d| Some(d.paper.identification.fit_percent)),
        files::FIT_IS_CALIBRATED,
        mean(true, |d| d.noise_model.trajectory_error_m),
        mean(true, |d| d.paper.trajectory_error_m),
    )
}
