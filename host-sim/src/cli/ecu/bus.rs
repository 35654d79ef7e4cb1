//! `host-sim ecu bus`: the worst-case load of the CAN bus.

use std::path::PathBuf;

use clap::Args;
use haptic_batch::bus_load::table;
use haptic_report::studies::bus::Load;

use super::super::output::Output;
use super::super::{BadInput, Outcome, print, print_json, width};

#[derive(Debug, Args)]
pub(in crate::cli) struct Arguments {
    /// Directory for a figure, the results and a report; default: no files
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print the table as one JSON object
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let output = arguments
        .out
        .as_deref()
        .map(|place| Output::begin(place, "ecu bus"))
        .transpose()?;
    let load = Load::of(table());
    if let (Some(output), Some(directory)) = (output, &arguments.out) {
        output.finish(|place| load.write(place))?;
        eprintln!("Report: {}", directory.join("report.html").display());
    }
    if arguments.json {
        print_json(&load.stamped())?;
    } else {
        print(&format!(
            "{}\n{}",
            load.table().to_text(width()),
            load.judgement()
        ))?;
    }
    Ok(if load.load <= load.max_load {
        Outcome::Good
    } else {
        Outcome::Failed
    })
}
