//! When the guidance was away, against what the ECU puts on its bus: decoded here bit by bit, as `core/haptic.dbc` says.

use haptic_core::bus::Frame;
use haptic_log::trace::Trace;
use haptic_sim::action::WorldFaults;
use haptic_sim::models::disturbances::SensorErrors;
use haptic_sim::models::driver::{ArmGains, DriverParameters};
use haptic_sim::models::road::Course;
use haptic_sim::scenario::{Condition, Failure, FailureKind, Sensors, Speed};
use haptic_sim::simulation::{SAMPLE_RATE_HZ, observe, simulate};
use haptic_sim::unguided::{Cause, Unguided, stretches};
use haptic_sim::{Action, Outcome, Scenario, Simulation};

const ACTIVE: u64 = 2;
/// Bits of the fault word.
const LANE_TIMEOUT: u32 = 1;
const HANDS_OFF: u32 = 1 << 19;

/// Straight, then a left curve of a radius of 800 m that is held for a minute at 60 km/h.
fn held_curve() -> Course {
    let text = "[[segment]]\nlength_m = 200\n[[segment]]\nlength_m = 100\ncurvature_start_per_m = 0\ncurvature_end_per_m = 0.00125\n\
                [[segment]]\nlength_m = 1000\ncurvature_per_m = 0.00125\n";
    Course::from_toml("held", text).unwrap()
}

/// Mode and fault word of a guidance frame: four bits from bit 32, 21 bits from bit 37.
fn mode_and_faults(frame: &Frame) -> (u64, u32) {
    assert_eq!(frame.id(), 0x0C0);
    let word = u64::from_le_bytes(frame.data().try_into().unwrap());
    ((word >> 32) & 0xF, ((word >> 37) & 0x1F_FFFF) as u32)
}

/// Drives, and gives the run's stretches and what the bus said of Active: for each stretch of another mode its first and
/// last instant, s, and the faults that came with it.
fn driven(scenario: &Scenario) -> (Vec<Unguided>, Vec<(f64, f64, u32)>) {
    let mut on_the_bus: Vec<(f64, f64, u32)> = Vec::new();
    let mut was_active = true;
    let run = observe(scenario, |outcome| {
        let (mode, faults) = mode_and_faults(&outcome.frames_out[0]);
        let is_active = mode == ACTIVE;
        if !is_active && was_active {
            on_the_bus.push((outcome.time_s(), outcome.time_s(), faults));
        } else if !is_active {
            on_the_bus.last_mut().unwrap().1 = outcome.time_s();
        }
        assert_eq!(outcome.unguided.is_some(), !is_active);
        assert_eq!(outcome.status.unwrap().faults.bits(), faults);
        was_active = is_active;
    });
    (stretches(&run.trace).unwrap(), on_the_bus)
}

/// To the sample behind it.
fn at(found_s: f64, wanted_s: f64) -> bool {
    (-1e-9..0.005).contains(&(found_s - wanted_s))
}

#[test]
fn a_run_says_what_the_bus_says() {
    let blind = SensorErrors {
        dropout_rate_per_s: 0.2,
        dropout_duration_s: 1.5,
        ..SensorErrors::default()
    };
    for condition in [Condition::High, Condition::Mid, Condition::Low] {
        for sensor_errors in [SensorErrors::default(), blind] {
            let scenario = Scenario::builder().course(held_curve()).condition(condition);
            let scenario = scenario.sensor_errors(sensor_errors).build().unwrap();
            let (found, on_the_bus) = driven(&scenario);
            assert_eq!(found.len(), on_the_bus.len(), "{condition}");
            for (found, (left_s, _, faults)) in found.iter().zip(on_the_bus) {
                assert!(at(found.from_s, left_s), "{found:?}, not {left_s}");
                assert_eq!((found.why, found.asked_for), (Cause::Faults(faults), false));
                assert_eq!(found.until_s, None, "nothing engages by itself");
                let left_m = left_s * 60.0 / 3.6;
                assert!((found.from_m - left_m).abs() < 1.0, "{found:?}, not {left_m} m");
            }
            if sensor_errors == blind {
                assert_eq!(found[0].why, Cause::Faults(LANE_TIMEOUT));
                assert_eq!(found[0].why.to_string(), "LaneTimeout");
            }
        }
    }
}

/// A driver who relies on the guidance and holds still in a long gentle curve is taken for nobody, unless the warning is
/// answered: then guidance goes on, and the vehicle stays on its line.
#[test]
fn who_answers_the_warning_keeps_the_guidance() {
    for sensors in [Sensors::Paper, Sensors::Exact] {
        let driven = |after_s| {
            let driver = DriverParameters {
                answers_hands_off_after_s: after_s,
                ..DriverParameters::default()
            };
            let scenario = Scenario::builder()
                .course(held_curve())
                .condition(Condition::High)
                .sensors(sensors)
                .driver(driver);
            simulate(&scenario.build().unwrap()).trace
        };
        let never = stretches(&driven(f64::INFINITY)).unwrap();
        assert_eq!(never[0].why, Cause::Faults(HANDS_OFF));
        assert_eq!(stretches(&driven(14.0)), Some(vec![]));
    }
}

/// Nobody holds the wheel: after 30 s in which the guidance acts it ends, whatever the sensors are.
#[test]
fn without_hands_it_ends_and_says_so() {
    let slack = DriverParameters {
        a_1: 0.0,
        a_2: 0.0,
        a_3: 0.0,
        k_nms: 0.0,
        answers_hands_off_after_s: f64::INFINITY,
        ..DriverParameters::default()
    };
    for sensors in [Sensors::Paper, Sensors::Exact] {
        let scenario = Scenario::builder()
            .course(held_curve())
            .sensors(sensors)
            .driver(slack);
        let scenario = scenario.gains(ArmGains { k_d: 0.0, k_hg: 0.0 }).build().unwrap();
        let run = simulate(&scenario);
        let [found] = stretches(&run.trace).unwrap()[..] else {
            panic!("one stretch");
        };
        assert_eq!(found.why, Cause::Faults(HANDS_OFF));
        let acts = |torque_nm: f64| torque_nm.abs() >= 0.05;
        let samples = run.trace.samples.iter().filter(|s| s.time_s < found.from_s);
        let acted_s = samples.filter(|s| acts(s.guidance_torque_nm)).count() as f64 * 0.005;
        assert!((acted_s - 30.0).abs() < 0.05, "{acted_s} s");
        // 4 N.m/s.
        let faded = run.trace.samples.iter().filter(|s| s.time_s > found.from_s + 1.3);
        assert!(faded.clone().count() > 10 && faded.clone().all(|s| s.guidance_torque_nm == 0.0));
    }
}

#[test]
fn what_the_scenario_lets_fail_is_asked_for() {
    for (kind, why) in [
        (FailureKind::Torque, Cause::TorqueLost),
        (FailureKind::Input, Cause::LaneLost),
    ] {
        for sensors in [Sensors::Paper, Sensors::Exact] {
            // The last picture is up to a camera's period old, and good for 30 ms; past the bus there is none in the next step.
            // Guidance goes on for a second without.
            let left_s = match (kind, sensors) {
                (FailureKind::Input, Sensors::Paper) => 20.003 + 0.03 - 0.004 + 1.0,
                (FailureKind::Input, _) => 20.003 + 1.0,
                _ => 20.003,
            };
            let failure = Failure {
                kind,
                time_s: 20.003,
                duration_s: None,
            };
            let scenario = Scenario::builder()
                .course(held_curve())
                .failure(failure)
                .sensors(sensors);
            let run = simulate(&scenario.build().unwrap());
            let [found] = stretches(&run.trace).unwrap()[..] else {
                panic!("{kind}: one stretch");
            };
            assert_eq!(
                (found.why, found.asked_for, found.until_s),
                (why, true, None),
                "{kind}"
            );
            assert!((found.from_s - left_s).abs() < 0.01, "{found:?}");
            let last_s = run.trace.samples.last().unwrap().time_s;
            assert!((found.lasts_s - (last_s - found.from_s)).abs() < 1e-6);
        }
    }
}

/// 36 km/h down to 12.6 and up again: 5 m/s are passed on the way down after 13 s, on the way up after 27 s, and a second
/// later the driver asks again.
#[test]
fn a_slow_stretch_is_away_until_guidance_is_back() {
    let speed = Speed::by_time_kmh(vec![8.0, 14.5, 25.5, 32.0], &[36.0, 12.6, 12.6, 36.0]);
    let course = Course::from_toml("s", "[[segment]]\nlength_m = 400").unwrap();
    let scenario = Scenario::builder().course(course).speed(speed).build().unwrap();
    let (found, on_the_bus) = driven(&scenario);
    let [found] = found[..] else { panic!("{found:?}") };
    let [(left_s, last_s, faults)] = on_the_bus[..] else {
        panic!("{on_the_bus:?}");
    };
    assert_eq!((faults, found.why, found.asked_for), (0, Cause::TooSlow, false));
    assert!(
        at(found.from_s, left_s) && (left_s - 13.0).abs() < 0.02,
        "{left_s}"
    );
    let back_s = found.until_s.unwrap();
    assert!(
        at(back_s, last_s + 0.001) && (back_s - 28.0).abs() < 0.1,
        "{back_s}"
    );
    assert!((found.lasts_s - (back_s - found.from_s)).abs() < 1e-6);
}

/// A host's actions, step by step: the request goes and comes again, then the torque is lost for 50 ms.
#[test]
fn what_a_host_takes_away_is_asked_for_too() {
    let scenario = Scenario::builder().course(held_curve()).build().unwrap();
    let mut simulation = Simulation::new(&scenario);
    let mut trace = Trace {
        sample_rate_hz: f64::from(SAMPLE_RATE_HZ),
        samples: Vec::new(),
    };
    while simulation.steps() < 12_000 {
        let step = simulation.steps();
        let action = Action {
            engage: Some(!(2000..4000).contains(&step)),
            world: WorldFaults {
                torque_lost: (8000..8050).contains(&step),
                lane_lost: false,
            },
            ..Action::default()
        };
        let outcome: Outcome = simulation.step(&action).unwrap();
        trace.samples.extend(outcome.sample);
    }
    let found = stretches(&trace).unwrap();
    let told: Vec<_> = found.iter().map(|s| (s.why, s.from_s, s.until_s)).collect();
    assert_eq!(
        told,
        [
            (Cause::RequestEnded, 2.0, Some(4.0)),
            (Cause::TorqueLost, 8.0, Some(8.05)),
        ]
    );
    assert!(found.iter().all(|stretch| stretch.asked_for));
}

#[test]
fn by_hand_nothing_is_away_and_an_old_file_does_not_say() {
    let manual = Scenario::builder().condition(Condition::Manual).build().unwrap();
    let mut run = simulate(&manual);
    assert_eq!(stretches(&run.trace).unwrap(), []);
    run.trace.samples.truncate(3);
    let mut csv = Vec::new();
    run.trace.write_csv(&mut csv).unwrap();
    let text = String::from_utf8(csv).unwrap();
    let cut = |line: &str| line.rsplit_once(',').unwrap().0.to_owned() + "\n";
    let old: String = text.lines().map(cut).collect();
    assert!(text.contains("unguided_cause") && !old.contains("unguided_cause"));
    assert_eq!(
        stretches(&Trace::read_csv(text.as_bytes()).unwrap()),
        Some(vec![])
    );
    assert_eq!(stretches(&Trace::read_csv(old.as_bytes()).unwrap()), None);
}

#[test]
fn a_cause_is_read_back_from_its_code() {
    for cause in [
        Cause::TorqueLost,
        Cause::LaneLost,
        Cause::RequestEnded,
        Cause::TooSlow,
        Cause::Unnamed,
        Cause::Faults(HANDS_OFF | LANE_TIMEOUT),
    ] {
        assert_eq!(Cause::from_code(cause.code()), Some(cause));
    }
    assert_eq!(Cause::from_code(0.0), None);
    assert_eq!([Cause::TorqueLost.code(), Cause::Unnamed.code()], [-1.0, -5.0]);
    assert_eq!(
        Cause::Faults(HANDS_OFF | LANE_TIMEOUT).to_string(),
        "LaneTimeout+HandsOff"
    );
}
