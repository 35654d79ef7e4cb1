//! `cargo xtask availability`.

use std::path::{Path, PathBuf};

use crate::reports::availability::{Balance, Detection, report, worlds};
use clap::Args;
use haptic_batch::engine;
use haptic_campaign::table::{self, FaultCase, Place};
use haptic_campaign::{World, campaign};
use haptic_evidence::availability::{AvailabilityPlan, ROADS, resumed};
use haptic_sim::worlds::WORLDS;
use serde_json::json;

use host_sim::cli::checkpoint::resume;
use host_sim::cli::results::{LevelArgument, ResultArguments};
use host_sim::cli::{BadInput, Outcome, chosen, output, print, progress, width};

#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// Hours in each world on each road, in drives of five minutes
    #[arg(long, value_name = "H", default_value_t = 0.25)]
    hours: f64,
    /// These drives alone, by number, separated by commas, in place of hours of them
    #[arg(long, value_delimiter = ',', value_name = "N,...", conflicts_with = "hours", value_parser = clap::value_parser!(u32).range(0..=1_199_999))]
    drives: Vec<u32>,
    /// Worlds, by name, separated by commas; default: all (--list shows them)
    #[arg(long, value_delimiter = ',', value_name = "NAME,...")]
    worlds: Vec<String>,
    /// Roads, by name, separated by commas: motorway, country; default: both
    #[arg(long, value_delimiter = ',', value_name = "NAME,...")]
    roads: Vec<String>,
    /// Root of all random numbers: which cars, roads, drivers and winds
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(0..=1_000_000_000))]
    seed: u64,
    /// Keep every drive in FILE as soon as it is done; a run with the same FILE goes on from there
    #[arg(long, value_name = "FILE")]
    checkpoint: Option<PathBuf>,
    /// Fail (exit code 1) if with the confidence of --level the rate of a judged world, its roads together, may be above R an hour
    #[arg(long, value_name = "R")]
    max_rate: Option<f64>,
    /// Runs of each fault of the campaign in the world 'everything' (or the last one asked for); 0: none
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u64).range(0..=1_000_000))]
    fault_seeds: u64,
    #[command(flatten)]
    level: LevelArgument,
    #[command(flatten)]
    results: ResultArguments,
    /// Say what is real in each world, and drive nothing
    #[arg(long, conflicts_with_all = ["out", "json", "checkpoint"])]
    list: bool,
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    if arguments.list {
        print(&worlds().to_text(width()))?;
        return Ok(Outcome::Good);
    }
    let plan = plan(arguments)?;
    let out = arguments.results.out.as_deref();
    let kept = kept_in(out, arguments.checkpoint.as_deref());
    let output = arguments.results.begin_beside("availability", &kept)?;
    let file = arguments.checkpoint.as_deref();
    let study = json!({ "study": "availability", "seed": plan.seed });
    let (on_record, checkpoint) = resume(file, study)?;
    if let Some(path) = file {
        output::keeps(path, "drive")?;
    }
    let results = progress::watched("drives of five minutes", |watch| {
        engine::run(&plan, &resumed(&on_record, |drive| checkpoint.add(drive)), watch)
    })?;
    let results = Balance {
        detection: detection(&plan, arguments.fault_seeds),
        availability: results,
    };
    let too_many = |most: f64| {
        let judged = results.availability.judged();
        let mut bounds = judged.map(|cell| cell.declarations.upper);
        bounds.any(|upper| upper > most || upper.is_nan())
    };
    let holds = !arguments.max_rate.is_some_and(too_many);
    output.show(&report(&results), &results, holds)
}

/// The checkpoint's name, if it lies in the directory of the results.
fn kept_in<'a>(directory: Option<&Path>, checkpoint: Option<&'a Path>) -> Vec<&'a str> {
    let within = checkpoint.filter(|path| directory.is_some() && path.parent() == directory);
    let name = within.and_then(|path| path.file_name()?.to_str());
    name.into_iter().collect()
}

fn plan(arguments: &Arguments) -> Result<AvailabilityPlan, BadInput> {
    if !(arguments.hours > 0.0 && arguments.hours <= 100_000.0) {
        let message = format!("--hours: {} is outside 0 to 100000 h", arguments.hours);
        return Err(BadInput(message));
    }
    Ok(AvailabilityPlan {
        worlds: chosen("--worlds", &arguments.worlds, &WORLDS, |c| c.name)?,
        roads: chosen("--roads", &arguments.roads, &ROADS, |r| r.name)?,
        hours: arguments.hours,
        seed: arguments.seed,
        only: arguments.drives.clone(),
        level: arguments.level.level,
    })
}

/// Every fault in the world that is to be as good as real.
fn detection(plan: &AvailabilityPlan, seeds: u64) -> Option<Detection> {
    let named = plan.worlds.iter().find(|world| world.name == "everything");
    let world = named.or(plan.worlds.last()).filter(|_| seeds > 0)?;
    let there =
        |row: &&'static FaultCase| row.place != Place::Target && row.left_out(world.has_bar()).is_none();
    let rows: Vec<&'static FaultCase> = table::rows().filter(there).collect();
    let campaign = progress::over(rows.len() as u64 * seeds, "faults", |done| {
        campaign::run(&World::new(Some(world)), &rows, 1..seeds + 1, done)
    });
    Some(Detection {
        world: world.name,
        rows: campaign.rows,
    })
}
