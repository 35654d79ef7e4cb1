//! `host-sim ecu cost [SCENARIO.toml]`: what authentication and a workshop's questions cost the ECU.

use clap::Args;
use haptic_sim::input::InputError;

use super::super::{BadInput, Outcome, print, print_json};
use super::{ScenarioArgument, failed};
use crate::processor::{self, ProcessorError};
use crate::tester;

#[derive(Debug, Args)]
pub(in crate::cli) struct Arguments {
    #[command(flatten)]
    scenario: ScenarioArgument,
    /// Print the results as one JSON object
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let scenario = arguments.scenario.load()?;
    let drive = match processor::record(&scenario) {
        Ok(drive) => drive,
        Err(ProcessorError::Scenario(message)) => return Err(InputError::new("cost", message).into()),
        Err(_) => unreachable!("nothing is started yet"),
    };
    let measured = haptic_pil::cost::measure(&drive).and_then(|costs| Ok((costs, tester::flood()?)));
    let (mut costs, flood) = match measured {
        Ok(measured) => measured,
        Err(error) => return failed(error),
    };
    costs.drives.extend(flood.costs);
    if arguments.json {
        print_json(&costs)?;
        return Ok(Outcome::Good);
    }
    print(
        "instructions in QEMU (Cortex-M4F)        step: mean   worst  behind it, worst  tick, worst  stack, B",
    )?;
    for cost in &costs.drives {
        print(&format!(
            "{:<40} {:>11.0} {:>7} {:>17} {:>12} {:>9}",
            cost.what, cost.mean, cost.worst, cost.worst_behind, cost.worst_tick, cost.stack_bytes
        ))?;
    }
    for (name, one) in [("SipHash-2-4", costs.siphash), ("AES-CMAC", costs.aes)] {
        print(&format!(
            "a lane preview with {name}: {} if it is true, {} if it is false (two MACs)",
            one.taken, one.refused
        ))?;
    }
    print(&format!(
        "the products drive 6 s on a straight road; the questions of a millisecond add {} to its step at most, {} frames of answers",
        flood.added, flood.answers
    ))?;
    Ok(Outcome::Good)
}
