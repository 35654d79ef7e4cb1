//! Random drives: a vehicle that follows a winding line, and whatever can go wrong between its sensors and the ECU. Beside the
//! ECU drive its reference, an ECU that is shown everything mirrored, and one whose clock shows another time. Forty drives by default,
//! more by hand:
//!
//! ```text
//! HAPTIC_DRIVES=1000 cargo test --release -p haptic-core reference:: -- --nocapture
//! ```
//!
//! Above 500 lines because a seed draws the world, what goes wrong and when in one order: split, a reader could not follow
//! what makes a drive repeat.

use super::Reference;
use super::frames::Frames;
use haptic_core::bus::messages::{Column, LanePreview, MESSAGES, Message, Request, ResetCause, Vehicle};
use haptic_core::bus::{Frame, Reject};
use haptic_core::controller::config::Setup;
use haptic_core::controller::params::Params;
use haptic_core::ecu::{Boot, Ecu, Step};
use haptic_core::quantity::{Instant, Metres, Micros, Radians, Ratio, Speed, Torque, TurningRate};
use haptic_core::safety::faults::{Fault, FaultSet};
use haptic_core::safety::modes::Mode;
use rand::rngs::SmallRng;
use rand::{RngExt, SeedableRng};
use std::collections::VecDeque;

const LSB_NM: f64 = 1.0 / 4096.0;

/// What the core's roundings may decide, as a share of a bound; and where a slow sum is rounded down on both sides of zero.
const TIE: f64 = 2e-4;
const MIRRORED: f64 = 5e-3;
/// The command differs from an evaluation in f64 by at most 1 mN.m.
const MOST_NM: f64 = 1e-3;
/// Where driver activity leaves a share, its error of 0.001 makes up to 5 mN.m more of the largest torque.
const SHARED_TIE: f64 = 5e-2;
const SHARED_MOST_NM: f64 = 6e-3;
/// What the clock of another ECU shows more: an eighth of a wrap.
const LATER: Micros = Micros::from_us(1 << 29);

/// To whole counts of a signal, so that its mirror image is one too.
fn counts(value: f64, lsb: f64) -> f64 {
    (value / lsb).round() * lsb
}

/// What is wrong between the vehicle and the ECU; nothing by default.
#[derive(Debug, Clone)]
struct Wrong {
    silent: [bool; 4],
    invalid: bool,
    /// Added to both lane errors, and what they are then multiplied by.
    other_line: [f64; 2],
    lane_scale: f64,
    lane_frozen: bool,
    /// Age and period of the pictures, ms.
    camera: (usize, i64),
    push: f64,
    driver_still: bool,
    speeds: [f64; 2],
    /// Times this, and so much more.
    yaw_rate: [f64; 2],
    no_yaw_rate: bool,
    wheel_scale: f64,
    motor: f64,
    request: Option<bool>,
    /// A bit that is flipped, how far the counter is ahead, a value out of range, a frame in each step.
    bit: [Option<u32>; 4],
    counter: [u8; 4],
    range: [bool; 4],
    every_step: [bool; 4],
    foreign: bool,
    tick_us: i64,
}

impl Default for Wrong {
    fn default() -> Self {
        Self {
            silent: [false; 4],
            invalid: false,
            other_line: [0.0; 2],
            lane_scale: 1.0,
            lane_frozen: false,
            camera: (0, 8),
            push: 0.0,
            driver_still: false,
            speeds: [0.0; 2],
            yaw_rate: [1.0, 0.0],
            no_yaw_rate: false,
            wheel_scale: 1.0,
            motor: 1.0,
            request: None,
            bit: [None; 4],
            counter: [0; 4],
            range: [false; 4],
            every_step: [false; 4],
            foreign: false,
            tick_us: 1000,
        }
    }
}

impl Wrong {
    /// Something goes wrong by three numbers of -1 to 1; `kind` of [`Self::KINDS`].
    fn add(&mut self, kind: u32, sender: usize, [a, b, c]: [f64; 3]) {
        match kind {
            0..4 => self.silent[sender] = true,
            4 => self.silent[0] = true,
            5 => self.invalid = true,
            6..8 => self.other_line = [4.0 * a * a * a, 0.3 * b * b * b],
            8 => self.lane_scale = a + b,
            9 => self.lane_frozen = true,
            10..12 => self.camera = ((80.0 + 80.0 * a) as usize, (34.0 + 33.0 * b) as i64),
            12..14 => self.push = 6.0 * a,
            14 => self.driver_still = true,
            15 => self.speeds = [6.0 * a, if c > 0.0 { 0.0 } else { 6.0 * b }],
            16 => self.yaw_rate = [a.round(), 0.3 * b * c],
            17 => self.no_yaw_rate = true,
            18 => self.wheel_scale = a + b,
            19 => self.motor = 1.0 - 1.3 * a.abs(),
            20 => self.request = Some(a > 0.0),
            21 => self.bit[sender] = Some((32.0 + 32.0 * a) as u32),
            22 => self.counter[sender] = (8.0 + 8.0 * a) as u8,
            23 => self.range[sender] = true,
            24 => self.every_step[sender] = true,
            25 => self.foreign = true,
            _ => self.tick_us = (5500.0 + 5500.0 * a) as i64,
        }
    }

    const KINDS: u32 = 27;
}

/// A vehicle, its line, and what its sensors have seen lately, newest first.
struct World {
    v: f64,
    v_wanted: f64,
    bend: f64,
    bend_wanted: f64,
    rate: f64,
    psi: f64,
    directions: VecDeque<f64>,
    e_y: f64,
    aside: f64,
    seen: VecDeque<[f64; 2]>,
}

impl World {
    fn new(v: f64) -> Self {
        Self {
            v,
            v_wanted: v,
            bend: 0.0,
            bend_wanted: 0.0,
            rate: 0.0,
            psi: 0.0,
            directions: [0.0; 3000].into(),
            e_y: 0.0,
            aside: 0.0,
            seen: [[0.0; 2]; 200].into(),
        }
    }

    fn step(&mut self, params: &Params, dt: f64) {
        let vehicle = &params.vehicle;
        self.v += (self.v_wanted - self.v).clamp(-6.0 * dt, 3.0 * dt);
        self.bend += (self.bend_wanted - self.bend).clamp(-0.1 * dt, 0.1 * dt);
        let far = self.directions[0] + self.bend * dt;
        self.directions.push_front(far);
        self.directions.truncate(3000);
        let between_ms = ((vehicle.far_time_s - vehicle.near_time_s) * 1e3) as usize;
        let near = self.directions[between_ms] - self.psi;
        let wanted = (far - self.psi) / vehicle.far_time_s + 0.03 * (self.e_y - self.aside);
        let most = 3.0 / self.v.max(5.0);
        self.rate += (wanted.clamp(-most, most) - self.rate).clamp(-0.5 * dt, 0.5 * dt);
        self.e_y += (self.v * near - vehicle.near_time_s * self.v * self.rate) * dt;
        self.psi += self.rate * dt;
        self.seen.push_front([self.e_y, far - self.psi]);
        self.seen.truncate(200);
    }

    /// The wheel of the steady state, and the aligning torque on the column.
    fn column(&self, params: &Params) -> (f64, f64) {
        let vehicle = &params.vehicle;
        let v = self.v.max(3.0);
        let slip = 1.0 + vehicle.stability_factor_s2_per_m2 * v * v;
        let wheel = self.rate * slip / (v * vehicle.curvature_gain_per_m);
        (
            wheel.clamp(-12.0, 12.0),
            vehicle.aligning_gain_nm_s2_per_m * v * self.rate,
        )
    }
}

/// The ECU, and those that are shown the same.
struct Ecus {
    told: Ecu,
    /// In a drive without a probe, which has a direction of its own.
    mirrored: Option<Ecu>,
    elsewhen: Ecu,
    reference: Reference,
    frames: Frames,
    us: i64,
    start_us: u32,
    applied: f64,
    tie: f64,
    most_nm: f64,
    context: String,
}

impl Ecus {
    /// Started, or guiding already where the drive is one of fourteen; with its own reason of the last reset.
    fn new(seed: u64, params: &Params, start_us: u32) -> Self {
        let setup = Setup::new(params).unwrap();
        let boot = Boot {
            reset: ResetCause::from_code((seed % 7) as i64).unwrap(),
            recent_resets: (seed % 3) as u8,
            latched: FaultSet::NONE,
        };
        let ecu = |now| {
            if is_engaged(seed) {
                Ecu::engaged(&setup, now)
            } else {
                Ecu::new(Some(&setup), boot, now)
            }
        };
        let start = Instant::from_us(start_us);
        let (tie, most_nm) = if params.law == 0.0 {
            (TIE, MOST_NM)
        } else {
            (SHARED_TIE, SHARED_MOST_NM)
        };
        let mut reference = Reference::new(params, 0);
        if is_engaged(seed) {
            reference.engage();
        }
        Self {
            told: ecu(start),
            mirrored: (seed % 2 == 1).then(|| ecu(start)),
            elsewhen: ecu(start.after(LATER)),
            reference,
            frames: Frames::new(seed % 7, 0),
            us: 0,
            start_us,
            applied: 0.0,
            tie,
            most_nm,
            context: String::new(),
        }
    }

    fn now(&self) -> Instant {
        Instant::from_us(self.start_us).after(Micros::from_us(self.us as u32))
    }

    /// An eighth of a wrap later.
    fn later(&self) -> Instant {
        self.now().after(LATER)
    }

    /// A frame to all, to one its mirror image. All agree on what they say of it.
    fn send(&mut self, frame: &Frame, mirrored: &Frame) {
        let (now, later) = (self.now(), self.later());
        let right = self.reference.receive(frame, self.us);
        let said: [Result<(), Reject>; 3] = [
            self.told.receive(frame, now),
            self.elsewhen.receive(frame, later),
            self.mirrored
                .as_mut()
                .map_or(right, |ecu| ecu.receive(mirrored, now)),
        ];
        assert_eq!(said, [right; 3], "{frame:?}, {} us, {}", self.us, self.context);
    }

    /// A step of all; whether what follows can still be compared.
    fn step(&mut self) -> Option<Step> {
        let (now, later) = (self.now(), self.later());
        let step = self.told.step(now);
        let mirrored = self.mirrored.as_mut().map(|ecu| ecu.step(now));
        let elsewhen = self.elsewhen.step(later);
        let said = self.reference.step(self.us, self.applied);
        let command = step.command;
        let context = || format!("{} us, {command:?},\nnot {said:?},\n{}", self.us, self.context);
        let is_tie = said.closest < self.tie;
        assert_eq!(step, elsewhen, "at another time: {}", context());
        let agrees = (command.mode, command.faults, command.limit, command.warning)
            == (said.mode, said.faults, said.limit, said.warning);
        if !agrees && is_tie {
            return None;
        }
        assert!(agrees, "{}", context());
        let torque = command.torque.nm();
        let is_near = (torque - said.torque).abs() < self.most_nm;
        if !is_near && is_tie {
            return None;
        }
        assert!(is_near, "{}", context());
        let probes = command.probe.map(Torque::nm).zip(said.probe);
        assert_eq!(command.probe.is_some(), said.probe.is_some(), "{}", context());
        assert!(
            probes.is_none_or(|(probe, said)| (probe - said).abs() < 3e-4),
            "{}",
            context()
        );
        assert_eq!(
            self.told.stands(),
            self.reference.receivers.stands(),
            "{}",
            context()
        );
        if let Some(Step { command: other, .. }) = mirrored {
            let is_mirrored = (other.mode, other.faults, other.limit, other.warning)
                == (command.mode, command.faults, command.limit, command.warning)
                && (other.torque.nm() + torque).abs() <= 2.0 * LSB_NM;
            if !is_mirrored && said.closest < MIRRORED {
                return None;
            }
            assert!(is_mirrored, "mirrored: {other:?}\n{}", context());
        }
        assert!(step.permitted, "{}", context());
        let sent = core::iter::once(&step.guidance).chain(&step.others);
        let sent: Vec<_> = sent
            .map(|frame| (frame.id(), frame.full_data().unwrap()))
            .collect();
        let expected = self.frames.expected(self.us, &command, said.has_column);
        assert_eq!(sent, expected, "{}", context());
        self.applied = torque;
        Some(step)
    }
}

/// A set of parameters of its own.
fn parameters(rng: &mut SmallRng) -> Params {
    let mut params = Params::PAPER;
    let mut times = |value: f64, least: f64, most: f64| value * rng.random_range(least..most);
    params.k_1 = times(params.k_1, 0.7, 1.3);
    params.a_1 = times(params.a_1, 0.7, 1.5);
    params.a_2 = times(params.a_2, 0.5, 4.0);
    params.a_3 = times(params.a_3, 0.7, 1.1);
    params.a_4 = times(params.a_4, 0.5, 1.2);
    params.torque_limit_nm = times(5.0, 0.2, 1.0);
    params.wind_up_nm_per_s = times(4.0, 0.9, 1.0);
    params.reduction_nm_per_s = times(8.0, 0.6, 1.0);
    params.least_speed_m_per_s = times(5.0, 0.5, 2.0);
    params.probe_amplitude_nm = times(0.2, 0.2, 1.0);
    params.probe_frequency_hz = times(2.5, 0.6, 1.1);
    params.low_speed_share = times(1.0, 0.3, 1.0);
    params.high_speed_share = times(1.0, 0.3, 1.0);
    let vehicle = &mut params.vehicle;
    vehicle.curvature_gain_per_m = times(vehicle.curvature_gain_per_m, 0.8, 1.2);
    vehicle.stability_factor_s2_per_m2 = times(vehicle.stability_factor_s2_per_m2, 0.5, 1.5);
    vehicle.aligning_gain_nm_s2_per_m = times(vehicle.aligning_gain_nm_s2_per_m, 0.5, 1.2);
    vehicle.column_damping_nm_s = times(vehicle.column_damping_nm_s, 0.5, 1.5);
    vehicle.far_time_s = times(vehicle.far_time_s, 0.9, 1.2);
    vehicle.near_time_s = times(vehicle.near_time_s, 0.5, 1.2);
    params.activity_lambda_min = times(1.0, 0.05, 0.5);
    params.law = f64::from(u8::from(rng.random_bool(0.5)));
    params
}

/// The sensors and the host.
struct Senders {
    wrong: Wrong,
    counters: [u8; 4],
    next_ms: [i64; 4],
    engage_from_ms: i64,
    authority: f64,
    probe: bool,
    has_yaw_rate: bool,
    wheel_offset: f64,
    /// What is frozen, or still.
    lane: [f64; 2],
    driver: f64,
    /// The driver has no hand on the wheel where friction holds it.
    lets_go: bool,
    /// A probe has a direction of its own, and so no mirror image.
    has_probe: bool,
}

impl Senders {
    fn new(seed: u64, wheel_offset: f64) -> Self {
        // A request that is high from the start is no rising edge.
        let is_high = is_engaged(seed) || seed % 6 == 1;
        Self {
            wrong: Wrong::default(),
            counters: [0; 4],
            next_ms: [0; 4],
            engage_from_ms: if is_high { 0 } else { 700 },
            authority: 1.0,
            probe: false,
            has_yaw_rate: !seed.is_multiple_of(5),
            wheel_offset,
            lane: [0.0; 2],
            driver: 0.0,
            lets_go: seed % 10 == 6,
            has_probe: seed.is_multiple_of(2),
        }
    }

    /// The next frame of a sender as it is, and mirrored.
    fn frames(&mut self, sender: usize, world: &World, params: &Params, applied: f64, ms: i64) -> [Frame; 2] {
        let wrong = &self.wrong;
        let counter = self.counters[sender].wrapping_add(wrong.counter[sender]);
        self.counters[sender] = counter.wrapping_add(1);
        let (wheel, aligning) = world.column(params);
        if !wrong.lane_frozen {
            self.lane = world.seen[wrong.camera.0];
        }
        if !wrong.driver_still {
            let rest = aligning - applied;
            let held = if self.lets_go && rest.abs() < 0.6 {
                0.0
            } else {
                rest
            };
            // The last bits move.
            self.driver = held + wrong.push + LSB_NM * f64::from(counter % 7);
        }
        let frames = [1.0, -1.0].map(|side| match sender {
            0 => LanePreview {
                e_y: Metres::from_m(side * self.seen(0, 1.0 / 8192.0)),
                e_theta: Radians::from_rad(side * self.seen(1, 1.0 / 65_536.0)),
                age: Micros::from_us(wrong.camera.0 as u32 * 1000 + u32::from(counter % 7) * 100),
                valid: !wrong.invalid,
            }
            .encode(counter),
            1 => {
                let wheel = counts(
                    wheel * wrong.wheel_scale + self.wheel_offset,
                    1e-2_f64.to_radians(),
                );
                Column {
                    driver_torque: Torque::from_nm(side * counts(self.driver, LSB_NM)),
                    wheel_angle: Radians::from_rad(side * wheel),
                    motor_torque: Torque::from_nm(side * counts(wrong.motor * applied, LSB_NM)),
                }
                .encode(counter)
            }
            2 => {
                let [scale, more] = wrong.yaw_rate;
                let yaw_rate = TurningRate::from_rad_per_s(side * counts(world.rate * scale + more, LSB_NM));
                Vehicle {
                    speeds: wrong
                        .speeds
                        .map(|by| Speed::from_m_per_s((world.v + by).max(0.0))),
                    yaw_rate: (self.has_yaw_rate && !wrong.no_yaw_rate).then_some(yaw_rate),
                }
                .encode(counter)
            }
            _ => Request {
                engage: wrong.request.unwrap_or(ms >= self.engage_from_ms),
                authority: Ratio::from_si(self.authority),
                probe: self.probe,
            }
            .encode(counter),
        });
        frames.map(|frame| spoilt(&frame, counter, wrong.range[sender], wrong.bit[sender]))
    }

    fn seen(&self, which: usize, lsb: f64) -> f64 {
        counts(
            (self.lane[which] + self.wrong.other_line[which]) * self.wrong.lane_scale,
            lsb,
        )
    }

    fn period_ms(&self, sender: usize) -> i64 {
        match sender {
            _ if self.wrong.every_step[sender] => 1,
            0 => self.wrong.camera.1,
            1 => 2,
            _ => 10,
        }
    }
}

/// A frame with a value out of its range, or with a flipped bit; one of the last bits makes it short.
fn spoilt(frame: &Frame, counter: u8, range: bool, bit: Option<u32>) -> Frame {
    let mut bytes: [u8; 8] = frame.data().try_into().unwrap();
    if range {
        // Beyond 4 m, 20 N.m, 90 m/s and an authority of 1.
        let (place, value) = match frame.id() {
            0x100 => (3, 0x0F),
            0x110 => (3, 0x1F),
            0x120 => (3, 0x7F),
            _ => (2, 0x1F),
        };
        bytes[place] = value;
        let message = MESSAGES.iter().find(|message| message.id == frame.id()).unwrap();
        message.protection.protect(&mut bytes, counter);
    }
    if let Some(bit) = bit {
        bytes[bit as usize / 8] ^= 1 << (bit % 8);
    }
    let length = if bit == Some(63) { 7 } else { 8 };
    Frame::new(frame.id(), &bytes[..length]).unwrap()
}

fn is_engaged(seed: u64) -> bool {
    seed.is_multiple_of(14)
}

/// Another speed, another place on the road, another request, another bend.
fn change(world: &mut World, senders: &mut Senders, rng: &mut SmallRng) {
    // m/s2 to the side: gentle bends where friction may hold the wheel.
    let sideways = if senders.lets_go { 0.4 } else { 2.0 };
    match rng.random_range(0..6) {
        0 => world.v_wanted = rng.random_range(-3.0_f64..40.0).max(0.0),
        1 => world.aside = rng.random_range(-1.0..1.0),
        2 => senders.authority = [1.0, rng.random_range(0.0..1.0)][rng.random_range(0..2)],
        3 => senders.probe = !senders.probe && senders.has_probe,
        _ => world.bend_wanted = rng.random_range(-sideways..sideways) / world.v.max(8.0),
    }
}

/// Drives for so long. The steps that were compared in each mode, each fault that there was, and whether a tie ended it.
fn drive(seed: u64, ms: i64) -> ([u32; 7], FaultSet, bool) {
    let rng = &mut SmallRng::seed_from_u64(seed);
    let params = if seed.is_multiple_of(4) {
        Params::PAPER
    } else {
        parameters(rng)
    };
    let mut ecus = Ecus::new(seed, &params, u32::MAX - rng.random_range(0..10_000_000));
    let mut world = World::new(rng.random_range(7.0..35.0));
    let mut senders = Senders::new(seed, rng.random_range(-0.05..0.05));
    let mut asks_for_ms = if senders.engage_from_ms == 0 { 800 } else { 60 };
    let wrongs_per_ms = if senders.lets_go { 1e-4 } else { 1.2e-3 };
    // What is wrong until when.
    let mut wrongs: Vec<(u32, usize, [f64; 3], i64)> = Vec::new();
    let (mut by_mode, mut ever) = ([0; 7], FaultSet::NONE);
    for ms in 0..ms {
        let us = ecus.us;
        wrongs.retain(|(.., until)| *until > us);
        if ms > 600 && rng.random_bool(wrongs_per_ms) {
            let kind = rng.random_range(0..Wrong::KINDS);
            // A few late steps are a fault for good.
            let longest: f64 = if kind == Wrong::KINDS - 1 { 4e3 } else { 2e6 };
            let lasts = longest.powf(rng.random_range(0.5..1.0)) as i64;
            let sizes = core::array::from_fn(|_| rng.random_range(-1.0..1.0));
            wrongs.push((kind, rng.random_range(0..4), sizes, us + lasts));
        }
        senders.wrong = Wrong::default();
        wrongs
            .iter()
            .for_each(|(kind, sender, sizes, _)| senders.wrong.add(*kind, *sender, *sizes));
        if rng.random_bool(1.0 / 1500.0) {
            change(&mut world, &mut senders, rng);
        }
        ecus.us += senders.wrong.tick_us;
        world.step(&params, senders.wrong.tick_us as f64 * 1e-6);
        ecus.context = format!("seed {seed}, {:?}", senders.wrong);
        if senders.wrong.foreign && rng.random_bool(0.01) {
            let id = [0x0C0, 0x350, 0x555][rng.random_range(0..3)];
            let frame = Frame::new(id, &[0; 8]).unwrap();
            ecus.send(&frame, &frame);
        }
        for sender in 0..4 {
            if ms < senders.next_ms[sender] {
                continue;
            }
            senders.next_ms[sender] = ms + senders.period_ms(sender);
            let [frame, mirrored] = senders.frames(sender, &world, &params, ecus.applied, ms);
            if !senders.wrong.silent[sender] {
                ecus.send(&frame, &mirrored);
            }
        }
        let Some(step) = ecus.step() else {
            return (by_mode, ever, true);
        };
        by_mode[step.command.mode as usize] += 1;
        ever = ever.union(step.command.faults);
        match step.command.mode {
            // A new request some time after the last one ended.
            Mode::Standby if ms >= senders.engage_from_ms + asks_for_ms => {
                asks_for_ms = 60;
                senders.engage_from_ms = ms + rng.random_range(50..700);
            }
            Mode::Fault => break,
            _ => {}
        }
    }
    (by_mode, ever, false)
}

#[test]
fn every_step_of_random_drives_is_as_the_documents_say_mirrored_and_at_any_time() {
    let drives: u64 = std::env::var("HAPTIC_DRIVES").map_or(40, |text| text.parse().unwrap());
    let (mut by_mode, mut ever, mut ties) = ([0; 7], FaultSet::NONE, 0);
    for seed in 0..drives {
        let ms = if seed % 10 == 6 { 45_000 } else { 15_000 };
        let (modes, faults, is_tie) = drive(seed, ms);
        by_mode.iter_mut().zip(modes).for_each(|(all, more)| *all += more);
        ever = ever.union(faults);
        ties += u64::from(is_tie);
    }
    println!("steps by mode {by_mode:?}, {ties} ties");
    assert!(ties <= drives / 4, "{ties} of {drives} drives end early");
    assert!(by_mode[1..6].iter().all(|steps| *steps > 0) && by_mode[2] > by_mode[1]);
    // Every fault of an input, and what bus, clock, motor and driver can do.
    let expected = FaultSet::INPUT
        .with(Fault::Deadline)
        .with(Fault::HandsOff)
        .with(Fault::YawRate);
    assert_eq!(expected.difference(ever), FaultSet::NONE);
}
