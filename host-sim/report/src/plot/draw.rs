//! A figure as an SVG document.

use kuva::backend::svg::SvgBackend;
use kuva::plot::LegendPlot;
use kuva::plot::legend::{LegendEntry, LegendShape};
use kuva::render::figure::Figure as Grid;
use kuva::render::layout::Layout;
use kuva::render::plots::Plot;

use super::frame::Frame;
use super::{Figure, Mark, style};

pub(super) const PAGE_WIDTH: f64 = 900.0;
pub(super) const PANEL_HEIGHT: f64 = 190.0;
pub(super) const LEFT: f64 = 76.0;
pub(super) const RIGHT: f64 = 16.0;
pub(super) const TEXT_SIZE: u32 = 14;
/// About the width of a letter of that size.
const LETTER: f64 = 8.2;
const LEGEND_LINE: f64 = 22.0;

pub(super) const STEM_DOT: f64 = 2.2;
pub(super) const INTERVAL_OPACITY: f64 = 0.25;

pub(super) fn svg(figure: &Figure) -> String {
    let legend = legend(figure);
    let columns = if figure.rows.is_empty() {
        1
    } else {
        figure.panels.len().max(1)
    };
    let mut page = Page::default();
    if !legend.is_empty() {
        page.put_legend(legend, columns);
    }
    let first = page.structure.len() * columns;
    for (i, (panel, y_limits)) in figure.panels.iter().zip(figure.y_limits()).enumerate() {
        let frame = Frame::new(figure, i, y_limits);
        page.structure.push(vec![first + i]);
        page.cells.push(frame.plots(panel));
        page.layouts.push(frame.layout(panel));
        if columns == 1 || i == 0 {
            page.heights.push(frame.height);
        }
    }
    let rows = page.heights.len().max(1);
    let mut grid = Grid::new(rows, columns)
        .with_structure(page.structure)
        .with_plots(page.cells)
        .with_layouts(page.layouts)
        .with_spacing(0.0)
        .with_padding(6.0)
        .with_cell_size(PAGE_WIDTH / columns as f64, PANEL_HEIGHT);
    if columns > 1 {
        let names = names_room(figure) - LEFT;
        let width = (PAGE_WIDTH - names) / columns as f64;
        for column in 0..columns {
            grid = grid.with_col_width(column, if column == 0 { width + names } else { width });
        }
    }
    for (row, height) in page.heights.into_iter().enumerate() {
        grid = grid.with_row_height(row, height);
    }
    if !figure.title.is_empty() {
        grid = grid.with_title(&figure.title).with_title_size(TEXT_SIZE + 2);
    }
    tidy(&SvgBackend::new().render_scene(&grid.render()))
}

/// Round joins, because a mitred join of a zigzag reaches beyond the data. The names of clip paths, which the
/// drawing library counts up for as long as the program runs, start from zero, so that equal figures are equal text.
fn tidy(svg: &str) -> String {
    let svg = svg.replacen("<svg ", "<svg stroke-linejoin=\"round\" ", 1);
    const NAME: &str = "kuva-clip-";
    let number = |text: &str| {
        text.split(|c: char| !c.is_ascii_digit())
            .next()?
            .parse::<u64>()
            .ok()
    };
    let mut pieces = svg.split(NAME);
    let mut tidied = pieces.next().unwrap_or_default().to_owned();
    let first = pieces.clone().filter_map(number).min().unwrap_or(0);
    for piece in pieces {
        let digits = piece.len() - piece.trim_start_matches(|c: char| c.is_ascii_digit()).len();
        let renumbered = number(piece).map_or(0, |n| n - first);
        tidied.push_str(&format!("{NAME}{renumbered}{}", &piece[digits..]));
    }
    tidied
}

/// The cells of a page under construction.
#[derive(Default)]
struct Page {
    structure: Vec<Vec<usize>>,
    cells: Vec<Vec<Plot>>,
    layouts: Vec<Layout>,
    heights: Vec<f64>,
}

impl Page {
    fn put_legend(&mut self, entries: Vec<LegendEntry>, columns: usize) {
        let widest = entries.iter().map(|e| e.label.chars().count()).max().unwrap_or(0);
        let fitting = (PAGE_WIDTH - LEFT - RIGHT) / (LETTER * widest as f64 + 44.0);
        let across = (fitting.max(1.0) as usize).min(entries.len());
        self.heights
            .push(LEGEND_LINE * entries.len().div_ceil(across) as f64 + 14.0);
        let plot = LegendPlot::from_entries(entries)
            .with_cols(across)
            .with_max_cols(across)
            .without_box();
        self.cells.push(vec![Plot::LegendPlot(plot)]);
        let layout = Layout::new((0.0, 1.0), (0.0, 1.0)).with_body_size(TEXT_SIZE);
        let layout = layout
            .with_force_margins(LEFT, RIGHT)
            .with_force_margins_y(10.0, 0.0);
        self.layouts.push(layout);
        self.structure.push((0..columns).collect());
    }
}

/// Room for the names of the rows.
pub(super) fn names_room(figure: &Figure) -> f64 {
    let longest = figure
        .rows
        .iter()
        .map(|name| name.chars().count())
        .max()
        .unwrap_or(0);
    (0.82 * LETTER * longest as f64 + 16.0).max(LEFT)
}

fn legend(figure: &Figure) -> Vec<LegendEntry> {
    let mut entries: Vec<LegendEntry> = Vec::new();
    let mut add = |label: &str, colour: &str, shape, dash: &str| {
        if !label.is_empty() && entries.iter().all(|e| e.label != label) {
            entries.push(LegendEntry {
                label: label.into(),
                color: colour.into(),
                shape,
                dasharray: (!dash.is_empty()).then(|| dash.into()),
            });
        }
    };
    for series in figure.panels.iter().flat_map(|p| &p.series) {
        let style = style::of(series.style);
        let (colour, shape) = match series.mark {
            Mark::Line => (style.colour.to_owned(), LegendShape::Line),
            Mark::Interval(_) => (paler(style.colour, INTERVAL_OPACITY), LegendShape::Rect),
            Mark::Dots | Mark::Whiskers(_) => (style.colour.to_owned(), LegendShape::Marker(style.marker)),
            Mark::Stems => (style.colour.to_owned(), LegendShape::CircleSize(STEM_DOT)),
        };
        add(&series.label, &colour, shape, style.dash);
    }
    for marker in &figure.markers {
        add(&marker.label, style::MARKER, LegendShape::Line, "2 2");
    }
    for band in &figure.bands {
        let (colour, opacity) = style::of_shade(band.shade);
        add(&band.label, &paler(colour, opacity), LegendShape::Rect, "");
    }
    entries
}

/// A colour as it looks on white paper.
fn paler(colour: &str, opacity: f64) -> String {
    let channel = |i: usize| u8::from_str_radix(colour.get(i..i + 2).unwrap_or("00"), 16).unwrap_or(0);
    let mixed = |i: usize| (f64::from(channel(i)) * opacity + 255.0 * (1.0 - opacity)) as u8;
    format!("#{:02x}{:02x}{:02x}", mixed(1), mixed(3), mixed(5))
}
