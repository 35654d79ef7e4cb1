//! A second-order Butterworth low-pass and a notch, run forward and backward over a record (zero phase).
//!
//! For records only: it looks into the future. The result is that of the usual `filtfilt`: the record is
//! continued at both ends by its own odd reflection, and each pass starts in the steady state of its first
//! value, so that a constant or a slope begins without a transient. The two passes square the filter's
//! magnitude: half the amplitude at the cut-off.
//!
//! It is written by hand because no crate has all of it: `biquad` starts from rest and leaves reflection and the way back to its user,
//! `sci-rs` has `sosfiltfilt` and no notch, and brings `ndarray` and a Kalman filter.

use std::f64::consts::{PI, SQRT_2};

/// Samples of odd reflection at each end: three times the number of coefficients, as SciPy and MATLAB take.
const REFLECTED: usize = 9;

/// `signal` through a second-order Butterworth low-pass, forward and backward.
///
/// `None` if the record has fewer than 10 samples or the cut-off is not between 0 and half the sample rate.
pub fn zero_phase_low_pass(signal: &[f64], sample_rate_hz: f64, cut_off_hz: f64) -> Option<Vec<f64>> {
    let filter = Biquad::low_pass(within(cut_off_hz, sample_rate_hz)?);
    forward_and_backward(&filter, signal)
}

/// `signal` without what lies about a frequency: a second-order notch `width_hz` wide at half the power, forward and backward.
///
/// `None` if the record has fewer than 10 samples or the frequency is not between 0 and half the sample rate.
pub fn zero_phase_notch(
    signal: &[f64],
    sample_rate_hz: f64,
    frequency_hz: f64,
    width_hz: f64,
) -> Option<Vec<f64>> {
    let filter = Biquad::notch(within(frequency_hz, sample_rate_hz)?, width_hz / sample_rate_hz);
    forward_and_backward(&filter, signal)
}

/// A frequency in cycles per sample; none if the record cannot hold it.
fn within(frequency_hz: f64, sample_rate_hz: f64) -> Option<f64> {
    (frequency_hz > 0.0 && frequency_hz < sample_rate_hz / 2.0).then_some(frequency_hz / sample_rate_hz)
}

fn forward_and_backward(filter: &Biquad, signal: &[f64]) -> Option<Vec<f64>> {
    let n = signal.len();
    // The reflection takes so many samples beside the first or the last, which it does not repeat.
    if n <= REFLECTED {
        return None;
    }
    let (first, last) = (signal[0], signal[n - 1]);
    let mut record = Vec::with_capacity(n + 2 * REFLECTED);
    record.extend((1..=REFLECTED).rev().map(|i| 2.0 * first - signal[i]));
    record.extend_from_slice(signal);
    record.extend((1..=REFLECTED).map(|i| 2.0 * last - signal[n - 1 - i]));

    filter.run(record.iter_mut());
    filter.run(record.iter_mut().rev());
    record.truncate(n + REFLECTED);
    record.drain(..REFLECTED);
    Some(record)
}

/// Coefficients of (b0 + b1/z + b2/z^2) / (1 + a1/z + a2/z^2), unit gain at zero frequency.
struct Biquad {
    b: [f64; 3],
    a: [f64; 2],
}

impl Biquad {
    /// Bilinear transform with the cut-off (in cycles per sample) prewarped.
    fn low_pass(cut_off: f64) -> Self {
        let w = (PI * cut_off).tan();
        let norm = 1.0 / (1.0 + SQRT_2 * w + w * w);
        let b0 = w * w * norm;
        Self {
            b: [b0, 2.0 * b0, b0],
            a: [2.0 * (w * w - 1.0) * norm, (1.0 - SQRT_2 * w + w * w) * norm],
        }
    }

    /// Zero at `frequency`, half the power `width` apart about it, both in cycles per sample.
    fn notch(frequency: f64, width: f64) -> Self {
        let gain = 1.0 / (1.0 + (PI * width).tan());
        let middle = -2.0 * gain * (2.0 * PI * frequency).cos();
        Self {
            b: [gain, middle, gain],
            a: [middle, 2.0 * gain - 1.0],
        }
    }

    /// Filters in place (transposed direct form II), from the steady state of the first value.
    fn run<'a>(&self, mut record: impl Iterator<Item = &'a mut f64>) {
        let ([b0, b1, b2], [a1, a2]) = (self.b, self.a);
        let mut record = record.by_ref().peekable();
        let first = record.peek().map_or(0.0, |x| **x);
        let mut z2 = (b2 - a2) * first;
        let mut z1 = (b1 - a1) * first + z2;
        for x in record {
            let y = b0 * *x + z1;
            z1 = b1 * *x - a1 * y + z2;
            z2 = b2 * *x - a2 * y;
            *x = y;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Expected values from SciPy 1.17.1:
    /// `i = numpy.arange(24); x = numpy.sin(0.4*i) + 0.1*i + (i % 5 == 0)`
    /// `b, a = scipy.signal.butter(2, FC, fs=FS); scipy.signal.filtfilt(b, a, x)`
    #[test]
    fn the_low_pass_agrees_with_scipy() {
        for (sample_rate_hz, cut_off_hz, expected) in SCIPY {
            let y = zero_phase_low_pass(&signal(), sample_rate_hz, cut_off_hz).unwrap();
            assert_same(&y, &expected);
        }
    }

    /// The notch filters the signal of the low-pass; `b, a = scipy.signal.iirnotch(2.5, 2.5 / 0.5, fs=120)`, every
    /// third value.
    #[test]
    fn the_notch_agrees_with_scipy() {
        let y = zero_phase_notch(&signal(), 120.0, 2.5, 0.5).unwrap();
        let third: Vec<f64> = y.into_iter().step_by(3).collect();
        assert_same(&third, &SCIPY_NOTCH);
    }

    fn signal() -> Vec<f64> {
        (0..24)
            .map(|i| (0.4 * i as f64).sin() + 0.1 * i as f64 + f64::from(i % 5 == 0))
            .collect()
    }

    fn assert_same(y: &[f64], expected: &[f64]) {
        assert_eq!(y.len(), expected.len());
        for (i, (y, want)) in y.iter().zip(expected).enumerate() {
            assert!((y - want).abs() < 1e-11, "sample {i}: {y} instead of {want}");
        }
    }

    const SCIPY_NOTCH: [f64; 8] = [
        1.085095300517,
        1.401577708293,
        1.512308780614,
        0.734188922729,
        0.480403315079,
        2.452417366021,
        2.746374293196,
        3.009121102291,
    ];

    const SCIPY: [(f64, f64, [f64; 24]); 2] = [
        (
            120.0,
            2.0,
            [
                1.195687667527,
                1.205850379241,
                1.218836051005,
                1.234561137169,
                1.252906382458,
                1.273750907678,
                1.297012223949,
                1.322660825829,
                1.350688328704,
                1.381055897824,
                1.413659133470,
                1.448316334777,
                1.484756734714,
                1.522591623404,
                1.561294449830,
                1.600220907988,
                1.638667088258,
                1.675931160070,
                1.711349850339,
                1.744325469577,
                1.774367100635,
                1.801140753249,
                1.824495302621,
                1.844441243020,
            ],
        ),
        (
            10.0,
            0.6,
            [
                0.986498030879,
                1.046673515814,
                1.101573717242,
                1.142886378173,
                1.158693024612,
                1.139027813526,
                1.083050134519,
                1.002468040284,
                0.917504986409,
                0.849892832828,
                0.818876456020,
                0.841024779634,
                0.929337214137,
                1.088305686807,
                1.309277154855,
                1.571497728322,
                1.848663068440,
                2.115277871861,
                2.348261987300,
                2.527072568165,
                2.636955414844,
                2.674802532910,
                2.652039303436,
                2.590543084129,
            ],
        ),
    ];

    #[test]
    fn a_constant_and_a_slope_pass_unchanged() {
        for slope in [0.0, 0.02] {
            let x: Vec<f64> = (0..2000).map(|i| 3.0 + slope * f64::from(i)).collect();
            let y = zero_phase_low_pass(&x, 120.0, 2.0).unwrap();
            // A slope is odd about its ends, so only the reflection's finite length shows there.
            for i in 500..1500 {
                assert!(
                    (x[i] - y[i]).abs() < 1e-9,
                    "sample {i}: {} becomes {}",
                    x[i],
                    y[i]
                );
            }
            assert!(slope > 0.0 || (y[0] - 3.0).abs() < 1e-9);
        }
    }

    #[test]
    fn refuses_what_it_cannot_filter() {
        assert_eq!(zero_phase_low_pass(&[1.0; 9], 120.0, 2.0), None);
        assert_eq!(zero_phase_low_pass(&[1.0; 100], 4.0, 2.0), None);
        assert_eq!(zero_phase_low_pass(&[1.0; 100], 0.0, 2.0), None);
    }
}
