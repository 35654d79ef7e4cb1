//! One panel: where it lies, what its axes show, and its series as the drawing library wants them.

use kuva::plot::annotations::{ReferenceLine, ShadedRegion};
use kuva::plot::{BandPlot, LinePlot, LineStyle, LollipopPlot, ScatterPlot};
use kuva::render::layout::Layout;
use kuva::render::plots::Plot;

use super::draw::{INTERVAL_OPACITY, LEFT, PAGE_WIDTH, PANEL_HEIGHT, RIGHT, STEM_DOT, TEXT_SIZE, names_room};
use super::{Figure, Mark, Panel, Series, polyline, style};

/// Height of a row of names.
const ROW_HEIGHT: f64 = 15.0;
/// Below a panel with and without tick labels and axis label, and above one with and without title.
const AXIS_ROOM: f64 = 52.0;
const GAP: f64 = 8.0;
const TITLE_ROOM: f64 = 34.0;
const TICK_TEXT_SIZE: u32 = 12;

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
/// A whole axis no longer than this has a tick at every number.
const MOST_WHOLE_TICKS: f64 = 20.0;
const STEM_WIDTH: f64 = 1.2;

/// Where a panel lies and what its axes show.
pub(super) struct Frame<'a> {
    figure: &'a Figure,
    index: usize,
    x_limits: (f64, f64),
    y_limits: (f64, f64),
    pub(super) height: f64,
}

impl<'a> Frame<'a> {
    pub(super) fn new(figure: &'a Figure, index: usize, y_limits: (f64, f64)) -> Self {
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

    pub(super) fn layout(&self, panel: &Panel) -> Layout {
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
        if self.figure.x.whole && across.1 - across.0 <= MOST_WHOLE_TICKS {
            layout = layout.with_x_tick_step(1.0);
        }
        if self.has_x_axis() {
            layout = layout.with_x_label(&self.figure.x.label);
        }
        layout.suppress_x_ticks = !self.has_x_axis();
        for band in self.figure.bands.iter().filter(|band| band.is_in(self.index)) {
            let (from, to) = (band.from.max(across.0), band.to.min(across.1));
            if from < to {
                let (colour, opacity) = style::of_shade(band.shade);
                let region = ShadedRegion::vertical(from, to).with_color(colour);
                layout = layout.with_shaded_region(region.with_opacity(opacity));
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

    pub(super) fn plots(&self, panel: &Panel) -> Vec<Plot> {
        let plots: Vec<_> = panel
            .series
            .iter()
            .flat_map(|series| self.plots_of(series))
            .collect();
        // A panel without anything is not drawn at all; one with an empty line has its frame.
        if plots.is_empty() {
            vec![Plot::Line(LinePlot::new())]
        } else {
            plots
        }
    }

    fn plots_of(&self, series: &Series) -> Vec<Plot> {
        let style = style::of(series.style);
        match &series.mark {
            Mark::Line if self.lies() => vec![line(self.places(series), style, style.dash, style.width)],
            Mark::Line => self.lines(series),
            Mark::Dots => vec![self.dots(style).with_data(self.places(series)).into()],
            Mark::Whiskers(ends) => {
                let whole = series
                    .points
                    .iter()
                    .zip(ends)
                    .filter(|(p, _)| p.0.is_finite() && p.1.is_finite());
                let arms = whole.map(|(p, [low, high])| (p.1 - low, high - p.1));
                let dots = self.dots(style).with_data(self.places(series));
                vec![
                    if self.lies() {
                        dots.with_x_err_asymmetric(arms)
                    } else {
                        dots.with_y_err_asymmetric(arms)
                    }
                    .into(),
                ]
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
        let on_page = |piece| {
            let thinned = polyline::thin(piece, MOST_POINTS).into_iter();
            let scaled: Vec<_> = thinned.map(|(x, y)| (x * x_scale, y * y_scale)).collect();
            polyline::simplify(&scaled, TOLERANCE)
        };
        let pieces: Vec<_> = polyline::in_view(&series.points, self.x_limits)
            .into_iter()
            .map(on_page)
            .collect();
        // All pieces of a series look alike.
        let scribble = pieces.iter().map(|p| polyline::length(p)).sum::<f64>() > SCRIBBLE;
        let (dash, width) = if scribble {
            ("", SCRIBBLE_WIDTH)
        } else {
            (style.dash, style.width)
        };
        let on_axes = |piece: Vec<(f64, f64)>| {
            let data = piece.into_iter().map(|(x, y)| (x / x_scale, y / y_scale));
            line(data.collect(), style, dash, width)
        };
        pieces.into_iter().map(on_axes).collect()
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
