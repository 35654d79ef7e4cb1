//! The assist's curve, and what is refused.

use haptic_sim::Scenario;
use haptic_sim::models::torsion_bar::Curve;

fn words(text: &str) -> Result<(), String> {
    Scenario::from_toml("s", text, |_, _| unreachable!())
        .map(drop)
        .map_err(|e| e.to_string())
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
    let column = |line: &str| words(&format!("[column]\nkind = \"torsion-bar\"\n{line}\n"));
    let refused = |line: &str, expected: &str| {
        let found = column(line).unwrap_err();
        assert!(found.contains(expected), "{found}");
    };
    refused(
        "k_tb_nm_per_rad = 4.9",
        "column.k_tb_nm_per_rad = 4.9 N.m/rad is outside 5 to 1000000000 N.m/rad",
    );
    refused(
        "j_w_kg_m2 = 0.11",
        "column.j_w_kg_m2 = 0.11 kg.m2 leaves the column none of the vehicle's 0.11 kg.m2",
    );
    assert_eq!(column("j_w_kg_m2 = 0.1099"), Ok(()));
    refused("sensor_lag_s = nan", "sensor_lag_s = NaN");
    refused("k_tb = 100", "unknown field `k_tb`");
    refused("angle = \"motor\"", "unknown variant `motor`");
    refused(
        "[assist]\ncurve = \"heavy\"",
        "\"none\", \"light\", \"medium\", \"strong\", or a table of torque_nm",
    );
    refused(
        "[assist]\ninject = \"offset\"",
        "assist.inject = \"offset\" takes an assist.curve other than",
    );
    refused(
        "[world]\nfriction_nm = 0.3",
        "world.friction_nm = 0.3 is of a rigid column",
    );
    refused(
        "[tolerances]\nmotor_lag_s = 0.01",
        "tolerances.motor_lag_s = 0.01 is of a rigid column",
    );
    let bent = |torques: &str, speeds: &str, rows: &str, expected: &str| {
        refused(
            &format!("[assist.curve]\ntorque_nm = {torques}\nspeed_m_per_s = {speeds}\nassist_nm = {rows}"),
            expected,
        );
    };
    bent(
        "[0.1, 1]",
        "[0, 9]",
        "[[0, 1], [0, 1]]",
        "assist.curve.torque_nm has to be",
    );
    bent(
        "[0, 1]",
        "[9, 0]",
        "[[0, 1], [0, 1]]",
        "assist.curve.speed_m_per_s has to be",
    );
    bent("[0, 1]", "[0, 9]", "[[0, 1]]", "a row for each speed");
    bent("[0, 1, 2]", "[0, 9]", "[[0, 2, 1], [0, 1, 2]]", "never falling");
    bent("[0, 1]", "[0, 9]", "[[0, inf], [0, 1]]", "finite");
}

/// What says something of a bar does not drive a column of one piece.
#[test]
fn a_bar_that_is_not_asked_for_is_refused() {
    for (text, field) in [
        (
            "[column]\nk_tb_nm_per_rad = 100\n",
            "column.k_tb_nm_per_rad = 100",
        ),
        ("[column]\nangle = \"column\"\n", "column.angle or column.fault"),
        ("[assist]\nlimit_nm = 50\n", "assist.limit_nm = 50"),
        ("[assist]\ncurve = \"light\"\n", "assist.inject or assist.curve"),
    ] {
        let found = words(text).unwrap_err();
        assert_eq!(found, format!("s: {field} takes column.kind = \"torsion-bar\""));
    }
    assert_eq!(
        words("[column]\nkind = \"rigid\"\n[assist]\ncurve = \"none\"\n"),
        Ok(())
    );
}

/// Read again it is the same scenario, points and all.
#[test]
fn a_scenario_with_a_bar_is_written_and_read() {
    let text = "[column]\nkind = \"torsion-bar\"\nangle = \"column\"\nj_w_kg_m2 = 0.03\n[assist]\ninject = \"offset\"\n\
                [assist.curve]\ntorque_nm = [0, 1.5]\nspeed_m_per_s = [0, 9]\nassist_nm = [[0, 4], [0, 1]]\n";
    let read = |text: &str| Scenario::from_toml("s", text, |_, _| unreachable!()).unwrap();
    let (first, again) = (read(text), read(&read(text).to_toml()));
    assert_eq!(first, again);
    assert!(again.assist().curve.assist().at(1.5, 0.0) == 4.0 && again.column().j_w_kg_m2 == 0.03);
}
