//! The rows that a target has to show as well: the same runs, with the image in QEMU in the place of the ECU.
//!
//! The closed loop runs here. What its ECU received goes to the target tick by tick, on the same clock, and every
//! frame that comes back has to be the host's, byte for byte: what the invariant checker and the row have found about the one
//! then holds for the other.
//!
//! A flipped bit is the exception: it is flipped in the target's memory only, through the debugger's stub of QEMU, and
//! anywhere in the controller, also where no second copy guards it. From there on the target is judged by
//! itself: the checker's rules in every cycle, and either no torque frame changes at all or the first that does is the
//! latched zero of class C.
//!
//! Not here: what breaks the image and not the controller (watchdog, stack, processor fault): `tests/resets.rs`.

use haptic_core::bus::Frame;
use rand::rngs::Xoshiro256PlusPlus;
use rand::{RngExt, SeedableRng};

use super::bytes::{FAULT, Status};
use super::campaign::{self, Campaign};
use super::injection::{Injection, Inside};
use super::invariants::{InvariantChecker, Violation};
use super::table::{Expect, FaultCase};
use super::trial::World;
use super::trial_record::{EcuTrace, Tick};
use haptic_pil::PilError;
use haptic_pil::qemu::instructions;
use haptic_pil::stepped::Stepped;

/// A bit flips after at least so many ticks, and at most twice as many.
const BEFORE: usize = 50;
/// Ticks after a flip in which the target is watched, and those that it is still watched once it has stopped.
const WATCHED: usize = 150;
const STOPPED: usize = 50;
/// Frames that a bus of 500 kbit/s carries from one step to the next at most: 222 us each, and one may have begun before.
const CARRIED: usize = 5;

/// Runs each row with `seeds` in QEMU; `done` is called after every run.
///
/// # Errors
/// What is missing or fails on the way to a running image, and a target that stops answering.
pub fn run(
    world: &World,
    rows: &[&'static FaultCase],
    seeds: std::ops::Range<u64>,
    mut done: impl FnMut(),
) -> Result<Campaign, PilError> {
    let (mut in_lockstep, mut with_memory) = (None, None);
    let mut results = Vec::new();
    for row in rows {
        let flips = flips(row);
        let target = started(if flips { &mut with_memory } else { &mut in_lockstep }, flips)?;
        let mut outcomes = Vec::new();
        for seed in seeds.clone() {
            // The host's ECU stays whole where the target's memory is flipped.
            let whole = FaultCase {
                injections: &[],
                expect: Expect::OnlyRules,
                ..**row
            };
            let (mut outcome, trace) = world.trial(if flips { &whole } else { row }, seed, true);
            if let (None, Some(trace)) = (&outcome.failure, trace) {
                if flips {
                    let flipped = flip(target, &trace, row, seed)?;
                    (outcome.reaction_ms, outcome.failure) = (flipped.stopped_after_ms, flipped.failure);
                    outcome.cycles = flipped.cycles;
                    outcome.seen = outcome.reaction_ms.is_some();
                } else {
                    outcome.failure = compare(target, &trace)?.0;
                }
            }
            outcomes.push(outcome);
            done();
        }
        results.push(campaign::result(
            row,
            &outcomes,
            world.drivers().limits(),
            " --target",
        ));
    }
    for target in [in_lockstep, with_memory].into_iter().flatten() {
        target.end()?;
    }
    Ok(Campaign::new(results))
}

fn started(target: &mut Option<Stepped>, memory: bool) -> Result<&mut Stepped, PilError> {
    match target {
        Some(target) => Ok(target),
        None => Ok(target.insert(Stepped::start(memory)?)),
    }
}

/// Whether a row flips bits.
fn flips(row: &FaultCase) -> bool {
    let flip = |injection: &Injection| matches!(injection, Injection::Inside(Inside::Flip(_)));
    row.injections.iter().any(flip)
}

fn send(target: &mut Stepped, tick: &Tick) -> Result<(), PilError> {
    let frames: Vec<Frame> = tick.frames.iter().map(|(frame, _)| *frame).collect();
    target.tick(tick.now, &frames)
}

/// Instructions of the worst step of a run, by a target that counts them ([`Stepped::counting`]): of every step, and of those for which
/// a bus carries the frames. `None` if it does not answer as the host does: the fault changes the ECU itself, which the target
/// leaves whole.
///
/// # Errors
/// A target that stops answering.
pub fn worst_steps(
    target: &mut Stepped,
    world: &World,
    row: &FaultCase,
    seed: u64,
) -> Result<Option<[u32; 2]>, PilError> {
    let trace = world.trial(row, seed, true).1;
    let compared = trace.map(|trace| compare(target, &trace)).transpose()?;
    let alike = compared.filter(|(violation, _)| violation.is_none());
    Ok(alike.map(|(_, cycles)| cycles.map(instructions)))
}

/// The first tick whose answer is not the host's, and the cycles of the worst steps.
fn compare(target: &mut Stepped, trace: &EcuTrace) -> Result<(Option<Violation>, [u32; 2]), PilError> {
    target.begin(&trace.params, trace.start)?;
    // All of them before the first answer: what comes back waits on our side of the pipe.
    for tick in &trace.ticks {
        send(target, tick)?;
    }
    let (mut violation, mut worst) = (None, [0; 2]);
    for tick in &trace.ticks {
        let answer = target.answer()?;
        let carried = usize::from(tick.frames.len() <= CARRIED);
        worst[..=carried]
            .iter_mut()
            .for_each(|worst| *worst = target.cost().cycles.max(*worst));
        if answer != tick.answer && violation.is_none() {
            violation = Some(Violation {
                step: tick.step,
                what: format!("the host answers {:02X?}, the target {answer:02X?}", tick.answer),
            });
        }
    }
    Ok((violation, worst))
}

/// What came of a flipped bit.
#[derive(Default)]
struct Flipped {
    stopped_after_ms: Option<u32>,
    cycles: u64,
    failure: Option<Violation>,
}

fn flip(target: &mut Stepped, trace: &EcuTrace, row: &FaultCase, seed: u64) -> Result<Flipped, PilError> {
    target.begin(&trace.params, trace.start)?;
    // Rows draw different bits with one seed.
    let mix = |hash: u64, byte| hash.wrapping_mul(31).wrapping_add(u64::from(byte));
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(row.name.bytes().fold(seed, mix));
    let bit = rng.random_range(0..target.bits());
    let at = rng.random_range(BEFORE..2 * BEFORE);
    let mut checker = InvariantChecker::new(true, false, trace.start.at.us());
    let mut flipped = Flipped::default();
    for (k, tick) in trace.ticks.iter().take(at + WATCHED).enumerate() {
        if k == at {
            target.flip(bit)?;
        }
        send(target, tick)?;
        let answer = target.answer()?;
        let now_us = tick.now.us();
        for (frame, accepted) in &tick.frames {
            if *accepted {
                checker.accepted(frame, now_us);
            }
        }
        let violation = match answer.split_first() {
            None => Some("no answer".into()),
            Some((guidance, others)) => {
                flipped.cycles += 1;
                checker.cycle(tick.step, u64::from(tick.step) * 1000, now_us, guidance, others);
                let status = Status::decode(guidance);
                if Some(guidance) != tick.answer.first() {
                    flipped.stopped_after_ms.get_or_insert((k - at) as u32);
                }
                let wrong = flipped.stopped_after_ms.is_some() && status.mode != FAULT;
                checker
                    .violation
                    .take()
                    .map(|violation| violation.what)
                    .or_else(|| wrong.then(|| format!("mode {}, T = {} N.m", status.mode, status.torque_nm)))
            }
        };
        if let Some(what) = violation {
            flipped.failure = Some(Violation {
                step: tick.step,
                what: format!("bit {bit} of the controller: {what}"),
            });
            return Ok(flipped);
        }
        if flipped
            .stopped_after_ms
            .is_some_and(|ms| k > at + ms as usize + STOPPED)
        {
            break;
        }
    }
    Ok(flipped)
}
