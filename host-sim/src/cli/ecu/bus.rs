//! `host-sim ecu bus`: the worst-case load of the CAN bus.

use clap::Args;
use haptic_batch::bus_load::{table, table_with_proofs};
use haptic_report::studies::bus::Load;

use super::super::results::ResultArguments;
use super::super::{BadInput, Outcome};

#[derive(Debug, Args)]
pub(in crate::cli) struct Arguments {
    /// Count the proofs of an ECU that has keys too, and all that belongs to them
    #[arg(long)]
    proofs: bool,
    #[command(flatten)]
    results: ResultArguments,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let output = arguments.results.begin("ecu bus")?;
    let load = Load::new(if arguments.proofs {
        table_with_proofs()
    } else {
        table()
    });
    output.show(&load.report(), &load, load.driving <= load.max_load)
}
