//! Files that appear together or not at all.
//!
//! The files of a study belong together: a figure beside the results of another run would mislead. So they are
//! written to a directory of their own within the one asked for, and moved up when all are there. A run that is
//! interrupted leaves the old set; what it had begun is removed, at the latest by the next run. Moving is a
//! rename each, so only a crash within those milliseconds could mix two sets.
//!
//! Handling signals is NOT done here.

use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

use super::WriteError;

/// Directory of a set under way, within the one asked for.
const STAGING: &str = ".unfinished";
/// Held locked in it by the program that writes, so that a second one is told and a dead one's is cleared.
const LOCK: &str = "lock";

/// A set of files under way. Dropped unfinished, it leaves nothing.
#[derive(Debug)]
pub struct FileSet {
    directory: PathBuf,
    staging: PathBuf,
    lock: Option<File>,
}

impl FileSet {
    /// Creates the directory if need be, and clears what an interrupted run left in it.
    ///
    /// # Errors
    /// The directory cannot be written, or another program is writing a set there.
    pub fn begin(directory: &Path) -> Result<Self, WriteError> {
        let staging = directory.join(STAGING);
        let lock = locked(&staging).and_then(|lock| {
            clear(&staging)?;
            Ok(lock)
        });
        Ok(Self {
            lock: Some(lock.map_err(|cause| failed(directory, cause))?),
            directory: directory.to_path_buf(),
            staging,
        })
    }

    /// Where to write the files, under the names that they shall have.
    #[must_use]
    pub fn staging(&self) -> &Path {
        &self.staging
    }

    /// Moves all files into the directory, in place of any of the same name.
    ///
    /// # Errors
    /// A file cannot be moved.
    pub fn finish(self) -> Result<(), WriteError> {
        move_up(&self.staging, &self.directory)
    }
}

impl Drop for FileSet {
    fn drop(&mut self) {
        // Open files cannot be removed everywhere.
        self.lock = None;
        // What stays is cleared by the next run.
        let _ = fs::remove_dir_all(&self.staging);
    }
}

fn failed(path: &Path, cause: io::Error) -> WriteError {
    WriteError {
        path: path.to_path_buf(),
        cause,
    }
}

fn locked(staging: &Path) -> io::Result<File> {
    fs::create_dir_all(staging)?;
    let lock = File::create(staging.join(LOCK))?;
    match lock.try_lock() {
        Ok(()) => Ok(lock),
        Err(TryLockError::Error(cause)) => Err(cause),
        Err(TryLockError::WouldBlock) => Err(io::Error::new(
            io::ErrorKind::ResourceBusy,
            "another run is writing its files there",
        )),
    }
}

fn clear(staging: &Path) -> io::Result<()> {
    for entry in fs::read_dir(staging)? {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            fs::remove_dir_all(entry.path())?;
        } else if entry.file_name() != LOCK {
            fs::remove_file(entry.path())?;
        }
    }
    Ok(())
}

fn move_up(from: &Path, to: &Path) -> Result<(), WriteError> {
    fs::create_dir_all(to).map_err(|cause| failed(to, cause))?;
    for entry in fs::read_dir(from).map_err(|cause| failed(from, cause))? {
        let entry = entry.map_err(|cause| failed(from, cause))?;
        let target = to.join(entry.file_name());
        let is_directory = entry.file_type().map_err(|cause| failed(from, cause))?.is_dir();
        if is_directory {
            move_up(&entry.path(), &target)?;
        } else if entry.file_name() != LOCK {
            fs::rename(entry.path(), &target).map_err(|cause| failed(&target, cause))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(directory: &Path) -> Vec<String> {
        let entries = fs::read_dir(directory).unwrap().map(|e| e.unwrap().file_name());
        let mut names: Vec<_> = entries.map(|name| name.into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_finished_set_replaces_its_files_and_no_others() {
        let directory = tempfile::tempdir().unwrap();
        let out = directory.path();
        fs::write(out.join("report.html"), "old").unwrap();
        fs::write(out.join("mine.txt"), "mine").unwrap();
        let set = FileSet::begin(out).unwrap();
        fs::write(set.staging().join("report.html"), "new").unwrap();
        fs::create_dir(set.staging().join("runs")).unwrap();
        fs::write(set.staging().join("runs/1.csv"), "1").unwrap();
        assert_eq!(fs::read_to_string(out.join("report.html")).unwrap(), "old");
        set.finish().unwrap();
        assert_eq!(names(out), ["mine.txt", "report.html", "runs"]);
        assert_eq!(names(&out.join("runs")), ["1.csv"]);
        assert_eq!(fs::read_to_string(out.join("report.html")).unwrap(), "new");
    }

    #[test]
    fn an_unfinished_set_leaves_nothing() {
        let directory = tempfile::tempdir().unwrap();
        let set = FileSet::begin(directory.path()).unwrap();
        fs::write(set.staging().join("report.html"), "half").unwrap();
        drop(set);
        assert_eq!(names(directory.path()), [""; 0]);
    }

    #[test]
    fn what_a_killed_run_left_is_cleared() {
        let directory = tempfile::tempdir().unwrap();
        let left = directory.path().join(STAGING);
        fs::create_dir_all(left.join("runs")).unwrap();
        for name in ["lock", "report.html.123.part", "runs/1.csv"] {
            fs::write(left.join(name), "").unwrap();
        }
        let set = FileSet::begin(directory.path()).unwrap();
        assert_eq!(names(&left), ["lock"]);
        set.finish().unwrap();
        assert_eq!(names(directory.path()), [""; 0]);
    }

    #[test]
    fn a_second_writer_and_a_bad_place_are_refused() {
        let directory = tempfile::tempdir().unwrap();
        let _first = FileSet::begin(directory.path()).unwrap();
        let second = FileSet::begin(directory.path()).unwrap_err().to_string();
        assert!(
            second.ends_with("another run is writing its files there"),
            "{second}"
        );
        assert_eq!(names(directory.path()), [STAGING], "the first goes on");

        let file = directory.path().join("file");
        fs::write(&file, "").unwrap();
        let error = FileSet::begin(&file).unwrap_err();
        assert_eq!(error.path, file);
    }
}
