//! A course as a person writes it: segments of linearly varying curvature, bank and grade, and a lane width; or
//! a lane of an OpenDRIVE file.
//!
//! As TOML: `lane_width = 3.6` (m) and `[[segment]]` tables with `length` (m) and either `curvature` (1/m,
//! left positive, default 0) or both `curvature_start` and `curvature_end`; in the same way `bank` (rad, positive
//! where the left edge is the higher one) and `grade` (rise per distance). All may jump between segments (an arc
//! without a clothoid); heading never does.

use std::sync::Arc;

use serde::Deserialize;

use super::opendrive::{self, LaneChoice, RoadUsed};
use super::piece::Piece;
use crate::input::{InputError, in_range, parse_toml};

/// Name under which the built-in course is asked for.
pub const PAPER_COURSE: &str = "paper-course";
/// Largest curvature of a course, 1/m: a radius of 10 m, tighter than any road driven at constant speed.
pub const MAX_CURVATURE_1PM: f64 = 0.1;
/// Shortest segment, m. Below it a curvature ramp has no meaning on a road.
const MIN_SEGMENT_M: f64 = 0.01;
/// Longest course, m: keeps the centreline's table below 20 MB on straights.
const MAX_COURSE_M: f64 = 200_000.0;
/// Lane widths of roads, m. The lower end clears the vehicle's 1.7 m.
const LANE_WIDTH_M: std::ops::RangeInclusive<f64> = 2.0..=10.0;
const DEFAULT_LANE_WIDTH_M: f64 = 3.6;
/// Banks of a course file, rad: far beyond the 8 % of public roads.
const BANK_RAD: std::ops::RangeInclusive<f64> = -0.3..=0.3;
/// Grades of a course file.
const GRADE: std::ops::RangeInclusive<f64> = -0.3..=0.3;

/// A part of a road whose curvature, bank and grade are linear in arc length.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Segment {
    /// Arc length, m.
    pub length_m: f64,
    /// Curvature at the start, 1/m, left positive.
    pub curvature_start_1pm: f64,
    /// Curvature at the end, 1/m, left positive.
    pub curvature_end_1pm: f64,
    /// Bank at the start and at the end, rad, positive where the left edge is the higher one.
    pub bank_rad: [f64; 2],
    /// Rise per distance at the start and at the end, positive uphill.
    pub grade: [f64; 2],
}

/// A checked course: every segment finite, within range, and at least one of them.
#[derive(Debug, Clone, PartialEq)]
pub struct Course {
    name: String,
    lane_width_m: f64,
    segments: Vec<Segment>,
    /// The lane's centre in fine pieces where segments are only a summary of it.
    pieces: Option<Arc<[Piece]>>,
    roads: Vec<RoadUsed>,
    notes: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CourseFile {
    #[serde(default = "default_lane_width")]
    lane_width: f64,
    #[serde(default)]
    segment: Vec<SegmentFile>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SegmentFile {
    length: f64,
    curvature: Option<f64>,
    curvature_start: Option<f64>,
    curvature_end: Option<f64>,
    bank: Option<f64>,
    bank_start: Option<f64>,
    bank_end: Option<f64>,
    grade: Option<f64>,
    grade_start: Option<f64>,
    grade_end: Option<f64>,
}

fn default_lane_width() -> f64 {
    DEFAULT_LANE_WIDTH_M
}

impl Course {
    /// The course of the evaluation: three curves of 300, 400 and 600 m radius at the ends of clothoids.
    ///
    /// The paper prints no numbers for its figure 5; this course is this project's own, made so that t = 70 s
    /// at 60 km/h falls 6.7 m into the first arc, as the paper's failure needs.
    pub fn paper() -> Self {
        let straight = |length_m| Segment {
            length_m,
            ..Segment::default()
        };
        let curve = |curvature_1pm: f64, clothoid_m, arc_m| {
            [
                Segment {
                    length_m: clothoid_m,
                    curvature_end_1pm: curvature_1pm,
                    ..Segment::default()
                },
                Segment {
                    length_m: arc_m,
                    curvature_start_1pm: curvature_1pm,
                    curvature_end_1pm: curvature_1pm,
                    ..Segment::default()
                },
                Segment {
                    length_m: clothoid_m,
                    curvature_start_1pm: curvature_1pm,
                    ..Segment::default()
                },
            ]
        };
        let mut segments = vec![straight(1080.0)];
        segments.extend(curve(1.0 / 300.0, 80.0, 300.0));
        segments.push(straight(200.0));
        segments.extend(curve(-1.0 / 400.0, 80.0, 250.0));
        segments.push(straight(200.0));
        segments.extend(curve(1.0 / 600.0, 100.0, 400.0));
        segments.push(straight(400.0));
        Self::of_segments(PAPER_COURSE, DEFAULT_LANE_WIDTH_M, segments)
    }

    pub(super) fn of_segments(name: &str, lane_width_m: f64, segments: Vec<Segment>) -> Self {
        Self {
            name: name.into(),
            lane_width_m,
            segments,
            pieces: None,
            roads: Vec::new(),
            notes: Vec::new(),
        }
    }

    /// A lane's centre in fine pieces; `segments` sum it up for pictures.
    pub(super) fn of_pieces(name: &str, pieces: Vec<Piece>, segments: Vec<Segment>) -> Self {
        let narrowest = pieces
            .iter()
            .flat_map(|p| p.width_m)
            .fold(f64::INFINITY, f64::min);
        Self {
            pieces: Some(pieces.into()),
            ..Self::of_segments(name, narrowest, segments)
        }
    }

    pub(super) fn from_roads(self, roads: Vec<RoadUsed>, notes: Vec<String>) -> Self {
        Self { roads, notes, ..self }
    }

    /// A lane of an OpenDRIVE file's text; `name` stands for the file in errors and results.
    ///
    /// # Errors
    /// What is broken, missing or not supported, by road and element.
    pub fn from_opendrive(name: &str, text: &str, choice: &LaneChoice) -> Result<Self, InputError> {
        let fail = |e: String| InputError::new(name, e);
        let course = opendrive::read(name, text, choice).map_err(fail)?;
        let length_m = course.length_m();
        in_range("course length", length_m, MIN_SEGMENT_M..=MAX_COURSE_M, "m").map_err(fail)?;
        Ok(course)
    }

    /// The course as the text of an OpenDRIVE file.
    pub fn to_opendrive(&self) -> String {
        opendrive::write(self)
    }

    /// Checks the text of a course file; `name` stands for the file in errors and results.
    ///
    /// # Errors
    /// A syntax error (with its line), an unknown field (by name), a value out of range (by segment, field, value
    /// and range).
    pub fn from_toml(name: &str, text: &str) -> Result<Self, InputError> {
        let file: CourseFile = parse_toml(name, text)?;
        let fail = |e: String| InputError::new(name, e);
        in_range("lane_width", file.lane_width, LANE_WIDTH_M, "m").map_err(fail)?;
        if file.segment.is_empty() {
            return Err(InputError::new(name, "a course needs at least one [[segment]]"));
        }
        let mut segments = Vec::with_capacity(file.segment.len());
        for (i, segment) in file.segment.iter().enumerate() {
            segments.push(
                segment
                    .checked()
                    .map_err(|e| fail(format!("segment {}: {e}", i + 1)))?,
            );
        }
        let course = Self::of_segments(name, file.lane_width, segments);
        in_range(
            "course length",
            course.length_m(),
            MIN_SEGMENT_M..=MAX_COURSE_M,
            "m",
        )
        .map_err(fail)?;
        Ok(course)
    }

    /// `paper-course`, or the name the course was loaded under.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Width of the lane whose middle is the centreline, m; the least one where it varies.
    pub fn lane_width_m(&self) -> f64 {
        self.lane_width_m
    }

    /// The segments, in order of arc length. Of a lane of an OpenDRIVE file that is not made of straights, arcs
    /// and clothoids they are a summary, one a geometry element.
    pub fn segments(&self) -> &[Segment] {
        &self.segments
    }

    pub(super) fn pieces(&self) -> Option<&[Piece]> {
        self.pieces.as_deref()
    }

    /// The roads of the OpenDRIVE file that the course came from, in order of driving.
    pub fn roads(&self) -> &[RoadUsed] {
        &self.roads
    }

    /// What was decided for the reader of an OpenDRIVE file, in sentences.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Arc length of the whole centreline, m.
    pub fn length_m(&self) -> f64 {
        match &self.pieces {
            Some(pieces) => pieces.iter().map(|piece| piece.length_m).sum(),
            None => self.segments.iter().map(|s| s.length_m).sum(),
        }
    }

    /// Whether any part of the course is banked or climbs.
    pub fn is_flat(&self) -> bool {
        match &self.pieces {
            Some(pieces) => pieces
                .iter()
                .all(|p| p.bank_rad == [0.0; 2] && p.grade == [0.0; 2]),
            None => self
                .segments
                .iter()
                .all(|s| s.bank_rad == [0.0; 2] && s.grade == [0.0; 2]),
        }
    }
}

/// A quantity of a segment: `NAME` for all of it, or `NAME_start` and `NAME_end`.
fn ends(
    name: &str,
    unit: &str,
    range: std::ops::RangeInclusive<f64>,
    [constant, start, end]: [Option<f64>; 3],
) -> Result<[f64; 2], String> {
    match (constant, start, end) {
        (None, None, None) => Ok([0.0; 2]),
        (Some(value), None, None) => in_range(name, value, range, unit).map(|()| [value; 2]),
        (None, Some(start), Some(end)) => {
            in_range(&format!("{name}_start"), start, range.clone(), unit)?;
            in_range(&format!("{name}_end"), end, range, unit)?;
            Ok([start, end])
        }
        (Some(_), _, _) => Err(format!(
            "give either `{name}` or `{name}_start` and `{name}_end`, not both"
        )),
        (None, ..) => Err(format!("`{name}_start` and `{name}_end` go together")),
    }
}

impl SegmentFile {
    fn checked(&self) -> Result<Segment, String> {
        in_range("length", self.length, MIN_SEGMENT_M..=MAX_COURSE_M, "m")?;
        let curvature = [self.curvature, self.curvature_start, self.curvature_end];
        let range = -MAX_CURVATURE_1PM..=MAX_CURVATURE_1PM;
        let [start, end] = ends("curvature", "1/m", range, curvature)?;
        let bank = [self.bank, self.bank_start, self.bank_end];
        let grade = [self.grade, self.grade_start, self.grade_end];
        Ok(Segment {
            length_m: self.length,
            curvature_start_1pm: start,
            curvature_end_1pm: end,
            bank_rad: ends("bank", "rad", BANK_RAD, bank)?,
            grade: ends("grade", "", GRADE, grade)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_paper_course_is_the_one_written_down() {
        let course = Course::paper();
        // 1080 + (80+300+80) + 200 + (80+250+80) + 200 + (100+400+100) + 400
        assert_eq!(course.length_m(), 3350.0);
        assert_eq!(course.segments().len(), 13);
        let arcs: Vec<f64> = [2, 6, 10]
            .map(|i| 1.0 / course.segments()[i].curvature_end_1pm)
            .to_vec();
        assert_eq!(arcs, [300.0, -400.0, 600.0]);
    }

    #[test]
    fn a_file_gives_straights_arcs_and_clothoids() {
        let text = "lane_width = 3\n[[segment]]\nlength = 10\n[[segment]]\nlength = 5.5\ncurvature = -0.01\n\
                    [[segment]]\nlength = 7\ncurvature_start = -0.01\ncurvature_end = 0.02\n";
        let course = Course::from_toml("t.toml", text).unwrap();
        assert_eq!(course.lane_width_m(), 3.0);
        let values: Vec<_> = course
            .segments()
            .iter()
            .map(|s| (s.length_m, s.curvature_start_1pm, s.curvature_end_1pm))
            .collect();
        assert_eq!(
            values,
            [(10.0, 0.0, 0.0), (5.5, -0.01, -0.01), (7.0, -0.01, 0.02)]
        );
    }

    #[test]
    fn every_bad_course_is_refused_by_file_field_value_and_range() {
        let cases = [
            ("lane_width = 3.6", "at least one [[segment]]"),
            (
                "[[segment]]\nlength = 0",
                "segment 1: length = 0 m is outside 0.01 to 200000 m",
            ),
            ("[[segment]]\nlength = -3", "length = -3 m"),
            ("[[segment]]\nlength = nan", "length = NaN m"),
            ("[[segment]]\nlength = inf", "length = inf m"),
            (
                "[[segment]]\nlength = 9\ncurvature = 0.2",
                "curvature = 0.2 1/m is outside -0.1 to 0.1 1/m",
            ),
            ("[[segment]]\nlength = 9\ncurvature = nan", "curvature = NaN"),
            (
                "[[segment]]\nlength = 9\ncurvature_start = 0.2\ncurvature_end = 0",
                "curvature_start = 0.2",
            ),
            (
                "[[segment]]\nlength = 9\ncurvature_start = 0.0\ncurvature_end = -1",
                "curvature_end = -1",
            ),
            ("[[segment]]\nlength = 9\ncurvature_start = 0.0", "go together"),
            (
                "[[segment]]\nlength = 9\ncurvature = 0\ncurvature_end = 0",
                "not both",
            ),
            (
                "lane_width = 0.5\n[[segment]]\nlength = 9",
                "lane_width = 0.5 m is outside 2 to 10 m",
            ),
            ("[[segment]]\nlength = 9\nradius = 3", "radius"),
            ("lanes = 2\n[[segment]]\nlength = 9", "lanes"),
            ("[[segment]]\ncurvature = 0", "length"),
            ("[[segment]]\nlength = \"long\"", "line 2"),
            ("[[segment]]\nlength = \"long\"", "expected a number"),
            ("[[segment]\nlength = 9", "line 1"),
            (
                "[[segment]]\nlength = 150000\n[[segment]]\nlength = 150000",
                "course length = 300000 m",
            ),
        ];
        for (text, expected) in cases {
            let error = Course::from_toml("bad.toml", text).unwrap_err().to_string();
            assert!(error.starts_with("bad.toml: "), "{error}");
            assert!(
                error.contains(expected),
                "{text:?} gave {error:?}, not {expected:?}"
            );
        }
    }
}
