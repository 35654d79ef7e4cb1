//! A course looked at: its length, the roads that it came from, and the centre of the lane every metre.

use std::path::Path;

use serde::Serialize;

use super::files::{write_figure, write_report};
use super::{OutputError, curves};
use crate::models::road::{Centreline, Course, Pose, RoadUsed, Surface};
use crate::plot::{Axis, Figure, Line, Panel};
use crate::report::{Block, Report, Section, Table, write_file, write_json};

/// Distance between two samples, m.
const STEP_M: f64 = 1.0;
/// Width over height of a panel of a figure, so that a plan has one scale.
const PANEL_ASPECT: f64 = 4.2;

/// The results, as `--json` prints them.
#[derive(Debug, Clone, Serialize)]
pub struct Survey {
    /// The file, or the name of a built-in course.
    pub course: String,
    /// Arc length of the lane's centre, m.
    pub length_m: f64,
    /// Least width of the lane, m.
    pub lane_width_m: f64,
    /// What the sign of a bank means.
    pub bank_sign: &'static str,
    /// The roads of the file, in order of driving; none for a course that is not from OpenDRIVE.
    pub roads: Vec<RoadUsed>,
    /// What was decided for the reader.
    pub notes: Vec<String>,
    /// The lane's centre, every metre from its start.
    pub samples: Vec<Sample>,
}

/// A place of the lane's centre, in the direction of travel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Sample {
    /// Arc length along the lane's centre, m.
    pub s_m: f64,
    /// In the frame of the file, m.
    pub x_m: f64,
    /// In the frame of the file, m.
    pub y_m: f64,
    /// Counter-clockwise from x, rad, not wrapped.
    pub heading_rad: f64,
    /// Left positive, 1/m.
    pub curvature_1pm: f64,
    /// Positive where the left edge is the higher one, rad.
    pub bank_rad: f64,
    /// Rise per distance, positive uphill.
    pub grade: f64,
    /// Width of the lane, m.
    pub width_m: f64,
}

/// Looks at a course.
pub fn survey(course: &Course) -> Survey {
    let line = Centreline::new(course);
    let sample = |i: usize| {
        let s_m = i as f64 * STEP_M;
        let (local, curvature_1pm, surface) = line.at(s_m);
        let Pose { x_m, y_m, heading_rad } = line.start().of_local(local);
        let Surface { bank_rad, grade, width_m } = surface;
        // Adding zero takes the sign off a zero.
        Sample {
            s_m,
            x_m,
            y_m,
            heading_rad,
            curvature_1pm: curvature_1pm + 0.0,
            bank_rad: bank_rad + 0.0,
            grade: grade + 0.0,
            width_m,
        }
    };
    Survey {
        course: course.name().into(),
        length_m: line.length_m(),
        lane_width_m: course.lane_width_m(),
        bank_sign: "positive: the left edge is the higher one, in the direction of travel",
        roads: course.roads().to_vec(),
        notes: course.notes().to_vec(),
        samples: (0..=(line.length_m() / STEP_M) as usize).map(sample).collect(),
    }
}

impl Survey {
    /// Writes the plan and what lies along the road (SVG, PNG), the samples (CSV, JSON) and a report (HTML).
    ///
    /// # Errors
    /// What could not be written or drawn.
    pub fn write(&self, course: &Course, directory: &Path) -> Result<(), OutputError> {
        let (plan, along) = (self.plan(), self.along(course));
        write_figure(directory, "plan", &plan)?;
        write_figure(directory, "course", &along)?;
        write_json(&directory.join("course.json"), self)?;
        write_file(&directory.join("course.csv"), |f| {
            writeln!(f, "s_m,x_m,y_m,heading_rad,curvature_1pm,bank_rad,grade,width_m")?;
            for s in &self.samples {
                writeln!(
                    f,
                    "{},{},{},{},{},{},{},{}",
                    s.s_m, s.x_m, s.y_m, s.heading_rad, s.curvature_1pm, s.bank_rad, s.grade, s.width_m
                )?;
            }
            Ok(())
        })?;
        write_report(directory, &self.report(plan, along))
    }

    fn plan(&self) -> Figure {
        let points: Vec<(f64, f64)> = self.samples.iter().map(|s| (s.x_m, s.y_m)).collect();
        let extent = |of: fn(&(f64, f64)) -> f64| {
            let values = points.iter().map(of);
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
        };
        let ((left, right), (low, high)) = (extent(|p| p.0), extent(|p| p.1));
        let height = 1.1 * (high - low).max((right - left) / PANEL_ASPECT).max(1.0);
        let around = |from: f64, to: f64, size: f64| Some((0.5 * (from + to - size), 0.5 * (from + to + size)));
        Figure {
            x: Axis {
                label: "x (m)".into(),
                limits: around(left, right, height * PANEL_ASPECT),
            },
            panels: vec![Panel {
                y: Axis {
                    label: "y (m)".into(),
                    limits: around(low, high, height),
                },
                lines: vec![Line {
                    points,
                    ..Line::default()
                }],
                ..Panel::default()
            }],
            ..Figure::default()
        }
    }

    fn along(&self, course: &Course) -> Figure {
        let panel = |label: &str, value: fn(&Sample) -> f64| Panel {
            y: Axis {
                label: label.into(),
                limits: None,
            },
            lines: vec![Line {
                points: self.samples.iter().map(|s| (s.s_m, value(s))).collect(),
                ..Line::default()
            }],
            ..Panel::default()
        };
        Figure {
            x: Axis {
                label: "Distance along the lane's centre (m)".into(),
                limits: None,
            },
            panels: vec![
                panel("Curvature (1/km)", |s| 1e3 * s.curvature_1pm),
                panel("Bank (%), left up", |s| 100.0 * s.bank_rad.tan()),
                panel("Grade (%)", |s| 100.0 * s.grade),
                panel("Lane width (m)", |s| s.width_m),
            ],
            bands: curves::bands(course),
            ..Figure::default()
        }
    }

    fn report(&self, plan: Figure, along: Figure) -> Report {
        let facts = [
            ("Length".to_owned(), format!("{:.2} m", self.length_m)),
            ("Least lane width".into(), format!("{:.2} m", self.lane_width_m)),
        ];
        let roads = self.roads.iter().map(|road| {
            let direction = if road.along_s { "along" } else { "against" };
            let lane = format!("lane {}, driven {direction} its s", road.lane);
            (format!("Road {}", road.road), lane)
        });
        let figure = |figure, caption: &str| Block::Figure {
            figure,
            caption: caption.into(),
        };
        Report {
            title: "A course".into(),
            summary: format!("{}. {}", self.course, super::notes(&self.notes)),
            sections: vec![Section {
                heading: "The centre of the lane".into(),
                blocks: vec![
                    Block::Table(Table::of_pairs(["What", "Value"], facts.into_iter().chain(roads))),
                    figure(plan, "Seen from above, in the frame of the file."),
                    figure(along, "Along the road, in the direction of travel: left curves and banks that raise \
                                   the left edge are positive."),
                ],
            }],
        }
    }
}
