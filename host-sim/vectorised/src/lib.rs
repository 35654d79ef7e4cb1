//! Vectorised runs: several runs side by side in one thread, each to the same bits as alone.
//!
//! World and ECU of [`BATCH`] runs are kept as a structure of arrays, so that an instruction moves four or eight of them at
//! once: each run has a lane of the vector registers. The widest instructions that the machine has are chosen when a
//! program runs; sums and products are the same in the same order at any width, and no product is fused with a
//! sum. A lane whose run ended takes the next one.
//!
//! The ECU in here is a lean one: it does what the shipping one does while nothing is wrong. Whatever could end guidance is
//! watched a little more strictly than the shipping ECU watches it, with core's own constants, and a run in which it could
//! is *rejected*, to be driven by [`simulate`](haptic_sim::simulate). So is a run that leaves the road. What cannot be
//! vectorised at all, [`unsupported_reason`] names.
//!
//! - [`run_batch`]: runs of many scenarios, with every step reported where that is asked for.
//! - [`Reason`]: why a run is rejected.
//!
//! Not here: metrics, threads, and whether a run is what the shipping ECU makes of it (`haptic-batch` drives one in some
//! anew).

#![expect(
    clippy::needless_range_loop,
    clippy::manual_clamp,
    reason = "a loop over lanes indexes many arrays at once, and a clamp that panics is no clamp for several lanes"
)]

mod band;
mod checks;
mod coast;
mod counts;
mod ecu;
mod lanes;
mod nonlinear;
mod points;
mod probe;
mod rejected;
mod runs;
mod sensing;
mod speeds;
#[cfg(test)]
mod tests;
mod tracked;
mod world;

use multiversion::multiversion;

use haptic_sim::models::STEP_S;
use haptic_sim::models::plant::{ARM, BETA, WHEEL, WHEEL_RATE, YAW, YAW_RATE};
use haptic_sim::scenario::Scenario;
use haptic_sim::simulation::{Outcome, Run};
use runs::Runs;

pub use rejected::{Reason, unsupported_reason};

/// Runs side by side.
pub const BATCH: usize = 8;

/// All bits of a lane that is under way.
const ALIVE: u64 = u64::MAX;

/// The first where all bits of the mask are set, the second where none is: as a choice the compiler makes a masked store
/// of it, which some processors take long for.
#[inline(always)]
fn either(mask: u64, a: f64, b: f64) -> f64 {
    f64::from_bits((a.to_bits() & mask) | (b.to_bits() & !mask))
}

/// Where the widest vectors lie within one line of the cache. What a step keeps on the stack is in it: with one such
/// local the compiler aligns its own spilled vectors too, which it otherwise does not.
#[repr(C, align(64))]
struct Aligned<T>(T);

/// Which instructions move a batch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Width {
    /// The widest that the machine has.
    #[default]
    Widest,
    /// AVX2 at most.
    Avx2,
    /// What every machine has.
    Portable,
}

/// What is asked of a batch beside its runs.
#[derive(Debug, Clone, Copy, Default)]
pub struct Options {
    /// Which instructions move them.
    pub width: Width,
    /// Every step is reported.
    pub every_step: bool,
    /// Runs are cut after so many seconds; none: they go to their ends.
    pub most_s: Option<u32>,
}

/// The truth of one step, as the plant moves on from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Its number.
    pub step: u32,
    /// Lane errors at the driver's points, m and rad.
    pub e_y_m: f64,
    /// See `e_y_m`.
    pub e_theta_rad: f64,
    /// Angle of the steering wheel, rad.
    pub wheel_angle_rad: f64,
    /// Torque of the guidance that acts, N.m.
    pub guidance_torque_nm: f64,
    /// Torque of the driver, remnant and all, N.m.
    pub driver_torque_nm: f64,
}

impl From<&Outcome<'_>> for Step {
    /// The step of a run alone, without errors of sensors: what they have is what is true.
    fn from(outcome: &Outcome<'_>) -> Self {
        Self {
            step: outcome.observation.step,
            e_y_m: outcome.preview.e_y_m,
            e_theta_rad: outcome.preview.e_theta_rad,
            wheel_angle_rad: outcome.observation.wheel_angle_rad,
            guidance_torque_nm: outcome.applied_torque_nm,
            driver_torque_nm: outcome.observation.driver_torque_nm,
        }
    }
}

/// What comes of a run.
#[derive(Debug)]
pub enum Event<'a> {
    /// The next steps, in order, where every step is asked for. A run that is rejected may have had some.
    Steps(&'a [Step]),
    /// The whole run, or as much as was asked for. Its samples are used again afterwards.
    Ended(&'a Run),
    /// The shipping ECU has to drive it: nothing that came of it here counts.
    Rejected(Reason),
}

/// Drives scenarios side by side; `on` gets everything that comes of each, its number first, in no order. A run's samples
/// are used again when `on` returns.
pub fn run_batch(scenarios: &[Scenario], options: Options, mut on: impl FnMut(usize, Event)) {
    let mut waiting = Vec::with_capacity(scenarios.len());
    for (number, scenario) in scenarios.iter().enumerate() {
        match unsupported_reason(scenario) {
            None => waiting.push((number, scenario)),
            Some(reason) => on(number, Event::Rejected(reason)),
        }
    }
    waiting.reverse();
    // The longest first: the last ones, beside which lanes go empty, are then short.
    waiting.sort_by(|(_, a), (_, b)| a.duration_s().total_cmp(&b.duration_s()));
    let whole = waiting
        .iter()
        .map(|(_, scenario)| (scenario.driver().t_p / STEP_S) as usize);
    let Some(whole) = whole.max() else { return };
    let mut runs = Runs::<BATCH>::new(whole + 1, waiting[0].1, options.every_step);
    let mut steps = Vec::new();
    loop {
        let mut is_empty = true;
        for lane in 0..BATCH {
            if let Some(number) = runs.steps_of_block(lane, &mut steps) {
                on(number, Event::Steps(&steps));
            }
            if let Some(most_s) = options.most_s {
                runs.cut(lane, most_s);
            }
            if runs.is_free(lane) {
                if let Some((number, run)) = runs.take(lane) {
                    on(number, run.map_or_else(Event::Rejected, Event::Ended));
                }
                if let Some((number, scenario)) = waiting.pop() {
                    runs.begin(lane, number, scenario);
                }
            }
            is_empty &= !runs.is_under_way(lane);
        }
        if is_empty {
            return;
        }
        match options.width {
            Width::Widest => block(&mut runs),
            Width::Avx2 => block_of_avx2(&mut runs),
            Width::Portable => runs.block(),
        }
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn block(runs: &mut Runs<BATCH>) {
    runs.block();
}

#[multiversion(targets("x86_64+avx2"))]
fn block_of_avx2(runs: &mut Runs<BATCH>) {
    runs.block();
}
