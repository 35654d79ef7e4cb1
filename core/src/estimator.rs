//! How much the driver relies on the guidance, live: K_hg of equation (8), from the probe.
//!
//! At the probe's frequency the driver's eyes and the vehicle play no part, so equation (8) leaves
//! `K_hg = -((1 + j*w*t_nms)*T_d + K_nms*phi)/T_h`, each symbol the Fourier coefficient of what was really
//! measured and applied. It is taken over *blocks*: Hann windows of a whole number of probe periods, about
//! 2 s, each overlapping the last by half. The real part of a block's ratio is one noisy reading.
//!
//! Readings are averaged: all since the start or the last change, of late the last 40 or so. A *change* is
//! declared when the mean of the last 3 to 14 readings is too far from the mean before them (a generalised
//! likelihood ratio); the memory before it is dropped. The spread of the readings, which the driver's own
//! noise decides, is estimated with a prior, and gives the deviation of the estimate.
//!
//! | figure, pooled over 14 drivers with 0.1 N.m of noise, 0.2 N.m at 2.5 Hz | after 10 s | after 30 s |
//! |---|---|---|
//! | bias | -0.002 | -0.003 |
//! | RMS error | 0.072 | 0.043 |
//! | share within 1.96 deviations | 0.95 | 0.95 |
//!
//! (`host-sim reliance` makes this table; `tests/reliance.rs` asserts a part of it.)
//!
//! Advisory, and outside the torque path: it computes in f32, with additions, multiplications and divisions
//! only, none of which is fused, so that host and target agree to the last bit. The work at the end of a
//! block is spread over later steps without a sample, one comparison each: with a sample in every other step no
//! step costs 400 instructions (`tests/pil.rs` counts them on the target).
//!
//! Not here: when to run. Without a probe there is nothing to read, and the ECU starts anew with the next.

use heapless::Deque;

use crate::quantity::{Instant, Radians, Ratio, Torque};
use crate::sine::{ONE, QUARTER, sine};

/// What the estimator knows of the probe and the driver's arm; immutable.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimator {
    /// Probe's phase per microsecond, in 2^-32 turns.
    pub(crate) phase_per_us: u32,
    /// Probe periods in a block.
    pub(crate) periods: u32,
    /// Probe's amplitude, N.m.
    pub(crate) amplitude_nm: f32,
    /// `w*t_nms`.
    pub(crate) lag: f32,
    /// K_nms, N.m/rad.
    pub(crate) k_nms: f32,
}

/// One sample of the column with the torque that was applied until then.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sample {
    /// When.
    pub at: Instant,
    /// T_h, probe and all.
    pub applied: Torque,
    /// T_d.
    pub driver_torque: Torque,
    /// phi.
    pub wheel_angle: Radians,
}

/// An estimate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reading {
    /// K_hg; 0: the driver relies on the guidance, 1: resists it.
    pub k_hg: Ratio,
    /// Its standard deviation.
    pub deviation: Ratio,
}

/// What the estimator remembers.
#[derive(Debug, Clone, PartialEq)]
pub struct EstimatorState {
    last_phase: Option<u32>,
    /// Place in the first block's window, in 2^-32 of its length; the second is half a window apart.
    window: u32,
    blocks: [Block; 2],
    work: Work,
    /// The last step left the work alone.
    spared: bool,
    average: Average,
    reading: Option<Reading>,
}

/// Sums of one block, with its window.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Block {
    /// Whether it was there from the beginning of its window.
    whole: bool,
    weight: f32,
    driver: Complex,
    wheel: Complex,
    applied: Complex,
}

#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Complex {
    re: f32,
    im: f32,
}

impl Complex {
    fn add(&mut self, weight: f32, term: Self) {
        self.re += weight * term.re;
        self.im += weight * term.im;
    }
}

/// What is left to do for the last block.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Work {
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
struct Change {
    significance: f32,
    mean: f32,
    count: u8,
}

/// The readings so far.
#[derive(Debug, Clone, PartialEq)]
struct Average {
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

/// A block lasts the whole number of periods that is nearest to this, s.
pub(crate) const BLOCK_S: f64 = 2.0;
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
/// A block in which limits left less than half of the probe says nothing.
const LEAST_SHARE: f32 = 0.5;

impl Estimator {
    /// Nothing seen yet.
    #[must_use]
    pub fn start(&self) -> EstimatorState {
        let scale = PRIOR_NM / self.amplitude_nm;
        EstimatorState {
            last_phase: None,
            window: 0,
            blocks: [
                Block {
                    whole: true,
                    ..Block::default()
                },
                Block::default(),
            ],
            work: Work::Nothing,
            spared: false,
            average: Average {
                mean: 0.0,
                count: 0,
                squares: PRIOR_WEIGHT * PRIOR_VARIANCE * scale * scale,
                weights: PRIOR_WEIGHT,
                total: 0,
                recent: Deque::new(),
            },
            reading: None,
        }
    }

    /// One step while there is a probe, with the column's sample if there is a new one.
    pub fn step(&self, state: &mut EstimatorState, sample: Option<&Sample>) {
        // A sample is work enough for a step, but must not keep the rest waiting if there is one in every step.
        state.spared = sample.is_some() && !state.spared;
        state.work = match state.work {
            work if state.spared => work,
            Work::Nothing => Work::Nothing,
            Work::Average(reading) => {
                state.average.take(reading);
                Work::Compare {
                    length: 0,
                    sum: 0.0,
                    best: Change::default(),
                }
            }
            Work::Compare { length, sum, best } => state.average.compare(length, sum, best),
            Work::Conclude(change) => {
                state.reading = state.average.conclude(change);
                Work::Nothing
            }
        };
        let ended = sample.and_then(|sample| self.add(state, sample));
        if let Some(reading) = ended.and_then(|block| self.reading(&block)) {
            state.work = Work::Average(reading);
        }
    }

    /// Adds a sample to both blocks; returns the one that ended before it.
    fn add(&self, state: &mut EstimatorState, sample: &Sample) -> Option<Block> {
        // 2^32 us are a whole number of turns, so that the clock's wrap is none of the phase.
        let phase = self.phase_per_us.wrapping_mul(sample.at.us());
        let advance = phase.wrapping_sub(state.last_phase.unwrap_or(phase));
        state.last_phase = Some(phase);
        let before = state.window;
        state.window = before.wrapping_add(advance.checked_div(self.periods).unwrap_or(0));

        let [first, second] = &mut state.blocks;
        let whole = Block {
            whole: true,
            ..Block::default()
        };
        let ended = match (before >> 31, state.window >> 31) {
            (1, 0) => Some(core::mem::replace(first, whole)),
            (0, 1) => Some(core::mem::replace(second, whole)),
            _ => None,
        };
        let (cos, sin) = (unit(phase.wrapping_add(QUARTER)), unit(phase));
        let turned = |value: f32| Complex {
            re: value * cos,
            im: -value * sin,
        };
        let driver = turned(sample.driver_torque.to_f32());
        let wheel = turned(sample.wheel_angle.to_f32());
        let applied = turned(sample.applied.to_f32());
        // Two Hann windows half a length apart add up to one.
        let weight = 0.5 - 0.5 * unit(state.window.wrapping_add(QUARTER));
        for (block, weight) in [(first, weight), (second, 1.0 - weight)] {
            block.weight += weight;
            block.driver.add(weight, driver);
            block.wheel.add(weight, wheel);
            block.applied.add(weight, applied);
        }
        ended.filter(|block| block.whole)
    }

    /// What a whole block says, if there was enough of a probe in it.
    fn reading(&self, block: &Block) -> Option<f32> {
        let Block {
            driver,
            wheel,
            applied,
            ..
        } = block;
        let re = driver.re - self.lag * driver.im + self.k_nms * wheel.re;
        let im = driver.im + self.lag * driver.re + self.k_nms * wheel.im;
        let power = applied.re * applied.re + applied.im * applied.im;
        // A sine's coefficient is half its amplitude times the sum of the window.
        let least = LEAST_SHARE * 0.5 * self.amplitude_nm * block.weight;
        (power > 0.0 && power >= least * least).then(|| -(re * applied.re + im * applied.im) / power)
    }
}

impl EstimatorState {
    /// The estimate, once there is one.
    #[must_use]
    pub fn reading(&self) -> Option<Reading> {
        self.reading
    }
}

impl Average {
    fn take(&mut self, reading: f32) {
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
    fn compare(&self, length: u8, sum: f32, best: Change) -> Work {
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

    fn conclude(&mut self, change: Change) -> Option<Reading> {
        if change.significance > 1.0 {
            (self.mean, self.count) = (change.mean, change.count);
        }
        let variance = OVERLAP_MEAN * self.variance() / f32::from(self.count) + FLOOR;
        // An integer root is exact, and the same everywhere: 2^-28 in, 2^-14 out.
        let deviation = ((variance * 268_435_456.0) as u32).isqrt();
        (self.total >= FIRST_REPORT).then(|| Reading {
            k_hg: Ratio::from_f32(self.mean),
            deviation: Ratio::from_wide(i64::from(deviation) << 10),
        })
    }
}

/// The sine as a float.
fn unit(phase: u32) -> f32 {
    const SCALE: f32 = 1.0 / ONE as f32;
    sine(phase) as f32 * SCALE
}
