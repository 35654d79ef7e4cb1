//! The directory of a command's files: checked before the work begins, filled when it is done.
//!
//! An interrupt or a request to terminate leaves the files of the last complete run, and nothing of this one.

use std::path::{Path, PathBuf};
use std::process;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

use clap::Args;
use haptic_report::document::{FileSet, Owner};
use haptic_report::studies::{OutputError, Pictures};

use super::{BadInput, INTERRUPTED};

/// How files are written, of whatever command.
#[derive(Debug, Clone, Copy, Args)]
pub struct FileArguments {
    /// Write also where files are that the command did not write
    #[arg(long, global = true)]
    force: bool,
    /// Each figure also as PNG, where no SVG can be opened
    #[arg(long, global = true)]
    png: bool,
}

static FORCE: AtomicBool = AtomicBool::new(false);
static PNG: AtomicBool = AtomicBool::new(false);

impl FileArguments {
    /// From now on files are written so.
    ///
    /// # Errors
    /// This build draws no PNG.
    pub fn choose(self) -> Result<(), BadInput> {
        if self.png && !cfg!(feature = "png") {
            let sentence = "--png: this build draws SVG alone, which takes half a minute from the first build: build host-sim with \
                            `--features png`, as in cargo run --release -p host-sim --features png -- run SCENARIO.toml --out out --png";
            return Err(sentence.into());
        }
        FORCE.store(self.force, Ordering::Relaxed);
        PNG.store(self.png, Ordering::Relaxed);
        Ok(())
    }
}

/// Files of the figures, as `--png` chose them.
pub(super) fn pictures() -> Pictures {
    #[cfg(feature = "png")]
    if PNG.load(Ordering::Relaxed) {
        return Pictures::AlsoPixels;
    }
    Pictures::Drawings
}

/// What an interrupt has to remove. Locked while a set begins and while its files are moved into place, so that
/// an interrupt waits.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// What an interrupt keeps, as a sentence.
static KEPT: OnceLock<String> = OnceLock::new();

/// From now on an interrupt says that every part of the work under way which is done is kept there.
///
/// # Errors
/// Interrupts cannot be caught.
pub fn keeps(place: &Path, part: &str) -> Result<(), BadInput> {
    KEPT.get_or_init(|| {
        let place = place.display();
        format!("{place} keeps every {part} that was done; the same command goes on from there.")
    });
    catch_interrupts()
}

fn catch_interrupts() -> Result<(), BadInput> {
    static CAUGHT: OnceLock<Result<(), String>> = OnceLock::new();
    let caught = CAUGHT.get_or_init(|| ctrlc::set_handler(on_interrupt).map_err(|e| e.to_string()));
    Ok(caught.clone()?)
}

fn on_interrupt() {
    let traces = lock_unfinished();
    // What stays is cleared by the next run.
    for (k, place) in traces.iter().enumerate() {
        let _ = if k == 0 {
            std::fs::remove_dir_all(place)
        } else {
            std::fs::remove_dir(place)
        };
    }
    let directory = traces.first().and_then(|staging| staging.parent());
    let directory = directory.map(|directory| {
        let kept = if directory.exists() {
            "holds what it held before"
        } else {
            "was not made"
        };
        format!("{} {kept}.", directory.display())
    });
    match (KEPT.get(), directory) {
        (Some(kept), Some(directory)) => eprintln!("Interrupted: {kept} {directory}"),
        (Some(kept), None) => eprintln!("Interrupted: {kept}"),
        (None, Some(directory)) => eprintln!("Interrupted: nothing of this run is kept, and {directory}"),
        (None, None) => {}
    }
    process::exit(INTERRUPTED.into());
}

/// Whether a command may write there, before it has worked for long.
pub(super) fn check(directory: &Path, command: &str, keeps: &[&str]) -> Result<(), BadInput> {
    Ok(FileSet::check(directory, owner(command, keeps))?)
}

fn owner<'a>(command: &'a str, keeps: &'a [&'a str]) -> Owner<'a> {
    Owner {
        command,
        keeps,
        force: is_forced(),
    }
}

/// Whether sets take the place of whatever is in their directory.
pub(super) fn is_forced() -> bool {
    FORCE.load(Ordering::Relaxed)
}

pub(super) struct Output {
    files: FileSet,
}

impl Output {
    /// For the files of a command, as it is typed, beside those that it keeps by other means.
    ///
    /// # Errors
    /// Nothing can be written there, or it holds what the command did not write.
    pub(super) fn begin(directory: &Path, command: &str, keeps: &[&str]) -> Result<Self, BadInput> {
        catch_interrupts()?;
        let mut unfinished = lock_unfinished();
        let files = FileSet::begin(directory, owner(command, keeps))?;
        *unfinished = files.traces();
        Ok(Self { files })
    }

    /// Where to write the files until then.
    pub(super) fn place(&self) -> &Path {
        self.files.staging()
    }

    /// Writes all files and puts them in place.
    pub(super) fn finish(self, write: impl FnOnce(&Path) -> Result<(), OutputError>) -> Result<(), BadInput> {
        write(self.files.staging())?;
        let mut unfinished = lock_unfinished();
        self.files.finish()?;
        unfinished.clear();
        Ok(())
    }
}

fn lock_unfinished() -> MutexGuard<'static, Vec<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}
