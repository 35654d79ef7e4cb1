//! The legend: each entry is drawn by what draws the series, so that it cannot look different.

use kuva::plot::BandPlot;
use kuva::render::layout::Layout;
use kuva::render::plots::Plot;
use kuva::render::render::{Primitive, TextAnchor};

use super::frame::{Frame, INTERVAL_OPACITY, bounds, dots, ends, line, marker, stems, whiskers};
use super::page::{LEFT, LETTER, PAGE_WIDTH, RIGHT, TEXT_SIZE, fixed, text};
use super::{Figure, Mark, Series, Shade, style};

const LINE_HEIGHT: f64 = 22.0;
const ABOVE: f64 = 10.0;
const BELOW: f64 = 4.0;
/// Length of what is drawn before a name: three times the longest dash with its gap.
const SWATCH: f64 = 40.0;
const GAP: f64 = 8.0;

/// What an entry explains.
enum What<'a> {
    /// A series, with the frame of its panel.
    Series(&'a Series, &'a Frame<'a>),
    Marker,
    Band {
        shade: Shade,
    },
}

struct Entry<'a> {
    name: &'a str,
    what: What<'a>,
    /// Left end, and line from above.
    x: f64,
    line: usize,
}

pub(super) struct Legend<'a> {
    entries: Vec<Entry<'a>>,
    lies: bool,
}

impl<'a> Legend<'a> {
    /// Each name once, in lines; none if nothing has a name.
    pub(super) fn new(figure: &'a Figure, frames: &'a [Frame<'a>]) -> Option<Self> {
        let panels = figure.panels.iter().zip(frames);
        let series = panels.flat_map(|(panel, frame)| panel.series.iter().map(move |s| (s, frame)));
        let named = series
            .map(|(s, frame)| (s.label.as_str(), What::Series(s, frame)))
            .chain(figure.markers.iter().map(|m| (m.label.as_str(), What::Marker)))
            .chain(
                figure
                    .bands
                    .iter()
                    .map(|b| (b.label.as_str(), What::Band { shade: b.shade })),
            );
        let mut entries: Vec<Entry> = Vec::new();
        let (mut x, mut line) = (0.0, 0);
        for (name, what) in named {
            if name.is_empty() || entries.iter().any(|e| e.name == name) {
                continue;
            }
            let length = SWATCH + GAP + LETTER * name.chars().count() as f64;
            if x > 0.0 && x + length > width() {
                (x, line) = (0.0, line + 1);
            }
            entries.push(Entry { name, what, x, line });
            x += length + 2.0 * GAP;
        }
        (!entries.is_empty()).then_some(Self {
            entries,
            lies: !figure.rows.is_empty(),
        })
    }

    fn inner_height(&self) -> f64 {
        LINE_HEIGHT * self.entries.last().map_or(0.0, |last| last.line as f64 + 1.0)
    }

    pub(super) fn height(&self) -> f64 {
        ABOVE + self.inner_height() + BELOW
    }

    /// A panel whose units are points of the page, without axes.
    pub(super) fn layout(&self) -> Layout {
        let (x, y) = ((0.0, width()), (0.0, self.inner_height()));
        let mut layout = fixed(x, y, [LEFT, ABOVE, BELOW])
            .with_show_grid(false)
            .with_axis_line_width(0.0)
            .with_tick_width(0.0);
        (layout.suppress_x_ticks, layout.suppress_y_ticks) = (true, true);
        layout
    }

    /// Middle of an entry, from the lower edge of the panel.
    fn middle(&self, entry: &Entry) -> f64 {
        self.inner_height() - LINE_HEIGHT * (entry.line as f64 + 0.5)
    }

    pub(super) fn plots(&self) -> Vec<Plot> {
        let swatch = |entry: &Entry| {
            let (x, y) = (entry.x, self.middle(entry));
            match entry.what {
                What::Series(series, frame) => self.swatch(series, frame, x, y),
                What::Marker => {
                    let x = x + 0.5 * SWATCH;
                    vec![marker(vec![(x, y - 9.0), (x, y + 9.0)])]
                }
                What::Band { shade } => {
                    let (colour, opacity) = style::of_shade(shade);
                    vec![block(x, y, colour, opacity)]
                }
            }
        };
        self.entries.iter().flat_map(swatch).collect()
    }

    /// The names; `top` is the upper edge of the legend on the page.
    pub(super) fn names(&self, left: f64, top: f64) -> impl Iterator<Item = Primitive> {
        self.entries.iter().map(move |entry| {
            let x = left + LEFT + entry.x + SWATCH + GAP;
            let y = top + ABOVE + self.inner_height() - self.middle(entry);
            text(x, y, entry.name, TEXT_SIZE, TextAnchor::Start, "#000000")
        })
    }

    fn swatch(&self, series: &Series, frame: &Frame, x: f64, y: f64) -> Vec<Plot> {
        let style = style::by_index(series.style);
        let middle = x + 0.5 * SWATCH;
        let mut plots = Vec::new();
        if series.joined || series.mark == Mark::Line {
            let (dash, width) = frame.line_style(series);
            plots.push(line(vec![(x, y), (x + SWATCH, y)], style, dash, width));
        }
        let stem = [[(x, y), (x + 0.7 * SWATCH, y)]];
        plots.extend(match &series.mark {
            Mark::Line => Vec::new(),
            Mark::Dots => vec![dots(style).with_data([(middle, y)]).into()],
            Mark::Whiskers(_) => vec![whiskers(style, self.lies, &[(middle, y)], [(8.0, 8.0)])],
            Mark::Stems => stems(style, &stem),
            Mark::Bounds => bounds(style, &stem, 7.0),
            Mark::Ends => vec![ends(style).with_data([(middle, y)]).into()],
            Mark::Interval(_) => vec![block(x, y, style.colour, INTERVAL_OPACITY)],
            Mark::Fields { .. } => vec![block(x, y, style.colour, 0.6)],
        });
        plots
    }
}

/// Width of the panel of the legend.
fn width() -> f64 {
    PAGE_WIDTH - LEFT - RIGHT
}

fn block(x: f64, y: f64, colour: &str, opacity: f64) -> Plot {
    let ends = [x + 0.25 * SWATCH, x + 0.75 * SWATCH];
    let band = BandPlot::new(ends, [y - 7.0; 2], [y + 7.0; 2]).with_color(colour);
    Plot::Band(band.with_opacity(opacity))
}
