//! How a command works through its drives: on how many threads, and under a progress bar on stderr; no bar where stderr is no
//! terminal.

use std::path::Path;

use clap::Args;
use haptic_batch::compare::on_threads;
use haptic_log::formats::{BusLog, Watch};
use indicatif::{ProgressBar, ProgressStyle};

use super::BadInput;

#[derive(Debug, Args)]
pub(super) struct Threads {
    /// Threads; default: one a core
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub(super) threads: Option<u32>,
}

impl Threads {
    /// Does some work on them.
    pub(super) fn run<T: Send>(&self, work: impl FnOnce() -> T + Send) -> Result<T, BadInput> {
        Ok(on_threads(self.threads, work)?)
    }
}

/// Does some work under a bar of `length` steps.
pub(super) fn over<T>(length: u64, unit: &str, work: impl FnOnce(&(dyn Fn() + Sync)) -> T) -> T {
    let bar = bar(length, unit);
    let done = work(&|| bar.inc(1));
    bar.finish_and_clear();
    done
}

/// A log whose reading moves a bar.
pub(super) fn of_log(log: BusLog) -> (BusLog, ProgressBar) {
    let (watch, bar) = over_bytes(log.size());
    (log.watched(watch), bar)
}

/// A bar over the bytes of a file, and who moves it.
pub(super) fn of_file(path: &Path) -> (Watch, ProgressBar) {
    over_bytes(std::fs::metadata(path).map_or(0, |known| known.len()))
}

/// A second reading begins anew.
fn over_bytes(size: u64) -> (Watch, ProgressBar) {
    let bar = styled(size, "{bar:40} {bytes}/{total_bytes} read, {elapsed}");
    let moved = bar.clone();
    let watch = Watch::new(move |read| {
        if moved.position() >= size {
            moved.set_position(0);
        }
        moved.inc(read);
    });
    (watch, bar)
}

/// A bar of `length` steps.
pub(super) fn bar(length: u64, unit: &str) -> ProgressBar {
    styled(length, &format!("{{bar:40}} {{pos}}/{{len}} {unit}, {{elapsed}}"))
}

/// A bar that looks as the template says.
pub(super) fn styled(length: u64, template: &str) -> ProgressBar {
    // A template that does not parse would only cost the bar its looks.
    let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(length).with_style(style)
}
