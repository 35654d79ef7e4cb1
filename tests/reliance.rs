//! The driver's reliance, read live by the ECU from its probe, against the truth of the driver model; and the probe
//! itself, which must pass the torque envelope unclipped on top of nominal guidance.

use host_sim::closed_loop::{self, Cycle};
use host_sim::models::driver::{ArmGains, DriverParameters};
use host_sim::models::road::Centreline;
use host_sim::scenario::{Condition, Scenario, Sensors};
use host_sim::studies::reliance::{Plan, study};

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

/// The paper's three drivers at each reliance: no limit acts in any cycle, neither on the default probe over the bus
/// nor, with exact lane errors, on the steepest that the parameters allow (3.5 N.m/s).
#[test]
fn with_nominal_guidance_the_envelope_never_clips_the_probe() {
    for (sensors, amplitude_nm, frequency_hz) in [
        (Sensors::Paper, 0.2, 2.5),
        (Sensors::Exact, 0.2, 2.75),
        (Sensors::Exact, 0.3, 1.85),
    ] {
        for t_p in [0.1, 0.3, 0.5] {
            for condition in [Condition::High, Condition::Mid, Condition::Low] {
                let mut scenario = Scenario {
                    driver: DriverParameters {
                        t_p,
                        ..DriverParameters::default()
                    },
                    gains: condition.gains(),
                    condition,
                    sensors,
                    ..Scenario::default()
                };
                scenario.guidance.probe = true;
                scenario.guidance.controller.probe_amplitude_nm = amplitude_nm;
                scenario.guidance.controller.probe_frequency_hz = frequency_hz;
                let road = Centreline::new(&scenario.course);
                let mut limited = 0;
                let mut largest: f64 = 0.0;
                let watch = &mut |cycle: &Cycle| {
                    limited += u32::from(cycle.given.limited);
                    largest = largest.max(cycle.applied_torque_nm.abs());
                };
                closed_loop::observe(&scenario, &road, watch).unwrap();
                assert_eq!(
                    limited, 0,
                    "t_p {t_p}, {condition}, {amplitude_nm} N.m at {frequency_hz} Hz"
                );
                // Nominal guidance alone peaks at 0.47 N.m.
                assert!(largest > 0.5, "there was a probe: {largest}");
            }
        }
    }
}

/// Off unless it is asked for: the default scenario's torque is that of the law alone, whatever the amplitude.
#[test]
fn the_probe_is_off_by_default() {
    let torque = |amplitude_nm: f64| {
        let mut scenario = Scenario {
            gains: ArmGains { k_d: 3.0, k_hg: 0.5 },
            ..Scenario::default()
        };
        scenario.guidance.controller.probe_amplitude_nm = amplitude_nm;
        let road = Centreline::new(&scenario.course);
        let mut torque = Vec::new();
        closed_loop::observe(&scenario, &road, &mut |cycle: &Cycle| {
            torque.push(cycle.applied_torque_nm)
        })
        .unwrap();
        torque
    };
    assert_eq!(torque(0.0), torque(0.2));
}
