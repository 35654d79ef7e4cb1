//! A figure in pieces that a printed page can hold.

use super::{Axis, Band, Figure, Panel, Series};

/// Most names on a page.
const ROWS: usize = 60;
/// Most panels above each other, if they have no titles.
const PANELS: usize = 5;

impl Figure {
    /// The figure, in as many pieces as it takes pages of paper; all have the same axes.
    pub fn pages(&self) -> Vec<Figure> {
        let limits = self.y_limits();
        let fixed = |(panel, (low, high)): (&Panel, &(f64, f64))| Panel {
            y: panel.y.clone().within(*low, *high),
            ..panel.clone()
        };
        let panels: Vec<Panel> = self.panels.iter().zip(&limits).map(fixed).collect();
        if self.rows.is_empty() {
            let titled = panels.iter().any(|panel| !panel.title.is_empty());
            let most = if titled { PANELS - 1 } else { PANELS };
            let (low, high) = self.x_limits();
            let piece = |(number, panels): (usize, &[Panel])| {
                let bands = self.bands.iter().filter_map(|band| {
                    let place = match band.panel {
                        Some(panel) => Some(panel.checked_sub(number * most).filter(|i| *i < panels.len())?),
                        None => None,
                    };
                    Some(Band {
                        panel: place,
                        ..band.clone()
                    })
                });
                Figure {
                    x: self.x.clone().within(low, high),
                    panels: panels.to_vec(),
                    bands: bands.collect(),
                    ..self.clone()
                }
            };
            let pages = panels.chunks(most).enumerate().map(piece).collect();
            return if panels.len() > most {
                pages
            } else {
                vec![self.clone()]
            };
        }
        // Several lines of panels share a page.
        let pages = self.rows.len().div_ceil((ROWS / self.lines()).max(1));
        let most = self.rows.len().div_ceil(pages);
        let piece = |(number, rows): (usize, &[String])| {
            let first = (number * most) as f64;
            // What belongs to the rows of other pages lies outside the frame, which cuts it.
            let moved = |series: &Series| Series {
                points: series.points.iter().map(|(x, y)| (x - first, *y)).collect(),
                ..series.clone()
            };
            let panels = panels.iter().map(|panel| Panel {
                series: panel.series.iter().map(moved).collect(),
                ..panel.clone()
            });
            Figure {
                x: Axis::default(),
                rows: rows.to_vec(),
                panels: panels.collect(),
                ..self.clone()
            }
        };
        self.rows.chunks(most).enumerate().map(piece).collect()
    }
}
