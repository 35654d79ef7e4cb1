//! Averages the readings of the blocks since the start or the last change, and estimates the deviation of their mean.
//!
//! The work on a reading is divided into pieces, of which each step does one. Not here: how a reading is computed.

#![expect(
    clippy::float_arithmetic,
    reason = "the estimate of K_hg is in f32; it moves nothing, and runs when the torque is on its way"
)]

use heapless::Deque;
use micromath::F32Ext;

use super::{Complex, Reading};
use crate::quantity::Ratio;

/// The work that is left for the last block.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Work {
    Nothing,
    /// Take a reading into the average.
    Average(Answer),
    /// Test for a change before the last `length` readings, whose sum is `sum`; `best` is the most significant change
    /// so far.
    Compare {
        length: u8,
        sum: Answer,
        best: Change,
    },
    /// Drop the readings before the change, if it is significant, and report.
    Conclude(Change),
}

/// What a block tells of the driver, or the mean or the sum of several.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Answer {
    /// K_hg with the assumed t_nms; noise and another t_nms make it complex.
    pub(super) k_hg: Complex,
    /// By how much it is more with a t_nms that is larger by one deviation of the prior.
    pub(super) slower: Complex,
    /// Variance of K_hg by what is not known of a bar.
    pub(super) unsure: f32,
}

impl Answer {
    fn add(&mut self, weight: f32, other: &Self) {
        self.k_hg.add(weight, other.k_hg);
        self.slower.add(weight, other.slower);
        self.unsure += weight * other.unsure;
    }
}

/// A possible change: its significance, which is above 1 for a real one, and the sum and the number of the readings
/// after it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Change {
    significance: f32,
    sum: Answer,
    count: u8,
}

/// The average of the readings so far.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Average {
    mean: Answer,
    /// Readings in the mean, at most [`MEMORY`].
    count: u8,
    /// Weighted sum of squared innovations, and the sum of the weights.
    squares: f32,
    weights: f32,
    /// Readings since the start, at most [`FIRST_REPORT`].
    total: u8,
    recent: Deque<Answer, LONGEST>,
}

/// Memory of the average in readings (40 s).
const MEMORY: u8 = 40;
/// The first report comes after this many readings: 6 s.
const FIRST_REPORT: u8 = 5;
/// The longest run of last readings that is tested for a change.
const LONGEST: usize = 14;
/// The fewest readings on either side of a change.
const SHORTEST: u8 = 3;
/// How many standard deviations the means before and after a change differ by at least, squared; more where there are
/// few readings after it. Noise alone triggers this once in 15 minutes.
const CHANGE: f32 = 3.1 * 3.1;
const CHANGE_OF_FEW: f32 = 3.8 * 3.8;
/// From this number on readings are no longer few.
const FEW: u8 = 6;
/// Prior of the variance of a reading, with a probe of [`PRIOR_NM`], and how many readings this prior counts as. With
/// 0.1 N.m of driver noise the deviation of a reading is 0.15 to 0.2.
const PRIOR_VARIANCE: f32 = 0.18 * 0.18;
const PRIOR_NM: f32 = 0.2;
const PRIOR_WEIGHT: f32 = 8.0;
/// Memory of the variance in readings.
const SPREAD_MEMORY: f32 = 60.0;
/// A squared deviation from the mean counts as at most this many variances, so that a change of K_hg does not enlarge
/// the variance.
const OUTLIER: f32 = 9.0;
/// Neighbouring blocks overlap, so their readings are correlated. The variance of the mean of n readings is 1.2/n
/// times that of one, and the variance of the difference of two means is 1.25 times that with independent readings.
const OVERLAP_MEAN: f32 = 1.2;
const OVERLAP_DIFFERENCE: f32 = 1.25;
/// Variance that averaging does not reduce: the driver's eyes have a small influence after all.
const FLOOR: f32 = 0.02 * 0.02;
impl Average {
    /// An average without readings, for a probe of this amplitude.
    pub(super) fn new(amplitude_nm: f32) -> Self {
        let scale = PRIOR_NM / amplitude_nm;
        Self {
            mean: Answer::default(),
            count: 0,
            squares: PRIOR_WEIGHT * PRIOR_VARIANCE * scale * scale,
            weights: PRIOR_WEIGHT,
            total: 0,
            recent: Deque::new(),
        }
    }

    pub(super) fn take(&mut self, reading: Answer) {
        if self.recent.is_full() {
            self.recent.pop_front();
        }
        // There is room, as the oldest was removed.
        let _ = self.recent.push_back(reading);
        let count = f32::from(self.count);
        let mut innovation = reading;
        innovation.add(-1.0, &self.mean);
        if self.count > 0 {
            // Corrected for the variance of the mean itself.
            let square = innovation.k_hg.re * innovation.k_hg.re * count / (count + 1.0);
            let square = square.min(OUTLIER * self.variance());
            let kept = 1.0 - 1.0 / SPREAD_MEMORY;
            self.squares = self.squares * kept + square;
            self.weights = self.weights * kept + 1.0;
        }
        self.count = self.count.saturating_add(1).min(MEMORY);
        self.total = self.total.saturating_add(1).min(FIRST_REPORT);
        self.mean.add(1.0 / f32::from(self.count), &innovation);
    }

    /// Variance of one reading.
    fn variance(&self) -> f32 {
        self.squares / self.weights
    }

    /// Counts one more reading to those after a possible change, and tests how significant that change is.
    pub(super) fn compare(&self, length: u8, mut sum: Answer, best: Change) -> Work {
        let next = self.recent.iter().rev().nth(usize::from(length));
        let length = length.saturating_add(1);
        let before = self.count.saturating_sub(length);
        let (Some(next), true) = (next, before >= SHORTEST) else {
            return Work::Conclude(best);
        };
        sum.add(1.0, next);
        let (new, old) = (f32::from(length), f32::from(before));
        let mean_before = (f32::from(self.count) * self.mean.k_hg.re - sum.k_hg.re) / old;
        let difference = sum.k_hg.re / new - mean_before;
        let variance = OVERLAP_DIFFERENCE * self.variance() * (1.0 / new + 1.0 / old);
        let least = if length < FEW { CHANGE_OF_FEW } else { CHANGE };
        let significance = difference * difference / (variance * least);
        let better = length >= SHORTEST && significance > best.significance;
        let best = if better {
            Change {
                significance,
                sum,
                count: length,
            }
        } else {
            best
        };
        Work::Compare { length, sum, best }
    }

    /// Reports the estimate: the mean with the most probable t_nms.
    pub(super) fn conclude(&mut self, change: Change) -> Option<Reading> {
        if change.significance > 1.0 {
            (self.mean, self.count) = (Answer::default(), change.count);
            self.mean.add(1.0 / f32::from(change.count), &change.sum);
        }
        let Answer { k_hg, slower, unsure } = self.mean;
        let noise = OVERLAP_MEAN * self.variance() / f32::from(self.count) + FLOOR + unsure;
        // With the arm's own t_nms, larger by u deviations, the mean is k_hg + u*slower, whose imaginary part is noise alone. So
        // u is `by`, with the variance `left` that remains of the prior's 1.
        let square = noise + slower.im * slower.im;
        let (by, left) = (-k_hg.im * slower.im / square, noise / square);
        let deviation = root(noise + slower.re * slower.re * left);
        (self.total >= FIRST_REPORT).then(|| Reading {
            k_hg: Ratio::from_f32(k_hg.re + by * slower.re),
            deviation: Ratio::from_f32(deviation),
        })
    }
}

/// The square root of a positive number: never too small, and at most 0.18 % too large. micromath's root is up to 6.1
/// % too large; one step of Heron's rule leaves half the square of that error.
fn root(square: f32) -> f32 {
    let near = F32Ext::sqrt(square);
    0.5 * (near + square / near)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The deviation of a reading is 0.02 to 100; the error is the same for every four times of the argument.
    #[test]
    fn a_root_is_at_most_0_18_percent_too_large() {
        let (mut least, mut most, mut rough) = (f64::MAX, f64::MIN, f64::MIN);
        for step in 0..2_000_000_u32 {
            let square = f32::from_bits(FLOOR.to_bits() + 97 * step);
            let exact = f64::from(square).sqrt();
            let error = f64::from(root(square)) / exact - 1.0;
            (least, most) = (least.min(error), most.max(error));
            rough = rough.max(f64::from(F32Ext::sqrt(square)) / exact - 1.0);
        }
        // A float is good to 6e-8.
        assert!(least > -1e-7 && most < 0.0018, "{least:e} {most:e}");
        assert!(rough < 0.061 && most > 0.0017, "{rough:e} {most:e}");
    }
}
