//! The oracle of the live estimate, in f64: the rule of docs/explanation/live-estimate.md, worked out from the whole record of
//! a drive, with a sum over each block's samples and the list of all readings.

pub(crate) mod drive;

use std::f64::consts::TAU;

use haptic_core::controller::params::Params;

/// One sample of the column, SI, each figure a multiple of 2^-24.
#[derive(Clone, Copy)]
pub(crate) struct Point {
    pub(crate) at_us: u64,
    pub(crate) applied_nm: f64,
    pub(crate) driver_nm: f64,
    pub(crate) wheel_rad: f64,
}

/// K_hg and its deviation.
pub(crate) type Estimate = Option<[f64; 2]>;

/// Real and imaginary part.
pub(crate) type Phasor = [f64; 2];

fn times([a, b]: Phasor, [c, d]: Phasor) -> Phasor {
    [a * c - b * d, a * d + b * c]
}

pub(crate) fn over(a: Phasor, [c, d]: Phasor) -> Phasor {
    times(a, [c / (c * c + d * d), -d / (c * c + d * d)])
}

/// The phase is counted in 2^-32 turns per microsecond.
fn frequency_hz(params: &Params) -> f64 {
    (params.probe_frequency_hz * 4_294.967_296).round() / 4_294.967_296
}

/// Length of a block: a whole number of periods, 2 s or next to it.
pub(crate) fn block_us(params: &Params) -> f64 {
    (2.0 * params.probe_frequency_hz).round() * 1e6 / frequency_hz(params)
}

/// A reading, and by how much it is more if t_nms is larger by 0.03 s.
type Reading = [Phasor; 2];

/// The readings since hands were last on the wheel, averaged.
struct Readings {
    all: Vec<Reading>,
    /// How many of them came since the last change.
    since_change: usize,
    /// Squared innovations, one for each reading but the first.
    squares: Vec<f64>,
    prior: f64,
}

impl Readings {
    fn none(params: &Params) -> Self {
        Self {
            all: Vec::new(),
            since_change: 0,
            squares: Vec::new(),
            prior: (0.18 * 0.2 / params.probe_amplitude_nm).powi(2),
        }
    }

    /// The mean since the change, and how many readings it counts for: beyond 40 the old ones fade.
    fn mean(&self) -> (Reading, f64) {
        let since = &self.all[self.all.len() - self.since_change..];
        let mut count = 0.0;
        let mean = since.iter().fold(Reading::default(), |mean, reading| {
            count = f64::min(count + 1.0, 40.0);
            let new = |i: usize, j: usize| mean[i][j] + (reading[i][j] - mean[i][j]) / count;
            [0, 1].map(|i| [0, 1].map(|j| new(i, j)))
        });
        (mean, count)
    }

    /// Each square counts 59/60 of the one after it; the prior is worth eight before the first.
    fn variance(&self) -> f64 {
        let kept = |age: usize| (59.0_f64 / 60.0).powi(age as i32);
        let n = self.squares.len();
        let (mut sum, mut weights) = (8.0 * self.prior * kept(n), 8.0 * kept(n));
        for (i, square) in self.squares.iter().enumerate() {
            sum += square * kept(n - 1 - i);
            weights += kept(n - 1 - i);
        }
        sum / weights
    }

    fn take(&mut self, reading: Reading, seen: &mut Seen) {
        let ([[mean, _], _], count) = self.mean();
        if count > 0.0 {
            let square = (reading[0][0] - mean).powi(2) * count / (count + 1.0);
            let most = 9.0 * self.variance();
            seen.outliers += usize::from(square > most);
            self.squares.push(square.min(most));
        }
        self.all.push(reading);
        self.since_change += 1;
        let ([[mean, _], _], count) = self.mean();
        let supposed = (3..=14_usize).filter(|new| *new as f64 + 3.0 <= count);
        let significance = |new: usize| {
            let sum: f64 = self.all[self.all.len() - new..]
                .iter()
                .map(|[[re, _], _]| re)
                .sum();
            let (new, before) = (new as f64, count - new as f64);
            let apart = sum / new - (count * mean - sum) / before;
            let deviation = (1.25 * self.variance() * (1.0 / new + 1.0 / before)).sqrt();
            apart.abs() / deviation / if new < 6.0 { 3.8 } else { 3.1 }
        };
        let best = supposed.max_by(|a, b| significance(*a).total_cmp(&significance(*b)));
        if let Some(new) = best.filter(|new| significance(*new) > 1.0) {
            seen.changes[new] += 1;
            self.since_change = new;
        }
    }

    /// The report, after five readings.
    fn estimate(&self) -> Estimate {
        let ([[re, im], more], count) = self.mean();
        let noise = 1.2 * self.variance() / count + 0.02_f64.powi(2);
        // The real part of the mean is K_hg - u*more[0], its imaginary part -u*more[1], each with the noise, and u is 0 +- 1.
        let left = 1.0 / (1.0 + more[1].powi(2) / noise);
        let u = -left * more[1] * im / noise;
        let deviation = (noise + left * more[0].powi(2)).sqrt();
        (self.all.len() >= 5).then_some([re + u * more[0], deviation])
    }
}

/// How often what this is about came to pass.
#[derive(Default)]
pub(crate) struct Seen {
    /// By the number of readings after the change.
    pub(crate) changes: [usize; 15],
    pub(crate) outliers: usize,
    /// Blocks with too little of a probe.
    pub(crate) faint: usize,
    /// Halves of blocks with nobody's hands.
    pub(crate) quiet: usize,
}

/// One reading: the ratio of Fourier coefficients under a Hann window that begins at `from_us`.
fn reading(params: &Params, block: &[Point], from_us: f64) -> Option<Reading> {
    let turns_per_us = 1e-6 * frequency_hz(params);
    let (mut driver, mut wheel, mut applied, mut weights) = ([0.0; 2], [0.0; 2], [0.0; 2], 0.0);
    for point in block {
        let at_us = point.at_us as f64;
        let weight = (0.5 * TAU * (at_us - from_us) / block_us(params)).sin().powi(2);
        let phase = TAU * turns_per_us * at_us;
        for (sum, value) in [
            (&mut driver, point.driver_nm),
            (&mut wheel, point.wheel_rad),
            (&mut applied, point.applied_nm),
        ] {
            sum[0] += weight * value * phase.cos();
            sum[1] -= weight * value * phase.sin();
        }
        weights += weight;
    }
    // A sine of amplitude a has a coefficient of a/2 times the weights.
    let size = applied[0].hypot(applied[1]) / (0.5 * weights);
    let with = |t_nms_s: f64| {
        let arm = times([1.0, TAU * params.probe_frequency_hz * t_nms_s], driver);
        let right = [0, 1].map(|i| -arm[i] - params.k_nms * wheel[i]);
        over(right, applied)
    };
    (size >= 0.5 * params.probe_amplitude_nm).then(|| {
        let [read, slower] = [with(params.t_nms_s), with(params.t_nms_s + 0.03)];
        [read, [0, 1].map(|i| slower[i] - read[i])]
    })
}

/// What there is to say from which sample on.
pub(crate) fn expected(params: &Params, points: &[Point], seen: &mut Seen) -> Vec<(usize, Estimate)> {
    let start_us = points[0].at_us as f64;
    let half_us = |half: usize| start_us + 0.5 * block_us(params) * half as f64;
    let first = |half: usize| points.partition_point(|point| (point.at_us as f64) < half_us(half));
    let mut readings = Readings::none(params);
    let (mut said, mut was_quiet) = (vec![(0, None)], false);
    for half in 0.. {
        let (from, to) = (first(half), first(half + 1));
        if to == points.len() {
            break;
        }
        let torques = || points[from..to].iter().map(|point| point.driver_nm);
        let quiet = torques().fold(f64::MIN, f64::max) - torques().fold(f64::MAX, f64::min) < 0.012;
        seen.quiet += usize::from(quiet);
        if quiet || was_quiet {
            readings = Readings::none(params);
            said.push((to, None));
        } else if half > 0 {
            match reading(params, &points[first(half - 1)..to], half_us(half - 1)) {
                Some(reading) => readings.take(reading, seen),
                None => seen.faint += 1,
            }
            said.push((to, readings.estimate()));
        }
        was_quiet = quiet;
    }
    said
}
