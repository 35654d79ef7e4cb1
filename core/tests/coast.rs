//! Guidance while the camera sees nothing for a while, or another line.

use crate::rig::{Rig, SPEED};
use crate::road::run_with_camera;
use haptic_core::quantity::{Metres, Micros, Radians, Torque};
use haptic_core::safety::faults::{Fault, FaultSet};
use haptic_core::safety::modes::Mode;

const LANE: usize = 0;
const VEHICLE: usize = 2;
/// K_1*a1' and K_1*a3' of the paper's law, N.m/m and N.m/rad.
const PER_M: f64 = 0.5;

/// On a straight, guided, beside the line.
fn beside(e_y_m: f64) -> Rig {
    let mut rig = Rig::paper();
    rig.yaw_rate = Some(0.0);
    rig.lane.e_y = Metres::from_m(e_y_m);
    rig.run(600);
    rig.engage = true;
    rig.run(1500);
    assert!((rig.applied - PER_M * e_y_m).abs() < 0.01, "{}", rig.applied);
    rig
}

/// A blink of the camera, silent or invalid: for its time past the 30 ms and the three frames that a sender shows, trust
/// falls by a half in a second, and it is back at one in a second.
#[test]
fn a_blink_takes_some_trust_and_brings_it_back() {
    for (ms, is_silent) in [(40, true), (40, false), (200, true), (500, false), (1000, true)] {
        let mut rig = beside(0.4);
        (rig.silent[LANE], rig.lane.valid) = (is_silent, is_silent);
        for _ in 0..ms {
            assert_eq!(rig.tick().command.mode, Mode::Active, "{ms} ms");
        }
        (rig.silent[LANE], rig.lane.valid) = (false, true);
        let least = (0..40).map(|_| {
            assert_eq!(rig.tick().command.mode, Mode::Active, "{ms} ms");
            rig.applied
        });
        let least = least.fold(f64::INFINITY, f64::min);
        // From 22 to 30 ms after it began until two frames later than it ended.
        let blind_s = f64::from(ms) * 1e-3 - 0.01;
        let expected = 0.4 * PER_M * (1.0 - 0.5 * blind_s);
        assert!(
            (least - expected).abs() < 0.005,
            "{ms} ms: {least}, not {expected}"
        );
        rig.run(500);
        assert!(
            (rig.applied - 0.4 * PER_M).abs() < 0.005,
            "{ms} ms: {}",
            rig.applied
        );
        assert_eq!(rig.tick().command.faults, FaultSet::NONE);
    }
}

/// A tenth of the torque is gone after 0.2 s without a picture in use: from then on the driver is warned, and no longer than it lasts.
/// The last picture is used for 22 to 30 ms, and three frames are needed.
#[test]
fn a_camera_that_is_silent_for_long_warns() {
    for (blind_ms, warned_ms) in [(100, 0), (190, 0), (300, 90), (900, 690)] {
        let mut rig = beside(0.2);
        rig.silent[LANE] = true;
        let mut warned = 0;
        for ms in 0..blind_ms + 100 {
            rig.silent[LANE] = ms < blind_ms;
            let step = rig.tick();
            assert_eq!(step.command.mode, Mode::Active);
            warned += u32::from(step.command.warning);
        }
        assert!(u32::abs_diff(warned, warned_ms) <= 12, "{blind_ms} ms: {warned}");
    }
}

/// A loss is declared after a second, and pictures make up for it half as fast: every second 0.4 s of none never end
/// guidance, 0.6 s do within 4.
#[test]
fn blinks_that_come_back_are_forgiven_half_as_fast() {
    for (blind_ms, stays) in [(300, true), (600, false)] {
        let mut rig = beside(0.2);
        let mut left = None;
        for ms in 0..60_000_u32 {
            // A hand that is felt.
            rig.driver = Some(if ms % 10_000 < 5000 { 0.0 } else { 0.1 });
            rig.silent[LANE] = ms % 1000 < blind_ms;
            if left.is_none() && rig.tick().command.mode != Mode::Active {
                left = Some(ms);
            }
        }
        assert_eq!(left.is_none(), stays, "{blind_ms} ms: {left:?}");
        assert!(left.is_none_or(|ms| ms < 4000), "{left:?}");
    }
}

/// In a bend of 0.05 rad/s that the vehicle follows, the camera goes blind; the line goes on, and so does the torque's share:
/// what the law asks of a near point 0.3 m aside and a far point 0.7 s ahead.
#[test]
fn the_line_goes_on_through_a_bend() {
    for sign in [1.0, -1.0] {
        let mut rig = Rig::paper();
        let rate = 0.05 * sign;
        rig.turn(rate);
        (rig.lane.e_y, rig.lane.e_theta) = (Metres::from_m(0.1), Radians::from_rad(0.7 * rate));
        rig.run(600);
        rig.engage = true;
        rig.run(1500);
        let before = rig.applied;
        rig.silent[LANE] = true;
        rig.run(30 + 500);
        let expected = before * 0.75;
        assert!(
            (rig.applied - expected).abs() < 0.01,
            "{}, not {expected}",
            rig.applied
        );
    }
}

/// The vehicle turns away by 0.1 rad/s from a straight line for half a second without a picture: 0.025 rad at the middle of
/// it. The near point, 5 m ahead, is then 0.25 m aside and the vehicle itself 0.2 m; K_1*a3' is 10 N.m/rad. A picture that
/// says so is believed at once, one that says that nothing happened is not.
#[test]
fn where_the_vehicle_went_meanwhile_is_known() {
    for (is_true, faults) in [
        (true, FaultSet::NONE),
        (false, FaultSet::NONE.with(Fault::LaneStep)),
    ] {
        let mut rig = beside(0.0);
        rig.silent[LANE] = true;
        rig.run(20);
        rig.turn(-0.1);
        // A sensor that is alive moves by its last bit.
        rig.driver = Some(1.0 / 4096.0);
        rig.run(500);
        rig.turn(0.0);
        rig.silent[LANE] = false;
        if is_true {
            rig.lane.e_theta = Radians::from_rad(0.05);
            rig.lane.e_y = Metres::from_m(0.05 * 0.3 * SPEED + 0.5 * 0.1 * 0.25 * SPEED);
        } else {
            rig.lane.e_y = Metres::from_m(0.0);
        }
        let step = rig.run(30);
        assert_eq!(step.command.faults, faults, "{is_true}");
        assert_eq!(step.command.mode, Mode::Active);
    }
}

/// Works: the line jumps aside by up to 0.8 m. Guidance lets go of the old one within half a second, with a warning, and takes
/// the new one within another.
#[test]
fn a_line_that_moves_is_let_go_of_and_taken() {
    for (from, to) in [(0.1, 0.5), (0.1, -0.5), (0.0, 0.79), (-0.3, 0.75), (2.0, -0.7)] {
        let mut rig = beside(from);
        let before = rig.applied;
        rig.lane.e_y = Metres::from_m(to);
        let (mut last, mut least, mut warned) = (before, before.abs(), 0);
        for _ in 0..40 + 500 + 20 {
            let step = rig.tick();
            assert_eq!(step.command.mode, Mode::Active, "{from} to {to}");
            assert!(
                (rig.applied - last).abs() <= 0.0085,
                "{from} to {to}: {last} to {}",
                rig.applied
            );
            warned += u32::from(step.command.warning);
            (last, least) = (rig.applied, least.min(rig.applied.abs()));
        }
        assert!(least < 0.01, "{from} to {to}: {least}");
        assert!((490..=520).contains(&warned), "{warned}");
        // A line that has shown no movement yet has half of the torque.
        rig.run(1500);
        assert!(
            (rig.applied - 0.5 * PER_M * to).abs() < 0.01,
            "{from} to {to}: {}",
            rig.applied
        );
    }
}

/// From a line to one 0.5 m aside, of which half of the torque follows.
fn on_a_new_line(sign: f64) -> Rig {
    let mut rig = beside(0.0);
    rig.lane.e_y = Metres::from_m(0.5 * sign);
    rig.run(1600);
    assert!(
        (rig.applied - 0.5 * PER_M * 0.5 * sign).abs() < 0.01,
        "{}",
        rig.applied
    );
    rig
}

/// The vehicle turns towards a new line for 0.4 s by 0.07 rad/s, goes on for 1 s and turns back; the line moves as it does, times
/// `share`. By hand 0.47 m/s. Returns where the line is then, or `None` where guidance has ended.
fn turns_towards(rig: &mut Rig, sign: f64, share: f64) -> Option<f64> {
    let (mut heading, mut y) = (0.0, 0.0);
    for ms in 0..2500 {
        let rate = match ms {
            0..400 => 0.07 * sign,
            1400..1800 => -0.07 * sign,
            _ => 0.0,
        };
        rig.turn(rate);
        rig.aligning = 0.987_4 * SPEED * rate;
        heading += 1e-3 * rate;
        y += 1e-3 * SPEED * heading;
        rig.lane.e_theta = Radians::from_rad(-share * heading);
        rig.lane.e_y = Metres::from_m(0.5 * sign - share * (y + 0.3 * SPEED * heading));
        let step = rig.tick();
        if step.command.mode != Mode::Active {
            assert!(step.command.faults.contains(Fault::LaneImplausible));
            return None;
        }
    }
    Some(rig.lane.e_y.m())
}

#[test]
fn a_new_line_that_moves_as_the_vehicle_does_is_trusted() {
    for sign in [1.0, -1.0] {
        let mut rig = on_a_new_line(sign);
        let e_y = turns_towards(&mut rig, sign, 1.0).expect("nothing is false");
        assert!((rig.applied - PER_M * e_y).abs() < 0.01, "{}", rig.applied);
    }
}

/// A new line runs off at 0.03 rad, 0.5 m/s at the near point from 0.4 s later on, and its picture moves by a share of that. A
/// line of which a quarter of the movement is missing, or comes on top, is trusted as soon as 0.2 m were predicted; beyond that it
/// stays doubted, with half of the torque.
#[test]
fn a_new_line_is_trusted_where_a_quarter_of_its_movement_is_missing() {
    for sign in [1.0, -1.0] {
        for (share, trust) in [(0.65, 0.5), (0.85, 1.0), (1.15, 1.0), (1.35, 0.5)] {
            let mut rig = on_a_new_line(sign);
            let mut e_y = 0.5;
            rig.lane.e_theta = Radians::from_rad(-0.03 * sign);
            for ms in 0..1700 {
                if ms >= 400 {
                    e_y -= 1e-3 * share * 0.03 * SPEED;
                }
                rig.lane.e_y = Metres::from_m(sign * e_y);
                let command = rig.tick().command;
                assert_eq!(command.mode, Mode::Active, "{share} {ms} {:?}", command.faults);
            }
            // The gains of the lateral error, of its rate and of the yaw error.
            let asked = PER_M * e_y - 0.0125 * share * 0.03 * SPEED - 10.0 * 0.03;
            let given = sign * rig.applied / asked;
            assert!((given - trust).abs() < 0.05, "{share}: {given}, not {trust}");
        }
    }
}

/// Both errors mirrored: what is seen and what is predicted come to differ by 2*(0.4 + 0.3) s times 0.47 m/s, 0.65 m.
#[test]
fn a_new_line_that_is_mirrored_is_found() {
    for sign in [1.0, -1.0] {
        assert_eq!(turns_towards(&mut on_a_new_line(sign), sign, -1.0), None);
    }
}

/// In a bend of 0.1 rad/s that the vehicle follows, pictures of a line elsewhere that is mirrored: it does not move aside as its
/// direction says, -(0.7 + 0.4 + 0.3) s times 1.67 m/s2. It is seen for 0.03 s less, and its course is known after 0.4 s: 0.4 m are
/// missing -ln(1 - 0.4/2.33) = 0.19 s later. It is not near enough to be taken.
#[test]
fn a_line_elsewhere_that_is_mirrored_is_found() {
    for sign in [1.0, -1.0] {
        let mut rig = Rig::paper();
        let rate = 0.1 * sign;
        rig.turn(rate);
        rig.aligning = 0.987_4 * SPEED * rate;
        rig.lane.e_theta = Radians::from_rad(0.7 * rate);
        rig.run(600);
        rig.engage = true;
        rig.run(1500);
        rig.lane.e_y = Metres::from_m(1.5);
        rig.lane.e_theta = Radians::from_rad(-0.7 * rate);
        let (ms, step) = rig.run_until(1000, |step| step.command.mode != Mode::Active);
        assert!((600..=660).contains(&ms), "{ms}");
        assert!(step.command.faults.contains(Fault::LaneImplausible));
        assert_eq!(rig.applied, 0.0);
    }
}

/// A line that slides by 2 m/s for 0.3 s, while the vehicle goes straight on, has gone 2*(1 - exp(-0.3)) = 0.518 m beyond the
/// prediction. If it then jumps, that is remembered: half of the margin is left of it ln(0.518/0.2) = 0.95 s after the slide, or a
/// little sooner for the 0.03 m/s that are learnt of it, and no sooner is it taken. From then on a slide by 1 m/s is beyond 0.4 m when 0.2*exp(-t) + 1 - exp(-t) is: after 0.29 s.
#[test]
fn what_a_line_owed_is_remembered_over_a_jump() {
    for sign in [1.0, -1.0] {
        let mut rig = beside(0.0);
        for ms in 1..=300 {
            rig.lane.e_y = Metres::from_m(sign * 2e-3 * f64::from(ms));
            rig.tick();
        }
        rig.lane.e_y = Metres::from_m(-0.4 * sign);
        rig.run(40);
        let (ms, step) = rig.run_until(1500, |step| !step.command.faults.contains(Fault::LaneStep));
        assert!((820..=900).contains(&ms), "{ms}");
        assert_eq!(step.command.mode, Mode::Active);
        let (ms, step) = (1..1000)
            .map(|ms| {
                rig.lane.e_y = Metres::from_m(sign * (1e-3 * f64::from(ms) - 0.4));
                (ms, rig.tick())
            })
            .find(|(_, step)| step.command.mode != Mode::Active)
            .expect("it is found");
        assert!((270..=320).contains(&ms), "{ms}");
        assert!(step.command.faults.contains(Fault::LaneImplausible));
    }
}

/// Another line is taken when it has been watched for the 0.4 s from near point to far point, and there is no trust left. Where
/// pictures of the line that is followed come between, the watch begins anew: the little trust that is left is gone within 0.15 s,
/// and the other line is taken no sooner than one that is seen for the first time. The pictures of three frames are refused
/// before.
#[test]
fn another_line_is_watched_anew_where_pictures_agreed_between() {
    for sign in [1.0, -1.0] {
        let mut rig = beside(0.0);
        let elsewhere = Metres::from_m(0.5 * sign);
        rig.lane.e_y = elsewhere;
        rig.run(450);
        rig.lane.e_y = Metres::ZERO;
        let (_, step) = rig.run_until(100, |step| step.command.faults == FaultSet::NONE);
        assert_eq!(step.command.mode, Mode::Active);
        rig.run(50);
        rig.lane.e_y = elsewhere;
        rig.run_until(150, |step| step.command.faults.contains(Fault::LaneStep));
        let (ms, step) = rig.run_until(600, |step| !step.command.faults.contains(Fault::LaneStep));
        assert!((400..=440).contains(&ms), "{ms}");
        assert_eq!(step.command.mode, Mode::Active);
        rig.run(1500);
        assert!((rig.applied - 0.5 * PER_M * 0.5 * sign).abs() < 0.01);
    }
}

/// Blind for 0.8 s, then on a line elsewhere that is taken: the next 0.8 s without a picture are no more than these.
#[test]
fn a_new_line_begins_with_no_blindness() {
    let mut rig = beside(0.0);
    rig.silent[LANE] = true;
    rig.run(800);
    rig.silent[LANE] = false;
    rig.lane.e_y = Metres::from_m(0.5);
    rig.run(800);
    rig.silent[LANE] = true;
    assert_eq!(rig.run(900).command.mode, Mode::Active);
}

/// The vehicle turns by 0.14 rad/s for 0.7 s without a picture: the near point is then 0.098*5 + 0.5*0.14*0.49*16.7 = 1.06 m
/// aside, which no line moves within a second. Where the lane went on to it is expected.
#[test]
fn the_way_that_a_lane_went_on_is_no_movement_of_the_picture() {
    for sign in [1.0, -1.0] {
        let mut rig = beside(0.0);
        rig.silent[LANE] = true;
        rig.run(20);
        let rate = -0.14 * sign;
        rig.turn(rate);
        rig.aligning = 0.987_4 * SPEED * rate;
        rig.run(700);
        rig.turn(0.0);
        rig.aligning = 0.0;
        rig.silent[LANE] = false;
        let mut e_y = 0.098 * 0.3 * SPEED + 0.5 * 0.14 * 0.49 * SPEED;
        rig.lane.e_theta = Radians::from_rad(0.098 * sign);
        for _ in 0..300 {
            rig.lane.e_y = Metres::from_m(sign * e_y);
            e_y += 0.098e-3 * SPEED;
            let step = rig.tick();
            assert_eq!(step.command.mode, Mode::Active, "{:?}", step.command.faults);
        }
        assert_eq!(rig.tick().command.faults, FaultSet::NONE);
    }
}

/// A lane change by hand of which nobody was told: the camera takes the new line half way, 1.9 m from the vehicle, which
/// comes to it at 1 m/s. Guidance is there again where the line is near, and not before.
#[test]
fn a_lane_change_by_hand_is_no_fault() {
    let mut rig = beside(0.0);
    rig.lane.e_theta = Radians::from_rad(0.0);
    let mut e_y = 0.0;
    let (mut taken_at, mut was_apart) = (None, false);
    for ms in 0..6000_i32 {
        // 1 m/s to the left, of which the yaw rate tells: half a second of turning to it, and from it.
        rig.turn(match ms {
            0..500 => 2.0 / SPEED,
            3500..4000 => -2.0 / SPEED,
            _ => 0.0,
        });
        let turned_ms = ms.min(500) - (ms - 3500).clamp(0, 500);
        let v = f64::from(turned_ms) * 2e-3;
        let heading = v / SPEED;
        e_y -= v * 1e-3;
        let line = if e_y < -1.6 { 3.5 } else { 0.0 };
        rig.lane.e_theta = Radians::from_rad(-heading);
        rig.lane.e_y = Metres::from_m(e_y + line - 0.3 * SPEED * heading);
        // A sensor that is alive moves.
        rig.driver = (ms % 500 < 2).then_some(1.0 / 4096.0);
        let step = rig.tick();
        assert_eq!(
            step.command.mode,
            Mode::Active,
            "{ms} ms, {:?}",
            step.command.faults
        );
        let is_apart = step.command.faults.contains(Fault::LaneStep);
        if was_apart && !is_apart {
            taken_at = Some(rig.lane.e_y.m());
        }
        was_apart = is_apart;
    }
    let at = taken_at.unwrap();
    assert!((0.7..=0.8).contains(&at), "{at} m");
}

/// Another line that comes no nearer is a fault after four seconds; a camera that then goes blind, after one.
#[test]
fn a_line_that_stays_elsewhere_is_a_fault() {
    let mut rig = beside(0.0);
    rig.lane.e_y = Metres::from_m(1.5);
    let (ms, step) = rig.run_until(4100, |step| step.command.mode == Mode::Handover);
    assert!(ms > 4000 && step.command.faults.contains(Fault::LaneStep));
    assert_eq!(rig.applied, 0.0);
    let mut rig = beside(0.0);
    rig.lane.e_y = Metres::from_m(1.5);
    rig.run(1000);
    rig.silent[LANE] = true;
    let (ms, _) = rig.run_until(1100, |step| step.command.mode == Mode::Handover);
    assert!((1000..=1040).contains(&ms), "{ms}");
}

/// Where a line went on to is believed for a second. Pictures that come back later and agree, but are not near, are of a line
/// elsewhere.
#[test]
fn a_line_that_went_on_for_long_proves_nothing() {
    for (apart_ms, is_known) in [(500, true), (900, true), (1100, false), (3000, false)] {
        let mut rig = beside(1.0);
        rig.lane.e_y = Metres::from_m(3.0);
        rig.run(apart_ms);
        rig.lane.e_y = Metres::from_m(1.0);
        let step = rig.run(80);
        assert_eq!(
            step.command.faults.contains(Fault::LaneStep),
            !is_known,
            "{apart_ms} ms"
        );
        assert_eq!(step.command.mode, Mode::Active);
    }
}

/// A camera that is blind and sees another line by turns is lost after four seconds all the same.
#[test]
fn a_blink_does_not_lengthen_the_wait_for_another_line() {
    let mut rig = beside(0.0);
    rig.lane.e_y = Metres::from_m(1.5);
    rig.run(3500);
    rig.silent[LANE] = true;
    let (ms, _) = rig.run_until(600, |step| step.command.mode == Mode::Handover);
    assert!((480..=540).contains(&ms), "{ms}");
}

/// Only guidance goes on: Standby needs pictures, and a handover does not go back.
#[test]
fn only_active_goes_on_and_nothing_comes_back_after_a_handover() {
    let mut rig = beside(0.2);
    rig.silent[LANE] = true;
    rig.run(1500);
    rig.silent[LANE] = false;
    for _ in 0..4000 {
        assert_ne!(rig.tick().command.mode, Mode::Active);
    }
    let mut rig = Rig::paper();
    rig.run(600);
    rig.silent[LANE] = true;
    rig.run(40);
    rig.engage = true;
    assert_eq!(rig.run(1000).command.mode, Mode::Standby);
}

/// What else ends guidance ends it while the lane goes on too. The handover, on a line of 2 s, has run since the picture was
/// lost: of 0.5 s without one it has 1.5 s left. Without a column it goes twice as fast.
#[test]
fn another_loss_hands_over_what_is_left_of_two_seconds() {
    for (sender, pace) in [(1, 2), (VEHICLE, 1), (3, 1)] {
        for blind_ms in [100, 500, 900] {
            let mut rig = beside(0.2);
            rig.silent[LANE] = true;
            rig.run(blind_ms);
            rig.silent[sender] = true;
            let (until, step) = rig.run_until(41, |step| step.command.mode == Mode::Handover);
            assert!(step.command.warning);
            // The last picture was used for 30 ms.
            let left_ms = (2000 - (blind_ms + until - 30)) / pace;
            let (ms, _) = rig.run_until(2001, |step| step.command.torque == Torque::ZERO);
            assert!(
                ms.abs_diff(left_ms) < 15,
                "{sender}, {blind_ms}: {ms}, not {left_ms} ms"
            );
        }
    }
}

/// A camera that is later after a blink than before, or jitters: its pictures are used as soon as they are of after where the
/// lane went on to, and the monitor, whose band is that of a picture 1.5 m aside, waits as long.
#[test]
fn a_camera_that_is_later_after_a_blink_is_waited_for() {
    for (before_ms, after_ms) in [(0, 8), (10, 60), (0, 140), (100, 20)] {
        for (e_y, faults) in [
            (0.2, FaultSet::NONE),
            (-3.0, FaultSet::NONE.with(Fault::LaneStep)),
        ] {
            let mut rig = beside(0.2);
            rig.lane.age = Micros::from_ms(before_ms);
            rig.run(300);
            rig.silent[LANE] = true;
            rig.run(300);
            rig.silent[LANE] = false;
            (rig.lane.age, rig.lane.e_y) = (Micros::from_ms(after_ms), Metres::from_m(e_y));
            for _ in 0..250 {
                let step = rig.tick();
                assert!(step.permitted && step.command.mode == Mode::Active);
            }
            assert_eq!(rig.tick().command.faults, faults, "{before_ms} to {after_ms} ms");
        }
    }
}

/// The oldest picture that guidance may still act on, of the slowest camera, as late as one may be: blind for almost a second, and
/// then of another line. The monitor has to wait until that is let go of.
#[test]
fn a_slow_camera_that_comes_back_elsewhere_meets_no_veto() {
    for blind_ms in (0..1000).step_by(40) {
        let (mut rig, mut counter) = (Rig::paper(), 0);
        rig.yaw_rate = Some(0.0);
        rig.lane.e_y = Metres::from_m(3.5);
        run_with_camera(&mut rig, &mut counter, 1000, 66_667, 150_000);
        rig.engage = true;
        run_with_camera(&mut rig, &mut counter, 1500, 66_667, 150_000);
        assert!(rig.applied > 1.7, "{}", rig.applied);
        rig.run(blind_ms);
        rig.lane.e_y = Metres::from_m(-3.5);
        run_with_camera(&mut rig, &mut counter, 1000, 66_667, 150_000);
        let step = rig.tick();
        assert!(step.permitted, "{blind_ms} ms");
        assert!(
            rig.applied.abs() < 0.01 || step.command.mode == Mode::Handover,
            "{blind_ms} ms"
        );
    }
}

/// A probe ends with the line that it rides on: what is left of it when no picture is in use must not meet the monitor.
#[test]
fn a_probe_ends_where_trust_does() {
    let mut rig = beside(0.2);
    rig.probe = true;
    rig.run(1000);
    rig.lane.e_y = Metres::from_m(1.5);
    rig.run(1100);
    for _ in 0..2000 {
        let step = rig.tick();
        assert!(step.permitted && step.command.mode == Mode::Active);
        assert_eq!(rig.applied, 0.0);
    }
}

/// Pictures that come back with the line 0.1 m beside where it went on to: K_1*a1' of it, as if it had always been there. As a
/// rate within one picture it would ask for as much again.
#[test]
fn where_pictures_come_back_is_no_rate() {
    for sign in [1.0, -1.0] {
        let mut rig = beside(0.0);
        rig.silent[LANE] = true;
        rig.run(100);
        rig.silent[LANE] = false;
        rig.lane.e_y = Metres::from_m(0.1 * sign);
        let most = (0..100).map(|_| {
            rig.tick();
            rig.applied * sign
        });
        let most = most.fold(0.0, f64::max);
        assert!((0.045..0.0505).contains(&most), "{most}");
    }
}

/// After a blink the rates of (9) follow the pictures at once, not only when the blink is forgiven: K_1*(a3'*e_theta' +
/// a4'*v) of a line that turns at v = 0.1 rad/s, and no more of v once it stays.
#[test]
fn how_fast_the_line_turns_counts_soon_after_a_blink() {
    const PER_RAD: f64 = 10.0;
    const PER_RAD_PER_S: f64 = 0.25;
    for sign in [1.0, -1.0] {
        let mut rig = beside(0.0);
        rig.silent[LANE] = true;
        rig.run(900);
        rig.silent[LANE] = false;
        // Trust is back after 0.45 s, the blink is forgiven after 1.8 s.
        rig.run(600);
        for ms in 0..1000 {
            let turned = 1e-4 * f64::from(ms.min(500)) * sign;
            let rate = if ms < 500 { 0.1 * sign } else { 0.0 };
            rig.lane.e_theta = Radians::from_rad(turned);
            assert_eq!(rig.tick().command.mode, Mode::Active);
            let expected = PER_RAD * turned + PER_RAD_PER_S * rate;
            // The low-pass of the rates needs 0.1 s.
            if (200..500).contains(&ms) || ms > 700 {
                let error = rig.applied - expected;
                assert!(error.abs() < 0.01, "{ms} ms: {}, not {expected}", rig.applied);
            }
        }
    }
}

/// A vehicle that begins to turn in front of a camera that is 0.1 s late: what the turn has added to the torque since the last
/// picture stays when no more come. From there guidance moves by 0.954 N.m/s at most, and trust takes 0.5 a second.
#[test]
fn what_a_late_camera_did_not_see_stays_without_pictures() {
    for sign in [1.0, -1.0] {
        let mut rig = beside(0.0);
        rig.lane.age = Micros::from_ms(100);
        rig.run(500);
        rig.yaw_rate = Some(0.1 * sign);
        rig.run(80);
        rig.silent[LANE] = true;
        let (_, lost) = rig.run_until(100, |step| step.command.faults.contains(Fault::LaneTimeout));
        assert_eq!(lost.command.mode, Mode::Active);
        let at_loss = rig.applied;
        assert!(at_loss * sign < -0.1, "{at_loss}");
        for ms in 1..100 {
            assert_eq!(rig.tick().command.mode, Mode::Active);
            let moved = (rig.applied - at_loss).abs();
            assert!(
                moved < (0.954 + 0.5 * at_loss.abs()) * 1e-3 * f64::from(ms) + 0.01,
                "{ms} ms: {moved}"
            );
        }
    }
}

/// A bend of 2.5 m/s^2 that the vehicle follows, without a picture for almost a second: the near point has come to where the line
/// was not seen. Of a line that went straight from there it would be 0.4 m aside.
#[test]
fn a_bend_goes_on_beyond_what_was_seen_of_it() {
    for sign in [1.0, -1.0] {
        let mut rig = Rig::paper();
        let rate = 0.15 * sign;
        rig.turn(rate);
        rig.aligning = 0.987_4 * SPEED * rate;
        rig.lane.e_theta = Radians::from_rad(0.7 * rate);
        rig.run(600);
        rig.engage = true;
        rig.run(1500);
        rig.silent[LANE] = true;
        rig.run(970);
        rig.silent[LANE] = false;
        for _ in 0..100 {
            let step = rig.tick();
            assert_eq!(step.command.mode, Mode::Active);
            assert!(!step.command.faults.contains(Fault::LaneStep));
        }
        assert_eq!(rig.tick().command.faults, FaultSet::NONE);
    }
}
