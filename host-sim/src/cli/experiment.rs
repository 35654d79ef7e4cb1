//! `host-sim experiment`.

use clap::Args;
use haptic_batch::experiment::{ExperimentPlan, experiment};
use haptic_report::studies::experiment::{report, write_logs};

use super::participants::{Participants, check_probe};
use super::results::{DEFAULT_OUT, ResultArguments};
use super::{BadInput, Outcome, progress};

#[derive(Debug, Args)]
#[command(mut_arg("out", |out| out.default_value("out/experiment").help(DEFAULT_OUT)))]
pub(super) struct Arguments {
    #[command(flatten)]
    participants: Participants,
    /// Amplitude of the probe in the guided drives, N.m (0: none). The probe is a small torque added to the guidance;
    /// the driver's answer to it tells K_hg
    #[arg(long, value_name = "AMPLITUDE", default_value_t = 0.0)]
    probe: f64,
    /// Seed of the remnants
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Write the recorded drives too, a CSV file each, into the directory's logs/
    #[arg(long)]
    logs: bool,
    #[command(flatten)]
    results: ResultArguments,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    check_probe("--probe", arguments.probe)?;
    let plan = ExperimentPlan {
        participants: arguments.participants.numbers(),
        probe_nm: arguments.probe,
        seed: arguments.seed,
    };
    let output = arguments.results.begin("experiment")?;
    let drives = 2 * plan.participants.len() as u64;
    let result = progress::over(drives, "drives", |done| experiment(&plan, done))?;
    if let Some(place) = output.place().filter(|_| arguments.logs) {
        write_logs(&result, &place.join("logs"))?;
    }
    let report = report(&result);
    output.show(&report, &report.stamp(&result), true)
}
