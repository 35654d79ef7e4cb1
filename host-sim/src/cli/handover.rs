//! `host-sim handover`.

use std::path::PathBuf;

use clap::Args;
use haptic_batch::handover::{HandoverResults, HandoverRow, ROWS, study};
use haptic_report::studies::handover as files;

use super::output::Output;
use super::{BadInput, Outcome, print, print_json, progress, width};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Directory for a figure, the results and a report; default: no files
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print the results as one JSON object instead of a table
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let output = arguments
        .out
        .as_deref()
        .map(|place| Output::begin(place, "handover"))
        .transpose()?;
    let bar = progress::bar(ROWS as u64, "rows");
    let results = study(|| bar.inc(1))?;
    bar.finish_and_clear();
    if let (Some(output), Some(directory)) = (output, &arguments.out) {
        output.finish(|place| files::write(&results, place))?;
        eprintln!("Report: {}", directory.join("report.html").display());
    }
    if arguments.json {
        print_json(&files::stamped(&results))?;
    } else {
        print(&readable(&results))?;
    }
    Ok(if results.rows.iter().any(HandoverRow::is_broken) {
        Outcome::Failed
    } else {
        Outcome::Good
    })
}

fn readable(results: &HandoverResults) -> String {
    format!(
        "{}\n\n{}\n{}",
        files::SUMMARY,
        files::table(results).to_text(width()),
        files::judgement(results)
    )
}
