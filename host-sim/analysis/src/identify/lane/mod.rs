//! What the camera's signals were before their noise: a smoother from the vehicle's own motion.
//!
//! Noise on an input of a regression biases what is estimated from it, and gives the likelihood of a delay a jagged
//! ridge and so a far too small standard error. What removes it without bias is the conditional mean of the input
//! given everything but the output: the error that is left is independent of the estimate (a Berkson error) and
//! only adds to the residual. Given the wheel angle, the vehicle's motion is known, so that what the lane signals
//! hold beside it is the road, which knows nothing of the driver's remnant: no future of the record leaks into
//! the driver's present.
//!
//! So each lane signal is a smooth course (the road, [`trend`]) plus the vehicle's answer to the wheel angle plus
//! white camera noise. The answer is that of any vehicle: the integrals of the wheel angle and its first-order
//! lags, with weights estimated from the record. Intensity of the course and size of the noise are those of the
//! largest likelihood. Innovations beyond [`GATE`] standard deviations are outliers: they get no part.
//!
//! A signal whose noise cannot matter ([`NEGLIGIBLE`]) is left as it is.

mod trend;

use serde::Serialize;
use trend::{Filter, Likelihood, likelihood};

/// Innovations beyond so many standard deviations are outliers.
const GATE: f64 = 5.0;

/// So many outliers within so long are a burst, and bursts that follow each other within so long are one, s.
const BURST: usize = 4;
const BURST_S: f64 = 0.25;
const BURSTS_APART_S: f64 = 10.0;

/// Noise below these, m and rad, is left in the signals: it is lost beside the driver's remnant.
const NEGLIGIBLE: [f64; 2] = [2e-5, 2e-6];

/// Time constants of the lags of the wheel angle that stand for the vehicle, s: its own are 0.05 to 0.3 s.
const VEHICLE_LAGS_S: [f64; 3] = [0.05, 0.12, 0.3];

/// What was found of one lane signal.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct LaneNoise {
    /// Standard deviation of the camera's white noise, in the signal's unit.
    pub noise_sd: f64,
    /// Root mean square of the error that is left after smoothing.
    pub left_sd: f64,
    /// Samples that were out of line.
    pub outliers: usize,
    /// Whether the signal was smoothed; one with next to no noise is only completed where values are missing.
    pub smoothed: bool,
}

/// A signal with the standard deviation of its error at each sample.
#[derive(Debug, Clone)]
pub(crate) struct Smoothed {
    pub signal: Vec<f64>,
    pub error_sd: Vec<f64>,
    /// Rows in bursts of outliers: whatever the signal was there, it was not the lane.
    pub bursts: Vec<bool>,
    pub noise: LaneNoise,
}

/// The vehicle's answers to the wheel angle that a lane signal may hold; `integrals` is 1 for an angle, 2 for a place.
fn answers(wheel_angle: &[f64], dt: f64, integrals: usize) -> Vec<Vec<f64>> {
    let mut out: Vec<Vec<f64>> = VEHICLE_LAGS_S
        .iter()
        .map(|&t| {
            let share = 1.0 - (-dt / t).exp();
            let mut y = wheel_angle[0];
            wheel_angle
                .iter()
                .map(|&u| {
                    y += share * (u - y);
                    y
                })
                .collect()
        })
        .collect();
    let mut whole = wheel_angle.to_vec();
    for _ in 0..integrals {
        whole = super::signals::integral(&whole, dt);
        out.push(whole.clone());
    }
    out
}

/// White noise of a smooth signal from its third differences, of which the course has next to nothing: 20 times its
/// variance, by the median so that outliers do not count. Over the samples that have a part, as if evenly spaced.
fn noise_of_differences(signal: &[f64], weight: &[f64]) -> f64 {
    let fresh: Vec<f64> = signal
        .iter()
        .zip(weight)
        .filter(|(_, w)| **w > 0.0)
        .map(|(&u, _)| u)
        .collect();
    let mut third: Vec<f64> = fresh
        .windows(4)
        .map(|u| (u[3] - 3.0 * u[2] + 3.0 * u[1] - u[0]).abs())
        .collect();
    if third.is_empty() {
        return 0.0;
    }
    let middle = third.len() / 2;
    let (_, median, _) = third.select_nth_unstable_by(middle, f64::total_cmp);
    // Median of |x| of a standard normal variable: 0.6745.
    *median / 0.674_5 / 20.0_f64.sqrt()
}

/// Smooths the place (`integrals` 2) or the angle (1) of the lane, with the vehicle's answer in it or without (`by_motion`). `weight` is the precision of each sample relative
/// to the usual, zero where there is none; `floor` the least noise that rounding makes.
pub(crate) fn smooth(
    signal: &[f64],
    wheel_angle: &[f64],
    dt: f64,
    integrals: usize,
    by_motion: bool,
    weight: &[f64],
    floor: f64,
) -> Smoothed {
    let used = weight.iter().filter(|&&w| w > 0.0).count();
    let white = noise_of_differences(signal, weight).max(floor);
    let missing = used < signal.len();
    let negligible = white < NEGLIGIBLE[2 - integrals];
    if used < 10 || (negligible && !missing) {
        return Smoothed {
            signal: signal.to_vec(),
            error_sd: vec![0.0; signal.len()],
            bursts: vec![false; signal.len()],
            noise: LaneNoise {
                noise_sd: white,
                ..LaneNoise::default()
            },
        };
    }
    let answers = if by_motion {
        answers(wheel_angle, dt, integrals)
    } else {
        Vec::new()
    };
    let mut weight = weight.to_vec();
    let mut outliers = Vec::new();
    let mut ratio = 1.0;
    let mut found: Option<(Filter, Likelihood)> = None;
    for round in 0..3 {
        let (best, filter, fit) =
            best_ratio(signal, &answers, dt, &weight, floor, (round > 0).then_some(ratio));
        ratio = best;
        let before = outliers.len();
        for (k, (w, v)) in weight.iter_mut().zip(&fit.innovations).enumerate() {
            if *w > 0.0 && v.abs() > GATE {
                *w = 0.0;
                outliers.push(k);
            }
        }
        found = Some((filter, fit));
        if outliers.len() == before {
            break;
        }
    }
    let Some((_, fit)) = found else {
        unreachable!("there is a first round")
    };
    let filter = Filter::new(dt, ratio, &weight);
    let motion: Vec<f64> = (0..signal.len())
        .map(|k| {
            answers
                .iter()
                .zip(fit.weights.iter())
                .map(|(x, w)| x[k] * w)
                .sum()
        })
        .collect();
    let road: Vec<f64> = signal.iter().zip(&motion).map(|(y, m)| y - m).collect();
    let (course, variance) = filter.smoothed(&road);
    let error_sd: Vec<f64> = variance.iter().map(|v| (v * fit.noise_variance).sqrt()).collect();
    // What has next to no noise is only completed.
    let keep = |k: usize| negligible && weight[k] > 0.0;
    let left = (error_sd.iter().map(|e| e * e).sum::<f64>() / error_sd.len() as f64).sqrt();
    Smoothed {
        signal: (0..signal.len())
            .map(|k| if keep(k) { signal[k] } else { course[k] + motion[k] })
            .collect(),
        error_sd,
        bursts: bursts(&mut outliers, signal.len(), dt),
        noise: LaneNoise {
            noise_sd: fit.noise_variance.sqrt(),
            left_sd: left,
            outliers: outliers.len(),
            smoothed: !negligible,
        },
    }
}

/// Rows between the first and the last outlier of a burst: at least [`BURST`] within [`BURST_S`]. Bursts that are near
/// each other are where something else began and where it ended.
fn bursts(outliers: &mut [usize], rows: usize, dt: f64) -> Vec<bool> {
    outliers.sort_unstable();
    let mut out = vec![false; rows];
    let (span, apart) = ((BURST_S / dt) as usize, (BURSTS_APART_S / dt) as usize);
    let mut last: Option<usize> = None;
    for w in outliers.windows(BURST).filter(|w| w[BURST - 1] - w[0] <= span) {
        let from = last.filter(|&l| w[0] <= l + apart).unwrap_or(w[0]);
        out[from..=w[BURST - 1]].fill(true);
        last = Some(w[BURST - 1]);
    }
    out
}

/// The ratio of the largest likelihood: by whole decades from `near` or over all, then by a parabola through the best
/// three.
fn best_ratio(
    signal: &[f64],
    answers: &[Vec<f64>],
    dt: f64,
    weight: &[f64],
    floor: f64,
    near: Option<f64>,
) -> (f64, Filter, Likelihood) {
    let at = |exponent: f64| {
        let filter = Filter::new(dt, 10.0_f64.powf(exponent), weight);
        let fit = likelihood(&filter, signal, answers, floor);
        (exponent, filter, fit)
    };
    let start = near.map_or(1.0, f64::log10);
    let mut here = at(start);
    let mut up = at(start + 1.0);
    let mut down = at(start - 1.0);
    for _ in 0..12 {
        if up.2.deviance < here.2.deviance {
            (down, here) = (here, up);
            up = at(here.0 + 1.0);
        } else if down.2.deviance < here.2.deviance {
            (up, here) = (here, down);
            down = at(here.0 - 1.0);
        } else {
            break;
        }
    }
    let bend = up.2.deviance - 2.0 * here.2.deviance + down.2.deviance;
    if bend > 0.0 {
        let step = 0.5 * (down.2.deviance - up.2.deviance) / bend;
        let refined = at(here.0 + step.clamp(-0.5, 0.5));
        if refined.2.deviance <= here.2.deviance {
            here = refined;
        }
    }
    (10.0_f64.powf(here.0), here.1, here.2)
}
