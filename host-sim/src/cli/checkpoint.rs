//! A file to which a long study adds each part as it is done, and from which an interrupted one goes on.
//!
//! The first line says what the parts belong to; every other line is one part, as JSON. A line that a cut left unfinished
//! is driven again.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use haptic_batch::StudyError;
use haptic_report::document::Provenance;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use super::{BadInput, in_file};

/// A file of parts; without a file nothing is kept.
#[derive(Default)]
pub struct Checkpoint {
    path: PathBuf,
    file: Option<Mutex<File>>,
}

/// The parts that an earlier run left in a file, and what keeps each new one. The study says what the parts belong to; this program does
/// too, since another one drives others.
///
/// # Errors
/// Another study's file, or one that cannot be read or written.
pub fn resume<T: DeserializeOwned>(
    path: Option<&Path>,
    mut study: Value,
) -> Result<(Vec<T>, Checkpoint), BadInput> {
    study["provenance"] = json!(Provenance::new(None));
    let opened = path.map(|path| Checkpoint::open(path, &study.to_string()));
    Ok(opened.transpose()?.unwrap_or_default())
}

impl Checkpoint {
    /// Opens the file, or makes it; gives the parts that it holds. `heading` says what they belong to.
    fn open<T: DeserializeOwned>(path: &Path, heading: &str) -> Result<(Vec<T>, Self), BadInput> {
        let fail = |e: &dyn std::fmt::Display| in_file(path)(e);
        let text = match std::fs::read_to_string(path) {
            Ok(text) => text,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => String::new(),
            Err(e) => return Err(fail(&e)),
        };
        let whole = text.rfind('\n').map_or("", |end| &text[..=end]);
        let mut lines = whole.lines();
        // Without an end of a line it is this study's only if a cut left a part of the heading.
        let first = lines
            .next()
            .or(Some(text.as_str()).filter(|text| !heading.starts_with(text)));
        if let Some(found) = first.filter(|found| *found != heading) {
            let what = format!(
                "belongs to another study; name another file, or delete it\n  it has {found}\n  this is {heading}"
            );
            return Err(fail(&what));
        }
        let parts = lines
            .enumerate()
            .map(|(i, line)| serde_json::from_str(line).map_err(|e| fail(&format!("line {}: {e}", i + 2))))
            .collect::<Result<_, _>>()?;
        let mut file = OpenOptions::new()
            .create(true)
            .truncate(false)
            .write(true)
            .open(path)
            .map_err(|e| fail(&e))?;
        file.set_len(whole.len() as u64).map_err(|e| fail(&e))?;
        std::io::Seek::seek(&mut file, std::io::SeekFrom::End(0)).map_err(|e| fail(&e))?;
        if whole.is_empty() {
            writeln!(file, "{heading}").map_err(|e| fail(&e))?;
        }
        let checkpoint = Self {
            path: path.to_path_buf(),
            file: Some(Mutex::new(file)),
        };
        Ok((parts, checkpoint))
    }

    /// Adds a part, if there is a file.
    ///
    /// # Errors
    /// What the file system says.
    pub fn add(&self, part: &impl Serialize) -> Result<(), StudyError> {
        let Some(file) = &self.file else {
            return Ok(());
        };
        let fail = |e: &dyn std::fmt::Display| format!("{}: {e}", self.path.display());
        let mut line = serde_json::to_string(part).map_err(|e| fail(&e))?;
        line.push('\n');
        let mut file = file.lock().unwrap_or_else(PoisonError::into_inner);
        Ok(file.write_all(line.as_bytes()).map_err(|e| fail(&e))?)
    }
}
