//! The example of a study of one's own, against drives of the simulator by themselves.

#[allow(dead_code, reason = "the example's own `main`")]
#[path = "../examples/peak_against_speed.rs"]
mod peak_against_speed;

use haptic_batch::Confidence;
use haptic_batch::engine::{Study, Watch, failures};
use haptic_sim::scenario::FailureKind;
use haptic_sim::simulation::simulate;
use peak_against_speed::{FAULTS, PeakAgainstSpeed, scenario};

/// The paper's law with its defaults is what the ECU's own step computes in fixed point, but for its rounding: the peaks of the three
/// seeds at 60 km/h, without a failure and after each.
#[test]
fn the_example_finds_what_the_simulator_drives() {
    let found = PeakAgainstSpeed(Confidence::USUAL).run(&Watch::nobody()).unwrap();
    let speeds: Vec<(&str, f64)> = found.iter().map(|((law, kmh, _), _)| (*law, *kmh)).collect();
    let [slow, usual, fast] = [40.0, 60.0, 80.0];
    assert_eq!(speeds[..3], [("paper", slow), ("paper", usual), ("paper", fast)]);
    assert_eq!(speeds[3..], [("fdca", slow), ("fdca", usual), ("fdca", fast)]);
    let (_, means) = &found[1];
    let mut expected_m = [0.0; 3];
    for seed in 1..=3 {
        let nominal = scenario(("paper", usual, seed)).unwrap();
        let peak_m = |kind: FailureKind| {
            let mut peaks_m = vec![0.0];
            for (_, failure) in failures(&nominal, FAULTS)
                .into_iter()
                .filter(|(_, f)| f.kind == kind)
            {
                let run = simulate(&nominal.to_builder().failure(failure).build().unwrap());
                let until_s = failure.time_s + FAULTS.lasts_s;
                let samples = run.trace.samples.iter();
                let behind = samples.filter(|s| s.time_s >= failure.time_s && s.time_s < until_s);
                peaks_m.extend(behind.map(|s| s.lateral_error_m.abs()));
            }
            peaks_m.into_iter().fold(0.0, f64::max)
        };
        let samples = simulate(&nominal).trace.samples;
        let nominal_m = samples
            .iter()
            .map(|s| s.lateral_error_m.abs())
            .fold(0.0, f64::max);
        for (sum, peak_m) in
            expected_m
                .iter_mut()
                .zip([nominal_m, peak_m(FailureKind::Torque), peak_m(FailureKind::Input)])
        {
            *sum += peak_m / 3.0;
        }
    }
    for (mean, expected_m) in means.iter().zip(expected_m) {
        assert!((mean.mean - expected_m).abs() < 0.02, "{mean}, not {expected_m}");
        assert!(
            mean.interval
                .is_some_and(|[low, high]| low < mean.mean && mean.mean < high)
        );
    }
}
