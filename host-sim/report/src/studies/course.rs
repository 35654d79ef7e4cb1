//! The files of a course looked at: its plan, what lies along it, its samples, and a report.

use std::path::Path;

use super::files::{write_figure, write_report};
use super::{OutputError, curves};
use crate::document::{Block, Cell, Provenance, Report, Section, Stamped, Table, write_file, write_json};
use crate::plot::{Axis, Figure, Panel, Series};
use haptic_batch::course::{Sample, Survey};
use haptic_sim::models::road::Course;

/// Width over height of a panel of a figure, so that a plan has one scale.
const PANEL_ASPECT: f64 = 4.2;

/// Writes the plan and what lies along the road (SVG, PNG), the samples (CSV, JSON) and a report (HTML).
///
/// # Errors
/// What could not be written or drawn.
pub fn write(survey: &Survey, course: &Course, directory: &Path) -> Result<(), OutputError> {
    let (plan, along) = (plan(survey), along(survey, course));
    write_figure(directory, "plan", &plan)?;
    write_figure(directory, "course", &along)?;
    write_json(&directory.join("course.json"), &stamped(survey))?;
    write_file(&directory.join("course.csv"), |f| {
        writeln!(f, "s_m,x_m,y_m,heading_rad,curvature_1pm,bank_rad,grade,width_m")?;
        for s in &survey.samples {
            writeln!(
                f,
                "{},{},{},{},{},{},{},{}",
                s.s_m, s.x_m, s.y_m, s.heading_rad, s.curvature_1pm, s.bank_rad, s.grade, s.width_m
            )?;
        }
        Ok(())
    })?;
    write_report(directory, &report(survey, plan, along))
}

/// The survey as JSON holds it.
pub fn stamped(survey: &Survey) -> Stamped<'_, Survey> {
    Provenance::of(None).stamp(survey)
}

/// Least and largest values along the lane's centre.
pub fn table(survey: &Survey) -> Table {
    /// Name, unit, digits, value.
    type Quantity = (&'static str, &'static str, usize, fn(&Sample) -> f64);
    let quantities: [Quantity; 4] = [
        ("Curvature, left positive", "1/m", 5, |s| s.curvature_1pm),
        ("Bank, positive: left edge higher", "rad", 4, |s| s.bank_rad),
        ("Grade, positive uphill", "", 4, |s| s.grade),
        ("Lane width", "m", 3, |s| s.width_m),
    ];
    let row = |(name, unit, decimals, of): (&str, &str, usize, fn(&Sample) -> f64)| {
        let values = || survey.samples.iter().map(of);
        vec![
            Cell::Text(name.into()),
            Cell::number(values().fold(f64::INFINITY, f64::min), decimals),
            Cell::number(values().fold(f64::NEG_INFINITY, f64::max), decimals),
            Cell::Text(unit.into()),
        ]
    };
    Table {
        caption: String::new(),
        columns: ["Along the lane's centre", "Least", "Most", "Unit"]
            .map(String::from)
            .to_vec(),
        rows: quantities.into_iter().map(row).collect(),
    }
}

fn plan(survey: &Survey) -> Figure {
    let points: Vec<(f64, f64)> = survey.samples.iter().map(|s| (s.x_m, s.y_m)).collect();
    let extent = |of: fn(&(f64, f64)) -> f64| {
        let values = points.iter().map(of);
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
            (low.min(v), high.max(v))
        })
    };
    let ((left, right), (low, high)) = (extent(|p| p.0), extent(|p| p.1));
    let height = 1.1 * (high - low).max((right - left) / PANEL_ASPECT).max(1.0);
    let around = |axis: Axis, from: f64, to: f64, size: f64| {
        axis.within(0.5 * (from + to - size), 0.5 * (from + to + size))
    };
    Figure {
        x: around(Axis::of("x", "m"), left, right, height * PANEL_ASPECT),
        panels: vec![Panel {
            y: around(Axis::of("y", "m"), low, high, height),
            series: vec![Series::line("", 1, points)],
            ..Panel::default()
        }],
        ..Figure::default()
    }
}

fn along(survey: &Survey, course: &Course) -> Figure {
    let panel = |quantity: &str, unit: &str, value: fn(&Sample) -> f64| Panel {
        title: String::new(),
        y: Axis::of(quantity, unit),
        series: vec![Series::line(
            "",
            1,
            survey.samples.iter().map(|s| (s.s_m, value(s))).collect(),
        )],
    };
    Figure {
        x: Axis::of("Distance along the lane's centre", "m"),
        panels: vec![
            panel("Curvature", "1/km", |s| 1e3 * s.curvature_1pm),
            panel("Bank, left up", "%", |s| 100.0 * s.bank_rad.tan()),
            panel("Grade", "%", |s| 100.0 * s.grade),
            panel("Lane width", "m", |s| s.width_m),
        ],
        bands: curves::bands(course),
        ..Figure::default()
    }
}

fn report(survey: &Survey, plan: Figure, along: Figure) -> Report {
    let facts = [("Length".to_owned(), format!("{:.2} m", survey.length_m))];
    let roads = survey.roads.iter().map(|road| {
        let direction = if road.along_s { "along" } else { "against" };
        let lane = format!("lane {}, driven {direction} its s", road.lane);
        (format!("Road {}", road.road), lane)
    });
    let figure = |figure, caption: &str| Block::Figure {
        figure,
        caption: caption.into(),
    };
    Report {
        provenance: Some(Provenance::of(None)),
        title: "A course".into(),
        summary: format!("{}. {}", survey.course, super::notes(&survey.notes)),
        sections: vec![Section {
            heading: "The centre of the lane".into(),
            blocks: vec![
                Block::Table(Table::of_pairs(["What", "Value"], facts.into_iter().chain(roads))),
                Block::Table(table(survey)),
                figure(plan, "Seen from above, in the frame of the file."),
                figure(
                    along,
                    "Along the road, in the direction of travel: left curves and banks that raise \
                               the left edge are positive.",
                ),
            ],
        }],
    }
}
