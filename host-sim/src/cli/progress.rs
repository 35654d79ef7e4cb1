//! A progress bar on stderr; nothing where stderr is no terminal.

use indicatif::{ProgressBar, ProgressStyle};

/// Does some work under a bar of `length` steps.
pub(super) fn over<T>(length: u64, unit: &str, work: impl FnOnce(&(dyn Fn() + Sync)) -> T) -> T {
    let bar = bar(length, unit);
    let done = work(&|| bar.inc(1));
    bar.finish_and_clear();
    done
}

/// A bar of `length` steps.
pub(super) fn bar(length: u64, unit: &str) -> ProgressBar {
    let template = format!("{{bar:40}} {{pos}}/{{len}} {unit}, {{elapsed}}");
    // A template that does not parse would only cost the bar its looks.
    let style = ProgressStyle::with_template(&template).unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(length).with_style(style)
}
