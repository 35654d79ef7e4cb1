//! Colours, dashes and markers.

use kuva::plot::scatter::MarkerShape;

use super::Shade;

pub(super) const MARKER: &str = "#555555";

pub(super) struct Style {
    pub(super) colour: &'static str,
    /// Dash and gap, points; empty is solid.
    pub(super) dash: &'static str,
    pub(super) width: f64,
    pub(super) marker: MarkerShape,
}

const fn style(colour: &'static str, dash: &'static str, width: f64, marker: MarkerShape) -> Style {
    Style {
        colour,
        dash,
        width,
        marker,
    }
}

/// Okabe and Ito's colours, without the yellow that is lost on white paper.
const ALL: [Style; 7] = [
    style("#000000", "", 2.4, MarkerShape::Circle),
    style("#0072b2", "", 1.5, MarkerShape::Square),
    style("#009e73", "9 4", 1.7, MarkerShape::Triangle),
    style("#d55e00", "4 3", 1.7, MarkerShape::Diamond),
    style("#cc79a7", "", 1.5, MarkerShape::Cross),
    style("#56b4e9", "9 4", 1.7, MarkerShape::Plus),
    style("#e69f00", "4 3", 1.7, MarkerShape::TriangleDown),
];

/// Colour and opacity of a band: the grid and the frame show through.
pub(super) fn of_shade(shade: Shade) -> (&'static str, f64) {
    match shade {
        Shade::Light => ("#000000", 0.05),
        Shade::Dark => ("#000000", 0.12),
        Shade::Alert => ("#d55e00", 0.2),
    }
}

/// Number of styles that can be told apart.
pub(super) const STYLES: usize = ALL.len();

pub(super) fn by_index(index: usize) -> &'static Style {
    &ALL[index % STYLES]
}

/// Colour of a style.
pub(crate) fn colour(index: usize) -> &'static str {
    by_index(index).colour
}

/// Dash and gap of a style, points; empty is solid.
pub(crate) fn dash(index: usize) -> Vec<f64> {
    by_index(index)
        .dash
        .split_whitespace()
        .filter_map(|n| n.parse().ok())
        .collect()
}

/// Width of a style's line, points.
pub(crate) fn width(index: usize) -> f64 {
    by_index(index).width
}
