//! The ECU behind the bar: what it makes of the hands where its parameters say what the sensor is, and where they are wrong.
//!
//! The car goes straight on a banked road at 60 km/h, so that guidance acts, with the column's assist; the ECU hears the bar (or, in one
//! row, hands that nothing measures in such a car) and the angle of the column every 2 ms.

use haptic_core::bus::messages::{Column, LanePreview, Message, Request, Vehicle as VehicleFrame};
use haptic_core::controller::config::Setup;
use haptic_core::controller::params::Params;
use haptic_core::ecu::{Boot, Ecu, Step};
use haptic_core::quantity::{Instant, Metres, Micros, Radians, Ratio, Speed, Torque, TurningRate};
use haptic_core::safety::faults::Fault;
use haptic_core::safety::modes::Mode;
use haptic_engine::StudyError;
use haptic_sim::models::torsion_bar::BarPlant;
use haptic_sim::parts::{Acting, Vehicle};
use haptic_sim::scenario::ScenarioError;
use serde::Serialize;

use super::{ColumnFile, believed, no_observer};

/// Speed, m/s, and bank of the road, rad.
const SPEED: f64 = 60.0 / 3.6;
const BANK_RAD: f64 = 0.02;
/// When guidance is asked for, when the hands do something, and the end, ms.
const ENGAGED_MS: u32 = 800;
const ACTS_MS: u32 = 8_000;
const END_MS: u32 = 45_000;
/// How hard the hands push against guidance, N.m.
pub const PUSH_NM: f64 = 3.0;
/// For how long, ms.
const PUSHES_MS: u32 = 300;
/// Stiffness and damping of hands that rest, N.m/rad and N.m.s/rad, and how they move beside it, N.m and Hz.
const RESTS: [f64; 4] = [5.0, 0.3, 0.3, 0.4];

/// What reaches the ECU as the column's torque.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Delivered {
    Bar,
    Hands,
}

/// What the hands do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Hands {
    Off,
    Rest,
    /// Pushes with [`PUSH_NM`] against guidance, from [`ACTS_MS`] on.
    Push,
}

/// A car whose ECU believes something of its sensor.
struct Loop {
    ecu: Ecu,
    plant: BarPlant,
    delivered: Delivered,
    probe: bool,
    hands_nm: f64,
    applied_nm: f64,
}

impl Loop {
    fn new(file: &ColumnFile, believed: &Params, delivered: Delivered) -> Result<Self, StudyError> {
        let setup = Setup::new(believed).map_err(no_observer)?;
        Ok(Self {
            ecu: Ecu::new(Some(&setup), Boot::default(), Instant::from_us(0)),
            plant: plant(file)?,
            delivered,
            probe: false,
            hands_nm: 0.0,
            applied_nm: 0.0,
        })
    }

    fn hear(&mut self, ms: u32) {
        let motion = self.plant.motion();
        let torque_nm = match self.delivered {
            Delivered::Bar => self.plant.sensor_torque_nm(),
            Delivered::Hands => self.hands_nm,
        };
        let [_, near_m] = self.plant.ahead_m(0.3 * SPEED);
        let lane = LanePreview {
            e_y: Metres::from_m(-near_m),
            e_theta: Radians::from_rad(motion.sideslip_rad - motion.direction_rad),
            age: Micros::from_us(0),
            valid: true,
        };
        let column = Column {
            driver_torque: Torque::from_nm(torque_nm),
            wheel_angle: Radians::from_rad(self.plant.column_angle_rad()),
            motor_torque: Torque::from_nm(self.plant.guidance_torque_nm()),
        };
        let moves = VehicleFrame {
            speeds: [Speed::from_m_per_s(SPEED); 2],
            yaw_rate: Some(TurningRate::from_rad_per_s(motion.yaw_rate_rad_per_s)),
        };
        let request = Request {
            engage: ms >= ENGAGED_MS,
            authority: Ratio::ONE,
            probe: self.probe && ms > ENGAGED_MS + 2000,
        };
        let frames = [
            (8, lane.encode(counter(ms / 8))),
            (2, column.encode(counter(ms / 2))),
            (10, moves.encode(counter(ms / 10))),
            (10, request.encode(counter(ms / 10))),
        ];
        for (_, frame) in frames.iter().filter(|(period, _)| ms.is_multiple_of(*period)) {
            // Until a sender has shown three clean frames it is not trusted.
            let _ = self.ecu.receive(frame, Instant::from_us(1000 * ms));
        }
    }

    fn step(&mut self, ms: u32, hands: Hands) -> Step {
        let motion = self.plant.motion();
        let (angle, rate) = (motion.wheel_angle_rad, motion.wheel_rate_rad_per_s);
        let [stiffness, damping, moves_nm, moves_hz] = RESTS;
        let moves = moves_nm * (std::f64::consts::TAU * moves_hz * 1e-3 * f64::from(ms)).sin();
        self.hands_nm = match hands {
            // Whoever asks for guidance is there.
            _ if ms < ENGAGED_MS => -stiffness * angle - damping * rate,
            Hands::Push if ms >= ACTS_MS => PUSH_NM * -self.applied_nm.signum(),
            Hands::Off | Hands::Push => 0.0,
            Hands::Rest => moves - stiffness * angle - damping * rate,
        };
        self.hear(ms);
        let step = self.ecu.step(Instant::from_us(1000 * ms));
        self.applied_nm = if step.permitted {
            step.command.torque.nm()
        } else {
            0.0
        };
        self.plant.step(&Acting {
            driver_torque_nm: self.hands_nm,
            guidance_torque_nm: self.applied_nm,
            speed_m_per_s: [SPEED; 2],
            bank_rad: BANK_RAD,
        });
        step
    }
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "a counter is cut to its four bits"
)]
fn counter(turn: u32) -> u8 {
    turn as u8
}

fn plant(file: &ColumnFile) -> Result<BarPlant, ScenarioError> {
    Ok(file.plant()?.with_assist(file.one_curve().1.assist()))
}

/// What a belief does.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// What the parameters say, and what is so.
    pub believed: &'static str,
    /// Without a hand: when the driver is warned, s after guidance began; none within 44 s.
    pub warned_s: Option<f64>,
    /// Likewise beside the probe.
    pub warned_beside_probe_s: Option<f64>,
    /// Likewise where hands rest on the wheel: a warning would be false.
    pub falsely_warned_s: Option<f64>,
    /// Hands that push against guidance have half of it away after so long, ms.
    pub yields_ms: Option<u32>,
    /// The fault but hands off that the ECU finds first in each of these, and after how many s.
    pub found: Vec<(String, f64)>,
}

#[derive(Debug, Default)]
struct Seen {
    warned_ms: Option<u32>,
    yields_ms: Option<u32>,
    found: Option<(Fault, u32)>,
}

/// Drives one way, until guidance ends: when the driver is warned, when half of the torque is away, and what is found.
fn drive(
    file: &ColumnFile,
    of: &Params,
    delivered: Delivered,
    (probe, hands): (bool, Hands),
) -> Result<Seen, StudyError> {
    let mut car = Loop::new(file, of, delivered)?;
    car.probe = probe;
    let (mut seen, mut before_nm) = (Seen::default(), f64::NAN);
    let [begins_ms, end_ms] = match hands {
        Hands::Push => [ACTS_MS, ACTS_MS + PUSHES_MS],
        Hands::Off | Hands::Rest => [ENGAGED_MS, END_MS],
    };
    for ms in 1..=end_ms {
        let command = car.step(ms, hands).command;
        if ms == begins_ms {
            before_nm = car.applied_nm.abs();
        }
        let passed_ms = ms.saturating_sub(begins_ms);
        if passed_ms == 0 {
            continue;
        }
        let new = |fault| command.faults.contains(fault).then_some(passed_ms);
        seen.warned_ms = seen.warned_ms.or_else(|| new(Fault::HandsOff));
        let mut others = Fault::ALL.into_iter().filter(|fault| *fault != Fault::HandsOff);
        seen.found = seen
            .found
            .or_else(|| others.find_map(|fault| Some((fault, new(fault)?))));
        let yields = (car.applied_nm.abs() <= 0.5 * before_nm).then_some(passed_ms);
        seen.yields_ms = seen.yields_ms.or(yields);
        if command.mode != Mode::Active {
            break;
        }
    }
    Ok(seen)
}

/// Every belief beside what is so.
///
/// # Errors
/// A column that cannot be, or that the ECU cannot be told of.
pub fn run(file: &ColumnFile) -> Result<Vec<Row>, StudyError> {
    let right = believed(file, 0.002, Params::PAPER.observer_bandwidth_rad_per_s);
    let wrong = |inertia: f64, stiffness: f64| Params {
        wheel_inertia_kg_m2: inertia * right.wheel_inertia_kg_m2,
        bar_stiffness_nm_per_rad: stiffness * right.bar_stiffness_nm_per_rad,
        ..right
    };
    let rows = [
        ("as it is", right, Delivered::Bar),
        ("half of J_w", wrong(0.5, 1.0), Delivered::Bar),
        ("twice J_w", wrong(2.0, 1.0), Delivered::Bar),
        ("half of K_tb", wrong(1.0, 0.5), Delivered::Bar),
        ("twice K_tb", wrong(1.0, 2.0), Delivered::Bar),
        ("hands, where a bar is", Params::PAPER, Delivered::Bar),
        ("a bar, where hands are", right, Delivered::Hands),
    ];
    let row = |(words, of, delivered): (&'static str, Params, Delivered)| {
        let drive = |way| drive(file, &of, delivered, way);
        let seen = [
            drive((false, Hands::Off))?,
            drive((true, Hands::Off))?,
            drive((false, Hands::Rest))?,
            drive((false, Hands::Push))?,
        ];
        let [warned_s, warned_beside_probe_s, falsely_warned_s, _] = seen
            .each_ref()
            .map(|seen| seen.warned_ms.map(|ms| 1e-3 * f64::from(ms)));
        let found = seen.iter().filter_map(|seen| seen.found);
        Ok(Row {
            believed: words,
            warned_s,
            warned_beside_probe_s,
            falsely_warned_s,
            yields_ms: seen[3].yields_ms,
            found: found
                .map(|(fault, ms)| (format!("{fault:?}"), 1e-3 * f64::from(ms)))
                .collect(),
        })
    };
    rows.into_iter().map(row).collect()
}
