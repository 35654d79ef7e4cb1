//! A vehicle that brakes or speeds up around the onset of a fault.

use std::fmt;

use haptic_sim::scenario::Speed;
use rand::RngExt;
use rand::rngs::Xoshiro256PlusPlus;

/// Least and most that a speed changes, m/s2: what roads show, and enough to be a change.
const RATE_M_PER_S2: [f64; 2] = [1.0, 4.0];
/// It begins so long before the onset at most, s, and always goes on at the onset.
const BEFORE_S: f64 = 1.3;
/// It begins so long after the onset at most, s: before most faults are declared.
const AFTER_S: f64 = 1.0;

/// A change from one speed to another at a constant rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpeedChange {
    /// Speed before it, km/h.
    pub from_kmh: f64,
    /// Speed behind it, km/h: a run may end before.
    pub to_kmh: f64,
    /// How fast, m/s2; negative while braking.
    pub rate_m_per_s2: f64,
    /// Begins so long after the onset, s; before it if negative.
    pub starts_after_s: f64,
}

impl SpeedChange {
    /// Draws to which of some speeds it leads, how fast, and whether it begins before, at or after the onset.
    pub(super) fn draw(from_kmh: f64, speeds_kmh: &[f64], rng: &mut Xoshiro256PlusPlus) -> Self {
        let others: Vec<f64> = speeds_kmh
            .iter()
            .copied()
            .filter(|kmh| *kmh != from_kmh)
            .collect();
        let to_kmh = others[rng.random_range(0..others.len())];
        let [least, most] = RATE_M_PER_S2;
        let mut change = Self {
            from_kmh,
            to_kmh,
            rate_m_per_s2: rng.random_range(least..most).copysign(to_kmh - from_kmh),
            starts_after_s: 0.0,
        };
        change.starts_after_s = match rng.random_range(0..3) {
            0 => -rng.random_range(0.1..0.9) * change.lasts_s().min(BEFORE_S),
            1 => 0.0,
            _ => rng.random_range(0.1..AFTER_S),
        };
        change
    }

    pub(super) fn first_m_per_s(&self) -> f64 {
        self.from_kmh / 3.6
    }

    fn lasts_s(&self) -> f64 {
        (self.to_kmh - self.from_kmh) / 3.6 / self.rate_m_per_s2
    }

    /// For how much of it the vehicle has changed its speed at a time after the onset, s.
    fn changed_s(&self, after_s: f64) -> f64 {
        (after_s - self.starts_after_s).clamp(0.0, self.lasts_s())
    }

    /// Speed at a time after the onset, km/h.
    pub fn kmh_at(&self, after_s: f64) -> f64 {
        self.from_kmh + 3.6 * self.rate_m_per_s2 * self.changed_s(after_s)
    }

    /// Highest speed up to a time after the onset, m/s.
    pub(super) fn fastest_m_per_s(&self, after_s: f64) -> f64 {
        self.from_kmh.max(self.kmh_at(after_s)) / 3.6
    }

    /// Way from the onset to a time after it, as if the change began there: only differences mean something, m.
    pub(super) fn way_m(&self, after_s: f64) -> f64 {
        let changed_s = self.changed_s(after_s);
        let behind_s = (after_s - self.starts_after_s - changed_s).max(0.0);
        self.first_m_per_s() * after_s + self.rate_m_per_s2 * changed_s * (0.5 * changed_s + behind_s)
    }

    /// When a vehicle has gone so far that is at the onset then, s after its start.
    pub(super) fn time_s_of(&self, onset_m: f64) -> f64 {
        // Of a change that begins before the onset some is done.
        let changed_s = self.changed_s(0.0);
        (onset_m - 0.5 * self.rate_m_per_s2 * changed_s * changed_s) / self.first_m_per_s()
    }

    /// The speed of a scenario with this onset.
    pub(super) fn speed(&self, onset_ms: u32) -> Speed {
        let starts_s = f64::from(onset_ms) * 1e-3 + self.starts_after_s;
        Speed::by_time_kmh(
            vec![starts_s, starts_s + self.lasts_s()],
            &[self.from_kmh, self.to_kmh],
        )
    }
}

impl fmt::Display for SpeedChange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} to {} km/h at {:.2} m/s2 ",
            self.from_kmh, self.to_kmh, self.rate_m_per_s2
        )?;
        match self.starts_after_s {
            0.0 => f.write_str("from the fault on"),
            s if s < 0.0 => write!(f, "from {:.2} s before the fault on", -s),
            s => write!(f, "from {s:.2} s after the fault on"),
        }
    }
}
