//! What proofs cost the ECU: instructions in QEMU of a recorded drive, without authentication, with each MAC, and under a flood of false
//! proofs.
//!
//! A flood fills each millisecond up to five frames to verify, more than a bus of 500 kbit/s carries beside the ECU's own. The true frames
//! come behind it, and the ECU's torque has to be the same with it and without, to the bit.
//!
//! Not here: what a tester asks, whose answers are worked out behind the step (`tests/pil.rs`).

use haptic_core::bus::Frame;
use haptic_core::bus::messages::{Guidance, LanePreview, Message, Request, Vehicle};
use haptic_core::controller::params::Params;
use haptic_core::quantity::Instant;
use haptic_lockstep::{Start, StartState, StepCost};
use haptic_secoc::Keys;
use haptic_secoc::fresh::Algorithm;
use haptic_secoc::messages::{PROVEN, Place};
use haptic_secoc::prover::Prover;
use serde::Serialize;

use super::PilError;
use super::qemu::instructions;
use super::stepped::Stepped;

/// Milliseconds before a drive, in which the senders are given their epochs.
const BEFORE: u32 = 500;
/// Frames to verify of a flooded millisecond.
const FLOOD: usize = 5;
/// Ticks of which the one in the middle counts for one frame.
const TRIES: u32 = 21;

/// A drive as its ECU heard it: the frames of each tick.
pub struct Drive {
    /// The controller's.
    pub params: Params,
    /// When, and what came.
    pub ticks: Vec<(Instant, Vec<Frame>)>,
}

/// What the ticks of a drive take.
#[derive(Debug, Clone, Serialize)]
pub struct Cost {
    /// Under which conditions.
    pub what: String,
    /// Frames that came and the step, in the mean.
    pub mean: f64,
    /// The worst of these steps.
    pub worst: u32,
    /// What is done behind the step, verifying included, at its worst.
    pub worst_behind: u32,
    /// All of a millisecond at its worst.
    pub worst_tick: u32,
    /// Bytes of stack that were ever used.
    pub stack_bytes: u32,
}

/// What one frame with its proof takes behind the step.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct OneFrame {
    /// A true one, the controller's receiving included.
    pub taken: u32,
    /// A false one: the MAC of either epoch.
    pub refused: u32,
}

/// What authentication costs.
#[derive(Debug, Clone, Serialize)]
pub struct Costs {
    /// The drive in each way.
    pub drives: Vec<Cost>,
    /// A lane preview with SipHash-2-4.
    pub siphash: OneFrame,
    /// A lane preview with AES-CMAC.
    pub aes: OneFrame,
}

/// Measures a drive in QEMU.
///
/// # Errors
/// What is missing or fails on the way to a running image; a flood that changes the torque.
pub fn measure(drive: &Drive) -> Result<Costs, PilError> {
    let mut drives = vec![
        Authenticated::start(None)?
            .run("no authentication", drive, false)?
            .0,
    ];
    let mut one = Vec::new();
    for (algorithm, name) in [
        (Algorithm::SipHash, "SipHash-2-4"),
        (Algorithm::AesCmac, "AES-CMAC"),
    ] {
        let mut ecu = Authenticated::start(Some(algorithm))?;
        one.push(ecu.one_frame()?);
        let (cost, quiet) = ecu.run(name, drive, false)?;
        let flooded = format!("{name}, flood of false proofs");
        let (cost_flooded, attacked) = Authenticated::start(Some(algorithm))?.run(&flooded, drive, true)?;
        drives.extend([cost, cost_flooded]);
        if let Some(tick) =
            (0..quiet.len()).find(|tick| quiet[*tick] != attacked.get(*tick).copied().flatten())
        {
            return Err(PilError::Failed(format!(
                "{flooded}: another torque than without it in tick {tick}"
            )));
        }
    }
    Ok(Costs {
        drives,
        siphash: one[0],
        aes: one[1],
    })
}

/// The image in QEMU, and its true senders.
struct Authenticated {
    ecu: Stepped,
    prover: Option<Prover>,
    numbers: u32,
}

impl Authenticated {
    fn start(algorithm: Option<Algorithm>) -> Result<Self, PilError> {
        let mut ecu = Stepped::counting()?;
        if let Some(algorithm) = algorithm {
            ecu.authenticate(algorithm)?;
        }
        let prover = algorithm.map(|algorithm| Prover::new(&Keys::bench(algorithm)));
        let mut started = Self {
            ecu,
            prover,
            numbers: 0,
        };
        let mut questions = Vec::new();
        for ms in 0..BEFORE {
            let mut frames = std::mem::take(&mut questions);
            for id in [LanePreview::ID, Vehicle::ID, Request::ID] {
                frames.extend(started.prove(&Frame::full(id, [0; 8])));
            }
            let at = Instant::from_us(ms.wrapping_sub(BEFORE).wrapping_mul(1000));
            questions = started.tick(at, &frames)?.1;
        }
        if algorithm.is_some() && started.prove(&Frame::full(LanePreview::ID, [0; 8])).len() < 2 {
            return Err(PilError::Failed("the ECU gave its senders no epoch".into()));
        }
        Ok(started)
    }

    fn prove(&mut self, frame: &Frame) -> Vec<Frame> {
        let Some(prover) = &mut self.prover else {
            return vec![*frame];
        };
        prover.prove(frame).to_vec()
    }

    /// The torque frame of a tick, what its senders then ask, and what it took.
    fn tick(
        &mut self,
        at: Instant,
        frames: &[Frame],
    ) -> Result<(Option<Frame>, Vec<Frame>, StepCost), PilError> {
        self.ecu.tick(at, frames)?;
        let answer = self.ecu.answer()?;
        let mut questions = Vec::new();
        for frame in &answer {
            if let Some(prover) = &mut self.prover {
                questions.extend(prover.hear(frame, || {
                    self.numbers += 1;
                    self.numbers
                }));
            }
        }
        let guidance = answer.into_iter().find(|frame| frame.id() == Guidance::ID);
        Ok((guidance, questions, self.ecu.cost()))
    }

    /// A drive from its start, and the torque frame of each tick; it ends the machine.
    fn run(
        mut self,
        what: &str,
        drive: &Drive,
        is_flooded: bool,
    ) -> Result<(Cost, Vec<Option<Frame>>), PilError> {
        let start = Start {
            state: StartState::Engaged,
            at: Instant::from_us(0),
        };
        self.ecu.begin(&drive.params, start)?;
        let (mut said, mut questions) = (Vec::new(), Vec::new());
        let (mut sum, mut worst, mut worst_behind, mut worst_tick) = (0, 0, 0, 0);
        for (at, frames) in &drive.ticks {
            let mut heard = std::mem::take(&mut questions);
            if is_flooded {
                heard.extend(flood(frames));
            }
            for frame in frames {
                heard.extend(self.prove(frame));
            }
            let (guidance, asked, cost) = self.tick(*at, &heard)?;
            questions = asked;
            said.push(guidance);
            let [step, behind] = [cost.cycles, cost.background_cycles].map(instructions);
            sum += u64::from(step);
            worst = worst.max(step);
            worst_behind = worst_behind.max(behind);
            worst_tick = worst_tick.max(step + behind);
        }
        let cost = Cost {
            what: what.into(),
            mean: sum as f64 / drive.ticks.len().max(1) as f64,
            worst,
            worst_behind,
            worst_tick,
            stack_bytes: self.ecu.stack_bytes(),
        };
        self.ecu.end()?;
        Ok((cost, said))
    }

    /// What a lane preview takes behind a step that has nothing else to do.
    fn one_frame(&mut self) -> Result<OneFrame, PilError> {
        let lane = Frame::full(LanePreview::ID, [0; 8]);
        let mut spent = [const { Vec::new() }; 3];
        for turn in 0..TRIES {
            let kinds = [Vec::new(), self.prove(&lane), false_lane().to_vec()];
            for ((kind, frames), spent) in (0..).zip(kinds).zip(&mut spent) {
                let at = Instant::from_us((turn * 3 + kind) * 1000);
                spent.push(instructions(self.tick(at, &frames)?.2.background_cycles));
            }
        }
        // A status falls into some of the ticks, and a false count may be the last one's.
        let [nothing, taken, refused] = spent.map(|mut spent| {
            spent.sort_unstable();
            spent[spent.len() / 2]
        });
        Ok(OneFrame {
            taken: taken.saturating_sub(nothing),
            refused: refused.saturating_sub(nothing),
        })
    }
}

/// False frames that fill a millisecond up, lanes first, which take most.
fn flood(frames: &[Frame]) -> Vec<Frame> {
    let is_proven = |frame: &&Frame| PROVEN.iter().any(|proven| proven.info.id == frame.id());
    let room = FLOOD.saturating_sub(frames.iter().filter(is_proven).count());
    let lanes = room.min(2);
    let mut flood = false_lane().repeat(lanes);
    flood.resize(flood.len() + room - lanes, Frame::full(Request::ID, [1; 8]));
    flood
}

/// A lane preview with the proof of the count behind any, which no MAC has.
fn false_lane() -> [Frame; 2] {
    let Some(proof) = PROVEN.iter().find_map(|proven| match proven.place {
        Place::Behind(id) if proven.info.id == LanePreview::ID => Frame::new(id, &[0x5A; 4]),
        _ => None,
    }) else {
        unreachable!("a lane preview has its proof behind it")
    };
    [Frame::full(LanePreview::ID, [0xA5; 8]), proof]
}
