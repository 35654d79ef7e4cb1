//! Estimates while driving how much the driver relies on the guidance: K_hg of equation (8), from the probe.
//!
//! At the probe's frequency the driver's eyes and the vehicle's movement hardly matter, so equation (8) becomes
//! `K_hg = -((1 + j*w*t_nms)*T_d + K_nms*phi)/T_h`, where each symbol is the Fourier coefficient of the measured or
//! applied signal. The coefficients are taken over *blocks*: Hann windows of a whole number of probe periods, about 2
//! s long, each overlapping the last by half. The ratio over one block is one noisy *reading* of K_hg.
//!
//! The estimate is the average of all readings since the start or since the last change, with a memory of about 40
//! readings. A *change* is declared when the mean of the last 3 to 14 readings differs too much from the mean before
//! them (a generalised likelihood ratio); the readings before it are then dropped. The spread of the readings, which
//! comes from the driver's own noise, is estimated with a prior, and gives the standard deviation of the estimate.
//!
//! How right it is: docs/explanation/live-estimate.md.
//!
//! K_nms of the driver's arm is assumed, and so is a t_nms, give or take 0.03 s. With the arm's own t_nms the ratio
//! is real but for noise; with the assumed one it is off by `j*w*(t_nms - assumed)*T_d/T_h`. So the imaginary part of the
//! average tells t_nms, and that corrects the real part. What is not told of t_nms is in the deviation.
//!
//! A driver who relies fully on the guidance, K_hg 0, is distinguished from hands off by T_d: where T_d stays
//! within 0.012 N.m for half a block, nobody holds the wheel, and there is no reading.
//!
//! The estimate is advisory and outside the torque path. It is computed in f32 with additions, multiplications and
//! divisions only, none of them fused, so that host and target agree to the last bit; the one square root is
//! micromath's, which uses the same operations. The work at the end of a block is spread over later steps without a
//! sample, one comparison each. With a sample in every other step no step takes 400 instructions (`tests/pil.rs`
//! counts them on the target).
//!
//! Not here: when the estimator runs. Without a probe there is no reading, and the ECU starts the estimator anew with
//! the next probe.

#![expect(
    clippy::as_conversions,
    clippy::float_arithmetic,
    reason = "the estimate of K_hg is in f32; it moves nothing, and runs when the torque is on its way"
)]

mod average;
pub(crate) mod background;

use crate::law::sine::{QUARTER, sine};
use crate::quantity::{Instant, Radians, Ratio, Torque};
use average::{Answer, Average, Change, Work};

/// What the estimator knows of the probe and the driver's arm; immutable.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimator {
    /// Probe's phase per microsecond, in 2^-32 turns.
    pub(crate) phase_per_us: u32,
    /// Probe periods in a block.
    pub(crate) periods: u32,
    /// Probe's amplitude, N.m.
    pub(crate) amplitude_nm: f32,
    /// What makes of the measured T_d that of the arm in front of its muscles: `1 + j*w*t_nms`, times the lags of an observer.
    pub(crate) arm: Complex,
    /// What `arm` is more if t_nms is larger by [`T_NMS_SD_S`].
    pub(crate) slower: Complex,
    /// K_nms, N.m/rad.
    pub(crate) k_nms: f32,
    /// Variance of K_hg that averaging does not reduce, times the square of T_h per angle of the wheel: what is not known of a bar.
    pub(crate) unsure: f32,
    /// If T_d stays within this band for half a block, nobody holds the wheel.
    pub(crate) quiet: Torque,
}

/// Standard deviation of t_nms over drivers' arms, s: they have 0.06 to 0.15 s.
pub(crate) const T_NMS_SD_S: f64 = 0.03;

/// [`Estimator::quiet`] with a sensor of the hands' torque: 0.012 N.m, one digit of it up and down.
pub(crate) const QUIET: Torque = Torque::from_bits(201_327);

/// One sample of the column with the torque that was applied until then.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sample {
    /// When it was taken.
    pub at: Instant,
    /// T_h with the probe.
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
    /// Position in the window of the first block, in 2^-32 of its length; the second block is half a window later.
    window: u32,
    blocks: [Block; 2],
    /// The last T_d.
    torque: i32,
    /// Lowest and highest T_d of this half of a block.
    band: [i32; 2],
    /// Whether nobody held the wheel in the half before.
    quiet: bool,
    /// A block that has ended and has no reading yet.
    ended: Option<Block>,
    work: Work,
    /// Whether the last step did none of the remaining work.
    spared: bool,
    average: Average,
    reading: Option<Reading>,
}

/// An empty band, before the first sample.
const NO_BAND: [i32; 2] = [i32::MAX, i32::MIN];

/// Weighted sums over one block.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Block {
    /// Whether it began with its window.
    whole: bool,
    weight: f32,
    driver: Complex,
    wheel: Complex,
    applied: Complex,
}

#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Complex {
    pub(crate) re: f32,
    pub(crate) im: f32,
}

impl Complex {
    fn add(&mut self, weight: f32, term: Self) {
        self.re += weight * term.re;
        self.im += weight * term.im;
    }

    fn times(self, other: Self) -> Self {
        Self {
            re: self.re * other.re - self.im * other.im,
            im: self.re * other.im + self.im * other.re,
        }
    }
}

/// A block lasts the whole number of periods that is nearest to this, s.
pub(crate) const BLOCK_S: f64 = 2.0;
/// A block in which limits left less than this share of the probe gives no reading.
const LEAST_SHARE: f32 = 0.5;

impl Estimator {
    /// The state before the first sample.
    #[must_use]
    pub fn start(&self) -> EstimatorState {
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
            torque: 0,
            band: NO_BAND,
            quiet: false,
            ended: None,
            work: Work::Nothing,
            spared: false,
            average: Average::new(self.amplitude_nm),
            reading: None,
        }
    }

    /// One step while there is a probe, with the column's sample if there is a new one.
    pub fn step(&self, state: &mut EstimatorState, sample: Option<&Sample>) {
        // A step with a sample does none of the remaining work, unless every step has a sample.
        state.spared = sample.is_some() && !state.spared;
        if !state.spared {
            let [low, high] = state.band;
            state.band = [low.min(state.torque), high.max(state.torque)];
            if state.ended.is_some() || !matches!(state.work, Work::Nothing) {
                self.go_on(state);
            }
        }
        let Some(ended) = sample.and_then(|sample| self.add(state, sample)) else {
            return;
        };
        let [low, high] = state.band;
        let (quiet, before) = (high.saturating_sub(low) < self.quiet.bits(), state.quiet);
        (state.band, state.quiet) = (NO_BAND, quiet);
        if quiet || before {
            // Even a driver who relies fully on the guidance changes the torque a little; a free wheel does not.
            // Earlier readings are no evidence of who takes the wheel next.
            state.average = Average::new(self.amplitude_nm);
            (state.reading, state.ended) = (None, None);
            state.work = Work::Nothing;
        } else if ended.whole {
            state.ended = Some(ended);
        }
    }

    /// Does the next piece of the work that an ended block leaves. It is not inlined, so that steps without such work
    /// stay short.
    #[inline(never)]
    fn go_on(&self, state: &mut EstimatorState) {
        state.work = match state.work {
            Work::Nothing => {
                let reading = state.ended.as_ref().and_then(|block| self.reading(block));
                state.ended = None;
                reading.map_or(Work::Nothing, Work::Average)
            }
            Work::Average(reading) => {
                state.average.take(reading);
                Work::Compare {
                    length: 0,
                    sum: Answer::default(),
                    best: Change::default(),
                }
            }
            Work::Compare { length, sum, best } => state.average.compare(length, sum, best),
            Work::Conclude(change) => {
                state.reading = state.average.conclude(change);
                Work::Nothing
            }
        };
    }

    /// Adds a sample to both blocks, and returns the block that ended before it, if one did. It is not inlined, like
    /// [`Self::go_on`].
    #[inline(never)]
    fn add(&self, state: &mut EstimatorState, sample: &Sample) -> Option<Block> {
        // 2^32 us are a whole number of turns, so the phase does not jump when the clock wraps.
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
        state.torque = sample.driver_torque.bits();
        ended
    }

    /// The reading of a block, if enough of the probe was applied in it.
    fn reading(&self, block: &Block) -> Option<Answer> {
        let (applied, square) = (block.applied, |of: Complex| of.re * of.re + of.im * of.im);
        let power = square(applied);
        // The coefficient of a sine is half its amplitude times the sum of the window's weights.
        let least = LEAST_SHARE * 0.5 * self.amplitude_nm * block.weight;
        ((power > 0.0) & (power >= least * least)).then(|| {
            // -1/T_h.
            let per_applied = Complex {
                re: -applied.re / power,
                im: applied.im / power,
            };
            let mut right = self.arm.times(block.driver);
            right.add(self.k_nms, block.wheel);
            Answer {
                k_hg: right.times(per_applied),
                slower: self.slower.times(block.driver).times(per_applied),
                unsure: self.unsure * square(block.wheel) / power,
            }
        })
    }
}

impl EstimatorState {
    /// The estimate, if there is one yet.
    #[must_use]
    pub fn reading(&self) -> Option<Reading> {
        self.reading
    }
}

/// The sine as a float, from the probe's own: its error is 7e-7, and it takes 30 instructions. micromath's has an
/// error of 2e-3 and takes 33; with it three of 267 drives in `core/tests/estimator.rs` show another change of K_hg
/// than the rule gives.
fn unit(phase: u32) -> f32 {
    const SCALE: f32 = 1.0 / (1 << 30) as f32;
    sine(phase).to_bits() as f32 * SCALE
}
