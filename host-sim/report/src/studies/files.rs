//! What every study leaves in the same way: its figures and its report.

use std::path::Path;

use super::OutputError;
use crate::document::{Block, Report, write_bytes};
use crate::plot::Figure;

/// A figure as `NAME.svg` and `NAME.png`.
fn write_figure(directory: &Path, name: &str, figure: &Figure) -> Result<(), OutputError> {
    let (svg, png) = (figure.to_svg()?, figure.to_png()?);
    write_bytes(&directory.join(format!("{name}.svg")), svg)?;
    Ok(write_bytes(&directory.join(format!("{name}.png")), png)?)
}

/// The figures of a report, and the report itself as `report.html`.
///
/// # Errors
/// What could not be written or drawn.
pub fn write(report: &Report, directory: &Path) -> Result<(), OutputError> {
    for block in report.sections.iter().flat_map(|section| &section.blocks) {
        if let Block::Figure { name, figure, .. } = block {
            write_figure(directory, name, figure)?;
        }
    }
    Ok(write_bytes(&directory.join("report.html"), report.to_html()?)?)
}
