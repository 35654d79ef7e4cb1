//! How a command works through its drives: on how many threads, and under a progress bar on stderr; no bar where stderr is no
//! terminal.

use std::fs::File;
use std::io::Read;
use std::ops::ControlFlow;
use std::path::Path;

use clap::Args;
use haptic_batch::engine::{Progress, Watch, on_threads};
use haptic_log::formats::BusLog;
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
    pub fn run<T: Send>(&self, work: impl FnOnce() -> T + Send) -> Result<T, BadInput> {
        Ok(on_threads(self.threads, work)?)
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

/// A log whose reading moves a bar; a second reading begins anew.
pub(super) fn of_log(log: BusLog) -> (BusLog, ProgressBar) {
    let size = log.size();
    let bar = styled(size, "{bar:40} {bytes}/{total_bytes} read, {elapsed}");
    let moved = bar.clone();
    let watch = move |read| {
        if moved.position() >= size {
            moved.set_position(0);
        }
        moved.inc(read);
    };
    (log.watched(watch), bar)
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

/// A bar over the bytes of a file, and what shows there how far its reader is.
pub(super) fn reading(path: &Path) -> (ProgressBar, impl FnOnce(File) -> Box<dyn Read> + use<>) {
    let size = std::fs::metadata(path).map_or(0, |known| known.len());
    let bar = styled(size, "{bar:40} {bytes}/{total_bytes} read, {elapsed}");
    let own = bar.clone();
    (bar, move |file| Box::new(own.wrap_read(file)))
}
