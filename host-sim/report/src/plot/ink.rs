//! Colours, dashes and the few shapes that a figure is made of.

use super::page::{PAGE_WIDTH, UNIT};
use plotters::coord::Shift;
use plotters::element::{DashedPathElement, PathElement};
use plotters::prelude::{DrawingArea, DrawingBackend};
use plotters::style::{Color, RGBColor, ShapeStyle};

pub(super) type DrawResult<DB> =
    Result<(), plotters::drawing::DrawingAreaErrorKind<<DB as DrawingBackend>::ErrorType>>;

pub(super) const INK: RGBColor = RGBColor(0x22, 0x22, 0x22);
pub(super) const GRID: RGBColor = RGBColor(0xd9, 0xd9, 0xd9);
pub(super) const MARKER: RGBColor = RGBColor(0x55, 0x55, 0x55);
const LIGHT_BAND: RGBColor = RGBColor(0xf4, 0xf4, 0xf4);
const DARK_BAND: RGBColor = RGBColor(0xe8, 0xe8, 0xe8);

pub(super) struct Style {
    colour: RGBColor,
    /// Dash and gap in tenths of a point; no dash is solid.
    dash: Option<(i32, i32)>,
}

/// Okabe and Ito's colours, without the yellow that is lost on white paper.
pub(super) const STYLES: [Style; 7] = [
    Style {
        colour: RGBColor(0x00, 0x00, 0x00),
        dash: None,
    },
    Style {
        colour: RGBColor(0x00, 0x72, 0xb2),
        dash: None,
    },
    Style {
        colour: RGBColor(0x00, 0x9e, 0x73),
        dash: Some((100, 40)),
    },
    Style {
        colour: RGBColor(0xd5, 0x5e, 0x00),
        dash: Some((40, 30)),
    },
    Style {
        colour: RGBColor(0xcc, 0x79, 0xa7),
        dash: None,
    },
    Style {
        colour: RGBColor(0x56, 0xb4, 0xe9),
        dash: Some((100, 40)),
    },
    Style {
        colour: RGBColor(0xe6, 0x9f, 0x00),
        dash: Some((40, 30)),
    },
];
const LINE_WIDTH: u32 = 7;

/// Beyond five page widths a line is a scribble: its dashes cannot be read, and as separate strokes they would
/// make an SVG of megabytes. It is drawn solid.
const LONGEST_DASHED: f64 = (5 * PAGE_WIDTH * UNIT) as f64;

/// What stands for something in the legend.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Key {
    Line(usize),
    Marker,
    Band { dark: bool },
}

/// A rectangle's outline as a path, because the SVG of an outlined rectangle drops the width of its line.
pub(super) fn frame(
    [(left, top), (right, bottom)]: [(i32, i32); 2],
    style: ShapeStyle,
) -> PathElement<(i32, i32)> {
    let corners = vec![
        (left, top),
        (right, top),
        (right, bottom),
        (left, bottom),
        (left, top),
    ];
    PathElement::new(corners, style)
}

pub(super) fn band_colour(dark: bool) -> RGBColor {
    if dark { DARK_BAND } else { LIGHT_BAND }
}

pub(super) fn draw_line<DB: DrawingBackend>(
    area: &DrawingArea<DB, Shift>,
    path: Vec<(i32, i32)>,
    style: usize,
) -> DrawResult<DB> {
    let Style { colour, dash } = STYLES[style % STYLES.len()];
    draw_path(area, path, colour.stroke_width(LINE_WIDTH), dash)
}

pub(super) fn draw_marker<DB: DrawingBackend>(
    area: &DrawingArea<DB, Shift>,
    x: i32,
    top: i32,
    bottom: i32,
) -> DrawResult<DB> {
    draw_path(
        area,
        vec![(x, top), (x, bottom)],
        MARKER.stroke_width(6),
        Some((20, 20)),
    )
}

fn length(path: &[(i32, i32)]) -> f64 {
    path.windows(2)
        .map(|p| f64::hypot(f64::from(p[1].0 - p[0].0), f64::from(p[1].1 - p[0].1)))
        .sum()
}

fn draw_path<DB: DrawingBackend>(
    area: &DrawingArea<DB, Shift>,
    path: Vec<(i32, i32)>,
    style: ShapeStyle,
    dash: Option<(i32, i32)>,
) -> DrawResult<DB> {
    match dash.filter(|_| length(&path) < LONGEST_DASHED) {
        None => area.draw(&PathElement::new(path, style)),
        Some((dash, gap)) => area.draw(&DashedPathElement::new(
            path,
            dash * UNIT / 10,
            gap * UNIT / 10,
            style,
        )),
    }
}
