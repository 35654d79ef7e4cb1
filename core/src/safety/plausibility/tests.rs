//! The checks against a reference in float64 or by hand.

use super::*;
use crate::lane::LaneSample;
use crate::quantity::{Instant, Micros, Radians, Speed, Torque, TurningRate};
use crate::safety::motion_history::MotionHistory;

/// Table 9's vehicle by hand, as docs/parameters.md has it.
const CURVATURE_GAIN_PER_M: f64 = 1.0 / (17.0 * 2.635);
const STABILITY_FACTOR_S2_PER_M2: f64 = 0.001_752_9;
const CHECKS: Plausibility = Plausibility {
    curvature_gain: CurvaturePerAngle::from_per_m(CURVATURE_GAIN_PER_M),
    stability_factor: StabilityFactor::from_s2_per_m2(STABILITY_FACTOR_S2_PER_M2),
    aligning_gain: TorquePerAcceleration::from_nm_s2_per_m(0.987_4),
    column_damping: TorquePerTurningRate::from_nm_s_per_rad(0.57),
    far_time: Seconds::from_s(0.7),
    near_time: Seconds::from_s(0.3),
    between: Micros::from_us(400_000),
};

#[test]
fn a_wheel_angle_turns_the_vehicle_before_it_is_checked() {
    for speed in [8.0, 20.0, 35.0] {
        let mut state = PlausibilityState::NEW;
        CHECKS.motion(&mut state, Speed::from_m_per_s(speed), None);
        state.set_wheel_angle(Radians::from_rad(-0.2));
        // The bicycle model in steady state.
        let steady = CURVATURE_GAIN_PER_M * speed / (1.0 + STABILITY_FACTOR_S2_PER_M2 * speed * speed);
        let turning = state.turning().rad_per_s();
        assert!(
            (turning + 0.2 * steady).abs() < 1e-4,
            "{speed}: {turning} {steady}"
        );
    }
}

/// A yaw rate of 0.02 rad/s more than the wheel's, as on a bank: learnt with a lag of 16 s.
#[test]
fn without_a_yaw_rate_the_wheel_turns_by_what_it_was_more() {
    let wheel = 0.05 / (CURVATURE_GAIN_PER_M * 20.0) * (1.0 + STABILITY_FACTOR_S2_PER_M2 * 400.0);
    for (sign, by_wheel) in [(1.0, 0.0), (-1.0, 0.0), (1.0, 0.05), (-1.0, 0.05)] {
        let mut state = PlausibilityState::NEW;
        let (speed, passed) = (Speed::from_m_per_s(20.0), Micros::from_ms(10));
        CHECKS.motion(&mut state, speed, None);
        state.set_wheel_angle(Radians::from_rad(wheel * by_wheel / 0.05));
        let measured = TurningRate::from_rad_per_s(by_wheel + sign * 0.02);
        // The first may be any: nothing came before that it could have stepped from.
        let swerve = TurningRate::from_rad_per_s(sign * 0.4);
        assert_eq!({ state }.accepted_yaw_rate(swerve, passed), Some(swerve));
        for _ in 0..2000 {
            let accepted = state.accepted_yaw_rate(measured, passed);
            assert_eq!(accepted, Some(measured));
            CHECKS.motion(&mut state, speed, accepted);
            assert_eq!(state.turning(), measured);
        }
        let expected = by_wheel + sign * 0.02 * (1.0 - f64::exp(-20.0 / 16.0));
        // In the step in which the lane denies it, and from the next message on.
        state.distrust_yaw_rate();
        for _ in 0..2 {
            let turning = state.turning().rad_per_s();
            assert!((turning - expected).abs() < 1e-3, "{turning}, not {expected}");
            CHECKS.motion(&mut state, speed, None);
        }
    }
}

#[test]
fn a_sample_that_comes_twice_says_nothing_new() {
    let (mut state, mut motion_history) = (PlausibilityState::NEW, MotionHistory::new());
    CHECKS.motion(&mut state, Speed::from_m_per_s(20.0), None);
    let at = |ms: u32, e_y: f64| LaneSample {
        e_y: Metres::from_m(e_y),
        e_theta: Radians::ZERO,
        at: Instant::from_us(1000 * ms),
    };
    for sample in [at(10, 0.0), at(20, 0.01)] {
        let moved = CHECKS.lane(&mut state, &mut motion_history, sample.at, sample);
        assert_eq!(moved, LaneMotion::Consistent);
    }
    let before = state;
    let moved = CHECKS.lane(
        &mut state,
        &mut motion_history,
        Instant::from_us(21_000),
        at(20, 0.01),
    );
    assert_eq!(moved, LaneMotion::Consistent);
    assert_eq!(state, before);
}

#[test]
fn a_torque_that_the_column_lacks_is_learnt_within_sixteen_seconds() {
    let mut state = PlausibilityState::NEW;
    CHECKS.motion(&mut state, Speed::from_m_per_s(20.0), None);
    let lacking = Torque::from_nm(0.4);
    for ms in 0..16_000 {
        let now = Instant::from_us(2000 * ms);
        assert!(CHECKS.column(&mut state, now, Torque::ZERO, Radians::ZERO, lacking));
        // A first-order lag of 16 s.
        let learnt = 0.4 * (1.0 - (-2e-3 * f64::from(ms) / 16.0).exp());
        let found = state.column.bias.nm();
        assert!((found - learnt).abs() < 0.01, "{ms}: {found} {learnt}");
    }
}

/// A line that drifts aside by 0.1 m/s where the yaw rate says nothing of it.
#[test]
fn a_drift_of_the_line_is_learnt_within_sixteen_seconds() {
    let (mut state, mut motion_history) = (PlausibilityState::NEW, MotionHistory::new());
    CHECKS.motion(&mut state, Speed::from_m_per_s(20.0), Some(TurningRate::ZERO));
    for step in 0..1600_u32 {
        let now = Instant::from_us(10_000 * step);
        let seconds = 0.01 * f64::from(step);
        let sample = LaneSample {
            e_y: Metres::from_m(0.1 * seconds - 0.8),
            e_theta: Radians::ZERO,
            at: now,
        };
        let moved = CHECKS.lane(&mut state, &mut motion_history, now, sample);
        assert_eq!(moved, LaneMotion::Consistent);
        // A first-order lag of 16 s, once the line is known for 0.4 s.
        let learnt = 0.1 * (1.0 - (-(seconds - 0.4).max(0.0) / 16.0).exp());
        let found = state.lane.bias.m_per_s();
        assert!((found - learnt).abs() < 0.001, "{seconds}: {found} {learnt}");
    }
}

/// 0.125 kg.m2 at 2 rad/s are 0.25 N.m.s beside the margin of 0.6, in the wheel's direction. A check takes 3 mN.m.s away.
#[test]
fn the_column_check_allows_the_momentum_of_the_wheel_and_no_more() {
    let judged = |sum_nm_s: f64, rad_per_s: f64| {
        let mut state = PlausibilityState::NEW;
        CHECKS.motion(&mut state, Speed::from_m_per_s(20.0), None);
        (state.column.is_known, state.column.at) = (1, Instant::from_us(0));
        state.column.sum = AngularImpulse::from_nm_s(sum_nm_s);
        let wheel = Radians::from_rad(2e-3 * rad_per_s);
        // As soon as it comes, a step before its check.
        state.set_wheel_angle(wheel);
        CHECKS.column(
            &mut state,
            Instant::from_us(2000),
            Torque::ZERO,
            wheel,
            Torque::ZERO,
        )
    };
    for sign in [1.0, -1.0] {
        assert!(judged(sign * 0.59, 0.0));
        assert!(!judged(sign * 0.61, 0.0));
        assert!(judged(sign * 0.84, sign * 2.0));
        assert!(!judged(sign * 0.86, sign * 2.0));
        assert!(!judged(sign * 0.61, sign * -2.0));
    }
}

/// At its margin a movement may be missing, and half of it has to be predicted; a count further it is not honest.
#[test]
fn the_lane_check_keeps_its_margins_to_the_count() {
    for (yaw_rate, margin, unreal) in [(Some(TurningRate::ZERO), 0.4, 0.8), (None, 1.0, 2.0)] {
        let [margin, unreal] = [margin, unreal].map(|m| Metres::from_m(m).bits());
        let judged = |predicted: i32, seen: i32| {
            let (mut state, mut motion_history) = (PlausibilityState::NEW, MotionHistory::new());
            CHECKS.motion(&mut state, Speed::from_m_per_s(20.0), yaw_rate);
            state.lane.predicted = Metres::from_bits(predicted);
            state.lane.seen = Metres::from_bits(seen);
            let sample = LaneSample::default();
            CHECKS.lane(&mut state, &mut motion_history, sample.at, sample) == LaneMotion::Consistent
        };
        for sign in [1, -1] {
            assert!(judged(sign * 3 * margin / 2, sign * margin / 2));
            assert!(!judged(sign * (3 * margin / 2 + 1), sign * margin / 2));
            assert!(judged(sign * (margin / 2), sign * -(margin / 2)));
            assert!(!judged(sign * (margin / 2 + 1), sign * -(margin / 2)));
            assert!(judged(0, sign * unreal));
            assert!(!judged(0, sign * (unreal + 1)));
        }
    }
}

/// In a steady bend of 1 m/s2 the line stays where it is: only the vehicle's turn, 0.3 m/s at the near point with a leak of
/// 1 s, shows that the line is real. It has made 0.2 m after ln(3) = 1.1 s.
#[test]
fn a_new_line_in_a_steady_bend_is_doubted_for_as_long_to_either_side() {
    for sign in [1.0, -1.0] {
        let (mut state, mut motion_history) = (PlausibilityState::NEW, MotionHistory::new());
        let turning = TurningRate::from_rad_per_s(0.05 * sign);
        CHECKS.motion(&mut state, Speed::from_m_per_s(20.0), Some(turning));
        state.adopt_other_line(&mut motion_history);
        for ms in (0..2000).step_by(10) {
            let now = Instant::from_us(1000 * ms);
            motion_history.record_turning_rate(now, turning);
            let sample = LaneSample {
                e_y: Metres::ZERO,
                e_theta: Radians::from_rad(0.7 * 0.05 * sign),
                at: now,
            };
            let moved = CHECKS.lane(&mut state, &mut motion_history, now, sample);
            assert_eq!(moved, LaneMotion::Consistent);
            if !(1050..1150).contains(&ms) {
                assert_eq!(state.is_line_doubted(), ms < 1100, "{sign} {ms}");
            }
        }
    }
}

/// 0.1 rad/s too much on a straight at 20 m/s: what is summed of it explains 14 m/s for each rad that is missing of the lane.
#[test]
fn a_lane_that_moves_as_the_wheel_says_is_not_blamed() {
    for (sum_rad, is_alive, moved) in [
        (0.011, 1, LaneMotion::ContradictsYawRate),
        // The same picture again, less than a quarter, and the wrong way.
        (0.011, 0, LaneMotion::Inconsistent),
        (0.009, 1, LaneMotion::Inconsistent),
        (-0.04, 1, LaneMotion::Inconsistent),
    ] {
        for sign in [1.0, -1.0] {
            let (mut state, mut motion_history) = (PlausibilityState::NEW, MotionHistory::new());
            CHECKS.motion(
                &mut state,
                Speed::from_m_per_s(20.0),
                Some(TurningRate::from_rad_per_s(sign * 0.1)),
            );
            state.motion.yaw.sum = Radians::from_rad(sign * sum_rad);
            state.lane.predicted = Metres::from_m(sign * -0.56);
            state.lane.is_alive = is_alive;
            let sample = LaneSample::default();
            assert_eq!(
                CHECKS.lane(&mut state, &mut motion_history, sample.at, sample),
                moved,
                "{sum_rad}, {is_alive}"
            );
            // What a wrong yaw rate predicted is not held against the lane.
            let used = Plausibility::used_margins(&state).0;
            assert_eq!(used == Metres::ZERO, moved == LaneMotion::ContradictsYawRate);
        }
    }
}

/// A quarter of the yaw rate's margin is 7.5 mrad: beyond it, and where the pictures move, the column may go by the wheel alone.
#[test]
fn a_column_that_turns_as_the_wheel_says_is_not_blamed_for_a_doubtful_yaw_rate() {
    // A wheel that stands straight for half a second, and a yaw rate of 0.15 rad/s: 2.96 N.m of aligning torque at 20 m/s.
    let lacking = |sum_rad: f64, is_alive: u32, yaw_rate: f64| {
        let mut state = PlausibilityState::NEW;
        CHECKS.motion(
            &mut state,
            Speed::from_m_per_s(20.0),
            Some(TurningRate::from_rad_per_s(yaw_rate)),
        );
        (state.motion.yaw.sum, state.lane.is_alive) = (Radians::from_rad(sum_rad), is_alive);
        for ms in 0..500 {
            let now = Instant::from_us(1000 * ms);
            let _ = CHECKS.column(&mut state, now, Torque::ZERO, Radians::ZERO, Torque::ZERO);
        }
        state.column.sum.nm_s().abs()
    };
    for sign in [1.0, -1.0] {
        let rate = 0.15 * sign;
        assert!(lacking(sign * 0.0074, 1, rate) > 0.4 && lacking(sign * 0.0076, 0, rate) > 0.4);
        assert!(lacking(sign * 0.0076, 1, rate) < 1e-6);
    }
}

/// A hand of 20 N.m and more on a column that stands still, less friction of 0.5 N.m: 0.6 N.m.s is beyond after 31 ms, to
/// either side. What is more than 20 N.m counts as 20.
#[test]
fn a_driver_torque_of_more_than_any_hand_has_is_found_on_either_side() {
    for nm in [20.0, 25.0, 30.0, -20.0, -25.0, -30.0] {
        let mut state = PlausibilityState::NEW;
        CHECKS.motion(&mut state, Speed::from_m_per_s(20.0), None);
        let found = (0..100).find(|ms| {
            let (now, driver) = (Instant::from_us(1000 * ms), Torque::from_nm(nm));
            !CHECKS.column(&mut state, now, driver, Radians::ZERO, Torque::ZERO)
        });
        assert!(found.is_some_and(|ms| (30..=34).contains(&ms)), "{nm}: {found:?}");
    }
}
