//! How a command works through its drives: on how many threads, and under a progress bar on stderr; no bar where stderr is no
//! terminal.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use clap::Args;
use haptic_batch::engine::{Progress, Watch, on_threads};
use haptic_log::formats::{self, BusLog};
use indicatif::{ProgressBar, ProgressStyle};

use super::BadInput;

/// On how many threads.
#[derive(Debug, Args)]
pub struct Threads {
    /// Threads; default: one a core
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub(super) threads: Option<u32>,
}

impl Threads {
    /// Does some work on them.
    pub(super) fn run<T: Send>(&self, work: impl FnOnce() -> T + Send) -> Result<T, BadInput> {
        Ok(on_threads(self.threads, work)?)
    }

    /// Does some work on them, under a bar.
    pub fn watched<T: Send>(
        &self,
        unit: &str,
        work: impl FnOnce(&Watch<'_>) -> T + Send,
    ) -> Result<T, BadInput> {
        watched(unit, |watch| self.run(|| work(watch)))
    }
}

/// Does some work under a bar of `length` steps.
pub fn over<T>(length: u64, unit: &str, work: impl FnOnce(&(dyn Fn() + Sync)) -> T) -> T {
    let bar = bar(length, unit);
    let done = work(&|| bar.inc(1));
    bar.finish_and_clear();
    done
}

/// Does some work that tells a watch how far it is, under a bar of what it tells.
pub fn watched<T>(unit: &str, work: impl FnOnce(&Watch<'_>) -> T) -> T {
    let bar = bar(0, unit);
    let hear = |progress: Progress| {
        bar.set_length(progress.all);
        bar.set_position(progress.done);
        ControlFlow::Continue(())
    };
    let done = work(&Watch::new(&hear));
    bar.finish_and_clear();
    done
}

/// Work that takes minutes, watched: behind it stderr has how long it took, by which the next can be planned.
pub fn timed<T>(unit: &str, work: impl FnOnce(&Watch<'_>) -> T) -> T {
    let since = Instant::now();
    let done = watched(unit, work);
    eprintln!("took {:.0} s", since.elapsed().as_secs_f64());
    done
}

/// A log whose reading moves a bar; a second reading begins anew.
pub(super) fn of_log(log: BusLog) -> (BusLog, ProgressBar) {
    let (watch, bar) = over_bytes(log.size());
    (log.watched(watch), bar)
}

/// A bar over the bytes of a file, and who moves it.
pub(super) fn of_file(path: &Path) -> (formats::Watch, ProgressBar) {
    over_bytes(std::fs::metadata(path).map_or(0, |known| known.len()))
}

/// A second reading begins anew.
fn over_bytes(size: u64) -> (formats::Watch, ProgressBar) {
    let bar = styled(size, "{bar:40} {bytes}/{total_bytes} read, {elapsed}");
    let moved = bar.clone();
    let watch = formats::Watch::new(move |read| {
        if moved.position() >= size {
            moved.set_position(0);
        }
        moved.inc(read);
    });
    (watch, bar)
}

/// A bar of `length` steps.
pub fn bar(length: u64, unit: &str) -> ProgressBar {
    styled(length, &format!("{{bar:40}} {{pos}}/{{len}} {unit}, {{elapsed}}"))
}

/// A bar that looks as the template says.
pub(super) fn styled(length: u64, template: &str) -> ProgressBar {
    // A template that does not parse would only cost the bar its looks.
    let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(length).with_style(style)
}
