//! The studies, against what is known without them.

use haptic_column::study::assist::{Column, Group, Study};
use haptic_column::study::{ColumnFile, ecu, reading, sensors};
use haptic_engine::Study as _;
use haptic_sim::models::torsion_bar::{ColumnParameters, Inject};

/// By hand, from the points: at 60 km/h medium's slope is 0.5 on a straight and 3.5 at 2 N.m; held hands feel 1/(1 + g) of an overlay
/// and g/(1 + g) of an offset, and the motor gives a free wheel 1 and g.
#[test]
fn what_is_felt_is_what_the_slope_says() {
    let study = Study::default();
    let results = study.summarise(Vec::new(), Vec::new()).unwrap();
    let mut seen = 0;
    for row in &results.felt {
        if (row.curve, row.speed_kmh) != ("medium", 60.0) {
            continue;
        }
        seen += 1;
        let g = if row.working_nm == 0.0 { 0.5 } else { 3.5 };
        let [felt, free] = match row.inject {
            Inject::Overlay => [1.0 / (1.0 + g), 1.0],
            Inject::Offset => [g / (1.0 + g), g],
        };
        assert!((row.slope - g).abs() < 1e-9);
        assert!((row.felt_nm / felt - 1.0).abs() < 0.08, "{row:?} {felt}");
        // The wheel's inertia takes its part of a swing, and the assist answers it.
        assert!((row.motor_free_nm / free - 1.0).abs() < 0.25, "{row:?} {free}");
    }
    assert_eq!(seen, 4);
    assert_eq!(results.loops.len(), 15);
    // More slope, less margin.
    let phase = |at: usize| results.loops[at].margins[0].and_then(|m| m.gain).unwrap();
    assert!(phase(0) < phase(1) && phase(1) < phase(2));
}

/// Table 8's driver with high reliance and the shortest delay: the bar changes little, a loss costs three times the peak (README).
#[test]
fn a_drive_through_a_bar_is_near_that_on_the_paper_s_column() {
    let study = Study::default();
    let cases = study.plan().unwrap().cases;
    let of = |column| {
        let case = cases
            .iter()
            .find(|case| case.column == column && case.group == Group::Conditions);
        study.driven(case.unwrap()).unwrap()
    };
    let rigid = of(Column::Rigid);
    assert!((rigid.peak_m.unwrap() - 0.1255).abs() < 0.005, "{rigid:?}");
    assert!((rigid.lost_peak_m.unwrap() - 0.4408).abs() < 0.02, "{rigid:?}");
    let smooth = of(Column::Smooth);
    assert!((smooth.peak_m.unwrap() - 0.1255).abs() < 0.02, "{smooth:?}");
    assert!((smooth.lost_peak_m.unwrap() - 0.4408).abs() < 0.06, "{smooth:?}");
    // Friction of 0.7 N.m beside torques of that size.
    assert!(of(Column::Bar).peak_m.unwrap() > 2.0 * smooth.peak_m.unwrap());
}

#[test]
fn a_better_sensor_tells_the_hands_better() {
    let results = sensors::run(&ColumnFile::default()).unwrap();
    let best = results.best();
    assert_eq!(best.len(), 6);
    // Within a rate the finer step is better, and 1 kHz better than 120 Hz.
    for k in [0, 1, 3, 4] {
        assert!(best[k].error_nm <= best[k + 1].error_nm, "{best:?}");
    }
    for k in 0..3 {
        assert!(best[k].error_nm <= best[k + 3].error_nm, "{best:?}");
    }
    assert!(
        best[0].no_hand_nm < results.bar_no_hand_nm,
        "{best:?} {results:?}"
    );
}

#[test]
fn a_file_names_what_is_wrong_with_it() {
    let words = |text: &str| ColumnFile::from_toml(text).unwrap_err().to_string();
    assert!(
        words("[column]\nk_tb_nm_per_rad = 3\n")
            .contains("column.k_tb_nm_per_rad = 3 N.m/rad is outside 5 to")
    );
    assert!(words("[colunm]\n").contains("unknown field `colunm`"));
    assert!(
        words("[assist.curve]\ntorque_nm = [0, 1]\nspeed_m_per_s = [0, 9]\nassist_nm = [[0, 1]]\n")
            .contains("a row for each speed")
    );
    let own = ColumnFile::from_toml(
        "[assist.curve]\ntorque_nm = [0, 1]\nspeed_m_per_s = [0, 9]\nassist_nm = [[0, 2], [0, 1]]\n",
    )
    .unwrap();
    assert_eq!(own.curves()[0].0, "the file's");
    assert_eq!(sensors::run(&own).unwrap().curve, "the file's");
    assert_eq!(own.column, ColumnParameters::default());
}

/// Guidance acts all the time, so that a warning comes after 15 s of it; the estimate is 30 ms late.
#[test]
fn the_ecu_behind_a_bar_knows_hands_from_none_where_its_parameters_are_right() {
    let rows = ecu::run(&ColumnFile::default()).unwrap();
    let row = |believed: &str| rows.iter().find(|row| row.believed == believed).unwrap();
    let right = row("as it is");
    for warned in [right.warned_s, right.warned_beside_probe_s] {
        assert!(warned.is_some_and(|s| (15.0..16.0).contains(&s)), "{right:?}");
    }
    assert_eq!(right.falsely_warned_s, None);
    assert!(right.yields_ms.is_some_and(|ms| ms <= 60), "{right:?}");
    assert_eq!(right.found, []);
    // Where it takes the bar for the hands, a wheel that nobody holds is held, and it yields later.
    let hands = row("hands, where a bar is");
    assert_eq!((hands.warned_s, hands.warned_beside_probe_s), (None, None));
    assert!(hands.yields_ms > right.yields_ms, "{hands:?}");
    assert_eq!(row("a bar, where hands are").found[0].0, "ColumnImplausible");
}

/// The driver is the paper's, whatever the column; with the medium assist, whose slope on a straight is 0.5, two thirds of the motor's torque come
/// up to the hands.
#[test]
fn a_reading_through_an_assist_is_of_the_motors_torque() {
    let study = reading::Study {
        file: ColumnFile::default(),
        read: |_| Ok(None),
    };
    let cases = study.plan().unwrap().cases;
    assert_eq!(cases.len(), 6 * 3 * 8);
    for case in &cases {
        let scenario = study.scenario(case).unwrap();
        assert_eq!(scenario.seed(), scenario.seed().clamp(1, 8));
        assert!(scenario.gains().k_d >= 2.0, "{:?}", scenario.gains());
    }
    // One drive of eight has no reading.
    let readings: Vec<_> = (0..cases.len())
        .map(|k| (k % 8 > 0).then_some([0.1 * (k % 8) as f64, 0.5]))
        .collect();
    let rows = study.summarise(cases, readings).unwrap().rows;
    let of_motor: Vec<f64> = rows.iter().map(|row| (1000.0 * row.of_motor).round()).collect();
    let (plain, assisted) = ([0.0, 300.0, 600.0], [0.0, 200.0, 400.0]);
    assert_eq!(
        of_motor,
        [plain, plain, plain, plain, assisted, assisted].concat()
    );
    for row in rows {
        assert_eq!((row.drives, row.reported), (7, 0.5));
        // 0.1 to 0.7: the mean 0.4, the variance 0.04.
        assert!(
            (row.read - 0.4).abs() < 1e-12 && (row.spread - 0.2).abs() < 1e-12,
            "{row:?}"
        );
    }
}
