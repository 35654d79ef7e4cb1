//! Drivers, vehicles and guidance as parts: the examples, the published parts against the published pair, failures that end.

use haptic_core::safety::modes::Mode;
use haptic_sim::guidance::OverBus;
use haptic_sim::models::road::{Course, Segment};
use haptic_sim::parts::{Acting, DriverView, PaperDriver, PaperVehicle, Vehicle};
use haptic_sim::scenario::{Condition, Failure, FailureKind};
use haptic_sim::simulation::{Ending, Run, simulate};
use haptic_sim::unguided::stretches;
use haptic_sim::{Action, Scenario, Simulation};

#[path = "../examples/own_driver.rs"]
mod own_driver;
#[path = "../examples/own_vehicle.rs"]
mod own_vehicle;

use own_driver::LINE_M;
use own_vehicle::{ALIGNING, Kinematic, RATIO, WHEELBASE_M};

/// Mean lateral error between two times, m.
fn mean_error_m(run: &Run, from_s: f64, to_s: f64) -> f64 {
    let samples = run.trace.samples.iter();
    let found: Vec<f64> = samples
        .filter(|sample| (from_s..to_s).contains(&sample.time_s))
        .map(|sample| sample.lateral_error_m)
        .collect();
    found.iter().sum::<f64>() / found.len() as f64
}

/// On the first straight, 60 s long, guidance pulls to the middle and the driver to a line 0.2 m beside it.
#[test]
fn a_driver_of_ones_own_drives_beside_the_middle_under_the_shipping_ecu() {
    own_driver::main();
    let run = own_driver::drive();
    assert_eq!(run.ending, Ending::CourseEnd);
    let offset_m = mean_error_m(&run, 30.0, 60.0);
    assert!((0.05..LINE_M).contains(&offset_m), "{offset_m}");
    let samples = &run.trace.samples;
    assert!(samples.iter().all(|sample| sample.lateral_error_m.abs() < 1.0));
    let straight = &samples[6000..12_000];
    let pull_nm = straight
        .iter()
        .map(|sample| sample.guidance_torque_nm)
        .sum::<f64>()
        / 6000.0;
    assert!(pull_nm < -0.05, "to the right: {pull_nm} N.m");
    // bindings/python/tests/test_examples.py has the same figure of the same driver in Python.
    let largest_m = samples
        .iter()
        .map(|sample| sample.lateral_error_m.abs())
        .fold(0.0, f64::max);
    assert_eq!(largest_m, 0.40802245804924103);
    assert!(
        samples.iter().all(|sample| sample.unguided_cause == 0.0),
        "the ECU guides all the time"
    );
}

#[test]
fn a_vehicle_of_ones_own_keeps_its_lane_under_the_shipping_ecu() {
    own_vehicle::main().unwrap();
    let run = own_vehicle::drive().unwrap();
    assert_eq!(run.ending, Ending::CourseEnd);
    let samples = &run.trace.samples;
    assert!(samples.iter().all(|sample| sample.lateral_error_m.abs() < 0.5));
    assert!(
        samples.iter().all(|sample| sample.unguided_cause == 0.0),
        "the ECU guides all the time"
    );
    // In the steady part of the first curve a kinematic vehicle's wheel points along the chord: tan(phi*ratio) = L*curvature.
    let steady = samples.iter().find(|sample| sample.s_m > 1500.0).unwrap();
    let wheel_rad = (WHEELBASE_M * steady.curvature_1pm).atan() / RATIO;
    assert!((steady.wheel_angle_rad - wheel_rad).abs() < 0.01, "{steady:?}");
}

/// A held torque turns the wheel until the aligning torque is as large; the circle then has the radius L/tan(delta).
#[test]
fn a_kinematic_vehicle_drives_the_textbooks_circle() {
    let (v, driver_torque_nm) = (10.0, 0.8);
    let mut vehicle = Kinematic::default();
    let mut points = Vec::new();
    for step in 0..90_000 {
        vehicle.step(&Acting {
            driver_torque_nm,
            guidance_torque_nm: 0.0,
            speed_m_per_s: [v; 2],
            bank_rad: 0.0,
        });
        if step >= 60_000 && step % 10_000 == 0 {
            points.push(vehicle.motion().position_m);
        }
    }
    // a_y = T/aligning = 0.8 m/s2, so r = 0.08 rad/s and R = 125 m; delta = atan(2.6/125).
    let radius_m = v * v * ALIGNING / driver_torque_nm;
    assert_eq!(radius_m, 125.0);
    let wheel_rad = vehicle.motion().wheel_angle_rad;
    assert!(
        (wheel_rad - (2.6_f64 / 125.0).atan() * 17.0).abs() < 1e-6,
        "{wheel_rad}"
    );
    // The circle through three points.
    let [[ax, ay], [bx, by], [cx, cy]] = points[..] else {
        panic!("three points");
    };
    let side = |x: f64, y: f64| x.hypot(y);
    let sides = [
        side(bx - cx, by - cy),
        side(ax - cx, ay - cy),
        side(ax - bx, ay - by),
    ];
    let area = 0.5 * ((bx - ax) * (cy - ay) - (cx - ax) * (by - ay)).abs();
    let found_m = sides.iter().product::<f64>() / (4.0 * area);
    assert!((found_m - radius_m).abs() < 1e-3, "{found_m}");
}

/// The published driver and vehicle coupled step by step, each torque held for 1 ms, against the exact pair.
#[test]
fn the_published_parts_drive_as_the_published_pair_within_a_millimetre() {
    for condition in [Condition::Manual, Condition::High, Condition::Low] {
        let failure = Failure {
            kind: if condition == Condition::Manual {
                FailureKind::None
            } else {
                FailureKind::Torque
            },
            ..Failure::default()
        };
        let scenario = Scenario::builder()
            .condition(condition)
            .failure(failure)
            .build()
            .unwrap();
        let exact = Simulation::with(&scenario, OverBus::new(scenario.setup())).run();
        let (driver, vehicle) = (PaperDriver::new(&scenario), PaperVehicle::new(&scenario));
        let parts = Simulation::of_parts(&scenario, driver, vehicle, OverBus::new(scenario.setup())).run();
        assert_eq!(exact.ending, parts.ending);
        let largest = |of: fn(&haptic_log::trace::Sample) -> f64| {
            let pairs = exact.trace.samples.iter().zip(&parts.trace.samples);
            pairs.map(|(a, b)| (of(a) - of(b)).abs()).fold(0.0, f64::max)
        };
        let (apart_m, torque_nm) = (largest(|s| s.lateral_error_m), largest(|s| s.driver_torque_nm));
        assert!(
            apart_m < 1e-3 && torque_nm < 0.02,
            "{condition}: {apart_m} m, {torque_nm} N.m"
        );
    }
}

/// A long curve, so that the guidance always has a torque.
fn curve() -> Course {
    let segments = vec![
        Segment::straight(100.0),
        Segment::clothoid(60.0, 0.0, 0.004),
        Segment::arc(900.0, 0.004),
    ];
    Course::new("curve", 3.5, segments).unwrap()
}

fn failing(kind: FailureKind, duration_s: Option<f64>) -> Scenario {
    let failure = Failure {
        kind,
        time_s: 20.0,
        duration_s,
    };
    Scenario::builder()
        .course(curve())
        .condition(Condition::Low)
        .failure(failure)
        .build()
        .unwrap()
}

/// Whatever is lost in a curve ends guidance by a handover: the motor does not obey, or there was no lane for a second. Once it is
/// back the driver takes the request back, and asks again after a second in Standby, in the next frame of the request (10 ms).
#[test]
fn what_was_lost_for_three_seconds_comes_back() {
    for kind in [FailureKind::Torque, FailureKind::Input] {
        let run = simulate(&failing(kind, Some(3.0)));
        let [away] = stretches(&run.trace).unwrap()[..] else {
            panic!("{kind}: one stretch");
        };
        let left_s = if kind == FailureKind::Input { 21.0 } else { 20.0 };
        assert!((left_s..left_s + 0.05).contains(&away.from_s), "{kind}: {away:?}");
        let back_s = away.until_s.expect("it comes back");
        assert!((24.0..24.03).contains(&back_s), "{kind}: {away:?}");
        let last = run.trace.samples.last().unwrap();
        assert!(
            last.guidance_torque_nm.abs() > 0.1 && last.lateral_error_m.abs() < 0.5,
            "{last:?}"
        );
        let for_good = simulate(&failing(kind, None));
        assert_eq!(
            for_good.trace.samples[..4600],
            run.trace.samples[..4600],
            "the same until then"
        );
        assert_eq!(stretches(&for_good.trace).unwrap()[0].until_s, None);
    }
}

/// A driver who only looks at what there is to be perceived.
struct Witness(Vec<DriverView>);

impl haptic_sim::parts::Driver for Witness {
    fn look_ahead_s(&self) -> [f64; 2] {
        [0.3, 1.0]
    }

    fn step(&mut self, view: &DriverView) -> f64 {
        self.0.push(*view);
        4.0 * view.lane.e_theta_rad - 2.0 * view.wheel_angle_rad
    }
}

/// The lamp is on from 0.2 s without a picture on, and while the ECU hands over; T_h felt is that of the step before; the points lie where the times say.
#[test]
fn a_driver_sees_the_lamp_and_feels_the_torque() {
    let scenario = failing(FailureKind::Input, None);
    let vehicle = PaperVehicle::new(&scenario);
    let ecu = OverBus::new(scenario.setup());
    let mut simulation = Simulation::of_parts(&scenario, Witness(Vec::new()), vehicle, ecu);
    let (mut applied, mut handing_over) = (Vec::new(), Vec::new());
    while simulation.steps() < 22_000 {
        let seen = simulation.view().unwrap();
        let outcome = simulation.step(&Action::default()).unwrap();
        applied.push(outcome.applied_torque_nm);
        handing_over.push(outcome.status.unwrap().mode == Mode::Handover);
        assert_eq!(simulation.driver_vehicle().driver.0.last(), Some(&seen));
    }
    let views = &simulation.driver_vehicle().driver.0;
    assert!(!views[15_000].warning && !views[15_000].is_lost && views[20_000].is_lost);
    // The last picture is at most 8.3 ms old when the input fails, and counts as missing after 30 ms.
    assert!(!views[20_200].warning && views[20_250].warning && !handing_over[20_250]);
    assert!(views[21_100].warning && handing_over[21_099]);
    assert!((1..22_000).all(|step| views[step].guidance_torque_nm == applied[step - 1]));
    // 60 km/h for 0.7 s on a straight are 11.667 m.
    let [near_m, far_m] = views[0].points_m;
    assert!((near_m - 5.0).abs() < 1e-9 && (far_m - near_m - 0.7 * 60.0 / 3.6).abs() < 1e-9);
}
