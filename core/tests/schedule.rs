//! The schedule of the torque with speed, against lines in f64.

use crate::rig::Rig;
use haptic_core::controller::config::{Config, Setup};
use haptic_core::controller::params::Params;
use haptic_core::ecu::Boot;
use haptic_core::quantity::{Metres, Ratio, Speed};
use haptic_core::safety::modes::Mode;

#[test]
fn the_share_is_two_lines_through_60_km_h() {
    for (low, high) in [(1.0, 1.0), (0.5, 0.25), (0.0, 1.0), (1.0, 0.0)] {
        let params = Params {
            low_speed_share: low,
            high_speed_share: high,
            ..Params::PAPER
        };
        let schedule = Config::new(&params).unwrap().schedule;
        for kmh in 0..=300 {
            let v = f64::from(kmh) / 3.6;
            let line = if kmh < 60 {
                low + (1.0 - low) * f64::from(kmh.max(20) - 20) / 40.0
            } else {
                1.0 + (high - 1.0) * f64::from(kmh.min(130) - 60) / 70.0
            };
            let share = schedule.share(Speed::from_m_per_s(v));
            assert!(
                (share.si() - line).abs() < 1e-5,
                "{kmh} km/h: {} for {line}",
                share.si()
            );
            // What is not asked for changes no bit.
            assert!(low < 1.0 || high < 1.0 || share == Ratio::ONE);
        }
    }
}

/// 0.4 m beside a straight line, at 60, 20 and 130 km/h and back: K_1*a1' of it, times the share of the speed.
#[test]
fn the_share_goes_with_the_speed_of_now() {
    let params = Params {
        low_speed_share: 0.5,
        high_speed_share: 0.25,
        ..Params::PAPER
    };
    let mut rig = Rig::new(Some(&Setup::new(&params).unwrap()), Boot::default());
    rig.yaw_rate = Some(0.0);
    rig.lane.e_y = Metres::from_m(0.4);
    rig.run(600);
    rig.engage = true;
    rig.run(500);
    for (kmh, share) in [
        (60.0, 1.0),
        (20.0, 0.5),
        (60.0, 1.0),
        (130.0, 0.25),
        (95.0, 0.625),
    ] {
        let speed = kmh / 3.6;
        while rig.speeds[0] != speed {
            let step = (speed - rig.speeds[0]).clamp(-0.5, 0.5);
            rig.speeds = [rig.speeds[0] + step; 2];
            rig.run(10);
        }
        let step = rig.run(200);
        assert_eq!(step.command.mode, Mode::Active);
        assert!(
            (rig.applied - 0.2 * share).abs() < 0.001,
            "{kmh} km/h: {}",
            rig.applied
        );
    }
}
