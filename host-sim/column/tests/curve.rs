//! The assist's curve, and what is refused.

use haptic_column::{Assist, BarParameters, Curve, Plant};
use haptic_sim::models::nonlinear::WorldParameters;
use haptic_sim::models::vehicle::VehicleParameters;

fn plant(bar: BarParameters, assist: Assist) -> Result<Plant, String> {
    let plant = Plant::new(
        bar,
        assist,
        &VehicleParameters::default(),
        &WorldParameters::default(),
        1,
    );
    plant.map_err(|e| e.to_string())
}

/// By hand: at 60 km/h between 2 and 3 N.m the points are 3.5 and 7 N.m; halfway between 60 and 100 km/h the share is 0.8.
#[test]
fn a_curve_is_read_between_and_beyond_its_points_on_both_sides() {
    let curve = Curve::usual(1.0);
    for (torque_nm, kmh, expected_nm) in [
        (2.5, 60.0, 5.25),
        (2.5, 80.0, 0.8 * 5.25),
        (8.0, 60.0, 27.0),
        (9.0, 60.0, 27.0),
        (2.5, 0.0, 5.0 * 5.25),
        (2.5, 200.0, 0.5 * 5.25),
        (0.0, 60.0, 0.0),
    ] {
        for side in [1.0, -1.0] {
            let found = curve.at(side * torque_nm, kmh / 3.6);
            assert!(
                (found - side * expected_nm).abs() < 1e-9,
                "{torque_nm} {kmh}: {found}"
            );
        }
    }
    for (torque_nm, slope) in [(0.0, 0.5), (0.49, 0.5), (0.51, 1.5), (7.9, 4.0), (8.0, 0.0)] {
        for side in [1.0, -1.0] {
            let found = curve.slope(side * torque_nm, 60.0 / 3.6);
            assert!((found - slope).abs() < 1e-9, "{torque_nm}: {found}");
        }
    }
    assert!((curve.steepest(0.0) - 20.0).abs() < 1e-9);
}

#[test]
fn a_column_that_cannot_be_is_refused_by_its_field_value_and_range() {
    let standard = BarParameters::default();
    let words = |bar, assist| plant(bar, assist).map(drop).unwrap_err();
    let soft = BarParameters {
        k_tb_nm_per_rad: 4.9,
        ..standard
    };
    assert_eq!(
        words(soft, Assist::None),
        "column.k_tb_nm_per_rad = 4.9 N.m/rad is outside 5 to 1000000000 N.m/rad"
    );
    let heavy = BarParameters {
        j_w_kg_m2: 0.11,
        ..standard
    };
    assert_eq!(
        words(heavy, Assist::None),
        "column.j_w_kg_m2 = 0.11 kg.m2 leaves the column none of the vehicle's 0.11 kg.m2"
    );
    assert!(
        plant(
            BarParameters {
                j_w_kg_m2: 0.1099,
                ..standard
            },
            Assist::None
        )
        .is_ok()
    );
    assert!(
        words(
            BarParameters {
                sensor_lag_s: f64::NAN,
                ..standard
            },
            Assist::None
        )
        .contains("sensor_lag_s = NaN")
    );
    let bent = |bend: fn(&mut Curve)| {
        let mut curve = Curve::usual(1.0);
        bend(&mut curve);
        words(standard, Assist::Points(curve))
    };
    assert!(bent(|c| c.torque_nm[0] = 0.1).starts_with("assist.torque_nm has to be"));
    assert!(bent(|c| c.speed_m_per_s.swap(0, 1)).starts_with("assist.speed_m_per_s has to be"));
    assert!(bent(|c| drop(c.assist_nm.pop())).contains("a row for each speed"));
    assert!(bent(|c| c.assist_nm[1][3] = 0.1).contains("never falling"));
    assert!(bent(|c| c.assist_nm[1][3] = f64::INFINITY).contains("finite"));
    let field = toml::from_str::<BarParameters>("k_tb = 100")
        .unwrap_err()
        .to_string();
    assert!(field.contains("unknown field `k_tb`"), "{field}");
    let file: BarParameters = toml::from_str("k_tb_nm_per_rad = 100\ninject = \"offset\"").unwrap();
    assert_eq!((file.k_tb_nm_per_rad, file.j_w_kg_m2), (100.0, 0.044));
}
