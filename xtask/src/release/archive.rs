//! Archives that have the same bytes whoever packs them, and whenever.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result};
use flate2::{Compression, GzBuilder, read::GzDecoder};

use crate::dist;

/// A file of an archive.
pub(crate) struct Entry {
    pub(crate) name: String,
    pub(crate) bytes: Vec<u8>,
    pub(super) is_program: bool,
}

impl Entry {
    pub(super) fn new(name: &str, bytes: impl Into<Vec<u8>>) -> Self {
        Self {
            name: name.to_owned(),
            bytes: bytes.into(),
            is_program: false,
        }
    }

    pub(super) fn read(file: &Path, name: &str) -> Result<Self> {
        let bytes = fs::read(file).with_context(|| file.display().to_string())?;
        Ok(Self::new(name, bytes))
    }

    pub(super) fn program(mut self) -> Self {
        self.is_program = true;
        self
    }

    /// Not a licence of our own, which is in every archive.
    pub(super) fn is_of_part(&self) -> bool {
        !self.name.starts_with("LICENSE")
    }
}

/// Writes the entries below `folder` into a `.tar.gz`, sorted, of nobody, and as old as the last commit.
pub(super) fn pack(file: &Path, folder: &str, mut entries: Vec<Entry>) -> Result<()> {
    entries.sort_by(|a, b| a.name.cmp(&b.name));
    let to = fs::File::create(file).with_context(|| file.display().to_string())?;
    let time = dist::commit_time()?;
    let mut tar = tar::Builder::new(GzBuilder::new().write(to, Compression::best()));
    for entry in entries {
        let mut header = tar::Header::new_gnu();
        header.set_size(entry.bytes.len() as u64);
        header.set_mode(if entry.is_program { 0o755 } else { 0o644 });
        header.set_mtime(time);
        tar.append_data(
            &mut header,
            format!("{folder}/{}", entry.name),
            entry.bytes.as_slice(),
        )?;
    }
    tar.into_inner()?.finish()?;
    Ok(())
}

/// Unpacks an archive as a user would.
pub(super) fn unpack(file: &Path, place: &Path) -> Result<()> {
    let from = fs::File::open(file).with_context(|| file.display().to_string())?;
    tar::Archive::new(GzDecoder::new(from))
        .unpack(place)
        .with_context(|| file.display().to_string())
}

#[cfg(test)]
mod tests {
    use std::process::Command;

    use super::{Entry, pack};

    /// Python's tarfile, and not our reader, says what is in it.
    #[test]
    fn an_archive_is_sorted_of_nobody_and_the_same_every_time() {
        let place = std::env::temp_dir().join(format!("haptic-archive-{}", std::process::id()));
        std::fs::create_dir_all(&place).unwrap();
        let [one, other] = ["one.tar.gz", "other.tar.gz"].map(|name| place.join(name));
        let [first, second] = [
            || Entry::new("b/text", "words"),
            || Entry::new("a", "x").program(),
        ];
        pack(&one, "top", vec![first(), second()]).unwrap();
        pack(&other, "top", vec![second(), first()]).unwrap();
        assert_eq!(std::fs::read(&one).unwrap(), std::fs::read(&other).unwrap());
        let list = "import sys, tarfile\nfor m in tarfile.open(sys.argv[1]): print(m.name, oct(m.mode), m.uid, m.uname, m.size)";
        let said = Command::new("python3")
            .args(["-c", list])
            .arg(&one)
            .output()
            .unwrap();
        std::fs::remove_dir_all(&place).unwrap();
        let said = String::from_utf8(said.stdout).unwrap();
        assert_eq!(said, "top/a 0o755 0  1\ntop/b/text 0o644 0  5\n");
    }
}
