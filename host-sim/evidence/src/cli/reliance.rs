//! `cargo xtask reliance`.

use crate::reports::reliance::report;
use clap::Args;
use haptic_evidence::reliance::{ReliancePlan, study};
use haptic_sim::input::in_range;

use host_sim::cli::participants::{Participants, check_probe};
use host_sim::cli::results::ResultArguments;
use host_sim::cli::{BadInput, Outcome, progress};

#[derive(Debug, Args)]
pub(crate) struct Arguments {
    #[command(flatten)]
    participants: Participants,
    /// Drives of each participant, each with its own remnant
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    seeds: u32,
    /// Frequency of the probe, Hz: a small sine added to the guidance torque, whose answer tells K_hg
    #[arg(long, value_name = "HZ", default_value_t = 2.5)]
    frequency: f64,
    /// Amplitude of the probe, N.m
    #[arg(long, value_name = "NM", default_value_t = 0.2)]
    amplitude: f64,
    /// The drivers' t_nms, s (0.02 to 0.5); the ECU goes on assuming 0.1
    #[arg(long, value_name = "S", default_value_t = 0.1)]
    t_nms: f64,
    #[command(flatten)]
    results: ResultArguments,
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    in_range("--t-nms", arguments.t_nms, 0.02..=0.5, "s")?;
    check_probe("--amplitude", arguments.amplitude)?;
    let plan = ReliancePlan {
        participants: arguments.participants.numbers(),
        seeds: arguments.seeds,
        amplitude_nm: arguments.amplitude,
        frequency_hz: arguments.frequency,
        t_nms_s: arguments.t_nms,
    };
    let output = arguments.results.begin("reliance")?;
    let results = progress::watched("drives", |watch| study(&plan, watch))?;
    output.show(&report(&results), &results, true)
}
