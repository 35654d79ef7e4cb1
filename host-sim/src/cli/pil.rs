//! `host-sim pil [SCENARIO.toml]`.

use std::path::{Path, PathBuf};

use clap::Args;
use host_sim::input::InputError;
use host_sim::pil::{Channel, PilError};
use host_sim::scenario::Scenario;
use host_sim::studies::processor::{self, ProcessorError};

use super::{BadInput, Outcome, print, print_json, progress};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Scenario file (TOML, see docs/files.md); default: medium reliance on paper-course
    #[arg(value_name = "SCENARIO.toml")]
    scenario: Option<PathBuf>,
    /// How frames reach the target: fifo (a pipe) or slcan (ASCII on the UART, much slower)
    #[arg(long, default_value = "fifo")]
    channel: Channel,
    /// Let the target count its instructions per step
    #[arg(long)]
    count: bool,
    /// Print the results as one JSON object
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let scenario = match &arguments.scenario {
        Some(path) => Scenario::load(path)?,
        None => Scenario::default(),
    };
    let steps = scenario.course.length_m() / scenario.speed_mps() * 1e3;
    let bar = progress::bar(steps as u64, "steps");
    let result = processor::run(&scenario, arguments.channel, arguments.count, |step| {
        // A thousand updates a second would cost more than the steps.
        if step.is_multiple_of(1000) {
            bar.set_position(step.into());
        }
    });
    bar.finish_and_clear();
    let report = match result {
        Ok(report) => report,
        Err(ProcessorError::Scenario(message)) => {
            let name = arguments
                .scenario
                .as_deref()
                .map_or("pil".into(), Path::to_string_lossy);
            return Err(InputError::new(name, message).into());
        }
        Err(ProcessorError::Target(error @ PilError::Missing(_))) => return Err(error.into()),
        // A target that cannot be built, started or heard is a comparison that failed, not bad usage.
        Err(ProcessorError::Target(error)) => {
            eprintln!("error: {error}");
            return Ok(Outcome::Failed);
        }
    };
    if arguments.json {
        print_json(&report)?;
    } else {
        print(&format!(
            "{} steps, {} frames compared, {} mismatches; {:.0} steps per second over {}",
            report.steps,
            report.frames_compared,
            report.mismatches,
            report.steps_per_second,
            arguments.channel,
        ))?;
        if let Some(instructions) = &report.instructions {
            print(&format!(
                "{} instructions in the worst step (number {}), {:.0} in the mean",
                instructions.worst, instructions.worst_step, instructions.mean
            ))?;
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
