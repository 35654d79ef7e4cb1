use super::*;
use crate::models::driver::DriverParameters;
use crate::scenario::{Condition, Failure, FailureKind, Sensors};

fn scenario(condition: Condition, sensors: Sensors) -> Scenario {
    let driver = DriverParameters {
        remnant_sd_nm: 0.1,
        ..Default::default()
    };
    let scenario = Scenario::builder().condition(condition).sensors(sensors);
    scenario.driver(driver).build().unwrap()
}

fn is_send<T: Send + 'static>(_: &T) {}

/// A probe, a hand, less authority and both faults of the world, in turn.
fn action(step: u32) -> Action {
    Action {
        authority: (step % 7000 > 3000).then_some(0.4),
        probe: Some(step % 2000 < 1000),
        hand_torque_nm: if step % 5000 < 40 { 0.7 } else { 0.0 },
        world: WorldFaults {
            torque_lost: (9000..9100).contains(&step),
            lane_lost: (12_000..12_020).contains(&step),
        },
        ..Action::default()
    }
}

#[test]
fn a_clone_in_mid_run_and_its_original_give_the_same_bits() {
    for (condition, sensors) in [
        (Condition::Manual, Sensors::Paper),
        (Condition::High, Sensors::Exact),
        (Condition::High, Sensors::Paper),
    ] {
        let mut original = Simulation::new(&scenario(condition, sensors));
        is_send(&original);
        for _ in 0..7919 {
            original.step(&action(original.steps())).unwrap();
        }
        let mut clone = original.clone();
        let rest = |simulation: &mut Simulation| {
            let mut bits = Vec::new();
            for _ in 0..8000 {
                let action = action(simulation.steps());
                let outcome = simulation.step(&action).unwrap();
                bits.push(outcome.applied_torque_nm.to_bits());
                bits.push(outcome.preview.e_y_m.to_bits());
                bits.push(outcome.observation.driver_torque_nm.to_bits());
                let frames = outcome.frames_in.iter().chain(outcome.frames_out);
                bits.extend(frames.flat_map(|frame| frame.data().iter().map(|byte| u64::from(*byte))));
            }
            bits
        };
        // The original goes first: what it does must not reach the clone.
        let first = rest(&mut original);
        assert_eq!(first, rest(&mut clone), "{condition} {sensors:?}");
    }
}

#[test]
fn an_action_lets_the_world_fail_as_a_scenario_does() {
    let failure = |kind| {
        let failure = Failure {
            kind,
            time_s: 30.0,
            duration_s: None,
        };
        let scenario = Scenario::builder().failure(failure).build().unwrap();
        simulate(&scenario).trace
    };
    let acted = |world: WorldFaults| {
        let mut simulation = Simulation::new(&Scenario::default());
        let mut samples = Vec::new();
        loop {
            let failing = simulation.steps() >= 30_000;
            let action = Action {
                world: if failing { world } else { WorldFaults::default() },
                ..Action::default()
            };
            let Some(outcome) = simulation.step(&action) else {
                break samples;
            };
            samples.extend(outcome.sample);
        }
    };
    let (torque_lost, lane_lost) = (true, false);
    assert_eq!(
        acted(WorldFaults {
            torque_lost,
            lane_lost
        }),
        failure(FailureKind::Torque).samples
    );
    let (torque_lost, lane_lost) = (false, true);
    assert_eq!(
        acted(WorldFaults {
            torque_lost,
            lane_lost
        }),
        failure(FailureKind::Input).samples
    );
}

/// On the first curve the paper's guidance gives about 0.4 N.m; a host that allows none of it gets none, and a
/// host that takes its request back gets a fade to nothing.
#[test]
fn the_host_decides_whether_and_how_much() {
    let torque_at_75_s = |action: Action| {
        let mut simulation = Simulation::new(&scenario(Condition::Mid, Sensors::Paper));
        let start = Action::default();
        loop {
            let action = if simulation.steps() < 70_000 {
                &start
            } else {
                &action
            };
            let outcome = simulation.step(action).unwrap();
            if outcome.observation.step == 75_000 {
                return outcome.applied_torque_nm;
            }
        }
    };
    let authority = |share| {
        torque_at_75_s(Action {
            authority: Some(share),
            ..Action::default()
        })
    };
    assert!(authority(1.0) > 0.2, "{}", authority(1.0));
    assert_eq!(authority(7.0), authority(1.0));
    assert_eq!([authority(0.0), authority(-1.0), authority(f64::NAN)], [0.0; 3]);
    let engage = Some(false);
    assert_eq!(
        torque_at_75_s(Action {
            engage,
            ..Action::default()
        }),
        0.0
    );
}

#[test]
fn a_run_that_has_ended_stays_ended() {
    let mut simulation = Simulation::new(&Scenario::default());
    while simulation.step(&Action::default()).is_some() {}
    let (steps, ending) = (simulation.steps(), simulation.ending());
    assert_eq!(ending, Some(Ending::CourseEnd));
    assert!(simulation.step(&Action::default()).is_none());
    assert_eq!((simulation.steps(), simulation.ending()), (steps, ending));
}
