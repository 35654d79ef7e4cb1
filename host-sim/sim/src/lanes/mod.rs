//! Lanes: several runs side by side in one thread, each to the same bits as alone.
//!
//! World and ECU of [`LANES`] runs are kept as a structure of arrays, so that an instruction moves four or eight of them at
//! once. The widest instructions that the machine has are chosen when a program runs; sums and products are the same in the
//! same order at any width, and none is contracted. Where a quotient by a constant is a product (`divide`), it is the same
//! quotient. A lane whose run ended takes the next one.
//!
//! The ECU in here is a lean one: it does what the shipping one does while nothing is wrong. Whatever could end guidance is
//! watched a little more strictly than the shipping ECU watches it, and the run of a lane in which it could is *suspect*:
//! it is given back to be driven by [`simulate`](crate::simulation::simulate). So is a run that leaves the road. What
//! lanes cannot drive at all, [`why_not`] names.
//!
//! - [`drive`]: runs of many scenarios.
//! - [`why_not`]: what keeps a scenario out.
//!
//! Not here: metrics, threads, and whether a lane's run is what the shipping ECU makes of it (`haptic-batch` drives one in
//! some anew).

#![expect(
    clippy::needless_range_loop,
    clippy::manual_clamp,
    reason = "a loop over lanes indexes many arrays at once, and a clamp that panics is no clamp for several lanes"
)]

mod band;
mod checks;
mod counts;
mod divide;
mod ecu;
mod gate;
mod points;
mod probe;
mod real;
mod runs;
mod sensing;
mod speeds;
#[cfg(test)]
mod tests;
mod tracked;
mod world;

use multiversion::multiversion;
use multiversion::target::target_cfg_f;

use crate::models::STEP_S;
use crate::scenario::Scenario;
use crate::simulation::Run;
use runs::Lanes;

pub use gate::{Reason, why_not};

/// Runs side by side.
pub const LANES: usize = 8;
/// All bits of a lane that is under way.
const ALIVE: u64 = u64::MAX;

/// Where the widest vectors lie within one line of the cache. What a step keeps on the stack is in it: with one such
/// local the compiler aligns its own spilled vectors too, which it otherwise does not.
#[repr(C, align(64))]
struct Aligned<T>(T);

/// Which instructions move the lanes.
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

/// Drives scenarios side by side. For each, in no order, `done` gets its number and its run, or `None` for one that is
/// suspect or that [`why_not`] keeps out. The run's samples are used again when `done` returns.
pub fn drive(scenarios: &[Scenario], width: Width, mut done: impl FnMut(usize, Option<&Run>)) {
    let mut waiting = Vec::with_capacity(scenarios.len());
    for (number, scenario) in scenarios.iter().enumerate() {
        if why_not(scenario).is_none() {
            waiting.push((number, scenario));
        } else {
            done(number, None);
        }
    }
    waiting.reverse();
    let whole = waiting
        .iter()
        .map(|(_, scenario)| (scenario.driver().t_p / STEP_S) as usize);
    let Some(whole) = whole.max() else { return };
    let mut lanes = Lanes::<LANES>::new(whole + 1, waiting[0].1);
    loop {
        let mut is_empty = true;
        for lane in 0..LANES {
            if lanes.is_free(lane) {
                if let Some((number, run)) = lanes.take(lane) {
                    done(number, run);
                }
                if let Some((number, scenario)) = waiting.pop() {
                    lanes.begin(lane, number, scenario);
                }
            }
            is_empty &= !lanes.is_under_way(lane);
        }
        if is_empty {
            return;
        }
        match width {
            Width::Widest => block(&mut lanes),
            Width::Avx2 => block_of_avx2(&mut lanes),
            Width::Portable => lanes.block::<false>(),
        }
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl+fma", "x86_64+avx2+fma"))]
fn block(lanes: &mut Lanes<LANES>) {
    lanes.block::<{ target_cfg_f!(target_feature = "fma") }>();
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn block_of_avx2(lanes: &mut Lanes<LANES>) {
    lanes.block::<{ target_cfg_f!(target_feature = "fma") }>();
}
