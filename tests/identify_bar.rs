//! Drives through the simulator's torsion bar, whose driver is known: what is made of the bar's torque, with the angle above it and below it.

use haptic_analysis::identify::{DriveLog, Identification, Options};
use haptic_batch::identify::{Method, identify};
use haptic_sim::models::driver::{ArmGains, DriverParameters};
use haptic_sim::models::torsion_bar::{ColumnKind, ColumnParameters};
use haptic_sim::scenario::{Condition, GuidanceParameters};
use haptic_sim::{Scenario, simulation};

const K_HG: f64 = 0.6;

/// A drive of 100 rows a second, with the bar's torque and the angle of the wheel, or of the column as the bar's twist leaves it.
fn drive(wheel_friction_nm: f64, below: bool) -> DriveLog {
    let column = ColumnParameters {
        kind: ColumnKind::TorsionBar,
        upper_friction_nm: wheel_friction_nm,
        lower_friction_nm: 0.3,
        ..ColumnParameters::default()
    };
    let guidance = GuidanceParameters {
        probe: true,
        ..GuidanceParameters::default()
    };
    let scenario = Scenario::builder()
        .condition(Condition::Custom)
        .driver(DriverParameters {
            remnant_sd_nm: 0.1,
            ..DriverParameters::default()
        })
        .gains(ArmGains {
            k_d: 2.0 + 2.0 * K_HG,
            k_hg: K_HG,
        })
        .column(column)
        .guidance(guidance.told_of(&column))
        .seed(7)
        .build()
        .unwrap();
    let trace = simulation::simulate(&scenario).trace;
    let every = (trace.sample_rate_hz / 100.0).round() as usize;
    let mut log = DriveLog {
        dt_s: every as f64 / trace.sample_rate_hz,
        ..DriveLog::default()
    };
    for now in trace.samples.iter().step_by(every) {
        let bar_nm = now.bar_torque_nm.unwrap();
        let twist = if below {
            bar_nm / column.k_tb_nm_per_rad
        } else {
            0.0
        };
        log.e_y_m.push(now.e_y_m);
        log.e_theta_rad.push(now.e_theta_rad);
        log.wheel_angle_rad.push(now.wheel_angle_rad - twist);
        log.guidance_torque_nm.push(now.guidance_torque_nm);
        log.driver_torque_nm.push(bar_nm);
    }
    log
}

fn read(log: &DriveLog, fixed: &[&str]) -> Identification {
    let fixed: Vec<String> = fixed.iter().map(ToString::to_string).collect();
    let options = Options::given(false, &fixed).unwrap();
    identify("bar", log, &options, Method::NoiseModel)
        .unwrap()
        .results
        .identification
}

#[test]
fn k_hg_comes_through_a_bar_by_the_inertia_of_the_wheel() {
    let above = drive(0.0, false);
    let below = drive(0.0, true);
    let told = [
        "wheel_inertia=0.044",
        "wheel_damping=0.05",
        "bar_stiffness=143.24",
    ];
    for (log, fixed) in [(&above, &told[..1]), (&above, &told[..2]), (&below, &told[..])] {
        let k_hg = read(log, fixed).parameters.k_hg;
        let [low, high] = k_hg.interval_95.unwrap();
        assert!(k_hg.identified, "{fixed:?}: {k_hg:?}");
        assert!(
            low < K_HG && K_HG < high && high - low < 0.3,
            "{fixed:?}: {k_hg:?}"
        );
    }
    // The bar's torque by itself is not the hands', and friction hides them.
    for (log, fixed) in [(&above, &told[..0]), (&drive(0.1, false), &told[..2])] {
        let found = read(log, fixed);
        assert!(
            !found.refuted.is_empty(),
            "{fixed:?}: {:?}",
            found.parameters.k_hg
        );
    }
}

#[test]
fn what_tells_no_wheel_is_refused() {
    let log = drive(0.0, false);
    let told = Options::given(false, &["wheel_inertia=0.044".to_owned()]).unwrap();
    let slow = DriveLog {
        dt_s: 0.05,
        ..log.clone()
    };
    for (log, method, says) in [
        (&slow, Method::NoiseModel, "20 rows a second, 40 are wanted"),
        (&log, Method::Paper, "knows no wheel"),
    ] {
        let refused = identify("bar", log, &told, method).unwrap_err().to_string();
        assert!(refused.contains(says), "{refused}");
    }
}
