//! `host-sim reliance`.

use std::path::PathBuf;

use clap::Args;
use haptic_batch::reliance::{Plan, RelianceResults, study};
use haptic_report::studies::reliance as files;
use haptic_sim::input::in_range;

use super::output::Output;
use super::participants::{Participants, check_probe};
use super::{BadInput, Outcome, print, print_json, progress, width};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    participants: Participants,
    /// Drives of each participant, each with its own remnant
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    seeds: u32,
    /// Frequency of the probe, Hz: a small sine added to the guidance torque, whose answer tells K_hg
    #[arg(long, value_name = "HZ", default_value_t = 2.5)]
    frequency: f64,
    /// Amplitude of the probe, N.m
    #[arg(long, value_name = "NM", default_value_t = 0.2)]
    amplitude: f64,
    /// The drivers' t_nms, s (0.02 to 0.5); the ECU goes on assuming 0.1
    #[arg(long, value_name = "S", default_value_t = 0.1)]
    t_nms: f64,
    /// Directory for a figure, the results and a report; default: no files
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print the results as one JSON object instead of tables
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    in_range("--t-nms", arguments.t_nms, 0.02..=0.5, "s")?;
    check_probe("--amplitude", arguments.amplitude)?;
    let plan = Plan {
        participants: arguments.participants.numbers(),
        seeds: arguments.seeds,
        amplitude_nm: arguments.amplitude,
        frequency_hz: arguments.frequency,
        t_nms_s: arguments.t_nms,
    };
    let output = arguments
        .out
        .as_deref()
        .map(|place| Output::begin(place, "reliance"))
        .transpose()?;
    let drives = plan.participants.len() as u64 * u64::from(plan.seeds);
    let bar = progress::bar(drives, "drives");
    let results = study(&plan, || bar.inc(1))?;
    bar.finish_and_clear();
    if let Some(output) = output {
        output.finish(|place| files::write(&results, place))?;
    }
    if arguments.json {
        print_json(&files::stamped(&results))?;
    } else {
        print(&readable(&results))?;
    }
    if let Some(directory) = &arguments.out {
        eprintln!("Report: {}", directory.join("report.html").display());
    }
    Ok(Outcome::Good)
}

fn readable(results: &RelianceResults) -> String {
    format!(
        "Reliance read live: probe {} N.m at {} Hz, {} seeds\n\n{}\n{}\n{}",
        results.amplitude_nm,
        results.frequency_hz,
        results.seeds,
        files::participants_table(results).to_text(width()),
        files::pooled_table(results).to_text(width()),
        files::settling(results),
    )
}
