//! Figures: panels over one shared axis, drawn as SVG; the PNG is that SVG, rasterised.
//!
//! A [`Figure`] is plain data: fill it and call [`Figure::to_svg`]. The SVG is the one
//! drawing: a PNG is made from its text by `png` (a feature of that name), so the two cannot differ. Limits are given or taken from the data that
//! are in view. A series breaks where a value is not finite, and is thinned without losing a peak (`thin`). Colours (Okabe
//! and Ito 2008) are told apart by colour-blind readers, and dashes, widths and markers in grey print. The font of
//! the PNG is built in, so that no machine needs one.
//!
//! Symbols in its words, such as `K_hg`, get their subscripts when it is drawn.
//!
//! Terms: a *series* is a row of points with a [`Mark`] that says how they are drawn; a *band* is a shaded stretch
//! of the shared axis; a *marker* is one place on it. A figure of *rows* has names in place of numbers on its
//! shared axis, and lies on its side, so that long names can be read; its panels stand side by side. What in it lies beyond given limits stands at the
//! frame as a number with an arrow.
//!
//! The drawing itself is done by the crates `kuva` (SVG) and `resvg` (pixels). What to plot is decided by studies,
//! and files are written by `document`, NOT here.

mod draw;
mod frame;
mod legend;
mod page;
mod pages;
mod polyline;
#[cfg(any(test, feature = "png"))]
mod raster;
mod style;
mod thin;
mod typeset;

pub(crate) use style::{colour, dash, width};
pub(crate) use typeset::units;

use serde::Serialize;

/// A drawing of panels that share an axis.
#[derive(Debug, Clone, Default)]
pub struct Figure {
    /// Drawn above everything; may be empty.
    pub title: String,
    /// The shared axis.
    pub x: Axis,
    /// Names of the places 1, 2, .. on the shared axis, if it has names. The figure then lies on its side.
    pub rows: Vec<String>,
    /// Whether all panels have the same limits for their values.
    pub same_y: bool,
    /// From top to bottom; from left to right, in lines, in a figure of rows.
    pub panels: Vec<Panel>,
    /// Lines through all panels.
    pub markers: Vec<Marker>,
    /// Shaded stretches behind all panels.
    pub bands: Vec<Band>,
}

/// What an axis shows.
#[derive(Debug, Clone, Default)]
pub struct Axis {
    /// Quantity and unit.
    pub(crate) label: String,
    /// Lower and upper end; `None` takes them from the data.
    pub limits: Option<(f64, f64)>,
    /// Whether only whole numbers mean anything on it.
    pub(crate) whole: bool,
}

impl Axis {
    /// An axis of a quantity with its unit, `-` if that is 1; limits from the data.
    pub fn new(quantity: &str, unit: &str) -> Self {
        Self {
            label: format!("{quantity} ({unit})"),
            ..Self::default()
        }
    }

    /// An axis of things that are counted, such as participants: only whole numbers mean anything on it.
    pub fn counting(things: &str) -> Self {
        Self {
            label: things.into(),
            limits: None,
            whole: true,
        }
    }

    /// The axis from one end to the other.
    #[must_use]
    pub fn within(self, low: f64, high: f64) -> Self {
        Self {
            limits: Some((low, high)),
            ..self
        }
    }

    /// The axis around these places, which are the middles of fields of a map.
    pub fn around(self, places: &[f64]) -> Self {
        let half = 0.5 * (places[1] - places[0]);
        self.within(places[0] - half, places[places.len() - 1] + half)
    }

    /// A plot of these series over this axis of their values, without a title.
    pub fn panel(self, series: impl IntoIterator<Item = Series>) -> Panel {
        Panel::new("", self, series)
    }

    /// A figure of these panels, which share this axis.
    pub fn figure(self, panels: impl IntoIterator<Item = Panel>) -> Figure {
        Figure {
            x: self,
            panels: panels.into_iter().collect(),
            ..Figure::default()
        }
    }
}

/// One plot of a figure.
#[derive(Debug, Clone, Default)]
pub struct Panel {
    /// Drawn above the panel; may be empty.
    pub title: String,
    /// The panel's own axis, of the values.
    pub y: Axis,
    /// In drawing order: the last lies on top.
    pub series: Vec<Series>,
}

impl Panel {
    /// A plot of these series.
    pub fn new(title: impl Into<String>, y: Axis, series: impl IntoIterator<Item = Series>) -> Self {
        let (title, series) = (title.into(), series.into_iter().collect());
        Self { title, y, series }
    }

    /// Width and height of its fields, if it is a map.
    fn fields(&self) -> Option<[f64; 2]> {
        self.series.iter().find_map(|series| match series.mark {
            Mark::Fields { size, .. } => Some(size),
            _ => None,
        })
    }
}

/// How the points of a series are drawn.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Mark {
    /// Joined by straight lines; the line breaks where a value is not finite.
    #[default]
    Line,
    /// Each by itself.
    Dots,
    /// Each by itself, with the interval that belongs to it.
    Whiskers(Vec<[f64; 2]>),
    /// Each with a stem to zero.
    Stems,
    /// A shaded area from the points up to these values.
    Interval(Vec<f64>),
    /// Each by itself: the most that a value may be, of which nothing else is known.
    Bounds,
    /// Each by itself: where a line ends before its time. The label says why.
    Ends,
    /// Each a field of a map with its middle there.
    Fields {
        /// Width and height.
        size: [f64; 2],
        /// How strong the colour of each is, from 0 to 1, and what is written in it.
        shown: Vec<(f64, String)>,
    },
}

/// Points of one meaning. Series of the same label share one legend entry, so give them the same style.
#[derive(Debug, Clone, Default)]
pub struct Series {
    /// Name in the legend; empty for none.
    pub label: String,
    /// Colour, dash and marker, from 0; after seven they repeat. Style 0 is the widest line, for what the
    /// others are compared with: a line that coincides with it lies visibly upon it.
    pub style: usize,
    /// How the points are drawn.
    pub mark: Mark,
    /// Place on the shared axis, and value.
    pub points: Vec<(f64, f64)>,
    /// Whether a line joins points that are drawn each by itself.
    pub joined: bool,
}

impl Series {
    /// A line through values at places.
    pub fn through(label: &str, style: usize, x: &[f64], y: &[f64]) -> Self {
        Self::line(label, style, x.iter().copied().zip(y.iter().copied()).collect())
    }

    /// A line.
    pub fn line(label: &str, style: usize, points: Vec<(f64, f64)>) -> Self {
        Self::with_mark(label, style, Mark::Line, points)
    }

    /// Dots.
    pub fn dots(label: &str, style: usize, points: Vec<(f64, f64)>) -> Self {
        Self::with_mark(label, style, Mark::Dots, points)
    }

    /// Points, each with its interval.
    pub fn whiskers(
        label: &str,
        style: usize,
        found: impl IntoIterator<Item = ((f64, f64), [f64; 2])>,
    ) -> Self {
        let (points, ends) = found.into_iter().unzip();
        Self::with_mark(label, style, Mark::Whiskers(ends), points)
    }

    /// An area between the values of `[low, high]`.
    pub fn interval(label: &str, style: usize, x: &[f64], ends: &[[f64; 2]]) -> Self {
        let lows = x.iter().zip(ends).map(|(x, [low, _])| (*x, *low)).collect();
        let highs = ends.iter().map(|[_, high]| *high).collect();
        Self::with_mark(label, style, Mark::Interval(highs), lows)
    }

    /// Points of any mark.
    pub fn with_mark(label: &str, style: usize, mark: Mark, points: Vec<(f64, f64)>) -> Self {
        Self {
            label: label.into(),
            style,
            mark,
            points,
            joined: false,
        }
    }

    /// The series with its points joined by a line, which breaks where a value is not finite.
    #[must_use]
    pub fn joined(self) -> Self {
        Self { joined: true, ..self }
    }

    /// Every value that is drawn between two places.
    fn values_within(&self, (left, right): (f64, f64)) -> impl Iterator<Item = f64> {
        let inside = move |x: f64| (left..=right).contains(&x);
        let own = self.points.iter().filter(move |p| inside(p.0)).map(|p| p.1);
        let (uppers, whiskers): (&[f64], &[[f64; 2]]) = match &self.mark {
            Mark::Interval(upper) => (upper, &[]),
            Mark::Whiskers(ends) => (&[], ends),
            Mark::Line | Mark::Dots | Mark::Stems | Mark::Bounds | Mark::Ends | Mark::Fields { .. } => {
                (&[], &[])
            }
        };
        let inner = move |i: usize| self.points.get(i).is_some_and(|p| inside(p.0));
        let upper = (0..).zip(uppers).filter(move |(i, _)| inner(*i)).map(|(_, v)| *v);
        let ends = (0..)
            .zip(whiskers)
            .filter(move |(i, _)| inner(*i))
            .flat_map(|(_, v)| *v);
        let zero = matches!(self.mark, Mark::Stems | Mark::Bounds).then_some(0.0);
        own.chain(upper).chain(ends).chain(zero)
    }
}

/// An instant or a place.
#[derive(Debug, Clone, Default)]
pub struct Marker {
    /// Name in the legend.
    pub label: String,
    /// Where.
    pub x: f64,
}

impl Marker {
    /// A line through all panels.
    pub fn new(label: &str, x: f64) -> Self {
        let label = label.into();
        Self { label, x }
    }
}

/// A stretch of the shared axis.
#[derive(Debug, Clone, Default)]
pub struct Band {
    /// Name in the legend; bands of one name share an entry.
    pub label: String,
    /// Start.
    pub from: f64,
    /// End.
    pub to: f64,
    /// How it is shaded.
    pub shade: Shade,
    /// The one panel that it is in; in all of them if none is named.
    pub panel: Option<usize>,
}

impl Band {
    /// A band through all panels.
    pub fn new(label: impl Into<String>, [from, to]: [f64; 2], shade: Shade) -> Self {
        let (label, panel) = (label.into(), None);
        Self {
            label,
            from,
            to,
            shade,
            panel,
        }
    }

    /// Whether it is in a panel.
    pub(crate) fn is_in(&self, panel: usize) -> bool {
        self.panel.is_none_or(|own| own == panel)
    }
}

/// How a stretch is shaded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Shade {
    /// A breath of grey.
    #[default]
    Light,
    /// Grey.
    Dark,
    /// A colour, for what nobody may overlook.
    Alert,
}

/// An SVG as a PNG with twice as many pixels along each side as the SVG has points.
///
/// # Errors
/// What is no SVG, or has no area.
#[cfg(any(test, feature = "png"))]
pub fn png(svg: &str) -> Result<Vec<u8>, PlotError> {
    raster::png(svg).map_err(|e| PlotError(e.to_string()))
}

/// Why a figure could not be drawn.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct PlotError(String);

/// Room left between a series and the frame, as a share of the extent of the values.
const MARGIN: f64 = 0.05;
/// Panels of a figure of rows that a page has room for beside each other.
const MOST_COLUMNS: usize = 3;
/// Room left behind a line that ends before its time, as a share of the extent.
const ROOM_BEHIND: f64 = 0.02;

impl Figure {
    /// A figure of rows with these names.
    pub fn of_rows<N: Into<String>>(
        names: impl IntoIterator<Item = N>,
        panels: impl IntoIterator<Item = Panel>,
    ) -> Self {
        Self {
            rows: names.into_iter().map(Into::into).collect(),
            ..Axis::default().figure(panels)
        }
    }

    /// The figure as an SVG document.
    ///
    /// # Errors
    /// A given limit is not finite, or does not lie below its upper one.
    pub fn to_svg(&self) -> Result<String, PlotError> {
        self.check_limits()?;
        Ok(draw::svg(&self.clone().thinned()))
    }

    /// Ends of the shared axis: as given, else of the data; (0, 1) if there is none.
    pub fn x_limits(&self) -> (f64, f64) {
        if !self.rows.is_empty() {
            return (0.5, self.rows.len() as f64 + 0.5);
        }
        let points = self.panels.iter().flat_map(|p| &p.series).flat_map(|s| &s.points);
        let of_data = || match extent(points.filter(|p| p.1.is_finite()).map(|p| p.0)) {
            Some((low, high)) if low < high && self.has_lines() => {
                // A line that ends before its time ends within the frame.
                let behind = if self.has_ends() { ROOM_BEHIND } else { 0.0 };
                (low, high + behind * (high - low))
            }
            // A dot or a stem stands free of the frame.
            Some((low, high)) if self.x.whole || low == high => (low - 0.5, high + 0.5),
            Some((low, high)) => (low - MARGIN * (high - low), high + MARGIN * (high - low)),
            None => (0.0, 1.0),
        };
        self.x.limits.unwrap_or_else(of_data)
    }

    /// Panels beside each other: of a figure of rows at most three, as evenly as they fill their lines.
    fn columns(&self) -> usize {
        let panels = self.panels.len().max(1);
        match self.rows.is_empty() {
            true => 1,
            false => panels.div_ceil(panels.div_ceil(MOST_COLUMNS)),
        }
    }

    /// Lines of panels.
    fn lines(&self) -> usize {
        self.panels.len().max(1).div_ceil(self.columns())
    }

    /// What the values of all panels of a figure of rows are, if they are one thing: it is written once, below all.
    fn shared_label(&self) -> Option<&str> {
        let label = &self.panels.first()?.y.label;
        let shared = self.panels.len() > 1 && self.panels.iter().all(|panel| panel.y.label == *label);
        (shared && !self.rows.is_empty()).then_some(label)
    }

    /// Whether any series has such a mark.
    pub fn has(&self, such: impl Fn(&Mark) -> bool) -> bool {
        let mut series = self.panels.iter().flat_map(|p| &p.series);
        series.any(|s| such(&s.mark))
    }

    fn has_ends(&self) -> bool {
        self.has(|mark| *mark == Mark::Ends)
    }

    fn has_lines(&self) -> bool {
        !self.has(|mark| !matches!(mark, Mark::Line | Mark::Interval(_) | Mark::Ends))
    }

    /// Ends of each panel's values: as given, else of the data in view (of all panels if [`Figure::same_y`]), with
    /// a little margin.
    pub fn y_limits(&self) -> Vec<(f64, f64)> {
        let x = self.x_limits();
        let visible = |panel: &Panel| extent(panel.series.iter().flat_map(|s| s.values_within(x)));
        let extents: Vec<_> = self.panels.iter().map(visible).collect();
        let of_all = extent(extents.iter().flatten().flat_map(|&(low, high)| [low, high]));
        let in_rows = !self.rows.is_empty() && self.has(|mark| matches!(mark, Mark::Stems | Mark::Bounds));
        let stands = (self.has_lines() || in_rows) && !self.has_ends();
        let limits = |(panel, own): (&Panel, &Option<(f64, f64)>)| {
            let data = if self.same_y { of_all } else { *own };
            panel.y.limits.unwrap_or_else(|| with_room(data, stands))
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

/// Smallest and largest finite value.
fn extent(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values
        .filter(|v| v.is_finite())
        .fold(None, |extent, v| match extent {
            None => Some((v, v)),
            Some((low, high)) => Some((low.min(v), high.max(v))),
        })
}

/// Limits that hold `extent` with margin; a single value gets half of itself on both sides, no value or zero (-1, 1). What
/// starts from zero may stand on the frame if it `stands` there, as lines do; a dot would be cut.
fn with_room(extent: Option<(f64, f64)>, stands: bool) -> (f64, f64) {
    match extent {
        None | Some((0.0, 0.0)) => (-1.0, 1.0),
        Some((low, high)) if low == high => (low - 0.5 * low.abs(), high + 0.5 * high.abs()),
        Some((low, high)) => {
            let margin = MARGIN * (high - low);
            let room_at = |end: f64| if stands && end == 0.0 { 0.0 } else { margin };
            (low - room_at(low), high + room_at(high))
        }
    }
}

#[cfg(test)]
mod pixel_tests;
#[cfg(test)]
mod tests;
