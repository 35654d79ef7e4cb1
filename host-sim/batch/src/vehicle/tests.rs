use haptic_log::recording::Group;
use haptic_log::recording::Series;

use super::*;

#[test]
fn the_trail_makes_the_aligning_stiffness_of_table_9() {
    // 2*0.026*53300/17 / (1 + 2*0.026*53300/48510) by hand: 154.22.
    assert!((trail(154.22, 53_300.0, 1.0 / 17.0, 48_510.0) - 0.026).abs() < 1e-5);
}

/// A drive of a vehicle on rails: yaw rate at once, v*angle/(16*2.5), the wheel to and fro at 0.3 Hz; no torque.
fn on_rails(amplitude_rad: f64, side: f64) -> Recording {
    let time_s: Vec<f64> = (0..6000).map(|k| f64::from(k) / 100.0).collect();
    let angle = |t: &f64| side * amplitude_rad * (std::f64::consts::TAU * 0.3 * t).sin();
    let speed = |t: &f64| 10.0 + 0.25 * t;
    let series = |name: &str, of: &dyn Fn(&f64) -> f64| Series {
        name: name.into(),
        values: time_s.iter().map(of).collect(),
        ..Series::default()
    };
    let channels = vec![
        series("wheel_angle_rad", &angle),
        series("yaw_rate_rad_per_s", &|t| {
            speed(t) * angle(t) / (16.0 * 2.5) + 1e-4 * (37.0 * t).sin()
        }),
        series("speed_m_per_s", &speed),
    ];
    Recording::of(Group::new(time_s.clone(), channels))
}

#[test]
fn the_file_is_a_scenario_with_the_vehicle_that_was_found() {
    let known = Known::new(1200.0, 2.5).unwrap();
    let mut found = identify(&on_rails(0.1, 1.0), &known, 0.3, Confidence::USUAL)
        .unwrap()
        .identification;
    let best = found.best.as_mut().unwrap();
    best.k_t = 0.05;
    (best.k_f, best.k_r) = (60_000.0, 70_000.0);
    let column = haptic_vehicle::BestColumn {
        j_s: 0.09,
        b_s: 0.5,
        friction_nm: 0.0,
        k_aln: 150.0,
    };
    best.column = Some(column);
    let text = scenario_file(&found, "a drive").unwrap().unwrap();
    let paper =
        |_: &str, _: &haptic_sim::models::road::LaneChoice| Ok(haptic_sim::models::road::Course::paper());
    let scenario = Scenario::from_toml("vehicle.toml", &text, paper).unwrap();
    let vehicle = scenario.vehicle();
    assert!(
        vehicle.m == 1200.0 && vehicle.k_t == 0.05 && vehicle.j_s == 0.09 && vehicle.k_f == 60_000.0,
        "{text}"
    );
    assert!((vehicle.l_f + vehicle.l_r - 2.5).abs() < 1e-4, "{text}");
    // Equation (4) with what was read back.
    let lever = 2.0 * vehicle.e_t * vehicle.k_f;
    assert!(
        (lever * vehicle.k_t / (1.0 + lever / vehicle.k_s) - 150.0).abs() < 0.01,
        "{text}"
    );
    best_without_column(&mut found);
    let text = scenario_file(&found, "a drive").unwrap().unwrap();
    assert!(
        text.contains("table 9's") && !text.contains("j_s_kg_m2"),
        "{text}"
    );
}

fn best_without_column(found: &mut VehicleIdentification) {
    found.best.as_mut().unwrap().column = None;
}

#[test]
fn a_drive_without_excitation_identifies_nothing_of_the_vehicle_and_no_torque_nothing_of_the_column() {
    let known = Known::new(1200.0, 2.5).unwrap();
    let mut silent = on_rails(0.0, 1.0);
    silent.groups[0].channels[1].values.fill(0.0);
    for recording in [silent, on_rails(1e-6, 1.0)] {
        let found = identify(&recording, &known, 0.3, Confidence::USUAL).unwrap();
        nothing_is_told(&found.identification);
    }
}

fn nothing_is_told(found: &VehicleIdentification) {
    for q in &found.quantities {
        let offset = q.name == "wheel_angle_offset";
        assert!(offset || q.verdict == Verdict::NotIdentified, "{q:?}");
        assert!(offset || (q.estimate.is_none() && !q.why.is_empty()), "{q:?}");
    }
    let column = found.quantities.iter().find(|q| q.name == "j_s").unwrap();
    assert!(column.why.contains("driver_torque_nm"), "{}", column.why);
    let told = |name: &str| {
        found
            .manoeuvres
            .iter()
            .any(|m| m.tells.iter().any(|t| t.name == name && t.identified))
    };
    assert!(told("steering_ratio"), "{:?}", found.manoeuvres);
}

#[test]
fn a_wheel_angle_in_degrees_and_one_of_another_sign_are_refused() {
    let known = Known::new(1200.0, 2.5).unwrap();
    for (factor, word) in [(-1.0, "sign"), (57.3, "rad"), (0.01, "rad")] {
        let mut recording = on_rails(0.1, 1.0);
        recording.groups[0].channels[0]
            .values
            .iter_mut()
            .for_each(|angle| *angle *= factor);
        let error = identify(&recording, &known, 0.3, Confidence::USUAL)
            .unwrap_err()
            .to_string();
        assert!(error.contains(word), "{error}");
    }
    let mut recording = on_rails(0.1, 1.0);
    recording.groups[0].channels.remove(2);
    let error = identify(&recording, &known, 0.3, Confidence::USUAL)
        .unwrap_err()
        .to_string();
    assert!(error.contains("speed_m_per_s"), "{error}");
}
