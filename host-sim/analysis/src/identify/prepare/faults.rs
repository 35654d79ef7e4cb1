//! What is wrong with single samples of a signal: numbers that are none, runs in which it is stuck, spikes, a sensor
//! slower than the log, and steps of its resolution.

use serde::Serialize;

use crate::identify::wide::median;

/// What was found in one column, in samples.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct ColumnFaults {
    /// Values that are no finite number.
    pub missing: usize,
    /// Values of runs in which the signal is stuck, at zero or elsewhere.
    pub stuck: usize,
    /// Values that jump away and back.
    pub spikes: usize,
    /// Rows from one fresh value to the next, if the sensor is slower than the log.
    pub held_rows: usize,
    /// Resolution, if the signal moves in steps that matter; zero otherwise.
    pub step: f64,
}

/// A column, and the part that each sample has in what follows.
pub(super) struct Examined {
    pub signal: Vec<f64>,
    /// Precision relative to the usual; zero: none.
    pub weight: Vec<f64>,
    /// Whether the sample itself is wrong (and not only without news).
    pub bad: Vec<bool>,
    pub faults: ColumnFaults,
}

/// Half the window of the running median, samples at most, and s: over a longer one the peaks of a probe of 2.5 Hz would be spikes.
const HALF_WINDOW: usize = 3;
const HALF_WINDOW_S: f64 = 0.034;
/// A spike is so many robust standard deviations of what the running median leaves over.
const SPIKE: f64 = 10.0;
/// Share of the rows that bring no news in a signal that moves in steps or is held.
const STEPPED: f64 = 0.5;
/// Stuck for so many rows, in a signal that otherwise never repeats itself.
const STUCK_ROWS: usize = 3;

/// Examines `signal`, whose rows are `dt_s` apart; changes below `least` never make a spike or a stuck run. Only what goes through the smoother of the
/// `lane` loses the rows that bring no news.
pub(super) fn examine(signal: &[f64], dt_s: f64, least: f64, lane: bool) -> Examined {
    let n = signal.len();
    let mut out = Examined {
        signal: signal.to_vec(),
        weight: vec![1.0; n],
        bad: signal.iter().map(|x| !x.is_finite()).collect(),
        faults: ColumnFaults::default(),
    };
    out.faults.missing = out.bad.iter().filter(|&&b| b).count();
    bridge(&mut out.signal, &out.bad);
    let half = ((HALF_WINDOW_S / dt_s).round() as usize).clamp(1, HALF_WINDOW);
    out.mark_spikes(least, half);
    out.mark_runs(least, lane);
    bridge(&mut out.signal, &out.bad);
    for (w, &bad) in out.weight.iter_mut().zip(&out.bad) {
        if bad {
            *w = 0.0;
        }
    }
    out
}

/// Straight lines across the samples that are `bad`, level at the ends.
pub(super) fn bridge(signal: &mut [f64], bad: &[bool]) {
    let n = signal.len();
    let mut last: Option<usize> = None;
    let mut k = 0;
    while k < n {
        if !bad[k] {
            last = Some(k);
            k += 1;
            continue;
        }
        let end = (k..n).find(|&j| !bad[j]);
        for j in k..end.unwrap_or(n) {
            signal[j] = match (last, end) {
                (Some(a), Some(b)) => signal[a] + (signal[b] - signal[a]) * (j - a) as f64 / (b - a) as f64,
                (Some(a), None) => signal[a],
                (None, Some(b)) => signal[b],
                (None, None) => 0.0,
            };
        }
        k = end.unwrap_or(n);
    }
}

/// The median of so many of each number.
fn median_of_counts(of_number: &[usize]) -> usize {
    let middle = of_number.iter().sum::<usize>() / 2;
    let mut below = 0;
    let reaches = |count: &usize| {
        below += count;
        below > middle
    };
    of_number.iter().position(reaches).unwrap_or(0)
}

/// Ends of the runs of equal values.
fn runs(signal: &[f64]) -> Vec<std::ops::Range<usize>> {
    let mut out = Vec::with_capacity(signal.len());
    let mut from = 0;
    for k in 1..=signal.len() {
        if k == signal.len() || signal[k] != signal[from] {
            out.push(from..k);
            from = k;
        }
    }
    out
}

impl Examined {
    fn mark_spikes(&mut self, least: f64, half: usize) {
        let u = &self.signal;
        let n = u.len();
        if n < 2 * half + 2 {
            return;
        }
        let off = |k: usize| {
            // As many rows to both sides: at the ends of a slope the middle one is not the median of the others.
            let half = half.min(k).min(n - 1 - k);
            let mut window = [0.0; 2 * HALF_WINDOW + 1];
            let window = &mut window[..=2 * half];
            window.copy_from_slice(&u[k - half..=k + half]);
            (u[k] - median(window)).abs()
        };
        // Where the signal hardly bends, its own neighbours say enough: the median is taken of those that may be one.
        let suspects: Vec<(usize, f64)> = (0..n)
            .filter(|&k| {
                let near = u[k.saturating_sub(1)];
                let after = u[(k + 1).min(n - 1)];
                (u[k] - near).abs() > 0.5 * least || (u[k] - after).abs() > 0.5 * least
            })
            .map(|k| (k, off(k)))
            .collect();
        let mut all: Vec<f64> = if suspects.len() > n / 4 {
            suspects.iter().map(|s| s.1).collect()
        } else {
            vec![0.0]
        };
        let scale = 1.4826 * median(&mut all);
        let beyond = (SPIKE * scale).max(least);
        for (k, off) in suspects {
            if off > beyond && !self.bad[k] {
                self.bad[k] = true;
                self.faults.spikes += 1;
            }
        }
    }

    /// Runs of equal values: a sensor that is stuck, slower than the log, or coarse.
    fn mark_runs(&mut self, least: f64, lane: bool) {
        let n = self.signal.len();
        let runs = runs(&self.signal);
        // How many of the runs in which the signal moves have which length.
        let mut of_length = vec![0; n / 10];
        for run in &runs {
            if let Some(count) = of_length.get_mut(run.len()) {
                *count += 1;
            }
        }
        let moving: usize = of_length.iter().sum();
        if moving < 3 {
            return;
        }
        let usual = median_of_counts(&of_length);
        let rows: usize = of_length.iter().enumerate().map(|(l, count)| l * count).sum();
        let repeats = rows - moving;
        let stepped = repeats as f64 > STEPPED * rows as f64;
        let regular = of_length[usual] as f64 > 0.8 * moving as f64;
        if !lane {
        } else if usual >= 2 && regular {
            // The value is that of the row in which it came.
            self.faults.held_rows = usual;
            for run in &runs {
                for k in run.start + 1..run.end {
                    self.weight[k] = 0.0;
                }
            }
        } else if stepped {
            self.steps(&runs);
        }
        let seldom = (repeats as f64) < 0.05 * n as f64;
        let step = self.faults.step;
        for run in runs.iter().filter(|r| r.start > 0 && r.end < n) {
            let value = self.signal[run.start];
            let jump = (self.signal[run.start - 1] - value)
                .abs()
                .min((self.signal[run.end] - value).abs());
            let longer = run.len() >= STUCK_ROWS.max(3 * usual);
            let stuck = (seldom && run.len() >= STUCK_ROWS && jump > 0.2 * least)
                || (longer && jump > least.max(3.0 * step))
                || (self.faults.held_rows > 0 && run.len() >= 3 * usual);
            if stuck {
                for k in run.clone() {
                    if !self.bad[k] {
                        self.bad[k] = true;
                        self.faults.stuck += 1;
                    }
                }
            }
        }
    }

    /// A signal in steps says most where it steps: there it was half way between the two values. Between, it says
    /// only that it is within half a step, once for the whole run.
    fn steps(&mut self, runs: &[std::ops::Range<usize>]) {
        let mut changes: Vec<f64> = runs
            .windows(2)
            .map(|w| (self.signal[w[1].start] - self.signal[w[0].start]).abs())
            .collect();
        let step = median(&mut changes);
        self.faults.step = step;
        let original = self.signal.clone();
        for run in runs {
            for k in run.clone() {
                self.weight[k] = 0.12 / run.len() as f64;
            }
        }
        for pair in runs.windows(2) {
            let k = pair[1].start;
            let change = (original[k] - original[k - 1]).abs();
            if change < 1.5 * step && !self.bad[k] && !self.bad[k - 1] {
                let middle = 0.5 * (original[k] + original[k - 1]);
                // It passed between the two rows.
                for j in [k - 1, k] {
                    self.signal[j] = middle;
                    self.weight[j] = 1.0;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A probe of 0.2 N.m at 2.5 Hz with one row off by 0.3 N.m, at 120 and at 30 rows a second: that row is out of line, and no other.
    #[test]
    fn the_peaks_of_a_probe_are_no_spikes() {
        for rate_hz in [120.0, 60.0, 30.0] {
            let sine = |k: usize| 0.2 * (std::f64::consts::TAU * 2.5 * k as f64 / rate_hz).sin();
            let mut torque: Vec<f64> = (0..1200).map(sine).collect();
            torque[601] += 0.3;
            let found = examine(&torque, 1.0 / rate_hz, 0.06, false);
            assert_eq!(found.faults.spikes, 1, "{rate_hz} Hz");
            assert!(found.bad[601]);
        }
    }
}
