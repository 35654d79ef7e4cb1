//! One run with one fault: the shipping ECU in the closed loop, a few seconds of road, the fault at an instant drawn by
//! the seed.
//!
//! The seed decides driver, speed, side of the curve, place, instant, and whatever the fault draws. Half of the runs meet
//! the fault in an arc of 0.93 m/s2 at the run's speed, a quarter before it, a quarter behind it. The onset lies 1.5 to 3 s
//! after the start (4 to 5.5 s behind a curve), and 5.2 s after it the run ends. Drivers who do not keep a lane at the
//! speed, alone and with guidance, do not drive. One second after the ECU has left, the driver drives as manually.
//!
//! Where the vehicle goes is judged by forks of the same run: *fault-free* goes on without the fault from the onset, *dropped*
//! loses the torque in the step in which the ECU leaves. The *deviation* is the distance from the fault-free vehicle across
//! its direction at the same instant.

use std::panic::{AssertUnwindSafe, catch_unwind};

use rand::rngs::Xoshiro256PlusPlus;
use rand::{RngExt, SeedableRng};

use super::drivers::{Driver, everyone};
use super::ecu_harness::EcuHarness;
use super::injection::Start;
use super::invariants::Violation;
use super::table::{FaultCase, PlaceOnRoad};
use super::trial_record::EcuTrace;
use super::verdict::judge;
use haptic_core::params::Params;
use haptic_log::Event;
use haptic_sim::models::driver::ArmGains;
use haptic_sim::models::real::WorldParameters;
use haptic_sim::models::road::{Course, DEFAULT_LANE_WIDTH_M, Segment};
use haptic_sim::models::sensors::camera_looks;
use haptic_sim::models::vehicle::VehicleParameters;
use haptic_sim::scenario::Scenario;
use haptic_sim::seeds::Stream;
use haptic_sim::stability::{Guided, growth_per_s};
use haptic_sim::worlds::{Surface, WorldKind};
use haptic_sim::{Action, Simulation};

/// Lateral acceleration in the arc, m/s2: the paper course's first curve at 60 km/h.
const LATERAL_M_PER_S2: f64 = 0.926;
/// Speeds of the campaign, km/h.
const SPEEDS_KMH: [f64; 7] = [40.0, 50.0, 60.0, 70.0, 80.0, 100.0, 130.0];
/// A driver keeps a lane if an error dies down this fast, 1/s.
const SETTLES_PER_S: f64 = 0.05;
/// Where the heading has to pass pi the curve is tighter, or a run would take a minute.
const TURN_KMH: f64 = 40.0;
const TURN_M_PER_S2: f64 = 2.0;
const EARLIEST_ONSET_MS: u32 = 1500;
const LATEST_ONSET_MS: u32 = 3000;
const AFTER_MS: u32 = 5200;
/// A curve to be left behind takes so much longer, ms.
const BEHIND_MS: u32 = 2500;
/// A driver who is warned drives as manually so much later, ms.
const NOTICES_MS: u32 = 1000;
/// Most that a handover may move the vehicle beyond what dropping the torque in the same step does, m.
pub(crate) const MOST_EXCESS_M: f64 = 0.1;
/// Who goes further aside than a lane is wide without any torque is thrown off the road whatever the ECU does: metres
/// beyond that say nothing of a handover, and are not judged.
const OFF_ROAD_M: f64 = 3.6;
/// From the middle of a lane of 3.6 m to where a vehicle of 1.7 m begins to leave it, m.
const LANE_EDGE_M: f64 = 0.95;

const PLACES: [PlaceOnRoad; 3] = [PlaceOnRoad::In, PlaceOnRoad::Before, PlaceOnRoad::After];

/// The world of the trials: roads are made once.
#[derive(Debug)]
pub struct World {
    drivers: Vec<Driver>,
    /// By speed: who keeps a lane.
    able: Vec<Vec<usize>>,
    /// By speed and place: curving left and right.
    roads: Vec<[[Course; 2]; 3]>,
    /// On which the heading passes +-pi.
    turning_road: [Course; 2],
    /// What is real; nothing if `None`.
    real: Option<&'static WorldKind>,
}

/// A straight of so long, a clothoid of 1 s, an arc, and if the arc ends a clothoid and a straight; on to the end of a run.
fn road(
    kmh: f64,
    lateral_m_per_s2: f64,
    [straight_s, arc_s]: [f64; 2],
    run_ms: u32,
    surface: Surface,
) -> Course {
    let v = kmh / 3.6;
    let curvature_1pm = lateral_m_per_s2 / (v * v);
    let [level, banked] = [
        surface.straight_rad(),
        surface.curve_rad(0.6_f64.copysign(lateral_m_per_s2)),
    ];
    let piece = |segment: Segment, bank_rad| segment.with_surface(bank_rad, [0.0; 2]);
    let rest_s = f64::from(run_ms) * 1e-3 + 2.0;
    let mut segments = vec![
        piece(Segment::straight(straight_s * v), [level; 2]),
        piece(Segment::clothoid(v, 0.0, curvature_1pm), [level, banked]),
        piece(Segment::arc(v * arc_s.min(rest_s), curvature_1pm), [banked; 2]),
    ];
    if arc_s < rest_s {
        segments.push(piece(Segment::clothoid(v, curvature_1pm, 0.0), [banked, level]));
        segments.push(piece(Segment::straight(v * rest_s), [level; 2]));
    }
    Course::new("curve of the fault campaign", DEFAULT_LANE_WIDTH_M, segments)
        .expect("in range at these speeds")
}

/// The straight before the arc and the arc, s, for a place.
fn lengths_s(place: PlaceOnRoad) -> [f64; 2] {
    match place {
        PlaceOnRoad::In => [0.5, f64::INFINITY],
        // The curve begins 0.2 to 1.7 s after the onset.
        PlaceOnRoad::Before => [3.2, f64::INFINITY],
        // It ends 0.3 to 1.8 s before it.
        PlaceOnRoad::After => [0.5, 1.2],
    }
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
    /// From the onset until the ECU left, ms.
    pub left_after_ms: Option<u32>,
    /// Where the vehicle went.
    pub deviation: Deviation,
    /// Whether the fault could be seen.
    pub seen: bool,
    /// What failed, and in which step.
    pub failure: Option<Violation>,
}

/// Where the vehicle of a run went.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Deviation {
    /// Largest deviation, m.
    pub faulted_m: f64,
    /// The same had the torque been dropped in the step in which the ECU left; `None` if it stayed.
    pub dropped_m: Option<f64>,
    /// Whether the vehicle left its lane where the fault-free one did not.
    pub leaves_lane: bool,
    /// Whether the vehicle was off the road when the ECU left, and so was the fault-free one: its driver took it there.
    pub driven_off: bool,
}

impl Deviation {
    /// How much further the vehicle went than it would have if the torque had been dropped, m.
    pub fn excess_m(&self) -> Option<f64> {
        self.dropped_m.map(|dropped_m| self.faulted_m - dropped_m)
    }

    /// Whether the vehicle leaves the road with the torque dropped or without the fault as well: then no handover is judged.
    pub fn is_off_road(&self) -> bool {
        self.driven_off || self.dropped_m.is_some_and(|dropped_m| dropped_m > OFF_ROAD_M)
    }
}

impl World {
    /// Everyone who drives and every road, in the paper's world.
    pub fn new() -> Self {
        Self::of(None)
    }

    /// The same where roads, cars and cameras are real.
    pub fn real(kind: &'static WorldKind) -> Self {
        Self::of(Some(kind))
    }

    fn of(real: Option<&'static WorldKind>) -> Self {
        let surface = real.map_or(Surface::FLAT, WorldKind::surface);
        let run_ms = LATEST_ONSET_MS + BEHIND_MS + AFTER_MS;
        let both = |kmh, lateral, lengths, ms| {
            [1.0, -1.0].map(|side| road(kmh, side * lateral, lengths, ms, surface))
        };
        let at = |kmh| PLACES.map(|place| both(kmh, LATERAL_M_PER_S2, lengths_s(place), run_ms));
        let drivers = everyone();
        Self {
            able: SPEEDS_KMH.map(|kmh| able(&drivers, kmh)).into(),
            drivers,
            roads: SPEEDS_KMH.map(at).into(),
            turning_road: both(
                TURN_KMH,
                TURN_M_PER_S2,
                [0.5, f64::INFINITY],
                turned_ms() + AFTER_MS,
            ),
            real,
        }
    }

    /// What is real in it; nothing in the paper's.
    pub fn kind(&self) -> Option<&'static WorldKind> {
        self.real
    }

    /// Runs a row with a seed.
    pub fn run(&self, row: &FaultCase, seed: u64) -> TrialOutcome {
        self.trial(row, seed, false).0
    }

    /// What a seed draws for a row: who drives, in which scenario, and the onset, ms.
    fn draw(&self, row: &FaultCase, seed: u64, rng: &mut Xoshiro256PlusPlus) -> (&Driver, Scenario, u32) {
        let speed = rng.random_range(0..SPEEDS_KMH.len());
        let able = &self.able[speed];
        let driver = &self.drivers[able[rng.random_range(0..able.len())]];
        let place = [0, 0, 1, 2][rng.random_range(0..4)];
        let place = match row.place_on_road {
            Some(asked) => PLACES.iter().position(|one| *one == asked).unwrap_or(0),
            // What engages there does so in mid-curve.
            None if row.start != Start::Engaged => 0,
            None => place,
        };
        let turns = row.start == Start::HeadingWraps;
        let (roads, speed_kmh) = if turns {
            (&self.turning_road, TURN_KMH)
        } else {
            (&self.roads[speed][place], SPEEDS_KMH[speed])
        };
        let course = &roads[rng.random_range(0..2)];
        let later_ms = if PLACES[place] == PlaceOnRoad::After {
            BEHIND_MS
        } else {
            0
        };
        let drawn_ms = later_ms + rng.random_range(EARLIEST_ONSET_MS..LATEST_ONSET_MS);
        let onset_ms = if turns {
            turned_ms()
        } else if row.after_sample {
            (drawn_ms..).find(|ms| camera_looks(ms - 1)).unwrap_or(drawn_ms)
        } else {
            drawn_ms
        };
        let mut scenario = Scenario::builder()
            .course(course.clone())
            .speed_kmh(speed_kmh)
            .driver(driver.parameters)
            .gains(driver.gains)
            .seed(seed);
        let mut plant = self
            .real
            .map_or_else(WorldParameters::default, WorldKind::parameters);
        if let Some(kind) = self.real {
            scenario = scenario
                .tolerances(kind.tolerances(seed))
                .sensor_errors(kind.sensor_errors());
        }
        if let Some(less_than_ideal) = row.plant {
            less_than_ideal(&mut plant);
        }
        let scenario = scenario.world(plant).build().expect("in range at these speeds");
        (driver, scenario, onset_ms)
    }

    /// Runs a row with a seed, and with `traced` keeps what went into the ECU and came out of it.
    pub(super) fn trial(&self, row: &FaultCase, seed: u64, traced: bool) -> (TrialOutcome, Option<EcuTrace>) {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(Stream::Faults.seed(seed));
        let (driver, scenario, onset_ms) = self.draw(row, seed, &mut rng);
        let mut harness = EcuHarness::new(row, &scenario, onset_ms, onset_ms + AFTER_MS, rng);
        if traced {
            harness.keep_trace();
        }
        let mut simulation = Simulation::with(&scenario, harness);
        let run = catch_unwind(AssertUnwindSafe(|| drive(&mut simulation, onset_ms, !traced)));
        let mut harness = simulation.into_guidance();
        let trace = harness.take_trace();
        let left_at = harness.left_at();
        let mut record = harness.into_record();
        let deviation = run.as_ref().copied().unwrap_or_default();
        record.driven_off = deviation.driven_off;
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
        let verdict = match self.real {
            None => judge(row, onset_ms, &record),
            // The second opinion on what can be seen knows the paper's world only: here every rule must hold, and what is
            // noticed is counted.
            Some(_) => record.violation.clone().map_or(Ok(left_at), Err),
        };
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
            left_after_ms: left_at.map(|at| at - onset_ms),
            deviation,
            peak_nm: record.peak_nm,
            seen: record.seen_at.is_some(),
            failure: verdict.err(),
        };
        (outcome, trace)
    }
}

/// Who keeps a lane at a speed, whatever the guidance does: relying on it, without it, and as manually.
fn able(drivers: &[Driver], kmh: f64) -> Vec<usize> {
    let law = Params::PAPER;
    let settles = |driver: &Driver| {
        let guided = Guided { law: &law, t_n: 0.3 };
        let cases = [
            (driver.gains, Some(guided)),
            (driver.gains, None),
            (ArmGains::MANUAL, None),
        ];
        cases.into_iter().all(|(gains, guided)| {
            let vehicle = VehicleParameters::default();
            growth_per_s(kmh / 3.6, &vehicle, &driver.parameters, gains, guided) < -SETTLES_PER_S
        })
    };
    (0..drivers.len()).filter(|n| settles(&drivers[*n])).collect()
}

type Trial<'a> = Simulation<EcuHarness<'a>>;

/// One step, with the hand on the wheel that the row has; whether there was one.
fn step(simulation: &mut Trial<'_>, takes_over: bool) -> bool {
    let (step, arm_nm) = (simulation.steps(), simulation.arm_torque_nm());
    let action = Action {
        hand_torque_nm: simulation.guidance().hand_torque_nm(step, arm_nm),
        takes_over,
        ..Action::default()
    };
    simulation.step(&action).is_some()
}

/// Distance from another vehicle, across its direction, m.
fn apart_m(simulation: &Trial<'_>, from: &Trial<'_>) -> f64 {
    let ([x, y], _) = simulation.place();
    let ([x_0, y_0], direction) = from.place();
    ((y - y_0) * direction.cos() - (x - x_0) * direction.sin()).abs()
}

/// To the end, with the forks beside it if asked for.
fn drive(simulation: &mut Trial<'_>, onset: u32, forks: bool) -> Deviation {
    let mut seen = Deviation::default();
    let mut healthy: Option<Trial<'_>> = None;
    let mut dropped: Option<Trial<'_>> = None;
    let mut edges = [false; 2];
    loop {
        if forks && simulation.steps() == onset {
            healthy = Some(simulation.clone());
            healthy
                .as_mut()
                .into_iter()
                .for_each(|twin| twin.guidance_mut().heal());
        }
        let left_at = simulation.guidance().left_at();
        let takes_over = left_at.is_some_and(|at| simulation.steps() >= at + NOTICES_MS);
        let goes_on = simulation.steps() < onset + AFTER_MS && step(simulation, takes_over);
        if !goes_on {
            break;
        }
        let Some(twin) = &mut healthy else { continue };
        if !step(twin, false) {
            break;
        }
        seen.faulted_m = seen.faulted_m.max(apart_m(simulation, twin));
        for (edge, one) in edges.iter_mut().zip([&*simulation, &*twin]) {
            *edge |= one
                .lateral_error_m()
                .is_some_and(|error_m| error_m.abs() > LANE_EDGE_M);
        }
        match &mut dropped {
            Some(without) => {
                // Off the road it stays where it is.
                step(without, takes_over);
                let apart_m = apart_m(without, twin);
                seen.dropped_m = seen.dropped_m.map(|most_m| most_m.max(apart_m));
            }
            None if left_at.is_none() && simulation.guidance().left_at().is_some() => {
                let without = dropped.insert(simulation.clone());
                without.guidance_mut().drop_torque();
                seen.dropped_m = Some(seen.faulted_m);
                seen.driven_off = [&*simulation, &*twin].iter().all(|one| {
                    one.lateral_error_m()
                        .is_some_and(|error_m| error_m.abs() > OFF_ROAD_M)
                });
            }
            None => {}
        }
    }
    seen.leaves_lane = edges[0] && !edges[1];
    seen
}

impl Default for World {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::super::table::rows;
    use super::*;

    /// At 130 km/h the taps of this participant throw the vehicle 4 m aside, where the camera's signal ends: the ECU hands over,
    /// rightly, and the run is none of a driver who loses the guidance for nothing. Who stays on the road is judged.
    #[test]
    fn a_driver_who_taps_is_judged_on_the_road_only() {
        let world = World::new();
        let taps = rows().find(|row| row.name == "driver-taps").unwrap();
        let off = world.run(taps, 27);
        assert!(off.left_after_ms.is_some());
        assert!(off.deviation.driven_off && off.deviation.is_off_road());
        assert!(off.failure.is_none(), "{:?}", off.failure);
        let on = world.run(taps, 11);
        assert_eq!((on.left_after_ms, on.deviation.driven_off), (None, false));
    }
}
