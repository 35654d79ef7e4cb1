//! What fails in a column with a bar, from its instant on.

use haptic_sim::models::torsion_bar::{Assist, BarPlant, ColumnFault, ColumnKind, ColumnParameters, Curve};
use haptic_sim::parts::Vehicle;
use haptic_sim::{Scenario, simulate};

use crate::physics::acting;

/// A free car of which something fails after 2 s, and one of which nothing does; 2 N.m at the wheel from the beginning, and so long.
fn both(fault: ColumnFault, steps: u32) -> [BarPlant; 2] {
    [fault, ColumnFault::None].map(|fault| {
        let column = ColumnParameters {
            kind: ColumnKind::TorsionBar,
            fault,
            fault_time_s: 2.0,
            sensor_noise_nm: 0.0,
            ..ColumnParameters::default()
        };
        let scenario = Scenario::builder().column(column).build().unwrap();
        let mut plant = BarPlant::new(&scenario).with_assist(Assist::Points(Curve::usual(1.0)));
        for _ in 0..steps {
            plant.step(&acting(2.0, 0.0));
        }
        plant
    })
}

/// The sensor's step is 5 mN.m. Nothing is otherwise before the instant.
#[test]
fn a_sensor_fails_at_its_instant_by_what_is_said() {
    for fault in [
        ColumnFault::SensorOffset,
        ColumnFault::SensorDrift,
        ColumnFault::SensorStuck,
        ColumnFault::SensorDoubled,
        ColumnFault::BrokenBar,
        ColumnFault::AssistLost,
        ColumnFault::AssistRunaway,
    ] {
        let [before, whole] = both(fault, 2000);
        assert_eq!(before.state(), whole.state(), "{fault:?}");
        let [mut failed, whole] = both(fault, 2001);
        let by_nm = failed.sensor_torque_nm() - whole.sensor_torque_nm();
        let expected = match fault {
            ColumnFault::SensorOffset => 1.0,
            ColumnFault::SensorDoubled => whole.sensor_torque_nm(),
            _ => 0.0,
        };
        assert!((by_nm - expected).abs() < 0.011, "{fault:?}: {by_nm} {expected}");
        for _ in 0..2000 {
            failed.step(&acting(2.0, 0.0));
        }
        let [reads, passes] = [failed.sensor_torque_nm(), failed.bar_torque_nm()];
        let off = reads - passes;
        match fault {
            ColumnFault::SensorDrift => assert!((off - 0.1).abs() < 0.011, "{off}"),
            ColumnFault::SensorStuck => {
                assert!((reads - whole.sensor_torque_nm()).abs() < 0.011, "{reads}");
            }
            // The twist is ten times what the whole bar would have, and the sensor ends at 10 N.m.
            ColumnFault::BrokenBar => {
                let twist = failed.state()[8];
                assert!(
                    (twist / passes - 10.0).abs() < 0.2 && reads == 10.0,
                    "{twist} {passes}"
                );
            }
            ColumnFault::AssistLost => assert!(failed.bar().unwrap().assist_nm.abs() < 1e-6),
            ColumnFault::AssistRunaway => assert!((failed.bar().unwrap().assist_nm - 60.0).abs() < 1e-3),
            _ => {}
        }
    }
}

#[test]
fn a_fault_takes_a_bar_and_a_run_that_lasts_until_then() {
    let read = |text: &str| Scenario::from_toml("s", text, |_, _| unreachable!());
    let rigid = read("[column]\nfault = \"sensor-stuck\"\n")
        .unwrap_err()
        .to_string();
    assert!(rigid.contains("takes column.kind"), "{rigid}");
    let late = "[column]\nkind = \"torsion-bar\"\nfault = \"broken-bar\"\nfault_time_s = 300\n";
    let refusal = read(late).unwrap().check_times().unwrap_err().to_string();
    assert!(
        refusal.starts_with("column.fault_time_s = 300 s is outside 0 to 200 s"),
        "{refusal}"
    );
}

/// All that the motor may turns the car to the left off the road, whatever the driver does.
#[test]
fn an_assist_that_runs_away_drives_off_the_road() {
    let text = "[column]\nkind = \"torsion-bar\"\nfault = \"assist-runaway\"\nfault_time_s = 20\n[assist]\ncurve = \"light\"\n";
    let run = simulate(&Scenario::from_toml("s", text, |_, _| unreachable!()).unwrap());
    let last = run.trace.samples.last().unwrap();
    assert!(
        run.diverged() && (20.0..24.0).contains(&last.time_s) && last.lateral_error_m > 1.0,
        "{last:?}"
    );
}
