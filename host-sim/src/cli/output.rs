//! The directory of a command's files: checked before the work begins, filled when it is done.
//!
//! An interrupt or a request to terminate leaves the files of the last complete run, and nothing of this one.

use std::path::{Path, PathBuf};
use std::process;
use std::sync::{Mutex, MutexGuard, PoisonError};

use haptic_report::document::FileSet;
use haptic_report::studies::OutputError;

use super::{BadInput, INTERRUPTED};

/// What an interrupt has to remove. Locked while a set begins and while its files are moved into place, so that
/// an interrupt waits.
static UNFINISHED: Mutex<Option<PathBuf>> = Mutex::new(None);

pub(super) struct Output {
    files: FileSet,
}

impl Output {
    /// # Errors
    /// Nothing can be written there.
    pub(super) fn begin(directory: &Path) -> Result<Self, BadInput> {
        ctrlc::set_handler(|| {
            let unfinished = lock_unfinished();
            if let Some(staging) = unfinished.as_ref() {
                // What stays is cleared by the next run.
                let _ = std::fs::remove_dir_all(staging);
            }
            process::exit(INTERRUPTED.into());
        })?;
        let mut unfinished = lock_unfinished();
        let files = FileSet::begin(directory)?;
        *unfinished = Some(files.staging().to_path_buf());
        Ok(Self { files })
    }

    /// Writes all files and puts them in place.
    pub(super) fn finish(self, write: impl FnOnce(&Path) -> Result<(), OutputError>) -> Result<(), BadInput> {
        write(self.files.staging())?;
        let mut unfinished = lock_unfinished();
        self.files.finish()?;
        *unfinished = None;
        Ok(())
    }
}

fn lock_unfinished() -> MutexGuard<'static, Option<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}
