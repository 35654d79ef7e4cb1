//! A course looked at: its length, the roads that it came from, and the centre of the lane every metre.

use haptic_sim::models::road::{Centreline, Course, Pose, RoadUsed, Surface};
use serde::Serialize;

/// Distance between two samples, m.
const STEP_M: f64 = 1.0;

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
        let Pose {
            x_m,
            y_m,
            heading_rad,
        } = line.start().of_local(local);
        let Surface {
            bank_rad,
            grade,
            width_m,
        } = surface;
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
