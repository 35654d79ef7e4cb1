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
//! lags, with weights estimated from the record. Their errors stay the same throughout the record, so no number of rows
//! averages them out: what they do to the signal is handed on ([`Smoothed::doubts`]), to be a part of the standard errors.
//!
//! The course is a random walk that was integrated three times: a road is built so that its curvature has no steps, and the
//! spectrum of what the camera sees of it falls fast. A walk that is integrated once has a spectrum that falls more slowly:
//! it leaves noise in the signal and takes the road's bends out of it, and both bias t_p and the gains. Intensity of the
//! course and size of the noise are those of the largest likelihood. Innovations beyond [`GATE`] standard deviations are
//! outliers and get no part, if they exceed what a sample may be out of line by, too: in a signal with next to no noise the
//! entry of every bend is beyond any number of standard deviations.
//!
//! A signal whose noise cannot matter ([`NEGLIGIBLE`]) is left as it is.

#[cfg(test)]
mod tests;
mod trend;

use super::wide::{lagged, median};
use nalgebra::DMatrix;
use serde::Serialize;
use trend::{COLUMNS, Filter, Likelihood, Row, likelihood};

/// Order of the course: level, slope and two more derivatives.
const ORDER: usize = 4;

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
    /// What one standard deviation of each independent error of the vehicle's answer makes of the signal.
    pub doubts: Vec<Vec<f64>>,
    /// Rows in bursts of outliers: whatever the signal was there, it was not the lane.
    pub bursts: Vec<bool>,
    pub noise: LaneNoise,
}

/// One standard deviation of an error that a smoothed lane signal has throughout.
#[derive(Debug, Clone)]
pub(crate) struct LaneDoubt {
    /// 0 is e_y, 1 is e_theta.
    pub lane: usize,
    /// Row of the log that it begins at.
    pub from: usize,
    /// What it makes of the signal.
    pub signal: Vec<f64>,
}

/// The vehicle's answers to the wheel angle that a lane signal may hold; `integrals` is 1 for an angle, 2 for a place.
fn answers(wheel_angle: &[f64], dt: f64, integrals: usize) -> Vec<Vec<f64>> {
    let mut out: Vec<Vec<f64>> = VEHICLE_LAGS_S
        .iter()
        .map(|&t| lagged(wheel_angle, dt, t))
        .collect();
    let mut whole = wheel_angle.to_vec();
    for _ in 0..integrals {
        whole = super::wide::integral(&whole, dt);
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
    // Median of |x| of a standard normal variable: 0.6745.
    median(&mut third) / 0.674_5 / 20.0_f64.sqrt()
}

/// Smooths the place (`integrals` 2) or the angle (1) of the lane, with the vehicle's answer in it or without (`by_motion`). `weight` is
/// the precision of each sample relative to the usual, zero where there is none; `floor` is the least noise that rounding makes,
/// `least` the least by which a sample is out of line.
pub(crate) fn smooth(
    signal: &[f64],
    wheel_angle: &[f64],
    dt: f64,
    (integrals, by_motion): (usize, bool),
    weight: &[f64],
    [floor, least]: [f64; 2],
) -> Smoothed {
    let used = weight.iter().filter(|&&w| w > 0.0).count();
    let white = noise_of_differences(signal, weight).max(floor);
    let missing = used < signal.len();
    let negligible = white < NEGLIGIBLE[2 - integrals];
    if used < 10 || (negligible && !missing) {
        return Smoothed {
            signal: signal.to_vec(),
            error_sd: vec![0.0; signal.len()],
            doubts: Vec::new(),
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
    let mut rows: Vec<Row> = signal
        .iter()
        .map(|&y| {
            let mut row = [0.0; COLUMNS];
            row[0] = y;
            row
        })
        .collect();
    for (i, answer) in answers.iter().enumerate() {
        for (row, x) in rows.iter_mut().zip(answer) {
            row[i + 1] = *x;
        }
    }
    let problem = Problem {
        rows,
        answers: answers.len(),
        dt,
        floor,
        least,
        keep: negligible,
    };
    let best = problem.best(weight, None);
    problem.smoothed(weight.to_vec(), best)
}

/// A lane signal and the vehicle's answers beside it.
struct Problem {
    rows: Vec<Row>,
    answers: usize,
    dt: f64,
    floor: f64,
    least: f64,
    /// Whether the values are kept as they are, and only missing ones completed.
    keep: bool,
}

/// The best ratio, by its decadic logarithm.
struct Best {
    exponent: f64,
    fit: Likelihood,
}

impl Problem {
    /// The ratio of the largest likelihood: by steps of the same share of the course's bandwidth, which is the eighth root
    /// of it, from `near` or from 10 rad/s, then by a parabola through the best three.
    fn best(&self, weight: &[f64], near: Option<f64>) -> Best {
        let at = |exponent: f64| {
            let filter = Filter::<ORDER>::new(self.dt, 10.0_f64.powf(exponent), weight);
            let fit = likelihood(&filter, &self.rows, self.answers, self.floor);
            Best { exponent, fit }
        };
        let order = ORDER as f64;
        let (start, pace) = (near.unwrap_or(2.0 * order + self.dt.log10()), 0.5 * order);
        let mut here = at(start);
        let mut up = at(start + pace);
        let mut down = at(start - pace);
        for _ in 0..12 {
            if up.fit.deviance < here.fit.deviance {
                (down, here) = (here, up);
                up = at(here.exponent + pace);
            } else if down.fit.deviance < here.fit.deviance {
                (up, here) = (here, down);
                down = at(here.exponent - pace);
            } else {
                break;
            }
        }
        let bend = up.fit.deviance - 2.0 * here.fit.deviance + down.fit.deviance;
        if bend > 0.0 {
            let step = 0.5 * (down.fit.deviance - up.fit.deviance) / bend;
            let refined = at(here.exponent + pace * step.clamp(-0.5, 0.5));
            if refined.fit.deviance <= here.fit.deviance {
                here = refined;
            }
        }
        here
    }

    /// The signal as the best course and the answers have it, after what is out of line lost its part.
    fn smoothed(&self, mut weight: Vec<f64>, mut best: Best) -> Smoothed {
        let mut outliers = Vec::new();
        for round in 0..3 {
            if round > 0 {
                best = self.best(&weight, Some(best.exponent));
            }
            let before = outliers.len();
            let gate = GATE.max(self.least / best.fit.noise_variance.sqrt());
            for (k, (w, v)) in weight.iter_mut().zip(&best.fit.innovations).enumerate() {
                if *w > 0.0 && v.abs() > gate {
                    *w = 0.0;
                    outliers.push(k);
                }
            }
            if outliers.len() == before {
                break;
            }
        }
        let Best { exponent, fit } = best;
        let filter = Filter::<ORDER>::new(self.dt, 10.0_f64.powf(exponent), &weight);
        // The course takes up what it can of the answers: what is left of each is what its weight adds to the signal.
        let course = filter.smoothed(&self.rows);
        let added = |k: usize, i: usize| self.rows[k][i + 1] - course[k][i + 1];
        let n = self.rows.len();
        // What has next to no noise is only completed.
        let keep = |k: usize| self.keep && weight[k] > 0.0;
        let smooth = |k: usize| -> f64 {
            course[k][0]
                + (0..self.answers)
                    .map(|i| fit.weights[i] * added(k, i))
                    .sum::<f64>()
        };
        let root = fit
            .covariance
            .cholesky()
            .map_or_else(|| DMatrix::zeros(0, 0), |c| c.l());
        let doubt = |j: usize| -> Vec<f64> {
            let of = |k: usize| (j..self.answers).map(|i| root[(i, j)] * added(k, i)).sum();
            (0..n).map(|k| if keep(k) { 0.0 } else { of(k) }).collect()
        };
        let noise_variance = fit.noise_variance;
        let error_sd: Vec<f64> = filter
            .variances()
            .iter()
            .map(|v| (v * noise_variance).sqrt())
            .collect();
        let left = (error_sd.iter().map(|e| e * e).sum::<f64>() / n as f64).sqrt();
        Smoothed {
            signal: (0..n)
                .map(|k| if keep(k) { self.rows[k][0] } else { smooth(k) })
                .collect(),
            doubts: (0..root.nrows()).map(doubt).collect(),
            error_sd,
            bursts: bursts(&mut outliers, n, self.dt),
            noise: LaneNoise {
                noise_sd: noise_variance.sqrt(),
                left_sd: left,
                outliers: outliers.len(),
                smoothed: !self.keep,
            },
        }
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
