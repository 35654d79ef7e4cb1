//! `cargo xtask validate`: the estimates of `identify` and `identify-vehicle` against drivers and vehicles whose truth is known.

use crate::reports::validation::Validation;
use clap::{ArgGroup, Args};
use haptic_batch::StudyError;
use haptic_evidence::estimates::{POPULATION, changes, corruptions, methods, recordings, repeat};
use haptic_evidence::vehicle::coverage;
use haptic_log::near::did_you_mean;

use host_sim::cli::participants::Drives;
use host_sim::cli::results::ResultArguments;
use host_sim::cli::{BadInput, Outcome, progress};

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
    /// Only those of --corruptions and --changes whose name holds this
    #[arg(long, value_name = "TEXT", default_value = "", conflicts_with_all = ["coverage", "methods", "recordings", "vehicles"])]
    only: String,
    #[command(flatten)]
    drives: Drives,
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
    let output = arguments.results.begin("validate")?;
    let questions = [
        arguments.coverage,
        arguments.corruptions,
        arguments.methods,
        arguments.changes,
        arguments.recordings,
        arguments.vehicles,
    ];
    let seeds = questions.into_iter().flatten().next().unwrap_or(1);
    let result = progress::watched("drives", |watch| -> Result<_, StudyError> {
        Ok(if arguments.coverage.is_some() {
            Validation::Coverage(repeat(&plan, seeds, watch)?)
        } else if arguments.corruptions.is_some() {
            Validation::Corruptions(Box::new(corruptions(&plan, seeds, &arguments.only, watch)?))
        } else if arguments.changes.is_some() {
            Validation::Changes(Box::new(changes(&plan, seeds, &arguments.only, watch)?))
        } else if arguments.recordings.is_some() {
            Validation::Recordings(Box::new(recordings(&plan, seeds, watch)?))
        } else if let Some(seeds) = arguments.vehicles {
            Validation::Vehicles(coverage(u64::from(seeds), plan.seed, watch)?)
        } else {
            Validation::Methods(methods(&plan, seeds, watch)?)
        })
    })?;
    let broken = result.broken();
    for line in &broken {
        eprintln!("NOT KEPT: {line}");
    }
    output.show(&result.report(), &result, broken.is_empty())
}
