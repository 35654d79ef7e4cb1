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
