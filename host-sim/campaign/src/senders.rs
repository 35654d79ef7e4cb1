//! The nodes that talk to the ECU, and what is wrong with their values: readings in, frames out.
//!
//! A sender encodes what it believes with the shipping encoders; what must not agree with the core by
//! construction is read and forged with `bytes`.

use haptic_core::bus::Frame;
use haptic_core::bus::messages::{Column, LanePreview, Message, Request, Vehicle};
use haptic_core::quantity::{Metres, Micros, Radians, Ratio, Speed, Torque, TurningRate};
use rand::rngs::Xoshiro256PlusPlus;
use rand_distr::{Distribution, StandardNormal};

use super::bytes::MESSAGES;
use super::injection::{Change, Injection, RequestFault, Signal, first_of};
use haptic_sim::guidance::Observation;
use haptic_sim::models::sensors;

const COLUMN_PERIOD_MS: u32 = 2;
const HOST_PERIOD_MS: u32 = 10;
/// t'_f, and the time that the vehicle needs from the near point to the far point, s.
const FAR_TIME_S: f64 = 0.7;
const BETWEEN_S: f64 = 0.4;

/// What the senders believe in one step.
#[derive(Debug, Clone, Copy)]
pub(super) struct SensorReadings {
    pub(super) lane: Option<(f64, f64)>,
    pub(super) lane_valid: bool,
    pub(super) column: Option<(f64, f64)>,
    pub(super) speeds_m_per_s: Option<[f64; 2]>,
    pub(super) yaw_rate_rad_per_s: Option<f64>,
    /// The motor's torque as the column tells it, N.m.
    pub(super) motor_torque_nm: f64,
}

/// The senders with their counters, and the values that a fault remembers.
#[derive(Debug, Clone, Default)]
pub(super) struct Senders {
    counters: [u8; MESSAGES.len()],
    /// By signal: the value at the onset.
    held: [Option<f64>; Signal::COUNT],
    toggled: bool,
    requests: u32,
    /// Whether the host wants the probe as well.
    pub(super) probe: bool,
    /// What the column's model takes for the aligning torque, N.m.s2/m.
    aligning_gain_nm_s2_per_m: f64,
}

impl Senders {
    pub(super) fn new(probe: bool, aligning_gain_nm_s2_per_m: f64) -> Self {
        Self {
            aligning_gain_nm_s2_per_m,
            probe,
            ..Self::default()
        }
    }

    /// What is read in this step, with what is wrong with it `since_s` the onset.
    pub(super) fn read(
        &mut self,
        observation: &Observation,
        acting: &[Injection],
        since_s: f64,
        noise: &mut Xoshiro256PlusPlus,
    ) -> SensorReadings {
        let mut read = |signal: Signal, truth: f64| {
            let changes = acting.iter().filter_map(|injection| match injection {
                Injection::Sensor(of, change) if *of == signal => Some(change),
                _ => None,
            });
            changes.fold(truth, |value, change| {
                let held = *self.held[signal as usize].get_or_insert(value);
                changed(change, value, held, since_s, noise)
            })
        };
        let at = |period: u32| observation.step.is_multiple_of(period);
        let speeds_m_per_s = at(HOST_PERIOD_MS).then(|| {
            [
                read(Signal::Speed1, observation.speed_m_per_s),
                read(Signal::Speed2, observation.speed_m_per_s),
            ]
        });
        let yaw_rate_rad_per_s = observation
            .yaw_rate_rad_per_s
            .filter(|_| at(HOST_PERIOD_MS))
            .map(|rate| read(Signal::YawRate, rate));
        let column = at(COLUMN_PERIOD_MS).then(|| {
            (
                read(
                    Signal::DriverTorque,
                    sensors::torque_nm(observation.driver_torque_nm),
                ),
                read(
                    Signal::WheelAngle,
                    sensors::wheel_angle_rad(observation.wheel_angle_rad),
                ),
            )
        });
        let motor_torque_nm = if column.is_some() {
            read(Signal::MotorTorque, observation.motor_torque_nm)
        } else {
            observation.motor_torque_nm
        };
        let lane = observation.lane.map(|errors| {
            (
                read(Signal::LateralError, errors.e_y_m),
                read(Signal::YawError, errors.e_theta_rad),
            )
        });
        let honest = SensorReadings {
            lane,
            lane_valid: !acting.contains(&Injection::Invalid),
            column,
            motor_torque_nm,
            speeds_m_per_s,
            yaw_rate_rad_per_s,
        };
        self.falsify(honest, observation, acting, since_s)
    }

    /// What a node that knows the checks makes of the readings, if there is one.
    fn falsify(
        &mut self,
        honest: SensorReadings,
        observation: &Observation,
        acting: &[Injection],
        since_s: f64,
    ) -> SensorReadings {
        if let Some((by_m, ms)) = first_of!(acting, Injection::BendsAway { by_m, ms } => (*by_m, *ms)) {
            let lasts_s = f64::from(ms) * 1e-3;
            // Half a wave of a cosine: how far it has gone, and how fast it goes.
            let phase = |at_s: f64| std::f64::consts::PI * (at_s / lasts_s).clamp(0.0, 1.0);
            let aside_m = 0.5 * by_m * (1.0 - phase(since_s).cos());
            let m_per_s = 0.5 * by_m * std::f64::consts::PI / lasts_s * phase(since_s + BETWEEN_S).sin();
            let lane = honest.lane.map(|(e_y_m, e_theta_rad)| {
                (e_y_m + aside_m, e_theta_rad + m_per_s / observation.speed_m_per_s)
            });
            return SensorReadings { lane, ..honest };
        }
        let false_lane =
            first_of!(acting, Injection::FalseLane { to_m, ms, hides_hand } => (*to_m, *ms, *hides_hand));
        let Some((to_m, ms, hides_hand)) = false_lane else {
            return honest;
        };
        let yaw_rate = observation.yaw_rate_rad_per_s.unwrap_or(0.0);
        let lane = honest.lane.map(|(e_y_m, _)| {
            let from_m = *self.held[Signal::LateralError as usize].get_or_insert(e_y_m);
            let share = (since_s * 1e3 / f64::from(ms)).min(1.0);
            (from_m + share * (to_m - from_m), FAR_TIME_S * yaw_rate)
        });
        let aligning_nm = self.aligning_gain_nm_s2_per_m * observation.speed_m_per_s * yaw_rate;
        let column = honest.column.map(|(driver_nm, wheel_rad)| {
            let hidden_nm = aligning_nm - observation.motor_torque_nm;
            (if hides_hand { hidden_nm } else { driver_nm }, wheel_rad)
        });
        SensorReadings {
            lane,
            column,
            ..honest
        }
    }

    /// Whether guidance is wanted in the command of this step; `high` without a fault.
    fn requests_guidance(&mut self, high: bool, acting: &[Injection]) -> bool {
        let Some(fault) = first_of!(acting, Injection::Request(fault) => *fault) else {
            return high;
        };
        self.toggled = !self.toggled;
        self.requests += 1;
        match fault {
            RequestFault::Ends => false,
            RequestFault::Drops(frames) => self.requests > frames,
            RequestFault::Toggles => !self.toggled,
        }
    }

    /// The frames of this step, in order of sending.
    pub(super) fn send(
        &mut self,
        observation: &Observation,
        readings: &SensorReadings,
        requested: bool,
        acting: &[Injection],
        frames: &mut Vec<Frame>,
    ) {
        let mut count = |sender: usize| {
            let counter = self.counters[sender];
            self.counters[sender] = counter.wrapping_add(1);
            counter
        };
        if let Some((e_y_m, e_theta_rad)) = readings.lane {
            let message = LanePreview {
                e_y: Metres::from_m(e_y_m),
                e_theta: Radians::from_rad(e_theta_rad),
                age: Micros::from_ms(observation.lane_age_ms),
                valid: readings.lane_valid,
            };
            frames.push(message.encode(count(0)));
        }
        if let Some((torque_nm, angle_rad)) = readings.column {
            let message = Column {
                driver_torque: Torque::from_nm(torque_nm),
                wheel_angle: Radians::from_rad(angle_rad),
                motor_torque: Torque::from_nm(readings.motor_torque_nm),
            };
            frames.push(message.encode(count(1)));
        }
        if let Some(speeds_m_per_s) = readings.speeds_m_per_s {
            let message = Vehicle {
                speeds: speeds_m_per_s.map(Speed::from_m_per_s),
                yaw_rate: readings.yaw_rate_rad_per_s.map(TurningRate::from_rad_per_s),
            };
            frames.push(message.encode(count(2)));
        }
        if observation.step.is_multiple_of(HOST_PERIOD_MS) {
            let counter = count(3);
            let message = Request {
                engage: self.requests_guidance(requested, acting),
                authority: Ratio::ONE,
                probe: self.probe,
            };
            frames.push(message.encode(counter));
        }
    }

    /// A sender that sends `count` frames where one is due goes on counting.
    pub(super) fn skip_counts(&mut self, id: u16, count: u8) {
        if let Some(sender) = MESSAGES.iter().position(|message| *message == id) {
            self.counters[sender] = self.counters[sender].wrapping_add(count);
        }
    }
}

fn changed(change: &Change, value: f64, held: f64, since_s: f64, noise: &mut Xoshiro256PlusPlus) -> f64 {
    match *change {
        Change::Frozen => held,
        Change::Times(factor) => factor * value,
        Change::Mirrored => 2.0 * held - value,
        Change::Plus(offset) => value + offset,
        Change::Drifting(per_s) => value + per_s * since_s,
        Change::Noisy(sd) => {
            let white: f64 = StandardNormal.sample(noise);
            value + sd * white
        }
        Change::StuckAt(constant) => constant,
        // By so much more than what is true changes: a lie about a speed that falls already lies as fast.
        Change::Approaching { value: end, per_s } => {
            let way = end - value;
            value + way.signum() * (per_s * since_s).min(way.abs())
        }
        Change::Growing { to, ms } => value * (1.0 + (to - 1.0) * (since_s * 1e3 / f64::from(ms)).min(1.0)),
        Change::Sliding { by, ms } => value + by * (since_s * 1e3 / f64::from(ms)).min(1.0),
        // A period of the host's messages up, one down.
        Change::Jumping(by) => {
            let up = ((since_s * 100.0).round() as u64).is_multiple_of(2);
            value + if up { by } else { -by }
        }
    }
}
