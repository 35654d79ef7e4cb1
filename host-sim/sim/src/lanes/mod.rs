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
//! - [`drive_asked`]: the same, every step reported, or only the first seconds of each.
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
use crate::simulation::{Outcome, Run};
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

/// What is asked of the lanes beside runs.
#[derive(Debug, Clone, Copy, Default)]
pub struct Asked {
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
    /// Of a run alone, without errors of sensors: what they have is what is true.
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

/// What the lanes have of a run.
#[derive(Debug)]
pub enum Event<'a> {
    /// The next steps, in order, where every step is asked for. A run that is handed back may have had some.
    Steps(&'a [Step]),
    /// The whole run, or as much as was asked for. Its samples are used again afterwards.
    Ended(&'a Run),
    /// It is suspect, or [`why_not`] keeps it out: nothing that came of it counts.
    HandedBack,
}

/// Drives scenarios side by side. For each, in no order, `done` gets its number and its run, or `None` for one that is
/// suspect or that [`why_not`] keeps out. The run's samples are used again when `done` returns.
pub fn drive(scenarios: &[Scenario], width: Width, mut done: impl FnMut(usize, Option<&Run>)) {
    let asked = Asked {
        width,
        ..Asked::default()
    };
    drive_asked(scenarios, asked, |number, event| match event {
        Event::Steps(_) => (),
        Event::Ended(run) => done(number, Some(run)),
        Event::HandedBack => done(number, None),
    });
}

/// As [`drive`], with what else is asked: `on` gets everything that comes of each run, its number first.
pub fn drive_asked(scenarios: &[Scenario], asked: Asked, mut on: impl FnMut(usize, Event)) {
    let mut waiting = Vec::with_capacity(scenarios.len());
    for (number, scenario) in scenarios.iter().enumerate() {
        if why_not(scenario).is_none() {
            waiting.push((number, scenario));
        } else {
            on(number, Event::HandedBack);
        }
    }
    waiting.reverse();
    let whole = waiting
        .iter()
        .map(|(_, scenario)| (scenario.driver().t_p / STEP_S) as usize);
    let Some(whole) = whole.max() else { return };
    let mut lanes = Lanes::<LANES>::new(whole + 1, waiting[0].1, asked.every_step);
    let mut steps = Vec::new();
    loop {
        let mut is_empty = true;
        for lane in 0..LANES {
            if let Some(number) = lanes.steps_of_block(lane, &mut steps) {
                on(number, Event::Steps(&steps));
            }
            if let Some(most_s) = asked.most_s {
                lanes.cut(lane, most_s);
            }
            if lanes.is_free(lane) {
                if let Some((number, run)) = lanes.take(lane) {
                    on(number, run.map_or(Event::HandedBack, Event::Ended));
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
        match asked.width {
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
