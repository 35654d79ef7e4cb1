//! `host-sim ecu pil [SCENARIO.toml]`.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::processor::{self, ProcessorError};
use clap::Args;
use clap::builder::NonEmptyStringValueParser;
use haptic_pil::{Channel, Machine, Target};
use haptic_sim::input::InputError;

use super::super::{BadInput, Outcome, print, print_json, progress};
use super::{ScenarioArgument, failed};

#[derive(Debug, Args)]
pub(in crate::cli) struct Arguments {
    #[command(flatten)]
    scenario: ScenarioArgument,
    /// How frames reach the target: fifo (a pipe) or slcan (ASCII on the UART, much slower)
    #[arg(long, default_value = "fifo")]
    channel: Channel,
    /// QEMU's board: mps2-an386 or mps2-an500
    #[arg(long, default_value_t)]
    machine: Machine,
    /// Let the target count its instructions per step
    #[arg(long)]
    count: bool,
    /// A board that runs the lockstep image, in QEMU's place: a CAN interface (can0), the serial port of an SLCAN
    /// adapter (/dev/ttyUSB0), or tcp:HOST:PORT
    #[arg(long, value_name = "IFACE", conflicts_with_all = ["channel", "machine", "count"],
          value_parser = NonEmptyStringValueParser::new())]
    can: Option<String>,
    /// Print the results as one JSON object
    #[arg(long)]
    json: bool,
}

/// Set by an interrupt or a request to terminate: QEMU must not outlive this program.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let scenario = arguments.scenario.load()?;
    let steps = scenario.duration_s() * 1e3;
    let bar = progress::bar(steps as u64, "steps");
    let target = match &arguments.can {
        Some(adapter) => Target::Board(adapter.clone()),
        None => Target::Qemu {
            machine: arguments.machine,
            channel: arguments.channel,
            count: arguments.count,
        },
    };
    ctrlc::set_handler(|| INTERRUPTED.store(true, Ordering::Relaxed))?;
    let result = processor::run(&scenario, &target, |step| {
        // A thousand updates a second would cost more than the steps.
        if step.is_multiple_of(1000) {
            bar.set_position(step.into());
        }
        if INTERRUPTED.load(Ordering::Relaxed) {
            return ControlFlow::Break(());
        }
        ControlFlow::Continue(())
    });
    bar.finish_and_clear();
    let report = match result {
        Ok(report) => report,
        Err(ProcessorError::Scenario(message)) => {
            let path = arguments.scenario.scenario.as_deref();
            let name = path.map_or("pil".into(), Path::to_string_lossy);
            return Err(InputError::new(name, message).into());
        }
        Err(ProcessorError::Interrupted) => return Ok(Outcome::Interrupted),
        Err(ProcessorError::Target(error)) => return failed(error),
    };
    if arguments.json {
        print_json(&report)?;
    } else {
        print(&format!(
            "{} steps, {} frames compared, {} mismatches; {:.0} steps per second over {}",
            report.steps, report.frames_compared, report.mismatches, report.steps_per_second, report.channel,
        ))?;
        let spent = [("instructions", &report.instructions), ("cycles", &report.cycles)];
        for (what, spent) in spent {
            if let Some(spent) = spent {
                print(&format!(
                    "{} {what} in the worst step (number {}), {:.0} in the mean",
                    spent.worst, spent.worst_step, spent.mean
                ))?;
            }
        }
    }
    if let Some(mismatch) = &report.first_mismatch {
        eprintln!("{mismatch}");
    }
    Ok(if report.mismatches == 0 {
        Outcome::Good
    } else {
        Outcome::Failed
    })
}
