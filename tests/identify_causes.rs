//! Logs whose fault is not the driver's nor a torque sensor's: what is named, and that honest logs with a car of their own are not accused.

use std::path::PathBuf;

use haptic_analysis::identify::{DriveLog, Identification, Options, Parameter, identify_with_noise_model};
use haptic_batch::experiment::Recorder;
use haptic_sim::models::driver::DriverParameters;
use haptic_sim::models::nonlinear::WorldParameters;
use haptic_sim::participants::participants;
use haptic_sim::scenario::{GuidanceParameters, Scenario};
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
    driven_with(friction_nm, rounded, crate::probing())
}

fn driven_with(friction_nm: f64, rounded: bool, guidance: GuidanceParameters) -> DriveLog {
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
        .guidance(guidance);
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

/// A log whose torque is a bar's below a wheel of this inertia, by the second difference of the angle.
fn above_a_bar(mut log: DriveLog, inertia: f64) -> DriveLog {
    let wheel = log.wheel_angle_rad.clone();
    for (k, w) in wheel.windows(3).enumerate() {
        log.driver_torque_nm[k + 1] -= inertia * (w[2] - 2.0 * w[1] + w[0]) / log.dt_s.powi(2);
    }
    log
}

/// What is found of the wheel's inertia where it is sought, beside these parameters.
fn sought(log: &DriveLog, fixes: &[&str]) -> (Parameter, Identification) {
    let fixes: Vec<String> = fixes.iter().map(ToString::to_string).collect();
    let mut options = Options::given(false, &fixes).unwrap();
    options.take_inertia("estimate").unwrap();
    let found = identify_with_noise_model(log, &options);
    let (name, wheel) = *found.beyond.last().unwrap();
    assert_eq!(name, "wheel_inertia");
    (wheel, found)
}

/// A probe tells wheels from near the least to near the largest that is sought within 0.003 kg.m2, and one of 10 % with a known arm; what an
/// unknown arm leaves open is in the intervals, and K_hg's is wider than where the inertia is told.
#[test]
fn a_probe_tells_the_inertia_of_a_wheel() {
    let truth = participants()[4].guided.k_hg.unwrap();
    for inertia in [0.01, 0.02, 0.04, 0.06, 0.09] {
        let log = above_a_bar(driven(0.0, false), inertia);
        let [free, known] = [
            &["wheel_damping=0"][..],
            &["wheel_damping=0", "t_nms=0.1", "k_nms=1"],
        ]
        .map(|fixes| {
            let (wheel, found) = sought(&log, fixes);
            let [low, high] = wheel
                .interval_95
                .unwrap_or_else(|| panic!("{inertia}: {:?}", found.notes));
            assert!(
                wheel.identified && low < inertia && inertia < high,
                "{inertia}: {wheel:?}"
            );
            assert!(
                (wheel.estimate.unwrap() - inertia).abs() < 0.003,
                "{inertia}: {wheel:?}"
            );
            let k_hg = found.parameters.k_hg;
            let [low, high] = k_hg.interval_95.unwrap();
            assert!((low..=high).contains(&truth), "{inertia}: {k_hg:?}");
            assert!(
                found.assumed.iter().any(|a| a.contains("kg.m2 (estimated)")),
                "{:?}",
                found.assumed
            );
            [wheel, k_hg].map(|p| p.standard_error.unwrap())
        });
        assert!(
            known[0] < free[0] && known[1] < free[1],
            "{inertia}: {known:?} {free:?}"
        );
        let mut told = Options::given(false, &["wheel_damping=0".to_owned()]).unwrap();
        told.fix(&format!("wheel_inertia={inertia}")).unwrap();
        let told = identify_with_noise_model(&log, &told).parameters.k_hg;
        assert!(
            told.standard_error.unwrap() < free[1],
            "{inertia}: {told:?} {free:?}"
        );
    }
}

/// An inertia below 0.005 or above 0.1 kg.m2 is none that is sought, and without a probe, with too little of one, or in a drive that seems to have no
/// guidance, nothing tells it: then no parameter is called identified, and a note or a refutation says why.
#[test]
fn what_does_not_tell_an_inertia_is_said() {
    let silent = |mut log: DriveLog| {
        log.guidance_torque_nm.fill(0.0);
        log
    };
    let short = |mut log: DriveLog| {
        for column in [
            &mut log.e_y_m,
            &mut log.e_theta_rad,
            &mut log.wheel_angle_rad,
            &mut log.guidance_torque_nm,
            &mut log.driver_torque_nm,
        ] {
            column.truncate(400);
        }
        log
    };
    let probed = driven(0.0, false);
    let unprobed = driven_with(0.0, false, GuidanceParameters::default());
    // What the note says; where the model is refuted without it, none is wanted.
    for (log, says) in [
        (above_a_bar(probed.clone(), 0.002), Some("it rests on a bound")),
        (above_a_bar(probed.clone(), 0.12), None),
        (above_a_bar(unprobed, 0.04), Some("no probe, or")),
        (silent(above_a_bar(probed.clone(), 0.04)), Some("no probe, or")),
        (
            short(above_a_bar(probed, 0.04)),
            Some("what is not known of the arm hides it"),
        ),
    ] {
        let (wheel, found) = sought(&log, &["wheel_damping=0"]);
        assert!(
            !wheel.identified && wheel.estimate.is_none(),
            "{says:?}: {wheel:?}"
        );
        let identified = found.parameters.list().iter().any(|p| p.2.identified);
        assert!(!identified, "{says:?}: {:?}", found.parameters);
        let why = |note: &String| {
            note.strip_prefix("wheel_inertia is not identified: ")
                .map(str::to_owned)
        };
        let said = found.notes.iter().find_map(why);
        match (said, says) {
            (Some(said), Some(says)) => assert!(said.starts_with(says), "{says}: {said}"),
            (None, None) => assert!(!found.refuted.is_empty()),
            (said, says) => panic!("{says:?}: {said:?}"),
        }
        // Without an interval of the inertia nothing is shown as if it were known.
        let is_shown = found.line.is_some() || found.at_t_nms.is_some();
        let is_known = wheel.interval_95.is_some() || !found.refuted.is_empty();
        assert!(is_known || !is_shown, "{says:?}");
    }
}

/// A wheel of 0.02 kg.m2 above a torsion bar takes `J phi''`, by the second difference of the angle. Told so give or take 10 %, told
/// 10 % less and told exactly, `identify` has an interval of K_hg that holds the truth; not knowing 10 % of it adds to the error what they move.
#[test]
fn the_inertia_of_a_wheel_is_in_the_errors() {
    const J: f64 = 0.02;
    let log = above_a_bar(driven(0.0, false), J);
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
