//! Draws a laid-out page: title, legend, and each panel from its background to its frame.

use super::ink::{DrawResult, GRID, INK, Key, MARKER, band_colour, draw_line, draw_marker, frame};
use super::page::{
    KEY_WIDTH, LEGEND_ROW, MARGIN, PANEL_HEIGHT, Page, TEXT_SIZE, TICK, TICK_TEXT_SIZE, TITLE_HEIGHT,
    TITLE_SIZE, UNIT,
};
use super::{Panel, axis, polyline};
use plotters::coord::Shift;
use plotters::element::{PathElement, Rectangle};
use plotters::prelude::{DrawingArea, DrawingBackend, Text};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, FontStyle, FontTransform, IntoTextStyle, WHITE};

/// Most points of one line: two for each point of the page's width.
const MOST_POINTS: usize = 1800;

/// How far a drawn line may be from the curve, units; more shows as corners.
const TOLERANCE: f64 = 0.35;

impl Page<'_> {
    pub(super) fn draw<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>) -> DrawResult<DB> {
        area.fill(&WHITE)?;
        if !self.figure.title.is_empty() {
            let style = self
                .font(TITLE_SIZE, FontStyle::Bold)
                .into_text_style(area)
                .color(&INK);
            area.draw(&Text::new(
                self.figure.title.as_str(),
                (self.left, MARGIN * UNIT),
                style,
            ))?;
        }
        self.draw_legend(area)?;
        for (i, panel) in self.figure.panels.iter().enumerate() {
            self.draw_panel(area, i, panel)?;
        }
        let style = self.text(TEXT_SIZE, HPos::Center, VPos::Bottom, area);
        let centre = ((self.left + self.right) / 2, self.height - MARGIN * UNIT);
        area.draw(&Text::new(self.figure.x.label.as_str(), centre, style))?;
        area.present()
    }

    fn text<DB: DrawingBackend>(
        &self,
        size: i32,
        h: HPos,
        v: VPos,
        area: &DrawingArea<DB, Shift>,
    ) -> plotters::style::TextStyle<'static> {
        self.font(size, FontStyle::Normal)
            .into_text_style(area)
            .color(&INK)
            .pos(Pos::new(h, v))
    }

    fn draw_legend<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>) -> DrawResult<DB> {
        let title = if self.figure.title.is_empty() {
            0
        } else {
            TITLE_HEIGHT
        };
        for (i, row) in self.legend.iter().enumerate() {
            let y = (MARGIN + title + LEGEND_ROW * i as i32 + LEGEND_ROW / 2) * UNIT;
            for &(key, label, x) in row {
                let (end, half) = (x + KEY_WIDTH * UNIT, 7 * UNIT);
                match key {
                    Key::Line(style) => draw_line(area, vec![(x, y), (end, y)], style)?,
                    Key::Marker => draw_marker(area, (x + end) / 2, y - half, y + half)?,
                    Key::Band { dark } => {
                        let corners = [(x, y - half), (end, y + half)];
                        area.draw(&Rectangle::new(corners, band_colour(dark).filled()))?;
                        area.draw(&frame(corners, GRID.stroke_width(UNIT as u32)))?;
                    }
                }
                let style = self.text(TEXT_SIZE, HPos::Left, VPos::Center, area);
                area.draw(&Text::new(label, (end + 8 * UNIT, y + self.text_drop), style))?;
            }
        }
        Ok(())
    }

    fn draw_panel<DB: DrawingBackend>(
        &self,
        area: &DrawingArea<DB, Shift>,
        index: usize,
        panel: &Panel,
    ) -> DrawResult<DB> {
        let (x_limits, y_limits) = (self.x_limits, self.y_limits[index]);
        let (left, right, top) = (self.left, self.right, self.tops[index]);
        let bottom = top + PANEL_HEIGHT * UNIT;
        let share = |v: f64, (low, high): (f64, f64)| (v - low) / (high - low);
        let exact_x = |x: f64| f64::from(left) + share(x, x_limits) * f64::from(right - left);
        let exact_y = |y: f64| f64::from(bottom) - share(y, y_limits) * f64::from(bottom - top);
        let to_x = |x: f64| exact_x(x).round() as i32;
        let to_y = |y: f64| exact_y(y).round() as i32;
        let inside = |x: f64| x.clamp(x_limits.0, x_limits.1);

        for band in &self.figure.bands {
            if band.to > x_limits.0 && band.from < x_limits.1 {
                let corners = [(to_x(inside(band.from)), top), (to_x(inside(band.to)), bottom)];
                area.draw(&Rectangle::new(corners, band_colour(band.dark).filled()))?;
            }
        }

        let hairline = GRID.stroke_width(UNIT as u32);
        let ink = INK.stroke_width(UNIT as u32);
        let (ticks, decimals) = axis::ticks(y_limits, axis::Y_TICKS);
        for tick in ticks {
            let y = to_y(tick);
            area.draw(&PathElement::new(vec![(left, y), (right, y)], hairline))?;
            area.draw(&PathElement::new(vec![(left - TICK * UNIT, y), (left, y)], ink))?;
            let style = self.text(TICK_TEXT_SIZE, HPos::Right, VPos::Center, area);
            let place = (left - (TICK + 4) * UNIT, y + self.text_drop);
            area.draw(&Text::new(axis::label(tick, decimals), place, style))?;
        }
        let (ticks, decimals) = axis::ticks(x_limits, axis::X_TICKS);
        let is_last = index + 1 == self.figure.panels.len();
        for tick in ticks {
            let x = to_x(tick);
            area.draw(&PathElement::new(vec![(x, top), (x, bottom)], hairline))?;
            area.draw(&PathElement::new(
                vec![(x, bottom), (x, bottom + TICK * UNIT)],
                ink,
            ))?;
            if is_last {
                let style = self.text(TICK_TEXT_SIZE, HPos::Center, VPos::Top, area);
                let place = (x, bottom + (TICK + 4) * UNIT);
                area.draw(&Text::new(axis::label(tick, decimals), place, style))?;
            }
        }
        if y_limits.0 < 0.0 && y_limits.1 > 0.0 {
            let zero = MARKER.stroke_width(UNIT as u32 / 2);
            area.draw(&PathElement::new(
                vec![(left, to_y(0.0)), (right, to_y(0.0))],
                zero,
            ))?;
        }
        for marker in self
            .figure
            .markers
            .iter()
            .filter(|m| m.x >= x_limits.0 && m.x <= x_limits.1)
        {
            draw_marker(area, to_x(marker.x), top, bottom)?;
        }
        for line in &panel.lines {
            for piece in polyline::clip(&line.points, x_limits, y_limits) {
                let path: Vec<_> = polyline::thin(&piece, MOST_POINTS)
                    .into_iter()
                    .map(|(x, y)| (exact_x(x), exact_y(y)))
                    .collect();
                let path = polyline::simplify(&path, TOLERANCE).into_iter();
                let mut path: Vec<_> = path.map(|(x, y)| (x.round() as i32, y.round() as i32)).collect();
                path.dedup();
                draw_line(area, path, line.style)?;
            }
        }
        area.draw(&frame([(left, top), (right, bottom)], ink))?;

        let style = self
            .font(TEXT_SIZE, FontStyle::Bold)
            .into_text_style(area)
            .color(&INK);
        let style = style.pos(Pos::new(HPos::Left, VPos::Bottom));
        area.draw(&Text::new(panel.title.as_str(), (left, top - 5 * UNIT), style))?;
        let font = self
            .font(TEXT_SIZE, FontStyle::Normal)
            .transform(FontTransform::Rotate270);
        let style = font
            .into_text_style(area)
            .color(&INK)
            .pos(Pos::new(HPos::Center, VPos::Top));
        area.draw(&Text::new(
            panel.y.label.as_str(),
            (MARGIN * UNIT, (top + bottom) / 2),
            style,
        ))
    }
}
