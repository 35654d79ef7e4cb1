//! `host-sim evaluate`, and `host-sim` alone.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use haptic_analysis::metrics::Window;
use haptic_batch::check_window;
use haptic_batch::evaluate::{Evaluation, RUNS, evaluate};
use haptic_sim::input::in_range;
use haptic_sim::models::road::Course;
use haptic_sim::scenario::{DEFAULT_SPEED_KMH, SPEED_KMH, Scenario, Sensors};

use super::output::Output;
use super::road::CourseArguments;
use super::table::{self, number};
use super::{BadInput, Outcome, print, print_json, print_notes, progress};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    course: CourseArguments,
    /// Speed, km/h (20 to 250)
    #[arg(long, value_name = "KMH", default_value_t = DEFAULT_SPEED_KMH, allow_negative_numbers = true)]
    speed: f64,
    /// When the guidance fails in the runs with failure, s after the start; default: 70
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    failure_time: Option<f64>,
    /// Stretch of road to measure, m; default: 1080 1740 on paper-course, else the whole course
    #[arg(long, num_args = 2, value_names = ["FROM", "TO"], allow_negative_numbers = true)]
    window: Option<Vec<f64>>,
    /// What the controller sees: full resolution every millisecond, or the paper's sensors over the bus
    #[arg(long, value_enum, default_value_t = SensorsArgument::Paper)]
    sensors: SensorsArgument,
    /// Print the results as one JSON object instead of a table
    #[arg(long)]
    json: bool,
    /// Directory for figures, time series, results and report
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum SensorsArgument {
    Exact,
    Paper,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    in_range("--speed", arguments.speed, SPEED_KMH, "km/h")?;
    let course = arguments.course.open()?.unwrap_or_else(Course::paper);
    let mut base = Scenario {
        course,
        speed_kmh: arguments.speed,
        sensors: match arguments.sensors {
            SensorsArgument::Exact => Sensors::Exact,
            SensorsArgument::Paper => Sensors::Paper,
        },
        ..Scenario::default()
    };
    base.check()?;
    // On a course too short for the default, the results say so.
    if let Some(time_s) = arguments.failure_time {
        base.check_time("--failure-time", time_s)?;
        base.failure.time_s = time_s;
    }
    let window = match arguments.window.as_deref() {
        Some(&[from_m, to_m]) => Some(Window { from_m, to_m }),
        _ => None,
    };
    if let Some(window) = window {
        check_window(window, &base).map_err(|e| format!("--{e}"))?;
    }
    let output = Output::begin(&arguments.out)?;
    let bar = progress::bar(RUNS as u64, "runs");
    let evaluation = evaluate(&base, window, || bar.inc(1))?;
    bar.finish_and_clear();
    output.finish(|place| haptic_report::studies::evaluation::write(&evaluation, place))?;
    if arguments.json {
        print_json(&evaluation.results)?;
    } else {
        print(&readable(&evaluation))?;
    }
    print_notes(&evaluation.results.notes);
    eprintln!("Report: {}", arguments.out.join("report.html").display());
    Ok(if evaluation.results.all_claims_hold() {
        Outcome::Good
    } else {
        Outcome::Failed
    })
}

fn readable(evaluation: &Evaluation) -> String {
    let results = &evaluation.results;
    let headings = [
        "t_p/s",
        "condition",
        "failure",
        "peak |e|/m",
        "mean |e|/m",
        "peak |T_h|/N.m",
        "peak |T_d|/N.m",
        "",
    ];
    let mut lines = vec![headings.map(String::from).to_vec()];
    for run in &results.runs {
        let m = &run.metrics;
        lines.push(vec![
            run.t_p.to_string(),
            run.condition.to_string(),
            run.failure.to_string(),
            number(m.peak_lateral_error_m, 4),
            number(m.mean_abs_lateral_error_m, 4),
            number(m.peak_guidance_torque_nm, 3),
            number(m.peak_driver_torque_nm, 3),
            if run.diverged {
                format!("diverged at {:.0} m", run.end_m)
            } else {
                String::new()
            },
        ]);
    }
    let [from, to] = results.window_m;
    let mut text = format!(
        "{}, {} km/h, {} to {} m of {:.0} m, failure at {} s\n\n{}",
        results.course,
        results.speed_kmh,
        from,
        to,
        results.course_length_m,
        results.failure_time_s,
        table::text(&lines)
    );
    for claim in &results.claims {
        let mark = if claim.holds { "holds " } else { "BROKEN" };
        text.push_str(&format!("\n{mark}  {}\n        {}", claim.claim, claim.evidence));
    }
    text
}
