//! `host-sim design-guidance FILE.toml`.

use std::path::PathBuf;

use clap::Args;
use haptic_batch::design_guidance::DesignGuidance;
use haptic_report::document::write_bytes;
use haptic_report::studies::design_guidance::{parameters, report};
use serde_json::json;

use super::checkpoint::resume;
use super::progress::Threads;
use super::results::{LevelArgument, ResultArguments};
use super::{BadInput, Outcome, in_file, output};

const OUT: &str = "Directory: every set that was driven, report, results and chosen.toml, which `run` and `ecu parameters` take. A search that was interrupted goes on where it was";
/// The sets that were driven, a line each.
const SETS: &str = "sets.jsonl";

#[derive(Debug, Args)]
#[command(mut_arg("out", |out| out.default_value("out/design-guidance").help(OUT)))]
pub(super) struct Arguments {
    /// Design file (TOML): drivers, roads, speeds, seeds, bars (docs/how-to/design-guidance.md)
    #[arg(value_name = "FILE.toml")]
    file: PathBuf,
    /// The share of drivers with a line of their own in the search, in place of the file's; the judgement keeps the file's
    #[arg(long, value_name = "SHARE")]
    own_line_share: Option<f64>,
    /// The row of the report whose set chosen.toml has
    #[arg(long, value_name = "ROW", default_value_t = 1)]
    choose: u32,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    level: LevelArgument,
    #[command(flatten)]
    results: ResultArguments,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let mut design = DesignGuidance::load(&arguments.file, arguments.own_line_share)?;
    design.level = arguments.level.level;
    let chosen = design.row(arguments.choose)?;
    let out = arguments.results.directory();
    output::check(out, "design-guidance", &[SETS])?;
    std::fs::create_dir_all(out).map_err(in_file(out))?;
    let study = json!({ "study": "design-guidance", "design": format!("{:016x}", design.identity()) });
    let (known, checkpoint) = resume(Some(&out.join(SETS)), study)?;
    output::keeps(out, "set")?;
    let output = arguments.results.begin_beside("design-guidance", &[SETS])?;
    let threads = &arguments.threads;
    let results = threads.watched("sets", |watch| {
        design.run(&known, |set| checkpoint.add(set), watch)
    })??;
    if let Some(place) = output.place() {
        write_bytes(&place.join("chosen.toml"), parameters(&results, chosen))?;
    }
    output.show(&report(&results, chosen), &results, true)
}
