//! What of the paper several studies drive: its three drivers, the remnants of its participants, the first curve of its course.

use haptic_sim::models::road::{Course, CourseError, DEFAULT_LANE_WIDTH_M, Segment};

/// Processing delays of the three drivers, s (table 7).
pub const DRIVERS_T_P: [f64; 3] = [0.1, 0.3, 0.5];
/// Standard deviation of the remnant in manual driving, N.m.
pub const REMNANT_MANUAL_NM: f64 = 0.097;
/// Standard deviation of the remnant with guidance, N.m.
pub const REMNANT_GUIDED_NM: f64 = 0.072;
/// Length of the last straight of [`stretched_curve`], m at 60 km/h.
const LAST_STRAIGHT_M: f64 = 400.0;

/// The first curve of the paper's course, every length `k` and every radius `k^2` times as long: at `k` times 60 km/h it is met at
/// the same time, with the same lateral acceleration of 0.93 m/s2.
pub fn stretched_curve(k: f64) -> Result<Course, CourseError> {
    let curvature = 1.0 / (300.0 * k * k);
    let (clothoid, arc) = (80.0 * k, 300.0 * k);
    let segments = vec![
        Segment::straight(120.0 * k),
        Segment::clothoid(clothoid, 0.0, curvature),
        Segment::arc(arc, curvature),
        Segment::clothoid(clothoid, curvature, 0.0),
        Segment::straight(LAST_STRAIGHT_M * k),
    ];
    let name = "first curve of paper-course, stretched";
    Course::new(name, DEFAULT_LANE_WIDTH_M, segments)
}
