//! A course as a person writes it: segments of linearly varying curvature, bank and grade, and a lane width; or
//! a lane of an OpenDRIVE file.
//!
//! As TOML: `lane_width_m` and `[[segment]]` tables of the fields in [`SEGMENT_FIELDS`]: `length_m` and either `curvature_per_m`
//! (default 0) or both `curvature_start_per_m` and `curvature_end_per_m`; in the same way `bank_rad` and `grade`. All may jump between
//! segments (an arc without a clothoid); heading never does.

use std::sync::{Arc, LazyLock, OnceLock};

use serde::{Deserialize, Serialize};

use super::Centreline;
use super::opendrive::{self, LaneChoice, RoadUsed};
use super::piece::{MAX_COURSE_M, Piece};
use haptic_input::fields::Field;
use haptic_input::fields::Range::Between;
use haptic_input::{InputError, RangeError, in_range, parse_toml};

/// Name under which the built-in course is asked for.
pub const PAPER_COURSE: &str = "paper-course";
/// Largest curvature of a course, 1/m: a radius of 10 m, tighter than any road driven at constant speed.
pub const MAX_CURVATURE_1PM: f64 = 0.1;
/// Shortest segment, m. Below it a curvature ramp has no meaning on a road.
const MIN_SEGMENT_M: f64 = 0.01;
/// Most that a course may turn in all, rad, to and fro: keeps the table below 200 MB in curves.
const MAX_TURN_RAD: f64 = 5000.0;
/// Width of a lane unless a course has its own, m: the paper's.
pub const DEFAULT_LANE_WIDTH_M: f64 = 3.6;
/// The fields of a course file beside its segments.
pub const COURSE_FIELDS: &[Field] = &[Field {
    name: "lane_width_m",
    symbol: "",
    unit: "m",
    // The lower end clears the vehicle's 1.7 m.
    range: Between(2.0, 10.0),
    default: Some(DEFAULT_LANE_WIDTH_M),
    meaning: "of the lane whose middle is the centreline",
}];

/// The fields of a segment of a course file. Curvature, bank and grade are given for all of it, or at its start and its end.
pub const SEGMENT_FIELDS: &[Field] = &[
    segment_field("length_m", "m", [MIN_SEGMENT_M, MAX_COURSE_M], None, "arc length"),
    curvature("curvature_per_m", Some(0.0), "left positive"),
    curvature("curvature_start_per_m", None, "at the start of a clothoid"),
    curvature("curvature_end_per_m", None, "at its end"),
    bank("bank_rad", Some(0.0), "positive: the left edge is the higher one"),
    bank("bank_start_rad", None, "at the start of a change"),
    bank("bank_end_rad", None, "at its end"),
    grade("grade", Some(0.0), "rise per distance, positive uphill"),
    grade("grade_start", None, "at the start of a change"),
    grade("grade_end", None, "at its end"),
];

const fn segment_field(
    name: &'static str,
    unit: &'static str,
    [from, to]: [f64; 2],
    default: Option<f64>,
    meaning: &'static str,
) -> Field {
    Field {
        name,
        symbol: "",
        unit,
        range: Between(from, to),
        default,
        meaning,
    }
}

const fn curvature(name: &'static str, default: Option<f64>, meaning: &'static str) -> Field {
    let range = [-MAX_CURVATURE_1PM, MAX_CURVATURE_1PM];
    segment_field(name, "1/m", range, default, meaning)
}

/// Far beyond the 8 % of public roads.
const fn bank(name: &'static str, default: Option<f64>, meaning: &'static str) -> Field {
    segment_field(name, "rad", [-0.3, 0.3], default, meaning)
}

const fn grade(name: &'static str, default: Option<f64>, meaning: &'static str) -> Field {
    segment_field(name, "", [-0.3, 0.3], default, meaning)
}

/// A part of a road whose curvature, bank and grade are linear in arc length.
#[derive(Debug, Clone, Copy, PartialEq)]
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
#[derive(Debug, Clone)]
pub struct Course {
    name: String,
    lane_width_m: f64,
    segments: Vec<Segment>,
    /// The lane's centre in fine pieces where segments are only a summary of it.
    pieces: Option<Arc<[Piece]>>,
    roads: Vec<RoadUsed>,
    notes: Vec<String>,
    /// Made when first asked for, and shared with every clone.
    centreline: Arc<OnceLock<Arc<Centreline>>>,
}

impl PartialEq for Course {
    fn eq(&self, other: &Self) -> bool {
        let of = |course: &Self| (course.name.clone(), course.lane_width_m);
        of(self) == of(other) && self.segments == other.segments && self.pieces == other.pieces
    }
}

/// Why there is no such course.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CourseError {
    /// A value out of range.
    #[error(transparent)]
    Range(#[from] RangeError),
    /// A segment, by its number from 1, that cannot be.
    #[error("segment {0}: {1}")]
    Segment(usize, Box<Self>),
    /// No segment at all.
    #[error("a course needs at least one [[segment]]")]
    Empty,
    /// A quantity that is given for all of a segment and for an end of it.
    #[error("give either `{whole}` or `{start}` and `{end}`, not both", whole = .0[0], start = .0[1], end = .0[2])]
    Both([&'static str; 3]),
    /// A quantity that is given for one end of a segment alone.
    #[error("`{start}` and `{end}` go together", start = .0[1], end = .0[2])]
    OneEnd([&'static str; 3]),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CourseFile {
    #[serde(default = "default_lane_width")]
    lane_width_m: f64,
    #[serde(default)]
    segment: Vec<SegmentFile>,
}

/// A segment as a person writes it, in a course file or in a scenario.
#[derive(Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct SegmentFile {
    length_m: f64,
    curvature_per_m: Option<f64>,
    curvature_start_per_m: Option<f64>,
    curvature_end_per_m: Option<f64>,
    bank_rad: Option<f64>,
    bank_start_rad: Option<f64>,
    bank_end_rad: Option<f64>,
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
        // Every caller's is a clone, so that its curve is made once.
        static PAPER: LazyLock<Course> = LazyLock::new(Course::make_paper);
        PAPER.clone()
    }

    fn make_paper() -> Self {
        let curve = |curvature_1pm: f64, clothoid_m, arc_m| {
            [
                Segment::clothoid(clothoid_m, 0.0, curvature_1pm),
                Segment::arc(arc_m, curvature_1pm),
                Segment::clothoid(clothoid_m, curvature_1pm, 0.0),
            ]
        };
        let mut segments = vec![Segment::straight(1080.0)];
        segments.extend(curve(1.0 / 300.0, 80.0, 300.0));
        segments.push(Segment::straight(200.0));
        segments.extend(curve(-1.0 / 400.0, 80.0, 250.0));
        segments.push(Segment::straight(200.0));
        segments.extend(curve(1.0 / 600.0, 100.0, 400.0));
        segments.push(Segment::straight(400.0));
        Self::of_segments(PAPER_COURSE, DEFAULT_LANE_WIDTH_M, segments)
    }

    pub(super) fn of_segments(name: impl Into<String>, lane_width_m: f64, segments: Vec<Segment>) -> Self {
        Self {
            name: name.into(),
            lane_width_m,
            segments,
            pieces: None,
            roads: Vec::new(),
            notes: Vec::new(),
            centreline: Arc::default(),
        }
    }

    /// A lane's centre in fine pieces; `segments` sum it up for pictures.
    pub(super) fn of_pieces(name: &str, pieces: Vec<Piece>, segments: Vec<Segment>) -> Self {
        let widths = pieces.iter().flat_map(|piece| piece.width_m);
        let narrowest = widths.fold(f64::INFINITY, f64::min);
        Self {
            pieces: Some(pieces.into()),
            ..Self::of_segments(name, narrowest, segments)
        }
    }

    pub(super) fn with_roads(self, roads: Vec<RoadUsed>, notes: Vec<String>) -> Self {
        Self { roads, notes, ..self }
    }

    /// A course from its segments, in order of arc length. `name` stands for it in results and errors.
    ///
    /// # Errors
    /// No segment; a lane width, a length or a curvature out of range; a course that is too long.
    pub fn new(
        name: impl Into<String>,
        lane_width_m: f64,
        segments: Vec<Segment>,
    ) -> Result<Self, CourseError> {
        COURSE_FIELDS[0].check(lane_width_m)?;
        if segments.is_empty() {
            return Err(CourseError::Empty);
        }
        for (i, segment) in segments.iter().enumerate() {
            segment
                .check()
                .map_err(|e| CourseError::Segment(i + 1, Box::new(e.into())))?;
        }
        let course = Self::of_segments(name, lane_width_m, segments);
        let length_m = course.length_m();
        in_range("course length", length_m, MIN_SEGMENT_M..=MAX_COURSE_M, "m")?;
        let sharpest = |s: &Segment| s.curvature_start_1pm.abs().max(s.curvature_end_1pm.abs());
        let turn = course.segments.iter().map(|s| s.length_m * sharpest(s)).sum();
        in_range("total turn", turn, 0.0..=MAX_TURN_RAD, "rad")?;
        Ok(course)
    }

    /// A course file's text: a lane of OpenDRIVE if the file's name ends with `.xodr`, else TOML.
    ///
    /// # Errors
    /// As [`Course::from_opendrive`] and [`Course::from_toml`]; a lane chosen of a file that has none.
    pub fn from_text(name: &str, text: &str, lane: &LaneChoice) -> Result<Self, InputError> {
        if name.to_ascii_lowercase().ends_with(".xodr") {
            return Self::from_opendrive(name, text, lane);
        }
        lane.check_none(name)?;
        Self::from_toml(name, text)
    }

    /// A lane of an OpenDRIVE file's text; `name` stands for the file in errors and results.
    ///
    /// # Errors
    /// What is broken, missing or not supported, by road and element.
    pub fn from_opendrive(name: &str, text: &str, choice: &LaneChoice) -> Result<Self, InputError> {
        let course = opendrive::read(name, text, choice).map_err(|e| InputError::new(name, e))?;
        let length_m = course.length_m();
        let fits = in_range("course length", length_m, MIN_SEGMENT_M..=MAX_COURSE_M, "m");
        fits.map_err(|e| InputError::new(name, e))?;
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
        Self::of_file(name, file.lane_width_m, &file.segment)
    }

    /// Checks the segments of a file; `name` stands for the file in errors and results.
    ///
    /// # Errors
    /// A value out of range (by segment, field, value and range); a quantity that is given twice or by half.
    pub fn of_file(name: &str, lane_width_m: f64, segments: &[SegmentFile]) -> Result<Self, InputError> {
        let segments = segments.iter().enumerate().map(|(i, segment)| {
            let parsed = segment.parsed();
            parsed.map_err(|e| CourseError::Segment(i + 1, Box::new(e)))
        });
        let course = segments.collect::<Result<_, _>>();
        let course = course.and_then(|segments| Self::new(name, lane_width_m, segments));
        course.map_err(|e| InputError::new(name, e))
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

    /// Whether no part of the course is banked. A grade does not move a vehicle of a given speed.
    pub fn is_level(&self) -> bool {
        match &self.pieces {
            Some(pieces) => pieces.iter().all(|piece| piece.bank_rad == [0.0; 2]),
            None => self.segments.iter().all(|segment| segment.bank_rad == [0.0; 2]),
        }
    }

    /// Whether the segments are all there is to the course.
    pub fn is_of_segments(&self) -> bool {
        self.pieces.is_none()
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

    /// The course as a curve, made once for it and all its clones.
    pub fn centreline(&self) -> Arc<Centreline> {
        let made = self.centreline.get_or_init(|| Arc::new(Centreline::new(self)));
        Arc::clone(made)
    }

    /// Arc length of the whole centreline, m.
    pub fn length_m(&self) -> f64 {
        match &self.pieces {
            Some(pieces) => pieces.iter().map(|piece| piece.length_m).sum(),
            None => self.segments.iter().map(|s| s.length_m).sum(),
        }
    }
}

impl Segment {
    /// A straight.
    pub fn straight(length_m: f64) -> Self {
        Self::arc(length_m, 0.0)
    }

    /// A piece of constant curvature.
    pub fn arc(length_m: f64, curvature_1pm: f64) -> Self {
        Self::clothoid(length_m, curvature_1pm, curvature_1pm)
    }

    /// A piece whose curvature goes from one value to another.
    pub fn clothoid(length_m: f64, curvature_start_1pm: f64, curvature_end_1pm: f64) -> Self {
        Self {
            length_m,
            curvature_start_1pm,
            curvature_end_1pm,
            bank_rad: [0.0; 2],
            grade: [0.0; 2],
        }
    }

    /// The segment with a bank (rad, positive where the left edge is the higher one) and a grade (rise per distance),
    /// each at the start and at the end.
    #[must_use]
    pub fn with_surface(self, bank_rad: [f64; 2], grade: [f64; 2]) -> Self {
        Self {
            bank_rad,
            grade,
            ..self
        }
    }

    fn check(&self) -> Result<(), RangeError> {
        let [length, varying @ ..] = SEGMENT_FIELDS else {
            return Ok(());
        };
        length.check(self.length_m)?;
        let curvature = [self.curvature_start_1pm, self.curvature_end_1pm];
        for (fields, [start, end]) in varying
            .chunks_exact(3)
            .zip([curvature, self.bank_rad, self.grade])
        {
            let is_constant = start.to_bits() == end.to_bits();
            fields[usize::from(!is_constant)].check(start)?;
            fields[2].check(end)?;
        }
        Ok(())
    }
}

impl From<&Segment> for SegmentFile {
    fn from(segment: &Segment) -> Self {
        Self {
            length_m: segment.length_m,
            curvature_start_per_m: Some(segment.curvature_start_1pm),
            curvature_end_per_m: Some(segment.curvature_end_1pm),
            bank_start_rad: Some(segment.bank_rad[0]),
            bank_end_rad: Some(segment.bank_rad[1]),
            grade_start: Some(segment.grade[0]),
            grade_end: Some(segment.grade[1]),
            ..Self::default()
        }
    }
}

impl SegmentFile {
    fn parsed(&self) -> Result<Segment, CourseError> {
        let curvature = [
            self.curvature_per_m,
            self.curvature_start_per_m,
            self.curvature_end_per_m,
        ];
        let bank = [self.bank_rad, self.bank_start_rad, self.bank_end_rad];
        let grade = [self.grade, self.grade_start, self.grade_end];
        let [start, end] = ends(1, curvature)?;
        let segment = Segment::clothoid(self.length_m, start, end);
        Ok(segment.with_surface(ends(4, bank)?, ends(7, grade)?))
    }
}

/// A quantity of a segment: for all of it, or at its start and its end. `first` is its place in [`SEGMENT_FIELDS`].
fn ends(first: usize, given: [Option<f64>; 3]) -> Result<[f64; 2], CourseError> {
    let names = [0, 1, 2].map(|i| SEGMENT_FIELDS[first + i].name);
    match given {
        [constant, None, None] => Ok([constant.unwrap_or(0.0); 2]),
        [None, Some(start), Some(end)] => Ok([start, end]),
        [Some(_), ..] => Err(CourseError::Both(names)),
        [None, ..] => Err(CourseError::OneEnd(names)),
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
        let text = "lane_width_m = 3\n[[segment]]\nlength_m = 10\n[[segment]]\nlength_m = 5.5\ncurvature_per_m = -0.01\n\
                    [[segment]]\nlength_m = 7\ncurvature_start_per_m = -0.01\ncurvature_end_per_m = 0.02\n";
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
            ("lane_width_m = 3.6", "at least one [[segment]]"),
            (
                "[[segment]]\nlength_m = 0",
                "segment 1: length_m = 0 m is outside 0.01 to 200000 m",
            ),
            ("[[segment]]\nlength_m = -3", "length_m = -3 m"),
            ("[[segment]]\nlength_m = nan", "length_m = NaN m"),
            ("[[segment]]\nlength_m = inf", "length_m = inf m"),
            (
                "[[segment]]\nlength_m = 9\ncurvature_per_m = 0.2",
                "curvature_per_m = 0.2 1/m is outside -0.1 to 0.1 1/m",
            ),
            (
                "[[segment]]\nlength_m = 9\ncurvature_per_m = nan",
                "curvature_per_m = NaN",
            ),
            (
                "[[segment]]\nlength_m = 9\ncurvature_start_per_m = 0.2\ncurvature_end_per_m = 0",
                "curvature_start_per_m = 0.2",
            ),
            (
                "[[segment]]\nlength_m = 9\ncurvature_start_per_m = 0.0\ncurvature_end_per_m = -1",
                "curvature_end_per_m = -1",
            ),
            (
                "[[segment]]\nlength_m = 9\ncurvature_start_per_m = 0.0",
                "go together",
            ),
            (
                "[[segment]]\nlength_m = 9\ncurvature_per_m = 0\ncurvature_end_per_m = 0",
                "not both",
            ),
            (
                "lane_width_m = 0.5\n[[segment]]\nlength_m = 9",
                "lane_width_m = 0.5 m is outside 2 to 10 m",
            ),
            ("[[segment]]\nlength_m = 9\nradius = 3", "radius"),
            ("lanes = 2\n[[segment]]\nlength_m = 9", "lanes"),
            ("[[segment]]\ncurvature_per_m = 0", "length_m"),
            ("[[segment]]\nlength_m = \"long\"", "line 2"),
            ("[[segment]]\nlength_m = \"long\"", "expected a number"),
            ("[[segment]\nlength_m = 9", "line 1"),
            (
                "[[segment]]\nlength_m = 150000\n[[segment]]\nlength_m = 150000",
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
