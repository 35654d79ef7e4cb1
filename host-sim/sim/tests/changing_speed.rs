//! A speed that changes: against sums done by hand, the steady state of the textbooks, and the constant run.

use haptic_core::bus::e2e::ReceiverState;
use haptic_core::bus::messages::{Guidance as GuidanceMessage, Message, Vehicle};
use haptic_core::safety::faults::FaultSet;
use haptic_core::safety::modes::Mode;
use haptic_log::trace::Sample;
use haptic_sim::fork::simulate_forked;
use haptic_sim::models::disturbances::SensorErrors;
use haptic_sim::models::driver::DriverParameters;
use haptic_sim::models::road::{Course, LaneChoice};
use haptic_sim::scenario::{Condition, Failure, FailureKind, Sensors, Speed};
use haptic_sim::simulation::{Ending, Run, observe, simulate};
use haptic_sim::{Action, Scenario, Simulation};

fn by_time(points: &[(f64, f64)]) -> Speed {
    let kmh: Vec<f64> = points.iter().map(|p| p.1).collect();
    Speed::by_time_kmh(points.iter().map(|p| p.0).collect(), &kmh)
}

fn by_place(points: &[(f64, f64)]) -> Speed {
    Speed::ByPlace {
        place_m: points.iter().map(|p| p.0).collect(),
        speed_m_per_s: points.iter().map(|p| p.1 / 3.6).collect(),
    }
}

fn course(text: &str) -> Course {
    Course::from_toml("c", text).unwrap()
}

fn straight(length_m: f64) -> Course {
    course(&format!("[[segment]]\nlength_m = {length_m}"))
}

/// 300 m straight, then a left curve of 200 m of radius.
fn curve() -> Course {
    course(
        "[[segment]]\nlength_m = 300\n[[segment]]\nlength_m = 100\ncurvature_start_per_m = 0\ncurvature_end_per_m = 0.005\n\
         [[segment]]\nlength_m = 500\ncurvature_per_m = 0.005",
    )
}

fn close(found: f64, wanted: f64, within: f64, what: &str) {
    assert!((found - wanted).abs() <= within, "{what}: {found}, not {wanted}");
}

/// 72 km/h for 5 s, then -2 m/s2 for 5 s, then 36 km/h: 100 m, 75 m more, and what follows.
#[test]
fn by_time_the_way_is_the_integral_of_the_speed() {
    let speed = by_time(&[(5.0, 72.0), (10.0, 36.0)]);
    let scenario = Scenario::builder().course(straight(300.0)).speed(speed);
    let scenario = scenario.build().unwrap();
    let run = simulate(&scenario);
    for sample in &run.trace.samples {
        let t = sample.time_s;
        let (v, s) = match t {
            _ if t <= 5.0 => (20.0, 20.0 * t),
            _ if t <= 10.0 => (20.0 - 2.0 * (t - 5.0), 100.0 + (t - 5.0) * (20.0 - (t - 5.0))),
            _ => (10.0, 175.0 + 10.0 * (t - 10.0)),
        };
        close(sample.speed_m_per_s, v, 1e-9, "speed");
        close(sample.s_m, s, 1e-6, "way");
    }
    // The far point, 10 m ahead, is at the end of 300 m at 175 + 10*(t - 10) = 290: after 21.5 s.
    assert_eq!(run.ending, Ending::CourseEnd);
    close(f64::from(run.steps) * 1e-3, 21.5, 2e-3, "end");
    close(scenario.duration_s(), 21.5, 1e-9, "duration");
    close(scenario.reach_m(), 290.0, 1e-9, "reach");
    assert!((4300..=4301).contains(&run.trace.samples.len()));
}

/// The square of the speed is linear in place: from 20 to 10 m/s between 100 and 250 m.
#[test]
fn by_place_the_speed_is_that_of_the_place() {
    let speed = by_place(&[(100.0, 72.0), (250.0, 36.0)]);
    for course in [straight(500.0), curve()] {
        let scenario = Scenario::builder().course(course).speed(speed.clone());
        let run = simulate(&scenario.build().unwrap());
        assert_eq!(run.ending, Ending::CourseEnd);
        for sample in &run.trace.samples {
            let braked_m = (sample.s_m - 100.0).clamp(0.0, 150.0);
            // A step is 20 mm, the squares fall by 2 m/s2 times it.
            close(
                sample.speed_m_per_s,
                (400.0 - 2.0 * braked_m).sqrt(),
                1e-3,
                "speed",
            );
        }
    }
}

#[test]
fn a_lane_of_opendrive_is_driven_by_place() {
    let text = std::fs::read_to_string(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../examples/banked-road.xodr"
    ));
    let course = Course::from_opendrive("banked-road.xodr", &text.unwrap(), &LaneChoice::default()).unwrap();
    let end_m = course.length_m();
    let speed = by_place(&[(0.2 * end_m, 80.0), (0.6 * end_m, 40.0)]);
    let run = simulate(&Scenario::builder().course(course).speed(speed).build().unwrap());
    assert_eq!(run.ending, Ending::CourseEnd);
    let last = run.trace.samples.last().unwrap();
    close(last.speed_m_per_s, 40.0 / 3.6, 1e-9, "speed at the end");
    close(
        run.trace.samples[0].speed_m_per_s,
        80.0 / 3.6,
        1e-9,
        "speed at the start",
    );
}

/// The largest differences of lateral error, wheel angle and driver torque.
fn differences(a: &Run, b: &Run) -> [f64; 3] {
    let mut most = [0.0_f64; 3];
    for (a, b) in a.trace.samples.iter().zip(&b.trace.samples) {
        let of = |s: &Sample| [s.lateral_error_m, s.wheel_angle_rad, s.driver_torque_nm];
        for (most, (a, b)) in most.iter_mut().zip(of(a).into_iter().zip(of(b))) {
            *most = most.max((a - b).abs());
        }
    }
    most
}

/// Within 0.05 mm, 0.05 mrad and 0.05 mN.m on the paper's course: its plant goes v*t along its path, the other one the
/// hypotenuse of v and the lateral velocity.
#[test]
fn a_profile_of_equal_speeds_is_the_constant_run() {
    let builder = || Scenario::builder().condition(Condition::High);
    let constant = simulate(&builder().speed_kmh(60.0).build().unwrap());
    for speed in [
        by_time(&[(0.0, 60.0), (50.0, 60.0)]),
        by_place(&[(100.0, 60.0), (900.0, 60.0)]),
    ] {
        let scenario = builder().speed(speed).build().unwrap();
        assert_eq!(scenario.duration_s(), builder().build().unwrap().duration_s());
        let run = simulate(&scenario);
        let found = differences(&constant, &run);
        assert!(found.iter().all(|most| *most < 5e-5), "{found:?}");
    }
}

/// Behind the braking, in the arc: r = v/R of the path, and beta = (l_r - m*l_f*v^2/(2*L*K_r))/R (Abe, Vehicle Handling
/// Dynamics; table 9 at 10 m/s: 1.635 - 0.17840 m).
#[test]
fn behind_a_braking_the_vehicle_turns_as_the_textbook_says() {
    let speed = by_place(&[(200.0, 72.0), (350.0, 36.0)]);
    // More than a turn: a driver's integral takes its time at this speed.
    let course = course(
        "[[segment]]\nlength_m = 300\n[[segment]]\nlength_m = 100\ncurvature_start_per_m = 0\ncurvature_end_per_m = 0.005\n\
         [[segment]]\nlength_m = 1500\ncurvature_per_m = 0.005",
    );
    // A driver who moves the wheel because the ECU asks for a hand is not at rest.
    let driver = DriverParameters {
        answers_hands_off_after_s: f64::INFINITY,
        ..DriverParameters::default()
    };
    for condition in [Condition::Manual, Condition::Mid] {
        let scenario = Scenario::builder()
            .course(course.clone())
            .condition(condition)
            .driver(driver);
        let run = simulate(&scenario.speed(speed.clone()).build().unwrap());
        let last = run.trace.samples.last().unwrap();
        let radius_m = 200.0 - last.lateral_error_m;
        close(last.yaw_rate_rad_per_s * radius_m / 10.0, 1.0, 1e-3, "yaw rate");
        close(last.sideslip_rad * radius_m, 1.635 - 0.178_40, 5e-3, "side slip");
    }
}

/// On a circle, the tangent at a point turns by atan(v*t/R) to the foot of the point v*t ahead: whoever looks ahead by time
/// looks less far when the vehicle is slower. And the bus carries the speed of the step, as the sensor has it.
#[test]
fn everybody_sees_the_speed_of_the_step() {
    let speed = by_time(&[(28.0, 72.0), (32.0, 36.0)]);
    let errors = SensorErrors {
        speed_gain: 1.02,
        ..SensorErrors::default()
    };
    let builder = Scenario::builder().course(curve()).sensor_errors(errors);
    let (mut receiver, mut sent) = (ReceiverState::TRUSTED, 0);
    let run = observe(&builder.speed(speed).build().unwrap(), |outcome| {
        let v = (20.0 - 2.5 * (outcome.time_s() - 28.0)).clamp(10.0, 20.0);
        close(outcome.observation.speed_m_per_s, 1.02 * v, 1e-9, "seen");
        for frame in outcome.frames_in.iter().filter(|frame| frame.id() == Vehicle::ID) {
            let vehicle = Vehicle::decode(&mut receiver, frame).unwrap();
            close(vehicle.speeds[0].m_per_s(), 1.02 * v, 0.004, "on the bus");
            sent += 1;
        }
    });
    assert_eq!(sent, run.steps.div_ceil(10));
    let mut judged = 0;
    for sample in run.trace.samples.iter().filter(|s| s.time_s > 25.0) {
        let radius_m = 200.0 - sample.lateral_error_m;
        // The point lies on the tangent of the movement, which is not quite that of the road.
        let seen = |error_rad: f64, ahead_s: f64| {
            let tangent = (ahead_s * sample.speed_m_per_s / radius_m).atan();
            close(error_rad + sample.heading_error_rad, tangent, 2e-3, "yaw error");
        };
        seen(sample.e_theta_rad, 1.0);
        seen(sample.guidance_e_theta_rad, 0.7);
        judged += 1;
    }
    assert!(judged > 1500, "{judged}");
}

#[test]
fn a_failure_in_mid_braking_and_a_clone_there_are_the_runs_that_they_are_of() {
    let speed = by_place(&[(200.0, 90.0), (400.0, 40.0)]);
    let base = Scenario::builder()
        .course(curve())
        .speed(speed)
        .condition(Condition::High);
    let base = base.build().unwrap();
    let braking = simulate(&base)
        .trace
        .samples
        .iter()
        .find(|s| s.s_m > 300.0)
        .unwrap()
        .time_s;
    let failures = [FailureKind::Torque, FailureKind::Input].map(|kind| Failure {
        kind,
        time_s: braking,
        duration_s: None,
    });
    let (nominal, forks) = simulate_forked(&base, &failures).unwrap();
    assert_eq!(nominal, simulate(&base));
    for (fork, failure) in forks.iter().zip(failures) {
        let alone = simulate(&base.to_builder().failure(failure).build().unwrap());
        assert_eq!(*fork, alone, "{failure:?}");
        assert!(!alone.diverged() && alone.trace != nominal.trace);
    }
    let mut original = Simulation::new(&base);
    while original.steps() < (1e3 * braking) as u32 {
        original.step(&Action::default()).unwrap();
    }
    assert_eq!(original.clone().run().ending, original.run().ending);
}

/// From 60 to 100 and to 40 km/h at 3 m/s2, on a straight and in curves of up to 2.6 m/s2 to either side, and through the
/// least speed that is guided: whoever brakes and accelerates tells no lie.
#[test]
fn honest_braking_is_no_fault() {
    let course = course(
        "[[segment]]\nlength_m = 150\n\
         [[segment]]\nlength_m = 80\ncurvature_start_per_m = 0\ncurvature_end_per_m = 0.0033\n\
         [[segment]]\nlength_m = 300\ncurvature_per_m = 0.0033\n\
         [[segment]]\nlength_m = 160\ncurvature_start_per_m = 0.0033\ncurvature_end_per_m = -0.0033\n\
         [[segment]]\nlength_m = 300\ncurvature_per_m = -0.0033\n\
         [[segment]]\nlength_m = 80\ncurvature_start_per_m = -0.0033\ncurvature_end_per_m = 0\n\
         [[segment]]\nlength_m = 300",
    );
    // 40 km/h are 11.1 m/s2*s: 3.7 s at 3 m/s2; 60 km/h 5.6 s.
    let mut profiles = Vec::new();
    for start_s in [2.0, 6.0, 10.0, 14.0, 18.0] {
        let up_s = start_s + 40.0 / 3.6 / 3.0;
        let down_s = up_s + 3.0;
        let slow_s = down_s + 60.0 / 3.6 / 3.0;
        profiles.push(by_time(&[
            (start_s, 60.0),
            (up_s, 100.0),
            (down_s, 100.0),
            (slow_s, 40.0),
            (slow_s + 4.0, 40.0),
            (slow_s + 8.0, 60.0),
        ]));
    }
    let mut guided = 0;
    for speed in profiles {
        for condition in [Condition::High, Condition::Mid, Condition::Low] {
            let builder = Scenario::builder().course(course.clone()).condition(condition);
            let scenario = builder
                .sensors(Sensors::Paper)
                .speed(speed.clone())
                .build()
                .unwrap();
            let mut receiver = ReceiverState::TRUSTED;
            let run = observe(&scenario, |outcome| {
                let guidance = GuidanceMessage::decode(&mut receiver, &outcome.frames_out[0]).unwrap();
                let at = (outcome.time_s(), &speed, condition);
                assert_eq!(
                    (guidance.mode, guidance.faults),
                    (Mode::Active, FaultSet::NONE),
                    "{at:?}"
                );
                guided += 1;
            });
            assert!(!run.diverged());
        }
    }
    assert!(guided > 15 * 40_000, "{guided}");
}

/// Below 5 m/s nothing is guided: the ECU leaves by itself, calls it no fault, and the driver goes on. After a second at
/// 5 m/s or faster the driver asks anew.
#[test]
fn a_drive_goes_through_the_least_speed_that_is_guided() {
    let speed = by_time(&[(10.0, 40.0), (16.0, 10.0), (26.0, 10.0), (32.0, 40.0)]);
    for condition in Condition::ALL {
        // Without a remnant the second stay in a steady bend passes for hands off the wheel.
        let driver = DriverParameters {
            remnant_sd_nm: 0.1,
            ..DriverParameters::default()
        };
        let builder = Scenario::builder()
            .course(curve())
            .condition(condition)
            .driver(driver);
        let scenario = builder.speed(speed.clone()).build().unwrap();
        let (mut receiver, mut modes) = (ReceiverState::TRUSTED, Vec::new());
        let (mut slowest_guided, mut again) = (f64::INFINITY, None);
        let run = observe(&scenario, |outcome| {
            let Some(frame) = outcome.frames_out.first() else {
                return;
            };
            let guidance = GuidanceMessage::decode(&mut receiver, frame).unwrap();
            assert_eq!(guidance.faults, FaultSet::NONE);
            if guidance.mode == Mode::Active {
                slowest_guided = slowest_guided.min(outcome.observation.speed_m_per_s);
            }
            if modes.last() != Some(&guidance.mode) {
                modes.push(guidance.mode);
                if modes[..] == [Mode::Active, Mode::Fade, Mode::Standby, Mode::Active] {
                    again = Some(outcome.observation.speed_m_per_s);
                }
            }
        });
        if condition != Condition::Manual {
            assert_eq!(modes.len(), 4, "{modes:?}");
            // Vehicle and Request come every 10 ms, in which 1.39 m/s2 make 0.014 m/s.
            close(slowest_guided, 5.0, 0.02, "slowest that is guided");
            // A second after 5 m/s, at 1.39 m/s2.
            close(again.unwrap(), 6.39, 0.03, "speed of the second engagement");
        }
        assert_eq!(run.ending, Ending::CourseEnd);
        let errors = run.trace.samples.iter().map(|s| s.lateral_error_m.abs());
        assert!(errors.fold(0.0, f64::max) < 0.5);
    }
}
