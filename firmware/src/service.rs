//! What an ECU says of its parameters, of itself and of frames that it did not use, the sets that it takes over the
//! bus, and its answers to a workshop's tester. Behind the torque, which is on its way by then. Not here: where a set is
//! stored, and the restart that it causes.

use core::num::NonZeroU32;

use haptic_core::bus::Frame;
use haptic_core::bus::messages::{Identity, Message, ParameterUnlock, ParameterWrite, Rejection};
use haptic_core::controller::Command;
use haptic_core::controller::params::Params;
use haptic_core::ecu::{Boot, Ecu};
use haptic_core::safety::modes::Mode;
use haptic_core::service::download::{self, Conditions, Download, mode_for_parameters};
use haptic_core::service::rejections::Rejections;
use haptic_core::service::stored::Set;
use haptic_diag::REQUEST_ID;
use haptic_diag::security::Key;
use haptic_diag::server::{Server, Situation, Wish};
use haptic_diag::trouble::Cells;
use haptic_secoc::verifier::Passed;
use heapless::Vec;

use crate::boards::{Board, ThisBoard};
use crate::reset;
use crate::storage::Found;

/// Steps between two statuses: one second.
const STEPS_PER_STATUS: u32 = 1000;
/// Steps between two parameters in use, and two counts of rejections, on the bus; these half a turn apart, and neither in
/// a step with a warning or a line of the fault history, which come on multiples of 50.
const STEPS_PER_LINE: u32 = 100;
const VALUE_AT: u32 = 25;
const REJECTION_AT: u32 = 75;

/// Commit that the image is built from, where the build says so.
const COMMIT: &str = match option_env!("HAPTIC_COMMIT") {
    Some(commit) => commit,
    None => "nobody said",
};

/// What the firmware knows of itself when it starts.
#[derive(Debug, Clone, Copy)]
pub struct Origin {
    /// Why it started.
    pub boot: Boot,
    /// The image is as it was built.
    pub is_image_whole: bool,
    /// What a tester has to know before it may write.
    pub key: Option<Key>,
}

/// What a service asks of its image.
#[expect(
    clippy::large_enum_variant,
    reason = "there is one at a time, and nothing to allocate it with"
)]
pub enum Restart {
    /// Store this set, and start with it.
    With(Set),
    /// Start anew.
    AsIs,
}

/// What has to do with parameters, and with testers.
pub struct Service {
    download: Download,
    /// The mode of the last step, which the download asks for.
    mode: Mode,
    found: Found,
    /// The set in use; None while the controller is locked for want of one.
    in_use: Option<Params>,
    origin: Origin,
    server: Server,
    /// The last count of rejections that the log told.
    told: Option<Rejection>,
}

impl Service {
    /// The service of an ECU that starts up so, with what lies in its memory and the set that it uses.
    #[must_use]
    pub fn new(found: Found, in_use: Option<Params>, origin: Origin, cells: &Cells) -> Self {
        Self {
            server: Server::new(cells, origin.key),
            download: Download::NEW,
            mode: Mode::Boot,
            found,
            in_use,
            origin,
            told: None,
        }
    }

    /// What lies in the memory.
    #[must_use]
    pub const fn found(&self) -> &Found {
        &self.found
    }

    /// Hands a frame, and when it came, to the controller, the tester's server and the download in the step of that number; the set
    /// that it completes.
    pub fn receive(
        &mut self,
        (frame, at): Passed,
        ecu: &mut Ecu,
        rejected: &mut Rejections,
        steps: u32,
    ) -> Option<Set> {
        self.server.receive(&frame, steps);
        match frame.id() {
            // It is none of the controller's.
            REQUEST_ID => return None,
            id => {
                if let Err(reason) = ecu.receive(&frame, at) {
                    rejected.count(id, reason);
                }
            }
        }
        // What a set finds is looked up for its own frames alone.
        let is_of_a_set = matches!(frame.id(), ParameterUnlock::ID | ParameterWrite::ID);
        let conditions = is_of_a_set.then(|| self.conditions(ecu, steps))?;
        self.download.receive(&frame, &conditions)
    }

    fn conditions(&self, ecu: &Ecu, steps: u32) -> Conditions {
        Conditions {
            mode: self.mode,
            stands: ecu.stands(),
            settled: reset::has_settled(self.origin.boot.reset, steps),
            in_use: self.found.stored.map(|stored| stored.sequence),
            now_ms: steps,
        }
    }

    /// Works for a tester behind the step of that number.
    // A function of its own: what an answer takes is not on the stack of the step.
    #[inline(never)]
    pub fn diagnose(
        &mut self,
        cells: &mut Cells,
        command: &Command,
        ecu: &Ecu,
        rejected: &Rejections,
        steps: u32,
    ) -> Option<Restart> {
        let conditions = self.conditions(ecu, steps);
        let is_damaged = self.found.damaged != [false, false];
        let stored = self.found.stored.as_ref();
        let situation = || Situation {
            conditions,
            outcome: self.download.status(stored, is_damaged).outcome,
            in_use: self.in_use.as_ref(),
            stored,
            is_damaged,
            is_image_whole: self.origin.is_image_whole,
            reset: self.origin.boot.reset,
            rejected: rejected.total(),
            hardware: ThisBoard::hardware(),
            cycles: ThisBoard::cycles(),
            software: env!("CARGO_PKG_VERSION"),
            commit: COMMIT,
        };
        match self.server.step(cells, command, steps, situation) {
            Wish::None => None,
            Wish::Download(frame) => self.download.receive(&frame, &conditions).map(Restart::With),
            Wish::Reset => Some(Restart::AsIs),
        }
    }

    /// The frame of an answer that is due; [`Service::answered`] once it found its place.
    #[must_use]
    pub fn answer(&self, steps: u32) -> Option<Frame> {
        self.server.frame(steps)
    }

    /// It did.
    pub fn answered(&mut self, steps: u32) {
        self.server.sent(steps);
    }

    /// What is to be said behind the step of that number.
    pub fn frames(&mut self, command: &Command, rejected: &mut Rejections, steps: u32) -> Vec<Frame, 3> {
        self.mode = mode_for_parameters(command.mode, command.faults);
        let mut frames = Vec::new();
        if steps.is_multiple_of(STEPS_PER_STATUS) {
            let turn = (steps / STEPS_PER_STATUS) as u8;
            let is_damaged = self.found.damaged != [false, false];
            let status = self.download.status(self.found.stored.as_ref(), is_damaged);
            let vehicle = self.found.stored.and_then(|stored| stored.set.vehicle);
            let identity = Identity {
                vehicle: vehicle.map_or(0, NonZeroU32::get),
                hardware: ThisBoard::hardware(),
            };
            // Three frames have three places.
            let _ = frames.push(status.encode(turn));
            let _ = frames.push(identity.encode(turn));
        }
        if let Some(line) = self.line(rejected, steps) {
            let _ = frames.push(line);
        }
        frames
    }

    /// A parameter in use or a count of rejections, when it is its turn.
    fn line(&mut self, rejected: &mut Rejections, steps: u32) -> Option<Frame> {
        let turn = steps / STEPS_PER_LINE;
        match steps % STEPS_PER_LINE {
            VALUE_AT => {
                let value = download::value(self.in_use.as_ref()?, turn)?;
                Some(value.encode(turn as u8))
            }
            REJECTION_AT => {
                let line = rejected.line()?;
                if self.told.replace(line) != Some(line) {
                    defmt::warn!(
                        "message {=u16:#05x} was not used {=u16} times, reason {=u8}",
                        line.id,
                        line.count,
                        line.reason as u8
                    );
                }
                Some(line.encode(turn as u8))
            }
            _ => None,
        }
    }
}
