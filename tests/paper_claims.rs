//! The paper's evaluation (section 5, figures 8 and 9) against an independent float64 implementation's table,
//! and the paper's claims as orderings.

use haptic_core::params::Params;
use host_sim::closed_loop::{Run, drive, simulate};
use host_sim::guidance::{FloatLaw, NoGuidance};
use host_sim::models::driver::DriverParameters;
use host_sim::models::road::{Centreline, Course};
use host_sim::scenario::{Condition, Failure, FailureKind, Scenario, Sensors};

/// t_p, condition; peak and mean |e| over s in [1080, 1740] m nominally, and with the failure at 70 s.
type Row = (f64, Condition, [f64; 2], Option<[f64; 2]>);

/// Made by an independent float64 implementation: exact errors, backward differences at 1 kHz, plant at 0.2 ms.
const TABLE: [Row; 12] = {
    use Condition::{High, Low, Manual, Mid};
    [
        (0.1, Manual, [0.1255, 0.0479], None),
        (0.1, High, [0.1255, 0.0438], Some([0.4408, 0.1002])),
        (0.1, Mid, [0.1283, 0.0444], Some([0.2730, 0.0727])),
        (0.1, Low, [0.1316, 0.0498], Some([0.1255, 0.0516])),
        (0.3, Manual, [0.1378, 0.0551], None),
        (0.3, High, [0.1262, 0.0452], Some([0.4703, 0.1086])),
        (0.3, Mid, [0.1290, 0.0461], Some([0.2831, 0.0798])),
        (0.3, Low, [0.1309, 0.0531], Some([0.1361, 0.0568])),
        (0.5, Manual, [0.2228, 0.0824], None),
        (0.5, High, [0.1430, 0.0486], Some([0.6179, 0.1349])),
        (0.5, Mid, [0.1613, 0.0561], Some([0.3930, 0.1033])),
        (0.5, Low, [0.2005, 0.0792], Some([0.2213, 0.0824])),
    ]
};

fn scenario(t_p: f64, condition: Condition, kind: FailureKind, sensors: Sensors) -> Scenario {
    Scenario {
        condition,
        gains: condition.gains(),
        driver: DriverParameters {
            t_p,
            ..Default::default()
        },
        failure: Failure { kind, time_s: 70.0 },
        sensors,
        ..Default::default()
    }
}

/// Peak and mean |e| over the first curve.
fn figures(run: &Run) -> [f64; 2] {
    assert!(!run.diverged());
    let errors: Vec<f64> = run
        .trace
        .samples
        .iter()
        .filter(|s| (1080.0..=1740.0).contains(&s.s_m))
        .map(|s| s.lateral_error_m.abs())
        .collect();
    [
        errors.iter().copied().fold(0.0, f64::max),
        errors.iter().sum::<f64>() / errors.len() as f64,
    ]
}

/// Every number of the table that `simulate` misses by more than `share` of it or `floor_m`.
fn misses(
    share: f64,
    floor_m: f64,
    simulate: impl Fn(Condition, &Scenario) -> Run,
    sensors: Sensors,
) -> Vec<String> {
    let mut misses = Vec::new();
    for (t_p, condition, nominal, failed) in TABLE {
        let cases = [(FailureKind::None, Some(nominal)), (FailureKind::Torque, failed)];
        for (kind, expected) in cases.iter().filter_map(|(kind, e)| e.map(|e| (*kind, e))) {
            let found = figures(&simulate(condition, &scenario(t_p, condition, kind, sensors)));
            for (name, (found, expected)) in ["peak", "mean"].iter().zip(found.iter().zip(expected)) {
                if (found - expected).abs() > (share * expected).max(floor_m) {
                    misses.push(format!(
                        "t_p {t_p} {condition} {kind} {name}: {found:.4}, not {expected:.4} m"
                    ));
                }
            }
        }
    }
    misses
}

#[test]
fn the_models_with_a_float_controller_give_the_table() {
    let line = Centreline::new(&Course::paper());
    let run = |condition, scenario: &Scenario| match condition {
        Condition::Manual => drive(scenario, &line, &mut NoGuidance, &mut ()),
        _ => drive(scenario, &line, &mut FloatLaw::new(Params::PAPER), &mut ()),
    };
    // The table has four digits; half of the last is 0.05 mm. Its plant was stepped at 0.2 ms by a method with
    // an error of its own, hence 0.3 mm.
    assert_eq!(misses(0.0, 0.0003, run, Sensors::Exact), Vec::<String>::new());
}

#[test]
fn the_shipping_controller_with_exact_sensors_gives_the_table() {
    let line = Centreline::new(&Course::paper());
    let run = |_, scenario: &Scenario| simulate(scenario, &line).unwrap();
    assert_eq!(misses(0.02, 0.002, run, Sensors::Exact), Vec::<String>::new());
}

#[test]
fn the_shipping_controller_over_the_bus_stays_within_ten_percent() {
    let line = Centreline::new(&Course::paper());
    let run = |_, scenario: &Scenario| simulate(scenario, &line).unwrap();
    assert_eq!(misses(0.10, 0.0, run, Sensors::Paper), Vec::<String>::new());
}
