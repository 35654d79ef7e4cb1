//! `host-sim stability`.

use std::path::PathBuf;

use clap::Args;
use haptic_batch::files::load_scenario;
use haptic_batch::stability::{map, shares};
use haptic_report::studies::stability::{Map, report};

use super::results::ResultArguments;
use super::{BadInput, Outcome, progress};
use haptic_sim::Scenario;
use haptic_sim::input::InputError;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Scenario file whose guidance with its schedule, driver, vehicle and world are mapped; speed, delay, arm and road are
    /// the map's, so that a speed that changes is refused; default: the paper's
    #[arg(value_name = "SCENARIO.toml")]
    scenario: Option<PathBuf>,
    #[command(flatten)]
    results: ResultArguments,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let (name, base) = match &arguments.scenario {
        None => ("the paper's scenario".into(), Scenario::default()),
        Some(path) => (path.display().to_string(), load_scenario(path)?),
    };
    let output = arguments.results.begin("stability")?;
    let named = |e| InputError::new(&name, e);
    let map = Map {
        places: progress::watched("drives", |watch| map(&base, watch)).map_err(named)?,
        shares: shares(&base).map_err(named)?,
    };
    let holds = map.places.iter().all(|place| place.broken().next().is_none());
    output.show(&report(&map), &map, holds)
}
