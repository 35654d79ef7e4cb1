//! The bends in which an input is lost, and the instants at which it is.

use std::fmt;

use serde::Serialize;

use haptic_sim::models::road::{Course, CourseError, DEFAULT_LANE_WIDTH_M, Segment};
use haptic_sim::scenario::DEFAULT_SPEED_KMH;

/// Speeds, km/h.
const SPEEDS_KMH: [f64; 5] = [40.0, 60.0, 80.0, 100.0, 130.0];
/// Radii, m. The last is there for 130 km/h: on 800 m none of the paper's drivers keeps the lane by hand at that speed.
const RADII_M: [f64; 7] = [100.0, 200.0, 300.0, 400.0, 500.0, 800.0, 1200.0];
/// Lateral accelerations that are driven, m/s2. Below, a bend asks for little torque; more than the upper one few drivers choose,
/// and beyond it the paper's drivers leave the lane by hand.
const DRIVEN_M_PER_S2: [f64; 2] = [0.5, 2.0];
/// Length of a clothoid in radii, as in the first curve of the paper's course.
const CLOTHOID: f64 = 80.0 / 300.0;
/// How long an arc lasts, s: the torque settles in it.
const ARC_S: f64 = 6.0;
/// The straight before the bend; guidance needs 2 s of it.
const BEFORE_S: f64 = 6.0;
/// Instants are taken from so long before the bend to so long behind it, s.
const BEYOND_S: f64 = 2.0;

/// Which way a bend turns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// Positive curvature.
    Left,
    /// Negative curvature.
    Right,
}

impl fmt::Display for Side {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Left => "left",
            Self::Right => "right",
        })
    }
}

/// A straight, a clothoid, an arc, a clothoid and a straight, at one speed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Bend {
    /// Whether it is the first curve of the paper's course.
    pub is_papers: bool,
    /// Speed, km/h.
    pub speed_kmh: f64,
    /// Radius of the arc, m.
    pub radius_m: f64,
    /// How long the straight before it, a clothoid and the arc last, s.
    #[serde(skip)]
    lasts_s: [f64; 3],
}

impl Bend {
    /// The first curve of the paper's course, its first straight shortened from 1080 m to 120 m.
    pub(super) const PAPERS: Self = Self {
        is_papers: true,
        speed_kmh: DEFAULT_SPEED_KMH,
        radius_m: 300.0,
        // 120, 80 and 300 m at 60 km/h.
        lasts_s: [7.2, 4.8, 18.0],
    };

    /// The paper's, and every speed on every radius with a lateral acceleration that is driven.
    pub(super) fn all() -> Vec<Self> {
        let pairs = SPEEDS_KMH
            .iter()
            .flat_map(|speed_kmh| RADII_M.map(|radius_m| (*speed_kmh, radius_m)));
        let bends = pairs.map(|(speed_kmh, radius_m)| Self {
            is_papers: false,
            speed_kmh,
            radius_m,
            lasts_s: [BEFORE_S, CLOTHOID * radius_m / (speed_kmh / 3.6), ARC_S],
        });
        let [least, most] = DRIVEN_M_PER_S2;
        let driven = bends.filter(|bend| (least..=most).contains(&bend.lateral_m_per_s2()));
        std::iter::once(Self::PAPERS).chain(driven).collect()
    }

    fn m_per_s(&self) -> f64 {
        self.speed_kmh / 3.6
    }

    /// Lateral acceleration in the arc, m/s2.
    pub fn lateral_m_per_s2(&self) -> f64 {
        self.m_per_s().powi(2) / self.radius_m
    }

    /// The road, with so long a straight behind the bend.
    pub(super) fn course(&self, side: Side, behind_s: f64) -> Result<Course, CourseError> {
        let curvature = match side {
            Side::Left => 1.0 / self.radius_m,
            Side::Right => -1.0 / self.radius_m,
        };
        let [before_m, clothoid_m, arc_m] = self.lasts_s.map(|s| s * self.m_per_s());
        let segments = vec![
            Segment::straight(before_m),
            Segment::clothoid(clothoid_m, 0.0, curvature),
            Segment::arc(arc_m, curvature),
            Segment::clothoid(clothoid_m, curvature, 0.0),
            Segment::straight(behind_s * self.m_per_s()),
        ];
        Course::new("bend", DEFAULT_LANE_WIDTH_M, segments)
    }

    /// When the bend begins, s after the start of the drive.
    pub(super) fn begins_s(&self) -> f64 {
        self.lasts_s[0]
    }

    /// When it is over, s.
    pub(super) fn ends_s(&self) -> f64 {
        let [before_s, clothoid_s, arc_s] = self.lasts_s;
        before_s + 2.0 * clothoid_s + arc_s
    }

    /// The instants of a failure, s after the start of the drive.
    pub(super) fn instants_s(&self, every_s: f64) -> impl Iterator<Item = f64> {
        let from_s = self.begins_s() - BEYOND_S;
        let count = ((self.ends_s() + BEYOND_S - from_s) / every_s + 1e-9) as u32;
        (0..=count).map(move |place| from_s + f64::from(place) * every_s)
    }

    /// Where the vehicle is at an instant, in words.
    pub(super) fn place(&self, instant_s: f64) -> String {
        let [before_s, clothoid_s, arc_s] = self.lasts_s;
        let into_s = instant_s - before_s;
        let parts = [
            ("the entry", 0.0, clothoid_s),
            ("the arc", clothoid_s, clothoid_s + arc_s),
            ("the exit", clothoid_s + arc_s, 2.0 * clothoid_s + arc_s),
        ];
        if into_s < 0.0 {
            return format!("{:.2} s before the bend", -into_s);
        }
        match parts.iter().find(|(_, _, until_s)| into_s < *until_s) {
            Some((part, from_s, _)) => format!("{:.2} s into {part}", into_s - from_s),
            None => format!("{:.2} s behind the bend", instant_s - self.ends_s()),
        }
    }
}
