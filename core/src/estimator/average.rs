//! The readings of the blocks, averaged: all since the start or the last change, and how far to trust their mean.
//!
//! The work on a reading is cut into pieces, of which a step does one. Not here: what a reading is.

#![expect(
    clippy::float_arithmetic,
    reason = "the estimate of K_hg is in f32; it moves nothing, and runs when the torque is on its way"
)]

use heapless::Deque;
use micromath::F32Ext;

use super::Reading;
use crate::quantity::Ratio;

/// What is left to do for the last block.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Work {
    Nothing,
    /// Take a reading into the average.
    Average(f32),
    /// Look for a change before the last `length` readings, whose sum is `sum`; the best so far.
    Compare {
        length: u8,
        sum: f32,
        best: Change,
    },
    /// Drop the memory before the change, if it was one, and report.
    Conclude(Change),
}

/// A supposed change: its significance, 1 where it is one, and the mean and the number of readings since.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Change {
    significance: f32,
    mean: f32,
    count: u8,
}

/// The readings so far.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Average {
    mean: f32,
    /// Readings in the mean, at most [`MEMORY`].
    count: u8,
    /// Weighted sum of squared innovations, and the sum of the weights.
    squares: f32,
    weights: f32,
    /// Readings since the start, at most [`FIRST_REPORT`].
    total: u8,
    recent: Deque<f32, LONGEST>,
}

/// The average forgets beyond so many readings (40 s).
const MEMORY: u8 = 40;
/// No report before so many: 6 s.
const FIRST_REPORT: u8 = 5;
/// A change is looked for among so many of the last readings.
const LONGEST: usize = 14;
/// The fewest readings on either side of a change.
const SHORTEST: u8 = 3;
/// How many standard deviations the means before and after a change differ by, at least; more where few
/// readings are all there is. Noise alone drops the memory once in 15 minutes. Squared.
const CHANGE: f32 = 3.1 * 3.1;
const CHANGE_OF_FEW: f32 = 3.8 * 3.8;
/// So many are few no longer.
const FEW: u8 = 6;
/// Variance of a reading before the first one, at the amplitude of [`PRIOR_NM`], and how many readings this
/// prior counts for: 0.1 N.m of driver noise gives 0.15 to 0.2.
const PRIOR_VARIANCE: f32 = 0.18 * 0.18;
const PRIOR_NM: f32 = 0.2;
const PRIOR_WEIGHT: f32 = 8.0;
/// The spread is remembered over so many readings.
const SPREAD_MEMORY: f32 = 60.0;
/// An innovation counts for at most this many variances: a change is no spread.
const OUTLIER: f32 = 9.0;
/// Overlapping neighbours are correlated: the variance of a mean of n readings is 1.2/n of one's, and that of
/// the difference of two means 1.25 times what independent readings would have.
const OVERLAP_MEAN: f32 = 1.2;
const OVERLAP_DIFFERENCE: f32 = 1.25;
/// Deviation that no averaging takes away: the driver's eyes do play a small part.
const FLOOR: f32 = 0.02 * 0.02;
impl Average {
    /// No reading yet, from a probe of this amplitude.
    pub(super) fn new(amplitude_nm: f32) -> Self {
        let scale = PRIOR_NM / amplitude_nm;
        Self {
            mean: 0.0,
            count: 0,
            squares: PRIOR_WEIGHT * PRIOR_VARIANCE * scale * scale,
            weights: PRIOR_WEIGHT,
            total: 0,
            recent: Deque::new(),
        }
    }

    pub(super) fn take(&mut self, reading: f32) {
        if self.recent.is_full() {
            self.recent.pop_front();
        }
        // There is room: the oldest has just left.
        let _ = self.recent.push_back(reading);
        let count = f32::from(self.count);
        let innovation = reading - self.mean;
        if self.count > 0 {
            // Less the spread of the mean itself.
            let square = innovation * innovation * count / (count + 1.0);
            let square = square.min(OUTLIER * self.variance());
            let kept = 1.0 - 1.0 / SPREAD_MEMORY;
            self.squares = self.squares * kept + square;
            self.weights = self.weights * kept + 1.0;
        }
        self.count = self.count.saturating_add(1).min(MEMORY);
        self.total = self.total.saturating_add(1).min(FIRST_REPORT);
        self.mean += innovation / f32::from(self.count);
    }

    /// Variance of one reading.
    fn variance(&self) -> f32 {
        self.squares / self.weights
    }

    /// One more reading to the supposed new ones, and how significant a change before it would be.
    pub(super) fn compare(&self, length: u8, sum: f32, best: Change) -> Work {
        let next = self.recent.iter().rev().nth(usize::from(length));
        let length = length.saturating_add(1);
        let before = self.count.saturating_sub(length);
        let (Some(next), true) = (next, before >= SHORTEST) else {
            return Work::Conclude(best);
        };
        let sum = sum + next;
        let (new, old) = (f32::from(length), f32::from(before));
        let mean = sum / new;
        let mean_before = (f32::from(self.count) * self.mean - sum) / old;
        let difference = mean - mean_before;
        let variance = OVERLAP_DIFFERENCE * self.variance() * (1.0 / new + 1.0 / old);
        let least = if length < FEW { CHANGE_OF_FEW } else { CHANGE };
        let significance = difference * difference / (variance * least);
        let better = length >= SHORTEST && significance > best.significance;
        let best = if better {
            Change {
                significance,
                mean,
                count: length,
            }
        } else {
            best
        };
        Work::Compare { length, sum, best }
    }

    /// The report; by the share `muscle` of K_hg it may be wrong because of the arm's t_nms.
    pub(super) fn conclude(&mut self, change: Change, muscle: f32) -> Option<Reading> {
        if change.significance > 1.0 {
            (self.mean, self.count) = (change.mean, change.count);
        }
        let variance = OVERLAP_MEAN * self.variance() / f32::from(self.count) + FLOOR;
        // The other error is no noise: it is added to it, not to its square.
        let deviation = root(variance) + muscle * self.mean.abs();
        (self.total >= FIRST_REPORT).then(|| Reading {
            k_hg: Ratio::from_f32(self.mean),
            deviation: Ratio::from_f32(deviation),
        })
    }
}

/// The square root of what is above zero: never too small, and at most 0.18 % too large. micromath's is up to 6.1 % too
/// large; a step of Heron's rule leaves half of that squared.
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
