//! The fourteen participants as drivers with a known truth: what the identification must find, what it must
//! refuse, and whether its standard errors are right.

use haptic_analysis::identify::{DriveLog, Identification, Options, Parameter, identify_with_noise_model};
use haptic_batch::engine::Watch;
use haptic_batch::experiment::{ExperimentPlan, Recorder, experiment};
use haptic_evidence::estimates::repeat;
use haptic_sim::models::driver::DriverParameters;
use haptic_sim::participants::{PublishedDriver, participants};
use haptic_sim::scenario::{Scenario, Sensors};
use haptic_sim::simulation;
use rayon::prelude::*;

/// One guided drive with a probe, without remnant, logged exactly. Nobody moves the wheel for the ECU, which feels no hand at times:
/// equation (8) has no such torque.
fn identified_without_noise(driver: &PublishedDriver) -> Identification {
    let scenario = Scenario::builder()
        .driver(DriverParameters {
            answers_hands_off_after_s: f64::INFINITY,
            ..driver.parameters()
        })
        .gains(driver.gains())
        .sensors(Sensors::Exact)
        .guidance(crate::probing());
    let mut recorder = Recorder::new(false);
    simulation::observe(&scenario.build().unwrap(), |outcome| recorder.observe(outcome));
    identify_with_noise_model(&recorder.into_log(), &Options::default())
}

/// gain_1, gain_2, gain_3, t_p and K_hg with their truth.
fn with_truth(found: &Identification, driver: &PublishedDriver) -> [(Parameter, f64); 5] {
    let (p, sum) = (&found.parameters, driver.k_d + 1.0);
    [
        (p.gain_1, sum * driver.a_1),
        (p.gain_2, sum * driver.a_2),
        (p.gain_3, sum * driver.a_3),
        (p.t_p, driver.t_p),
        (p.k_hg, driver.k_hg.unwrap()),
    ]
}

#[test]
fn without_noise_all_parameters_are_within_one_percent() {
    participants().into_par_iter().for_each(|participant| {
        let driver = participant.guided;
        let found = identified_without_noise(&driver);
        let [gains @ .., (t_p, true_t_p), (k_hg, true_k_hg)] = with_truth(&found, &driver);
        assert!(
            (t_p.estimate.unwrap() - true_t_p).abs() < 0.002,
            "{} {t_p:?}",
            participant.number
        );
        for (parameter, truth) in gains {
            let estimate = parameter.estimate.unwrap();
            assert!(
                (estimate / truth - 1.0).abs() < 0.01,
                "{}: {estimate} for {truth}",
                participant.number
            );
        }
        // K_hg of those who rely on the guidance is near zero: 1 % of its range.
        assert!(
            (k_hg.estimate.unwrap() - true_k_hg).abs() < 0.01 * true_k_hg.max(0.1),
            "{}",
            participant.number
        );
    });
}

/// K_hg 0 and 1 are drivers too: a bound that rounding passes by a hair is no contradiction.
#[test]
fn drivers_at_either_end_of_k_hg_are_identified() {
    for k_hg in [0.0, 1.0] {
        let mut driver = participants()[0].guided;
        driver.k_hg = Some(k_hg);
        let found = identified_without_noise(&driver);
        for (parameter, truth) in with_truth(&found, &driver) {
            let estimate = parameter.estimate.unwrap();
            assert!(
                (estimate - truth).abs() < 0.01 * truth.max(0.1),
                "{estimate} for {truth}"
            );
        }
    }
}

/// 14 participants x 5 seeds with a 0.2 N.m probe: K_hg is read within 0.05 in each drive, and the 95 % intervals of
/// all parameters hold the truth as often as they promise.
#[test]
fn with_a_probe_k_hg_is_read_and_the_intervals_hold_what_they_promise() {
    let plan = ExperimentPlan {
        participants: (1..=14).collect(),
        probe_nm: 0.2,
        seed: 1,
    };
    let found = repeat(&plan, 5, &Watch::nobody()).unwrap();
    for line in found.participants.iter().filter(|p| p.parameter == "k_hg") {
        assert_eq!(line.identified, 1.0, "{line:?}");
        assert!(line.largest.unwrap() < 0.05, "{line:?}");
    }
    let coverage = found.pooled.iter().map(|p| p.coverage).sum::<f64>() / found.pooled.len() as f64;
    assert!((0.90..=0.99).contains(&coverage), "{coverage}");
}

/// Without a probe, on the same drives: the default method says that K_hg is not identified, for every
/// participant; the published way names a number and puts it on its bound for most. Its mean fit is the paper's.
#[test]
fn without_a_probe_k_hg_is_not_identified() {
    let plan = ExperimentPlan {
        participants: (1..=14).collect(),
        probe_nm: 0.0,
        seed: 1,
    };
    let found = experiment(&plan, &Watch::nobody()).unwrap();
    let (guided, manual): (Vec<_>, Vec<_>) = found.drives.iter().partition(|d| d.guided);
    assert_eq!((guided.len(), manual.len()), (14, 14));
    for drive in &guided {
        let k_hg = drive.noise_model.identification.parameters.k_hg;
        assert!(
            !k_hg.identified && k_hg.estimate.is_none(),
            "{}",
            drive.participant
        );
        assert!(k_hg.standard_error.unwrap() > 0.15, "{}", drive.participant);
    }
    let on_bound = |d: &&&haptic_batch::experiment::Drive| d.paper.identification.parameters.k_hg.on_bound;
    assert!(guided.iter().filter(on_bound).count() >= 10);
    let mean_fit = |drives: &[&haptic_batch::experiment::Drive]| {
        drives
            .iter()
            .map(|d| d.paper.identification.fit_percent)
            .sum::<f64>()
            / drives.len() as f64
    };
    assert!((mean_fit(&guided) - 69.0).abs() < 1.5, "{}", mean_fit(&guided));
    assert!((mean_fit(&manual) - 76.0).abs() < 1.5, "{}", mean_fit(&manual));
    // Validation (4.3): no identified driver leaves the road, and none is farther off than the paper's worst.
    for drive in &found.drives {
        let error = drive.noise_model.trajectory_error_m.unwrap();
        assert!(error < 0.366, "{}: {error}", drive.participant);
    }
}

/// A drive recorded at instants that limp by up to a fifth of a step: resampled by its stamps it is not refuted, and the
/// truth lies in the intervals of all that is identified.
#[test]
fn a_drive_with_uneven_stamps_is_resampled_and_identified() {
    let driver = participants()[1].guided;
    let scenario = Scenario::builder()
        .driver(DriverParameters {
            remnant_sd_nm: 0.07,
            ..driver.parameters()
        })
        .gains(driver.gains())
        .guidance(crate::probing())
        .seed(4)
        .build()
        .unwrap();
    let mut steps: Vec<[f64; 5]> = Vec::new();
    simulation::observe(&scenario, |o| {
        let seen = &o.observation;
        let lane = [o.preview.e_y_m, o.preview.e_theta_rad];
        steps.push([
            lane[0],
            lane[1],
            seen.wheel_angle_rad,
            o.applied_torque_nm,
            seen.driver_torque_nm,
        ]);
    });
    let mut columns: [Vec<f64>; 6] = Default::default();
    for k in 1.. {
        let time_s = (k as f64 + 0.2 * (12.9898 * k as f64).sin()) / 120.0;
        let (whole, share) = ((time_s * 1e3) as usize, (time_s * 1e3).fract());
        let Some([now, next]) = steps
            .get(whole..whole + 2)
            .and_then(|w| <&[[f64; 5]; 2]>::try_from(w).ok())
        else {
            break;
        };
        columns[0].push(time_s);
        for (c, column) in columns[1..].iter_mut().enumerate() {
            // T_h is held for its millisecond.
            let held = c == 3;
            column.push(if held {
                now[c]
            } else {
                now[c] + share * (next[c] - now[c])
            });
        }
    }
    let log = DriveLog::from_columns(columns, false).unwrap();
    assert!(log.findings[0][1].starts_with("uneven"), "{:?}", log.findings);
    let found = identify_with_noise_model(&log, &Options::default());
    assert!(found.refuted.is_empty(), "{:?}", found.refuted);
    for (parameter, truth) in with_truth(&found, &driver) {
        let [low, high] = parameter.interval_95.unwrap();
        assert!(low <= truth && truth <= high, "{parameter:?} against {truth}");
    }
    assert!(found.parameters.k_hg.identified);
}
