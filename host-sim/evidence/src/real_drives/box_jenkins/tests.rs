//! Expected values are statsmodels': tests/tools/box_jenkins.py prints them.

use super::*;

/// The script's series: two inputs of waves, and ARMA(2,1) noise of a linear congruential generator.
fn series() -> Series {
    let (mut state, mut error, mut noise) = (1_u64, 0.0, [0.0; 2]);
    let row = |k: u32| {
        let k = f64::from(k);
        state = (1_103_515_245 * state + 12_345) % (1 << 31);
        let new = state as f64 / f64::from(1_u32 << 31) - 0.5;
        let n = 1.2 * noise[0] - 0.35 * noise[1] + new + 0.4 * error;
        (noise, error) = ([n, noise[0]], new);
        let x = vec![
            (0.11 * k).sin() + 0.5 * (0.043 * k + 1.0).sin(),
            (0.6 * k).sin() * (0.013 * k).sin(),
        ];
        let y = 0.8 * x[0] - 0.3 * x[1] + n;
        (x, y)
    };
    (0..600).map(row).collect()
}

#[test]
fn a_model_has_the_parameters_that_statsmodels_finds() {
    let found = BoxJenkins::fitted(&[&series()]).unwrap();
    let found: Vec<f64> = found.weights.iter().chain(&found.noise).copied().collect();
    let expected = [0.66902, -0.26371, 1.31802, -0.46346, 0.3668];
    let errors = [0.13238, 0.09477, 0.05063, 0.0496, 0.0551];
    for k in 0..5 {
        // The likelihood of statsmodels has a term for the first two rows; a tenth of a standard error is more than that is worth.
        assert!((found[k] - expected[k]).abs() < 0.1 * errors[k], "{found:?}");
    }
    let both = BoxJenkins::fitted(&[&series(), &series()]).unwrap();
    assert!((both.noise[0] - found[2]).abs() < 1e-4, "{:?}", both.noise);
}

#[test]
fn a_prediction_is_that_of_statsmodels() {
    let model = BoxJenkins {
        weights: vec![0.8, -0.3],
        noise: [1.2, -0.35, 0.4],
    };
    // The row 404 by what is known of rows 0 to 399.
    let ahead = model.ahead(&series(), 5);
    assert!((ahead[404 - ORDER - 5] - 0.134_695_718).abs() < 1e-8);
    assert_eq!(ahead.len(), 600 - ORDER - 5);
    assert!(model.ahead(&series()[..4].to_vec(), 5).is_empty());
}

#[test]
fn a_regression_on_the_own_past_is_that_of_statsmodels() {
    let torque: Vec<f64> = series().iter().map(|row| row.1).collect();
    let mean = |of: &dyn Fn(usize) -> f64| (16..600).map(of).sum::<f64>() / 584.0;
    let means: Vec<f64> = (0..=6).map(|lag| mean(&|k| torque[k - lag])).collect();
    let at = |k: usize, lag: usize| torque[k - lag] - means[lag];
    let rows: Vec<(Vec<f64>, f64)> = (16..600)
        .map(|k| ((1..=6).map(|lag| at(k, lag)).collect(), at(k, 0)))
        .collect();
    let expected = [
        1.724_699_266,
        -1.112_720_235,
        0.437_607_988,
        -0.222_424_59,
        0.093_587_293,
        0.007_053_438,
    ];
    for (found, expected) in weights(&rows).unwrap().iter().zip(expected) {
        assert!((found - expected).abs() < 1e-8, "{found} {expected}");
    }
}
