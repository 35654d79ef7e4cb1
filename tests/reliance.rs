//! The driver's reliance, read live by the ECU from its probe, against the truth of the driver model. (Whether the
//! envelope clips the probe is `unclipped`'s question.)

use haptic_batch::reliance::{Plan, study};
use haptic_sim::models::driver::ArmGains;
use haptic_sim::scenario::{GuidanceParameters, Scenario};
use haptic_sim::simulation;

/// 14 drivers x 2 seeds, four sessions each, against the required bounds. (`host-sim reliance` has 20 seeds.)
#[test]
fn all_participants_are_read_live() {
    let plan = Plan {
        participants: (1..=14).collect(),
        seeds: 2,
        amplitude_nm: 0.2,
        frequency_hz: 2.5,
    };
    let found = study(&plan, || {}).unwrap();
    assert_eq!(found.diverged, 0);
    for (after_s, largest_rms) in [(10.0, 0.085), (30.0, 0.05)] {
        let pooled = found.pooled.iter().find(|a| a.after_s == after_s).unwrap();
        assert_eq!(pooled.count, 14 * 2 * 4);
        assert!(
            pooled.bias.abs() <= 0.02 && pooled.rms <= largest_rms,
            "{pooled:?}"
        );
        assert!((0.90..=0.99).contains(&pooled.coverage), "{pooled:?}");
    }
    // After the driver has become another.
    assert!(
        found.settling.count == 28 && found.settling.near >= 0.95,
        "{:?}",
        found.settling
    );
}

/// Off unless it is asked for: the default scenario's torque is that of the law alone, whatever the amplitude.
#[test]
fn the_probe_is_off_by_default() {
    let torque = |amplitude_nm: f64| {
        let mut guidance = GuidanceParameters::default();
        guidance.controller.probe_amplitude_nm = amplitude_nm;
        let scenario = Scenario::builder()
            .gains(ArmGains { k_d: 3.0, k_hg: 0.5 })
            .guidance(guidance);
        let mut torque = Vec::new();
        simulation::observe(&scenario.build().unwrap(), |outcome| {
            torque.push(outcome.applied_torque_nm)
        });
        torque
    };
    assert_eq!(torque(0.0), torque(0.2));
}
