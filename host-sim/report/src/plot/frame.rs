//! One panel: where it lies, what its axes show, and its series as the drawing library wants them.

use kuva::plot::annotations::{ReferenceLine, ShadedRegion};
use kuva::plot::scatter::MarkerShape;
use kuva::plot::{BandPlot, LinePlot, LineStyle, ScatterPlot};
use kuva::render::layout::Layout;
use kuva::render::plots::Plot;
use kuva::render::render::{Primitive, TextAnchor};

use super::page::{LEFT, LETTER, PAGE_WIDTH, PANEL_HEIGHT, RIGHT, TEXT_SIZE, fixed, names_room, text};
use super::style::Style;
use super::{Figure, Mark, Marker, Panel, Series, polyline, style};

/// Height of a row of names.
const ROW_HEIGHT: f64 = 15.0;
/// Height of a row from which lines lead to the next.
const JOINED_ROW_HEIGHT: f64 = 44.0;
/// Height of a row of fields.
const FIELD_HEIGHT: f64 = 24.0;
/// Below a panel with tick labels and axis label, with the first alone, and with neither; above one with and without title.
const AXIS_ROOM: f64 = 52.0;
const TICK_ROOM: f64 = 28.0;
const GAP: f64 = 8.0;
const TITLE_ROOM: f64 = 34.0;
const TICK_TEXT_SIZE: u32 = 12;

/// How far a drawn line may be from the data, points.
const TOLERANCE: f64 = 0.15;
/// Beyond five page widths a line is a scribble. Its dashes could not be read, and a wide line would be a blot: it is
/// drawn solid and thin.
const SCRIBBLE: f64 = 5.0 * PAGE_WIDTH;
const SCRIBBLE_WIDTH: f64 = 1.0;
/// A whole axis no longer than this has a tick at every number.
const MOST_WHOLE_TICKS: f64 = 20.0;
const STEM_WIDTH: f64 = 1.2;
const STEM_DOT: f64 = 2.2;
/// Half the length of the stroke at a bound, in rows.
const BOUND: f64 = 0.3;
const MARKER_WIDTH: f64 = 1.5;
const DOTTED: &str = "2 2";
pub(super) const INTERVAL_OPACITY: f64 = 0.25;

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
        let plot = match figure.panels[index].fields() {
            Some([_, height]) => FIELD_HEIGHT * ((y_limits.1 - y_limits.0) / height).round(),
            None if figure.rows.is_empty() => PANEL_HEIGHT,
            None => row_height(figure) * figure.rows.len() as f64,
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

    fn left(&self) -> f64 {
        match (self.lies(), self.index % self.figure.columns()) {
            (true, 0) => names_room(self.figure),
            (true, _) => RIGHT,
            (false, _) => LEFT,
        }
    }

    fn below(&self) -> f64 {
        let is_last = self.index / self.figure.columns() + 1 == self.figure.lines();
        match self.has_x_axis() {
            false => GAP,
            true if self.figure.shared_label().is_some() && !is_last => TICK_ROOM,
            true => AXIS_ROOM,
        }
    }

    pub(super) fn layout(&self, panel: &Panel) -> Layout {
        let (across, up) = if self.lies() {
            (self.y_limits, self.x_limits)
        } else {
            (self.x_limits, self.y_limits)
        };
        let mut layout = fixed(across, up, [self.left(), self.above(), self.below()])
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
            layout = layout.with_y_categories(names);
            if self.figure.shared_label().is_none() {
                layout = layout.with_x_label(&panel.y.label);
            }
            layout.suppress_y_ticks = !self.index.is_multiple_of(self.figure.columns());
            return layout;
        }
        layout = layout.with_y_label(&panel.y.label);
        if let Some([width, height]) = panel.fields() {
            layout = layout
                .with_x_tick_step(width)
                .with_y_tick_step(height)
                .with_show_grid(false);
        }
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
        let is_within = |m: &&Marker| m.x >= across.0 && m.x <= across.1;
        for marker in self.figure.markers.iter().filter(is_within) {
            let line = ReferenceLine::vertical(marker.x).with_color(style::MARKER);
            layout = layout.with_reference_line(line.with_dasharray(DOTTED).with_stroke_width(MARKER_WIDTH));
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
        match plots.is_empty() {
            true => vec![Plot::Line(LinePlot::new())],
            false => plots,
        }
    }

    fn plots_of(&self, series: &Series) -> Vec<Plot> {
        let style = style::by_index(series.style);
        let places = self.places(series);
        let from_zero = || -> Vec<_> {
            let foot = |(x, y): (f64, f64)| if self.lies() { (0.0, y) } else { (x, 0.0) };
            places.iter().map(|place| [foot(*place), *place]).collect()
        };
        let mut plots = match series.mark {
            Mark::Line => self.lines(series),
            _ if series.joined => self.lines(series),
            _ => Vec::new(),
        };
        plots.extend(match &series.mark {
            Mark::Line => Vec::new(),
            Mark::Dots => vec![dots(style).with_data(places).into()],
            Mark::Whiskers(ends) => {
                let known = |(p, _): &(&(f64, f64), _)| p.0.is_finite() && p.1.is_finite();
                let whole = series.points.iter().zip(ends).filter(known);
                let arms = whole.map(|(p, [low, high])| (p.1 - low, high - p.1));
                vec![whiskers(style, self.lies(), &places, arms)]
            }
            Mark::Stems => stems(style, &from_zero()),
            Mark::Bounds => bounds(style, &from_zero(), BOUND),
            Mark::Ends => vec![ends(style).with_data(places).into()],
            Mark::Interval(upper) => polyline::pieces_of_area(&series.points, upper)
                .into_iter()
                .map(|piece| {
                    let column = |i: usize| piece.iter().map(move |p| p[i]);
                    let band = BandPlot::new(column(0), column(1), column(2)).with_color(style.colour);
                    Plot::Band(band.with_opacity(INTERVAL_OPACITY))
                })
                .collect(),
            Mark::Fields {
                size: [width, height],
                shown,
            } => {
                let field = |((x, y), (strength, _)): (&(f64, f64), &(f64, String))| {
                    let x = [x - 0.5 * width, x + 0.5 * width];
                    let y = [y - 0.5 * height, y + 0.5 * height];
                    let band = BandPlot::new(x, [y[0]; 2], [y[1]; 2]).with_color(style.colour);
                    Plot::Band(band.with_opacity(*strength))
                };
                series.points.iter().zip(shown).map(field).collect()
            }
        });
        plots
    }

    /// What stands in words upon the panel, whose cell has its upper left corner at `[x, y]` and this width: the fields of a
    /// map, and in a figure that lies what is beyond its limits.
    pub(super) fn words(&self, panel: &Panel, [x, y]: [f64; 2], width: f64) -> Vec<Primitive> {
        let (left, right) = (x + self.left(), x + width - RIGHT);
        let (top, bottom) = (y + self.above(), y + self.height - self.below());
        let share = |value: f64, (low, high): (f64, f64)| (value - low) / (high - low);
        let mut words = Vec::new();
        // What is beyond in a row stands side by side.
        let mut beyond = vec![right - 4.0; self.figure.rows.len()];
        for series in &panel.series {
            if let Mark::Fields { shown, .. } = &series.mark {
                words.extend(series.points.iter().zip(shown).map(|((x, y), (_, word))| {
                    let x = left + share(*x, self.x_limits) * (right - left);
                    let y = bottom - share(*y, self.y_limits) * (bottom - top);
                    text(x, y, word, TICK_TEXT_SIZE, TextAnchor::Middle, "#000000")
                }));
            }
            let far = |p: &&(f64, f64)| self.lies() && p.1 > self.y_limits.1;
            for (x, value) in series.points.iter().filter(far) {
                let Some(end) = beyond.get_mut((x.round() as usize).wrapping_sub(1)) else {
                    continue;
                };
                let word = format!("{value:.1} \u{2192}");
                let y = top + share(*x, self.x_limits) * (bottom - top);
                let colour = style::by_index(series.style).colour;
                words.push(text(*end, y, &word, TICK_TEXT_SIZE, TextAnchor::End, colour));
                *end -= LETTER * (word.chars().count() + 1) as f64;
            }
        }
        words
    }

    /// Finite points, as they lie on the page.
    fn places(&self, series: &Series) -> Vec<(f64, f64)> {
        let last = self.figure.rows.len() as f64 + 1.0;
        let points = series.points.iter().copied();
        let finite = points.filter(|p| p.0.is_finite() && p.1.is_finite());
        let placed = |(x, y)| if self.lies() { (y, last - x) } else { (x, y) };
        finite.map(placed).collect()
    }

    /// Dash and width of a series' line.
    pub(super) fn line_style(&self, series: &Series) -> (&'static str, f64) {
        let style = style::by_index(series.style);
        // All pieces of a series look alike.
        let length: f64 = self.on_page(series).map(|piece| polyline::length(&piece)).sum();
        if length > SCRIBBLE && !self.lies() {
            ("", SCRIBBLE_WIDTH)
        } else {
            (style.dash, style.width)
        }
    }

    /// Points of the page in a unit of each axis.
    fn scales(&self) -> (f64, f64) {
        let scale = |(low, high): (f64, f64), length: f64| length / (high - low);
        (
            scale(self.x_limits, PAGE_WIDTH - LEFT - RIGHT),
            scale(self.y_limits, PANEL_HEIGHT),
        )
    }

    /// The pieces of a line, in points of the page.
    fn on_page(&self, series: &Series) -> impl Iterator<Item = Vec<(f64, f64)>> {
        let (x_scale, y_scale) = self.scales();
        let scaled =
            move |piece: &[(f64, f64)]| piece.iter().map(|(x, y)| (x * x_scale, y * y_scale)).collect();
        polyline::pieces(&series.points).map(scaled)
    }

    fn lines(&self, series: &Series) -> Vec<Plot> {
        let style = style::by_index(series.style);
        let (dash, width) = self.line_style(series);
        if self.lies() {
            return vec![line(self.places(series), style, dash, width)];
        }
        let (x_scale, y_scale) = self.scales();
        let on_axes = |piece: Vec<(f64, f64)>| {
            let drawn = polyline::simplify(&piece, TOLERANCE).into_iter();
            let data = drawn.map(|(x, y)| (x / x_scale, y / y_scale));
            line(data.collect(), style, dash, width)
        };
        self.on_page(series).map(on_axes).collect()
    }
}

fn row_height(figure: &Figure) -> f64 {
    let mut series = figure.panels.iter().flat_map(|panel| &panel.series);
    match series.any(|series| series.joined) {
        true => JOINED_ROW_HEIGHT,
        false => ROW_HEIGHT,
    }
}

pub(super) fn line(points: Vec<(f64, f64)>, style: &Style, dash: &str, width: f64) -> Plot {
    coloured(points, style.colour, dash, width)
}

/// The line at an instant or a place.
pub(super) fn marker(points: Vec<(f64, f64)>) -> Plot {
    coloured(points, style::MARKER, DOTTED, MARKER_WIDTH)
}

fn coloured(points: Vec<(f64, f64)>, colour: &str, dash: &str, width: f64) -> Plot {
    let line = LinePlot::new()
        .with_data(points)
        .with_color(colour)
        .with_stroke_width(width);
    Plot::Line(match dash {
        "" => line,
        dash => line.with_line_style(LineStyle::Custom(dash.into())),
    })
}

pub(super) fn dots(style: &Style) -> ScatterPlot {
    ScatterPlot::new()
        .with_color(style.colour)
        .with_marker(style.marker)
        .with_size(3.6)
}

/// Crosses where lines end.
pub(super) fn ends(style: &Style) -> ScatterPlot {
    dots(style).with_marker(MarkerShape::Cross).with_size(6.0)
}

/// Dots with arms to both sides.
pub(super) fn whiskers(
    style: &Style,
    lies: bool,
    places: &[(f64, f64)],
    arms: impl IntoIterator<Item = (f64, f64)>,
) -> Plot {
    let dots = dots(style).with_data(places.to_vec());
    if lies {
        dots.with_x_err_asymmetric(arms)
    } else {
        dots.with_y_err_asymmetric(arms)
    }
    .into()
}

/// Dots, each with a stem to its foot.
pub(super) fn stems(style: &Style, stems: &[[(f64, f64); 2]]) -> Vec<Plot> {
    let dots = ScatterPlot::new().with_color(style.colour).with_size(STEM_DOT);
    let stem = |ends: &[(f64, f64); 2]| line(ends.to_vec(), style, "", STEM_WIDTH);
    stems
        .iter()
        .map(stem)
        .chain([dots.with_data(stems.iter().map(|ends| ends[1])).into()])
        .collect()
}

/// Dotted lines up to a stroke across, which reaches `half` to both sides.
pub(super) fn bounds(style: &Style, bounds: &[[(f64, f64); 2]], half: f64) -> Vec<Plot> {
    let bound = |ends: &[(f64, f64); 2]| {
        let (x, y) = ends[1];
        [
            line(ends.to_vec(), style, DOTTED, STEM_WIDTH),
            line(vec![(x, y - half), (x, y + half)], style, "", 2.0 * STEM_WIDTH),
        ]
    };
    bounds.iter().flat_map(bound).collect()
}
