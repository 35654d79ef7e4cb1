//! Files that are there whole or not at all.
//!
//! A file is written under another name in its directory and renamed when it is complete, so an interrupted
//! run leaves the old file or none. It does not wait for the disk: a power cut may still lose it.

use serde::Serialize;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// Why a file could not be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}: {cause}", path.display())]
pub struct WriteError {
    /// The file.
    pub path: PathBuf,
    /// What the system said.
    #[source]
    pub cause: io::Error,
}

pub(super) fn failed(path: &Path, cause: io::Error) -> WriteError {
    let path = path.to_path_buf();
    WriteError { path, cause }
}

/// Writes what `content` writes to `path`, and creates the directories above it.
///
/// # Errors
/// The directory or file cannot be written, or `content` fails; the old file, if any, is untouched.
pub fn write_file(
    path: &Path,
    content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), WriteError> {
    let failed = |cause| failed(path, cause);
    let Some(name) = path.file_name() else {
        let cause = io::Error::new(io::ErrorKind::InvalidInput, "not the name of a file");
        return Err(failed(cause));
    };
    if let Some(directory) = path.parent() {
        fs::create_dir_all(directory).map_err(failed)?;
    }
    let mut partial_name = name.to_os_string();
    partial_name.push(format!(".{}.part", std::process::id()));
    let partial = path.with_file_name(partial_name);
    let written = write_to(&partial, content).and_then(|()| fs::rename(&partial, path));
    written.map_err(|cause| {
        // The first failure is the one to report; the rest of the file may not even exist.
        let _ = fs::remove_file(&partial);
        failed(cause)
    })
}

fn write_to(path: &Path, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let mut file = BufWriter::new(File::create(path)?);
    content(&mut file)?;
    file.flush()
}

/// Writes `path` with these bytes.
///
/// # Errors
/// As [`write_file`].
pub fn write_bytes(path: &Path, bytes: impl AsRef<[u8]>) -> Result<(), WriteError> {
    write_file(path, |file| file.write_all(bytes.as_ref()))
}

/// Writes `value` as indented JSON, ended by a newline. A float that is not finite becomes `null`.
///
/// # Errors
/// As [`write_file`].
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<(), WriteError> {
    write_file(path, |file| {
        serde_json::to_writer_pretty(&mut *file, value)?;
        writeln!(file)
    })
}
