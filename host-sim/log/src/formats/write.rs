//! Files that are written: beside their place, then moved there.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

#[cfg(not(feature = "mdf"))]
use super::LARGER;
#[cfg(feature = "mcap")]
use super::mcap;
#[cfg(feature = "mdf")]
use super::mdf_write;
#[cfg(feature = "parquet")]
use super::parquet;
use super::{Format, csv, mat};
use crate::recording::{Recording, RecordingError, refuse};

/// Writes channels into the file at `path`: beside it first, so that a file that is there is replaced by a whole one.
///
/// # Errors
/// A format of frames, channels that it cannot hold, what the disk says; with the file.
pub fn write(path: &Path, recording: Recording) -> Result<(), RecordingError> {
    let format = Format::from_path(path)?;
    replaced(path, |out| {
        match format {
        Format::Csv => csv::write(&recording.into_one_group()?, out),
        Format::Mat => mat::write(&recording.into_one_group()?, out),
        #[cfg(feature = "mdf")]
        Format::Mdf4 => whole(out, mdf_write::write(&recording)?),
        #[cfg(not(feature = "mdf"))]
        Format::Mdf4 => Err(format!("this build writes no .mf4, {LARGER}").into()),
        #[cfg(feature = "mcap")]
        Format::Mcap => whole(out, mcap::write(&recording)?),
        #[cfg(feature = "parquet")]
        Format::Parquet => parquet::write(&recording.into_one_group()?, out),
        Format::Candump | Format::Asc | Format::Blf => Err(
            "a table of channels has no frames, and a bus log nothing else; `host-sim run --bus-log` records the bus".into(),
        ),
    }
    })
}

/// Channels as the text of a CSV file.
///
/// # Errors
/// Two channels of one name.
pub fn to_csv(recording: Recording) -> Result<Vec<u8>, RecordingError> {
    let mut text = Vec::new();
    csv::write(&recording.into_one_group()?, &mut text)?;
    Ok(text)
}

#[cfg(any(feature = "mcap", feature = "mdf"))]
fn whole(out: &mut Out, bytes: Vec<u8>) -> Result<(), RecordingError> {
    std::io::Write::write_all(out, &bytes).map_err(refuse)
}

/// A file under way.
pub(super) type Out = BufWriter<File>;

/// Puts what `write` writes in the place of the file at `path`; where that fails, the file stays as it is. What a kill leaves
/// beside it is in nobody's way.
pub(super) fn replaced(
    path: &Path,
    write: impl FnOnce(&mut Out) -> Result<(), RecordingError>,
) -> Result<(), RecordingError> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let beside = path.with_file_name(format!("{name}.{}.unfinished", std::process::id()));
    let made = || -> Result<(), RecordingError> {
        let mut out = BufWriter::new(File::create(&beside).map_err(refuse)?);
        write(&mut out)?;
        let file = out.into_inner().map_err(refuse)?;
        file.sync_all().map_err(refuse)?;
        std::fs::rename(&beside, path).map_err(refuse)
    };
    made().map_err(|e| {
        // If it cannot be removed either, the disk has said why.
        let _ = std::fs::remove_file(&beside);
        RecordingError(format!("{}: {e}", path.display()))
    })
}
