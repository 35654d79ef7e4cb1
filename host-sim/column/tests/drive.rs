//! The shipping ECU drives through a bar.

use haptic_core::bus::e2e::ReceiverState;
use haptic_core::bus::messages::{Column, Message};
use haptic_core::safety::modes::Mode;
use haptic_sim::guidance::OverBus;
use haptic_sim::models::nonlinear::WorldParameters;
use haptic_sim::models::sensors;
use haptic_sim::parts::DriverVehicle;
use haptic_sim::scenario::FailureKind;
use haptic_sim::{Action, Scenario, Simulation, simulate};

fn example() -> Scenario {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/torsion-bar.toml");
    let text = std::fs::read_to_string(path).unwrap();
    Scenario::from_toml("s", &text, |_, _| unreachable!()).unwrap()
}

/// The course of 3350 m less 16.7 m of look-ahead lasts 200 s at 60 km/h.
#[test]
fn the_ecu_drives_the_example_to_its_end_without_a_fault() {
    let run = simulate(&example());
    assert!(
        !run.diverged() && (199_000..201_000).contains(&run.steps),
        "{}",
        run.steps
    );
    let samples = &run.trace.samples;
    assert!(samples.iter().all(|sample| sample.unguided_cause == 0.0));
    let (mut guidance, mut error, mut apart) = (0.0_f64, 0.0_f64, 0.0_f64);
    for sample in samples {
        guidance = guidance.max(sample.guidance_torque_nm.abs());
        error = error.max(sample.lateral_error_m.abs());
        apart = apart.max((sample.bar_torque_nm.unwrap() - sample.driver_torque_nm).abs());
    }
    assert!(guidance > 0.5 && error < 1.5, "{guidance} {error}");
    // Bar and hands differ by what moves the wheel.
    assert!((0.05..1.0).contains(&apart), "{apart}");
    assert!(
        run.trace
            .channels()
            .any(|channel| channel.name == "assist_torque_nm")
    );
}

/// The ECU's mode after a step, if it said one.
fn mode_after(simulation: &mut Simulation<OverBus>, action: &Action) -> Option<Mode> {
    let status = simulation.step(action).and_then(|outcome| outcome.status);
    status.map(|status| status.mode)
}

/// The wheel is turned at more than 5 rad/s, and slows without hands. A monitor that withdraws its permission latches.
#[test]
fn a_driver_who_swerves_meets_no_fault_that_latches() {
    let mut simulation = Simulation::with(&example(), OverBus::new(example().setup()));
    for _ in 0..8 {
        let modes = (0..10_000).map(|_| mode_after(&mut simulation, &Action::default()));
        assert_eq!(modes.last(), Some(Some(Mode::Active)));
        for (hand_nm, for_ms) in [(6.0, 500), (8.0, 300), (10.0, 200), (12.0, 200)] {
            for hand_torque_nm in [hand_nm, -hand_nm] {
                let mut swerves = simulation.clone();
                let pushed = (0..2000).map(|ms| Action {
                    hand_torque_nm: if ms < for_ms { hand_torque_nm } else { 0.0 },
                    ..Action::default()
                });
                let mut fastest = 0.0_f64;
                for action in pushed {
                    let mode = mode_after(&mut swerves, &action);
                    assert!(mode != Some(Mode::Fault), "{hand_torque_nm} N.m for {for_ms} ms");
                    fastest = fastest.max(swerves.driver_vehicle().motion().wheel_rate_rad_per_s.abs());
                }
                assert!(fastest > 5.0, "{fastest}");
            }
        }
    }
}

/// The frame of the column has the bar's reading and the column's angle.
#[test]
fn the_bus_carries_what_the_bar_reads() {
    let scenario = example();
    let mut simulation = Simulation::with(&scenario, OverBus::new(scenario.setup()));
    let (mut seen, mut receiver) = (0, ReceiverState::TRUSTED);
    for _ in 0..80_000 {
        let (mut frames, mut told) = (Vec::new(), None);
        if let Some(outcome) = simulation.step(&Action::default()) {
            frames.extend_from_slice(outcome.frames_in);
            told = Some(outcome.observation);
        }
        let told = told.unwrap();
        for frame in frames {
            let Ok(column) = Column::decode(&mut receiver, &frame) else {
                continue;
            };
            let torque = column.driver_torque.nm() - sensors::torque_nm(told.driver_torque_nm);
            let angle = column.wheel_angle.rad() - sensors::wheel_angle_rad(told.wheel_angle_rad);
            assert!(torque.abs() < 1e-3 && angle.abs() < 1e-4, "{column:?} {told:?}");
            seen += 1;
        }
    }
    assert!(seen > 1000, "{seen}");
}

/// A loss of torque is noticed as on the paper's column; wind and tyres of the world act.
#[test]
fn failures_and_the_world_reach_a_car_with_a_bar() {
    let text = "[column]\nkind = \"torsion-bar\"\n[assist]\ncurve = \"medium\"\n[failure]\nkind = \"torque\"\ntime_s = 30\n";
    let read = |text: &str| Scenario::from_toml("s", text, |_, _| unreachable!()).unwrap();
    let lost = simulate(&read(text));
    assert_eq!(read(text).failure().kind, FailureKind::Torque);
    let after = lost
        .trace
        .samples
        .iter()
        .find(|sample| sample.time_s > 30.5)
        .unwrap();
    assert!(after.guidance_torque_nm == 0.0 && after.unguided_cause == -1.0);
    let blown = read(text).to_builder().world(WorldParameters {
        wind_n: 500.0,
        ..WorldParameters::default()
    });
    let blown = simulate(&blown.build().unwrap());
    // 500 N on 1100 kg for 1 s: up to 0.23 m, to the left.
    let at_1_s = |run: &haptic_sim::simulation::Run| run.trace.samples[200].lateral_error_m;
    assert!(
        (0.03..0.23).contains(&(at_1_s(&blown) - at_1_s(&lost))),
        "{} {}",
        at_1_s(&blown),
        at_1_s(&lost)
    );
}
