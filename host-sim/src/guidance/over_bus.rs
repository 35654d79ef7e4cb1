//! The shipping ECU behind its bus: sensors with the paper's resolution, frames with counter and CRC, and the
//! torque as the actuator reads it from the guidance frame.
//!
//! The bus has no latency here: a frame arrives in the step in which it was sent, and the torque acts from
//! that step on. The actuator keeps the last good torque, as the ECU's own frame never fails on this bus.

use haptic_core::bus::Frame;
use haptic_core::bus::e2e::ReceiverState;
use haptic_core::bus::messages::{Column, Guidance as GuidanceMessage, LanePreview, Message};
use haptic_core::ecu::Ecu;
use haptic_core::envelope::LimitReason;
use haptic_core::params::Config;
use haptic_core::quantity::{Metres, Micros, Radians, Torque};

use super::{Applied, Guidance, View};
use crate::models::sensors;

/// The column's sensors send every 2 ms.
const COLUMN_PERIOD_STEPS: u32 = 2;
/// At most a lane preview and a column frame in one step.
const MAX_FRAMES: usize = 2;

/// The ECU, its sensors and its actuator on one bus.
#[derive(Debug, Clone)]
pub struct OverBus {
    ecu: Ecu,
    lane_counter: u8,
    column_counter: u8,
    sent: [Frame; MAX_FRAMES],
    sent_count: usize,
    answer: Option<Frame>,
    actuator: ReceiverState,
    applied: Applied,
}

impl OverBus {
    /// A bus on which nothing was sent yet.
    pub fn new(config: Config) -> Self {
        let empty = Column::default().encode(0);
        Self {
            ecu: Ecu::new(config),
            lane_counter: 0,
            column_counter: 0,
            sent: [empty; MAX_FRAMES],
            sent_count: 0,
            answer: None,
            actuator: ReceiverState::NEW,
            applied: Applied::default(),
        }
    }

    fn send(&mut self, frame: Frame, view: &View) {
        self.sent[self.sent_count] = frame;
        self.sent_count += 1;
        // The ECU judges the frame by itself and keeps the last good one; the first two of a new sender are
        // refused by design, so a refusal is no fault of the loop.
        let _ = self.ecu.receive(&frame, super::instant(view.step));
    }
}

impl Guidance for OverBus {
    fn looks_at_road(&self, step: u32) -> bool {
        sensors::camera_looks(step)
    }

    #[inline]
    fn step(&mut self, view: &View) -> Applied {
        self.sent_count = 0;
        if let Some(errors) = view.lane {
            let preview = LanePreview {
                e_y: Metres::from_m(errors.e_y_m),
                e_theta: Radians::from_rad(errors.e_theta_rad),
                age: Micros::from_us(0),
                valid: true,
            };
            self.send(preview.encode(self.lane_counter), view);
            self.lane_counter = self.lane_counter.wrapping_add(1);
        }
        if view.step.is_multiple_of(COLUMN_PERIOD_STEPS) {
            let column = Column {
                driver_torque: Torque::from_nm(sensors::torque_nm(view.driver_torque_nm)),
                wheel_angle: Radians::from_rad(sensors::wheel_angle_rad(view.wheel_angle_rad)),
            };
            self.send(column.encode(self.column_counter), view);
            self.column_counter = self.column_counter.wrapping_add(1);
        }
        let frame = self.ecu.step(super::instant(view.step)).guidance;
        self.answer = Some(frame);
        if let Ok(guidance) = GuidanceMessage::decode(&mut self.actuator, &frame) {
            self.applied = Applied {
                torque_nm: guidance.torque.nm(),
                limited: guidance.limit == LimitReason::Absolute,
            };
        }
        self.applied
    }

    fn frames_in(&self) -> &[Frame] {
        &self.sent[..self.sent_count]
    }

    fn frame_out(&self) -> Option<&Frame> {
        self.answer.as_ref()
    }
}
