//! Our side of the comparison with `closed_loop.c` and `closed_loop.py`: the simulator's loop with the shipping
//! controller behind its bus, one run of the evaluation's course, timed. Prints one JSON object with the peers'
//! field names. The road is built outside the time, as theirs is. `--ecu c` puts C's kind of ECU in the place of the
//! shipping one: protected frames and the law in float64, and nothing else.
//!
//!     cargo run --release --example closed_loop -p haptic-guidance -- --repeat 20

use cpu_time::ThreadTime;
use haptic_core::bus::e2e::Protection;
use haptic_core::controller::params::Params;
use haptic_sim::guidance::{Actuation, Guidance, Observation};
use haptic_sim::models::sensors;
use haptic_sim::scenario::Scenario;
use haptic_sim::simulation::{Run, Simulation, simulate};
use std::hint::black_box;

/// One run. A function of its own so that callgrind can count what is below it.
#[inline(never)]
fn one_run(scenario: &Scenario) -> Run {
    simulate(scenario)
}

#[inline(never)]
fn run_with_c_s_ecu(scenario: &Scenario) -> Run {
    Simulation::with(scenario, Light::default()).run()
}

const USAGE: &str = "usage: closed_loop [--ecu shipping|c] [--repeat N], the fastest of N runs is timed";

fn main() {
    let (mut repeat, mut one_run): (u32, fn(&Scenario) -> Run) = (1, one_run);
    let mut arguments = std::env::args().skip(1);
    while let Some(option) = arguments.next() {
        match (option.as_str(), arguments.next().as_deref()) {
            ("--repeat", Some(n)) if n.parse::<u32>().is_ok_and(|n| n > 0) => repeat = n.parse().unwrap_or(1),
            ("--ecu", Some("shipping")) => {}
            ("--ecu", Some("c")) => one_run = run_with_c_s_ecu,
            _ => {
                eprintln!("{USAGE}");
                std::process::exit(2);
            }
        }
    }
    let frame = Link::new(0x22).send([1, 2]).to_le_bytes();
    assert!(Protection::new(0x22).is_intact(&frame), "a CRC as core has it");
    let scenario = Scenario::default();
    let _built = scenario.course().centreline();
    let mut processor_seconds = f64::INFINITY;
    let (mut steps, mut peak_m) = (0, 0.0);
    for _ in 0..repeat {
        let start = ThreadTime::now();
        let run = one_run(&scenario);
        processor_seconds = processor_seconds.min(start.elapsed().as_secs_f64());
        assert!(!run.diverged(), "a run that diverged is no measure");
        steps = run.steps;
        let in_window = run
            .trace
            .samples
            .iter()
            .filter(|s| (1080.0..=1740.0).contains(&s.s_m));
        peak_m = in_window.map(|s| s.lateral_error_m.abs()).fold(0.0, f64::max);
    }
    let simulated_seconds = f64::from(steps) * 1e-3;
    println!(
        "{}",
        serde_json::json!({
            "program": "haptic-guidance",
            "sensors": "paper",
            "simulated_seconds": simulated_seconds,
            "processor_seconds": processor_seconds,
            "times_real_time": simulated_seconds / processor_seconds,
            "steps": steps,
            "peak_lateral_error_m": peak_m,
        })
    );
}

/// C's kind of ECU, as `closed_loop.c` has it: a lane frame at 120 Hz, a column frame and a torque frame each
/// millisecond, packed, protected, checked and unpacked; the law in float64. No mode, no envelope, no monitor.
#[derive(Debug, Clone)]
struct Light {
    gains: Params,
    lane: Link,
    column: Link,
    command: Link,
    law: Law,
    torque_nm: f64,
    /// The sum of the decoded column frames: their reader, so that no work is optimised away.
    column_sum: f64,
}

#[derive(Debug, Clone)]
struct Link {
    /// The data ID of each counter.
    ids: [u8; 16],
    sent: u8,
    seen: u8,
}

#[derive(Debug, Clone, Default)]
struct Law {
    primed: bool,
    time_s: f64,
    errors: [f64; 2],
    rates: [f64; 2],
}

const LSB_OF_E_Y_M: f64 = 1.0 / 8192.0;
const LSB_OF_E_THETA_RAD: f64 = 1.0 / 65536.0;
const LSB_OF_T_D_NM: f64 = 0.005;
const LSB_OF_PHI_RAD: f64 = 0.1 * std::f64::consts::PI / 180.0;
const LSB_OF_T_H_NM: f64 = 0.001;

const DATA_IDS: [u8; 16] = [
    0xD9, 0xAD, 0xC1, 0x0B, 0x75, 0xF8, 0xE0, 0x7C, 0x7A, 0xE6, 0xAE, 0x92, 0x9B, 0x3E, 0xEA, 0x5E,
];

/// The remainder of a byte followed by so many zero bytes, polynomial 0x2F.
static SLICES: [[u8; 256]; 8] = {
    let mut slices = [[0; 256]; 8];
    let mut n = 0;
    while n < 8 * 256 {
        let (zeros, byte) = (n / 256, n % 256);
        let mut rest = if zeros == 0 {
            byte as u8
        } else {
            slices[zeros - 1][byte]
        };
        let mut bit = 0;
        while bit < 8 {
            rest = (rest << 1) ^ if rest & 0x80 != 0 { 0x2F } else { 0 };
            bit += 1;
        }
        slices[zeros][byte] = rest;
        n += 1;
    }
    slices
};

/// The CRC of a frame, whose bytes from the second on are in place: slicing by eight, as C does, so that the look-ups do not
/// wait for each other.
fn crc8(frame: u64, id: u8) -> u8 {
    let byte = |i: usize| usize::from((frame >> (8 * i)) as u8);
    let first = SLICES[7][byte(1) ^ 0xFF] ^ SLICES[0][usize::from(id)];
    (2..8).fold(first, |crc, i| crc ^ SLICES[8 - i][byte(i)]) ^ 0xFF
}

impl Link {
    fn new(constant: u8) -> Self {
        Self {
            ids: DATA_IDS.map(|id| id ^ constant),
            sent: 15,
            seen: 15,
        }
    }

    /// A frame, its first byte the lowest.
    fn send(&mut self, [a, b]: [i16; 2]) -> u64 {
        self.sent = (self.sent + 1) & 15;
        let signals = u64::from(a as u16) << 16 | u64::from(b as u16) << 32;
        let frame = signals | 0x1000 | u64::from(self.sent) << 8;
        // Hides the frame from the compiler, which leaves out CRC and check where it sees both ends.
        black_box(frame | u64::from(crc8(frame, self.ids[usize::from(self.sent)])))
    }

    fn receive(&mut self, frame: u64) -> Option<[i16; 2]> {
        let counter = (frame >> 8) as u8 & 15;
        if frame as u8 != crc8(frame, self.ids[usize::from(counter)]) || counter == self.seen {
            return None;
        }
        self.seen = counter;
        Some([(frame >> 16) as i16, (frame >> 32) as i16])
    }
}

/// Rounded half away from zero, saturated.
fn code(value: f64, lsb: f64) -> i16 {
    let code = value / lsb;
    (code + 0.5_f64.copysign(code)) as i16
}

impl Default for Light {
    fn default() -> Self {
        Self {
            gains: Params::PAPER,
            lane: Link::new(0x11),
            column: Link::new(0x22),
            command: Link::new(0x5A),
            law: Law::default(),
            torque_nm: 0.0,
            column_sum: 0.0,
        }
    }
}

impl Law {
    fn sample(&mut self, time_s: f64, errors: [f64; 2], corner_hz: f64) {
        let dt = time_s - self.time_s;
        if self.primed && dt > 0.0 {
            let w_dt = std::f64::consts::TAU * corner_hz * dt;
            let gain = w_dt / (1.0 + w_dt);
            for (i, rate) in self.rates.iter_mut().enumerate() {
                *rate += gain * ((errors[i] - self.errors[i]) / dt - *rate);
            }
        }
        (self.primed, self.time_s, self.errors) = (true, time_s, errors);
    }

    fn torque_nm(&self, p: &Params) -> f64 {
        let ([e_y, e_theta], [y_rate, theta_rate]) = (self.errors, self.rates);
        let torque = p.k_1 * (p.a_1 * e_y + p.a_2 * y_rate + p.a_3 * e_theta + p.a_4 * theta_rate);
        torque.max(-p.torque_limit_nm).min(p.torque_limit_nm)
    }
}

impl Guidance for Light {
    fn looks_at_road(&self, step: u32) -> bool {
        sensors::camera_looks(step)
    }

    #[inline]
    fn step(&mut self, observation: &Observation) -> Actuation {
        if let Some(errors) = observation.lane {
            let codes = [
                code(errors.e_y_m, LSB_OF_E_Y_M),
                code(errors.e_theta_rad, LSB_OF_E_THETA_RAD),
            ];
            let frame = self.lane.send(codes);
            if let Some([a, b]) = self.lane.receive(frame) {
                let seen = [f64::from(a) * LSB_OF_E_Y_M, f64::from(b) * LSB_OF_E_THETA_RAD];
                self.law.sample(
                    f64::from(observation.step) * 1e-3,
                    seen,
                    self.gains.rate_corner_hz,
                );
            }
        }
        let codes = [
            code(observation.driver_torque_nm, LSB_OF_T_D_NM),
            code(observation.wheel_angle_rad, LSB_OF_PHI_RAD),
        ];
        let frame = self.column.send(codes);
        if let Some([a, b]) = self.column.receive(frame) {
            self.column_sum += f64::from(a) * LSB_OF_T_D_NM + f64::from(b) * LSB_OF_PHI_RAD;
        }
        let frame = self
            .command
            .send([code(self.law.torque_nm(&self.gains), LSB_OF_T_H_NM), 0]);
        if let Some([a, _]) = self.command.receive(frame) {
            self.torque_nm = f64::from(a) * LSB_OF_T_H_NM;
        }
        // The sum keeps its reader; it is never a thousand million.
        Actuation {
            torque_nm: self.torque_nm,
            limited: self.column_sum.abs() > 1e12,
        }
    }
}
