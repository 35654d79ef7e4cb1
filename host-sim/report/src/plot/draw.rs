//! A figure as an SVG document.

use kuva::backend::svg::SvgBackend;
use kuva::render::figure::Figure as Grid;
use kuva::render::layout::Layout;
use kuva::render::plots::Plot;
use kuva::render::render::TextAnchor;

use super::frame::Frame;
use super::legend::Legend;
use super::page::{LEFT, PAGE_WIDTH, PANEL_HEIGHT, RIGHT, TEXT_SIZE, names_room, text};
use super::{Figure, typeset};

/// Around the page.
const PADDING: f64 = 6.0;
/// Height of the label below the panels.
const LABEL_ROOM: f64 = 24.0;

pub(super) fn svg(figure: &Figure) -> String {
    let columns = figure.columns();
    let frames: Vec<Frame> = (0..figure.panels.len())
        .zip(figure.y_limits())
        .map(|(i, y_limits)| Frame::new(figure, i, y_limits))
        .collect();
    let legend = Legend::new(figure, &frames);
    let mut page = Page::default();
    if let Some(legend) = &legend {
        page.structure.push((0..columns).collect());
        page.heights.push(legend.height());
        page.cells.push(legend.plots());
        page.layouts.push(legend.layout());
    }
    let first = page.structure.len() * columns;
    for (i, (panel, frame)) in figure.panels.iter().zip(&frames).enumerate() {
        page.structure.push(vec![first + i]);
        page.cells.push(frame.plots(panel));
        page.layouts.push(frame.layout(panel));
        if i % columns == 0 {
            page.heights.push(frame.height);
        }
    }
    let heights = page.heights.clone();
    let mut grid = page.grid(columns);
    let mut widths = vec![PAGE_WIDTH / columns as f64; columns];
    if columns > 1 {
        let names = names_room(figure) - LEFT;
        widths.fill((PAGE_WIDTH - names) / columns as f64);
        widths[0] += names;
        for (column, width) in widths.iter().enumerate() {
            grid = grid.with_col_width(column, *width);
        }
    }
    if !figure.title.is_empty() {
        grid = grid.with_title(&figure.title).with_title_size(TEXT_SIZE + 2);
    }
    let mut scene = grid.render();
    // The words that stand upon what is drawn. Above the panels is the title, as high as the library makes it.
    let [mut x, mut y] = [PADDING, scene.height - PADDING - heights.iter().sum::<f64>()];
    if let Some(legend) = &legend {
        legend.names(x, y).for_each(|name| scene.add(name));
        y += legend.height();
    }
    for ((panel, frame), i) in figure.panels.iter().zip(&frames).zip(0..) {
        frame
            .words(panel, [x, y], widths[i % columns])
            .into_iter()
            .for_each(|word| scene.add(word));
        x += widths[i % columns];
        if (i + 1) % columns == 0 {
            (x, y) = (PADDING, y + frame.height);
        }
    }
    if let Some(label) = figure.shared_label() {
        let middle = PADDING + 0.5 * (widths.iter().sum::<f64>() + names_room(figure) - RIGHT);
        let y = scene.height - PADDING - 0.5 * LABEL_ROOM;
        scene.add(text(middle, y, label, TEXT_SIZE, TextAnchor::Middle, "#000000"));
    }
    let svg = tidy(&SvgBackend::new().render_scene(&scene), scene.width, scene.height);
    typeset::texts(&svg)
}

/// Round joins, because a mitred join of a zigzag reaches beyond the data. The names of clip paths, which the
/// drawing library counts up for as long as the program runs, start from zero, so that equal figures are equal text. A view
/// box, without which a narrow page or paper would cut the drawing.
fn tidy(svg: &str, width: f64, height: f64) -> String {
    let head = format!("<svg viewBox=\"0 0 {width} {height}\" stroke-linejoin=\"round\" ");
    let svg = svg.replacen("<svg ", &head, 1);
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
    fn grid(self, columns: usize) -> Grid {
        let mut grid = Grid::new(self.heights.len().max(1), columns)
            .with_structure(self.structure)
            .with_plots(self.cells)
            .with_layouts(self.layouts)
            .with_spacing(0.0)
            .with_padding(PADDING)
            .with_cell_size(PAGE_WIDTH / columns as f64, PANEL_HEIGHT);
        for (row, height) in self.heights.into_iter().enumerate() {
            grid = grid.with_row_height(row, height);
        }
        grid
    }
}
