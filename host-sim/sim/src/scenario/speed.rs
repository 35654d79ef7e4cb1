//! How fast the vehicle goes: at one speed, or through points by time or by place.
//!
//! Between two points the acceleration is constant, whatever the points are of; before the first and behind the last the
//! speed is theirs. So speed is linear in time, and its square linear in place. A profile by place is then one by time too,
//! on a road that is followed exactly, and how long a run lasts is a sum over stretches.

use std::fmt;
use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};

use super::ScenarioError;
use crate::input::in_range;

/// Speeds that a scenario may have all the time, m/s: 20 to 250 km/h and a little more. The controller guides from 5 m/s on.
pub const SPEED_M_PER_S: RangeInclusive<f64> = 5.5..=70.0;
/// Speeds that one may go through, m/s: below what is guided, and no standstill, whose equations are others.
pub const CHANGING_SPEED_M_PER_S: RangeInclusive<f64> = 2.5..=70.0;
/// Accelerations between two points, m/s2: full braking on a dry road, and more than most cars can accelerate.
pub const ACCELERATION_M_PER_S2: RangeInclusive<f64> = -8.0..=5.0;
/// Where the points of a profile may lie.
const TIMES_S: RangeInclusive<f64> = 0.0..=1e6;
const PLACES_M: RangeInclusive<f64> = 0.0..=1e6;

/// Speed as a scenario says it, not yet checked.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged, try_from = "InFile")]
pub enum Speed {
    /// One speed all the time, m/s. In a file it is a number at the top.
    #[serde(skip)]
    Constant(f64),
    /// Through points by time.
    ByTime {
        /// Seconds since the start.
        time_s: Vec<f64>,
        /// Speeds there.
        speed_m_per_s: Vec<f64>,
    },
    /// Through points by place.
    ByPlace {
        /// Arc length along the centreline.
        place_m: Vec<f64>,
        /// Speeds there.
        speed_m_per_s: Vec<f64>,
    },
}

/// A table [speed].
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct InFile {
    time_s: Option<Vec<f64>>,
    place_m: Option<Vec<f64>>,
    speed_m_per_s: Option<Vec<f64>>,
    speed_kmh: Option<Vec<f64>>,
}

impl TryFrom<InFile> for Speed {
    type Error = &'static str;

    fn try_from(file: InFile) -> Result<Self, Self::Error> {
        let of_kmh = |kmh: Vec<f64>| kmh.iter().map(|kmh| kmh / 3.6).collect();
        let wanted = "expected a table [speed] with either `time_s` or `place_m` and either `speed_m_per_s` or \
                      `speed_kmh`, each a list of numbers";
        let speed_m_per_s = match (file.speed_m_per_s, file.speed_kmh) {
            (Some(m_per_s), None) => m_per_s,
            (None, Some(kmh)) => of_kmh(kmh),
            _ => return Err(wanted),
        };
        match (file.time_s, file.place_m) {
            (Some(time_s), None) => Ok(Self::ByTime {
                time_s,
                speed_m_per_s,
            }),
            (None, Some(place_m)) => Ok(Self::ByPlace {
                place_m,
                speed_m_per_s,
            }),
            _ => Err(wanted),
        }
    }
}

/// A speed in km/h, for people to read: the number of km/h that it was made of, if it was.
fn kmh(m_per_s: f64) -> f64 {
    (3.6e9 * m_per_s).round() / 1e9
}

impl Speed {
    /// One speed all the time.
    pub fn constant_kmh(kmh: f64) -> Self {
        Self::Constant(kmh / 3.6)
    }

    /// Through speeds (km/h) by time (s).
    pub fn by_time_kmh(time_s: Vec<f64>, kmh: &[f64]) -> Self {
        let speed_m_per_s = kmh.iter().map(|kmh| kmh / 3.6).collect();
        Self::ByTime {
            time_s,
            speed_m_per_s,
        }
    }

    /// The largest, m/s.
    #[must_use]
    pub fn fastest_m_per_s(&self) -> f64 {
        match self {
            Self::Constant(m_per_s) => *m_per_s,
            Self::ByTime { speed_m_per_s, .. } | Self::ByPlace { speed_m_per_s, .. } => {
                speed_m_per_s.iter().copied().fold(0.0, f64::max)
            }
        }
    }

    /// What it is at the start, km/h.
    pub fn start_kmh(&self) -> f64 {
        let points = match self {
            Self::Constant(m_per_s) => return kmh(*m_per_s),
            Self::ByTime { speed_m_per_s, .. } | Self::ByPlace { speed_m_per_s, .. } => speed_m_per_s,
        };
        points.first().map_or(f64::NAN, |first| kmh(*first))
    }

    /// Checks everything.
    pub(super) fn profile(&self) -> Result<SpeedProfile, ScenarioError> {
        match self {
            Self::Constant(m_per_s) => {
                in_range("speed_m_per_s", *m_per_s, SPEED_M_PER_S, "m/s")?;
                Ok(SpeedProfile::constant(*m_per_s))
            }
            Self::ByTime {
                time_s,
                speed_m_per_s,
            } => SpeedProfile::through(Axis::Time, time_s, speed_m_per_s),
            Self::ByPlace {
                place_m,
                speed_m_per_s,
            } => SpeedProfile::through(Axis::Place, place_m, speed_m_per_s),
        }
    }
}

impl fmt::Display for Speed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (points, by) = match self {
            Self::Constant(m_per_s) => return write!(f, "{} km/h", kmh(*m_per_s)),
            Self::ByTime { speed_m_per_s, .. } => (speed_m_per_s, "time"),
            Self::ByPlace { speed_m_per_s, .. } => (speed_m_per_s, "place"),
        };
        let least = points.iter().copied().fold(f64::INFINITY, f64::min);
        let most = points.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        write!(f, "{} to {} km/h by {by}", kmh(least), kmh(most))
    }
}

/// What the points are of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Axis {
    Time,
    Place,
}

/// A point, and how it goes on from there.
#[derive(Debug, Clone, Copy, PartialEq)]
struct SpeedPoint {
    time_s: f64,
    place_m: f64,
    v_m_per_s: f64,
    acceleration_m_per_s2: f64,
}

/// A speed over a run, checked.
#[derive(Debug, Clone, PartialEq)]
pub struct SpeedProfile {
    axis: Axis,
    /// The first is the start; behind the last the speed stays.
    points: Vec<SpeedPoint>,
}

impl SpeedProfile {
    pub(super) fn constant(v_m_per_s: f64) -> Self {
        Self {
            axis: Axis::Time,
            points: vec![SpeedPoint {
                time_s: 0.0,
                place_m: 0.0,
                v_m_per_s,
                acceleration_m_per_s2: 0.0,
            }],
        }
    }

    fn through(axis: Axis, at: &[f64], speeds: &[f64]) -> Result<Self, ScenarioError> {
        let (field, unit, range) = match axis {
            Axis::Time => ("speed.time_s", "s", TIMES_S),
            Axis::Place => ("speed.place_m", "m", PLACES_M),
        };
        let refused = |message: String| Err(ScenarioError::Speed(message));
        if at.len() != speeds.len() {
            return refused(format!(
                "{field} has {} and speed.speed_m_per_s {} values: each point takes one of both",
                at.len(),
                speeds.len()
            ));
        }
        if at.len() < 2 {
            return refused(format!(
                "{field}: a speed that changes takes two points at least, not {}; one that does not is `speed_m_per_s = 20`",
                at.len()
            ));
        }
        let mut profile = Self::constant(speeds[0]);
        profile.axis = axis;
        for (i, (at, v)) in at.iter().zip(speeds).enumerate() {
            let number = i + 1;
            in_range(&format!("{field} (point {number})"), *at, range.clone(), unit)?;
            in_range(
                &format!("speed.speed_m_per_s (point {number})"),
                *v,
                CHANGING_SPEED_M_PER_S,
                "m/s",
            )?;
            profile.add_point(number, *at, *v, (field, unit))?;
        }
        Ok(profile)
    }

    /// Appends a point.
    fn add_point(
        &mut self,
        number: usize,
        at: f64,
        v: f64,
        (field, unit): (&str, &str),
    ) -> Result<(), ScenarioError> {
        let last = self.points.len() - 1;
        let from = &mut self.points[last];
        let u = from.v_m_per_s;
        let stretch = match self.axis {
            Axis::Time => at - from.time_s,
            Axis::Place => at - from.place_m,
        };
        if stretch <= 0.0 {
            if number == 1 {
                return Ok(());
            }
            return Err(ScenarioError::Speed(format!(
                "{field} (point {number}) = {at} {unit} is not behind point {}: the points have to follow each other",
                number - 1
            )));
        }
        let (lasts_s, length_m) = match self.axis {
            Axis::Time => (stretch, 0.5 * (u + v) * stretch),
            Axis::Place => (2.0 * stretch / (u + v), stretch),
        };
        let acceleration = (v - u) / lasts_s;
        let name = format!("speed: acceleration to point {number}");
        // Whole thousandths, for people to read.
        let rounded = (1e3 * acceleration).round() / 1e3;
        in_range(&name, rounded, ACCELERATION_M_PER_S2, "m/s2")?;
        from.acceleration_m_per_s2 = acceleration;
        let (time_s, place_m) = (from.time_s + lasts_s, from.place_m + length_m);
        self.points.push(SpeedPoint {
            time_s,
            place_m,
            v_m_per_s: v,
            acceleration_m_per_s2: 0.0,
        });
        Ok(())
    }

    /// Whether nothing changes.
    pub(crate) fn is_constant(&self) -> bool {
        self.points.len() == 1
    }

    /// Speed at the start, m/s.
    pub(crate) fn start_m_per_s(&self) -> f64 {
        self.points[0].v_m_per_s
    }

    /// Speed at a time at which the vehicle is at some place, m/s.
    pub fn at(&self, time_s: f64, place_m: f64) -> f64 {
        match self.axis {
            Axis::Time => {
                let point = self.last_before(|p| p.time_s, time_s);
                point.v_m_per_s + point.acceleration_m_per_s2 * (time_s - point.time_s)
            }
            Axis::Place => {
                let point = self.last_before(|p| p.place_m, place_m);
                let behind_m = (place_m - point.place_m).max(0.0);
                (point.v_m_per_s * point.v_m_per_s + 2.0 * point.acceleration_m_per_s2 * behind_m).sqrt()
            }
        }
    }

    /// Way along a road that is followed exactly until a time, m.
    pub(crate) fn way_m(&self, time_s: f64) -> f64 {
        let point = self.last_before(|p| p.time_s, time_s);
        let after_s = time_s - point.time_s;
        point.place_m + after_s * (point.v_m_per_s + 0.5 * point.acceleration_m_per_s2 * after_s)
    }

    /// When a point that lies some seconds ahead first comes to the end of a road, s, and the speed then, m/s.
    pub(crate) fn end(&self, length_m: f64, ahead_s: f64) -> (f64, f64) {
        let ends_s = self.points.iter().skip(1).map(|p| p.time_s);
        for (point, end_s) in self.points.iter().zip(ends_s.chain([f64::INFINITY])) {
            let (v, a) = (point.v_m_per_s, point.acceleration_m_per_s2);
            // (a/2)*t^2 + slope*t = missing_m, its first root in the form that does not cancel.
            let missing_m = length_m - point.place_m - v * ahead_s;
            let slope = v + a * ahead_s;
            if missing_m <= 0.0 {
                return (point.time_s, v);
            }
            let root = slope * slope + 2.0 * a * missing_m;
            if slope <= 0.0 || root < 0.0 {
                continue;
            }
            let after_s = if a == 0.0 {
                missing_m / slope
            } else {
                2.0 * missing_m / (slope + root.sqrt())
            };
            if point.time_s + after_s <= end_s {
                return (point.time_s + after_s, v + a * after_s);
            }
        }
        // The last point has no end: not reached.
        (f64::INFINITY, self.points[self.points.len() - 1].v_m_per_s)
    }

    fn last_before(&self, key: impl Fn(&SpeedPoint) -> f64, x: f64) -> &SpeedPoint {
        let after = self.points.partition_point(|point| key(point) <= x);
        &self.points[after.saturating_sub(1)]
    }
}

#[cfg(test)]
mod tests;
