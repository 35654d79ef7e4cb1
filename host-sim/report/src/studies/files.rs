//! What every study leaves in the same way: its figures and its report.

use std::path::Path;

use super::OutputError;
use crate::document::{Report, write_file};
use crate::plot::Figure;

/// A figure as `NAME.svg` and `NAME.png`.
pub(super) fn write_figure(directory: &Path, name: &str, figure: &Figure) -> Result<(), OutputError> {
    let (svg, png) = (figure.to_svg()?, figure.to_png()?);
    write_file(&directory.join(format!("{name}.svg")), |f| {
        f.write_all(svg.as_bytes())
    })?;
    Ok(write_file(&directory.join(format!("{name}.png")), |f| {
        f.write_all(&png)
    })?)
}

/// The report as `report.html`.
pub(super) fn write_report(directory: &Path, report: &Report) -> Result<(), OutputError> {
    let html = report.to_html()?;
    Ok(write_file(&directory.join("report.html"), |f| {
        f.write_all(html.as_bytes())
    })?)
}
