//! `host-sim ecu bus`: the worst-case load of the CAN bus.

use clap::Args;
use haptic_batch::bus_load::table;
use haptic_report::studies::bus::Load;

use super::super::results::ResultArguments;
use super::super::{BadInput, Outcome};

#[derive(Debug, Args)]
pub(in crate::cli) struct Arguments {
    #[command(flatten)]
    results: ResultArguments,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let output = arguments.results.begin("ecu bus")?;
    let load = Load::new(table());
    output.show(&load.report(), &load, load.load <= load.max_load)
}
