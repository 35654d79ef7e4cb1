//! `cargo xtask handover`.

use crate::reports::handover::report;
use clap::Args;
use haptic_evidence::handover::{EVERY_S, HandoverRow, study};

use host_sim::cli::progress::Threads;
use host_sim::cli::results::ResultArguments;
use host_sim::cli::{BadInput, Outcome};

#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// Spacing of the instants at which the input is lost, 0.05 to 5
    #[arg(long, value_name = "S", default_value_t = EVERY_S, value_parser = seconds)]
    every: f64,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    results: ResultArguments,
}

fn seconds(text: &str) -> Result<f64, String> {
    let seconds: f64 = text.parse().map_err(|_| "no number".to_owned())?;
    if (0.05..=5.0).contains(&seconds) {
        Ok(seconds)
    } else {
        Err("not from 0.05 to 5 s".into())
    }
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let output = arguments.results.begin("handover")?;
    let threads = &arguments.threads;
    let results = threads.watched("drives", |watch| study(arguments.every, watch))??;
    let holds = !results.rows.iter().any(HandoverRow::is_broken);
    output.show(&report(&results), &results, holds)
}
