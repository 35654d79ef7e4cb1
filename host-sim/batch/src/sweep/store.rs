//! Finished chunks in a directory. A chunk appears whole or not at all, so a sweep goes on behind a kill at any instant;
//! shards may share the directory, or be copied into one.
//!
//! `sweep.toml` is the sweep whole, with the program that drives it; `chunks/` holds the chunks; `drives.csv`,
//! `drives.parquet` and [`Summary`] are made of them when all are there.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use super::chunk::checksum;
use super::summary::Summarised;
use super::table::{columns, entries};
use super::{Chunk, Driven, Shard, StoreError, Summary, Sweep};
use crate::engine::Tables;
use crate::statistics::Confidence;
use crate::sweep::run::Enough;

/// A sweep's directory.
#[derive(Debug)]
pub struct Store<'a> {
    sweep: &'a Sweep,
    version: String,
    directory: PathBuf,
    fingerprint: u64,
}

impl<'a> Store<'a> {
    /// Begins a directory, or goes on with it. `version` names the program: its results are not mixed with those of
    /// another.
    ///
    /// # Errors
    /// A file that cannot be written; a directory with another sweep in it.
    pub fn open(sweep: &'a Sweep, version: &str, directory: &Path) -> Result<Self, StoreError> {
        let text = head(sweep, version);
        let store = Self {
            sweep,
            version: version.into(),
            directory: directory.into(),
            fingerprint: checksum(text.as_bytes()),
        };
        let chunks = directory.join("chunks");
        fs::create_dir_all(&chunks).map_err(|e| StoreError::file(&chunks, e))?;
        let path = directory.join("sweep.toml");
        match fs::read_to_string(&path) {
            Ok(there) if there == text => {}
            Ok(_) => return Err(StoreError::Another(directory.into())),
            // In the directory itself the unfinished file would be somebody's to a shard that begins at the same time.
            Err(e) if e.kind() == io::ErrorKind::NotFound => {
                store.write_by(&store.beside(&chunks.join("sweep.toml")), &path, text.as_bytes())?;
            }
            Err(e) => return Err(StoreError::file(&path, e)),
        }
        Ok(store)
    }

    /// Tells a sweep and the program that drives it from others, before there is a directory.
    pub fn fingerprint_of(sweep: &Sweep, version: &str) -> u64 {
        checksum(head(sweep, version).as_bytes())
    }

    /// Where it lies.
    pub fn directory(&self) -> &Path {
        &self.directory
    }

    /// Tells the sweep and its program from others.
    pub fn fingerprint(&self) -> u64 {
        self.fingerprint
    }

    fn path(&self, chunk: u64) -> PathBuf {
        self.directory.join("chunks").join(format!("{chunk:08}"))
    }

    /// A finished chunk.
    pub fn get(&self, number: u64) -> Option<Chunk> {
        let bytes = fs::read(self.path(number)).ok()?;
        self.chunk(&bytes).filter(|chunk| chunk.number == number)
    }

    /// One drive of a finished chunk.
    pub fn get_drive(&self, drive: u64) -> Option<Driven> {
        let number = drive / self.sweep.drives_of_a_chunk();
        let place = drive - self.sweep.drives_of(number).start;
        self.get(number)?.rows.get(usize::try_from(place).ok()?).cloned()
    }

    fn chunk(&self, bytes: &[u8]) -> Option<Chunk> {
        let number: [u8; 8] = bytes.get(16..24)?.try_into().ok()?;
        let rows = self.sweep.drives_of(u64::from_le_bytes(number));
        let rows = usize::try_from(rows.end - rows.start).ok()?;
        Chunk::from_bytes(bytes, self.fingerprint, rows, self.sweep.metrics().len())
    }

    /// Keeps a finished chunk, as [`Chunk::to_bytes`] gives it.
    ///
    /// # Errors
    /// Bytes that are no chunk of this sweep; what the disk says.
    pub fn put(&self, number: u64, bytes: &[u8]) -> Result<(), StoreError> {
        if self.chunk(bytes).is_none_or(|chunk| chunk.number != number) {
            return Err(StoreError::Corrupted(number));
        }
        self.write(&self.path(number), bytes)
    }

    /// Chunks of a shard that are not finished, in order.
    pub fn missing(&self, shard: Shard) -> Vec<u64> {
        let mine = (0..self.sweep.chunks()).filter(|chunk| shard.has(*chunk));
        mine.filter(|chunk| self.get(*chunk).is_none()).collect()
    }

    /// The file whole or not at all: written beside its place, then moved there.
    fn write(&self, path: &Path, bytes: &[u8]) -> Result<(), StoreError> {
        self.write_by(&self.beside(path), path, bytes)
    }

    fn write_by(&self, beside: &Path, path: &Path, bytes: &[u8]) -> Result<(), StoreError> {
        let written = fs::File::create(beside).and_then(|mut file| {
            file.write_all(bytes)?;
            file.sync_all()
        });
        let moved = written.and_then(|()| fs::rename(beside, path));
        moved.map_err(|e| StoreError::file(path, e))
    }

    /// A name of this process alone.
    fn beside(&self, path: &Path) -> PathBuf {
        let mut name = path.file_name().unwrap_or_default().to_os_string();
        name.push(format!(".{}.unfinished", std::process::id()));
        path.with_file_name(name)
    }

    /// Makes the table of all drives, or of an early stop's, and their summary with intervals of a level.
    ///
    /// # Errors
    /// Chunks that are missing; what the disk says.
    pub fn finish(&self, level: Confidence) -> Result<Summary, StoreError> {
        let all = self.sweep.chunks();
        let mut watch = Enough::new(self.sweep);
        let (mut summary, mut end) = (Summarised::new(self.sweep, level), None);
        let places = ["drives.csv", "drives.parquet"].map(|name| self.directory.join(name));
        let beside = places.each_ref().map(|path| self.beside(path));
        // The whole sweep and the scenario that it varies are in the file, so that a row says with its file what was driven.
        let metadata = [
            ("haptic.version", &*self.version),
            ("haptic.sweep", self.sweep.text()),
        ];
        let mut tables =
            Tables::create(columns(self.sweep), &metadata, &beside).map_err(|e| self.table_error(e))?;
        for number in 0..all {
            let Some(chunk) = self.get(number) else {
                for path in &beside {
                    // It is only half a table.
                    let _ = fs::remove_file(path);
                }
                return Err(StoreError::Missing(self.missing(Shard::WHOLE).len() as u64, all));
            };
            for (drive, driven) in self.sweep.drives_of(number).zip(&chunk.rows) {
                let point = self.sweep.point(drive);
                summary.add(&point, driven);
                tables
                    .row(entries(&point, driven, &self.version))
                    .map_err(|e| self.table_error(e))?;
            }
            if watch.add(&chunk) {
                end = Some(self.sweep.drives_of(number).end);
                break;
            }
        }
        tables.finish().map_err(|e| self.table_error(e))?;
        let made = if cfg!(feature = "parquet") { 2 } else { 1 };
        for (from, to) in beside.iter().zip(&places).take(made) {
            match fs::rename(from, to) {
                // A shard that finished at the same time has tidied up behind itself; its bytes are the same.
                Err(e) if e.kind() == io::ErrorKind::NotFound && to.exists() => {}
                moved => moved.map_err(|e| StoreError::file(to, e))?,
            }
        }
        self.tidy();
        Ok(summary.finish(end.unwrap_or(self.sweep.drives()), &self.version))
    }

    fn table_error(&self, error: io::Error) -> StoreError {
        StoreError::file(&self.directory.join("drives"), error)
    }

    /// What kills have left. All chunks are there, so nobody needs it.
    fn tidy(&self) {
        for folder in [self.directory.clone(), self.directory.join("chunks")] {
            for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
                if entry.path().extension().is_some_and(|end| end == "unfinished") {
                    // Somebody else may have been quicker.
                    let _ = fs::remove_file(entry.path());
                }
            }
        }
    }
}

/// What `sweep.toml` holds.
fn head(sweep: &Sweep, version: &str) -> String {
    format!("# Made by {version}\n{}", sweep.text())
}
