//! Where everything of a figure lies on the page.
//!
//! Sizes are in points of a page 900 points wide; places are in units, of which a point has [`UNIT`].

use super::ink::Key;
use super::{Figure, PlotError, axis, font};
use plotters::style::{FontDesc, FontFamily, FontStyle};

/// Units of the drawing library in a point.
pub(super) const UNIT: i32 = 4;

pub(super) const PAGE_WIDTH: i32 = 900;
pub(super) const MARGIN: i32 = 12;
pub(super) const TITLE_HEIGHT: i32 = 30;
pub(super) const LEGEND_ROW: i32 = 24;
const PANEL_TITLE: i32 = 24;
pub(super) const PANEL_HEIGHT: i32 = 190;
const PANEL_GAP: i32 = 12;
pub(super) const TICK: i32 = 5;
pub(super) const KEY_WIDTH: i32 = 38;

pub(super) const TEXT_SIZE: i32 = 15;
pub(super) const TICK_TEXT_SIZE: i32 = 14;
pub(super) const TITLE_SIZE: i32 = 17;

/// A figure with its limits and the place of everything, in units.
pub(super) struct Page<'a> {
    pub(super) figure: &'a Figure,
    pub(super) font: FontFamily<'static>,
    pub(super) x_limits: (f64, f64),
    pub(super) y_limits: Vec<(f64, f64)>,
    pub(super) left: i32,
    pub(super) right: i32,
    /// Rows of the legend: key, label, place of the key.
    pub(super) legend: Vec<Vec<(Key, &'a str, i32)>>,
    /// Upper end of each panel's plot.
    pub(super) tops: Vec<i32>,
    pub(super) height: i32,
    /// Correction of vertically centred text, downward.
    pub(super) text_drop: i32,
}

impl<'a> Page<'a> {
    pub(super) fn new(figure: &'a Figure) -> Result<Self, PlotError> {
        figure.check_limits()?;
        let mut page = Page {
            figure,
            font: font::register(),
            x_limits: figure.x_limits(),
            y_limits: figure.y_limits(),
            left: 0,
            right: (PAGE_WIDTH - MARGIN - 10) * UNIT,
            legend: Vec::new(),
            tops: Vec::new(),
            height: 0,
            text_drop: 0,
        };
        let widest = page.y_limits.iter().flat_map(|&limits| {
            let (ticks, decimals) = axis::ticks(limits, axis::Y_TICKS);
            ticks.into_iter().map(move |tick| axis::label(tick, decimals))
        });
        let widest = widest
            .map(|label| page.text_width(&label, TICK_TEXT_SIZE))
            .max()
            .unwrap_or(0);
        page.left = widest + (MARGIN + TEXT_SIZE + 12 + TICK + 4) * UNIT;
        page.legend = page.place_legend();

        let mut y = MARGIN * UNIT;
        if !figure.title.is_empty() {
            y += TITLE_HEIGHT * UNIT;
        }
        y += page.legend.len() as i32 * LEGEND_ROW * UNIT;
        for panel in &figure.panels {
            y += if panel.title.is_empty() {
                PANEL_GAP
            } else {
                PANEL_TITLE + PANEL_GAP
            } * UNIT;
            page.tops.push(y);
            y += PANEL_HEIGHT * UNIT;
        }
        page.height = y + (TICK + TICK_TEXT_SIZE + TEXT_SIZE + 12 + MARGIN) * UNIT;
        Ok(page)
    }

    pub(super) fn units(&self) -> (u32, u32) {
        ((PAGE_WIDTH * UNIT) as u32, self.height as u32)
    }

    pub(super) fn font(&self, size: i32, style: FontStyle) -> FontDesc<'static> {
        FontDesc::new(self.font, f64::from(size * UNIT), style)
    }

    pub(super) fn text_width(&self, text: &str, size: i32) -> i32 {
        // Only a missing font fails, and the font is built in.
        self.font(size, FontStyle::Normal)
            .box_size(text)
            .map_or(0, |(width, _)| width as i32)
    }

    fn place_legend(&self) -> Vec<Vec<(Key, &'a str, i32)>> {
        let figure = self.figure;
        let lines = figure
            .panels
            .iter()
            .flat_map(|p| &p.lines)
            .map(|l| (Key::Line(l.style), &l.label));
        let markers = figure.markers.iter().map(|m| (Key::Marker, &m.label));
        let bands = figure
            .bands
            .iter()
            .map(|b| (Key::Band { dark: b.dark }, &b.label));
        let mut rows: Vec<Vec<(Key, &str, i32)>> = Vec::new();
        let mut x = self.left;
        for (key, label) in lines.chain(markers).chain(bands) {
            let known = |row: &Vec<(Key, &str, i32)>| row.iter().any(|k| k.0 == key && k.1 == label);
            if label.is_empty() || rows.iter().any(known) {
                continue;
            }
            let width = (KEY_WIDTH + 8 + 22) * UNIT + self.text_width(label, TEXT_SIZE);
            if rows.is_empty() || x + width > self.right + 22 * UNIT {
                rows.push(Vec::new());
                x = self.left;
            }
            if let Some(row) = rows.last_mut() {
                row.push((key, label, x));
            }
            x += width;
        }
        rows
    }
}
