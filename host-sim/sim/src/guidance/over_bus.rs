//! The shipping ECU behind its bus: sensors with the paper's resolution, frames with counter and CRC, and the
//! torque as the actuator reads it from the guidance frame. What the ECU says of itself is read there too, and in telemetry.
//!
//! The bus has no latency here: a frame arrives in the step in which it was sent, and the torque acts from
//! that step on. The actuator keeps the last good torque, as the ECU's own frame never fails on this bus.

use haptic_core::bus::Frame;
use haptic_core::bus::e2e::ReceiverState;
use haptic_core::bus::messages::{
    Column, Guidance as GuidanceMessage, LanePreview, Message, Request, Telemetry, Vehicle,
};
use haptic_core::controller::config::Setup;
use haptic_core::ecu::{Ecu, Step};
use haptic_core::quantity::{Instant, Metres, Micros, Radians, Ratio, Speed, Torque, TurningRate};
use heapless::Vec;

use super::{Actuation, Guidance, Observation, Status, is_limited};
use crate::models::sensors;

/// The column's sensors send every 2 ms.
const COLUMN_PERIOD_STEPS: u32 = 2;
/// Speeds and the host's request come every 10 ms.
const HOST_PERIOD_STEPS: u32 = 10;
/// One frame of each sender in a step.
const MAX_FRAMES: usize = 4;
/// The guidance frame, a warning, a line of the fault history and telemetry.
const MAX_ANSWERS: usize = 4;

/// The ECU, its sensors and its actuator on one bus. Every sender is trusted and the guidance active from the
/// start, as the paper's studies have it.
#[derive(Debug, Clone)]
pub struct OverBus {
    ecu: Ecu,
    lane_counter: u8,
    sent: Vec<Frame, MAX_FRAMES>,
    answers: Vec<Frame, MAX_ANSWERS>,
    actuator: ReceiverState,
    applied: Actuation,
    display: ReceiverState,
    status: Status,
    /// What each wheel speed is more than the vehicle's, m/s.
    slips_m_per_s: [f64; 2],
}

impl OverBus {
    /// A bus on which nothing was sent yet.
    pub fn new(setup: &Setup) -> Self {
        Self {
            ecu: Ecu::engaged(setup, Instant::from_us(0)),
            lane_counter: 0,
            sent: Vec::new(),
            answers: Vec::new(),
            actuator: ReceiverState::TRUSTED,
            applied: Actuation::default(),
            display: ReceiverState::TRUSTED,
            status: Status::GUIDES,
            slips_m_per_s: [0.0; 2],
        }
    }

    /// Makes the two speeds on the bus differ from the vehicle's by so much, m/s, until the next call: wheels that slip, or a
    /// source that drifts. They are no less than zero.
    pub fn slip(&mut self, slips_m_per_s: [f64; 2]) {
        self.slips_m_per_s = slips_m_per_s;
    }

    /// The frames that the senders put on the bus in this step.
    fn send(&mut self, observation: &Observation) {
        self.sent.clear();
        // MAX_FRAMES has a place for each of the four, so no push fails.
        if let Some(errors) = observation.lane {
            let preview = LanePreview {
                e_y: Metres::from_m(errors.e_y_m),
                e_theta: Radians::from_rad(errors.e_theta_rad),
                age: Micros::from_ms(observation.lane_age_ms),
                valid: true,
            };
            let _ = self.sent.push(preview.encode(self.lane_counter));
            self.lane_counter = self.lane_counter.wrapping_add(1);
        }
        if observation.step.is_multiple_of(COLUMN_PERIOD_STEPS) {
            let column = Column {
                driver_torque: Torque::from_nm(sensors::torque_nm(observation.driver_torque_nm)),
                wheel_angle: Radians::from_rad(sensors::wheel_angle_rad(observation.wheel_angle_rad)),
                motor_torque: Torque::from_nm(observation.motor_torque_nm),
            };
            let _ = self
                .sent
                .push(column.encode((observation.step / COLUMN_PERIOD_STEPS) as u8));
        }
        if observation.step.is_multiple_of(HOST_PERIOD_STEPS) {
            let counter = (observation.step / HOST_PERIOD_STEPS) as u8;
            let speed = |slip_m_per_s: f64| (observation.speed_m_per_s + slip_m_per_s).max(0.0);
            let vehicle = Vehicle {
                speeds: self.slips_m_per_s.map(|slip| Speed::from_m_per_s(speed(slip))),
                yaw_rate: observation.yaw_rate_rad_per_s.map(TurningRate::from_rad_per_s),
            };
            let _ = self.sent.push(vehicle.encode(counter));
            let request = Request {
                engage: observation.request.engage,
                authority: Ratio::from_si(observation.request.authority),
                probe: observation.request.probe,
            };
            let _ = self.sent.push(request.encode(counter));
        }
    }

    /// A step: the frames to the ECU, its step, its frames back.
    #[inline]
    pub(super) fn exchange(
        &mut self,
        observation: &Observation,
        step: impl FnOnce(&mut Ecu, Instant) -> Step,
    ) -> Actuation {
        let now = observation.now();
        self.send(observation);
        for frame in &self.sent {
            // The ECU judges by itself, keeps the last good frame and reports what it misses.
            let _ = self.ecu.receive(frame, now);
        }
        let step = step(&mut self.ecu, now);
        self.answers.clear();
        // MAX_ANSWERS has a place for each.
        let _ = self.answers.push(step.guidance);
        let _ = self.answers.extend_from_slice(&step.others);
        let telemetry = self.ecu.background_step();
        self.answers.extend(telemetry);
        if let Ok(guidance) = GuidanceMessage::decode(&mut self.actuator, &step.guidance) {
            self.applied = Actuation {
                torque_nm: guidance.torque.nm(),
                limited: is_limited(guidance.limit),
            };
            self.status = Status {
                mode: guidance.mode,
                faults: guidance.faults,
                warning: guidance.warning,
                ..self.status
            };
        }
        if let Some(Ok(said)) = telemetry.map(|frame| Telemetry::decode(&mut self.display, &frame)) {
            self.status.k_hg = said
                .k_hg
                .map(|reading| [reading.k_hg.si(), reading.deviation.si()]);
        }
        self.applied
    }
}

impl Guidance for OverBus {
    fn looks_at_road(&self, step: u32) -> bool {
        sensors::camera_looks(step)
    }

    #[inline]
    fn step(&mut self, observation: &Observation) -> Actuation {
        self.exchange(observation, Ecu::step)
    }

    fn status(&self) -> Option<Status> {
        Some(self.status)
    }

    fn frames_in(&self) -> &[Frame] {
        &self.sent
    }

    fn frames_out(&self) -> &[Frame] {
        &self.answers
    }
}
