//! A figure as an SVG document.

use kuva::backend::svg::SvgBackend;
use kuva::plot::annotations::{ReferenceLine, ShadedRegion};
use kuva::plot::legend::{LegendEntry, LegendShape};
use kuva::plot::{BandPlot, LegendPlot, LinePlot, LineStyle, LollipopPlot, ScatterPlot};
use kuva::render::figure::Figure as Grid;
use kuva::render::layout::Layout;
use kuva::render::plots::Plot;

use super::{Figure, Mark, Panel, Series, polyline, style};

const PAGE_WIDTH: f64 = 900.0;
const PANEL_HEIGHT: f64 = 190.0;
/// Height of a row of names.
const ROW_HEIGHT: f64 = 15.0;
const LEFT: f64 = 76.0;
const RIGHT: f64 = 16.0;
/// Below a panel with and without tick labels and axis label, and above one with and without title.
const AXIS_ROOM: f64 = 52.0;
const GAP: f64 = 8.0;
const TITLE_ROOM: f64 = 34.0;
const TEXT_SIZE: u32 = 14;
const TICK_TEXT_SIZE: u32 = 12;
/// About the width of a letter of that size.
const LETTER: f64 = 8.2;
const LEGEND_LINE: f64 = 22.0;

/// Most points of one line: two for each point of the page's width.
const MOST_POINTS: usize = 1800;
/// How far a drawn line may be from the data, points.
const TOLERANCE: f64 = 0.15;
/// Beyond five page widths a line is a scribble. Its dashes could not be read, and a wide line would be a blot: it is
/// drawn solid and thin.
const SCRIBBLE: f64 = 5.0 * PAGE_WIDTH;
const SCRIBBLE_WIDTH: f64 = 1.0;
/// Most points of an area's edge.
const MOST_AREA_POINTS: usize = 600;
const STEM_WIDTH: f64 = 1.2;
const STEM_DOT: f64 = 2.2;
const INTERVAL_OPACITY: f64 = 0.25;

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
        let plot = LegendPlot::from_entries(entries).with_cols(across).without_box();
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
fn names_room(figure: &Figure) -> f64 {
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
        add(
            &band.label,
            &paler("#000000", band_opacity(band.dark)),
            LegendShape::Rect,
            "",
        );
    }
    entries
}

/// Bands are a breath of black, so that the grid and the frame show through.
fn band_opacity(dark: bool) -> f64 {
    if dark { 0.12 } else { 0.05 }
}

/// A colour as it looks on white paper.
fn paler(colour: &str, opacity: f64) -> String {
    let channel = |i: usize| u8::from_str_radix(colour.get(i..i + 2).unwrap_or("00"), 16).unwrap_or(0);
    let mixed = |i: usize| (f64::from(channel(i)) * opacity + 255.0 * (1.0 - opacity)) as u8;
    format!("#{:02x}{:02x}{:02x}", mixed(1), mixed(3), mixed(5))
}

/// Where a panel lies and what its axes show.
struct Frame<'a> {
    figure: &'a Figure,
    index: usize,
    x_limits: (f64, f64),
    y_limits: (f64, f64),
    height: f64,
}

impl<'a> Frame<'a> {
    fn new(figure: &'a Figure, index: usize, y_limits: (f64, f64)) -> Self {
        let plot = if figure.rows.is_empty() {
            PANEL_HEIGHT
        } else {
            ROW_HEIGHT * figure.rows.len() as f64
        };
        let mut frame = Frame {
            figure,
            index,
            x_limits: figure.x_limits(),
            y_limits,
            height: plot,
        };
        frame.height += frame.above() + frame.below();
        frame
    }

    fn lies(&self) -> bool {
        !self.figure.rows.is_empty()
    }

    fn has_x_axis(&self) -> bool {
        self.lies() || self.index + 1 == self.figure.panels.len()
    }

    fn above(&self) -> f64 {
        let titled = |p: &Panel| !p.title.is_empty();
        // Panels side by side begin at the same height.
        let titled = if self.lies() {
            self.figure.panels.iter().any(titled)
        } else {
            titled(&self.figure.panels[self.index])
        };
        if titled { TITLE_ROOM } else { GAP }
    }

    fn below(&self) -> f64 {
        if self.has_x_axis() { AXIS_ROOM } else { GAP }
    }

    fn layout(&self, panel: &Panel) -> Layout {
        let (across, up) = if self.lies() {
            (self.y_limits, self.x_limits)
        } else {
            (self.x_limits, self.y_limits)
        };
        let left = match (self.lies(), self.index) {
            (true, 0) => names_room(self.figure),
            (true, _) => RIGHT,
            (false, _) => LEFT,
        };
        let mut layout = Layout::new(across, up)
            .with_clamp_axis()
            .with_x_axis_min(across.0)
            .with_x_axis_max(across.1)
            .with_y_axis_min(up.0)
            .with_y_axis_max(up.1)
            .with_force_margins(left, RIGHT)
            .with_force_margins_y(self.above(), self.below())
            .with_box_axes()
            .with_title_size(TEXT_SIZE)
            .with_label_size(TEXT_SIZE)
            .with_tick_size(TICK_TEXT_SIZE)
            .with_body_size(TEXT_SIZE)
            .with_font_family("sans-serif");
        if !panel.title.is_empty() {
            layout = layout.with_title(&panel.title);
        }
        if self.lies() {
            let names = self.figure.rows.iter().rev().cloned().collect();
            layout = layout.with_x_label(&panel.y.label).with_y_categories(names);
            layout.suppress_y_ticks = self.index > 0;
            return layout;
        }
        layout = layout.with_y_label(&panel.y.label);
        if self.has_x_axis() {
            layout = layout.with_x_label(&self.figure.x.label);
        }
        layout.suppress_x_ticks = !self.has_x_axis();
        for band in &self.figure.bands {
            let (from, to) = (band.from.max(across.0), band.to.min(across.1));
            if from < to {
                let region = ShadedRegion::vertical(from, to).with_color("#000000");
                layout = layout.with_shaded_region(region.with_opacity(band_opacity(band.dark)));
            }
        }
        if up.0 < 0.0 && up.1 > 0.0 {
            let zero = ReferenceLine::horizontal(0.0).with_color(style::MARKER);
            layout = layout.with_reference_line(zero.with_dasharray("").with_stroke_width(0.6));
        }
        for marker in self
            .figure
            .markers
            .iter()
            .filter(|m| m.x >= across.0 && m.x <= across.1)
        {
            let line = ReferenceLine::vertical(marker.x).with_color(style::MARKER);
            layout = layout.with_reference_line(line.with_dasharray("2 2").with_stroke_width(1.5));
        }
        layout
    }

    fn plots(&self, panel: &Panel) -> Vec<Plot> {
        panel
            .series
            .iter()
            .flat_map(|series| self.plots_of(series))
            .collect()
    }

    fn plots_of(&self, series: &Series) -> Vec<Plot> {
        let style = style::of(series.style);
        match &series.mark {
            Mark::Line if self.lies() => vec![line(self.places(series), style, style.dash, style.width)],
            Mark::Line => self.lines(series),
            Mark::Dots => vec![self.dots(style).with_data(self.places(series)).into()],
            Mark::Whiskers(ends) => {
                let finite = series.points.iter().zip(ends).filter(|(p, _)| p.1.is_finite());
                let (points, ends): (Vec<(f64, f64)>, Vec<[f64; 2]>) = finite.map(|(p, e)| (*p, *e)).unzip();
                let arms = points
                    .iter()
                    .zip(&ends)
                    .map(|(p, [low, high])| (p.1 - low, high - p.1));
                let dots = self.dots(style).with_data(points.iter().copied());
                vec![dots.with_y_err_asymmetric(arms).into()]
            }
            Mark::Stems if self.lies() => {
                let places = self.places(series);
                let stem = |(x, y): &(f64, f64)| line(vec![(0.0, *y), (*x, *y)], style, "", STEM_WIDTH);
                let dots = ScatterPlot::new().with_color(style.colour).with_size(STEM_DOT);
                places
                    .iter()
                    .map(stem)
                    .chain([dots.with_data(places.clone()).into()])
                    .collect()
            }
            Mark::Stems => {
                let stems = LollipopPlot::new()
                    .with_points(self.places(series))
                    .with_color(style.colour);
                vec![Plot::Lollipop(
                    stems.with_dot_radius(STEM_DOT).with_stem_width(STEM_WIDTH),
                )]
            }
            Mark::Interval(upper) => polyline::pieces(&series.points, upper)
                .into_iter()
                .map(|piece| {
                    let piece = polyline::thin_area(piece, MOST_AREA_POINTS);
                    let column = |i: usize| piece.iter().map(move |p| p[i]);
                    let band = BandPlot::new(column(0), column(1), column(2)).with_color(style.colour);
                    Plot::Band(band.with_opacity(INTERVAL_OPACITY))
                })
                .collect(),
        }
    }

    fn dots(&self, style: &style::Style) -> ScatterPlot {
        ScatterPlot::new()
            .with_color(style.colour)
            .with_marker(style.marker)
            .with_size(3.6)
    }

    /// Finite points, as they lie on the page.
    fn places(&self, series: &Series) -> Vec<(f64, f64)> {
        let last = self.figure.rows.len() as f64 + 1.0;
        let finite = series
            .points
            .iter()
            .copied()
            .filter(|p| p.0.is_finite() && p.1.is_finite());
        finite
            .map(|(x, y)| if self.lies() { (y, last - x) } else { (x, y) })
            .collect()
    }

    fn lines(&self, series: &Series) -> Vec<Plot> {
        let style = style::of(series.style);
        let scale = |(low, high): (f64, f64), length: f64| length / (high - low);
        let (x_scale, y_scale) = (
            scale(self.x_limits, PAGE_WIDTH - LEFT - RIGHT),
            scale(self.y_limits, PANEL_HEIGHT),
        );
        let mut plots = Vec::new();
        for piece in polyline::in_view(&series.points, self.x_limits) {
            let on_page: Vec<_> = polyline::thin(piece, MOST_POINTS)
                .into_iter()
                .map(|(x, y)| (x * x_scale, y * y_scale))
                .collect();
            let on_page = polyline::simplify(&on_page, TOLERANCE);
            let scribble = polyline::length(&on_page) > SCRIBBLE;
            let (dash, width) = if scribble {
                ("", SCRIBBLE_WIDTH)
            } else {
                (style.dash, style.width)
            };
            let data = on_page
                .into_iter()
                .map(|(x, y)| (x / x_scale, y / y_scale))
                .collect();
            plots.push(line(data, style, dash, width));
        }
        plots
    }
}

fn line(points: Vec<(f64, f64)>, style: &style::Style, dash: &str, width: f64) -> Plot {
    let line = LinePlot::new()
        .with_data(points)
        .with_color(style.colour)
        .with_stroke_width(width);
    Plot::Line(match dash {
        "" => line,
        dash => line.with_line_style(LineStyle::Custom(dash.into())),
    })
}
