//! A line that was taken in another's place: what it has to show before it has all of the torque.

use crate::rig::{Rig, SPEED};
use haptic_core::quantity::{Metres, Radians};
use haptic_core::safety::faults::{Fault, FaultSet};
use haptic_core::safety::modes::Mode;

/// rad/s; at the paper's 60 km/h its near point, 5 m ahead, turns by 0.25 m/s.
const RATE: f64 = 0.05;
/// What (9) asks for in it: K_1*a3', 10 N.m/rad, of 0.7 s.
const IN_BEND: f64 = 10.0 * 0.7 * RATE;
/// K_1*a1', N.m/m.
const PER_M: f64 = 0.5;

/// Guided through a bend that line and vehicle follow, to the left or to the right.
fn in_bend(sign: f64) -> Rig {
    let mut rig = Rig::paper();
    rig.turn(RATE * sign);
    rig.aligning = 0.987_4 * SPEED * RATE * sign;
    rig.lane.e_theta = Radians::from_rad(0.7 * RATE * sign);
    rig.run(600);
    rig.engage = true;
    rig.run(1500);
    assert!((rig.applied - IN_BEND * sign).abs() < 0.01, "{}", rig.applied);
    rig
}

/// In a steady bend a line shows nothing but that it turns with the vehicle: 0.25 m/s, summed with a memory of 1 s, are 0.2 m ln 5 =
/// 1.609 s after it was taken. Until then it has half of the torque, and 0.25 s later three quarters. What the vehicle turned
/// beside one line says nothing of the next.
#[test]
fn each_new_line_has_to_show_that_it_turns_with_the_vehicle() {
    for sign in [1.0, -1.0] {
        for aside in [0.4, -0.4] {
            let mut rig = in_bend(sign);
            for e_y in [aside, 0.0, aside] {
                rig.lane.e_y = Metres::from_m(e_y);
                rig.run_until(80, |step| step.command.faults.contains(Fault::LaneStep));
                rig.run_until(700, |step| step.command.faults == FaultSet::NONE);
                let asked = sign * IN_BEND + PER_M * e_y;
                let most = rig.run(1500).command.torque.nm() / asked;
                assert!((most - 0.5).abs() < 0.02, "{e_y}: {most} of what is asked for");
                let (ms, step) = rig.run_until(600, |step| step.command.torque.nm() / asked >= 0.75);
                assert!((1500 + ms).abs_diff(1859) <= 30, "{e_y}: {ms}");
                assert_eq!(step.command.mode, Mode::Active);
                rig.run(500);
                assert!((rig.applied - asked).abs() < 0.01, "{}", rig.applied);
            }
        }
    }
}
