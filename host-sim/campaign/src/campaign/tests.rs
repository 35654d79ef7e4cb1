//! What a row's runs sum up to, on runs whose deviations are set by hand.

use super::super::deviation::Deviation;
use super::super::drivers::Drivers;
use super::super::table::{FaultCase, rows};
use super::super::trial::{TrialOutcome, World};
use super::{CaseResult, FailedBy, result};

fn by_name(name: &str) -> &'static FaultCase {
    rows().find(|row| row.name == name).expect("a row of the table")
}

/// A row with runs of these deviations, m, of the same with a dropped torque, and whether the ECU noticed something.
fn row_of(name: &str, runs: &[(f64, Option<f64>, bool)]) -> CaseResult {
    let row = by_name(name);
    let run = World::new(None).run(by_name("counter-wrap"), 1);
    let outcomes: Vec<TrialOutcome> = (1..)
        .zip(runs)
        .map(|(seed, (faulted_m, dropped_m, noticed))| TrialOutcome {
            seed,
            deviation: Deviation {
                faulted_m: *faulted_m,
                dropped_m: *dropped_m,
                ..Deviation::default()
            },
            peak_nm: 2.0 * faulted_m,
            noticed_after_ms: noticed.then_some(30),
            failure: None,
            ..run.clone()
        })
        .collect();
    result(row, &outcomes, Drivers::Population.limits(), "")
}

/// 0.1 m beyond a dropped torque and a deviation of 0.95 m are allowed.
#[test]
fn runs_beyond_the_drop_and_beyond_the_limit_are_counted_apart() {
    let row = row_of(
        "lateral-error-frozen",
        &[
            (0.29, Some(0.20), true),
            (0.31, Some(0.20), true),
            (0.94, None, false),
            (0.96, None, false),
            // Both: as a failure it has one sentence.
            (1.20, Some(0.90), true),
        ],
    );
    assert_eq!((row.beyond_drop, row.beyond_limit), (2, 2));
    let failed: Vec<u64> = row.failures.iter().map(|failure| failure.seed).collect();
    assert_eq!(failed, [2, 4, 5]);
    assert!(row.failures.iter().all(|failure| failure.by == FailedBy::Vehicle));
    assert_eq!(row.unnoticed_deviation_m, Some(0.96));
    assert_eq!(row.unnoticed_torque_nm, Some(1.92));
}

#[test]
fn where_all_is_noticed_nothing_is_said_of_the_unnoticed() {
    let row = row_of("silent-lane", &[(0.5, Some(0.45), true)]);
    assert_eq!((row.unnoticed_deviation_m, row.unnoticed_torque_nm), (None, None));
}

/// Nothing that the ECU says moves a motor that ignores it; a hand that opposes is no limit's matter, but the drop's.
#[test]
fn who_does_not_decide_where_the_vehicle_goes_is_not_judged() {
    let far = [(3.0, Some(1.0), true)];
    let row = row_of("motor-ignores", &far);
    assert_eq!((row.beyond_drop, row.beyond_limit), (0, 0));
    let row = row_of("attack-lane-and-column-opposed", &far);
    assert_eq!((row.beyond_drop, row.beyond_limit), (1, 0));
}

/// The answers follow from the reactions that `cargo xtask faults --list` prints.
#[test]
fn guidance_may_end_where_something_is_wrong() {
    for (name, may_leave) in [
        ("lateral-error-frozen", true),
        ("lateral-error-x2", true),
        ("attack-motor-reading", true),
        ("jerk", false),
        ("driver-opposes-0.80", false),
        ("driver-opposes-10", false),
        ("lateral-error-drifting", false),
    ] {
        assert_eq!(by_name(name).may_leave(), may_leave, "{name}");
    }
}
