//! Measures of the page that a figure is drawn on, and text on it.

use kuva::render::layout::Layout;
use kuva::render::render::{Primitive, TextAnchor};

use super::Figure;

pub(super) const PAGE_WIDTH: f64 = 900.0;
pub(super) const PANEL_HEIGHT: f64 = 190.0;
pub(super) const LEFT: f64 = 76.0;
pub(super) const RIGHT: f64 = 16.0;
pub(super) const TEXT_SIZE: u32 = 14;
/// Approximate width of a letter of that size.
pub(super) const LETTER: f64 = 8.2;

/// Axes from one end to the other, with these margins: left, above and below.
pub(super) fn fixed(x: (f64, f64), y: (f64, f64), [left, above, below]: [f64; 3]) -> Layout {
    Layout::new(x, y)
        .with_clamp_axis()
        .with_x_axis_min(x.0)
        .with_x_axis_max(x.1)
        .with_y_axis_min(y.0)
        .with_y_axis_max(y.1)
        .with_force_margins(left, RIGHT)
        .with_force_margins_y(above, below)
}

/// A text whose vertical middle is at `y`.
pub(super) fn text(x: f64, y: f64, words: &str, size: u32, anchor: TextAnchor, colour: &str) -> Primitive {
    Primitive::Text {
        x,
        // 0.36 of the size is half the height of a digit.
        y: y + 0.36 * f64::from(size),
        content: words.into(),
        size,
        anchor,
        rotate: None,
        bold: false,
        color: Some(colour.into()),
    }
}

/// Width that the names of the rows need.
pub(super) fn names_room(figure: &Figure) -> f64 {
    let longest = figure
        .rows
        .iter()
        .map(|name| name.chars().count())
        .max()
        .unwrap_or(0);
    (0.82 * LETTER * longest as f64 + 16.0).max(LEFT)
}
