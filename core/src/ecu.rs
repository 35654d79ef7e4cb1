//! The ECU: frames in, frames out. Holds one controller, the receivers of its inputs with their ages, and
//! the counters of its own frames. Firmware and simulator carry bytes to it and from it, nothing more.

use crate::bus::e2e::ReceiverState;
use crate::bus::messages::{Column, Guidance, LanePreview, Message, TIMEOUT};
use crate::bus::{Frame, Reject};
use crate::controller::{Command, Controller, ControllerState, Inputs};
use crate::law::LaneSample;
use crate::params::Config;
use crate::quantity::Instant;

/// A controller with its bus.
#[derive(Debug, Clone)]
pub struct Ecu {
    controller: Controller,
    state: ControllerState,
    lane: Receiver<LaneSample>,
    column: Receiver<Column>,
    counter: u8,
}

/// What one step puts on the bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Step {
    /// The command behind the frame.
    pub command: Command,
    /// The guidance torque frame. Its torque, rounded to the bus's LSB, is the one to apply.
    pub guidance: Frame,
}

/// The latest value of one input, with what judges the next.
#[derive(Debug, Clone, Copy)]
struct Receiver<T> {
    e2e: ReceiverState,
    last: Option<(T, Instant)>,
}

impl<T: Copy> Receiver<T> {
    const fn new() -> Self {
        Self {
            e2e: ReceiverState::NEW,
            last: None,
        }
    }

    /// Drops a value that is stale, so that no instant outlives a wrap of the clock, and the sender's trust.
    fn expire(&mut self, now: Instant) {
        if self.last.is_some_and(|(_, at)| now.since(at) > TIMEOUT) {
            self.last = None;
            self.e2e.lose_trust();
        }
    }
}

impl Ecu {
    /// An ECU that has heard nothing yet.
    #[must_use]
    pub const fn new(config: Config) -> Self {
        Self {
            controller: Controller::new(config),
            state: ControllerState::NEW,
            lane: Receiver::new(),
            column: Receiver::new(),
            counter: 0,
        }
    }

    /// Takes a frame that arrived at `now`. Frames of no interest are ignored.
    ///
    /// # Errors
    /// Why a frame with a known identifier is not used; the last good one stays in use until it is stale.
    pub fn receive(&mut self, frame: &Frame, now: Instant) -> Result<(), Reject> {
        match frame.id() {
            LanePreview::ID => {
                let lane = LanePreview::decode(&mut self.lane.e2e, frame)?;
                if lane.valid {
                    let at = now.before(lane.age);
                    self.lane.last = Some((
                        LaneSample {
                            e_y: lane.e_y,
                            e_theta: lane.e_theta,
                            at,
                        },
                        at,
                    ));
                }
            }
            Column::ID => {
                self.column.last = Some((Column::decode(&mut self.column.e2e, frame)?, now));
            }
            _ => {}
        }
        Ok(())
    }

    /// One step of the 1 kHz loop.
    pub fn step(&mut self, now: Instant) -> Step {
        self.lane.expire(now);
        self.column.expire(now);
        let inputs = Inputs {
            lane: self.lane.last.map(|(sample, _)| sample),
        };
        let command = self.controller.step(&mut self.state, now, &inputs);
        let guidance = Guidance {
            torque: command.torque,
            limit: command.limit,
        }
        .encode(self.counter);
        self.counter = self.counter.wrapping_add(1) & 0x0F;
        Step { command, guidance }
    }

    /// The driver torque and wheel angle in use, if they are fresh.
    #[must_use]
    pub fn column(&self) -> Option<Column> {
        self.column.last.map(|(column, _)| column)
    }
}
