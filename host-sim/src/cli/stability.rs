//! `host-sim stability`.

use std::path::PathBuf;

use clap::Args;
use haptic_batch::stability::{PLACES, map, shares};
use haptic_report::studies::stability::{self as files, Map};

use super::output::Output;
use super::{BadInput, Outcome, print, print_json, progress, width};
use haptic_sim::Scenario;
use haptic_sim::input::InputError;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Scenario file whose guidance with its schedule, driver, vehicle and world are mapped; speed, delay, arm and road are
    /// the map's, so that a speed that changes is refused; default: the paper's
    #[arg(value_name = "SCENARIO.toml")]
    scenario: Option<PathBuf>,
    /// Directory for figures, the results and a report; default: no files
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print the results as one JSON object instead of a table
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let (name, base) = match &arguments.scenario {
        None => ("the paper's scenario".into(), Scenario::default()),
        Some(path) => (
            path.display().to_string(),
            haptic_batch::files::load_scenario(path)?,
        ),
    };
    let output = arguments
        .out
        .as_deref()
        .map(|place| Output::begin(place, "stability"))
        .transpose()?;
    let bar = progress::bar(PLACES as u64, "places");
    let map = Map {
        places: map(&base, || bar.inc(1)).map_err(|e| InputError::new(&name, e))?,
        shares: shares(&base).map_err(|e| InputError::new(&name, e))?,
    };
    bar.finish_and_clear();
    if let Some(output) = output {
        output.finish(|place| files::write(&map, place))?;
    }
    if arguments.json {
        print_json(&files::stamped(&map))?;
    } else {
        print(&format!(
            "{}\n\n{}\n{}\n{}\n{}",
            files::SUMMARY,
            files::growth_table(&map).to_text(width()),
            files::peak_table(&map).to_text(width()),
            files::shares(&map).to_text(width()),
            files::judgement(&map)
        ))?;
    }
    let broken = map.places.iter().any(|place| place.broken().next().is_some());
    Ok(if broken { Outcome::Failed } else { Outcome::Good })
}
