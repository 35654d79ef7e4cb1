//! The server: sessions, the order in which a request is judged, and what a step has to do.
//!
//! A request is judged as ISO 14229-1 (7.5 and 8.7) has it: service, session, least length, sub-function, length, security,
//! and then what the service asks for. Here: sessions, identification of the tester, reset. `services` has the others,
//! `writing` what is written.

mod services;
mod writing;

pub use services::{MOST_DATA, STORED_LAYOUT};
pub use writing::{COMMIT, FOUND, SELF_TEST};

use automotive_diag::uds::{UdsCommand, UdsError, UdsSessionType};
use haptic_core::bus::Frame;
use haptic_core::bus::messages::{ResetCause, WriteOutcome};
use haptic_core::controller::Command;
use haptic_core::controller::params::Params;
use haptic_core::safety::modes::Mode;
use haptic_core::service::download::Conditions;
use haptic_core::service::stored::Stored;
use heapless::Vec;

use crate::data::Ear;
use crate::isotp::Link;
use crate::security::{BYTES, Key, MOST_WRONG};
use crate::trouble::{Attempts, Cells, Troubles, attempts};
use crate::{REQUEST_ID, RESPONSE_ID};
use writing::Writing;

/// Bytes of the longest request that a service takes: eight identifiers, or an answer to a challenge.
const REQUEST: usize = 18;
/// Bytes of the longest answer: a status for each of 32 faults.
const ANSWER: usize = 160;
/// A session that is not the default one ends after so long without a request, ms (S3).
pub const SESSION_MS: u32 = 5000;
/// An answer comes within 50 ms, and never later (P2, and P2* in tens of milliseconds).
const TIMES: [u8; 4] = [0x00, 0x32, 0x01, 0xF4];
/// A reset comes so long after it was asked for, ms: the answer leaves the controller of the bus before.
const RESET_MS: u32 = 50;
/// The bit of a sub-function that asks for no positive answer.
const SILENT: u8 = 0x80;

/// What the ECU knows in the step in which it answers.
#[derive(Debug, Clone, Copy)]
pub struct Situation<'a> {
    /// What a download finds.
    pub conditions: Conditions,
    /// What became of the last set.
    pub outcome: WriteOutcome,
    /// The parameters in use; None while the ECU is locked for want of some.
    pub in_use: Option<&'a Params>,
    /// Where they come from, if from the memory.
    pub stored: Option<&'a Stored>,
    /// A copy in the memory cannot be read.
    pub is_damaged: bool,
    /// The image is as it was built.
    pub is_image_whole: bool,
    /// Why the ECU started.
    pub reset: ResetCause,
    /// Frames that were not used.
    pub rejected: u32,
    /// This processor's own number.
    pub hardware: u32,
    /// A count that runs fast.
    pub cycles: u32,
    /// Version of the software.
    pub software: &'static str,
    /// Commit that it was built from.
    pub commit: &'static str,
}

/// What the ECU has to do behind a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wish {
    /// Nothing.
    None,
    /// Hand this frame to the download, as if it had come over the bus.
    Download(Frame),
    /// Start anew.
    Reset,
}

/// How far security access is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Lock {
    Closed,
    Challenged([u8; BYTES]),
    Open,
}

/// A request.
type Request = Vec<u8, REQUEST>;

/// An answer, as it is written.
struct Reply(Vec<u8, ANSWER>);

impl Reply {
    fn put(&mut self, bytes: &[u8]) -> Result<(), UdsError> {
        self.0
            .extend_from_slice(bytes)
            .map_err(|_| UdsError::ResponseTooLong)
    }
}

/// Answers a tester.
#[derive(Debug, Clone)]
pub struct Server {
    link: Link<REQUEST, ANSWER>,
    session: UdsSessionType,
    /// When the last request came.
    asked_ms: u32,
    key: Option<Key>,
    lock: Lock,
    attempts: Attempts,
    /// When a wrong answer came last.
    wrong_ms: u32,
    writing: Writing,
    troubles: Troubles,
    ear: Ear,
    /// When a reset that was asked for comes.
    reset_ms: Option<u32>,
}

impl Server {
    /// A server at a start. Without a key nothing can be written.
    #[must_use]
    pub fn new(cells: &Cells, key: Option<Key>) -> Self {
        Self {
            link: Link::NEW,
            session: UdsSessionType::Default,
            asked_ms: 0,
            key,
            lock: Lock::Closed,
            attempts: attempts(cells),
            wrong_ms: 0,
            writing: Writing::NEW,
            troubles: Troubles::new(cells),
            ear: Ear::default(),
            reset_ms: None,
        }
    }

    /// Takes a frame of the bus.
    pub fn receive(&mut self, frame: &Frame, now_ms: u32) {
        if frame.id() == REQUEST_ID {
            self.link.receive(frame.data(), now_ms);
        } else {
            self.ear.hear(frame);
        }
    }

    /// What is to be done behind a step: at most one request is answered.
    pub fn step<'a>(
        &mut self,
        cells: &mut Cells,
        command: &Command,
        now_ms: u32,
        situation: impl FnOnce() -> Situation<'a>,
    ) -> Wish {
        self.troubles.step(cells, command, || self.ear.heard(), now_ms);
        self.link.age(now_ms);
        if self.link.is_sending() {
            // Whoever takes an answer is there.
            self.asked_ms = now_ms;
        } else if self
            .reset_ms
            .is_some_and(|asked_ms| now_ms.wrapping_sub(asked_ms) >= RESET_MS)
        {
            return Wish::Reset;
        } else if now_ms.wrapping_sub(self.asked_ms) > SESSION_MS && self.session != UdsSessionType::Default {
            self.enter(UdsSessionType::Default);
        }
        let is_asked = self.link.message().is_some() && !self.link.is_sending();
        if !is_asked && !self.writing.is_due(now_ms) {
            return Wish::None;
        }
        let situation = situation();
        if is_asked {
            self.answer(cells, command, now_ms, &situation);
        }
        self.writing
            .frame(now_ms, &situation)
            .map_or(Wish::None, Wish::Download)
    }

    /// The frame that is due on the bus.
    #[must_use]
    pub fn frame(&self, now_ms: u32) -> Option<Frame> {
        self.link
            .frame(now_ms)
            .map(|bytes| Frame::full(RESPONSE_ID, bytes))
    }

    /// It has found its place.
    pub fn sent(&mut self, now_ms: u32) {
        self.link.sent(now_ms);
    }

    /// Another session begins: nothing is unlocked, and what was to be written is forgotten.
    fn enter(&mut self, session: UdsSessionType) {
        self.session = session;
        self.lock = Lock::Closed;
        self.writing.forget();
    }

    fn answer(&mut self, cells: &mut Cells, command: &Command, now_ms: u32, situation: &Situation<'_>) {
        let Some(message) = self.link.message() else {
            return;
        };
        let is_whole = message.bytes.len() == usize::from(message.length);
        // It has as many places as the link.
        let request = Request::from_slice(message.bytes).unwrap_or_default();
        self.link.done();
        self.asked_ms = now_ms;
        let Some((service, rest)) = request.split_first() else {
            return;
        };
        let mut reply = Reply(Vec::new());
        let now = Now {
            command,
            now_ms,
            situation,
        };
        let asked = Asked {
            service: *service,
            rest,
            is_whole,
        };
        match self.serve(cells, &asked, &now, &mut reply) {
            Ok(Answer::Silent) => {}
            Ok(Answer::Spoken) => {
                self.link.send(&reply.0);
            }
            Err(error) => {
                self.link.send(&[0x7F, *service, error.into()]);
            }
        }
    }

    /// Judges a request and carries it out.
    fn serve(
        &mut self,
        cells: &mut Cells,
        asked: &Asked<'_>,
        now: &Now<'_>,
        reply: &mut Reply,
    ) -> Result<Answer, UdsError> {
        use UdsCommand as S;
        let service = S::from_repr(asked.service).ok_or(UdsError::ServiceNotSupported)?;
        let is_for_all = match service {
            S::DiagnosticSessionControl
            | S::TesterPresent
            | S::ReadDataByIdentifier
            | S::ReadDTCInformation => true,
            S::ECUReset
            | S::ClearDiagnosticInformation
            | S::SecurityAccess
            | S::WriteDataByIdentifier
            | S::RoutineControl => false,
            _ => return Err(UdsError::ServiceNotSupported),
        };
        if !is_for_all && self.session != UdsSessionType::Extended {
            return Err(UdsError::ServiceNotSupportedInActiveSession);
        }
        // None of our services takes more than what is kept.
        if !asked.is_whole {
            return Err(UdsError::IncorrectMessageLengthOrInvalidFormat);
        }
        reply.put(&[asked.service | 0x40])?;
        match service {
            S::ReadDataByIdentifier => self.read_data(asked.rest, now, reply)?,
            S::WriteDataByIdentifier => self.write_data(asked.rest, reply)?,
            S::ClearDiagnosticInformation => self.clear(cells, asked.rest)?,
            _ => {
                let (sub, rest) = asked
                    .rest
                    .split_first()
                    .ok_or(UdsError::IncorrectMessageLengthOrInvalidFormat)?;
                let code = sub & !SILENT;
                reply.put(&[code])?;
                match service {
                    S::DiagnosticSessionControl => self.session_control(code, rest, reply)?,
                    S::TesterPresent => one_of(&[0], code).and_then(|()| none(rest))?,
                    S::ECUReset => self.reset(code, rest, now)?,
                    S::SecurityAccess => self.security_access(cells, code, rest, now, reply)?,
                    S::RoutineControl => self.routine(code, rest, now, reply)?,
                    _ => self.read_troubles(cells, code, rest, reply)?,
                }
                if sub & SILENT != 0 {
                    return Ok(Answer::Silent);
                }
            }
        }
        Ok(Answer::Spoken)
    }

    fn session_control(&mut self, code: u8, rest: &[u8], reply: &mut Reply) -> Result<(), UdsError> {
        let session = match code {
            1 => UdsSessionType::Default,
            3 => UdsSessionType::Extended,
            _ => return Err(UdsError::SubFunctionNotSupported),
        };
        none(rest)?;
        self.enter(session);
        reply.put(&TIMES)
    }

    /// A hard reset. Each counts towards the lock of an ECU that resets again and again, so it asks for security access.
    fn reset(&mut self, code: u8, rest: &[u8], now: &Now<'_>) -> Result<(), UdsError> {
        one_of(&[1], code)?;
        none(rest)?;
        self.ask_for_security()?;
        now.ask_for_standstill()?;
        self.reset_ms = Some(now.now_ms);
        Ok(())
    }

    fn ask_for_security(&self) -> Result<(), UdsError> {
        if self.lock == Lock::Open {
            Ok(())
        } else {
            Err(UdsError::SecurityAccessDenied)
        }
    }

    /// Whether a further attempt has to wait.
    fn is_delayed(&self, now_ms: u32) -> bool {
        self.attempts.wrong >= MOST_WRONG && now_ms.wrapping_sub(self.wrong_ms) < crate::security::DELAY_MS
    }
}

/// What an answer is.
enum Answer {
    Spoken,
    /// The tester asked for none.
    Silent,
}

/// A request, apart.
struct Asked<'a> {
    service: u8,
    rest: &'a [u8],
    /// All of it was kept.
    is_whole: bool,
}

/// The step in which it is answered.
struct Now<'a> {
    command: &'a Command,
    now_ms: u32,
    situation: &'a Situation<'a>,
}

impl Now<'_> {
    /// What changes the ECU asks for Standby, or a lock for want of parameters, and for a vehicle that stands.
    fn ask_for_standstill(&self) -> Result<(), UdsError> {
        let Conditions { mode, stands, .. } = self.situation.conditions;
        match (mode, stands) {
            (Mode::Standby, true) => Ok(()),
            (Mode::Standby, false) => Err(UdsError::VehicleSpeedTooHigh),
            _ => Err(UdsError::ConditionsNotCorrect),
        }
    }
}

/// A sub-function is one of those that there are.
fn one_of(codes: &[u8], code: u8) -> Result<(), UdsError> {
    if codes.contains(&code) {
        Ok(())
    } else {
        Err(UdsError::SubFunctionNotSupported)
    }
}

/// Nothing follows.
fn none(rest: &[u8]) -> Result<(), UdsError> {
    if rest.is_empty() {
        Ok(())
    } else {
        Err(UdsError::IncorrectMessageLengthOrInvalidFormat)
    }
}
