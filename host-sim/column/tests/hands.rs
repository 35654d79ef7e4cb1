//! Hands, told from the motor, against what is known without the study.

use haptic_column::study::ColumnFile;
use haptic_column::study::hands::{Eye, Hand, Study, timer_s};
use haptic_engine::Study as _;
use haptic_engine::statistics::Confidence;

/// By hand for seconds that are felt as a coin falls: 900 stretches an hour begin, each second halves them, so that of the 90,000 in
/// 100 h one lasts 1 + log2(90,000) = 17.5 s.
#[test]
fn seconds_that_a_coin_decides_need_as_long_as_arithmetic_says() {
    // Another generator than the study's: bits of a linear congruential one (Knuth's constants).
    let mut state = 1_u64;
    let mut coin = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        state >> 63 == 1
    };
    let seconds: Vec<[f64; 2]> = (0..36_000)
        .map(|_| if coin() { [1.0, 0.0] } else { [0.01, 0.0] })
        .collect();
    let [after_s, low, high] = timer_s(&seconds, 0.5, 10.0, Confidence::USUAL);
    assert!((after_s - 17.5).abs() < 2.5, "{after_s}");
    assert!(
        low <= after_s && after_s <= high && high - low < 6.0,
        "{low} {high}"
    );
    // A mean that no offset of a sensor is, is a hand as well, on both sides.
    for mean in [0.36, -0.36] {
        let held: Vec<[f64; 2]> = seconds.iter().map(|[swing, _]| [*swing, mean]).collect();
        assert!(timer_s(&held, 0.5, 10.0, Confidence::USUAL)[0] < after_s);
    }
}

/// Eighty stretches of 1 s and one each of 2 to 21 s in an hour: of the longest fifth 190 seconds go on and 20 end, so p = 191/212, and the time is
/// 2 + ln(2100)/-ln(p), rounded up; at its ends p -+ 2.5758*sqrt(p*(1 - p)/212) at 99 %, 0.6745 of that root at 50 %.
#[test]
fn the_ends_of_a_time_are_those_of_its_level() {
    let lengths = std::iter::repeat_n(1, 80).chain(2..=21);
    let stretch = |length: usize| [vec![[0.01, 0.0]; length], vec![[1.0, 0.0]]].concat();
    let seconds: Vec<[f64; 2]> = lengths.flat_map(stretch).collect();
    for (share, wanted) in [(0.5, [76.0, 66.0, 88.0]), (0.99, [76.0, 49.0, 164.0])] {
        let level = Confidence::new(share).unwrap();
        assert_eq!(timer_s(&seconds, 0.5, 1.0, level), wanted);
    }
}

/// A minute each with the file's wheel: a hand that steers is told by every observer, and none is felt more where nobody is.
#[test]
fn a_hand_that_steers_is_told_from_none() {
    let study = Study {
        file: ColumnFile::default(),
        hours: 0.02,
        level: Confidence::USUAL,
    };
    let mut cases = study.plan().unwrap().cases;
    assert_eq!(cases.len(), 56);
    // Three roads, four hands, two halves: the first are the file's wheel.
    cases.truncate(24);
    let driven: Vec<_> = cases.iter().map(|case| study.driven(case).unwrap()).collect();
    let results = study.summarise(cases, driven).unwrap();
    assert_eq!((results.rows.len(), results.roc.len()), (48, 9));
    // Three roads, four eyes, three hands.
    for row in &results.rows[..36] {
        if row.hand == Hand::Steering && row.eye != Eye::Bar {
            let told = row.told.unwrap();
            assert!(told.threshold_nm > 0.01 && told.after_s[0] < 60.0, "{row:?}");
        }
    }
    for roc in &results.roc {
        for two in roc.points.windows(2) {
            assert!(two[0][0] >= two[1][0] && two[0][1] >= two[1][1], "{roc:?}");
        }
        if roc.hand == Hand::Steering {
            assert!(roc.points.iter().all(|[none, hand]| hand >= none), "{roc:?}");
        }
    }
}
