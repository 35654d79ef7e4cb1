//! Logs whose fault is not the driver's nor a torque sensor's: what is named, and that honest logs with a car of their own are not accused.

use std::path::PathBuf;

use haptic_analysis::identify::{DriveLog, Identification, Options, identify_with_noise_model};
use haptic_batch::experiment::Recorder;
use haptic_sim::models::driver::DriverParameters;
use haptic_sim::models::nonlinear::WorldParameters;
use haptic_sim::participants::participants;
use haptic_sim::scenario::Scenario;
use haptic_sim::simulation;

fn recorded() -> DriveLog {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data/driver-logs/guided-probe.csv");
    DriveLog::open(&path, false).unwrap()
}

fn fit(log: &DriveLog) -> Identification {
    identify_with_noise_model(log, &Options::default())
}

/// What a log with one fault is told, and that nothing of it is identified.
fn first_cause(spoil: impl Fn(&mut DriveLog)) -> String {
    let mut log = recorded();
    spoil(&mut log);
    let found = fit(&log);
    assert!(
        found.parameters.list().iter().all(|p| !p.2.identified),
        "{:?}",
        found.refuted
    );
    found
        .refuted
        .first()
        .map_or_else(String::new, |r| r.cause.clone())
}

fn negated(u: &mut [f64]) {
    u.iter_mut().for_each(|x| *x = -*x);
}

/// What is done to a log.
type Spoiled = fn(&mut DriveLog);

#[test]
fn what_is_wrong_with_a_signal_is_named() {
    let faults: [(Spoiled, &str); 6] = [
        (|log| log.e_y_m.fill(0.0), "e_y_m is dead"),
        (
            |log| log.driver_torque_nm.iter_mut().for_each(|t| *t = t.abs()),
            "driver_torque_nm is recorded without its sign",
        ),
        (|log| negated(&mut log.e_y_m), "the sign of e_y_m is swapped"),
        (
            |log| negated(&mut log.e_theta_rad),
            "the sign of e_theta_rad is swapped",
        ),
        (
            |log| {
                let half = log.len() / 2;
                log.wheel_angle_rad[half..].iter_mut().for_each(|phi| *phi += 0.1);
            },
            "the sensor of the wheel angle got a new zero",
        ),
        (
            |log| {
                let half = log.len() / 2;
                log.wheel_angle_rad[half..].iter_mut().for_each(|phi| *phi -= 0.1);
            },
            "the sensor of the wheel angle got a new zero",
        ),
    ];
    for (spoil, says) in faults {
        let cause = first_cause(spoil);
        assert!(cause.starts_with(says), "{cause:?} where {says:?} is true");
    }
}

/// A guided drive of participant 5 with a probe, in a car with so much dry friction, N.m; by sensors with steps, or exact.
fn driven(friction_nm: f64, rounded: bool) -> DriveLog {
    let world = WorldParameters {
        friction_nm,
        ..WorldParameters::default()
    };
    let truth = participants()[4].guided;
    let driver = DriverParameters {
        remnant_sd_nm: 0.1,
        ..truth.parameters()
    };
    let scenario = Scenario::builder()
        .driver(driver)
        .gains(truth.gains())
        .world(world)
        .seed(4711)
        .guidance(crate::probing());
    let mut recorder = Recorder::new(rounded);
    simulation::observe(&scenario.build().unwrap(), |outcome| recorder.observe(outcome));
    recorder.into_log()
}

/// A car whose column has 0.3 N.m of dry friction (Dahl) is no car with a wrong torque sensor.
#[test]
fn friction_accuses_no_sensor() {
    let truth = participants()[4].guided;
    let found = fit(&driven(0.3, true));
    assert!(found.refuted.is_empty(), "{:?}", found.refuted);
    let [friction, _] = found.balance.unwrap().friction_nm.unwrap();
    assert!((0.2..=0.35).contains(&friction), "{friction}");
    let k_hg = found.parameters.k_hg;
    let [low, high] = k_hg.interval_95.unwrap();
    assert!(
        k_hg.identified && (low..=high).contains(&truth.k_hg.unwrap()),
        "{k_hg:?}"
    );
}

/// A wheel of 0.02 kg.m2 above a torsion bar takes `J phi''`, by the second difference of the angle. Told so give or take 10 %, told
/// 10 % less and told exactly, `identify` has an interval of K_hg that holds the truth; not knowing 10 % of it adds to the error what they move.
#[test]
fn the_inertia_of_a_wheel_is_in_the_errors() {
    const J: f64 = 0.02;
    let mut log = driven(0.0, false);
    let wheel = log.wheel_angle_rad.clone();
    for (k, w) in wheel.windows(3).enumerate() {
        log.driver_torque_nm[k + 1] -= J * (w[2] - 2.0 * w[1] + w[0]) / log.dt_s.powi(2);
    }
    let interval = |told: f64, is_exact: bool| {
        let mut options = Options::default();
        if is_exact {
            options.fix(&format!("wheel_inertia={told}")).unwrap();
        } else {
            options.wheel_inertia = Some(told);
        }
        // Second differences have no damping.
        options.fix("wheel_damping=0").unwrap();
        let found = identify_with_noise_model(&log, &options);
        let k_hg = found.parameters.k_hg;
        let known = k_hg.interval_95.zip(k_hg.estimate.zip(k_hg.standard_error));
        known.unwrap_or_else(|| panic!("{k_hg:?} {:?}", found.refuted))
    };
    let truth = participants()[4].guided.k_hg.unwrap();
    let [about, less, exact] =
        [(J, false), (0.9 * J, false), (J, true)].map(|(told, exact)| interval(told, exact));
    for ([low, high], _) in [about, less, exact] {
        assert!((low..=high).contains(&truth), "{low} to {high}, {truth}");
    }
    // What 10 % of the inertia move is what not knowing them adds.
    let (about, less, exact) = (about.1, less.1, exact.1);
    let (moved, added) = (
        (about.0 - less.0).abs(),
        (about.1.powi(2) - exact.1.powi(2)).sqrt(),
    );
    assert!((0.7..1.4).contains(&(added / moved)), "{added} {moved}");
}
