//! One run with one fault: the shipping ECU in the closed loop, a few seconds of road, the fault at an instant drawn by
//! the seed.
//!
//! The seed decides driver, speed, side of the curve, place, instant, and whatever the fault draws. Half of the runs meet
//! the fault in an arc of 0.93 m/s2 at the run's speed, a quarter before it, a quarter behind it. The onset lies 1.5 to 3 s
//! after the start (4 to 5.5 s behind a curve), and 5.2 s after it the run ends, or 9 s where a lie takes its time. Drivers who do not keep a lane at the
//! speed, alone and with guidance, do not drive. One second after the ECU has left, the driver drives as manually.
//!
//! In a world in which the speed changes, the vehicle brakes or speeds up to another of the campaign's speeds by 1 to 4 m/s2.
//! That begins up to 1.3 s before the onset and then goes on at it, at the onset, or up to 1 s after it. The road's pieces lie
//! where this vehicle is at the instants of a run at one speed; the arc has its 0.93 m/s2 where the vehicle is fastest, and less
//! elsewhere. The driver keeps a lane at every speed in between.
//!
//! Where the vehicle goes [`mod@super::deviation`] judges.

use std::panic::{AssertUnwindSafe, catch_unwind};

use rand::rngs::Xoshiro256PlusPlus;
use rand::{RngExt, SeedableRng};

use super::deviation::{Deviation, drive};
use super::drivers::{Driver, Drivers, everyone, lane_keeper, relying};
use super::ecu_harness::EcuHarness;
use super::injection::Start;
use super::invariants::Violation;
use super::roads::{self, ChangingRoad, TURN_KMH};
use super::speed_change::SpeedChange;
use super::table::{FaultCase, LONG_AFTER_MS, PlaceOnRoad};
use super::trial_record::EcuTrace;
use super::verdict::judge;
use haptic_core::controller::params::{LAWS, Params};
use haptic_log::Event;
use haptic_sim::Simulation;
use haptic_sim::models::driver::ArmGains;
use haptic_sim::models::nonlinear::WorldParameters;
use haptic_sim::models::road::Course;
use haptic_sim::models::sensors::camera_looks;
use haptic_sim::models::vehicle::VehicleParameters;
use haptic_sim::scenario::{GuidanceParameters, Scenario, ScenarioBuilder, Speed};
use haptic_sim::seeds::{Stream, named};
use haptic_sim::stability::{Guided, growth_per_s};
use haptic_sim::worlds::{Surface, WorldKind};

/// Speeds of the campaign, km/h.
const SPEEDS_KMH: [f64; 7] = [40.0, 50.0, 60.0, 70.0, 80.0, 100.0, 130.0];
/// Where a driver has to keep a lane whose speed changes between two of them, km/h.
const BETWEEN_KMH: [f64; 10] = [40.0, 50.0, 60.0, 70.0, 80.0, 90.0, 100.0, 110.0, 120.0, 130.0];
/// A driver keeps a lane if an error dies down this fast, 1/s.
const SETTLES_PER_S: f64 = 0.05;
/// Between which the speed of the turning road changes, km/h: a road for faster ones would take a minute.
const TURNING_KMH: [f64; 2] = [TURN_KMH, 50.0];
const EARLIEST_ONSET_MS: u32 = 1500;
const LATEST_ONSET_MS: u32 = 3000;
/// A curve to be left behind takes so much longer, ms.
const BEHIND_MS: u32 = 2500;

const PLACES: [PlaceOnRoad; 3] = [PlaceOnRoad::In, PlaceOnRoad::Before, PlaceOnRoad::After];

/// What a seed draws for a row: who drives, in which scenario, and the onset.
struct Drawn {
    driver: String,
    scenario: Scenario,
    onset_ms: u32,
    change: Option<SpeedChange>,
}

/// The world of the trials. Roads are made once, but for those of a speed that changes.
#[derive(Debug)]
pub struct World {
    drivers: Vec<Driver>,
    /// By speed, km/h: who keeps a lane.
    able: Vec<(f64, Vec<usize>)>,
    /// By speed and place: curving left and right.
    roads: Vec<[[Course; 2]; 3]>,
    /// On which the heading passes +-pi.
    turning_road: [Course; 2],
    /// What it has beyond the paper's world; nothing if `None`.
    kind: Option<&'static WorldKind>,
    driven_by: Drivers,
    /// The guidance law on the ECU, by its place among [`LAWS`].
    law: usize,
}

/// What a run showed.
#[derive(Debug, Clone)]
pub struct TrialOutcome {
    /// Seed of the run.
    pub seed: u64,
    /// Who drove.
    pub driver: String,
    /// How fast at the start, km/h.
    pub speed_kmh: f64,
    /// How the speed changes, if it does.
    pub change: Option<SpeedChange>,
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
    /// From the onset until the ECU reported a fault or left, ms.
    pub noticed_after_ms: Option<u32>,
    /// From the onset until the ECU left, ms.
    pub left_after_ms: Option<u32>,
    /// Where the vehicle went.
    pub deviation: Deviation,
    /// Whether the fault could be seen.
    pub seen: bool,
    /// What failed, and in which step.
    pub failure: Option<Violation>,
}

impl World {
    /// This world with other drivers.
    pub fn driven_by(mut self, drivers: Drivers) -> Self {
        self.driven_by = drivers;
        self
    }

    /// This world with another of the [`LAWS`] on the ECU, by its place among them.
    pub fn guided_by(mut self, law: usize) -> Self {
        self.law = law;
        self
    }

    /// Name of the guidance law on the ECU.
    pub fn law(&self) -> &'static str {
        LAWS[self.law]
    }

    /// Who drives in it.
    pub fn drivers(&self) -> Drivers {
        self.driven_by
    }

    /// What a command needs beside row and seed to run a trial of this world again.
    pub(crate) fn arguments(&self) -> String {
        let world = self
            .kind
            .map_or(String::new(), |kind| format!(" --world {}", kind.name));
        let law = match self.law {
            0 => String::new(),
            _ => format!(" --law {}", self.law()),
        };
        if self.driven_by == usual(self.kind) {
            format!("{world}{law}")
        } else {
            format!("{world} --drivers {}{law}", self.driven_by.name())
        }
    }

    /// Everyone who drives and every road: in the paper's world if there is no `kind`, else in one beyond it, such as one with friction,
    /// wind or braking, with drivers who keep the lane in such a car.
    pub fn new(kind: Option<&'static WorldKind>) -> Self {
        let surface = kind.map_or(Surface::FLAT, WorldKind::surface);
        let run_ms = LATEST_ONSET_MS + BEHIND_MS + LONG_AFTER_MS;
        let at = |kmh| PLACES.map(|place| roads::curve(kmh, place, run_ms, surface));
        let drivers = everyone();
        let keeps_lane: Vec<f64> = if kind.is_some_and(WorldKind::changes_speed) {
            BETWEEN_KMH.into()
        } else {
            SPEEDS_KMH.into()
        };
        Self {
            able: keeps_lane
                .into_iter()
                .map(|kmh| (kmh, able(&drivers, kmh)))
                .collect(),
            drivers,
            roads: SPEEDS_KMH.map(at).into(),
            turning_road: roads::turning(LONG_AFTER_MS, surface),
            kind,
            driven_by: usual(kind),
            law: 0,
        }
    }

    /// Whether its column has a torsion bar.
    pub fn has_bar(&self) -> bool {
        self.kind.is_some_and(WorldKind::has_bar)
    }

    /// What it has beyond the paper's world; nothing in the paper's own.
    pub fn kind(&self) -> Option<&'static WorldKind> {
        self.kind
    }

    /// Runs a row with a seed.
    pub fn run(&self, row: &FaultCase, seed: u64) -> TrialOutcome {
        self.trial(row, seed, false).0
    }

    /// The drivers who keep a lane at every speed from one to another, km/h.
    fn able_between(&self, a_kmh: f64, b_kmh: f64) -> Vec<usize> {
        let range = a_kmh.min(b_kmh)..=a_kmh.max(b_kmh);
        let mut there = self.able.iter().filter(|(kmh, _)| range.contains(kmh));
        let first = there.next().map_or(&[][..], |(_, able)| able);
        let everywhere = |driver: &usize| {
            let mut there = there.clone();
            there.all(|(_, able)| able.contains(driver))
        };
        first.iter().copied().filter(everywhere).collect()
    }

    /// How the speed of a run changes, if it does in this world. It has a stream of its own: all else is drawn as where it
    /// does not.
    fn draw_change(&self, row: &FaultCase, seed: u64, from_kmh: f64) -> Option<SpeedChange> {
        self.kind.filter(|kind| kind.changes_speed())?;
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(named(Stream::Faults.seed(seed), "speed"));
        Some(if row.start == Start::HeadingWraps {
            let from_kmh = TURNING_KMH[rng.random_range(0..2)];
            SpeedChange::draw(from_kmh, &TURNING_KMH, &mut rng)
        } else {
            SpeedChange::draw(from_kmh, &SPEEDS_KMH, &mut rng)
        })
    }

    /// What a seed draws for a row.
    fn draw(&self, row: &FaultCase, seed: u64, rng: &mut Xoshiro256PlusPlus) -> Drawn {
        let speed = rng.random_range(0..SPEEDS_KMH.len());
        let change = self.draw_change(row, seed, SPEEDS_KMH[speed]);
        let able = match &change {
            None => self.able_between(SPEEDS_KMH[speed], SPEEDS_KMH[speed]),
            Some(change) => self.able_between(change.from_kmh, change.to_kmh),
        };
        let driver = &self.drivers[able[rng.random_range(0..able.len())]];
        let place = [0, 0, 1, 2][rng.random_range(0..4)];
        let place = match row.place_on_road {
            Some(asked) => PLACES.iter().position(|one| *one == asked).unwrap_or(0),
            // What engages there does so in mid-curve.
            None if row.start != Start::Engaged => 0,
            None => place,
        };
        let side = rng.random_range(0..2);
        let later_ms = if PLACES[place] == PlaceOnRoad::After {
            BEHIND_MS
        } else {
            0
        };
        let drawn_ms = later_ms + rng.random_range(EARLIEST_ONSET_MS..LATEST_ONSET_MS);
        let (course, speed, onset_ms) = match change {
            None => self.road(row, [speed, place, side], drawn_ms),
            Some(change) => self.changing_road(row, change, [place, side], drawn_ms),
        };
        let mut guidance = GuidanceParameters::default();
        guidance.controller.law = self.law as f64;
        let scenario = Scenario::builder().course(course).speed(speed.clone()).seed(seed);
        let scenario = match self.kind {
            None => scenario.guidance(guidance),
            Some(kind) => kind.on_its_column(scenario, guidance),
        };
        let (driver, scenario) = match self.driven_by {
            Drivers::Paper => (
                driver.name.clone(),
                scenario.driver(driver.parameters).gains(driver.gains),
            ),
            Drivers::Population | Drivers::Relying => {
                let relies = self.driven_by == Drivers::Relying;
                let driver = if relies { relying(seed) } else { lane_keeper(seed) };
                let name = format!("t_p {:.2} s, reliance {:.2}", driver.t_p, driver.reliance);
                let fastest_kmh =
                    change.map_or(speed.start_kmh(), |change| change.from_kmh.max(change.to_kmh));
                (name, driver.drives(scenario, fastest_kmh / 3.6))
            }
        };
        Drawn {
            driver,
            scenario: self.in_this_world(scenario, row, seed),
            onset_ms,
            change,
        }
    }

    /// Road, speed and onset (ms) of a run at one speed.
    fn road(&self, row: &FaultCase, [speed, place, side]: [usize; 3], drawn_ms: u32) -> (Course, Speed, u32) {
        let (roads, kmh, onset_ms) = if row.start == Start::HeadingWraps {
            (&self.turning_road, TURN_KMH, roads::turned_ms())
        } else {
            let roads = &self.roads[speed][place];
            (roads, SPEEDS_KMH[speed], onset_ms(row, drawn_ms))
        };
        (roads[side].clone(), Speed::constant_kmh(kmh), onset_ms)
    }

    /// Road, speed and onset of a run whose speed changes.
    fn changing_road(
        &self,
        row: &FaultCase,
        change: SpeedChange,
        [place, side]: [usize; 2],
        drawn_ms: u32,
    ) -> (Course, Speed, u32) {
        let road = ChangingRoad {
            change,
            after_ms: row.after_ms,
            side: [1.0, -1.0][side],
            surface: self.kind.map_or(Surface::FLAT, WorldKind::surface),
        };
        let (course, onset_ms) = if row.start == Start::HeadingWraps {
            road.turning()
        } else {
            let onset_ms = onset_ms(row, drawn_ms);
            (road.curve(PLACES[place], onset_ms), onset_ms)
        };
        (course, change.speed(onset_ms), onset_ms)
    }

    /// A scenario with the car, the road and the sensors of this world, and what a row makes less than ideal.
    fn in_this_world(&self, mut scenario: ScenarioBuilder, row: &FaultCase, seed: u64) -> Scenario {
        let mut plant = self
            .kind
            .map_or_else(WorldParameters::default, WorldKind::parameters);
        if let Some(kind) = self.kind {
            scenario = scenario
                .tolerances(kind.tolerances(seed))
                .sensor_errors(kind.sensor_errors());
        }
        if let Some(less_than_ideal) = row.plant {
            less_than_ideal(&mut plant);
        }
        scenario.world(plant).build().expect("in range at these speeds")
    }

    /// Runs a row with a seed, and with `traced` keeps what went into the ECU and came out of it.
    pub(super) fn trial(&self, row: &FaultCase, seed: u64, traced: bool) -> (TrialOutcome, Option<EcuTrace>) {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(Stream::Faults.seed(seed));
        let Drawn {
            driver,
            scenario,
            onset_ms,
            change,
        } = self.draw(row, seed, &mut rng);
        let end_ms = onset_ms + row.after_ms;
        let told = |wrong: fn(&mut Params)| {
            let mut guidance = *scenario.guidance();
            wrong(&mut guidance.controller);
            let told = scenario.to_builder().guidance(guidance).build();
            told.expect("half and twice are in range")
        };
        let as_told = row.told.map(told);
        let with_ecu = |of: &Scenario| {
            let harness = EcuHarness::new(row, of, onset_ms, end_ms, rng.clone());
            Simulation::with(of, harness)
        };
        let right = as_told.as_ref().map(|_| with_ecu(&scenario));
        let mut simulation = with_ecu(as_told.as_ref().unwrap_or(&scenario));
        if traced {
            simulation.guidance_mut().keep_trace();
        }
        let run = catch_unwind(AssertUnwindSafe(|| {
            drive(&mut simulation, right, onset_ms, end_ms, !traced)
        }));
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
        let reported = record.ecu.events().collect();
        // What is told wrong may be noticed before the onset.
        let from_ms = if row.told.is_some() { 0 } else { onset_ms };
        let reported_at = record.ecu.first_fault_from(from_ms);
        let verdict = match self.kind {
            None => judge(row, onset_ms, &record),
            // The second opinion on what can be seen knows the paper's world only: here every rule must hold, and what is
            // noticed is counted.
            Some(_) => record.violation.clone().map_or(Ok(left_at), Err),
        };
        let outcome = TrialOutcome {
            seed,
            driver,
            speed_kmh: scenario.speed_kmh(),
            change,
            onset_ms,
            reported,
            cycles: record.cycles,
            reaction_ms: record
                .seen_at
                .zip(verdict.as_ref().ok().copied().flatten())
                .map(|(seen_at, at)| at.saturating_sub(seen_at)),
            noticed_after_ms: [reported_at, left_at]
                .into_iter()
                .flatten()
                .min()
                .map(|at| at.saturating_sub(onset_ms)),
            left_after_ms: left_at.map(|at| at - onset_ms),
            deviation,
            peak_nm: record.peak_nm,
            seen: record.seen_at.is_some(),
            failure: verdict.err(),
        };
        (outcome, trace)
    }
}

/// The instant drawn, or the next one behind a lane preview.
fn onset_ms(row: &FaultCase, drawn_ms: u32) -> u32 {
    if row.after_sample {
        (drawn_ms..).find(|ms| camera_looks(ms - 1)).unwrap_or(drawn_ms)
    } else {
        drawn_ms
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

/// Who drives if nobody asks for others.
fn usual(kind: Option<&'static WorldKind>) -> Drivers {
    kind.map_or(Drivers::Paper, |_| Drivers::Population)
}

#[cfg(test)]
mod tests;
