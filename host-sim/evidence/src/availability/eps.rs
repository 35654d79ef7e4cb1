//! How often an EPS that faults on limits of its own would leave the guidance alone: segments of [`availability`](super),
//! in which nothing is wrong, heard as such an EPS hears them, by a frame every 10 ms while guidance acts.
//!
//! Others found the limits on the road, in units of their cars; how these become N.m is a guess of ours. The drive goes on behind a fault, in
//! which guidance would be gone, so only the first of a segment counts.

use std::collections::VecDeque;

use haptic_batch::engine::{Watch, each};
use haptic_batch::{Confidence, Rate, StudyError};
use haptic_core::safety::modes::Mode;
use haptic_sim::Simulation;
use haptic_sim::guidance::OverBus;
use haptic_sim::worlds::WORLDS;
use serde::Serialize;

use super::{Listener, ROADS, SEGMENT_S, SegmentNumber};

/// Worlds, in the order of theirs.
const DRIVEN: [&str; 3] = ["calibrated", "everything", "bar"];

/// Torques of a frame, N.m: by how much the request fell, what the motor gives, what the torque sensor reads.
pub type Heard = [f64; 3];

/// A limit of an EPS: what is limited, who found it, and beyond how many N.m the EPS faults; its frames, what of each, and of all.
#[rustfmt::skip]
pub struct Limit(pub &'static str, pub &'static str, pub f64, usize, fn(Heard) -> f64, fn(&VecDeque<f64>) -> f64);

/// Every limit. Shares of the most that a car's request may be are taken of our 5 N.m.
#[rustfmt::skip]
pub const LIMITS: [Limit; 3] = [
    Limit("motor less driver, mean of 3 s", "opendbc 3126: 3,900 units x s, of 2,047 at most", 5.0 * 3900.0 / 3.0 / 2047.0, 300,
        |[_, motor, driver]| motor.abs() - driver.abs(), |values| values.iter().sum::<f64>() / values.len() as f64),
    Limit("driver's torque, more than 50 frames", "openpilot 24943: 500 units, taken for 0.01 N.m each", 5.0, 51,
        |[.., driver]| driver.abs(), |values| values.iter().copied().fold(f64::INFINITY, f64::min)),
    Limit("jerk: the request falls in a frame", "openpilot 24054: 45 units, of 1,500 at most", 5.0 * 45.0 / 1500.0, 1,
        |[fell, ..]| fell, |values| values[0]),
];

/// A limit over a segment.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Seen {
    last: VecDeque<f64>,
    /// The most that was reached, N.m.
    pub most_nm: f64,
    /// Whether that was too much once.
    pub faulted: bool,
    /// Frames with guidance before.
    pub frames: u32,
}

impl Seen {
    /// Takes a frame; none while guidance is away.
    pub fn hear(&mut self, Limit(_, _, level_nm, frames, of, of_all): &Limit, heard: Option<Heard>) {
        let Some(heard) = heard else {
            return self.last.clear();
        };
        self.frames += u32::from(!self.faulted);
        self.last.push_back(of(heard));
        if self.last.len() == *frames {
            self.most_nm = self.most_nm.max(of_all(&self.last));
            self.faulted |= self.most_nm > *level_nm;
            self.last.pop_front();
        }
    }
}

/// A limit in a world.
#[derive(Debug, Serialize)]
pub struct Row {
    /// The world.
    pub world: &'static str,
    /// What is limited.
    pub limit: &'static str,
    /// Beyond it the EPS faults, N.m.
    pub level_nm: f64,
    /// Segments with a fault, in the time with guidance before.
    pub faults: Rate,
    /// The most that any segment reached, N.m.
    pub most_nm: f64,
}

/// Drives a segment with the shipping ECU.
fn drive(segment: &SegmentNumber, seed: u64) -> Result<[Seen; LIMITS.len()], StudyError> {
    let scenario = segment.scenario(seed)?;
    let mut simulation = Simulation::with(&scenario, OverBus::new(scenario.setup()));
    let (mut listener, mut asked_nm) = (Listener::new(), None);
    let mut seen: [Seen; LIMITS.len()] = Default::default();
    while listener.steps < SEGMENT_S as u32 * 1000
        && listener.reported.mode != Mode::Fault
        && let Some(outcome) = simulation.step(&listener.action())
    {
        listener.observe(&outcome);
        if outcome.observation.step.is_multiple_of(10) {
            let acts = matches!(listener.reported.mode, Mode::Active | Mode::Handover);
            let now_nm = acts.then_some(outcome.decided.torque_nm.abs());
            let heard = now_nm.map(|now_nm| {
                let fell = asked_nm.map_or(0.0, |before_nm: f64| before_nm - now_nm);
                let now = &outcome.observation;
                [fell, now.motor_torque_nm, now.driver_torque_nm]
            });
            asked_nm = now_nm;
            (seen.iter_mut().zip(&LIMITS)).for_each(|(seen, limit)| seen.hear(limit, heard));
        }
    }
    Ok(seen)
}

/// Drives so many hours on each road of each of three worlds.
///
/// # Errors
/// What [`SegmentNumber::scenario`] says.
pub fn study(hours: f64, seed: u64, watch: &Watch<'_>) -> Result<Vec<Row>, StudyError> {
    let count = (hours * 3600.0 / SEGMENT_S).ceil() as u32;
    let mut segments = Vec::new();
    for world in WORLDS.iter().filter(|world| DRIVEN.contains(&world.name)) {
        for road in &ROADS {
            segments.extend((0..count).map(|number| SegmentNumber { world, road, number }));
        }
    }
    let seen = each(&segments, watch, |segment| drive(segment, seed))?;
    let mut rows = Vec::new();
    // Each world has two roads.
    for (world, seen) in DRIVEN.into_iter().zip(seen.chunks(2 * count as usize)) {
        for (place, Limit(limit, _, level_nm, ..)) in LIMITS.iter().enumerate() {
            let of = || seen.iter().map(|seen| &seen[place]);
            // So many frames of 10 ms are an hour.
            let hours = of().map(|seen| f64::from(seen.frames)).sum::<f64>() / 360_000.0;
            let faulted = of().filter(|seen| seen.faulted).count() as u64;
            rows.push(Row {
                world,
                limit,
                level_nm: *level_nm,
                faults: Rate::new(faulted, hours, Confidence::USUAL),
                most_nm: of().map(|seen| seen.most_nm).fold(0.0, f64::max),
            });
        }
    }
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every limit on both of its sides, with torques of both signs: by hand 3.176 N.m for 300 frames, 5 N.m for 51, 0.15 N.m in one.
    #[test]
    fn an_eps_faults_beyond_its_limits_alone() {
        let after = |place: usize, frames: usize, heard: Heard| {
            let mut seen = Seen::default();
            (0..frames).for_each(|_| seen.hear(&LIMITS[place], Some(heard)));
            seen.faulted
        };
        for side in [1.0, -1.0] {
            assert!(after(0, 300, [0.0, side * 3.68, side * -0.5]));
            assert!(!after(0, 300, [0.0, side * 3.67, side * -0.5]));
            assert!(!after(0, 299, [0.0, side * 5.0, 0.0]));
            assert!(after(1, 51, [0.0, 0.0, side * 5.01]));
            assert!(!after(1, 50, [0.0, 0.0, side * 9.0]));
            assert!(!after(1, 500, [0.0, 0.0, side * 4.99]));
        }
        assert!(after(2, 1, [0.151, 0.0, 0.0]) && !after(2, 100, [0.149, 0.0, 0.0]));
        assert!(!after(2, 1, [-1.0, 0.0, 0.0]));
    }

    /// Guidance that goes ends what was counted; behind a fault no time counts.
    #[test]
    fn a_pause_begins_anew_and_a_fault_ends_the_time() {
        let mut seen = Seen::default();
        let mut hear = |frames: u32, heard| (0..frames).for_each(|_| seen.hear(&LIMITS[1], heard));
        hear(50, Some([0.0, 0.0, 6.0]));
        hear(1, None);
        hear(50, Some([0.0, 0.0, 6.0]));
        hear(1, Some([0.0, 0.0, 4.0]));
        hear(51, Some([0.0, 0.0, 6.0]));
        hear(7, Some([0.0, 0.0, 6.0]));
        assert!(seen.faulted && seen.frames == 152, "{}", seen.frames);
    }
}
