//! `host-sim experiment`.

use std::path::PathBuf;

use clap::Args;
use haptic_analysis::identify::Muscle;
use haptic_batch::experiment::{
    Drive, Experiment, POPULATION, Plan, Repetitions, Spoiled, experiment, repeat, spoiled,
};

use super::output::Output;
use super::participants::Participants;
use super::table::{self, number};
use super::{BadInput, Outcome, print, print_json, progress};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Participants: numbers and ranges such as 1,3..5
    #[arg(long, value_name = "LIST", default_value = "1..14")]
    participants: Participants,
    /// Amplitude of the probe in the guided drives, N.m (0: none)
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
    /// scales, delays and signs), and count the values that are called identified and are wrong; needs a --probe
    #[arg(long, value_name = "N", conflicts_with_all = ["out", "repetitions"], value_parser = clap::value_parser!(u32).range(1..))]
    spoiled: Option<u32>,
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
        participants: arguments.participants.0.clone(),
        probe_nm: arguments.probe,
        seed: arguments.seed,
    };
    if let Some(repetitions) = arguments.repetitions {
        let drives = plan.participants.len() as u64 * u64::from(repetitions);
        let bar = progress::bar(drives, "drives");
        let result = repeat(&plan, repetitions, || bar.inc(1))?;
        bar.finish_and_clear();
        if arguments.json {
            print_json(&result)?;
        } else {
            print(&repeated(&result))?;
        }
        return Ok(Outcome::Good);
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
            haptic_report::studies::experiment::write_logs(&result, &place.join("logs"))?;
        }
        haptic_report::studies::experiment::write(&result, place)
    })?;
    if arguments.json {
        print_json(&result)?;
    } else {
        print(&readable(&result))?;
    }
    eprintln!("Report: {}", arguments.out.join("report.html").display());
    Ok(Outcome::Good)
}

fn run_spoiled(arguments: &Arguments, plan: &Plan, seeds: u32) -> Result<Outcome, BadInput> {
    let ways = POPULATION
        .iter()
        .filter(|(name, _)| name.contains(&arguments.only))
        .count();
    if ways == 0 {
        let names: Vec<&str> = POPULATION.iter().map(|(name, _)| *name).collect();
        return Err(format!("--only {:?}: none of {}", arguments.only, names.join("; ")).into());
    }
    let bar = progress::bar(
        ways as u64 * plan.participants.len() as u64 * u64::from(seeds),
        "drives",
    );
    let result = spoiled(plan, seeds, &arguments.only, || bar.inc(1))?;
    bar.finish_and_clear();
    if arguments.json {
        print_json(&result)?;
    } else {
        print(&spoiled_table(&result))?;
    }
    Ok(if result.broken.is_empty() {
        Outcome::Good
    } else {
        Outcome::Failed
    })
}

fn spoiled_table(result: &Spoiled) -> String {
    let headings = [
        "spoiled by",
        "drives",
        "refuted",
        "identified",
        "wrong",
        "95 %",
        "gain_1",
        "gain_2",
        "gain_3",
        "t_p/s",
        "K_hg",
        "K_hg read",
        "cause named most",
    ];
    let mut lines = vec![headings.map(String::from).to_vec()];
    for l in &result.lines {
        let mut cells = vec![
            l.spoiled_by.to_owned(),
            l.drives.to_string(),
            l.refuted.to_string(),
            l.identified.to_string(),
            l.lies.to_string(),
            number(l.coverage, 3),
        ];
        cells.extend(l.rms.iter().map(|&x| number(Some(x), 4)));
        cells.push(l.k_hg_read.to_string());
        cells.push(
            l.cause
                .as_ref()
                .map_or_else(String::new, |(cause, n)| format!("{n}: {cause}")),
        );
        lines.push(cells);
    }
    let mut text = format!(
        "{} drives of each participant; wrong: called identified, and more than 4 standard errors and 10 % (15 ms, 0.05) \
         off; RMS errors by parameter, refuted or not\n\n{}\n{} wrong of {} identified",
        result.seeds,
        table::text(&lines),
        result.lies,
        result.identified
    );
    for broken in &result.broken {
        text.push_str(&format!("\nNOT KEPT: {broken}"));
    }
    text
}

fn readable(result: &Experiment) -> String {
    let headings = [
        "no",
        "drive",
        "",
        "fit %",
        "gain_1",
        "gain_2",
        "gain_3",
        "t_p/s",
        "K_hg",
        "std error",
        "path/m",
    ];
    let mut lines = vec![headings.map(String::from).to_vec()];
    for drive in &result.drives {
        lines.push(truth(drive));
        for finding in [&drive.noise_model, &drive.paper] {
            let found = &finding.identification;
            let p = &found.parameters;
            // The published method names a number whatever the data say.
            let value = |p: &haptic_analysis::identify::Parameter, decimals| {
                number(
                    if found.method == "paper" {
                        p.optimum
                    } else {
                        p.estimate
                    },
                    decimals,
                )
            };
            lines.push(vec![
                String::new(),
                String::new(),
                found.method.into(),
                number(Some(found.fit_percent), 1),
                value(&p.gain_1, 3),
                value(&p.gain_2, 3),
                value(&p.gain_3, 2),
                value(&p.t_p, 3),
                value(&p.k_hg, 3),
                number(p.k_hg.standard_error, 3),
                number(finding.trajectory_error_m, 3),
            ]);
        }
    }
    let mean = |guided: bool, value: fn(&Drive) -> Option<f64>| {
        let values: Vec<f64> = result
            .drives
            .iter()
            .filter(|d| d.guided == guided)
            .filter_map(value)
            .collect();
        number(
            (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64),
            3,
        )
    };
    let [low, middle, high] = result.published_trajectory_error_m;
    format!(
        "{}, probe {} N.m, seed {}; a dash: not identified\n\n{}\n\
         Mean fit of the published method: manual {} % (the paper: 76), guided {} % (69)\n\
         Mean trajectory error, guided: noise model {} m, published method {} m (the paper: {middle}, {low} to {high})",
        result.course,
        result.probe_nm,
        result.seed,
        table::text(&lines),
        mean(false, |d| Some(d.paper.identification.fit_percent)),
        mean(true, |d| Some(d.paper.identification.fit_percent)),
        mean(true, |d| d.noise_model.trajectory_error_m),
        mean(true, |d| d.paper.trajectory_error_m),
    )
}

fn truth(drive: &Drive) -> Vec<String> {
    let t = &drive.truth;
    let sum = t.k_d + Muscle::default().k_nms;
    vec![
        drive.participant.to_string(),
        if drive.guided { "guided" } else { "manual" }.into(),
        "truth".into(),
        number(Some(t.fitness), 1),
        number(Some(sum * t.a_1), 3),
        number(Some(sum * t.a_2), 3),
        number(Some(sum * t.a_3), 2),
        number(Some(t.t_p), 3),
        number(t.k_hg, 3),
        number(None, 0),
        number(None, 0),
    ]
}

fn repeated(result: &Repetitions) -> String {
    let headings = [
        "participant",
        "parameter",
        "drives",
        "identified",
        "coverage of 95 %",
        "bias",
        "rms error",
        "largest error",
        "mean std error",
    ];
    let mut lines = vec![headings.map(String::from).to_vec()];
    for line in result.participants.iter().chain(&result.pooled) {
        lines.push(vec![
            line.participant.map_or("all".into(), |n| n.to_string()),
            line.parameter.into(),
            line.drives.to_string(),
            number(Some(line.identified), 3),
            number(Some(line.coverage), 3),
            number(line.bias, 4),
            number(line.rms, 4),
            number(line.largest, 4),
            number(line.standard_error, 4),
        ]);
    }
    format!(
        "{} repetitions of each guided drive, probe {} N.m, seeds from {}; errors where identified\n\n{}",
        result.repetitions,
        result.probe_nm,
        result.seed,
        table::text(&lines)
    )
}
