//! Files that appear together or not at all.
//!
//! The files of a study belong together: a figure beside the results of another run would mislead. So they are
//! written to a directory of their own within the one asked for, and moved up when all are there. A run that is
//! interrupted leaves the old set; what it had begun is removed, at the latest by the next run. Moving is a
//! rename each, so only a crash within those milliseconds could mix two sets.
//!
//! A set leaves a list of itself in the directory: which command made it, and its files. The next set of the same command
//! takes the place of these files. What is not on the list is somebody's: a directory that holds it, or another command's set, is
//! refused.
//!
//! Handling signals is NOT done here.

use std::collections::BTreeSet;
use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::WriteError;
use super::files::failed;

/// Directory of a set under way, within the one asked for.
const STAGING: &str = ".unfinished";
/// Held locked in it by the program that writes, so that a second one is told and a dead one's is cleared.
const LOCK: &str = "lock";
/// The list of a finished set.
const LIST: &str = ".host-sim.json";

/// Whose files a directory may hold.
#[derive(Debug, Clone, Copy)]
pub struct Owner<'a> {
    /// The command, as it is typed.
    pub command: &'a str,
    /// Names of files that the command keeps there by other means.
    pub keeps: &'a [&'a str],
    /// Takes the place of whatever is there.
    pub force: bool,
}

#[derive(Serialize, Deserialize)]
struct List {
    command: String,
    files: BTreeSet<PathBuf>,
}

/// A set of files under way. Dropped unfinished, it leaves nothing.
#[derive(Debug)]
pub struct FileSet {
    directory: PathBuf,
    staging: PathBuf,
    command: String,
    /// Directories that were not there before, the outermost last.
    made: Vec<PathBuf>,
    lock: Option<File>,
}

impl FileSet {
    /// Creates the directory if need be, and clears what an interrupted run left in it.
    ///
    /// # Errors
    /// The directory cannot be written, another program is writing a set there, or it holds what is not the owner's.
    pub fn begin(directory: &Path, owner: Owner<'_>) -> Result<Self, WriteError> {
        Self::check(directory, owner)?;
        let is_new = |place: &&Path| !place.as_os_str().is_empty() && !place.exists();
        let made = directory
            .ancestors()
            .take_while(is_new)
            .map(Path::to_path_buf)
            .collect();
        let staging = directory.join(STAGING);
        let lock = locked(&staging).and_then(|lock| {
            clear(&staging)?;
            Ok(lock)
        });
        Ok(Self {
            lock: Some(lock.map_err(|cause| failed(directory, cause))?),
            directory: directory.to_path_buf(),
            command: owner.command.to_owned(),
            made,
            staging,
        })
    }

    /// Whether a set of this owner may begin there, before there is work behind it.
    ///
    /// # Errors
    /// The directory holds what is not the owner's.
    pub fn check(directory: &Path, owner: Owner<'_>) -> Result<(), WriteError> {
        if owner.force {
            return Ok(());
        }
        refuse_what_is_foreign(directory, owner).map_err(|cause| failed(directory, cause))
    }

    /// Where to write the files, under the names that they shall have.
    #[must_use]
    pub fn staging(&self) -> &Path {
        &self.staging
    }

    /// What an interrupt has to remove: the files under way, then the directories that were made for them, while they are empty.
    #[must_use]
    pub fn traces(&self) -> Vec<PathBuf> {
        [vec![self.staging.clone()], self.made.clone()].concat()
    }

    /// Moves all files into the directory, in place of the last set's.
    ///
    /// # Errors
    /// A file cannot be moved.
    pub fn finish(mut self) -> Result<(), WriteError> {
        let mut files = BTreeSet::new();
        list(&self.staging, Path::new(""), &mut files).map_err(|cause| failed(&self.staging, cause))?;
        let last = read_list(&self.directory).filter(|last| last.command == self.command);
        move_up(&self.staging, &self.directory)?;
        self.made.clear();
        for left in last.iter().flat_map(|last| last.files.difference(&files)) {
            // It may be gone already.
            let _ = fs::remove_file(self.directory.join(left));
        }
        let command = self.command.clone();
        super::write_json(&self.directory.join(LIST), &List { command, files })
    }
}

/// The list that the last set left, if one did.
fn read_list(directory: &Path) -> Option<List> {
    let bytes = fs::read(directory.join(LIST)).ok()?;
    serde_json::from_slice(&bytes).ok()
}

fn refuse_what_is_foreign(directory: &Path, owner: Owner<'_>) -> io::Result<()> {
    let refuse = |what: String| {
        let advice = "choose another --out, or --force to write there all the same";
        Err(io::Error::other(format!("it holds {what}; {advice}")))
    };
    let last = read_list(directory);
    if let Some(last) = last.as_ref().filter(|last| last.command != owner.command) {
        return refuse(format!("results of `host-sim {}`", last.command));
    }
    // A directory that is not there, or no directory: writing says so.
    let entries = fs::read_dir(directory).into_iter().flatten().flatten();
    let is_foreign = |name: &str| {
        name != LIST
            // What a killed program left of a file is nobody's.
            && !name.ends_with(".unfinished")
            && !owner.keeps.contains(&name)
            && !last
                .as_ref()
                .is_some_and(|last| last.files.contains(Path::new(name)))
    };
    let mut foreign: Vec<String> = entries
        .filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_file()))
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .filter(|name| is_foreign(name))
        .collect();
    foreign.sort();
    match foreign.as_slice() {
        [] => Ok(()),
        [first, rest @ ..] => {
            let more = match rest.len() {
                0 => String::new(),
                count => format!(" and {count} more files"),
            };
            let command = owner.command;
            refuse(format!("{first}{more}, which `host-sim {command}` did not write"))
        }
    }
}

/// The files below a directory, as paths from it.
fn list(directory: &Path, from: &Path, files: &mut BTreeSet<PathBuf>) -> io::Result<()> {
    for entry in fs::read_dir(directory)? {
        let entry = entry?;
        let name = from.join(entry.file_name());
        if entry.file_type()?.is_dir() {
            list(&entry.path(), &name, files)?;
        } else if entry.file_name() != LOCK {
            files.insert(name);
        }
    }
    Ok(())
}

impl Drop for FileSet {
    fn drop(&mut self) {
        // Open files cannot be removed everywhere.
        self.lock = None;
        // What stays is cleared by the next run.
        let _ = fs::remove_dir_all(&self.staging);
        for place in &self.made {
            // A directory that holds something stays.
            let _ = fs::remove_dir(place);
        }
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

    const RUN: Owner<'static> = Owner {
        command: "run",
        keeps: &["kept.toml"],
        force: false,
    };

    fn finished(out: &Path, owner: Owner<'_>, files: &[&str]) -> Result<(), WriteError> {
        let set = FileSet::begin(out, owner)?;
        for name in files {
            let path = set.staging().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, name).unwrap();
        }
        set.finish()
    }

    #[test]
    fn a_set_takes_the_place_of_the_last_one() {
        let directory = tempfile::tempdir().unwrap();
        let out = directory.path();
        fs::create_dir(out.join("other")).unwrap();
        fs::write(out.join("kept.toml"), "mine").unwrap();
        finished(out, RUN, &["report.html", "bus.log", "runs/1.csv"]).unwrap();
        assert_eq!(
            names(out),
            [LIST, "bus.log", "kept.toml", "other", "report.html", "runs"]
        );
        finished(out, RUN, &["report.html"]).unwrap();
        assert_eq!(names(out), [LIST, "kept.toml", "other", "report.html", "runs"]);
        assert_eq!(names(&out.join("runs")), [""; 0]);
    }

    #[test]
    fn what_is_somebody_elses_is_refused_and_stays() {
        let directory = tempfile::tempdir().unwrap();
        let out = directory.path();
        fs::write(out.join("run.csv"), "recorded").unwrap();
        let error = finished(out, RUN, &["run.csv"]).unwrap_err().to_string();
        assert!(
            error.contains("it holds run.csv, which `host-sim run` did not write"),
            "{error}"
        );
        assert_eq!(fs::read_to_string(out.join("run.csv")).unwrap(), "recorded");
        assert_eq!(names(out), ["run.csv"]);
        let force = Owner { force: true, ..RUN };
        finished(out, force, &["run.csv"]).unwrap();
        assert_eq!(fs::read_to_string(out.join("run.csv")).unwrap(), "run.csv");

        let identify = Owner {
            command: "identify",
            ..RUN
        };
        let error = finished(out, identify, &["report.html"]).unwrap_err().to_string();
        assert!(error.contains("it holds results of `host-sim run`"), "{error}");
    }

    #[test]
    fn an_unfinished_set_leaves_nothing() {
        let directory = tempfile::tempdir().unwrap();
        let out = directory.path().join("new/deep");
        let set = FileSet::begin(&out, RUN).unwrap();
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
        let set = FileSet::begin(directory.path(), RUN).unwrap();
        assert_eq!(names(&left), ["lock"]);
        drop(set);
        assert_eq!(names(directory.path()), [""; 0]);
    }

    #[test]
    fn a_second_writer_and_a_bad_place_are_refused() {
        let directory = tempfile::tempdir().unwrap();
        let _first = FileSet::begin(directory.path(), RUN).unwrap();
        let second = FileSet::begin(directory.path(), RUN).unwrap_err().to_string();
        assert!(
            second.ends_with("another run is writing its files there"),
            "{second}"
        );
        assert_eq!(names(directory.path()), [STAGING], "the first goes on");

        let file = directory.path().join("file");
        fs::write(&file, "").unwrap();
        let error = FileSet::begin(&file, RUN).unwrap_err();
        assert_eq!(error.path, file);
    }
}
