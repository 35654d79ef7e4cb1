//! Which files are read, and how they are understood.

use std::path::{Path, PathBuf};

use haptic_analysis::identify::{Layout, Mapping, Options};
use haptic_log::formats::Format;

/// How recordings are understood.
#[derive(Debug, Clone)]
pub struct Understood {
    /// Their layout; the first built-in one that fits if there is none.
    pub layout: Option<Layout>,
    /// What is called otherwise than the layout says.
    pub maps: Vec<Mapping>,
    /// Stretches that are used, s; all of a drive if there is none.
    pub stretches: Vec<(f64, f64)>,
    /// Pauses up to so long are bridged, s.
    pub bridge_s: f64,
}

impl Default for Understood {
    fn default() -> Self {
        Self {
            layout: None,
            maps: Vec::new(),
            stretches: Vec::new(),
            bridge_s: Options::default().bridge_s,
        }
    }
}

pub(super) fn collect(directory: &Path, files: &mut Vec<PathBuf>) -> std::io::Result<()> {
    for entry in std::fs::read_dir(directory)? {
        let path = entry?.path();
        if path.is_dir() {
            collect(&path, files)?;
        } else if Format::from_path(&path).is_ok_and(|format| !format.holds_frames()) {
            files.push(path);
        }
    }
    Ok(())
}
