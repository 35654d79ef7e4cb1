//! What a flood of a workshop's questions costs the ECU: instructions in QEMU of a drive on a straight road, without it and with it.
//!
//! The drive obeys the ECU, and the guidance is on with its probe. The flood is three frames in each millisecond, as many as a bus of
//! 500 kbit/s has room for: requests of every kind, among them one whose answer is a MAC, and answers in several frames, which are asked for.
//! Whatever else the ECU says has to be the same with it, to the bit.

use haptic_core::bus::Frame;
use haptic_core::bus::e2e::ReceiverState;
use haptic_core::bus::messages::{Column, Guidance, LanePreview, Message, Request, Vehicle};
use haptic_core::controller::params::Params;
use haptic_core::quantity::{Instant, Metres, Ratio, Speed, Torque};
use haptic_core::safety::modes::Mode;
use haptic_diag::{REQUEST_ID, RESPONSE_ID};
use haptic_lockstep::{Start, StartState};
use haptic_pil::PilError;
use haptic_pil::cost::Cost;
use haptic_pil::qemu::instructions;
use haptic_pil::stepped::Stepped;

const TICKS: u32 = 6000;
/// From here on guidance is asked for: its inputs have to have been there for half a second.
const ENGAGE_AT: u32 = 800;

/// The drive without questions, and under a flood of them.
#[derive(Debug)]
pub struct Flood {
    /// What each takes.
    pub costs: [Cost; 2],
    /// Frames of answers.
    pub answers: usize,
    /// The most that the questions of a millisecond add to its step.
    pub added: u32,
}

/// One run.
struct Drive {
    steps: Vec<u32>,
    cost: Cost,
    /// All that the ECU said but its answers.
    said: Vec<Vec<Frame>>,
    answers: usize,
    active: usize,
}

/// Measures it.
///
/// # Errors
/// What is missing or fails on the way to a running image; a drive without guidance; a flood that changes what the ECU says.
pub fn flood() -> Result<Flood, PilError> {
    let quiet = drive("a product, no tester", false)?;
    let flooded = drive("a product, flood of a tester's questions", true)?;
    if quiet.active < 4000 {
        let why = format!("the guidance was on for {} ms only", quiet.active);
        return Err(PilError::Failed(why));
    }
    if let Some(tick) = (0..quiet.said.len()).find(|tick| quiet.said[*tick] != flooded.said[*tick]) {
        let why = format!("under the flood the ECU says something else in tick {tick}");
        return Err(PilError::Failed(why));
    }
    let pairs = flooded.steps.iter().zip(&quiet.steps);
    let added = pairs.map(|(flooded, quiet)| flooded.saturating_sub(*quiet)).max();
    Ok(Flood {
        costs: [quiet.cost, flooded.cost],
        answers: flooded.answers,
        added: added.unwrap_or(0),
    })
}

fn drive(what: &str, is_flooded: bool) -> Result<Drive, PilError> {
    let mut ecu = Stepped::counting()?;
    let start = Start {
        state: StartState::Product,
        at: Instant::from_us(0),
    };
    ecu.begin(&Params::PAPER, start)?;
    let (mut steps, mut said, mut answers, mut active) = (Vec::new(), Vec::new(), 0, 0);
    let (mut worst_behind, mut worst_tick, mut torque) = (0, 0, Torque::ZERO);
    for ms in 1..=TICKS {
        let mut heard = others(ms, torque);
        if is_flooded {
            heard.extend(questions(ms));
        }
        ecu.tick(Instant::from_us(ms * 1000), &heard)?;
        let (answer, other): (Vec<_>, Vec<_>) = ecu
            .answer()?
            .into_iter()
            .partition(|frame| frame.id() == RESPONSE_ID);
        answers += answer.len();
        let guidance = other.iter().find(|frame| frame.id() == Guidance::ID);
        let guidance =
            guidance.and_then(|frame| Guidance::decode(&mut { ReceiverState::TRUSTED }, frame).ok());
        torque = guidance.map_or(Torque::ZERO, |guidance| guidance.torque);
        active += usize::from(guidance.is_some_and(|guidance| guidance.mode == Mode::Active));
        said.push(other);
        let [step, behind] = [ecu.cost().cycles, ecu.cost().background_cycles].map(instructions);
        steps.push(step);
        worst_behind = worst_behind.max(behind);
        worst_tick = worst_tick.max(step + behind);
    }
    let cost = Cost {
        what: what.into(),
        mean: steps.iter().map(|step| f64::from(*step)).sum::<f64>() / f64::from(TICKS),
        worst: steps.iter().copied().max().unwrap_or(0),
        worst_behind,
        worst_tick,
        stack_bytes: ecu.stack_bytes(),
    };
    ecu.end()?;
    Ok(Drive {
        steps,
        cost,
        said,
        answers,
        active,
    })
}

/// What everybody else says: a car beside the middle of its lane, its driver against the guidance, its motor as it was told.
fn others(ms: u32, torque: Torque) -> Vec<Frame> {
    let count = |period: u32| (ms / period) as u8;
    let lane = LanePreview {
        e_y: Metres::from_m(0.3),
        valid: true,
        ..LanePreview::default()
    };
    let column = Column {
        driver_torque: Torque::from_nm(-torque.nm()),
        motor_torque: torque,
        ..Column::default()
    };
    let vehicle = Vehicle {
        speeds: [Speed::from_m_per_s(20.0); 2],
        yaw_rate: None,
    };
    let request = Request {
        engage: ms >= ENGAGE_AT,
        authority: Ratio::ONE,
        probe: true,
    };
    let all = [
        (8, lane.encode(count(8))),
        (2, column.encode(count(2))),
        (10, vehicle.encode(count(10))),
        (10, request.encode(count(10))),
    ];
    let due = all.into_iter().filter(|(period, _)| ms.is_multiple_of(*period));
    due.map(|(_, frame)| frame).collect()
}

fn questions(ms: u32) -> [Frame; 3] {
    // ISO-TP's length, then UDS: extended session; a challenge; codes by status; three identifiers; the snapshot of a code;
    // clear all; the first frame of an answer to the challenge; every code that there may be.
    const QUESTIONS: [&[u8]; 8] = [
        &[2, 0x10, 3],
        &[2, 0x27, 1],
        &[3, 0x19, 2, 0xFF],
        &[7, 0x22, 0x03, 0x10, 0x03, 0x11, 0x10, 0x00],
        &[6, 0x19, 4, 0x51, 0, 0, 1],
        &[4, 0x14, 0xFF, 0xFF, 0xFF],
        &[0x10, 18, 0x27, 2, 0, 0, 0, 0],
        &[2, 0x19, 0x0A],
    ];
    let question = QUESTIONS[(ms / 3) as usize % QUESTIONS.len()];
    // Flow control for the answers, and the rest of the longest request.
    let flow: &[u8] = &[0x30, 0, 0];
    let rest: &[u8] = &[0x21 + (ms % 2) as u8, 0, 0, 0, 0, 0, 0, 0];
    [question, flow, rest]
        .map(|data| Frame::new(REQUEST_ID, data).unwrap_or_else(|| unreachable!("at most eight bytes")))
}
