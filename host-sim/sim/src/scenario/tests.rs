//! What a scenario file may say, and how it is refused.

use super::*;

/// The scenario of a text, which is also that of the table that the text says.
fn parse(text: &str) -> Result<Scenario, InputError> {
    let course = |name: &str, _: &LaneChoice| Err(InputError::new(name, "not there"));
    let parsed = Scenario::from_toml("s.toml", text, course);
    if let Ok(table) = toml::from_str(text) {
        let read = Scenario::from_table("s.toml", table, course);
        assert_eq!(read.ok(), parsed.clone().ok(), "{text}");
    }
    parsed
}

#[test]
fn an_empty_file_is_tables_4_8_and_9() {
    let s = parse("").unwrap();
    assert_eq!(s, Scenario::default());
    let d = s.driver();
    assert_eq!((d.a_1, d.a_2, d.a_3), (0.1, 0.05, 3.7));
    assert_eq!((d.t_n, d.t_f, d.t_nms, d.k_nms), (0.3, 1.0, 0.1, 1.0));
    let g = s.guidance();
    assert_eq!(
        (g.controller.k_1, g.controller.a_1, g.controller.a_2),
        (0.25, 2.0, 0.05)
    );
    assert_eq!(
        (g.controller.a_3, g.controller.a_4, g.t_n, g.t_f),
        (40.0, 1.0, 0.3, 0.7)
    );
    let v = s.vehicle();
    assert_eq!((v.m, v.i, v.l_f, v.l_r), (1100.0, 2940.0, 1.0, 1.635));
    assert_eq!(
        (v.k_f, v.k_r, v.k_s, v.e_t),
        (53_300.0, 117_000.0, 48_510.0, 0.026)
    );
    assert_eq!((v.b_s, v.j_s, v.k_t), (0.57, 0.11, 1.0 / 17.0));
    assert_eq!((s.gains().k_d, s.gains().k_hg, s.speed_kmh()), (3.0, 0.5, 60.0));
}

#[test]
fn every_field_can_be_set() {
    let s = parse(
        "course = 'paper-course'\nspeed_m_per_s = 20\ncondition = 'high'\nsensors = 'exact'\nseed = 9\n\
         [driver]\nt_p_s = 0.3\nk_hg = 0.25\nremnant_sd_nm = 0.1\n[vehicle]\nm_kg = 1500\ni_kg_m2 = 3000\n\
         [guidance]\nk_1_nm = 0.5\na_2_s_per_m = 0.1\nt_f_s = 0.8\ntorque_limit_nm = 3\n\
         [failure]\nkind = 'torque'\ntime_s = 50",
    )
    .unwrap();
    assert_eq!((s.speed_kmh(), s.sensors(), s.seed()), (72.0, Sensors::Exact, 9));
    assert_eq!((s.driver().t_p, s.driver().remnant_sd_nm), (0.3, 0.1));
    assert_eq!(
        (s.gains().k_d, s.gains().k_hg, s.condition()),
        (2.0, 0.25, Condition::Custom)
    );
    assert_eq!((s.vehicle().m, s.vehicle().i), (1500.0, 3000.0));
    assert_eq!(
        (
            s.guidance().controller.k_1,
            s.guidance().controller.a_2,
            s.guidance().t_f
        ),
        (0.5, 0.1, 0.8)
    );
    assert_eq!(s.failure().at_s(), Some(50.0));
    assert_eq!(
        parse("condition = 'low'").unwrap().gains(),
        ArmGains { k_d: 4.0, k_hg: 1.0 }
    );
    assert_eq!(
        parse("[driver]\nk_d_nm_per_rad = 2\nk_hg = 0")
            .unwrap()
            .condition(),
        Condition::High
    );
}

/// Each text is refused with the file's name and the words beside it.
fn each_is_refused(cases: &[(&str, &str)]) {
    for (text, expected) in cases {
        let error = parse(text).unwrap_err().to_string();
        assert!(error.starts_with("s.toml: "), "{error}");
        assert!(
            error.contains(expected),
            "{text:?} gave {error:?}, not {expected:?}"
        );
    }
}

#[test]
fn a_file_of_another_kind_is_named() {
    each_is_refused(&[
        (
            "[[segment]]\nlength_m = 500",
            "this is a course: a scenario names it",
        ),
        (
            "[[law]]\nkind = 'fdca'\n[scenario]\nspeed_m_per_s = 16",
            "this is a comparison of laws, for `host-sim compare`",
        ),
    ]);
}

#[test]
fn a_law_that_is_none_of_the_list_is_refused() {
    each_is_refused(&[
        (
            "[guidance]\nlaw = 1.5",
            "guidance.law = 1.5 is not a whole number from 0 to 1",
        ),
        (
            "[guidance]\nlaw = 3",
            "guidance.law = 3 is not a whole number from 0 to 1",
        ),
        (
            "[guidance]\nlaw = -1",
            "guidance.law = -1 is not a whole number from 0 to 1",
        ),
    ]);
}

#[test]
fn every_bad_field_is_named_with_its_value_and_range() {
    let cases = [
        ("sped = 50", "sped"),
        ("[driver]\nkd = 3", "kd"),
        ("[guidance]\nt_x = 3", "t_x"),
        ("[failure]\nwhen = 3", "when"),
        ("[vehicle]\nmass = 3", "mass"),
        (
            "speed_m_per_s = 0",
            "speed_m_per_s = 0 m/s is outside 5.5 to 70 m/s",
        ),
        ("speed_m_per_s = nan", "speed_m_per_s = NaN"),
        ("speed_m_per_s = 'fast'", "line 1"),
        ("speed_m_per_s = 'fast'", "expected a number"),
        ("seed = -1", "expected a whole number, 0 or more"),
        ("condition = 'custom'", "custom"),
        ("sensors = 'perfect'", "perfect"),
        ("[failure]\nkind = 'brakes'", "brakes"),
        (
            "[driver]\nt_p_s = 0",
            "driver.t_p_s = 0 s is outside 0.001 to 2 s",
        ),
        (
            "[driver]\nk_d_nm_per_rad = -1",
            "driver.k_d_nm_per_rad = -1 N.m/rad is outside 0 to 50 N.m/rad",
        ),
        ("[driver]\nremnant_sd_nm = -1", "driver.remnant_sd_nm = -1"),
        ("[vehicle]\nm_kg = 0", "vehicle.m_kg = 0 kg"),
        (
            "[guidance]\nk_1_nm = 50",
            "guidance.k_1_nm = 50 N.m is outside 0 to 4 N.m",
        ),
        (
            "[guidance]\na_3_per_rad = 1e3",
            "guidance.a_3_per_rad = 1000 1/rad is outside 0 to 100 1/rad",
        ),
        (
            "[guidance]\na_4_s_per_rad = -1",
            "guidance.a_4_s_per_rad = -1 s/rad is outside 0 to 100 s/rad",
        ),
        (
            "[guidance]\nk_1_nm = 4\na_1_per_m = 9",
            "guidance: k_1_nm*a_1_per_m = 36 N.m/m is outside 0 to 32 N.m/m",
        ),
        (
            "[guidance]\nt_f_s = 0.05",
            "guidance.t_f_s = 0.05 s is outside 0.1 to 3 s",
        ),
        (
            "[vehicle]\nk_t = 0.2\nl_f_m = 0.1\nl_r_m = 0.1",
            "vehicle: K_t/(l_f + l_r) = 1 1/m is outside 0.001 to 0.1 1/m",
        ),
        ("[guidance]\nt_n_s = -0.1", "guidance.t_n_s = -0.1"),
        ("[failure]\ntime_s = -3", "failure.time_s = -3"),
        ("[driver_change]\ntime_s = 3\nk_d_nm_per_rad = 2", "k_hg"),
        (
            "[driver_change]\ntime_s = 3\nk_d_nm_per_rad = 2\nk_hg = -1",
            "driver_change.k_hg = -1",
        ),
        (
            "[guidance]\nprobe_amplitude_nm = 0.31",
            "guidance.probe_amplitude_nm = 0.31",
        ),
        (
            "[driver]\nt_f_s = 5\n[guidance]\nt_f_s = 5.5",
            "guidance.t_f_s = 5.5 s is outside 0.1 to 3 s",
        ),
    ];
    each_is_refused(&cases);
    assert!(
        parse("course = 'nowhere.toml'")
            .unwrap_err()
            .to_string()
            .starts_with("s.toml: course: nowhere.toml: ")
    );
}

/// What only guidance could use, and what a manual driver may have all the same.
#[test]
fn a_manual_driver_has_nothing_that_needs_guidance() {
    let manual = |rest: &str| parse(&format!("condition = 'manual'\n{rest}"));
    for (text, expected) in [
        ("[failure]\nkind = 'torque'", "failure.kind = \"torque\""),
        ("[failure]\nkind = 'input'", "failure.kind = \"input\""),
        ("[driver]\nk_hg = 0.5", "driver.k_hg = 0.5"),
        ("[guidance]\nprobe = true", "guidance.probe = true"),
        (
            "[driver_change]\ntime_s = 3\nk_d_nm_per_rad = 2\nk_hg = 0.25",
            "driver_change.k_hg = 0.25",
        ),
    ] {
        let error = manual(text).unwrap_err().to_string();
        assert!(
            error.starts_with("s.toml: condition = \"manual\"") && error.contains(expected),
            "{error}"
        );
    }
    let own_arm = manual(
        "[driver]\nk_d_nm_per_rad = 3\nk_hg = 0\n[driver_change]\ntime_s = 3\nk_d_nm_per_rad = 2\nk_hg = 0",
    )
    .unwrap();
    assert_eq!(
        (own_arm.condition(), own_arm.gains().k_d),
        (Condition::Manual, 3.0)
    );
}

/// At 60 km/h, 516.7 m less 1 s of look-ahead are 30 s.
#[test]
fn what_happens_in_mid_drive_happens_before_the_run_ends() {
    let after = |failure_s, kind| {
        let failure = Failure {
            kind,
            time_s: failure_s,
            duration_s: None,
        };
        let course = Course::from_toml("c", "[[segment]]\nlength_m = 516.7").unwrap();
        let scenario = Scenario::builder().course(course).failure(failure);
        scenario.build().unwrap()
    };
    assert!((after(0.0, FailureKind::None).duration_s() - 30.002).abs() < 1e-9);
    assert_eq!(after(30.0, FailureKind::Torque).check_times(), Ok(()));
    assert_eq!(after(70.0, FailureKind::None).check_times(), Ok(()));
    assert_eq!(
        after(30.1, FailureKind::Input)
            .check_times()
            .map_err(|e| e.to_string()),
        Err("failure.time_s = 30.1 s is outside 0 to 30 s: the run ends there".into())
    );
    let change = DriverChange {
        time_s: 31.0,
        k_d: 3.0,
        k_hg: 0.5,
    };
    let changing = after(0.0, FailureKind::None).to_builder();
    let changing = changing.driver_change(Some(change)).build().unwrap();
    let error = changing.check_times().unwrap_err().to_string();
    assert!(error.starts_with("driver_change.time_s = 31 s"), "{error}");
}

#[test]
fn a_course_with_less_than_a_second_to_drive_is_refused() {
    let course = |length| Course::from_toml("c", &format!("[[segment]]\nlength_m = {length}")).unwrap();
    // 1.0 s of look-ahead and 1 s to drive, at 60 km/h, are 33.333 m.
    let short = |length| {
        let scenario = Scenario::builder().course(course(length));
        scenario.build().map(|_| ()).map_err(|e| e.to_string())
    };
    assert_eq!(
        short(33.2),
        Err("course c is 33.2 m long, but at 60 km/h it needs 33.3 m: 16.7 m of look-ahead (1.00 s) and 1 s to \
             drive"
            .into())
    );
    assert_eq!(short(33.4), Ok(()));
}

/// What a result holds of its scenario is enough to run it again.
#[test]
fn a_scenario_written_and_read_again_is_the_same() {
    let course = "lane_width_m = 3.1\n[[segment]]\nlength_m = 150.5\n\
                  [[segment]]\nlength_m = 1000\ncurvature_start_per_m = 0.0\ncurvature_end_per_m = -0.00123456789012345\n";
    let others = "condition = 'low'\ncourse = 'my road.toml'\nspeed_m_per_s = 19.7\nseed = 7\n\
                  [driver]\nt_p_s = 0.1234567890123\nk_d_nm_per_rad = 3.21\nremnant_sd_nm = 0.1\n\
                  [guidance]\na_2_s_per_m = 0.07\nprobe = true\n[failure]\nkind = 'input'\ntime_s = 3.3\n\
                  [driver_change]\ntime_s = 2\nk_d_nm_per_rad = 3\nk_hg = 0.25\n[vehicle]\nm_kg = 1234.5\n";
    for text in ["", "condition = 'manual'", others] {
        let load = |name: &str, _: &LaneChoice| Course::from_toml(name, course);
        let scenario = Scenario::from_toml("s.toml", text, load).unwrap();
        let written = scenario.to_toml();
        let none = |name: &str, _: &LaneChoice| -> Result<Course, _> { panic!("asks for {name}") };
        assert_eq!(
            Scenario::from_toml("again.toml", &written, none).unwrap(),
            scenario,
            "{written}"
        );
    }
}

#[test]
fn a_bad_course_within_a_scenario_is_refused_like_one_in_a_file() {
    let text = "[course]\nname = 'mine'\nlane_width_m = 3\n\
                [[course.segment]]\nlength_m = 100\ncurvature_start_per_m = 0\ncurvature_end_per_m = 0.5\n";
    let none = |name: &str, _: &LaneChoice| -> Result<Course, _> { panic!("asks for {name}") };
    let error = Scenario::from_toml("s.toml", text, none).unwrap_err().to_string();
    assert!(
        error.contains("s.toml") && error.contains("segment 1: curvature_end_per_m = 0.5"),
        "{error}"
    );
}

#[test]
fn neutral_and_oversteering_vehicles_can_be_driven() {
    let understeering = VehicleParameters::default();
    // Neutral where l_r*K_r = l_f*K_f, by a rounding on either side; then oversteering, stable up to 320 km/h.
    let neutral = understeering.l_f * understeering.k_f / understeering.l_r;
    for k_r in [neutral, neutral * (1.0 - 1e-9), neutral * (1.0 + 1e-9), 31_000.0] {
        let vehicle = VehicleParameters { k_r, ..understeering };
        let scenario = Scenario::builder().vehicle(vehicle).build().unwrap();
        assert!(scenario.controller_params().vehicle.stability_factor_s2_per_m2 >= 0.0);
        assert!(!crate::simulation::simulate(&scenario).diverged(), "{k_r}");
    }
}

#[test]
fn a_real_world_is_driven_and_stands_in_the_file_of_the_scenario() {
    let text = "seed = 3\n[world]\ntyres = \"saturating\"\nmu = 0.8\nfriction_nm = 0.3\nmotor_lag_s = 0.005\n\
                gust_sd_n = 100\n[sensor_errors]\ntorque_bias_nm = 0.05\nlane_noise_m = 0.01\n";
    let scenario = Scenario::from_toml("s", text, |_, _| unreachable!()).unwrap();
    let again = Scenario::from_toml("s", &scenario.to_toml(), |_, _| unreachable!()).unwrap();
    assert_eq!(again, scenario);
    let (run, same) = (
        crate::simulation::simulate(&scenario),
        crate::simulation::simulate(&again),
    );
    assert!(!run.diverged());
    assert_eq!(run, same, "a seed fixes all");
    let other = scenario.to_builder().seed(4).build().unwrap();
    assert_ne!(crate::simulation::simulate(&other), run);
    // The wind and the friction are there.
    let ideal = Scenario::builder().seed(3).build().unwrap();
    let sdlp = |run: &crate::simulation::Run| {
        let errors = run.trace.samples.iter().map(|s| s.lateral_error_m.powi(2));
        errors.sum::<f64>() / run.trace.samples.len() as f64
    };
    assert!(sdlp(&run) > 1.5 * sdlp(&crate::simulation::simulate(&ideal)));
}

/// One rule for every name: the paper's symbol in small letters or words, and behind it the unit.
#[test]
fn every_name_ends_with_its_unit_and_begins_with_its_symbol() {
    let mut count = 0;
    for field in TABLES.iter().flat_map(|(_, fields)| fields()) {
        let unit = crate::fields::suffix(field.unit);
        assert!(field.name.ends_with(&unit), "{field:?}");
        let symbol = field.symbol.replace('\'', "").to_lowercase();
        assert!(field.name.starts_with(&symbol), "{field:?}");
        assert_eq!(field.name, field.name.to_lowercase());
        count += 1;
    }
    assert!(count > 90, "{count}");
}
