//! `host-sim experiment`.

use std::path::PathBuf;

use clap::Args;
use haptic_batch::experiment::{
    Drive, Experiment, POPULATION, Plan, Repetitions, experiment, methods, repeat, spoiled,
};

use haptic_report::studies::experiment as files;

use super::output::Output;
use super::participants::Participants;
use super::{BadInput, Outcome, print, print_json, progress};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    participants: Participants,
    /// Amplitude of the probe in the guided drives, N.m (0: none). The probe is a small torque added to the guidance;
    /// the driver's answer to it tells K_hg
    #[arg(
        long,
        value_name = "AMPLITUDE",
        default_value_t = 0.0,
        allow_negative_numbers = true
    )]
    probe: f64,
    /// Seed of the remnants
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Instead: repeat each guided drive N times with seeds from --seed on, and hold the 95 % intervals of the
    /// default method against the truth
    #[arg(long, value_name = "N", conflicts_with = "out", value_parser = clap::value_parser!(u32).range(1..))]
    repetitions: Option<u32>,
    /// Instead: spoil N guided drives of each participant as real logs are (noise, outliers, gaps, hands off, wrong
    /// scales, delays and signs), and count the values that are called identified and are wrong; needs a --probe.
    /// Exit code 1 if more than 1 of 1,000 is, or if lane noise costs too much
    #[arg(long, value_name = "N", conflicts_with_all = ["out", "repetitions"], value_parser = clap::value_parser!(u32).range(1..))]
    spoiled: Option<u32>,
    /// Instead: repeat each guided drive N times and check that the 95 % intervals of each parameter hold the truth in 93
    /// to 97 % of the drives; needs a --probe. Exit code 1 if they do not
    #[arg(long, value_name = "N", conflicts_with_all = ["out", "repetitions", "spoiled"], value_parser = clap::value_parser!(u32).range(1..))]
    coverage: Option<u32>,
    /// Instead: put more and more camera noise on N guided drives of each participant, and compare the ways to treat it
    /// (none, a plain smoother, the default, the published method) with the information bound; needs a --probe
    #[arg(long, value_name = "N", conflicts_with_all = ["out", "repetitions", "spoiled", "coverage"], value_parser = clap::value_parser!(u32).range(1..))]
    methods: Option<u32>,
    /// Of --spoiled: only the ways whose name holds this
    #[arg(long, value_name = "TEXT", default_value = "", requires = "spoiled")]
    only: String,
    /// Directory for figures, results and a report
    #[arg(long, value_name = "DIR", default_value = "out/experiment")]
    out: PathBuf,
    /// Write the recorded drives too, a CSV file each, into the directory's logs/
    #[arg(long, conflicts_with = "repetitions")]
    logs: bool,
    /// Print the results as one JSON object instead of tables
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let plan = Plan {
        participants: arguments.participants.numbers(),
        probe_nm: arguments.probe,
        seed: arguments.seed,
    };
    if let Some(seeds) = arguments.methods {
        let bar = progress::bar(plan.participants.len() as u64 * u64::from(seeds), "drives");
        let lines = methods(&plan, seeds, || bar.inc(1))?;
        bar.finish_and_clear();
        if arguments.json {
            print_json(&lines)?;
        } else {
            print(&files::methods_table(&lines).to_text())?;
        }
        return Ok(Outcome::Good);
    }
    if let Some(repetitions) = arguments.repetitions.or(arguments.coverage) {
        let drives = plan.participants.len() as u64 * u64::from(repetitions);
        let bar = progress::bar(drives, "drives");
        let result = repeat(&plan, repetitions, || bar.inc(1))?;
        bar.finish_and_clear();
        if arguments.json {
            print_json(&result)?;
        } else {
            print(&repeated(&result))?;
        }
        if arguments.coverage.is_none() {
            return Ok(Outcome::Good);
        }
        let off = files::off_coverage(&result);
        for line in &off {
            eprintln!("NOT KEPT: {line}");
        }
        return Ok(if off.is_empty() {
            Outcome::Good
        } else {
            Outcome::Failed
        });
    }
    if let Some(seeds) = arguments.spoiled {
        return run_spoiled(arguments, &plan, seeds);
    }
    let output = Output::begin(&arguments.out)?;
    let bar = progress::bar(2 * plan.participants.len() as u64, "drives");
    let result = experiment(&plan, || bar.inc(1))?;
    bar.finish_and_clear();
    output.finish(|place| {
        if arguments.logs {
            files::write_logs(&result, &place.join("logs"))?;
        }
        files::write(&result, place)
    })?;
    if arguments.json {
        print_json(&files::stamped(&result))?;
    } else {
        print(&readable(&result))?;
    }
    eprintln!("Report: {}", arguments.out.join("report.html").display());
    Ok(Outcome::Good)
}

fn run_spoiled(arguments: &Arguments, plan: &Plan, seeds: u32) -> Result<Outcome, BadInput> {
    let chosen = POPULATION
        .iter()
        .filter(|(name, _)| name.contains(&arguments.only));
    let ways = chosen.count() as u64;
    if ways == 0 {
        let names: Vec<&str> = POPULATION.iter().map(|(name, _)| *name).collect();
        return Err(format!("--only {:?}: none of {}", arguments.only, names.join("; ")).into());
    }
    let drives = ways * plan.participants.len() as u64 * u64::from(seeds);
    let bar = progress::bar(drives, "drives");
    let result = spoiled(plan, seeds, &arguments.only, || bar.inc(1))?;
    bar.finish_and_clear();
    if arguments.json {
        print_json(&result)?;
    } else {
        let mut text = format!(
            "{} drives of each participant, probe {} N.m, seeds from {}\n\n{}\n{}\nInformation bound of gain_1, gain_2, gain_3, \
             t_p, K_hg on clean logs: {}\n{} wrong of {} identified",
            result.seeds,
            plan.probe_nm,
            plan.seed,
            files::spoiled_table(&result).to_text(),
            files::held_table(&result).to_text(),
            result.bound.map(|b| format!("{b:.4}")).join(", "),
            result.lies,
            result.identified
        );
        for broken in &result.broken {
            text.push_str(&format!("\nNOT KEPT: {broken}"));
        }
        print(&text)?;
    }
    Ok(if result.broken.is_empty() {
        Outcome::Good
    } else {
        Outcome::Failed
    })
}

fn readable(result: &Experiment) -> String {
    let mean = |guided: bool, value: fn(&Drive) -> Option<f64>| -> String {
        let values: Vec<f64> = result
            .drives
            .iter()
            .filter(|d| d.guided == guided)
            .filter_map(value)
            .collect();
        match values.len() {
            0 => "-".into(),
            count => format!("{:.3}", values.iter().sum::<f64>() / count as f64),
        }
    };
    let [low, middle, high] = result.published_trajectory_error_m;
    format!(
        "{}, probe {} N.m, seed {}; a dash: not identified\n\nManual\n{}\nGuided\n{}\n{}\n\
         Mean fit of the published method: manual {} % (the paper: 76), guided {} % (69)\n\
         Mean trajectory error, guided: noise model {} m, published method {} m (the paper: {middle}, {low} to {high})",
        result.course,
        result.probe_nm,
        result.seed,
        files::truth_table(result, false).to_text(),
        files::truth_table(result, true).to_text(),
        files::trajectory_table(result).to_text(),
        mean(false, |d| Some(d.paper.identification.fit_percent)),
        mean(true, |d| Some(d.paper.identification.fit_percent)),
        mean(true, |d| d.noise_model.trajectory_error_m),
        mean(true, |d| d.paper.trajectory_error_m),
    )
}

fn repeated(result: &Repetitions) -> String {
    format!(
        "{} repetitions of each guided drive, probe {} N.m, seeds from {}; errors where identified\n\n{}",
        result.repetitions,
        result.probe_nm,
        result.seed,
        files::repetitions_table(result).to_text()
    )
}
