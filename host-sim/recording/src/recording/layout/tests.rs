use super::points::line;
use super::*;

#[test]
fn every_built_in_layout_is_one_and_another_name_is_refused_with_those_there_are() {
    let names: Vec<String> = Layout::built_in().unwrap().into_iter().map(|l| l.name).collect();
    assert_eq!(names, BUILT_IN.map(|(name, _)| name));
    let error = Layout::named("open-lka").unwrap_err().to_string();
    assert!(
        error.contains("layout open-lka: one of openlka, openpilot"),
        "{error}"
    );
    let error = Layout::named("/nowhere/own.toml").unwrap_err().to_string();
    assert!(error.contains("own.toml"), "{error}");
}

/// 20 m/s towards the centre at 0.05 rad, on an arc of 0.01 /m to the left, 0.4 m right of the centre. The near point, 6 m ahead, has
/// 0.4 - 0.05*6 + 0.01*36/2 = 0.28 m; the far one, 20 m ahead, -0.05 + 0.01*20 = 0.15 rad.
#[test]
fn the_points_are_those_of_a_lane_that_is_an_arc() {
    let (dt_s, rows) = (0.1, 21);
    let offset = |k: usize| 0.4 - 1.0 * dt_s * (k as f64 - 10.0);
    let mut table = Table::from([
        ("offset_m".into(), (0..rows).map(offset).collect()),
        ("curvature_1pm".into(), vec![0.01; rows]),
        (SPEED_COLUMN.into(), vec![20.0; rows]),
    ]);
    two_points(&mut table, dt_s);
    assert!(
        (table["e_y_m"][10] - 0.28).abs() < 1e-12,
        "{}",
        table["e_y_m"][10]
    );
    assert!(
        (table["e_theta_rad"][10] - 0.15).abs() < 1e-12,
        "{}",
        table["e_theta_rad"][10]
    );
}

/// The slope and the correlation of five points, by hand: x 0..4 has a sum of squares of 10 about its mean; y = 0, 1, 1, 3, 5 of 16
/// about 2; the products sum to 12.
#[test]
fn a_line_has_the_slope_of_least_squares() {
    let pairs = [(0.0, 0.0), (1.0, 1.0), (2.0, 1.0), (3.0, 3.0), (4.0, 5.0)];
    let (slope, correlation) = line(&pairs);
    assert!((slope - 1.2).abs() < 1e-12 && (correlation - 12.0 / 160.0_f64.sqrt()).abs() < 1e-12);
}

#[test]
fn how_old_a_held_signal_gets_is_the_mean_time_between_two_values() {
    // Three values in 0.6 s.
    let held = super::renewed_s(&[1.0, 1.0, 1.0, 2.0, 2.0, 1.0], 0.1);
    assert!((held - 0.2).abs() < 1e-12, "{held}");
}
