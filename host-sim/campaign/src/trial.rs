//! One run with one fault: the shipping ECU in the closed loop, a few seconds of a curve, the fault at an
//! instant drawn by the seed.
//!
//! The seed decides driver, speed, side of the curve, instant, and whatever the fault draws. The road is a straight
//! of 0.5 s, a clothoid of 1 s, then an arc of 0.93 m/s2 at the run's speed; the onset lies 1.5 to 3 s after the
//! start, and 3.2 s after it checking ends. The driver never notices: it is the ECU that is on trial, and a driver
//! who goes on relying is the harder one.

use std::panic::{AssertUnwindSafe, catch_unwind};

use rand::rngs::Xoshiro256PlusPlus;
use rand::{RngExt, SeedableRng};

use super::drivers::{Driver, everyone};
use super::ecu_harness::EcuHarness;
use super::injection::Start;
use super::invariants::Violation;
use super::table::FaultCase;
use super::trial_record::EcuTrace;
use super::verdict::judge;
use haptic_log::Event;
use haptic_sim::models::road::{Course, DEFAULT_LANE_WIDTH_M, Segment};
use haptic_sim::models::sensors::camera_looks;
use haptic_sim::scenario::Scenario;
use haptic_sim::seeds::Stream;
use haptic_sim::{Action, Simulation};

/// Lateral acceleration in the arc, m/s2: the paper course's first curve at 60 km/h.
const LATERAL_M_PER_S2: f64 = 0.926;
/// Speeds of the campaign, km/h. Above, the participants with the longest delays drive unstably.
const SPEEDS_KMH: [f64; 5] = [40.0, 50.0, 60.0, 70.0, 80.0];
/// Where the heading has to pass pi the curve is tighter, or a run would take a minute.
const TURN_KMH: f64 = 40.0;
const TURN_M_PER_S2: f64 = 2.0;
const EARLIEST_ONSET_MS: u32 = 1500;
const LATEST_ONSET_MS: u32 = 3000;
const AFTER_MS: u32 = 3200;

/// The world of the trials: roads are made once.
#[derive(Debug)]
pub struct World {
    drivers: Vec<Driver>,
    /// By speed: curving left and right.
    roads: Vec<[Course; 2]>,
    /// On which the heading passes +-pi.
    turning_road: [Course; 2],
}

/// A straight of 0.5 s, a clothoid of 1 s, and an arc for the rest of a run and the look-ahead.
fn road(kmh: f64, lateral_m_per_s2: f64, run_ms: u32) -> Course {
    let v = kmh / 3.6;
    let curvature_1pm = lateral_m_per_s2 / (v * v);
    let segments = vec![
        Segment::straight(0.5 * v),
        Segment::clothoid(v, 0.0, curvature_1pm),
        Segment::arc(v * (f64::from(run_ms) * 1e-3 + 2.0), curvature_1pm),
    ];
    Course::new("curve of the fault campaign", DEFAULT_LANE_WIDTH_M, segments)
        .expect("in range at these speeds")
}

/// When the heading of the turning road passes pi.
fn turned_ms() -> u32 {
    let rad_per_s = TURN_M_PER_S2 / (TURN_KMH / 3.6);
    // The clothoid turns half as fast for 1 s, after the straight.
    ((1.0 + std::f64::consts::PI / rad_per_s) * 1e3) as u32
}

/// What a run showed.
#[derive(Debug, Clone)]
pub struct TrialOutcome {
    /// Seed of the run.
    pub seed: u64,
    /// Who drove.
    pub driver: String,
    /// How fast, km/h.
    pub speed_kmh: f64,
    /// When the fault began, ms after the start.
    pub onset_ms: u32,
    /// What the ECU said of itself, from its frames.
    pub reported: Vec<Event>,
    /// ECU cycles in which every rule was checked.
    pub cycles: u64,
    /// From the instant in which the fault could be seen to the reaction, ms; `None` without one.
    pub reaction_ms: Option<u32>,
    /// Largest torque from the onset on, N.m.
    pub peak_nm: f64,
    /// Whether the fault could be seen.
    pub seen: bool,
    /// What failed, and in which step.
    pub failure: Option<Violation>,
}

impl World {
    /// Everyone who drives and every road.
    pub fn new() -> Self {
        let both = |kmh, lateral, ms| [1.0, -1.0].map(|side| road(kmh, side * lateral, ms));
        let curve = |kmh| both(kmh, LATERAL_M_PER_S2, LATEST_ONSET_MS + AFTER_MS);
        Self {
            drivers: everyone(),
            roads: SPEEDS_KMH.map(curve).into(),
            turning_road: both(TURN_KMH, TURN_M_PER_S2, turned_ms() + AFTER_MS),
        }
    }

    /// Runs a row with a seed.
    pub fn run(&self, row: &FaultCase, seed: u64) -> TrialOutcome {
        self.trial(row, seed, false).0
    }

    /// Runs a row with a seed, and with `traced` keeps what went into the ECU and came out of it.
    pub(super) fn trial(&self, row: &FaultCase, seed: u64, traced: bool) -> (TrialOutcome, Option<EcuTrace>) {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(Stream::Faults.seed(seed));
        let driver = &self.drivers[rng.random_range(0..self.drivers.len())];
        let speed = rng.random_range(0..SPEEDS_KMH.len());
        let turns = row.start == Start::HeadingWraps;
        let (roads, speed_kmh) = if turns {
            (&self.turning_road, TURN_KMH)
        } else {
            (&self.roads[speed], SPEEDS_KMH[speed])
        };
        let course = &roads[rng.random_range(0..2)];
        let drawn_ms = rng.random_range(EARLIEST_ONSET_MS..LATEST_ONSET_MS);
        let onset_ms = if turns {
            turned_ms()
        } else if row.after_sample {
            (drawn_ms..).find(|ms| camera_looks(ms - 1)).unwrap_or(drawn_ms)
        } else {
            drawn_ms
        };
        let scenario = Scenario::builder()
            .course(course.clone())
            .speed_kmh(speed_kmh)
            .driver(driver.parameters)
            .gains(driver.gains)
            .seed(seed)
            .build()
            .expect("in range at these speeds");
        let mut harness = EcuHarness::new(row, &scenario, onset_ms, onset_ms + AFTER_MS, rng);
        if traced {
            harness.keep_trace();
        }
        let mut simulation = Simulation::with(&scenario, harness);
        let run = catch_unwind(AssertUnwindSafe(|| drive(&mut simulation)));
        let mut harness = simulation.into_guidance();
        let trace = harness.take_trace();
        let mut record = harness.into_record();
        if let Err(panic) = run {
            let what = panic
                .downcast_ref::<String>()
                .cloned()
                .or_else(|| panic.downcast_ref::<&str>().map(ToString::to_string));
            record.violation = Some(Violation {
                step: record.steps,
                what: format!("panic: {}", what.unwrap_or_default()),
            });
        }
        let reported = std::mem::take(&mut record.ecu).into_events();
        let verdict = judge(row, onset_ms, &record);
        let outcome = TrialOutcome {
            seed,
            driver: driver.name.clone(),
            speed_kmh: scenario.speed_kmh(),
            onset_ms,
            reported,
            cycles: record.cycles,
            reaction_ms: record
                .seen_at
                .zip(verdict.as_ref().ok().copied().flatten())
                .map(|(seen_at, at)| at.saturating_sub(seen_at)),
            peak_nm: record.peak_nm,
            seen: record.seen_at.is_some(),
            failure: verdict.err(),
        };
        (outcome, trace)
    }
}

/// To the end, with the hand on the wheel that the row has.
fn drive(simulation: &mut Simulation<EcuHarness<'_>>) {
    loop {
        let (step, arm_nm) = (simulation.steps(), simulation.arm_torque_nm());
        let action = Action {
            hand_torque_nm: simulation.guidance().hand_torque_nm(step, arm_nm),
            ..Action::default()
        };
        if simulation.step(&action).is_none() {
            break;
        }
    }
}

impl Default for World {
    fn default() -> Self {
        Self::new()
    }
}
