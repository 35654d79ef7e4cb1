//! The road: the centre of one lane, with its curvature, bank, grade and width.
//!
//! `course` holds what a person writes down (segments, lane width) and checks it; `opendrive` reads a lane out of
//! an OpenDRIVE file and writes a course as one; `centreline` turns either into a curve that can be projected onto
//! a thousand times a simulated second. Neighbouring lanes are not modelled.

mod centreline;
mod course;
mod opendrive;
mod piece;

pub use centreline::{CONVERGED_M, Cell, FORTIETH, MIN_DETERMINANT, OVERRUN_M, SIXTH, Shape};
pub use centreline::{Centreline, Projection, Tracker};
pub use course::{COURSE_FIELDS, Course, CourseError, DEFAULT_LANE_WIDTH_M, MAX_CURVATURE_1PM, PAPER_COURSE};
pub use course::{SEGMENT_FIELDS, Segment, SegmentFile};
pub use opendrive::{LaneChoice, RoadUsed};
pub use piece::{Pose, Surface};
