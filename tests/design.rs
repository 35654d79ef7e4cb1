//! Which experiment tells a driver: what `host-sim design` promises is held against drives that were identified.

use haptic_batch::Confidence;
use haptic_batch::design::{DesignRequest, design};
use haptic_batch::engine::Watch;
use haptic_sim::models::road::Course;

fn question() -> DesignRequest {
    DesignRequest {
        participants: vec![2, 9],
        courses: vec![Course::paper()],
        frequencies_hz: vec![1.5, 2.5],
        amplitudes_nm: vec![0.1, 0.2],
        parameter: "k_hg".to_owned(),
        error: 0.02,
        t_nms_known: true,
        confirmations: 6,
        seed: 1,
        level: Confidence::USUAL,
    }
}

/// Twelve fits: their RMS error has a relative standard deviation of 20 %. No unbiased estimator is below the prediction.
#[test]
fn the_error_that_is_promised_is_the_one_that_comes() {
    let answer = design(&question(), &Watch::nobody()).unwrap();
    let best = &answer.designs[answer.best.unwrap()];
    assert_eq!(best.amplitude_nm, 0.2);
    let c = answer.confirmation.as_ref().unwrap();
    assert_eq!(c.fits, 12);
    assert!((0.5..1.7).contains(&(c.rms / c.predicted)), "{c:?}");
    // Twice the probe has four times the information, where the probe is all that there is.
    let at = |amplitude: f64| {
        let same =
            |d: &&haptic_batch::design::Design| d.amplitude_nm == amplitude && d.frequencies_hz == [2.5];
        answer.designs.iter().find(same).unwrap().needed_s.unwrap()
    };
    assert!(
        (3.0..5.0).contains(&(at(0.1) / at(0.2))),
        "{} {}",
        at(0.1),
        at(0.2)
    );
    // And without a probe it takes hours.
    let without = answer
        .designs
        .iter()
        .find(|d| d.frequencies_hz.is_empty())
        .unwrap();
    assert!(without.needed_s.unwrap() > 100.0 * at(0.2));
}

#[test]
fn what_cannot_be_asked_is_named() {
    let of = |edit: fn(&mut DesignRequest)| {
        let mut question = question();
        edit(&mut question);
        design(&question, &Watch::nobody()).unwrap_err().to_string()
    };
    assert!(of(|q| q.parameter = "k_d".to_owned()).contains("\"k_d\" is unknown"));
    assert!(of(|q| q.participants = vec![15]).contains("participant = 15 is outside 1 to 14"));
}
