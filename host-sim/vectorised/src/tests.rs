//! Vectorised runs against runs one by one: the shipping ECU is the oracle.

use haptic_core::controller::params::{DRIVER_ACTIVITY, Params};
use haptic_log::trace::Sample;
use rand::rngs::Xoshiro256PlusPlus;
use rand::{RngExt, SeedableRng};

use super::*;
use haptic_sim::models::disturbances::SensorErrors;
use haptic_sim::models::driver::{ArmGains, DriverParameters};
use haptic_sim::models::nonlinear::{Tyres, WorldParameters};
use haptic_sim::models::road::Course;
use haptic_sim::models::tolerances::Tolerances;
use haptic_sim::models::torsion_bar::{ColumnKind, ColumnParameters};
use haptic_sim::population::LaneKeeper;
use haptic_sim::scenario::{
    Condition, DriverChange, Failure, FailureKind, GuidanceParameters, ScenarioBuilder, Sensors, Speed,
};
use haptic_sim::simulation::simulate;
use haptic_sim::worlds::{WORLDS, WorldKind};

/// Every field of every sample, signs of zeros included.
fn bits(run: &Run) -> Vec<u64> {
    let fields =
        |sample: &Sample| haptic_log::trace::CHANNELS.map(|channel| (channel.value)(sample).to_bits());
    run.trace.samples.iter().flat_map(fields).collect()
}

/// Drives scenarios side by side and one by one; returns how many were rejected.
fn compare(scenarios: &[Scenario], width: Width) -> usize {
    let (mut suspects, mut seen) = (0, vec![0; scenarios.len()]);
    let options = Options {
        width,
        ..Options::default()
    };
    run_batch(scenarios, options, |number, event| {
        seen[number] += 1;
        let Event::Ended(run) = event else {
            suspects += 1;
            return;
        };
        let alone = simulate(&scenarios[number]);
        assert_eq!((run.steps, run.ending), (alone.steps, alone.ending), "{number}");
        let pairs = run.trace.samples.iter().zip(&alone.trace.samples);
        for (mine, shipping) in pairs {
            assert_eq!(mine, shipping, "{}", scenarios[number].to_toml());
        }
        assert_eq!(bits(run), bits(&alone), "{}", scenarios[number].to_toml());
    });
    assert!(seen.iter().all(|times| *times == 1), "{seen:?}");
    suspects
}

fn short_course() -> Course {
    let text = "[[segment]]\nlength_m = 120\n[[segment]]\nlength_m = 60\ncurvature_start_per_m = 0\ncurvature_end_per_m = 0.004\n\
        [[segment]]\nlength_m = 150\ncurvature_per_m = 0.004\n[[segment]]\nlength_m = 60\ncurvature_start_per_m = 0.004\n\
        curvature_end_per_m = -0.003\n[[segment]]\nlength_m = 200\ncurvature_per_m = -0.003\n[[segment]]\nlength_m = 150";
    Course::from_toml("short.toml", text).unwrap()
}

fn banked_course() -> Course {
    let text = "[[segment]]\nlength_m = 120\nbank_rad = -0.025\n[[segment]]\nlength_m = 60\ncurvature_start_per_m = 0\n\
        curvature_end_per_m = 0.004\nbank_start_rad = -0.025\nbank_end_rad = -0.06\n[[segment]]\nlength_m = 150\ncurvature_per_m = 0.004\n\
        bank_rad = -0.06\n[[segment]]\nlength_m = 60\ncurvature_start_per_m = 0.004\ncurvature_end_per_m = -0.003\nbank_start_rad = -0.06\n\
        bank_end_rad = 0.04\n[[segment]]\nlength_m = 200\ncurvature_per_m = -0.003\nbank_rad = 0.04\n[[segment]]\nlength_m = 150";
    Course::from_toml("banked.toml", text).unwrap()
}

/// What a scenario has beside the paper's, from a draw between two ends.
type Beside = fn(ScenarioBuilder, &mut dyn FnMut(f64, f64) -> f64) -> ScenarioBuilder;

/// Sensors with errors, but a camera that is in time.
fn erring(builder: ScenarioBuilder, between: &mut dyn FnMut(f64, f64) -> f64) -> ScenarioBuilder {
    builder.sensor_errors(SensorErrors {
        torque_bias_nm: between(-0.1, 0.1),
        torque_gain: between(0.95, 1.05),
        angle_bias_rad: between(-0.026, 0.026),
        speed_gain: between(0.97, 1.03),
        yaw_rate_bias_rad_per_s: between(-0.005, 0.005),
        yaw_rate_gain: between(0.97, 1.03),
        yaw_rate_noise_rad_per_s: between(-0.002, 0.003).max(0.0),
        lane_noise_m: between(-0.02, 0.03).max(0.0),
        heading_noise_rad: between(-0.002, 0.002).max(0.0),
        camera_yaw_rad: between(-0.002, 0.002),
        ..SensorErrors::default()
    })
}

/// Cars that differ, tyres, column, motor, wind and a road that lies aslant, each in some of the worlds.
fn nonlinear(builder: ScenarioBuilder, between: &mut dyn FnMut(f64, f64) -> f64) -> ScenarioBuilder {
    let mut some = |share: f64, from: f64, to: f64, off: f64| {
        let value = between(from, to);
        if between(0.0, 1.0) < share { value } else { off }
    };
    let world = WorldParameters {
        tyres: [Tyres::Linear, Tyres::Saturating][some(0.5, 1.0, 1.0, 0.0) as usize],
        mu: some(0.5, 0.6, 1.0, 1.0),
        castor_share: some(0.5, 0.2, 0.6, 0.4),
        bank_rad: some(0.3, -0.04, 0.04, 0.0),
        friction_nm: some(0.5, 0.1, 0.4, 0.0),
        friction_give_rad: some(0.5, 0.0017, 0.0087, 0.0035),
        assist_nm: some(0.3, 1.0, 8.0, 0.0),
        motor_lag_s: some(0.3, 0.001, 0.02, 0.0),
        motor_error: some(0.3, -0.1, 0.1, 0.0),
        motor_ripple_nm: some(0.3, 0.01, 0.03, 0.0),
        wind_n: some(0.3, -200.0, 200.0, 0.0),
        gust_sd_n: some(0.5, 20.0, 200.0, 0.0),
        ..WorldParameters::default()
    };
    let tolerances = Tolerances {
        tyres: some(0.3, 0.0, 0.15, 0.0),
        trail: some(0.3, 0.0, 0.15, 0.0),
        load_kg: some(0.3, 0.0, 300.0, 0.0),
        ..Tolerances::default()
    };
    let is_banked = some(0.5, 1.0, 1.0, 0.0) != 0.0;
    let builder = builder.world(world).tolerances(tolerances);
    if is_banked {
        builder.course(banked_course())
    } else {
        builder
    }
}

/// Speeds that change by time or by place, some below what is guided.
fn changing(builder: ScenarioBuilder, between: &mut dyn FnMut(f64, f64) -> f64) -> ScenarioBuilder {
    let first = between(50.0, 100.0);
    let kmh = vec![first, first * between(0.25, 1.1), first * between(0.3, 1.0)];
    if between(0.0, 1.0) < 0.5 {
        let time = vec![between(1.0, 5.0), between(12.0, 15.0), between(22.0, 26.0)];
        builder.speed(Speed::by_time_kmh(time, &kmh))
    } else {
        let place_m = vec![between(10.0, 80.0), between(250.0, 300.0), between(480.0, 600.0)];
        let speed_m_per_s = kmh.iter().map(|kmh| kmh / 3.6).collect();
        builder.speed(Speed::ByPlace {
            place_m,
            speed_m_per_s,
        })
    }
}

/// Random scenarios over all that lanes drive in the paper's world, with something beside it.
fn random(count: usize, seed: u64, beside: Beside) -> Vec<Scenario> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let course = short_course();
    let mut scenarios = Vec::new();
    while scenarios.len() < count {
        let mut between = |from: f64, to: f64| from + (to - from) * random.random::<f64>();
        let mut driver = DriverParameters {
            a_1: between(0.05, 0.3),
            a_2: between(0.0, 0.06),
            a_3: between(2.0, 4.0),
            t_p: between(0.001, 0.3),
            t_n: between(0.2, 0.5),
            t_f: between(0.8, 1.2),
            remnant_sd_nm: (between(-0.1, 0.2)).max(0.0),
            ..DriverParameters::default()
        };
        driver.takes_over_after_s = 10.0 * driver.t_p;
        let kind = [FailureKind::None, FailureKind::Torque, FailureKind::Input][between(0.0, 3.0) as usize];
        let time_s = between(2.0, 20.0);
        let change = DriverChange {
            time_s: between(0.0, 15.0),
            k_d: between(1.0, 4.0),
            k_hg: between(0.0, 1.0),
        };
        let manual = between(0.0, 1.0) < 0.1;
        let mut builder = Scenario::builder()
            .course(course.clone())
            .speed_kmh(between(30.0, 110.0))
            .driver(driver)
            .seed(between(0.0, 1e9) as u64);
        builder = if manual {
            builder.condition(Condition::Manual)
        } else {
            let failure = Failure {
                kind,
                time_s,
                duration_s: None,
            };
            builder
                .gains(ArmGains {
                    k_d: between(1.0, 5.0),
                    k_hg: between(0.0, 1.5),
                })
                .manual_k_d(between(1.0, 9.0))
                .failure(failure)
        };
        if between(0.0, 1.0) < 0.5 {
            let controller = Params {
                k_1: between(0.05, 0.4),
                a_1: between(0.5, 4.0),
                a_2: between(0.0, 0.3),
                a_3: between(10.0, 60.0),
                a_4: between(0.0, 3.0),
                rate_corner_hz: between(4.0, 20.0),
                torque_limit_nm: between(0.3, 5.0),
                wind_up_nm_per_s: between(0.5, 4.0),
                reduction_nm_per_s: between(4.0, 8.0),
                low_speed_share: between(0.0, 1.0),
                high_speed_share: between(0.0, 1.0),
                probe_amplitude_nm: between(0.0, 0.25),
                probe_frequency_hz: between(1.0, 2.2),
                ..Params::PAPER
            };
            builder = builder.guidance(GuidanceParameters {
                controller,
                t_n: between(0.2, 0.5),
                t_f: between(0.5, 0.9),
                probe: false,
            });
        }
        if between(0.0, 1.0) < 0.3 {
            builder = builder.driver_change(Some(change));
        }
        builder = builder.probe(!manual && between(0.0, 1.0) < 0.4);
        builder = beside(builder, &mut between);
        if let Ok(scenario) = builder.build() {
            scenarios.push(scenario);
        }
    }
    scenarios
}

#[test]
fn the_papers_drives_are_the_same_side_by_side() {
    let mut scenarios = Vec::new();
    for condition in [Condition::Manual, Condition::High, Condition::Mid, Condition::Low] {
        scenarios.push(Scenario::builder().condition(condition).build().unwrap());
    }
    for kind in [FailureKind::Torque, FailureKind::Input] {
        for condition in [Condition::High, Condition::Low] {
            let failure = Failure {
                kind,
                ..Failure::default()
            };
            let builder = Scenario::builder().condition(condition).failure(failure);
            scenarios.push(builder.build().unwrap());
        }
    }
    let driver = DriverParameters {
        remnant_sd_nm: 0.1,
        line_m: 0.3,
        ..DriverParameters::default()
    };
    scenarios.push(Scenario::builder().driver(driver).build().unwrap());
    // Who weaves is on the road for longer than the course takes.
    let weaving = haptic_sim::participants::participants()[12].guided;
    let builder = Scenario::builder().driver(weaving.parameters());
    scenarios.push(builder.gains(weaving.gains()).build().unwrap());
    assert_eq!(compare(&scenarios, Width::Widest), 0, "they are nominal");
}

#[test]
fn random_drives_are_the_same_side_by_side_and_few_are_suspect() {
    let suspects = compare(&random(80, 1, |builder, _| builder), Width::Widest);
    assert!(suspects < 30, "{suspects} of 80");
}

#[test]
fn sensors_with_errors_are_the_same_side_by_side_and_few_are_suspect() {
    let suspects = compare(&random(80, 3, erring), Width::Widest);
    assert!(suspects < 50, "{suspects} of 80");
}

#[test]
fn real_worlds_are_the_same_side_by_side_and_few_are_suspect() {
    let suspects = compare(&random(80, 4, nonlinear), Width::Widest);
    assert!(suspects < 50, "{suspects} of 80");
    let both: Beside = |builder, between| nonlinear(erring(builder, between), between);
    let suspects = compare(&random(60, 5, both), Width::Widest);
    assert!(suspects < 40, "{suspects} of 60");
}

#[test]
fn speeds_that_change_are_the_same_side_by_side_and_few_are_suspect() {
    let suspects = compare(&random(40, 8, changing), Width::Widest);
    assert!(suspects < 25, "{suspects} of 40");
    let all: Beside = |builder, between| changing(nonlinear(erring(builder, between), between), between);
    let suspects = compare(&random(40, 9, all), Width::Widest);
    assert!(suspects < 30, "{suspects} of 40");
}

/// A driver who keeps the lane, with guidance and by hand, in a car of a world on a road.
fn pair_in(world: &WorldKind, course: &Course, number: u64) -> [Scenario; 2] {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(number);
    let first_kmh: f64 = random.random_range(60.0..80.0);
    let speed = if world.changes_speed() {
        let kmh = [1.0, 1.0, 0.6, 0.6, 0.9].map(|share| share * first_kmh);
        Speed::by_time_kmh(vec![0.0, 4.0, 8.0, 12.0, 20.0], &kmh)
    } else {
        Speed::constant_kmh(first_kmh)
    };
    let builder = Scenario::builder().course(course.clone()).speed(speed);
    let guided = LaneKeeper::draw(&mut random, 0.36)
        .drives(builder, first_kmh / 3.6)
        .world(world.parameters())
        .tolerances(world.tolerances(number))
        .sensor_errors(world.sensor_errors())
        .seed(number);
    let k_d = guided.clone().build().unwrap().gains().k_d;
    let by_hand = guided.clone().condition(Condition::Manual);
    let by_hand = by_hand.gains(ArmGains { k_d, k_hg: 0.0 });
    [guided, by_hand].map(|builder| builder.build().unwrap())
}

/// Each world that has a name, on a level road and on one that lies aslant. Where the camera is late or blind nobody is guided
/// side by side, and a column with a bar is no world of these scenarios.
#[test]
fn every_named_world_is_the_same_side_by_side() {
    for world in WORLDS.iter().filter(|world| !world.has_bar()) {
        let roads = [short_course(), banked_course()];
        let numbers = roads
            .iter()
            .flat_map(|road| (0..2).map(move |number| (road, number)));
        let (guided, by_hand): (Vec<_>, Vec<_>) = numbers
            .map(|(road, number)| <(Scenario, Scenario)>::from(pair_in(world, road, number)))
            .unzip();
        let rejected = [guided, by_hand].map(|scenarios| compare(&scenarios, Width::Widest));
        let of_guided = if ["camera", "blind"].contains(&world.name) {
            4
        } else {
            0
        };
        assert_eq!(rejected, [of_guided, 0], "{}", world.name);
    }
}

/// Every step that is reported, and the samples of runs that are cut after 7 s, against the shipping ECU.
#[test]
fn every_step_is_reported_and_runs_are_cut_where_it_is_options() {
    let mut scenarios = random(20, 11, |builder, _| builder);
    scenarios.extend(random(12, 12, nonlinear));
    let mut steps: Vec<Vec<Step>> = vec![Vec::new(); scenarios.len()];
    let (mut cut, mut whole) = (Vec::new(), 0);
    let mut options = Options {
        every_step: true,
        ..Options::default()
    };
    run_batch(&scenarios, options, |number, event| match event {
        Event::Steps(more) => steps[number].extend(more),
        Event::Ended(run) => {
            whole += 1;
            let mut alone = Vec::new();
            haptic_sim::simulation::observe(&scenarios[number], |outcome| {
                alone.push(Step::from(outcome));
            });
            assert_eq!(run.steps as usize, alone.len());
            // Debug has the shortest digits that give the same bits back, and signs of zeros.
            assert_eq!(format!("{:?}", steps[number]), format!("{alone:?}"), "{number}");
        }
        Event::Rejected(_) => (),
    });
    assert!(whole > 12, "{whole}");
    options = Options {
        most_s: Some(7),
        ..Options::default()
    };
    run_batch(&scenarios, options, |number, event| {
        if let Event::Ended(run) = event {
            cut.push((number, run.clone()));
        }
    });
    assert!(cut.len() >= whole, "{} of {whole}", cut.len());
    for (number, run) in cut {
        let mut alone = simulate(&scenarios[number]);
        assert!(alone.steps > 7000);
        alone.trace.samples.truncate(1400);
        alone.steps = 7000;
        assert_eq!((run.steps, bits(&run)), (alone.steps, bits(&alone)), "{number}");
    }
}

#[test]
fn every_width_gives_the_same() {
    let mut scenarios = random(16, 2, |builder, _| builder);
    scenarios.extend(random(8, 6, erring));
    scenarios.extend(random(16, 7, nonlinear));
    scenarios.extend(random(8, 10, changing));
    for width in [Width::Widest, Width::Avx2, Width::Portable] {
        compare(&scenarios, width);
    }
}

#[test]
fn what_cannot_be_vectorised_is_named_and_rejected() {
    let exact = Scenario::builder().sensors(Sensors::Exact).build().unwrap();
    assert_eq!(unsupported_reason(&exact), Some(Reason::ExactSensors));
    assert_eq!(unsupported_reason(&Scenario::default()), None);
    let bar = Scenario::builder().column(ColumnParameters {
        kind: ColumnKind::TorsionBar,
        ..ColumnParameters::default()
    });
    assert_eq!(
        unsupported_reason(&bar.build().unwrap()),
        Some(Reason::TorsionBar)
    );
    let mut guidance = GuidanceParameters::default();
    guidance.controller.law = DRIVER_ACTIVITY;
    let another = Scenario::builder().guidance(guidance).build().unwrap();
    assert_eq!(unsupported_reason(&another), Some(Reason::AnotherLaw));
    let mut guidance = GuidanceParameters::default();
    guidance.controller.torque_sensor = 1.0;
    let bar = Scenario::builder().guidance(guidance).build().unwrap();
    assert_eq!(unsupported_reason(&bar), Some(Reason::BarSensor));
    let equal = Speed::by_time_kmh(vec![0.0, 50.0], &[60.0; 2]);
    let equal = Scenario::builder().speed(equal).build().unwrap();
    assert_eq!(unsupported_reason(&equal), None);
    let mut failure = Scenario::default().failure();
    (failure.kind, failure.duration_s) = (FailureKind::Torque, Some(3.0));
    let ends = Scenario::builder().failure(failure).build().unwrap();
    assert_eq!(unsupported_reason(&ends), Some(Reason::FailureEnds));
    assert_eq!(compare(&[exact], Width::Widest), 1);
}
