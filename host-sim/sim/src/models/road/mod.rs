//! The road: a centreline of straights, arcs and clothoids.
//!
//! `course` holds what a person writes down (segments, lane width) and checks it; `centreline` turns it into
//! a curve that can be projected onto a thousand times a simulated second. Banking, slope and neighbouring
//! lanes are not modelled.

mod centreline;
mod course;

pub use centreline::{Centreline, Projection, Tracker};
pub use course::{Course, CourseError, DEFAULT_LANE_WIDTH_M, MAX_CURVATURE_1PM, PAPER_COURSE, Segment};
