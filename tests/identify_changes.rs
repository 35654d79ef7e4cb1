//! Drivers who change while they drive in closed loop: seen, when, and with what truth in the pieces.

use haptic_batch::engine::Watch;
use haptic_batch::experiment::ExperimentPlan;
use haptic_evidence::estimates::{ChangesLine, changes};

fn line(participants: Vec<u32>, drives: u32, kind: &str) -> ChangesLine {
    let plan = ExperimentPlan {
        participants,
        probe_nm: 0.2,
        seed: 40,
    };
    let [line] = &changes(&plan, drives, kind, &Watch::nobody()).unwrap().lines[..] else {
        panic!("{kind}: more than one kind")
    };
    line.clone()
}

#[test]
fn a_step_of_k_hg_is_seen_when_it_was_and_its_pieces_hold_the_truth() {
    for kind in [
        "K_hg steps by 0.2",
        "K_hg steps by 1",
        "while the camera is blind",
    ] {
        let l = line(vec![1, 5, 9], 2, kind);
        assert_eq!((l.seen, l.steps_seen), (6, 6), "{l:?}");
        // What the camera did not see is told no finer than that: 10 s.
        assert!(kind.ends_with("blind") || l.within_5_s == 6, "{l:?}");
        assert!(l.instants.held >= 10, "{l:?}");
        assert_eq!(l.false_identifications, [0, 0], "{l:?}");
        assert!(l.identified[1] >= 12, "{l:?}");
        assert!(l.intervals[1].held * 10 >= l.intervals[1].identified * 8, "{l:?}");
    }
}

#[test]
fn a_drift_is_seen_and_nobody_is_identified_who_was_not_there() {
    for kind in ["K_hg drifts by 0.5", "steps ten times"] {
        let l = line(vec![2, 11], 2, kind);
        assert_eq!((l.seen, l.false_identifications), (4, [0, 0]), "{l:?}");
    }
}

#[test]
fn what_is_no_driver_is_not_called_one() {
    for kind in ["nothing", "weighed 0.4", "T_d drifts by"] {
        let l = line(vec![3, 14], 3, kind);
        assert_eq!(
            (l.of_driver, l.seen, l.false_identifications),
            (false, 0, [0, 0]),
            "{l:?}"
        );
    }
    // A sensor is named in their place.
    for kind in ["scale of T_d", "T_d drifts by"] {
        let l = line(vec![4, 7], 2, kind);
        assert_eq!((l.seen, l.refuted_otherwise), (0, 4), "{l:?}");
    }
}
