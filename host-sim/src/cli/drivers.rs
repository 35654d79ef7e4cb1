//! `host-sim drivers LOG LOG...`: several drivers beside each other.

use std::path::PathBuf;

use clap::Args;
use haptic_analysis::identify::{Options, Recording, open_mapped};
use haptic_batch::identify::{Drivers, compare_drivers};
use haptic_report::studies::drivers as files;

use super::output::Output;
use super::{BadInput, Outcome, print, print_json, progress, width};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Recorded drives, one of each driver, as for identify. Two are compared; three or more are a population too
    #[arg(value_name = "LOG", num_args = 2.., required = true)]
    logs: Vec<PathBuf>,
    /// Drives without guidance: there is no K_hg
    #[arg(long)]
    manual: bool,
    /// Take a driver who changed in pieces, as identify --pieces: each is listed, and the longest one is compared
    #[arg(long)]
    pieces: bool,
    /// A known parameter, the same for all; as for identify
    #[arg(long, value_name = "NAME=VALUE")]
    fix: Vec<String>,
    /// Estimate what is otherwise taken as known; as for identify
    #[arg(long, value_name = "NAME[=LOW..HIGH]")]
    estimate: Vec<String>,
    /// Directory for figures, results and a report; default: no files
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print the results as one JSON object instead of tables
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let mut options = Options::given(arguments.manual, &arguments.fix)?;
    for what in &arguments.estimate {
        options.estimate(what)?;
    }
    options.check()?;
    let mut logs = Vec::new();
    for path in &arguments.logs {
        let how = Recording {
            manual: arguments.manual,
            ..Recording::default()
        };
        let (log, _) = open_mapped(path, &[], &how)?;
        logs.push((path.display().to_string(), log));
    }
    let output = arguments
        .out
        .as_deref()
        .map(|place| Output::begin(place, "drivers"))
        .transpose()?;
    let bar = progress::bar(logs.len() as u64, "drives");
    let found: Drivers = compare_drivers(logs, &options, arguments.pieces, || bar.inc(1));
    bar.finish_and_clear();
    if let Some(output) = output {
        output.finish(|place| files::write(&found, place))?;
    }
    if arguments.json {
        print_json(&files::stamped(&found))?;
    } else {
        let tables: Vec<String> = files::tables(&found).iter().map(|t| t.to_text(width())).collect();
        print(&tables.join("\n"))?;
    }
    if let Some(directory) = &arguments.out {
        eprintln!("Report: {}", directory.join("report.html").display());
    }
    Ok(Outcome::Good)
}
