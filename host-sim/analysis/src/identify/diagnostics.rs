//! Is the model enough? Fit, whiteness of the residuals, and their independence of the inputs.
//!
//! Sources: Ljung and Box, "On a measure of lack of fit in time series models", Biometrika 65 (1978); Ljung,
//! "System Identification", section 16.6 (residual analysis).

use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::result::{InputCorrelation, Whiteness};
use super::wide::dot;

/// Lags of the whiteness test.
const LAGS: usize = 25;

/// Span of the input correlation test, s, and its lags.
const INPUT_SPAN_S: f64 = 1.0;
const INPUT_LAGS: usize = 10;

/// Fit of `model` to `measured` in %: 100*(1 - |y - yhat|/|y - mean y|). 100 is perfect, 0 is what the mean does.
pub fn fit_percent(measured: &[f64], model: impl Iterator<Item = f64>) -> f64 {
    let mean = measured.iter().sum::<f64>() / measured.len() as f64;
    let (mut error, mut spread) = (0.0, 0.0);
    for (&y, m) in measured.iter().zip(model) {
        error += (y - m).powi(2);
        spread += (y - mean).powi(2);
    }
    // A constant record has no spread: no model can be said to fit it.
    if spread > 0.0 {
        100.0 * (1.0 - (error / spread).sqrt())
    } else {
        0.0
    }
}

/// Autocorrelation of `residual` at lags 1 to `lags`, about zero.
pub fn autocorrelation(residual: &[f64], lags: usize) -> Vec<f64> {
    let power = dot(residual, residual);
    let at = |lag: usize| dot(residual, &residual[lag..]) / power;
    (1..=lags.min(residual.len() / 4))
        .map(|lag| if power > 0.0 { at(lag) } else { 0.0 })
        .collect()
}

/// The largest autocorrelation of `residual` beyond what reading off between rows explains. That gives white noise the
/// autocorrelation `resampling`; the noise model may take up a part of it, so anything from nothing to all of it may be left.
pub(crate) fn unexplained_autocorrelation(residual: &[f64], resampling: &[f64]) -> f64 {
    let explained = resampling.iter().copied().chain(std::iter::repeat(0.0));
    autocorrelation(residual, LAGS)
        .into_iter()
        .zip(explained)
        .map(|(r, e)| r - r.clamp(e.min(0.0), e.max(0.0)))
        .fold(
            0.0,
            |largest: f64, r| if r.abs() > largest.abs() { r } else { largest },
        )
}

/// Ljung-Box test of `residual`, of which `estimated` noise parameters were fitted.
pub(crate) fn whiteness(residual: &[f64], estimated: usize) -> Whiteness {
    let n = residual.len() as f64;
    let correlations = autocorrelation(residual, LAGS);
    let lags = correlations.len();
    let mut largest: f64 = 0.0;
    let mut statistic = 0.0;
    for (r, lag) in correlations.into_iter().zip(1..) {
        statistic += n * (n + 2.0) * r * r / (n - f64::from(lag));
        if r.abs() > largest.abs() {
            largest = r;
        }
    }
    let freedom = (lags - estimated.min(lags.saturating_sub(1))).max(1) as f64;
    let p_value = ChiSquared::new(freedom).map_or(0.0, |d| d.sf(statistic));
    Whiteness {
        largest_autocorrelation: largest,
        lags,
        statistic,
        p_value,
        white: p_value >= 0.01,
    }
}

/// Cross-correlation of `residual` with the past of each input. For a white residual that is independent of the
/// input's past, each correlation times sqrt(n) is standard normal.
pub(crate) fn input_correlation(
    residual: &[f64],
    inputs: &[(&'static str, &[f64])],
    dt_s: f64,
) -> Vec<InputCorrelation> {
    let stride = ((INPUT_SPAN_S / dt_s) as usize / INPUT_LAGS).max(1);
    let power = dot(residual, residual);
    inputs
        .iter()
        .map(|&(input, u)| {
            let mean = u.iter().sum::<f64>() / u.len() as f64;
            let centred: Vec<f64> = u.iter().map(|x| x - mean).collect();
            let energy = dot(&centred, &centred);
            let norm = (power * energy).sqrt();
            let mut largest_z: f64 = 0.0;
            for lag in (0..=INPUT_LAGS)
                .map(|i| i * stride)
                .filter(|&l| l < residual.len())
            {
                let cross = dot(&residual[lag..], &centred);
                if norm > 0.0 {
                    let z = cross / norm * (residual.len() as f64).sqrt();
                    if z.abs() > largest_z.abs() {
                        largest_z = z;
                    }
                }
            }
            InputCorrelation {
                input,
                largest_z,
                independent: largest_z.abs() <= 3.3,
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fit_of_hand_made_series() {
        // |y - yhat| = 1, |y - mean| = sqrt(2): 100 * (1 - 1/sqrt 2) = 29.289.
        let fit = fit_percent(&[1.0, 2.0, 3.0], [1.0, 2.0, 4.0].into_iter());
        assert!((fit - 29.289_321_9).abs() < 1e-6);
        assert_eq!(fit_percent(&[1.0, 2.0, 3.0], [1.0, 2.0, 3.0].into_iter()), 100.0);
        assert_eq!(fit_percent(&[2.0, 2.0], [2.0, 2.0].into_iter()), 0.0);
    }

    /// A period-2 series of length n has r_1 = -(n-1)/n and r_2 = (n-2)/n, so the statistic is far beyond any
    /// chi-square point; one impulse has r = 0 at every lag.
    #[test]
    fn a_square_wave_is_not_white_and_an_impulse_is() {
        let alternating: Vec<f64> = (0..400).map(|k| if k % 2 == 0 { 1.0 } else { -1.0 }).collect();
        let w = whiteness(&alternating, 2);
        assert!((w.largest_autocorrelation + 399.0 / 400.0).abs() < 1e-12);
        assert!(w.p_value < 1e-9 && !w.white);
        let mut impulse = vec![0.0; 400];
        impulse[17] = 1.0;
        let w = whiteness(&impulse, 2);
        assert_eq!((w.statistic, w.p_value, w.white), (0.0, 1.0, true));
    }

    /// Half of one value and half of the next: white noise gets the autocorrelation 1/2 at lag 1 and none beyond. Beside
    /// that, an echo of 0.4 three rows later has (0.4 + 0.2 * 0) / (1 + 0.16) at lag 3, and is seen.
    #[test]
    fn what_resampling_explains_is_no_colour_and_more_is() {
        let mut state: u64 = 7;
        let white: Vec<f64> = (0..20_000)
            .map(|_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
            })
            .collect();
        let halves: Vec<f64> = white.windows(2).map(|w| 0.5 * (w[0] + w[1])).collect();
        assert!((unexplained_autocorrelation(&halves, &[]) - 0.5).abs() < 0.03);
        assert!(unexplained_autocorrelation(&halves, &[0.5]).abs() < 0.03);
        let echo: Vec<f64> = halves.windows(4).map(|w| w[3] + 0.4 * w[0]).collect();
        let left = unexplained_autocorrelation(&echo, &[0.5]);
        assert!((left - 0.4 / 1.16).abs() < 0.03, "{left}");
    }

    /// The residual is the input of 6 samples before, which repeats every 6: correlation 1 already at lag 0, so
    /// z = sqrt(n) there up to the ends, and independence is denied. The other input is zero and says nothing.
    #[test]
    fn a_residual_that_repeats_an_input_is_seen() {
        let u: Vec<f64> = (0..1000)
            .map(|k| if k / 3 % 2 == 0 { 1.0 } else { -1.0 })
            .collect();
        let residual: Vec<f64> = (0..1000).map(|k| if k >= 6 { u[k - 6] } else { 0.0 }).collect();
        let zero = vec![0.0; 1000];
        let tests = input_correlation(&residual, &[("a", &u), ("b", &zero)], 1.0 / 120.0);
        assert!((tests[0].largest_z - 1000.0_f64.sqrt()).abs() < 1.0 && !tests[0].independent);
        assert!(tests[1].independent && tests[1].largest_z == 0.0);
    }
}
