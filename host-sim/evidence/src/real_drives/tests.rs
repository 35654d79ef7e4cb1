use std::path::Path;

use haptic_analysis::identify::Layout;

use super::fed::{Feed, fed};
use super::hands::{Felt, Hands, area};
use super::pooled::{Judged, Model, Pooled, Segment, pooled};
use super::rows::{Rows, turned};

/// 100 s shared and 60 s by hand, of simulated drives with the paper's vehicle.
fn recorded() -> Rows {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/layouts/openlka.csv");
    let bytes = std::fs::read(path).unwrap();
    Rows::read(&Layout::named("openlka").unwrap(), &bytes, None, &[]).unwrap()
}

/// Rows of 1/8 s: as many by hand with the first torques as shared with the others, under a guidance of 1 N.m.
fn made(by_hand_nm: &[f64], shared_nm: &[f64]) -> Rows {
    let n = by_hand_nm.len() + shared_nm.len();
    let shared: Vec<bool> = (0..n).map(|k| k >= by_hand_nm.len()).collect();
    Rows {
        time_s: (0..n).map(|k| k as f64 / 8.0).collect(),
        speed_m_per_s: vec![20.0; n],
        driver_nm: [by_hand_nm, shared_nm].concat(),
        guidance_nm: shared.iter().map(|shared| f64::from(u8::from(*shared))).collect(),
        shared,
        wheel_rad: vec![0.0; n],
        e_y_m: vec![0.0; n],
        e_theta_rad: vec![0.0; n],
        yaw_rate_rad_per_s: vec![0.0; n],
        driven_1pm: vec![0.0; n],
        roll_rad: vec![0.0; n],
        road: None,
    }
}

fn alternating(nm: f64) -> Vec<f64> {
    (0..81).map(|k| if k % 2 == 0 { nm } else { -nm }).collect()
}

fn hands(rows: &Rows) -> Hands {
    Hands::new(&[&(Felt::new(rows), Vec::new())]).unwrap()
}

/// What ended guidance, and whether driving was shared.
fn ends(rows: &Rows, feed: Feed) -> Vec<(String, bool)> {
    let ends = fed(rows, feed, "drive.csv").ends.into_iter();
    ends.map(|end| (end.faults, end.shared)).collect()
}

#[test]
fn the_area_under_a_curve_is_that_of_its_trapezoids() {
    // By hand: 0.5*1 + 0.5*(1 + 0.5)/2; and on the diagonal a half.
    assert!((area(&[[1.0, 1.0], [1.0, 0.5], [0.5, 0.0]]) - 0.875).abs() < 1e-12);
    assert!((area(&[[0.7, 0.7], [0.2, 0.2]]) - 0.5).abs() < 1e-12);
}

#[test]
fn a_hand_is_felt_up_to_the_threshold_that_its_torque_passes() {
    // From zero, the start, 0.2 N.m passes 0.08 N.m times 2.38, not times 2.83; 0.03 N.m passes it times 0.35, not 0.42.
    let found = hands(&made(&alternating(0.2), &alternating(0.03)));
    assert_eq!(found.seconds, [10, 10]);
    for threshold in &found.curve {
        let passes = [2.5, 0.375].map(|most| f64::from(u8::from(threshold.factor < most)));
        assert_eq!(threshold.felt, passes, "{}", threshold.factor);
    }
    assert!((found.own().factor - 1.0).abs() < 1e-12);
    assert_eq!((found.area, found.area_95), (1.0, [1.0; 2]));
    assert_eq!(found.longest_s, 10.0);
    let same = hands(&made(&alternating(0.2), &alternating(0.2)));
    assert_eq!((same.area, same.longest_s), (0.5, 0.125));
}

#[test]
fn pushes_against_the_guidance_are_counted_by_their_length() {
    let mut shared = vec![0.0; 81];
    // 1/8 s, 1/2 s and 10/8 s against it; the last goes with it.
    for (from, rows, torque) in [
        (8, 1, -0.9),
        (16, 4, -0.9),
        (32, 10, -0.9),
        (60, 4, -0.8),
        (70, 4, 0.9),
    ] {
        shared[from..from + rows].fill(torque);
    }
    assert_eq!(hands(&made(&[0.0; 81], &shared)).pushes, [1, 1, 1]);
}

#[test]
fn the_lane_ahead_turns_as_far_as_the_vehicle_will() {
    // 0.5 s at 0.2 rad/s and 0.2 s at 0.4 rad/s; from the second row on the recording ends after 0.5 s.
    let turned = turned(&[0.0, 0.5, 1.0], &[0.2, 0.4, 0.4], 0.7);
    for (turned, by_hand) in turned.iter().zip([0.18, 0.2, 0.0]) {
        assert!((turned - by_hand).abs() < 1e-12, "{turned} {by_hand}");
    }
}

#[test]
fn an_honest_recording_ends_nothing_and_what_is_wrong_in_it_is_named() {
    let honest = recorded();
    let of = |fault: &str, shared| (fault.to_owned(), shared);
    for feed in [Feed::Line, Feed::Held] {
        let fed = fed(&honest, feed, "drive.csv");
        assert!(fed.ends.is_empty(), "{:?}", fed.ends);
        // 160 s but for the last row: all of it guided.
        assert_eq!(fed.hours, fed.guided_h);
        assert!((3600.0 * (fed.hours[0] + fed.hours[1]) - 159.9).abs() < 0.01);
    }
    // At ten rows a second the column is silent for 30 ms at once, and guidance is not granted again.
    assert_eq!(ends(&honest, Feed::Nothing), [of("ColumnTimeout", true)]);
    // A torque of 4 N.m for 3 s that turns no wheel.
    let mut spiked = recorded();
    spiked.driver_nm[500..530]
        .iter_mut()
        .for_each(|torque| *torque += 4.0);
    let fed = fed(&spiked, Feed::Line, "drive.csv");
    let [end] = fed.ends.as_slice() else {
        panic!("{:?}", fed.ends)
    };
    assert_eq!((end.faults.as_str(), end.shared), ("ColumnImplausible", true));
    assert!(
        (50.0..53.0).contains(&end.time_s) && end.driver_nm > 1.0,
        "{end:?}"
    );
    // A torque of the wrong sign, in the bends by hand.
    let mut flipped = recorded();
    flipped.driver_nm[1000..]
        .iter_mut()
        .for_each(|torque| *torque = -*torque);
    let named = ends(&flipped, Feed::Line);
    assert!(!named.is_empty(), "a flip is not noticed");
    assert!(
        named.iter().all(|end| *end == of("ColumnImplausible", false)),
        "{named:?}"
    );
    // No hand while the guidance acts, which it does for 60 to 90 s of the 100: two ends after 30 s each. The sensor is alive.
    let mut free = recorded();
    for (row, torque) in free.driver_nm[..1000].iter_mut().enumerate() {
        *torque = 0.002 * (row % 2) as f64;
    }
    let acts = free
        .guidance_nm
        .iter()
        .filter(|torque| torque.abs() >= 0.05)
        .count();
    assert!((600..900).contains(&acts), "{acts}");
    assert_eq!(
        ends(&free, Feed::Line),
        [of("HandsOff", true), of("HandsOff", true)]
    );
}

/// Six segments of 60 s by hand on bends of their own, with an offset of the torque each; `torque` has wheel angle, planned curvature
/// times v^2 and row.
fn segments(torque: impl Fn(f64, f64, usize) -> f64) -> Vec<(String, Segment)> {
    let of = |segment: usize| {
        let mut rows = made(&[0.0; 481], &[]);
        let turn = |k: usize| (0.05 * k as f64 + segment as f64).sin();
        let planned = |k: usize| 0.002 * turn(k) + 0.001 * (0.023 * (k * (segment + 2)) as f64).cos();
        let offset = |k: usize| 0.2 * (0.031 * (k + 40 * segment) as f64).sin();
        rows.wheel_rad = (0..481).map(|k| 0.1 * turn(k)).collect();
        rows.road = Some([(0..481).map(planned).collect(), (0..481).map(offset).collect()]);
        let told = |k: usize| torque(rows.wheel_rad[k], 400.0 * planned(k), k) + segment as f64;
        rows.driver_nm = (0..481).map(told).collect();
        let [segment] = <[Segment; 1]>::try_from(Segment::of(&rows, "drive.csv"))
            .ok()
            .unwrap();
        ("truck".to_owned(), segment)
    };
    (0..6).map(of).collect()
}

/// The variance that a model accounts for in each of them.
fn accounted(found: &Pooled, model: Model, ahead_s: Option<f64>) -> [f64; 6] {
    let is_it = |judged: &&Judged| judged.model == model && judged.ahead_s == ahead_s;
    let judged = found.models.iter().find(is_it).unwrap();
    judged.accounted[..].try_into().unwrap()
}

fn one(mut found: Vec<Pooled>) -> Pooled {
    assert_eq!(found.len(), 1);
    found.remove(0)
}

#[test]
fn what_all_segments_share_is_told_in_the_one_left_out() {
    // A spring at the wheel; a driver who follows the planned curvature; both.
    let [spring, driver] = [
        |phi: f64, _: f64, _| 5.0 * phi,
        |_: f64, road: f64, _| -0.6 * road,
    ];
    let column = one(pooled(segments(spring)));
    assert!(accounted(&column, Model::Column, None).iter().all(|v| *v > 0.999));
    let alone = one(pooled(segments(driver)));
    assert!(accounted(&alone, Model::Driver, None).iter().all(|v| *v > 0.999));
    let both = one(pooled(segments(|phi, road, k| {
        spring(phi, 0.0, k) + driver(0.0, road, k)
    })));
    let then = accounted(&both, Model::ColumnThenDriver, None);
    for (column, then) in accounted(&both, Model::Column, None).into_iter().zip(then) {
        assert!(column < 0.98 && then > column, "{column} {then}");
    }
    // Persistence of a wave of 0.05 rad in 1/8 s, 1 s ahead: 1 - var(y(t+8) - y(t))/var(y) = 1 - 2 (1 - cos 0.4) but for the ends.
    for stays in accounted(&column, Model::Persistence, Some(1.0)) {
        assert!(
            (stays - (1.0 - 2.0 * (1.0 - 0.4_f64.cos()))).abs() < 0.03,
            "{stays}"
        );
    }
    for model in [Model::OwnPast, Model::Road, Model::BoxJenkins, Model::Ceiling] {
        let ahead = accounted(&column, model, Some(1.0));
        assert!(ahead.iter().all(|v| *v > 0.999), "{model:?} {ahead:?}");
    }
}

#[test]
fn noise_is_predicted_by_nothing_and_five_segments_are_too_few() {
    // Squares modulo a prime.
    let noise = |_: f64, _: f64, k: usize| ((k * k * 7919 + k * 104_729) % 1009) as f64 / 1009.0;
    let found = one(pooled(segments(noise)));
    for model in [Model::OwnPast, Model::Road, Model::BoxJenkins] {
        let ahead = accounted(&found, model, Some(0.5));
        assert!(ahead.iter().all(|v| *v < 0.1), "{model:?} {ahead:?}");
    }
    let mut few = segments(noise);
    few.truncate(5);
    assert!(pooled(few).is_empty());
}
