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
//! What is assumed: K_nms, and t_nms. An arm with another t_nms, 0.06 to 0.15 s, makes an error in proportion to K_hg; the
//! deviation that is reported is that of the noise plus the largest such error. So it is wide for drivers who resist: 0.39 of K_hg at
//! 2.5 Hz. (An identification from a whole record tells t_nms too.) A driver who relies on the guidance fully, K_hg 0,
//! is told from hands off by T_d itself: where it stays within 0.012 N.m for half a block there are no hands, and no reading.
//!
//! Advisory, and outside the torque path: it computes in f32, with additions, multiplications and divisions
//! only, none of which is fused, so that host and target agree to the last bit; the one root is micromath's, which is such arithmetic too. The work at the end of a
//! block is spread over later steps without a sample, one comparison each: with a sample in every other step no
//! step costs 400 instructions (`tests/pil.rs` counts them on the target).
//!
//! Not here: when to run. Without a probe there is nothing to read, and the ECU starts anew with the next.

#![expect(
    clippy::as_conversions,
    clippy::float_arithmetic,
    reason = "the estimate of K_hg is in f32; it moves nothing, and runs when the torque is on its way"
)]

mod average;
pub(crate) mod background;

use crate::law::sine::{QUARTER, sine};
use crate::quantity::{Instant, Radians, Ratio, Torque};
use average::{Average, Change, Work};

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
    /// Largest error of K_hg, as a share of it, that another t_nms of [`T_NMS_RANGE_S`] makes.
    pub(crate) muscle: f32,
}

/// What t_nms drivers' arms have, s: the deviation that is reported holds the error that any of them makes.
pub const T_NMS_RANGE_S: [f64; 2] = [0.06, 0.15];

/// T_d that stays within this band for half a block is of nobody's hands: 0.012 N.m, the sensor's last digit up and down,
/// in units of 2^-24 N.m.
const QUIET: i32 = 201_327;

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
    /// The last T_d.
    torque: i32,
    /// Lowest and highest T_d of this half of a block.
    band: [i32; 2],
    /// Nobody's hands in the half before.
    quiet: bool,
    /// The block that ended and was not read yet.
    ended: Option<Block>,
    work: Work,
    /// The last step left the work alone.
    spared: bool,
    average: Average,
    reading: Option<Reading>,
}

/// Before the first sample.
const NO_BAND: [i32; 2] = [i32::MAX, i32::MIN];

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

/// A block lasts the whole number of periods that is nearest to this, s.
pub(crate) const BLOCK_S: f64 = 2.0;
/// A block in which limits left less than half of the probe says nothing.
const LEAST_SHARE: f32 = 0.5;

impl Estimator {
    /// Nothing seen yet.
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
        // A sample is work enough for a step, but must not keep the rest waiting if there is one in every step.
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
        let (quiet, before) = (high.saturating_sub(low) < QUIET, state.quiet);
        (state.band, state.quiet) = (NO_BAND, quiet);
        if quiet || before {
            // A driver who relies on the guidance fully moves the wheel all the same; nobody's hands do not. What was
            // read before is no evidence of who takes it next.
            state.average = Average::new(self.amplitude_nm);
            (state.reading, state.ended) = (None, None);
            state.work = Work::Nothing;
        } else if ended.whole {
            state.ended = Some(ended);
        }
    }

    /// The next piece of what a block that has ended leaves to do. Apart, so that a step without any is short.
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
                    sum: 0.0,
                    best: Change::default(),
                }
            }
            Work::Compare { length, sum, best } => state.average.compare(length, sum, best),
            Work::Conclude(change) => {
                state.reading = state.average.conclude(change, self.muscle);
                Work::Nothing
            }
        };
    }

    /// Adds a sample to both blocks; returns the one that ended before it, whole or not. Apart, as [`Self::go_on`].
    #[inline(never)]
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
        state.torque = sample.driver_torque.bits();
        ended
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
        ((power > 0.0) & (power >= least * least)).then(|| -(re * applied.re + im * applied.im) / power)
    }
}

impl EstimatorState {
    /// The estimate, once there is one.
    #[must_use]
    pub fn reading(&self) -> Option<Reading> {
        self.reading
    }
}

/// The sine as a float: the probe's own, good to 7e-7 in 30 instructions. micromath's is good to 2e-3 in 33, and with it
/// three drives of 267 in `core/tests/estimator.rs` are read with another change of K_hg than the rule has.
fn unit(phase: u32) -> f32 {
    const SCALE: f32 = 1.0 / (1 << 30) as f32;
    sine(phase).to_bits() as f32 * SCALE
}
