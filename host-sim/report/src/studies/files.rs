//! What every study leaves in the same way: its figures and its report.

use std::path::Path;

use super::OutputError;
use crate::document::{Drawn, Report, write_bytes};

/// Files of the figures, beside the drawings in the report.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Pictures {
    /// SVG.
    #[default]
    Drawings,
    /// SVG, and its pixels as PNG.
    #[cfg(feature = "png")]
    AlsoPixels,
}

/// The figures of a report with their captions, and the report itself as `report.html`.
///
/// # Errors
/// What could not be written or drawn.
pub fn write(report: &Report, directory: &Path, pictures: Pictures) -> Result<(), OutputError> {
    let (figures, page) = report.drawn()?;
    for Drawn { name, caption, svg } in &figures {
        let file = |ending: &str| directory.join(format!("{name}.{ending}"));
        write_bytes(&file("svg"), svg)?;
        write_bytes(&file("txt"), format!("{caption}\n"))?;
        match pictures {
            Pictures::Drawings => {}
            #[cfg(feature = "png")]
            Pictures::AlsoPixels => write_bytes(&file("png"), crate::plot::png(svg)?)?,
        }
    }
    Ok(write_bytes(&directory.join("report.html"), page)?)
}
