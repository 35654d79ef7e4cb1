//! Same bits on host and target: the controller in QEMU answers every tick with the frames of the host's; on both
//! cores, and behind a serial port as a board would be.
//!
//! These runs feed frames that the closed loop of the paper's studies never makes: damaged, missing, asking for
//! guidance again and again. QEMU must be there; without it they fail.

use std::collections::BTreeSet;
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

use haptic_core::bus::Frame;
use haptic_core::bus::messages::{Column, LanePreview, Message, Request, Telemetry, Vehicle};
use haptic_core::controller::params::{DRIVER_ACTIVITY, Params};
use haptic_core::ecu::Boot;
use haptic_core::quantity::{Instant, Metres, Micros, Radians, Ratio, Speed, Torque, TurningRate};
use haptic_lockstep::{Start, StartState};
use haptic_pil::{Channel, Machine, Pil, PilError, Report, Target, image};

/// xorshift64: the same frames in every run.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }
}

/// A car on a straight road, its steering wheel turned by driver and guidance against a spring of 5.18 N.m/rad
/// (the steady state at 20 m/s that the plausibility checks assume), as frames.
///
/// The driver keeps the road but weaves, strongly enough to override now and then. At the end of every cycle the bus is silent
/// for 100 ms; the guidance hands over and is asked for anew. One frame in two hundred has a bit flipped.
struct World {
    random: Random,
    cycle_ms: u32,
    offset_m: f64,
    heading_rad: f64,
    /// What the motor delivers: the ECU's last torque.
    motor: Torque,
}

impl World {
    const SPEED_M_PER_S: f64 = 20.0;
    const STIFFNESS_NM_PER_RAD: f64 = 5.18;
    /// Rate of the heading per wheel angle.
    const TURNING_1PS: f64 = 0.262;
    /// 0.7 s ahead.
    const FAR_M: f64 = 14.0;

    fn frames(&mut self, k: u32) -> Vec<Frame> {
        let weaving = 1.2 * (2.5e-3 * f64::from(k)).cos();
        let driver_torque = Torque::from_nm(weaving - 0.2 * self.offset_m - 4.0 * self.heading_rad);
        let wheel_rad = (driver_torque.nm() + self.motor.nm()) / Self::STIFFNESS_NM_PER_RAD;
        self.heading_rad += 1e-3 * Self::TURNING_1PS * wheel_rad;
        self.offset_m += 1e-3 * Self::SPEED_M_PER_S * self.heading_rad;

        let mut frames = Vec::new();
        let in_cycle = k % self.cycle_ms;
        if in_cycle >= self.cycle_ms - 100 {
            return frames;
        }
        if k.is_multiple_of(8) {
            let lane = LanePreview {
                e_y: Metres::from_m(-self.offset_m - Self::FAR_M * self.heading_rad),
                e_theta: Radians::from_rad(-self.heading_rad),
                age: Micros::from_us((self.random.next() % 7_000) as u32),
                valid: true,
            };
            frames.push(lane.encode((k / 8) as u8));
        }
        if k.is_multiple_of(2) {
            let column = Column {
                driver_torque,
                wheel_angle: Radians::from_rad(wheel_rad),
                motor_torque: self.motor,
            };
            frames.push(column.encode((k / 2) as u8));
        }
        if k.is_multiple_of(10) {
            let speeds = [Speed::from_m_per_s(Self::SPEED_M_PER_S); 2];
            frames.push(
                Vehicle {
                    speeds,
                    yaw_rate: Some(TurningRate::from_rad_per_s(Self::TURNING_1PS * wheel_rad)),
                }
                .encode((k / 10) as u8),
            );
            let request = Request {
                engage: in_cycle > 2500,
                authority: Ratio::from_si(1.0),
                probe: in_cycle > 3000,
            };
            frames.push(request.encode((k / 10) as u8));
        }
        for frame in &mut frames {
            if self.random.next().is_multiple_of(200) {
                let mut data = frame.data().to_vec();
                data[(self.random.next() % 8) as usize] ^= 1 << (self.random.next() % 8);
                *frame = Frame::new(frame.id(), &data).unwrap();
            }
        }
        frames
    }
}

/// The reference board in QEMU.
const fn qemu(channel: Channel) -> Target {
    Target::Qemu {
        machine: Machine::An386,
        channel,
        count: false,
    }
}

/// Runs `steps` ticks in cycles of 8 s; the host's controller has `host`'s parameters, the target's has `other`'s. Returns the
/// report and how many of the host's torques were not zero.
fn run(target: &Target, steps: u32, host: &Params, other: &Params) -> (Report, u32) {
    let (report, guiding, _) = run_cycles(target, steps, 8_000, host, other);
    (report, guiding)
}

/// Runs `steps` ticks in cycles of another length. Also returns the values of K_hg and its deviation that the host's
/// telemetry carried.
fn run_cycles(
    target: &Target,
    steps: u32,
    cycle_ms: u32,
    host: &Params,
    other: &Params,
) -> (Report, u32, BTreeSet<[i32; 2]>) {
    // Starts 2 s before the clock's wrap.
    let clock = |k: u32| Instant::from_us((u32::MAX - 2_000_000).wrapping_add(k * 1000));
    let start = Start {
        state: StartState::Boot(Boot::default()),
        at: clock(0),
    };
    let mut ecu = start.ecu(host).unwrap();
    let mut pil = Pil::on(target, other, start).unwrap();
    let mut world = World {
        random: Random(0x9E37_79B9_7F4A_7C15),
        cycle_ms,
        offset_m: 0.0,
        heading_rad: 0.0,
        motor: Torque::ZERO,
    };
    let (mut guiding, mut readings) = (0, BTreeSet::new());
    for k in 0..steps {
        let now = clock(k);
        let frames = world.frames(k);
        for frame in &frames {
            let _ = ecu.receive(frame, now);
        }
        let step = ecu.step(now);
        world.motor = step.command.torque;
        guiding += u32::from(step.command.torque != Torque::ZERO);
        let background = ecu.background_step();
        if let Some(frame) = background {
            let reading = Telemetry::unpack(frame.data().try_into().unwrap()).unwrap().k_hg;
            // An LSB of the bus is 2^-10.
            let counts = |ratio: Ratio| (1024.0 * ratio.si()) as i32;
            readings.extend(reading.map(|r| [counts(r.k_hg), counts(r.deviation)]));
        }
        let answer: Vec<Frame> = [step.guidance]
            .into_iter()
            .chain(step.others)
            .chain(background)
            .collect();
        pil.tick(now, &frames, &answer).unwrap();
    }
    (pil.finish().unwrap(), guiding, readings)
}

#[test]
fn twenty_seconds_over_the_fifo_are_identical() {
    let (report, guiding) = run(&qemu(Channel::Fifo), 20_000, &Params::PAPER, &Params::PAPER);
    assert_eq!(report.mismatches, 0, "{}", report.first_mismatch.unwrap());
    assert_eq!(report.steps, 20_000);
    // A torque frame each step, and warnings and fault records beside them.
    assert!(report.frames_compared > 20_000);
    assert!(guiding > 10_000, "only {guiding} steps of the run guide at all");
}

/// The estimate of K_hg is in f32, with a root of micromath: every telemetry frame that carries one is among those compared.
#[test]
fn a_live_estimate_has_the_same_bits() {
    let target = qemu(Channel::Fifo);
    let (report, _, readings) = run_cycles(&target, 40_000, 40_000, &Params::PAPER, &Params::PAPER);
    assert_eq!(report.mismatches, 0, "{}", report.first_mismatch.unwrap());
    assert!(readings.len() > 20, "{readings:?}");
}

#[test]
fn driver_activity_has_the_same_bits() {
    let params = Params {
        law: DRIVER_ACTIVITY,
        ..Params::PAPER
    };
    let (report, guiding) = run(&qemu(Channel::Fifo), 10_000, &params, &params);
    assert_eq!(report.mismatches, 0, "{}", report.first_mismatch.unwrap());
    assert!(guiding > 3_000, "only {guiding} steps of the run guide at all");
    // It is not the paper's.
    let (other, _) = run(&qemu(Channel::Fifo), 6_000, &params, &Params::PAPER);
    assert!(other.mismatches > 100, "{}", other.mismatches);
}

#[test]
fn two_seconds_over_slcan_are_identical() {
    let (report, _) = run(&qemu(Channel::Slcan), 2_000, &Params::PAPER, &Params::PAPER);
    assert_eq!(report.mismatches, 0, "{}", report.first_mismatch.unwrap());
    assert_eq!(report.steps, 2_000);
}

/// The negative control: a gain that is larger by a thousandth must show.
#[test]
fn a_difference_is_found_and_printed() {
    let other = Params {
        a_3: 40.04,
        ..Params::PAPER
    };
    let (report, _) = run(&qemu(Channel::Fifo), 4_000, &Params::PAPER, &other);
    let first = report.first_mismatch.expect("a difference");
    assert!(report.mismatches > 0 && report.mismatches < 4_000);
    let text = first.to_string();
    assert!(text.contains(&format!("step {}", first.step)), "{text}");
    assert!(text.contains("N.m, limit"), "{text}");
    // The same parameters on both ends: the difference was theirs.
    let (same, _) = run(&qemu(Channel::Fifo), 4_000, &other, &other);
    assert_eq!(same.mismatches, 0);
}

#[test]
fn another_core_gives_the_same_bits() {
    let target = Target::Qemu {
        machine: Machine::An500,
        channel: Channel::Fifo,
        count: false,
    };
    let (report, guiding) = run(&target, 10_000, &Params::PAPER, &Params::PAPER);
    assert_eq!(report.mismatches, 0, "{}", report.first_mismatch.unwrap());
    assert!(guiding > 3_000, "only {guiding} steps of the run guide at all");
}

/// The way to a board, with QEMU's serial port in the adapter's place.
#[test]
fn a_board_behind_a_serial_adapter_is_compared() {
    let elf = image::build(Machine::An386).unwrap();
    let mut qemu = Command::new("qemu-system-arm")
        .args(["-machine", "mps2-an386", "-display", "none", "-monitor", "none"])
        .args(["-serial", "pty", "-serial", "null"])
        .args([
            "-semihosting-config",
            "enable=on,target=native,arg=lockstep,arg=slcan",
        ])
        .arg("-kernel")
        .arg(elf)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    let mut said = BufReader::new(qemu.stdout.take().unwrap());
    said.read_line(&mut line).unwrap();
    // "char device redirected to /dev/pts/3 (label serial0)"
    let port = line.split_whitespace().find(|word| word.starts_with("/dev/"));
    let target = Target::Board(port.unwrap_or_else(|| panic!("QEMU says: {line}")).into());
    let (report, _) = run(&target, 1_000, &Params::PAPER, &Params::PAPER);
    // The image ends QEMU when the channel is closed.
    assert!(qemu.wait().unwrap().success());
    assert_eq!(report.mismatches, 0, "{}", report.first_mismatch.unwrap());
    assert_eq!(report.steps, 1_000);
    // A board's cost is what its own counter says.
    assert!(report.cycles.expect("cycles").mean > 0.0);
    assert_eq!(report.instructions, None);
}

#[test]
fn an_adapter_that_is_not_there_is_named() {
    let start = Start {
        state: StartState::Engaged,
        at: Instant::from_us(0),
    };
    for name in ["/dev/no-such-adapter", "can99"] {
        let error = Pil::on(&Target::Board(name.into()), &Params::PAPER, start)
            .err()
            .expect("an error");
        assert!(matches!(error, PilError::Missing(_)), "{error:?}");
        assert!(error.to_string().contains(name), "{error}");
    }
}

/// Instruction counts do not depend on the machine, the load or the run.
#[test]
fn counted_instructions_repeat() {
    let count = || {
        let target = Target::Qemu {
            machine: Machine::An386,
            channel: Channel::Fifo,
            count: true,
        };
        let (report, _) = run(&target, 1_000, &Params::PAPER, &Params::PAPER);
        report.instructions
    };
    let first = count().expect("counted");
    assert_eq!(Some(first), count());
}

/// The probe is asked for after 3 s; its blocks of 2 s end once a second from then on.
#[test]
fn reading_the_reliance_costs_less_than_400_instructions_a_step() {
    let target = Target::Qemu {
        machine: Machine::An386,
        channel: Channel::Fifo,
        count: true,
    };
    let (report, _) = run(&target, 7_900, &Params::PAPER, &Params::PAPER);
    assert_eq!(report.mismatches, 0);
    let worst = report.instructions.expect("counted").worst_background;
    // 151 are those of a telemetry frame alone: more shows that there was a probe to read.
    assert!((200..400).contains(&worst), "{worst}");
}

/// The stack's budget (`firmware/src/stack.x`).
const STACK: u32 = 16_384;

/// A workshop's questions, as many as the bus carries: whatever else the ECU says is the same to the bit, the step is within its budget,
/// and what comes of a question adds to it what taking three frames does.
#[test]
fn a_flood_of_questions_leaves_the_step_within_its_budget_and_the_torque_as_it_is() {
    let flood = host_sim::tester::flood().unwrap();
    println!("{flood:?}");
    let [quiet, flooded] = &flood.costs;
    assert!(flood.answers > 1000, "{} frames of answers", flood.answers);
    assert!(flood.added <= 300, "{} instructions", flood.added);
    assert!(
        quiet.worst <= flooded.worst && flooded.worst <= 5500,
        "{}",
        flooded.worst
    );
    assert!(
        flooded.worst_behind > quiet.worst_behind,
        "answers are worked out"
    );
    for cost in &flood.costs {
        assert!(cost.stack_bytes > 0 && cost.stack_bytes < STACK, "{cost:?}");
    }
}
