//! What is shown of the map over speed and delay: a table, figures, and the files with both.

use std::path::Path;

use super::OutputError;
use super::files::{write_figure, write_report};
use crate::document::{Block, Cell, Provenance, Report, Section, Stamped, Table, write_json};
use crate::plot::{Axis, Figure, Panel, Series};
use haptic_batch::left_by_themselves;
use haptic_batch::stability::{DELAYS_S, Drive, Place, SHARES, SPEEDS_KMH, Shares};
use haptic_sim::scenario::Condition;
use serde::Serialize;

/// What the map is about.
pub const SUMMARY: &str = "Growth: the largest real part of the loop's eigenvalues on a straight; below zero an error dies \
                           down. Peak: the largest lateral error through a curve of 0.93 m/s2, simulated with the shipping ECU.";

/// The results as JSON holds them.
#[derive(Debug, Serialize)]
pub struct Map {
    /// By speed and delay.
    pub places: Vec<Place>,
    /// What any schedule could do at each speed.
    pub shares: Vec<Shares>,
}

/// Writes the figures (SVG, PNG), the results (JSON) and a report (HTML).
///
/// # Errors
/// What could not be written or drawn.
pub fn write(map: &Map, directory: &Path) -> Result<(), OutputError> {
    let growth = figure(map, "Growth (1/s)", |drive| drive.growth_per_s);
    let peak = figure(map, "Peak lateral error (m)", |drive| {
        drive.peak_m.unwrap_or(f64::NAN)
    });
    write_figure(directory, "stability", &growth)?;
    write_figure(directory, "peaks", &peak)?;
    write_json(&directory.join("results.json"), &stamped(map))?;
    let blocks = vec![
        Block::Figure {
            figure: growth,
            caption: "A loop above zero is unstable.".into(),
        },
        Block::Figure {
            figure: peak,
            caption: "A line that ends: the vehicle left the road.".into(),
        },
        Block::Table(table(map)),
        Block::Table(shares(map)),
    ];
    write_report(
        directory,
        &Report {
            title: "Who keeps the lane, how fast, with which delay".into(),
            summary: format!("{SUMMARY} {}", judgement(map)),
            sections: vec![Section {
                heading: "Speed and delay".into(),
                blocks,
            }],
            provenance: Some(Provenance::of(None)),
        },
    )
}

/// The map with where it comes from.
pub fn stamped(map: &Map) -> Stamped<'_, Map> {
    Provenance::of(None).stamp(map)
}

/// Whether guidance keeps every driver stable who is stable alone.
pub fn judgement(map: &Map) -> String {
    let broken: Vec<String> = map
        .places
        .iter()
        .flat_map(|place| {
            place.broken().map(move |drive| {
                format!(
                    "{} reliance at {} km/h and t_p {} s",
                    drive.condition, place.speed_kmh, place.t_p
                )
            })
        })
        .collect();
    let mut text = if broken.is_empty() {
        "Wherever the manual driver is stable, every guided one is.".into()
    } else {
        format!(
            "Unstable with guidance where the manual driver is stable: {}.",
            broken.join("; ")
        )
    };
    let guided = map.places.iter().flat_map(|place| {
        let guided = place
            .drives
            .iter()
            .filter(|drive| drive.condition != Condition::Manual);
        guided.map(move |drive| {
            let name = format!(
                "{} km/h, t_p {} s, {}",
                place.speed_kmh, place.t_p, drive.condition
            );
            (&drive.away, name)
        })
    });
    if let Some(left) = left_by_themselves(guided) {
        text.push_str(&format!(" The peaks are not all of guided driving: {left}."));
    }
    text
}

/// Every place of the map.
pub fn table(map: &Map) -> Table {
    let row = |place: &Place| {
        let mut cells = vec![Cell::number(place.speed_kmh, 0), Cell::number(place.t_p, 1)];
        cells.extend(
            place
                .drives
                .iter()
                .map(|drive| Cell::number(drive.growth_per_s, 2)),
        );
        cells.extend(place.drives.iter().map(|drive| Cell::Number {
            value: drive.peak_m,
            decimals: 3,
        }));
        cells.push(Cell::Text(
            if place.broken().next().is_some() {
                "WORSE THAN MANUAL"
            } else {
                ""
            }
            .into(),
        ));
        cells
    };
    let of = |what: &str, unit: &str| Condition::ALL.map(|condition| format!("{what} {condition} ({unit})"));
    let mut columns = vec!["Speed (km/h)".into(), "t_p (s)".into()];
    columns.extend(of("Growth", "1/s"));
    columns.extend(of("Peak", "m"));
    columns.push(String::new());
    Table {
        caption: String::new(),
        columns,
        rows: map.places.iter().map(row).collect(),
    }
}

/// Which share of the guidance at a speed makes the least stable driver most stable.
pub fn shares(map: &Map) -> Table {
    let row = |row: &Shares| {
        let mut cells = vec![Cell::number(row.speed_kmh, 0)];
        cells.extend(row.growth_per_s.map(|value| Cell::Number { value, decimals: 3 }));
        cells.push(Cell::Number {
            value: row.best(),
            decimals: 2,
        });
        cells
    };
    let mut columns = vec!["Speed (km/h)".into()];
    columns.extend(SHARES.map(|share| format!("Share {share}")));
    columns.push("Recommended".into());
    Table {
        caption: "Largest growth (1/s) of all guided drives where the manual one is stable, by the share of the guidance that a \
                  schedule leaves at the speed (guidance.low_speed_share, guidance.high_speed_share); recommended is the largest \
                  share within 0.01 /s of the least growth"
            .into(),
        columns,
        rows: map.shares.iter().map(row).collect(),
    }
}

/// A panel for each delay: one value over the speed, a line for each way to drive.
fn figure(map: &Map, label: &str, value: fn(&Drive) -> f64) -> Figure {
    let panel = |t_p: f64| {
        let line = |(style, condition): (usize, Condition)| {
            let places = map.places.iter().filter(|place| place.t_p == t_p);
            let of = |place: &Place| {
                place
                    .drives
                    .iter()
                    .find(|drive| drive.condition == condition)
                    .map(value)
            };
            let points = places.map(|place| (place.speed_kmh, of(place).unwrap_or(f64::NAN)));
            let name = match condition {
                Condition::Manual => "manual".into(),
                guided => format!("{guided} reliance"),
            };
            Series::line(&name, style, points.collect())
        };
        Panel {
            title: format!("t_p {t_p} s"),
            y: Axis::of(label),
            series: Condition::ALL.into_iter().enumerate().map(line).collect(),
        }
    };
    Figure {
        x: Axis {
            label: "Speed (km/h)".into(),
            limits: Some((SPEEDS_KMH[0] - 2.0, SPEEDS_KMH[SPEEDS_KMH.len() - 1] + 2.0)),
            ..Axis::default()
        },
        panels: DELAYS_S.map(panel).to_vec(),
        ..Figure::default()
    }
}
