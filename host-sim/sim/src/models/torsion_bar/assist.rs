//! Power assist: a torque of the motor for a torque of the bar, by points over torque and speed.

use serde::{Deserialize, Serialize};

use crate::scenario::ScenarioError;

/// A curve by points: linear between them, the last one beyond them, odd in the torque.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Curve {
    /// Torques of the bar, rising from 0, N.m.
    pub torque_nm: Vec<f64>,
    /// Speeds, rising, m/s.
    pub speed_m_per_s: Vec<f64>,
    /// A row for each speed, a torque of the motor for each torque of the bar, N.m, from 0 and never falling.
    pub assist_nm: Vec<Vec<f64>>,
}

/// Curves of usual practice, by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Usual {
    /// No assist.
    #[default]
    None,
    /// Half of medium.
    Light,
    /// A largest slope of 4 at 60 km/h and 20 at a standstill.
    Medium,
    /// 1.25 of medium.
    Strong,
}

impl Usual {
    /// The curves that assist.
    pub const ALL: [Self; 3] = [Self::Light, Self::Medium, Self::Strong];

    /// Its name in a file.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Light => "light",
            Self::Medium => "medium",
            Self::Strong => "strong",
        }
    }

    /// What it amplifies.
    pub fn assist(self) -> Assist {
        match self {
            Self::None => Assist::None,
            Self::Light => Assist::Points(Curve::usual(0.5)),
            Self::Medium => Assist::Points(Curve::usual(1.0)),
            Self::Strong => Assist::Points(Curve::usual(1.25)),
        }
    }
}

/// A curve as a file chooses it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "\"none\", \"light\", \"medium\", \"strong\", or a table of torque_nm, speed_m_per_s and assist_nm"
)]
pub enum CurveChoice {
    /// By name.
    Usual(Usual),
    /// By points.
    Points(Curve),
}

impl Default for CurveChoice {
    fn default() -> Self {
        Self::Usual(Usual::None)
    }
}

impl CurveChoice {
    /// Whether it can be read.
    ///
    /// # Errors
    /// What [`Curve::check`] finds.
    pub fn check(&self) -> Result<(), ScenarioError> {
        match self {
            Self::Usual(_) => Ok(()),
            Self::Points(curve) => curve.check(),
        }
    }

    /// What it amplifies.
    pub fn assist(&self) -> Assist {
        match self {
            Self::Usual(usual) => usual.assist(),
            Self::Points(curve) => Assist::Points(curve.clone()),
        }
    }
}

/// What amplifies the torque of the bar.
#[derive(Debug, Clone, PartialEq)]
pub enum Assist {
    /// Nothing.
    None,
    /// A fixed amplification: a curve at a working point.
    Slope(f64),
    /// A curve by points.
    Points(Curve),
}

/// Where x lies among points: the place of the point before, and the share of the way to the next.
fn place(points: &[f64], x: f64) -> (usize, f64) {
    let before = points.partition_point(|point| *point <= x).saturating_sub(1);
    let before = before.min(points.len() - 2);
    let share = (x - points[before]) / (points[before + 1] - points[before]);
    // Beyond the points there is no more and no less than at the last.
    (before, share.clamp(0.0, 1.0))
}

fn between(row: &[f64], (before, share): (usize, f64)) -> f64 {
    row[before] + share * (row[before + 1] - row[before])
}

impl Curve {
    /// A shape of usual practice, times a factor: with 1 its slope is 4 at 60 km/h and 20 at a standstill.
    pub fn usual(factor: f64) -> Self {
        let shape = [0.0, 0.25, 1.0, 3.5, 7.0, 11.0, 27.0];
        let speeds_kmh = [0.0, 30.0, 60.0, 100.0, 130.0];
        let by_speed = [5.0, 2.0, 1.0, 0.6, 0.5];
        Self {
            torque_nm: vec![0.0, 0.5, 1.0, 2.0, 3.0, 4.0, 8.0],
            speed_m_per_s: speeds_kmh.iter().map(|kmh| kmh / 3.6).collect(),
            assist_nm: (by_speed.iter())
                .map(|share| shape.iter().map(|nm| factor * share * nm).collect())
                .collect(),
        }
    }

    /// Whether it can be read.
    ///
    /// # Errors
    /// The field, and what it has to be.
    pub fn check(&self) -> Result<(), ScenarioError> {
        let rises = |points: &[f64]| points.len() > 1 && points.windows(2).all(|two| two[0] < two[1]);
        let shape = |field, is| Err(ScenarioError::Curve { field, is });
        let numbers = self.assist_nm.iter().flatten();
        if !self
            .torque_nm
            .iter()
            .chain(&self.speed_m_per_s)
            .chain(numbers)
            .all(|x| x.is_finite())
        {
            return shape("assist.curve", "finite numbers");
        }
        if !rises(&self.torque_nm) || self.torque_nm[0] != 0.0 {
            return shape("assist.curve.torque_nm", "two numbers or more, rising from 0");
        }
        if !rises(&self.speed_m_per_s) || self.speed_m_per_s[0] < 0.0 {
            return shape(
                "assist.curve.speed_m_per_s",
                "two numbers or more, rising, none below 0",
            );
        }
        if self.assist_nm.len() != self.speed_m_per_s.len() {
            return shape("assist.curve.assist_nm", "a row for each speed");
        }
        let falls = |row: &Vec<f64>| row.windows(2).any(|two| two[1] < two[0]);
        let wrong = |row: &Vec<f64>| row.len() != self.torque_nm.len() || row[0] != 0.0 || falls(row);
        if self.assist_nm.iter().any(wrong) {
            return shape(
                "assist.curve.assist_nm",
                "in each row a number for each torque, from 0, never falling",
            );
        }
        Ok(())
    }

    /// The assist for a torque, N.m.
    pub fn at(&self, torque_nm: f64, v_m_per_s: f64) -> f64 {
        let (slow, share) = place(&self.speed_m_per_s, v_m_per_s);
        let along = place(&self.torque_nm, torque_nm.abs());
        let [a, b] = [slow, slow + 1].map(|row| between(&self.assist_nm[row], along));
        (a + share * (b - a)).copysign(torque_nm)
    }

    /// Its slope just above a torque's size.
    pub fn slope(&self, torque_nm: f64, v_m_per_s: f64) -> f64 {
        let size = torque_nm.abs();
        let (before, _) = place(&self.torque_nm, size);
        if size >= self.torque_nm[self.torque_nm.len() - 1] {
            return 0.0;
        }
        let [from, to] = [before, before + 1].map(|k| self.torque_nm[k]);
        (self.at(to, v_m_per_s) - self.at(from, v_m_per_s)) / (to - from)
    }

    /// Its largest slope at a speed.
    pub fn steepest(&self, v_m_per_s: f64) -> f64 {
        let slopes = self.torque_nm.iter().map(|torque| self.slope(*torque, v_m_per_s));
        slopes.fold(0.0, f64::max)
    }
}

impl Assist {
    /// The motor's torque for what the compensator hands on, N.m.
    pub fn at(&self, torque_nm: f64, v_m_per_s: f64) -> f64 {
        match self {
            Self::None => 0.0,
            Self::Slope(slope) => slope * torque_nm,
            Self::Points(curve) => curve.at(torque_nm, v_m_per_s),
        }
    }

    /// Its largest slope at a speed.
    pub fn steepest(&self, v_m_per_s: f64) -> f64 {
        match self {
            Self::None => 0.0,
            Self::Slope(slope) => *slope,
            Self::Points(curve) => curve.steepest(v_m_per_s),
        }
    }

    /// Its slope just above a torque's size.
    pub fn slope(&self, torque_nm: f64, v_m_per_s: f64) -> f64 {
        match self {
            Self::None => 0.0,
            Self::Slope(slope) => *slope,
            Self::Points(curve) => curve.slope(torque_nm, v_m_per_s),
        }
    }
}
