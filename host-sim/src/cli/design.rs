//! `host-sim design`.

use std::path::PathBuf;

use clap::Args;
use haptic_batch::design::{DesignRequest, design};
use haptic_report::studies::design::report;
use haptic_sim::models::road::{Course, LaneChoice};

use super::participants::Participants;
use super::results::{LevelArgument, ResultArguments};
use super::{BadInput, Outcome, progress, road};

#[derive(Debug, Args)]
#[command(mut_arg("participant", |which| which.default_value("2,5,9")))]
pub(super) struct Arguments {
    /// The parameter that is to be known: gain_1, gain_2, gain_3, k_hg or t_p
    #[arg(long, value_name = "NAME", default_value = "k_hg")]
    parameter: String,
    /// To which standard error, in the parameter's unit
    #[arg(long, value_name = "VALUE", default_value_t = 0.05)]
    error: f64,
    #[command(flatten)]
    participants: Participants,
    /// Frequencies of the probe to choose from, Hz (1 to 5)
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_values_t = [1.0, 1.5, 2.0, 2.5, 3.5, 5.0])]
    frequencies: Vec<f64>,
    /// Amplitudes of the probe to choose from, N.m (0 to 0.3)
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_values_t = [0.1, 0.2])]
    amplitudes: Vec<f64>,
    /// Courses to choose from (TOML or OpenDRIVE .xodr, or paper-course); may be repeated
    #[arg(long, value_name = "FILE", default_value = "paper-course")]
    course: Vec<PathBuf>,
    /// t_nms of the drivers is known: without it, its uncertainty (0.03 s about 0.1 s) is a part of the errors
    #[arg(long)]
    t_nms_known: bool,
    /// Drives of each participant that the best design is confirmed with; 0 for none
    #[arg(long, value_name = "N", default_value_t = 5)]
    confirm: u32,
    /// Seed of the remnants
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    level: LevelArgument,
    #[command(flatten)]
    results: ResultArguments,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    if !(arguments.error.is_finite() && arguments.error > 0.0) {
        return Err(format!("--error = {}: a number above 0 is wanted", arguments.error).into());
    }
    let courses = arguments
        .course
        .iter()
        .map(|path| road::open(path, &LaneChoice::default()))
        .collect::<Result<Vec<Course>, _>>()?;
    let question = DesignRequest {
        participants: arguments.participants.numbers(),
        courses,
        frequencies_hz: arguments.frequencies.clone(),
        amplitudes_nm: arguments.amplitudes.clone(),
        parameter: arguments.parameter.clone(),
        error: arguments.error,
        t_nms_known: arguments.t_nms_known,
        confirmations: arguments.confirm,
        seed: arguments.seed,
        level: arguments.level.level,
    };
    let output = arguments.results.begin("design")?;
    let answer = progress::watched("drives", |watch| design(&question, watch))?;
    let best = answer.best.map(|best| &answer.designs[best]);
    let holds = best.is_some_and(|best| best.left_by_itself == 0);
    output.show(&report(&answer), &answer, holds)
}
