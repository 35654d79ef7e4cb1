//! `host-sim sweep FILE.toml`.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use clap::Args;
use haptic_batch::VERSION;
use haptic_batch::engine::{Progress, Watch};
use haptic_batch::sweep::{Shard, Store, StoreError, Sweep, run_all};
use haptic_report::document::{SeriesFormat, write_bytes, write_json};
use haptic_report::studies::run as run_files;
use haptic_report::studies::sweep as files;
use indicatif::ProgressBar;

use super::output::{self, Output};
use super::progress::{Threads, styled};
use super::results::{LevelArgument, ResultArguments};
use super::{BadInput, Outcome, print, width};

const OUT: &str = "Directory of the sweep: finished chunks, the table (drives.csv; drives.parquet in a build with Parquet), summary, figures, report. A sweep that was interrupted goes on where it was";

#[derive(Debug, Args)]
#[command(mut_arg("out", |out| out.default_value("out/sweep").help(OUT)))]
pub(super) struct Arguments {
    /// Sweep file (TOML): a scenario, what is varied in it and how, the metrics (docs/sweeps.md)
    #[arg(value_name = "FILE.toml")]
    file: PathBuf,
    /// Drive only part I of N, on this machine or another one; the table is made when the last part is done in (or
    /// copied into) the same directory
    #[arg(long, value_name = "I/N", default_value = "1/1")]
    shard: Shard,
    #[command(flatten)]
    threads: Threads,
    /// Instead: drive one row of the table again, and compare it with the table if there is one (exit code 1 if it
    /// differs); its scenario is in the printed text
    #[arg(long, value_name = "ROW", conflicts_with_all = ["shard", "threads", "dry_run", "json"])]
    replay: Option<u64>,
    /// Also write the scenario, the time series, figures and report of the drive of --replay into this directory
    #[arg(long, value_name = "DIR", requires = "replay")]
    replay_out: Option<PathBuf>,
    /// Only check the file, and print how many drives it plans, with its first rows
    #[arg(long, conflicts_with = "json")]
    dry_run: bool,
    #[command(flatten)]
    level: LevelArgument,
    #[command(flatten)]
    results: ResultArguments,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let sweep = Sweep::load(&arguments.file)?;
    if arguments.dry_run {
        print(&files::plan(&sweep).to_text(width()))?;
        return Ok(Outcome::Good);
    }
    if let Some(drive) = arguments.replay {
        return replay(arguments, &sweep, drive);
    }
    let out = arguments.results.directory();
    // A shard that began at the same time may have made the directory a sweep's between the two looks.
    output::check(out, "sweep", kept(out)).or_else(|_| output::check(out, "sweep", kept(out)))?;
    let store = Store::open(&sweep, VERSION, out)?;
    output::keeps(out, "chunk")?;
    let bar = Bar::new();
    let hear = |progress| {
        bar.show(progress);
        ControlFlow::Continue(())
    };
    let watch = Watch::new(&hear);
    arguments
        .threads
        .run(|| run_all(&store, &sweep, arguments.shard, &watch))??;
    bar.bar.finish_and_clear();
    let summary = match store.finish(arguments.level.level) {
        Ok(summary) => summary,
        Err(error @ StoreError::Missing(..)) if arguments.shard != Shard::WHOLE => {
            eprintln!("This shard is done. {error}.");
            return Ok(Outcome::Good);
        }
        Err(error) => return Err(error.into()),
    };
    // What drives a row again is told the table too.
    let file = format!("{} --out {}", arguments.file.display(), out.display());
    let output = match arguments.results.begin_beside("sweep", kept(out)) {
        // Every shard that finds all chunks makes the same files.
        Err(_) if arguments.shard != Shard::WHOLE => arguments.results.without_files(),
        output => output?,
    };
    eprintln!("Table: {}", out.join("drives.csv").display());
    let report = files::report(&sweep, &summary, &file);
    output.named("summary.json").show_bare(&report, &summary, true)
}

/// What a sweep keeps in its directory beside its report. Of a directory without a sweep nothing is its own.
fn kept(directory: &Path) -> &'static [&'static str] {
    if directory.join("sweep.toml").exists() {
        &["sweep.toml", "drives.csv", "drives.parquet"]
    } else {
        &[]
    }
}

/// Drives one row again.
fn replay(arguments: &Arguments, sweep: &Sweep, drive: u64) -> Result<Outcome, BadInput> {
    let last = sweep.drives().saturating_sub(1);
    if drive > last {
        return Err(format!("--replay = {drive} is outside 0 to {last}").into());
    }
    let point = sweep.point(drive);
    let scenario = sweep.scenario(&point)?;
    let driven = sweep.drive(&point)?;
    print(&format!(
        "{}\n{}",
        scenario.to_toml(),
        files::drive_table(sweep, &point, &driven).to_text(width())
    ))?;
    if let Some(directory) = &arguments.replay_out {
        write_drive(&scenario, directory)?;
    }
    let out = arguments.results.directory();
    let is_stored = out.join("sweep.toml").exists();
    let store = is_stored.then(|| Store::open(sweep, VERSION, out).ok()).flatten();
    let Some(there) = store.and_then(|store| store.get_drive(drive)) else {
        eprintln!("There is no row to compare with in {}.", out.display());
        return Ok(Outcome::Good);
    };
    if there == driven {
        eprintln!("The same bits as in the table of {}.", out.display());
        return Ok(Outcome::Good);
    }
    eprintln!("NOT the same as in the table of {}: {there:?}", out.display());
    Ok(Outcome::Failed)
}

fn write_drive(scenario: &haptic_sim::Scenario, directory: &Path) -> Result<(), BadInput> {
    let output = Output::begin(directory, "sweep --replay", &[])?;
    let single = haptic_batch::run::run(scenario.clone(), false)?;
    let report = run_files::report(&single);
    output.finish(|place| {
        write_bytes(&place.join("scenario.toml"), scenario.to_toml())?;
        run_files::write_series(&single, SeriesFormat::Csv, place)?;
        write_json(&place.join("results.json"), &report.stamp(&single.results))?;
        haptic_report::studies::write(&report, place, output::pictures())
    })?;
    eprintln!("Report: {}", directory.join("report.html").display());
    Ok(())
}

/// Progress with rate and time left: a bar on a terminal, a line now and then in a log.
struct Bar {
    bar: ProgressBar,
    since: Instant,
    lines: Mutex<Instant>,
}

/// Between two lines of a log.
const BETWEEN_LINES: Duration = Duration::from_secs(30);

impl Bar {
    fn new() -> Self {
        let now = Instant::now();
        Self {
            bar: styled(0, "{bar:40} {pos}/{len} drives, {msg}"),
            since: now,
            lines: Mutex::new(now),
        }
    }

    fn show(&self, progress: Progress) {
        let spent = self.since.elapsed();
        let rate = (progress.done - progress.before) as f64 / spent.as_secs_f64().max(1e-3);
        let left = match progress.all - progress.done {
            0 => "0 s left".into(),
            _ if rate <= 0.0 => "time left not known yet".into(),
            drives => format!("{:.0} s left", drives as f64 / rate),
        };
        let message = format!("{rate:.1} drives/s, {left}");
        if !self.bar.is_hidden() {
            self.bar.set_length(progress.all);
            self.bar.set_position(progress.done);
            self.bar.set_message(message);
            return;
        }
        let mut last = self.lines.lock().unwrap_or_else(PoisonError::into_inner);
        if last.elapsed() >= BETWEEN_LINES || progress.done == progress.all {
            *last = Instant::now();
            eprintln!("{}/{} drives, {message}", progress.done, progress.all);
        }
    }
}
