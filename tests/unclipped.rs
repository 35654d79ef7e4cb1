//! The envelope is for faults: no limit touches the torque in ordinary driving, with or without the probe.

use haptic_batch::evaluate::DRIVERS_T_P;
use haptic_batch::experiment::REMNANT_GUIDED_NM;
use haptic_sim::models::driver::DriverParameters;
use haptic_sim::participants::participants;
use haptic_sim::scenario::{Condition, Scenario};
use haptic_sim::simulation::observe;

/// The paper's nominal runs, and the participants of table 6 with the remnant that brings their fit into the paper's
/// range.
fn everyone() -> Vec<(String, Scenario)> {
    let nominal = DRIVERS_T_P.iter().flat_map(|t_p| {
        [Condition::High, Condition::Mid, Condition::Low].map(|condition| {
            let driver = DriverParameters {
                t_p: *t_p,
                ..Default::default()
            };
            let scenario = Scenario::builder().condition(condition).driver(driver);
            (format!("t_p {t_p} s, {condition}"), scenario.build().unwrap())
        })
    });
    let identified = participants().into_iter().map(|participant| {
        let driver = participant.guided;
        let scenario = Scenario::builder()
            .gains(driver.gains())
            .driver(DriverParameters {
                remnant_sd_nm: REMNANT_GUIDED_NM,
                ..driver.parameters()
            });
        let name = format!("participant {}", participant.number);
        (name, scenario.build().unwrap())
    });
    nominal.chain(identified).collect()
}

/// Steps in which a limit acted. The probe is in the torque, so it is in what would be limited.
fn limited(scenario: &Scenario) -> usize {
    let (mut steps, mut limited) = (0, 0);
    let run = observe(scenario, |outcome| {
        steps += 1;
        limited += usize::from(outcome.decided.limited);
    });
    assert!(!run.diverged());
    assert!(steps > 190_000, "a whole run, not {steps} steps");
    limited
}

#[test]
fn no_limit_acts_in_nominal_runs() {
    for (who, scenario) in everyone() {
        assert_eq!(limited(&scenario), 0, "{who}");
    }
}

/// The default probe is never clipped on the nominal guidance; the strongest that the parameters allow, 3.5 N.m/s, in less
/// than 1 % of the steps, and the estimators take the torque that was applied. Participants with a remnant make the
/// guidance itself steeper; there a step in ten thousand may be clipped.
#[test]
fn the_probe_is_hardly_clipped() {
    for (amplitude_nm, frequency_hz, nominal, guided) in [(0.2, 2.5, 0, 20), (0.3, 1.85, 2000, 2000)] {
        let mut most = 0;
        for (who, scenario) in everyone() {
            let mut guidance = *scenario.guidance();
            guidance.probe = true;
            guidance.controller.probe_amplitude_nm = amplitude_nm;
            guidance.controller.probe_frequency_hz = frequency_hz;
            let scenario = scenario.to_builder().guidance(guidance).build().unwrap();
            let allowed = match scenario.condition() {
                Condition::Custom => guided,
                _ => nominal,
            };
            let limited = limited(&scenario);
            most = most.max(limited);
            assert!(
                limited <= allowed,
                "{who}, {amplitude_nm} N.m at {frequency_hz} Hz: {limited}"
            );
        }
        println!("{amplitude_nm} N.m at {frequency_hz} Hz: at most {most} steps of a run are clipped");
    }
}
