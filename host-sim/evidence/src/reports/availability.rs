//! What is shown of how often guidance leaves for nothing: tables and figures.

use haptic_campaign::campaign::CaseResult;
use haptic_evidence::availability::{Availability, Cell as Row, DriveSegment, Ended, Rate};
use haptic_report::document::{Block, Cell, Report, Section, Table};
use haptic_report::plot::{Axis, Figure, Mark, Panel, Series};
use haptic_report::studies::place;
use haptic_sim::worlds::{WORLDS, WorldKind};
use serde::Serialize;

/// What the study is about.
const SUMMARY: &str = "A declaration is what took guidance away. Nothing is wrong in any drive, so each is a false one. \
                           The interval is the exact one of a Poisson rate; where nothing was declared there is only a \
                           bound. Every drive is driven a second time \
                           by hand; one that leaves the road then too is lost by hand, and counted there alone.";

/// What is given up for what: false declarations, and faults noticed in the same world.
#[derive(Debug, Serialize)]
pub(crate) struct Balance {
    /// Without a fault.
    #[serde(flatten)]
    pub(crate) availability: Availability,
    /// The results with every fault by name.
    pub(crate) detection: Option<Detection>,
}

/// Faults in a world.
#[derive(Debug, Serialize)]
pub(crate) struct Detection {
    /// Name of the world.
    pub(crate) world: &'static str,
    /// Every row of the campaign.
    pub(crate) rows: Vec<CaseResult>,
}

impl Detection {
    /// Rows that ask the ECU to leave, and those in which it did.
    fn shown(&self) -> impl Iterator<Item = &CaseResult> {
        self.rows.iter().filter(|row| row.asks_to_leave || row.left > 0)
    }
}

fn left_percent(row: &CaseResult) -> f64 {
    100.0 * row.left as f64 / row.runs as f64
}

/// How often and how soon the ECU leaves when something is wrong.
fn detection_table(faults: &Detection) -> Table {
    let row = |row: &CaseResult| {
        let time = |n: usize| Cell::number(row.left_after_ms.map(|times| f64::from(times[n])), 0);
        let should = if row.asks_to_leave { "leave" } else { "may go on" };
        [
            ("Fault", Cell::text(row.name)),
            ("Class", Cell::Text(row.class.to_string())),
            ("ECU should", Cell::text(should)),
            ("Runs", Cell::count(row.runs)),
            ("Left (%)", Cell::number(left_percent(row), 0)),
            ("Median (ms)", time(0)),
            ("Longest (ms)", time(1)),
            ("Deviation (m)", Cell::number(row.deviation_m, 2)),
            ("Beyond dropping (m)", Cell::number(row.excess_m, 2)),
        ]
    };
    let caption = format!("Faults noticed in the world '{}'", faults.world);
    Table::of_rows(caption, faults.shown().map(row))
}

fn detection_figure(faults: &Detection) -> Figure {
    let places = || faults.shown().enumerate().map(|(i, row)| (place(i), row));
    let left = places().map(|(x, row)| (x, left_percent(row))).collect();
    let after = |n: usize| {
        let times = places().filter_map(|(x, row)| Some((x, 1e-3 * f64::from(row.left_after_ms?[n]))));
        times.collect::<Vec<_>>()
    };
    let share = Axis::new("Share of the runs", "%").within(0.0, 105.0);
    let times = [
        Series::with_mark("longest", 3, Mark::Stems, after(1)),
        Series::dots("median", 1, after(0)),
    ];
    let panels = [
        Panel::new(
            "The ECU left",
            share,
            [Series::with_mark("", 2, Mark::Stems, left)],
        ),
        Panel::new("How soon", Axis::new("Time from the onset", "s"), times),
    ];
    Figure::of_rows(faults.shown().map(|row| row.name), panels)
}

/// The study's document.
pub(crate) fn report(results: &Balance) -> Report {
    let own = &results.availability;
    let caption = format!(
        "False declarations in an hour with their exact {0} % interval; where there was none, the rate that is not exceeded with {0} % \
         confidence, which is large where little was driven. Beside them the time without guidance: two seconds of handover and five \
         until the driver asks again.",
        own.level
    );
    let blocks = vec![
        Block::figure("availability", figure(own), caption),
        Block::Table(table(own)),
        Block::Table(causes(own)),
        Block::Table(drives(own)),
        Block::Table(worlds()).on_page(),
    ];
    let mut sections = vec![Section::new("False declarations", blocks)];
    if let Some(faults) = &results.detection {
        let caption = format!(
            "Share of the runs in which the ECU left, and the time from the onset, in the world '{}'. Bars at the left would be faults \
             that nobody notices.",
            faults.world
        );
        let blocks = vec![
            Block::figure("detection", detection_figure(faults), caption),
            Block::Table(detection_table(faults)),
        ];
        sections.push(Section::new("Faults noticed in the same world", blocks));
    }
    Report::new("Guidance that leaves for nothing", SUMMARY, sections)
}

/// What is known of a rate after so many hours.
fn finding(rate: &Rate, hours: f64) -> String {
    match (rate.count, hours > 0.0) {
        (_, false) => "nothing is known".into(),
        (0, true) => {
            let decimals = if rate.upper < 1.0 { 4 } else { 1 };
            format!(
                "no event in {hours:.2} h: at most {:.decimals$} an hour",
                rate.upper
            )
        }
        _ => format!(
            "{:.2} an hour ({:.2} to {:.2})",
            rate.per_hour, rate.interval[0], rate.interval[1]
        ),
    }
}

/// Head of the column of rates.
fn confidence(results: &Availability) -> String {
    format!("Rate, {} % confidence", results.level)
}

/// Every world on every road; the roads of a judged one together.
fn table(results: &Availability) -> Table {
    let confidence = confidence(results);
    let row = |row: &Row| {
        let judged = if row.judged { "judged" } else { "beyond" };
        let rate = finding(&row.declarations, row.hours);
        let with_one = format!("{} of {}", row.cars_with, row.cars);
        [
            ("World", Cell::text(row.world)),
            ("Road", Cell::text(row.road)),
            ("Judged", Cell::text(judged)),
            ("Hours", Cell::number(row.hours, 2)),
            ("False declarations", Cell::count(row.declarations.count)),
            (confidence.as_str(), Cell::Text(rate)),
            ("At most (1/h)", Cell::number(row.declarations.upper, 4)),
            ("Cars with one", Cell::Text(with_one)),
            ("Time without guidance (%)", Cell::number(away_percent(row), 2)),
            ("Latched", Cell::count(row.latched)),
            ("Off the road", Cell::count(row.diverged)),
            ("Lost by hand", Cell::count(row.lost_by_hand.segments)),
            ("SDLP (m)", Cell::number(row.sdlp_m, 2)),
        ]
    };
    Table::of_rows("", results.cells.iter().chain(&results.together).map(row))
}

/// False declarations by the faults that the ECU named.
fn causes(results: &Availability) -> Table {
    let confidence = confidence(results);
    let confidence = confidence.as_str();
    let rows = results.cells.iter().flat_map(|row| {
        row.causes.iter().map(move |cause| {
            let rate = finding(&cause.rate, row.hours);
            [
                ("World", Cell::text(row.world)),
                ("Road", Cell::text(row.road)),
                ("Faults", Cell::text(&cause.faults)),
                ("Declarations", Cell::count(cause.rate.count)),
                (confidence, Cell::Text(rate)),
            ]
        })
    });
    Table::of_rows("By what the ECU named", rows)
}

/// The drives of judged worlds in which something happened, each with the number that drives it alone (`--drives`).
fn drives(results: &Availability) -> Table {
    let off = |ended: Ended| match ended {
        Ended::Whole => "",
        Ended::Latched => "latched",
        Ended::Diverged => "off the road",
    };
    let row = |segment: &DriveSegment| {
        let declared = segment.declarations.iter().map(|d| {
            format!(
                "{} at {:.1} s, {:.2} m/s2",
                d.faults, d.time_s, d.lateral_m_per_s2
            )
        });
        let declared = declared.collect::<Vec<_>>().join("; ");
        let by_hand = &segment.by_hand;
        [
            ("World", Cell::text(&segment.world)),
            ("Road", Cell::text(&segment.road)),
            ("Drive", Cell::count(segment.number)),
            ("Car", Cell::Text(segment.car.to_string())),
            ("Speed (km/h)", Cell::number(segment.speed_kmh, 1)),
            (
                "Declared, at a lateral acceleration of the road",
                Cell::Text(declared),
            ),
            ("Ended", Cell::text(off(segment.ended))),
            ("By hand", Cell::text(off(by_hand.ended))),
            (
                "Largest error by hand (m)",
                Cell::number(by_hand.largest_error_m, 2),
            ),
        ]
    };
    let caption = "Drives in which something happened";
    Table::of_rows(caption, results.segments.iter().map(row))
}

/// What each world has beyond the paper's.
pub(crate) fn worlds() -> Table {
    let row = |c: &WorldKind| {
        [
            ("World", Cell::text(c.name)),
            ("What it adds", Cell::text(c.what)),
        ]
    };
    Table::of_rows("What each world adds to the paper's", WORLDS.iter().map(row))
}

fn away_percent(row: &Row) -> f64 {
    100.0 * (1.0 - row.available)
}

fn figure(results: &Availability) -> Figure {
    let places = || results.cells.iter().enumerate().map(|(i, row)| (place(i), row));
    let seen = || places().filter(|(_, row)| row.declarations.count > 0);
    let rates = seen().map(|(x, row)| (x, row.declarations.per_hour)).collect();
    let intervals = seen().map(|(_, row)| row.declarations.interval).collect();
    let none = places().filter(|(_, row)| row.declarations.count == 0);
    let bounds: Vec<_> = none.map(|(x, row)| (x, row.declarations.upper)).collect();
    let away = places().map(|(x, row)| (x, away_percent(row))).collect();
    // From zero; what was seen is not made small by how little the rest was driven.
    let most =
        |values: &mut dyn Iterator<Item = f64>| 1.05 * values.filter(|v| v.is_finite()).fold(0.1, f64::max);
    let most_seen = most(&mut seen().map(|(_, row)| row.declarations.interval[1]));
    let least_bound = bounds.iter().map(|bound| bound.1).fold(f64::INFINITY, f64::min);
    let most_rate = most(&mut [most_seen, 1.1 * least_bound].into_iter());
    let name = |row: &Row| {
        let lost = if row.hours > 0.0 { "" } else { " (lost by hand)" };
        format!("{}, {}{lost}", row.world, row.road)
    };
    let seen = Mark::Whiskers(intervals);
    let rates = [
        Series::with_mark(
            &format!("seen, with the {} % interval", results.level),
            1,
            seen,
            rates,
        ),
        Series::with_mark(
            &format!("none seen: at most ({} %)", results.level),
            0,
            Mark::Bounds,
            bounds,
        ),
    ];
    let rate = Axis::new("Rate", "1/h").within(0.0, most_rate);
    let most_away = most(&mut results.cells.iter().map(away_percent));
    let share = Axis::new("Share of the time", "%").within(0.0, most_away);
    let panels = [
        Panel::new("False declarations", rate, rates),
        Panel::new(
            "Without guidance",
            share,
            [Series::with_mark("", 2, Mark::Stems, away)],
        ),
    ];
    Figure::of_rows(results.cells.iter().map(name), panels)
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptic_evidence::availability::{Confidence, Lost};

    fn cell(count: u64, hours: f64) -> Row {
        Row {
            world: "w",
            road: "r",
            judged: true,
            hours,
            available: 1.0,
            declarations: Rate::new(count, hours, Confidence::USUAL),
            causes: Vec::new(),
            cars: 1,
            cars_with: 0,
            latched: 0,
            diverged: 0,
            lost_by_hand: Lost {
                segments: 0,
                hours: 0.0,
                declarations: 0,
            },
            sdlp_m: 0.1,
            largest_error_m: 0.3,
        }
    }

    /// No event in five minutes: the rate that is not exceeded with 95 % confidence is -ln(0.05) / (1/12 h) = 35.95 an hour.
    #[test]
    fn where_nothing_happened_there_is_a_bound_and_no_finding() {
        let results = Availability {
            seed: 1,
            hours: 0.1,
            level: Confidence::USUAL,
            cells: vec![cell(0, 1.0 / 12.0), cell(3, 2.0), cell(0, 0.0)],
            together: Vec::new(),
            segments: Vec::new(),
        };
        let figure = figure(&results);
        let [seen, none] = &figure.panels[0].series[..] else {
            panic!("{:?}", figure.panels[0].series)
        };
        assert!(matches!(seen.mark, Mark::Whiskers(_)) && none.mark == Mark::Bounds);
        assert_eq!(seen.points, [(2.0, 1.5)]);
        assert_eq!(none.points[0].0, 1.0);
        assert!(
            (none.points[0].1 - -(0.05_f64.ln()) * 12.0).abs() < 1e-6,
            "{:?}",
            none.points
        );
        let text = table(&results).to_text(None);
        assert!(
            text.contains("no event in 0.08 h: at most 35.9 an hour"),
            "{text}"
        );
        assert!(
            text.contains("1.50 an hour (0.31 to 4.38)") && text.contains("nothing is known"),
            "{text}"
        );
        assert!(!text.contains("0.00 to"), "{text}");
    }
}
