//! An ECU whose law is another's: all that comes after the law is the product's, but for the band about law (9).

use crate::rig::Rig;
use haptic_core::controller::config::Setup;
use haptic_core::ecu::Boot;
use haptic_core::quantity::{Metres, Torque};
use haptic_core::safety::modes::Mode;

/// Guiding beside a line, 0.4 m away.
fn guiding(setup: &Setup) -> Rig {
    let mut rig = Rig::new(Some(setup), Boot::default());
    rig.yaw_rate = Some(0.0);
    rig.lane.e_y = Metres::from_m(0.4);
    rig.run(600);
    rig.engage = true;
    assert_eq!(rig.run(600).command.mode, Mode::Active);
    rig
}

fn with_another_law() -> Setup {
    Setup {
        monitor: Setup::PAPER.monitor.with_another_law(),
        ..Setup::PAPER
    }
}

/// A law that asks for 1 N.m where (9) asks for 0.2: the envelope brings it there, to either side; across zero a step may fall by 8
/// mN.m and grow by 4.
#[test]
fn another_law_is_followed_within_the_limits_and_without_the_band() {
    for asked in [1.0, -1.0] {
        let mut rig = guiding(&with_another_law());
        rig.ecu.force_law(Some(Torque::from_nm(asked)));
        let mut last = rig.applied;
        for ms in 0..400 {
            assert!(rig.tick().permitted, "{ms} ms");
            assert!(
                (rig.applied - last).abs() <= 0.0121,
                "{ms} ms: {last} to {}",
                rig.applied
            );
            last = rig.applied;
        }
        assert!((last - asked).abs() < 0.001, "{last}");
        let mut product = guiding(&Setup::PAPER);
        product.ecu.force_law(Some(Torque::from_nm(asked)));
        product.run_until(300, |step| !step.permitted);
    }
}

/// The step that takes the torque itself is the step of a law that asks for it.
#[test]
fn the_torque_that_is_handed_in_takes_the_place_of_the_laws() {
    let mut rig = guiding(&with_another_law());
    let mut handed = rig.clone();
    for ms in 0..300 {
        let asked = Torque::from_nm(0.3 * (f64::from(ms) * 0.02).sin());
        rig.ecu.force_law(Some(asked));
        let step = rig.tick();
        handed.t_us = rig.t_us;
        for (sender, period) in [8, 2, 10, 10].into_iter().enumerate() {
            if handed.ticks.is_multiple_of(period) {
                let frame = handed.frame(sender);
                assert_eq!(handed.send(&frame), Ok(()));
            }
        }
        handed.ticks += 1;
        let now = handed.now();
        let same = handed.ecu.step_with_law(now, asked);
        handed.applied = same.command.torque.nm();
        assert_eq!(same, step, "{ms} ms");
        assert!(ms < 100 || same.command.torque != Torque::ZERO || asked.nm().abs() < 0.01);
    }
}
