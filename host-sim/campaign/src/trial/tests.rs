//! A speed that changes around the onset, against the drive itself: what the vehicle does, what the bus carries. A column with a bar,
//! against the example and plain drives of it. And who is judged.

use haptic_log::trace::Sample;
use haptic_sim::Action;
use haptic_sim::guidance::OverBus;
use haptic_sim::models::torsion_bar::{ColumnFault, ColumnParameters};
use haptic_sim::parts::DriverVehicle;
use haptic_sim::simulation::simulate;
use haptic_sim::worlds::WORLDS;

use super::*;
use crate::bytes::{self, VEHICLE};
use crate::table::rows;

const SEEDS: std::ops::RangeInclusive<u64> = 1..=60;

fn braking() -> World {
    World::new(Some(WORLDS.iter().find(|world| world.name == "braking").unwrap()))
}

fn by_name(name: &str) -> &'static FaultCase {
    rows().find(|row| row.name == name).expect("a row of the table")
}

fn drawn(world: &World, row: &FaultCase, seed: u64) -> Drawn {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(Stream::Faults.seed(seed));
    world.draw(row, seed, &mut rng)
}

/// A run without a fault, and its onset, s.
fn honest(world: &World, row: &FaultCase, seed: u64) -> (Vec<Sample>, f64) {
    let Drawn {
        scenario, onset_ms, ..
    } = drawn(world, row, seed);
    let run = simulate(&scenario);
    assert!(!run.diverged(), "seed {seed}");
    (run.trace.samples, f64::from(onset_ms) * 1e-3)
}

fn at(samples: &[Sample], time_s: f64) -> &Sample {
    samples
        .iter()
        .find(|s| s.time_s > time_s - 0.0025)
        .expect("in the run")
}

/// The figures are those of the document: 40 to 130 km/h, 1 to 4 m/s2, a change that begins up to 1.3 s before the onset and
/// goes on at it, or up to 1 s after it; at most 0.93 m/s2 in the arc.
#[test]
fn a_vehicle_brakes_and_speeds_up_around_the_onset_and_no_curve_is_sharper_for_it() {
    let world = braking();
    // Braking and speeding up; beginning before, at and after the onset.
    let (mut ways, mut begins) = ([0; 2], [0; 3]);
    for seed in SEEDS {
        let (samples, onset_s) = honest(&world, by_name("counter-wrap"), seed);
        let v = |time_s: f64| at(&samples, time_s).speed_m_per_s;
        for pair in samples.windows(2) {
            let rate = (pair[1].speed_m_per_s - pair[0].speed_m_per_s) / 0.005;
            assert!(rate.abs() <= 4.0 + 1e-6, "seed {seed}: {rate} m/s2");
            let s = &pair[0];
            assert!(
                (40.0 - 1e-6..=130.0 + 1e-6).contains(&(3.6 * s.speed_m_per_s)),
                "seed {seed}: {} m/s",
                s.speed_m_per_s
            );
            let lateral = s.curvature_1pm.abs() * s.speed_m_per_s * s.speed_m_per_s;
            let watched = s.time_s <= onset_s + 5.2;
            assert!(
                !watched || lateral < 0.93,
                "seed {seed}: {lateral} m/s2 at {} s",
                s.time_s
            );
        }
        // The change is there while the fault is, and was not over before it.
        let changed = v(onset_s + 1.5) - v(onset_s - 1.5);
        assert!(changed.abs() > 0.45, "seed {seed}: {changed} m/s");
        assert!((v(onset_s + 5.0) - v(onset_s)).abs() > 0.2, "seed {seed}");
        ways[usize::from(changed > 0.0)] += 1;
        // At 1 m/s2 20 ms are 0.02 m/s.
        begins[if (v(onset_s - 0.02) - v(0.0)).abs() > 0.01 {
            0
        } else if (v(onset_s + 0.02) - v(0.0)).abs() > 0.01 {
            1
        } else {
            2
        }] += 1;
    }
    assert!(
        ways.iter().chain(&begins).all(|n| *n >= 10),
        "{ways:?}, {begins:?}"
    );
}

/// Half of the onsets lie in the curve, a quarter before and behind it, at whatever speed the vehicle gets there.
#[test]
fn the_onset_lies_where_the_row_asks_for_it() {
    let world = braking();
    for seed in 1..=12 {
        let on_road = |place| FaultCase {
            place_on_road: Some(place),
            ..*by_name("counter-wrap")
        };
        let curvature = |place, after_s: f64| {
            let (samples, onset_s) = honest(&world, &on_road(place), seed);
            at(&samples, onset_s + after_s).curvature_1pm.abs()
        };
        let full = curvature(PlaceOnRoad::In, 0.0);
        let close = |found: f64| (found / full - 1.0).abs() < 1e-6;
        assert!(
            full > 1e-4 && close(curvature(PlaceOnRoad::In, 4.0)),
            "seed {seed}"
        );
        assert_eq!(curvature(PlaceOnRoad::Before, 0.0), 0.0, "seed {seed}");
        assert!(close(curvature(PlaceOnRoad::Before, 2.8)), "seed {seed}");
        assert_eq!(curvature(PlaceOnRoad::After, 0.0), 0.0, "seed {seed}");
        assert!(curvature(PlaceOnRoad::After, -1.85) > 0.0, "seed {seed}");
    }
}

#[test]
fn the_heading_passes_pi_at_the_onset_while_the_speed_changes() {
    let world = braking();
    let row = by_name("heading-wraps");
    for seed in 1..=3 {
        let Drawn {
            scenario, onset_ms, ..
        } = drawn(&world, row, seed);
        let mut simulation = Simulation::new(&scenario);
        while simulation.steps() < onset_ms {
            simulation.step(&Action::default()).expect("a road until then");
        }
        let direction = simulation.driver_vehicle().motion().direction_rad.abs();
        assert!(
            (direction - std::f64::consts::PI).abs() < 0.03,
            "seed {seed}: {direction}"
        );
        let (samples, onset_s) = honest(&world, row, seed);
        let changed = at(&samples, onset_s + 1.5).speed_m_per_s - at(&samples, onset_s - 1.5).speed_m_per_s;
        assert!(changed.abs() > 0.45, "seed {seed}: {changed} m/s");
    }
}

/// The two speeds on the bus by the step, m/s, as a row's run has them.
fn speeds_on_the_bus(world: &World, name: &str, seed: u64) -> Vec<(u32, [f64; 2])> {
    let (_, trace) = world.trial(by_name(name), seed, true);
    let ticks = trace.expect("asked for").ticks.into_iter();
    ticks
        .flat_map(|tick| {
            let speeds = tick.frames.into_iter().filter(|(frame, _)| frame.id() == VEHICLE);
            speeds.map(move |(frame, _)| {
                // 1/256 m/s.
                let speed = |start| bytes::signed(&frame, start, 16) as f64 / 256.0;
                (tick.step, [speed(12), speed(28)])
            })
        })
        .collect()
}

/// Wrong speeds are wrong by as much as their rows say, of a truth that changes: the truth is the drive without the fault,
/// whose speed is a function of time.
#[test]
fn wrong_speeds_are_wrong_by_the_same_while_the_true_one_changes() {
    let world = braking();
    type Wrong = fn(f64, f64) -> [f64; 2];
    let wrong: [(&str, Wrong); 4] = [
        ("counter-wrap", |v, _| [v, v]),
        ("speeds-apart", |v, _| [v, v + 2.0]),
        ("speeds-drift-apart", |v, since_s| [v, v + 5.0 * since_s]),
        ("speed-falls-to-zero", |v, since_s| {
            [(v - 10.0 * since_s).max(0.0); 2]
        }),
    ];
    for seed in 1..=6 {
        for (name, of) in wrong {
            let (samples, onset_s) = honest(&world, by_name(name), seed);
            let mut heard = 0;
            for (step, found) in speeds_on_the_bus(&world, name, seed) {
                let time_s = f64::from(step) * 1e-3;
                let v = at(&samples, time_s).speed_m_per_s;
                let expected = if time_s < onset_s {
                    [v; 2]
                } else {
                    of(v, time_s - onset_s)
                };
                for (found, expected) in found.into_iter().zip(expected) {
                    assert!(
                        (found - expected).abs() < 0.006,
                        "{name} seed {seed}: {found}, not {expected} m/s at {time_s} s"
                    );
                }
                heard += 1;
            }
            assert!(heard > 600, "{heard}");
        }
    }
}

/// Whoever drives keeps a lane by hand and with guidance at every speed in between, also where nobody looked.
#[test]
fn whoever_drives_is_stable_at_every_speed_of_the_run() {
    for drivers in Drivers::ALL {
        let world = braking().driven_by(drivers);
        for seed in SEEDS {
            let Drawn {
                driver,
                change,
                scenario,
                ..
            } = drawn(&world, by_name("counter-wrap"), seed);
            let change = change.expect("in this world");
            for fifth in 0..=5 {
                let share = f64::from(fifth) / 5.0;
                let v = (change.from_kmh + share * (change.to_kmh - change.from_kmh)) / 3.6;
                let vehicle = VehicleParameters::default();
                let guided = Guided {
                    law: &Params::PAPER,
                    t_n: 0.3,
                };
                let cases = [(scenario.gains(), Some(guided)), (scenario.manual_gains(), None)];
                for (gains, guided) in cases {
                    let growth = growth_per_s(v, &vehicle, scenario.driver(), gains, guided);
                    assert!(growth < 0.0, "{driver}: {growth} 1/s at {v} m/s");
                }
            }
        }
    }
}

/// Other drivers in the same runs: place, speed, onset and car are those of the seed.
#[test]
fn drivers_change_who_drives_and_nothing_else() {
    let row = by_name("silent-lane");
    let mut names = std::collections::BTreeSet::new();
    for seed in SEEDS {
        let [paper, population, relying] =
            Drivers::ALL.map(|who| drawn(&braking().driven_by(who), row, seed));
        assert_eq!(relying.scenario.driver().remnant_sd_nm, 0.0);
        assert_eq!(relying.scenario.driver().t_p, population.scenario.driver().t_p);
        assert!(relying.scenario.gains().k_hg <= 0.2);
        assert_eq!(paper.onset_ms, population.onset_ms);
        let same = paper
            .scenario
            .to_builder()
            .driver(*population.scenario.driver())
            .gains(population.scenario.gains())
            .manual_k_d(population.scenario.manual_gains().k_d)
            .build()
            .unwrap();
        assert_eq!(same, population.scenario);
        assert_ne!(paper.driver, population.driver);
        names.insert(population.driver);
    }
    // Sixty seeds, sixty drivers.
    assert!(names.len() > 55, "{names:?}");
}

/// What runs a failure again says who drove, and which law, where they are not the usual ones.
#[test]
fn a_replay_names_world_drivers_and_law() {
    let everything = || {
        World::new(Some(
            WORLDS.iter().find(|world| world.name == "everything").unwrap(),
        ))
    };
    assert_eq!(World::new(None).arguments(), "");
    assert_eq!(everything().arguments(), " --world everything");
    assert_eq!(
        everything().driven_by(Drivers::Paper).arguments(),
        " --world everything --drivers paper"
    );
    assert_eq!(
        World::new(None).driven_by(Drivers::Population).arguments(),
        " --drivers population"
    );
    assert_eq!(
        everything().guided_by(1).arguments(),
        " --world everything --law driver_activity"
    );
}

/// At 130 km/h the taps of this participant throw the vehicle 4 m aside, where the camera's signal ends: the ECU hands over,
/// rightly, and the run is none of a driver who loses the guidance for nothing. Who stays on the road is judged.
#[test]
fn a_driver_who_taps_is_judged_on_the_road_only() {
    let world = World::new(None);
    let taps = by_name("driver-taps");
    let off = world.run(taps, 27);
    assert!(off.left_after_ms.is_some());
    assert!(off.deviation.driven_off && off.deviation.is_off_road());
    assert!(off.failure.is_none(), "{:?}", off.failure);
    let on = world.run(taps, 11);
    assert_eq!((on.left_after_ms, on.deviation.driven_off), (None, false));
}

fn bar() -> World {
    World::new(Some(WORLDS.iter().find(|world| world.name == "bar").unwrap()))
}

/// Column, assist and what the ECU is told are those of the example.
#[test]
fn the_world_bar_has_the_column_of_the_example() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/torsion-bar.toml");
    let text = std::fs::read_to_string(path).unwrap();
    let example = Scenario::from_toml("s", &text, |_, _| unreachable!()).unwrap();
    let run = drawn(&bar(), by_name("counter-wrap"), 1).scenario;
    assert_eq!(run.column(), example.column());
    assert_eq!(run.values().assist, example.values().assist);
    assert_eq!(run.guidance().controller, example.guidance().controller);
    let paper = drawn(&World::new(None), by_name("counter-wrap"), 1).scenario;
    assert_eq!(paper.column(), &ColumnParameters::default());
}

/// When a plain drive behind the bus first reports a fault from the onset on, ms; the fault is the scenario's.
fn reported_by_a_plain_drive(of: &Drawn, fault: ColumnFault) -> Option<u32> {
    let column = ColumnParameters {
        fault,
        fault_time_s: f64::from(of.onset_ms) * 1e-3,
        ..*of.scenario.column()
    };
    let scenario = of.scenario.to_builder().column(column).build().unwrap();
    let mut simulation = Simulation::with(&scenario, OverBus::new(scenario.setup()));
    while simulation.steps() < of.onset_ms + 5200 {
        let step = simulation.steps();
        let status = simulation.step(&Action::default())?.status?;
        if status.faults != haptic_core::safety::faults::FaultSet::NONE {
            assert!(step >= of.onset_ms, "{fault:?} at {step} ms");
            return Some(step - of.onset_ms);
        }
    }
    None
}

/// In curves to the left and to the right: an assist that runs away to the left is noticed within a tenth of a second, a drift of
/// 0.05 N.m/s within 5.2 s not at all, in the campaign and in a plain drive whose column fails by itself.
#[test]
fn faults_of_a_bar_are_noticed_as_in_a_plain_drive_to_both_sides() {
    let world = bar();
    let mut sides = [0; 2];
    for seed in 1..=8 {
        let of = drawn(&world, by_name("assist-runs-away"), seed);
        let bend = of
            .scenario
            .course()
            .segments()
            .iter()
            .map(|s| s.curvature_end_1pm)
            .sum::<f64>();
        sides[usize::from(bend > 0.0)] += 1;
        for (name, fault, is_noticed) in [
            ("assist-runs-away", ColumnFault::AssistRunaway, true),
            ("bar-sensor-drift", ColumnFault::SensorDrift, false),
        ] {
            let plain = reported_by_a_plain_drive(&of, fault);
            let found = world.run(by_name(name), seed).noticed_after_ms;
            for ms in [plain, found] {
                assert_eq!(
                    ms.is_some(),
                    is_noticed,
                    "{name} seed {seed}: {plain:?} {found:?}"
                );
                assert!(ms.unwrap_or_default() <= 100, "{name} seed {seed}: {ms:?}");
            }
        }
    }
    assert!(sides[0] > 0 && sides[1] > 0, "{sides:?}");
}

/// Without a fault the vehicle goes where its twin goes; what the ECU is told wrong, it is compared with an ECU that is told right.
#[test]
fn what_the_ecu_is_told_wrong_is_compared_with_what_is_right() {
    let world = bar();
    let honest = world.run(by_name("counter-wrap"), 3);
    assert_eq!((honest.deviation.faulted_m, honest.failure), (0.0, None));
    let hands = world.run(by_name("bar-taken-for-hands"), 3);
    let deviation_m = hands.deviation.faulted_m;
    assert!(deviation_m > 0.0 && deviation_m < 0.95, "{deviation_m}");
}

/// By hand: what the paper's car is made less ideal by and a column with a bar has as its own, and what only such a column has.
#[test]
fn rows_are_left_out_where_they_cannot_be() {
    let left_out = |has_bar: bool| -> Vec<&str> {
        let rows = rows().filter(|row| row.left_out(has_bar).is_some());
        rows.map(|row| row.name).collect()
    };
    let of_the_paper = [
        "motor-lags-2",
        "motor-lags-10",
        "motor-lags-20",
        "friction",
        "assist",
    ];
    assert_eq!(left_out(true), of_the_paper);
    let of_the_bar = crate::table::GROUPS[7].rows.iter().map(|row| row.name);
    assert_eq!(left_out(false), of_the_bar.collect::<Vec<_>>());
    assert_eq!(left_out(false).len(), 13);
}
