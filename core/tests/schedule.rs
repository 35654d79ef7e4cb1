//! The schedule of the torque with speed, against lines in f64.

use haptic_core::controller::config::Config;
use haptic_core::controller::params::Params;
use haptic_core::quantity::{Ratio, Speed};

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
