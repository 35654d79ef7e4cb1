//! How fast a line may slide aside, while yaw rate and yaw error say that the vehicle goes straight, before it is found: the bound
//! that `docs/explanation/hazard-analysis.md` builds on, counted here from the ways alone.

use haptic_core::quantity::Metres;
use haptic_core::safety::faults::Fault;
use haptic_core::safety::modes::Mode;

use crate::rig::Rig;

/// The lane check sums what moves beyond the prediction with a memory of 1 s, up to 0.8 m, and learns up to 0.15 m/s.
const MARGIN_M: f64 = 0.8;
const LEARNT_M_PER_S: f64 = 0.15;

/// When a line that slides by so many m/s is found, s; `None` if it is not until it has gone 5 m.
fn found_s(m_per_s: f64) -> Option<f64> {
    let mut rig = Rig::paper();
    rig.yaw_rate = Some(0.0);
    rig.lane.e_y = Metres::from_m(-2.5 * m_per_s.signum());
    rig.run(1500);
    rig.engage = true;
    rig.run(500);
    let last_ms = (5000.0 / m_per_s.abs()) as u32;
    let found = (0..last_ms).find(|ms| {
        let seconds = 1e-3 * f64::from(*ms);
        rig.lane.e_y = Metres::from_m(-2.5 * m_per_s.signum() + m_per_s * seconds);
        let step = rig.tick();
        // No torque grows faster than 4 N.m/s, or beyond 5 N.m, whatever the line does meanwhile.
        assert!(rig.applied.abs() <= 5.0, "{} N.m", rig.applied);
        if step.command.mode != Mode::Active {
            assert!(step.command.faults.contains(Fault::LaneImplausible));
        }
        step.command.mode != Mode::Active
    });
    found.map(|ms| 1e-3 * f64::from(ms))
}

#[test]
fn a_line_that_slides_faster_than_the_bound_is_found_and_a_slower_one_is_not() {
    for sign in [1.0, -1.0] {
        for m_per_s in [0.2, 0.5, 0.75] {
            assert_eq!(found_s(sign * m_per_s), None, "{m_per_s} m/s");
        }
        for m_per_s in [1.05, 1.5, 2.0, 4.0] {
            let found_s = found_s(sign * m_per_s).expect("it is found");
            // The sum of a constant rate, without and with all that may be learnt, and two pictures.
            let sum_s = |rate: f64| -(1.0 - MARGIN_M / rate).ln();
            let (least, most) = (sum_s(m_per_s), sum_s(m_per_s - LEARNT_M_PER_S) + 0.02);
            println!(
                "{m_per_s} m/s: found after {found_s:.2} s, {:.2} m",
                m_per_s * found_s
            );
            assert!((least..=most).contains(&found_s), "{m_per_s} m/s: {found_s} s");
        }
    }
}

/// A whole vehicle that is invented, in a bend in which guidance carries all of the aligning torque, so that nothing contradicts it; its
/// driver torque moves by so much to and fro, N.m. When guidance warns of hands that are off, and when it ends, s.
fn phantom(dither_nm: f64, sign: f64) -> [Option<u32>; 2] {
    let mut rig = Rig::paper();
    rig.curve(2.0 * sign);
    rig.yaw_rate = Some(rig.lane.e_theta.rad() / 0.7);
    rig.run(600);
    rig.engage = true;
    let [mut warned, mut ended] = [None; 2];
    for ms in 0..60_000_u32 {
        rig.driver = Some(if ms / 50 % 2 == 0 { dither_nm } else { -dither_nm });
        let step = rig.tick();
        if step.command.faults.contains(Fault::HandsOff) {
            warned.get_or_insert(ms / 1000);
        }
        if step.command.mode != Mode::Active {
            ended.get_or_insert(ms / 1000);
        } else if ended.is_none() && ms > 3000 {
            assert!((rig.applied - 2.0 * sign).abs() < 0.02, "{} N.m", rig.applied);
        }
    }
    [warned, ended]
}

/// Hands whose torque changes by no more than 0.08 N.m are off: a warning after 15 s, the end after 30 s. What moves more is a hand.
#[test]
fn an_invented_vehicle_is_bounded_by_the_hands_alone() {
    for sign in [1.0, -1.0] {
        for (dither_nm, warned_s, ended_s) in [(0.01, 15, 30), (0.035, 15, 30)] {
            assert_eq!(
                phantom(dither_nm, sign),
                [Some(warned_s), Some(ended_s)],
                "{dither_nm}"
            );
        }
        assert_eq!(phantom(0.05, sign), [None, None]);
    }
}
