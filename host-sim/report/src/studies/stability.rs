//! What is shown of the map over speed and delay: tables and maps.

use crate::document::{Block, Cell, Report, Section, Table, signed};
use crate::plot::{Axis, Figure, Mark, Panel, Series};
use haptic_batch::left_by_themselves;
use haptic_batch::stability::{DELAYS_S, Drive, Place, SHARES, SPEEDS_KMH, Shares};
use haptic_sim::scenario::Condition;
use serde::Serialize;

/// What the map is about.
const SUMMARY: &str = "Growth: the largest real part of the loop's eigenvalues on a straight; below zero an error dies \
                           down, above it grows. Peak: the largest lateral error through a curve of 0.93 m/s2, simulated with the shipping ECU.";

/// The results as JSON holds them.
#[derive(Debug, Serialize)]
pub struct Map {
    /// By speed and delay.
    pub places: Vec<Place>,
    /// What any schedule could do at each speed.
    pub shares: Vec<Shares>,
}

/// The document of the map.
pub fn report(map: &Map) -> Report {
    let growth = "Growth (1/s) by speed and delay, by hand and with guidance. The stronger the colour, the faster an error dies down \
                  or grows.";
    let peaks = "Peak lateral error (m) in the curve by speed and delay.";
    let blocks = vec![
        Block::figure("stability", growth_figure(map), growth),
        Block::figure("peaks", peak_figure(map), peaks),
        Block::Table(growth_table(map)),
        Block::Table(peak_table(map)),
        Block::Table(shares(map)),
        Block::Text(judgement(map)),
    ];
    let title = "Who keeps the lane, how fast, with which delay";
    Report::new(title, SUMMARY, vec![Section::new("Speed and delay", blocks)])
}

/// Whether guidance keeps every driver stable who is stable alone.
fn judgement(map: &Map) -> String {
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
    let named =
        |place: &Place, condition| format!("{} km/h, t_p {} s, {condition}", place.speed_kmh, place.t_p);
    let guided = map.places.iter().flat_map(|place| {
        let guided = place
            .drives
            .iter()
            .filter(|drive| drive.condition != Condition::Manual);
        guided.map(move |drive| (&drive.away, named(place, drive.condition)))
    });
    if let Some(left) = left_by_themselves(guided) {
        text.push_str(&format!(" The peaks are not all of guided driving: {left}."));
    }
    text
}

/// The map of growths, a row for each way to drive and each delay.
fn growth_table(map: &Map) -> Table {
    let caption = "Growth (1/s): with - an error dies down, with + the loop is unstable";
    rows(map, caption, |drive| Cell::Signed(drive.growth_per_s))
}

/// The map of peaks.
fn peak_table(map: &Map) -> Table {
    rows(
        map,
        "Peak lateral error (m); a dash: the vehicle leaves the road",
        |drive| Cell::number(drive.peak_m, 3),
    )
}

fn rows(map: &Map, caption: &str, cell: fn(&Drive) -> Cell) -> Table {
    let row = |condition: Condition, t_p: f64| {
        let head = [Cell::Text(name(condition)), Cell::number(t_p, 1)];
        let drives = in_condition(map, condition).filter(|(place, _)| place.t_p == t_p);
        head.into_iter()
            .chain(drives.map(|(_, drive)| cell(drive)))
            .collect()
    };
    let rows = Condition::ALL
        .into_iter()
        .flat_map(|condition| DELAYS_S.map(|t_p| row(condition, t_p)));
    Table::new(
        caption,
        ["Drive".into(), "t_p (s)".into()]
            .into_iter()
            .chain(SPEEDS_KMH.map(|kmh| format!("{kmh} km/h"))),
        rows,
    )
}

/// Every place with the drive of one kind there.
fn in_condition(map: &Map, condition: Condition) -> impl Iterator<Item = (&Place, &Drive)> {
    map.places.iter().filter_map(move |place| {
        let drive = place.drives.iter().find(|drive| drive.condition == condition)?;
        Some((place, drive))
    })
}

fn name(condition: Condition) -> String {
    match condition {
        Condition::Manual => "manual".into(),
        guided => format!("{guided} reliance"),
    }
}

/// Which share of the guidance at a speed makes the least stable driver most stable.
fn shares(map: &Map) -> Table {
    let row = |row: &Shares| {
        let mut cells = vec![Cell::number(row.speed_kmh, 0)];
        cells.extend(row.growth_per_s.map(|value| Cell::number(value, 3)));
        cells.push(Cell::number(row.best(), 2));
        cells
    };
    let mut columns = vec!["Speed (km/h)".into()];
    columns.extend(SHARES.map(|share| format!("Share {share}")));
    columns.push("Recommended".into());
    Table::new(
        "Largest growth (1/s) of all guided drives where the manual one is stable, by the share of the guidance that a \
                  schedule leaves at the speed (guidance.low_speed_share, guidance.high_speed_share); recommended is the largest \
                  share within 0.01 /s of the least growth",
        columns,
        map.shares.iter().map(row),
    )
}

/// A growth of this size has the strongest colour, 1/s.
const STRONG_PER_S: f64 = 0.4;
/// A peak of this size, m: where a vehicle of 1.7 m begins to leave a lane of 3.6 m.
const LARGE_M: f64 = 0.95;

fn growth_figure(map: &Map) -> Figure {
    figure(map, |place, drive| {
        let (kind, style) = if drive.is_stable() {
            ("stable: an error dies down", 1)
        } else if place.broken().any(|broken| broken == drive) {
            ("unstable where manual is stable", 4)
        } else {
            ("unstable: an error grows", 3)
        };
        (
            kind,
            style,
            drive.growth_per_s.abs() / STRONG_PER_S,
            signed(drive.growth_per_s),
        )
    })
}

fn peak_figure(map: &Map) -> Figure {
    figure(map, |_, drive| match drive.peak_m {
        Some(peak_m) if peak_m <= LARGE_M => ("within the lane", 1, peak_m / LARGE_M, format!("{peak_m:.3}")),
        Some(peak_m) => ("out of the lane", 6, 0.3, format!("{peak_m:.3}")),
        None => ("left the road", 3, 1.0, "off".into()),
    })
}

/// What a place of the map is called, its style, how strong its colour is, and what is written there.
type Shown = (&'static str, usize, f64, String);

/// A map for each way to drive, on the same axes.
fn figure(map: &Map, show: fn(&Place, &Drive) -> Shown) -> Figure {
    let size = [SPEEDS_KMH[1] - SPEEDS_KMH[0], DELAYS_S[1] - DELAYS_S[0]];

    // A legend names each kind once.
    let series = |(place, drive): (&Place, &Drive)| {
        let (label, style, strength, word) = show(place, drive);
        let shown = vec![(0.15 + 0.6 * strength.min(1.0), word)];
        let points = vec![(place.speed_kmh, place.t_p)];
        Series::with_mark(label, style, Mark::Fields { size, shown }, points)
    };
    let panel = |condition: Condition| {
        let y = Axis::new("t_p", "s").around(&DELAYS_S);
        Panel::new(name(condition), y, in_condition(map, condition).map(series))
    };
    let x = Axis::new("Speed", "km/h").around(&SPEEDS_KMH);
    x.figure(Condition::ALL.map(panel))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two places with growths so small that two digits would not tell them apart.
    #[test]
    fn a_map_shows_each_verdict_in_colour_and_sign() {
        let drives = |manual, low| {
            let drive = |(condition, growth_per_s)| Drive {
                condition,
                growth_per_s,
                peak_m: None,
                away: Default::default(),
            };
            [(Condition::Manual, manual), (Condition::Low, low)]
                .map(drive)
                .to_vec()
        };
        let place = |speed_kmh, manual, low| Place {
            speed_kmh,
            t_p: 0.1,
            drives: drives(manual, low),
        };
        let map = Map {
            places: vec![place(20.0, -0.0004, 0.0003), place(30.0, 0.0004, 0.2)],
            shares: Vec::new(),
        };
        let figure = growth_figure(&map);
        let shown = |panel: usize| -> Vec<(&str, &str, (f64, f64))> {
            let words = figure.panels[panel]
                .series
                .iter()
                .map(|series| match &series.mark {
                    Mark::Fields { shown, .. } => {
                        (series.label.as_str(), shown[0].1.as_str(), series.points[0])
                    }
                    other => panic!("{other:?}"),
                });
            words.collect()
        };
        let (stable, grows) = ("stable: an error dies down", "unstable: an error grows");
        assert_eq!(
            shown(0),
            [(stable, "-0.0004", (20.0, 0.1)), (grows, "+0.0004", (30.0, 0.1))]
        );
        let worse = "unstable where manual is stable";
        assert_eq!(
            shown(3),
            [(worse, "+0.0003", (20.0, 0.1)), (grows, "+0.200", (30.0, 0.1))]
        );
        assert_eq!(figure.panels[0].title, "manual");
        let text = growth_table(&map).to_text(None);
        assert!(
            text.contains("-0.0004  +0.0004") && text.contains("+0.0003   +0.200"),
            "{text}"
        );
    }
}
