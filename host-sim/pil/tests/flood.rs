//! A flood of questions: the control step in QEMU takes as many instructions as without, and its frames are the same.

use haptic_core::bus::Frame;
use haptic_core::bus::messages::{Column, LanePreview, Message, Request, Vehicle};
use haptic_core::controller::params::Params;
use haptic_core::quantity::{Instant, Speed};
use haptic_lockstep::{Start, StartState};
use haptic_pil::qemu::instructions;
use haptic_pil::stepped::Stepped;

const REQUEST: u16 = 0x730;
const ANSWER: u16 = 0x738;
const TICKS: u32 = 4000;
/// The stack's budget (`firmware/src/stack.x`).
const STACK: u32 = 12_288;

/// What everybody else on the bus says in a millisecond: a car that drives straight on, and asks for guidance from 0.8 s on.
fn drive(ms: u32) -> Vec<Frame> {
    let count = |period: u32| (ms / period) as u8;
    let vehicle = Vehicle {
        speeds: [Speed::from_m_per_s(20.0); 2],
        yaw_rate: None,
    };
    let request = Request {
        engage: ms >= 800,
        authority: haptic_core::quantity::Ratio::ONE,
        probe: true,
    };
    let lane = LanePreview {
        valid: true,
        ..LanePreview::default()
    };
    [
        (8, lane.encode(count(8))),
        (2, Column::default().encode(count(2))),
        (10, vehicle.encode(count(10))),
        (10, request.encode(count(10))),
    ]
    .into_iter()
    .filter(|(period, _)| ms.is_multiple_of(*period))
    .map(|(_, frame)| frame)
    .collect()
}

/// Questions, as many as the bus has room for, of every kind: each has to be worked out, some of them with a MAC, and long answers wait
/// for flow control.
fn questions(ms: u32) -> [Frame; 3] {
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
    let flow: &[u8] = &[0x30, 0, 0];
    let consecutive: &[u8] = &[0x21 + (ms % 2) as u8, 0, 0, 0, 0, 0, 0, 0];
    [question, flow, consecutive].map(|data| Frame::new(REQUEST, data).unwrap())
}

/// Instructions of each step, the ECU's frames but its answers, and how many answers there were.
fn run(is_flooded: bool) -> (Vec<u32>, Vec<Vec<Frame>>, usize) {
    let mut ecu = Stepped::counting().unwrap();
    let start = Start {
        state: StartState::Product,
        at: Instant::from_us(0),
    };
    ecu.begin(&Params::PAPER, start).unwrap();
    let (mut costs, mut frames, mut answers) = (Vec::new(), Vec::new(), 0);
    for ms in 1..=TICKS {
        let mut heard = drive(ms);
        if is_flooded {
            heard.extend(questions(ms));
        }
        ecu.tick(Instant::from_us(ms * 1000), &heard).unwrap();
        let (answer, said) = ecu
            .answer()
            .unwrap()
            .into_iter()
            .partition::<Vec<_>, _>(|frame| frame.id() == ANSWER);
        answers += answer.len();
        costs.push(instructions(ecu.cost().cycles));
        frames.push(said);
    }
    let stack = ecu.stack_bytes();
    println!(
        "flood {is_flooded}: worst step {} instructions, {stack} B of stack",
        costs.iter().max().unwrap()
    );
    assert!(stack > 0 && stack < STACK, "{stack} B of stack");
    ecu.end().unwrap();
    (costs, frames, answers)
}

#[test]
fn the_step_takes_no_instruction_more_under_a_flood_of_questions() {
    let (quiet, quiet_frames, none) = run(false);
    let (flooded, flooded_frames, answers) = run(true);
    assert_eq!(none, 0);
    assert!(answers > 1000, "{answers} answers");
    assert_eq!(quiet, flooded);
    assert_eq!(quiet_frames, flooded_frames);
}
