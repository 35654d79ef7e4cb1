//! Figures: a column of panels over one shared x axis, the same drawing as SVG and as PNG.
//!
//! A [`Figure`] is plain data: fill it and call [`Figure::to_svg`] or [`Figure::to_png`]. Limits are either
//! given or taken from the data and rounded outward to a tick; [`Figure::x_limits`] and [`Figure::y_limits`]
//! tell what will be drawn. Lines are cut at the limits and where a value is not finite, and thinned without
//! losing a peak. Colours (Okabe and Ito 2008) are told apart by colour-blind readers, and dashes in grey
//! print. The font is built in, so that no machine needs one.
//!
//! What to plot is decided by studies, and files are written by `report`, NOT here. `lateral_error` lays out
//! the one figure that several studies share.

mod axis;
mod draw;
mod font;
mod ink;
pub mod lateral_error;
mod output;
mod page;
mod polyline;

use std::fmt;

/// A drawing of panels that share their x axis.
#[derive(Debug, Clone, Default)]
pub struct Figure {
    /// Drawn above everything; may be empty.
    pub title: String,
    /// The shared x axis.
    pub x: Axis,
    /// Whether all panels have the same y limits.
    pub same_y: bool,
    /// From top to bottom.
    pub panels: Vec<Panel>,
    /// Vertical lines through all panels.
    pub markers: Vec<Marker>,
    /// Shaded stretches of x behind all panels.
    pub bands: Vec<Band>,
}

/// What an axis shows.
#[derive(Debug, Clone, Default)]
pub struct Axis {
    /// Quantity and unit.
    pub label: String,
    /// Lower and upper end; `None` takes them from the data.
    pub limits: Option<(f64, f64)>,
}

/// One plot of the column.
#[derive(Debug, Clone, Default)]
pub struct Panel {
    /// Drawn above the panel at its left; may be empty.
    pub title: String,
    /// The panel's own y axis.
    pub y: Axis,
    /// In drawing order: the last lies on top.
    pub lines: Vec<Line>,
}

/// One curve. Lines of the same label share one legend entry, so give them the same style.
#[derive(Debug, Clone, Default)]
pub struct Line {
    /// Name in the legend; empty for none.
    pub label: String,
    /// Colour and dash, from 0; from [`STYLES`] on they repeat.
    pub style: usize,
    /// The curve; it breaks where a value is not finite.
    pub points: Vec<(f64, f64)>,
}

/// An instant or a place.
#[derive(Debug, Clone, Default)]
pub struct Marker {
    /// Name in the legend.
    pub label: String,
    /// Where.
    pub x: f64,
}

/// A stretch of x.
#[derive(Debug, Clone, Default)]
pub struct Band {
    /// Name in the legend; bands of one name share an entry.
    pub label: String,
    /// Start.
    pub from: f64,
    /// End.
    pub to: f64,
    /// The darker of the two shades.
    pub dark: bool,
}

/// Number of line styles that can be told apart.
pub const STYLES: usize = ink::STYLES.len();

/// Why a figure could not be drawn.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PlotError(String);

impl fmt::Display for PlotError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for PlotError {}

impl Figure {
    /// The figure as an SVG document.
    ///
    /// # Errors
    /// A given limit is not finite, or does not lie below its upper one.
    pub fn to_svg(&self) -> Result<String, PlotError> {
        output::svg(self)
    }

    /// The figure as a PNG, 1800 pixels wide.
    ///
    /// # Errors
    /// As [`Figure::to_svg`].
    pub fn to_png(&self) -> Result<Vec<u8>, PlotError> {
        output::png(self)
    }

    /// Ends of the x axis: as given, else of the data; (0, 1) if there is none.
    pub fn x_limits(&self) -> (f64, f64) {
        let points = self.panels.iter().flat_map(|p| &p.lines).flat_map(|l| &l.points);
        let extent = || match axis::extent(points.filter(|p| p.1.is_finite()).map(|p| p.0)) {
            Some((low, high)) if low < high => (low, high),
            Some((only, _)) => (only - 0.5, only + 0.5),
            None => (0.0, 1.0),
        };
        self.x.limits.unwrap_or_else(extent)
    }

    /// Ends of each panel's y axis: as given, else of the data within the x limits (of all panels if
    /// [`Figure::same_y`]), rounded outward to a tick.
    pub fn y_limits(&self) -> Vec<(f64, f64)> {
        let (left, right) = self.x_limits();
        let visible = |panel: &Panel| {
            let points = panel.lines.iter().flat_map(|l| &l.points);
            axis::extent(points.filter(|p| (left..=right).contains(&p.0)).map(|p| p.1))
        };
        let extents: Vec<_> = self.panels.iter().map(visible).collect();
        let of_all = axis::extent(extents.iter().flatten().flat_map(|&(low, high)| [low, high]));
        let limits = |(panel, own): (&Panel, &Option<(f64, f64)>)| {
            panel
                .y
                .limits
                .unwrap_or_else(|| axis::rounded_outward(if self.same_y { of_all } else { *own }))
        };
        self.panels.iter().zip(&extents).map(limits).collect()
    }

    fn check_limits(&self) -> Result<(), PlotError> {
        let y = self.panels.iter().filter_map(|p| Some((&p.y.label, p.y.limits?)));
        let x = self.x.limits.map(|limits| (&self.x.label, limits));
        for (label, (low, high)) in x.into_iter().chain(y) {
            if !(low.is_finite() && high.is_finite() && low < high) {
                return Err(PlotError(format!(
                    "figure '{}': limits of axis '{label}' are {low} to {high}, must be finite and rising",
                    self.title
                )));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
