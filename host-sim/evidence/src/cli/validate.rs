//! `cargo xtask validate`: the estimates of `identify` and `identify-vehicle` against drivers and vehicles whose truth is known.

use std::path::PathBuf;

use crate::reports::validation::Validation;
use clap::{ArgGroup, Args};
use haptic_batch::StudyError;
use haptic_batch::engine::{self, Store, Watch};
use haptic_batch::experiment::ExperimentPlan;
use haptic_evidence::estimates::{
    POPULATION, RandomDrive, RandomPlan, changes, corruptions, methods, recordings, repeat, resumed_random,
};
use haptic_evidence::vehicle::coverage;
use haptic_log::near::did_you_mean;
use serde_json::json;

use host_sim::cli::checkpoint::resume;
use host_sim::cli::participants::Drives;
use host_sim::cli::progress::Threads;
use host_sim::cli::results::ResultArguments;
use host_sim::cli::{BadInput, Outcome, output};

#[derive(Debug, Args)]
#[command(group = ArgGroup::new("question").required(true), mut_arg("probe", |probe| probe.default_value("0.2")))]
pub(crate) struct Arguments {
    /// Drive N times with each participant, and ask whether the 95 % intervals of each parameter hold the truth in 93 to
    /// 97 % of the drives (200 drives tell). Exit code 1 if they do not
    #[arg(long, value_name = "N", group = "question", value_parser = clap::value_parser!(u32).range(1..))]
    coverage: Option<u32>,
    /// Corrupt N drives of each participant as real logs are (noise, outliers, gaps, hands off, wrong scales, delays and
    /// signs), and count the values that are called identified and are false. Exit code 1 if more than 1 of 1,000 is, or
    /// if lane noise costs too much
    #[arg(long, value_name = "N", group = "question", value_parser = clap::value_parser!(u32).range(1..))]
    corruptions: Option<u32>,
    /// Let N drives of each participant hold a change of the driver (steps and drifts of K_hg, K_d and t_p) or of something else, one
    /// kind after the other: is it seen, when, and is a value called identified that is false? Exit code 1 if more than 1 of
    /// 1,000 is, if an instant of ten is missed by 5 s, or if a constant driver is said to have changed in more than 2 %
    #[arg(long, value_name = "N", group = "question", value_parser = clap::value_parser!(u32).range(1..))]
    changes: Option<u32>,
    /// Put more and more camera noise on N drives of each participant, and compare the ways to treat it (none, a plain
    /// smoother, the default, the published method) with the information bound
    #[arg(long, value_name = "N", group = "question", value_parser = clap::value_parser!(u32).range(1..))]
    methods: Option<u32>,
    /// Record N drives of each participant as the cars of others record real people (10 or 100 rows a second, lane lines with noise,
    /// a torsion bar that feels the wheel), read each as `identify --layout openlka` does, and count as --corruptions does
    #[arg(long, value_name = "N", group = "question", value_parser = clap::value_parser!(u32).range(1..))]
    recordings: Option<u32>,
    /// Share N drives between CommonRoad's three vehicles, in a linear, a nonlinear and a disturbed world each; identify them as
    /// `identify-vehicle` does, and ask how often the 95 % intervals hold the truth. Takes no participant and no probe. Exit code 1
    /// if in the first two worlds those of a quantity surely hold it in fewer than 90 % (20 drives or more tell)
    #[arg(long, value_name = "N", group = "question", value_parser = clap::value_parser!(u32).range(1..), conflicts_with_all = ["participant", "probe"])]
    vehicles: Option<u32>,
    /// Compose N drives by chance (sensors, sampling, vehicle, column, driver, road, guidance, time; two or three at once), every
    /// second with honest conditions alone, and count wrong values and honest logs that are accused, each listed. Drive K of a seed
    /// is the same in every run. Exit code 1 if more than 1 of 1,000 values is wrong, or more than 2 of 100 honest logs are accused
    #[arg(long, value_name = "N", group = "question", value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    random: Option<u32>,
    /// These drives of --random alone, by number, separated by commas; with --out their logs are left there, as drive-K.csv
    #[arg(
        long = "drives",
        value_delimiter = ',',
        value_name = "K,...",
        requires = "random"
    )]
    only_drives: Vec<u32>,
    /// Keep every drive of --random in FILE as soon as it is done; a run with the same FILE goes on from there, with a larger N too
    #[arg(long, value_name = "FILE", requires = "random")]
    checkpoint: Option<PathBuf>,
    /// Only those of --corruptions and --changes whose name holds this
    #[arg(long, value_name = "TEXT", default_value = "", conflicts_with_all = ["coverage", "methods", "recordings", "vehicles", "random"])]
    only: String,
    #[command(flatten)]
    drives: Drives,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    results: ResultArguments,
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let plan = arguments.drives.plan()?;
    let is_asked = |name: &str| name.contains(&arguments.only);
    if !POPULATION.iter().any(|(name, _)| is_asked(name)) && arguments.changes.is_none() {
        let names: Vec<&str> = POPULATION.iter().map(|(name, _)| *name).collect();
        let near = did_you_mean(&arguments.only, names.iter().copied());
        return Err(format!("--only {:?}: none of {}{near}", arguments.only, names.join("; ")).into());
    }
    let logs: Vec<String> = arguments
        .only_drives
        .iter()
        .map(|k| format!("drive-{k}.csv"))
        .collect();
    let kept: Vec<&str> = logs.iter().map(String::as_str).collect();
    let output = arguments.results.begin_beside("validate", &kept)?;
    let file = arguments.checkpoint.as_deref();
    let (on_record, checkpoint) = resume(file, json!({ "study": "random drives", "plan": plan }))?;
    if let Some(path) = file {
        output::keeps(path, "drive")?;
    }
    let store = resumed_random(&on_record, |drive| checkpoint.add(drive));
    let threads = &arguments.threads;
    let result = threads.watched("drives", |watch| arguments.answer(&plan, &store, watch))??;
    let broken = result.broken();
    for line in &broken {
        eprintln!("NOT KEPT: {line}");
    }
    if let Some(place) = output.place() {
        let plan = RandomPlan {
            plan,
            numbers: Vec::new(),
        };
        for (number, name) in arguments.only_drives.iter().zip(&logs) {
            std::fs::write(place.join(name), plan.log_of(*number)?)?;
        }
    }
    output.show(&result.report(), &result, broken.is_empty())
}

impl Arguments {
    fn answer(
        &self,
        plan: &ExperimentPlan,
        on_record: &impl Store<u32, RandomDrive>,
        watch: &Watch<'_>,
    ) -> Result<Validation, StudyError> {
        Ok(if let Some(drives) = self.coverage {
            Validation::Coverage(repeat(plan, drives, watch)?)
        } else if let Some(drives) = self.corruptions {
            Validation::Corruptions(Box::new(corruptions(plan, drives, &self.only, watch)?))
        } else if let Some(drives) = self.changes {
            Validation::Changes(Box::new(changes(plan, drives, &self.only, watch)?))
        } else if let Some(drives) = self.recordings {
            Validation::Recordings(Box::new(recordings(plan, drives, watch)?))
        } else if let Some(drives) = self.vehicles {
            Validation::Vehicles(coverage(u64::from(drives), plan.seed, watch)?)
        } else if let Some(drives) = self.random {
            let numbers = match self.only_drives.as_slice() {
                [] => (0..drives).collect(),
                some => some.to_vec(),
            };
            let plan = RandomPlan {
                plan: plan.clone(),
                numbers,
            };
            Validation::Random(Box::new(engine::run(&plan, on_record, watch)?))
        } else {
            Validation::Methods(methods(plan, self.methods.unwrap_or(1), watch)?)
        })
    }
}
