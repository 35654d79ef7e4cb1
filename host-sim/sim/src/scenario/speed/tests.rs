//! Speeds against sums done by hand and by a computer in small steps.

use super::*;
use crate::input::InputError;
use crate::models::road::Course;
use crate::scenario::Scenario;

fn by_time(time: &[f64], kmh: &[f64]) -> Speed {
    Speed::by_time_kmh(time.to_vec(), kmh)
}

fn by_place(place: &[f64], kmh: &[f64]) -> Speed {
    Speed::ByPlace {
        place_m: place.to_vec(),
        speed_m_per_s: kmh.iter().map(|kmh| kmh / 3.6).collect(),
    }
}

fn close(found: f64, wanted: f64, within: f64) {
    assert!((found - wanted).abs() < within, "{found}, not {wanted}");
}

/// 72 km/h are 20 m/s. From 10 s on 2 m/s2 less for 5 s: 10 m/s at 15 s, 75 m on.
#[test]
fn a_speed_by_time_is_held_and_falls_and_is_held() {
    let profile = by_time(&[10.0, 15.0], &[72.0, 36.0]).profile().unwrap();
    for (time_s, v, way_m) in [
        (0.0, 20.0, 0.0),
        (10.0, 20.0, 200.0),
        (12.0, 16.0, 236.0),
        (15.0, 10.0, 275.0),
        (25.0, 10.0, 375.0),
    ] {
        close(profile.at(time_s, 1e9), v, 1e-12);
        close(profile.way_m(time_s), way_m, 1e-9);
    }
}

/// From 20 to 10 m/s within 150 m are (100 - 400)/300 = -1 m/s2, for 10 s.
#[test]
fn a_speed_by_place_brakes_evenly() {
    let profile = by_place(&[100.0, 250.0], &[72.0, 36.0]).profile().unwrap();
    for (place_m, v) in [
        (-1.0, 20.0),
        (100.0, 20.0),
        (100.0 + 15.0 * 5.0 + 2.5 * 5.0, 15.0),
        (250.0, 10.0),
        (900.0, 10.0),
    ] {
        close(profile.at(1e9, place_m), v, 1e-12);
    }
    // 5 s to the braking, 10 s of it, 10 s behind it.
    close(profile.way_m(25.0), 350.0, 1e-9);
}

/// The first instant at which the place plus the look-ahead is the road's end, by steps of 0.1 ms.
fn end_in_steps(profile: &SpeedProfile, length_m: f64, ahead_s: f64) -> f64 {
    let (dt, mut time_s, mut place_m) = (1e-4, 0.0, 0.0);
    loop {
        let v = profile.at(time_s, place_m);
        if place_m + v * ahead_s >= length_m {
            return time_s;
        }
        place_m += dt * 0.5 * (v + profile.at(time_s + dt, place_m + v * dt));
        time_s += dt;
    }
}

#[test]
fn a_run_ends_when_the_look_ahead_gets_to_the_end_of_the_road() {
    let (up, down) = ([36.0, 108.0, 72.0], [108.0, 36.0, 72.0]);
    for speed in [
        by_time(&[3.0, 9.0, 14.0], &up),
        by_time(&[0.0, 4.0, 30.0], &down),
        by_place(&[50.0, 200.0, 400.0], &up),
        by_place(&[0.0, 90.0, 400.0], &down),
    ] {
        let profile = speed.profile().unwrap();
        for length_m in [20.0, 90.0, 130.0, 260.0, 430.0, 900.0] {
            // With 5 s the point ahead goes back while the vehicle brakes.
            for ahead_s in [0.1, 1.0, 5.0] {
                let (end_s, v) = profile.end(length_m, ahead_s);
                close(end_s, end_in_steps(&profile, length_m, ahead_s), 2e-3);
                close(v, profile.at(end_s, profile.way_m(end_s)), 1e-6);
            }
        }
    }
}

#[test]
fn a_speed_that_stays_has_the_end_that_it_always_had() {
    let profile = Speed::constant_kmh(61.7).profile().unwrap();
    let v = 61.7 / 3.6;
    assert_eq!(profile.end(3350.0, 1.3), ((3350.0 - v * 1.3) / v, v));
}

#[test]
fn points_that_make_no_sense_are_refused_by_name() {
    let text = |table: &str| {
        let text = format!("[speed]\n{table}");
        let none = |name: &str, _: &_| -> Result<Course, _> { Err(InputError::new(name, "not there")) };
        Scenario::from_toml("s.toml", &text, none).map_err(|e| e.to_string())
    };
    for (table, expected) in [
        (
            "time_s = [0, 10, 5]\nspeed_m_per_s = [16, 14, 16]",
            "speed.time_s (point 3) = 5 s is not behind point 2",
        ),
        (
            "time_s = [0, 10, 10]\nspeed_m_per_s = [16, 14, 16]",
            "speed.time_s (point 3) = 10 s is not behind point 2",
        ),
        (
            "time_s = [0, nan]\nspeed_m_per_s = [16, 16]",
            "speed.time_s (point 2) = NaN s is outside 0 to 1000000 s",
        ),
        (
            "place_m = [-1, 5]\nspeed_m_per_s = [16, 16]",
            "speed.place_m (point 1) = -1 m is outside 0 to 1000000 m",
        ),
        (
            "time_s = [0, 9]\nspeed_m_per_s = [16, nan]",
            "speed.speed_m_per_s (point 2) = NaN m/s is outside 2.5 to 70 m/s",
        ),
        (
            "time_s = [0, 9]\nspeed_m_per_s = [16, 0]",
            "speed.speed_m_per_s (point 2) = 0 m/s is outside 2.5 to 70 m/s",
        ),
        (
            "time_s = [0, 9]\nspeed_m_per_s = [16, 16, 16]",
            "speed.time_s has 2 and speed.speed_m_per_s 3 values",
        ),
        (
            "time_s = [0]\nspeed_m_per_s = [16]",
            "takes two points at least, not 1",
        ),
        (
            "place_m = []\nspeed_m_per_s = []",
            "takes two points at least, not 0",
        ),
        // 11 m/s less in a second.
        (
            "time_s = [0, 1]\nspeed_m_per_s = [28, 17]",
            "speed: acceleration to point 2 = -11 m/s2 is outside -8 to 5 m/s2",
        ),
        // (28^2 - 17^2)/(2*30)
        (
            "place_m = [0, 30]\nspeed_m_per_s = [17, 28]",
            "acceleration to point 2 = 8.25 m/s2 is outside -8 to 5",
        ),
        (
            "time_s = [0, 9]\nplace_m = [0, 9]\nspeed_m_per_s = [16, 16]",
            "either `time_s` or `place_m`",
        ),
        (
            "time_s = [0, 9]\nspeeds = [60, 60]",
            "unknown field `speeds`, expected one of `time_s`, `place_m`",
        ),
        ("speed_m_per_s = [16, 16]", "`time_s` or `place_m`"),
        ("time_s = 0\nspeed_m_per_s = 16", "expected a sequence"),
    ] {
        let error = text(table).unwrap_err();
        assert!(
            error.starts_with("s.toml: ") && error.contains(expected),
            "{table}: {error}"
        );
    }
    let both = "speed_m_per_s = 16\n[speed]\ntime_s = [0, 9]\nspeed_m_per_s = [16, 16]";
    let none = |name: &str, _: &_| -> Result<Course, _> { Err(InputError::new(name, "not there")) };
    let error = Scenario::from_toml("s.toml", both, none).unwrap_err().to_string();
    assert!(
        error.contains("one of speed_m_per_s, speed_kmh and a table [speed] is wanted"),
        "{error}"
    );
    // Behind the end of the road nothing is wrong: the run ends before.
    assert!(text("time_s = [0, 1e6]\nspeed_m_per_s = [16, 69]").is_ok());
}

#[test]
fn a_speed_written_and_read_again_is_the_same() {
    for speed in [
        by_time(&[0.0, 10.1, 15.3], &[72.0, 36.7, 250.0 / 3.0]),
        by_place(&[7.0, 250.0], &[72.0, 36.0]),
    ] {
        let scenario = Scenario::builder().speed(speed.clone()).build().unwrap();
        let none = |name: &str, _: &_| -> Result<Course, _> { Err(InputError::new(name, "not there")) };
        let again = Scenario::from_toml("s", &scenario.to_toml(), none).unwrap();
        assert_eq!(again, scenario);
        assert_eq!((again.speed(), again.changes_speed()), (&speed, true));
    }
}

#[test]
fn a_road_too_short_for_its_first_second_says_what_it_needs() {
    let course = Course::from_toml("c", "[[segment]]\nlength_m = 44").unwrap();
    let scenario = Scenario::builder().course(course);
    // 20 m/s, 3 m/s2: 21.5 m in the first second, and then 23 m ahead.
    let error = scenario
        .speed(by_time(&[0.0, 4.0], &[72.0, 115.2]))
        .build()
        .unwrap_err()
        .to_string();
    assert!(
        error.starts_with("course c is 44.0 m long, but at 82.8 km/h it needs 44.5 m: 23.0 m of"),
        "{error}"
    );
}
