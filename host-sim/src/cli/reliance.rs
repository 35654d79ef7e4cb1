//! `host-sim reliance`.

use std::path::PathBuf;

use clap::Args;
use haptic_batch::reliance::{NEAR, Plan, Results, SETTLING_S, study};

use super::output::Output;
use super::participants::Participants;
use super::table::{self, number};
use super::{BadInput, Outcome, print, print_json, progress};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Participants of table 6: numbers and ranges such as 1,3..5
    #[arg(long, value_name = "LIST", default_value = "1..14")]
    participants: Participants,
    /// Drives of each participant, each with its own remnant
    #[arg(long, value_name = "N", default_value_t = 20)]
    seeds: u32,
    /// Frequency of the probe, Hz
    #[arg(long, value_name = "HZ", default_value_t = 2.5, allow_negative_numbers = true)]
    frequency: f64,
    /// Amplitude of the probe, N.m
    #[arg(long, value_name = "NM", default_value_t = 0.2, allow_negative_numbers = true)]
    amplitude: f64,
    /// Directory for a figure, the results and a report; default: no files
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print the results as one JSON object instead of tables
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let plan = Plan {
        participants: arguments.participants.0.clone(),
        seeds: arguments.seeds,
        amplitude_nm: arguments.amplitude,
        frequency_hz: arguments.frequency,
    };
    let output = arguments.out.as_deref().map(Output::begin).transpose()?;
    let drives = plan.participants.len() as u64 * u64::from(plan.seeds);
    let bar = progress::bar(drives, "drives");
    let results = study(&plan, || bar.inc(1))?;
    bar.finish_and_clear();
    if let Some(output) = output {
        output.finish(|place| haptic_report::studies::reliance::write(&results, place))?;
    }
    if arguments.json {
        print_json(&results)?;
    } else {
        print(&readable(&results))?;
    }
    if let Some(directory) = &arguments.out {
        eprintln!("Report: {}", directory.join("report.html").display());
    }
    Ok(Outcome::Good)
}

fn readable(results: &Results) -> String {
    let times = || results.pooled.iter().map(|a| format!("{} s", a.after_s));
    let head = ["participant", "K_hg", "estimate"].map(String::from).into_iter();
    let head = head
        .chain(times().map(|t| format!("bias {t}")))
        .chain(times().map(|t| format!("rms {t}")));
    let mut lines = vec![head.collect::<Vec<_>>()];
    for p in &results.participants {
        let line = [
            p.participant.to_string(),
            number(Some(p.truth), 3),
            number(Some(p.estimate), 3),
        ];
        let bias = p.accuracy.iter().map(|a| number(Some(a.bias), 3));
        let rms = p.accuracy.iter().map(|a| number(Some(a.rms), 3));
        lines.push(line.into_iter().chain(bias).chain(rms).collect());
    }
    let heads = [
        "after",
        "estimates",
        "bias",
        "rms",
        "deviation reported",
        "coverage of 95 %",
    ];
    let mut pooled = vec![heads.map(String::from).to_vec()];
    for a in &results.pooled {
        pooled.push(vec![
            format!("{} s", a.after_s),
            a.count.to_string(),
            number(Some(a.bias), 4),
            number(Some(a.rms), 4),
            number(Some(a.deviation), 4),
            number(Some(a.coverage), 3),
        ]);
    }
    let settling = &results.settling;
    let [limited, steps] = results.limited_steps;
    format!(
        "Reliance read live: probe {} N.m at {} Hz, {} seeds\n\n{}\n{}\n{} changes of the driver: {:.1} % within \
         {NEAR} after {SETTLING_S} s (changes by more than 0.3: {:.1} %), rms {:.3}\nlimited: {limited} of {steps} \
         steps; diverged: {} drives",
        results.amplitude_nm,
        results.frequency_hz,
        results.seeds,
        table::text(&lines),
        table::text(&pooled),
        settling.count,
        100.0 * settling.near,
        100.0 * settling.near_after_large,
        settling.rms,
        results.diverged,
    )
}
