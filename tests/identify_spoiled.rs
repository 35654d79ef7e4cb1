//! Logs as cars and simulators really record them, with a known truth: nothing that is wrong may be called identified, what
//! is wrong with the sensors has to be named, and what is only noisy must not be given up.
//!
//! Three participants and one seed here; `cargo xtask validate --corruptions 20` drives all of them.

use std::sync::LazyLock;

use haptic_batch::engine::Watch;
use haptic_batch::experiment::ExperimentPlan;
use haptic_evidence::estimates::{CorruptionLine, Corruptions, corruptions};

static FOUND: LazyLock<Corruptions> = LazyLock::new(|| {
    let plan = ExperimentPlan {
        participants: vec![2, 5, 9],
        probe_nm: 0.2,
        seed: 1,
    };
    corruptions(&plan, 1, "", &Watch::nobody()).unwrap()
});

fn line(name: &str) -> &'static CorruptionLine {
    FOUND.lines.iter().find(|l| l.corrupted_by == name).unwrap()
}

#[test]
fn nothing_wrong_is_called_identified() {
    let mut identified = 0;
    for l in &FOUND.lines {
        assert_eq!(l.false_identifications, 0, "{l:?}");
        identified += l.identified;
    }
    // Not by giving up: clean logs, noise and single faults leave most of it.
    assert!(identified > 150, "{identified}");
}

#[test]
fn what_is_only_noisy_is_identified_all_the_same() {
    for name in [
        "clean",
        "one e_theta sample off by 0.05 rad",
        "lane noise 5 mm, 0.5 mrad",
        "lane noise 10 mm, 1 mrad",
        "e_theta in steps of 2 mrad",
        "five lane samples zero",
        "lane zero for 0.1 s",
        "lane zero for 2 s",
        "hands off for 30 s",
        "parked for 20 s, wheel askew",
    ] {
        let l = line(name);
        assert_eq!((l.refuted, l.k_hg_read), (0, l.drives), "{l:?}");
    }
}

#[test]
fn a_wrong_sensor_is_refuted_with_its_cause() {
    for (name, cause) in [
        ("T_d at half scale", "times its value"),
        ("T_d 50 ms late", "driver_torque_nm is ms late"),
        ("T_h 8 ms late", "guidance_torque_nm is ms late"),
        ("sign of T_d", "sign of driver_torque_nm"),
        ("sign of T_h", "sign of guidance_torque_nm"),
        ("sign of the wheel angle", "sign of wheel_angle_rad"),
        ("guided, called manual", "--manual"),
        ("T_d is T_d + T_h", "the sum T_d + T_h"),
    ] {
        let l = line(name);
        assert_eq!((l.refuted, l.identified), (l.drives, 0), "{l:?}");
        let (said, times) = l.cause.as_ref().unwrap();
        assert!(*times == l.drives && said.contains(cause), "{l:?}");
    }
    for name in ["T_d is noise", "signs of the lane"] {
        assert_eq!(line(name).identified, 0, "{:?}", line(name));
    }
}

/// The arm is another one than is assumed, which the record says: it is estimated, and the model then holds.
#[test]
fn another_t_nms_is_estimated_and_refutes_nothing() {
    for name in ["t_nms 0.15 s", "t_nms 0.06 s", "noise 10 mm, t_nms 0.15 s"] {
        assert_eq!(line(name).refuted, 0, "{:?}", line(name));
    }
}
