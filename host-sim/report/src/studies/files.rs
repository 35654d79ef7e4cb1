//! What every study leaves in the same way: its figures and its report.

use std::path::Path;

use super::OutputError;
use crate::document::{Block, Report, write_file};
use crate::plot::Figure;

/// A figure as `NAME.svg` and `NAME.png`.
fn write_figure(directory: &Path, name: &str, figure: &Figure) -> Result<(), OutputError> {
    let (svg, png) = (figure.to_svg()?, figure.to_png()?);
    write_file(&directory.join(format!("{name}.svg")), |f| {
        f.write_all(svg.as_bytes())
    })?;
    Ok(write_file(&directory.join(format!("{name}.png")), |f| {
        f.write_all(&png)
    })?)
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
    let html = report.to_html()?;
    Ok(write_file(&directory.join("report.html"), |f| {
        f.write_all(html.as_bytes())
    })?)
}
