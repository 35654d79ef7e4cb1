//! The parameters of a product on a bus: which set it has in use, and a new one for it to store.
//!
//! The client sends a set as `haptic_core::service::download` has it and believes it stored when the ECU, started anew, says
//! that a set of another number is in use. The ECU takes a set at standstill only, by the speeds on the bus; where nobody
//! sends any, as on a bench, the client does, while it sends the set.
//! Not here: what is in a set, and the way to the bus (`adapter`).

use std::time::{Duration, Instant};

use haptic_core::bus::Frame;
use haptic_core::bus::e2e::ReceiverState;
use haptic_core::bus::messages::{
    Guidance, Identity, Message, ParameterStatus, ParameterValue, Vehicle, WriteOutcome,
};
use haptic_core::controller::config::Config;
use haptic_core::controller::params::{PARAMETERS, Params};
use haptic_core::safety::modes::Mode;
use haptic_core::service::download::{frames, mode_for_parameters, unlock};
use haptic_secoc::Keys;

use super::PilError;
use super::port::Port;

/// Longest wait for a status, which comes every second, and a start takes less than another.
const REPLY_TIMEOUT: Duration = Duration::from_secs(5);
/// Statuses after a set was sent: its storing and the start take less than these seconds.
const STATUSES: usize = 5;
/// The parameters in use come in turn, one every 100 ms, and a frame may be lost.
const VALUES_WITHIN_ROUNDS: usize = 3;
/// So many speeds of zero come first: the three of a new sender, and the hundred in a row of a vehicle that stands.
const SPEEDS: u8 = 110;
/// Our frames come once in so many of the ECU's, which are a millisecond apart: faster ones are refused.
const PERIOD: u32 = 10;
/// So often is a set sent whose speeds were too old when it came.
const ATTEMPTS: u32 = 10;

/// The ECU at the other end of an adapter.
pub struct Product {
    pub(super) port: Port,
    /// Somebody sends the vehicle's speed.
    pub(super) hears_speed: bool,
}

impl Product {
    /// Opens the way to a bus, named as for [`super::Target::Board`].
    ///
    /// # Errors
    /// What is missing on the way.
    pub fn on(adapter: &str) -> Result<Self, PilError> {
        Ok(Self {
            port: Port::open(adapter)?,
            hears_speed: false,
        })
    }

    /// Proves under these keys what it sends.
    pub fn prove(&mut self, keys: Option<&Keys>) {
        if let Some(keys) = keys {
            self.port.prove(keys);
        }
    }

    /// Which set is in use, and what became of the last one sent.
    ///
    /// # Errors
    /// No ECU says so.
    pub fn status(&mut self) -> Result<ParameterStatus, PilError> {
        Ok(self.status_and_mode()?.0)
    }

    /// Sends a set for the vehicle of that number (0: nobody says) and waits until it is in use. The ECU must be in Standby,
    /// and starts anew with the set.
    ///
    /// # Errors
    /// Why it is not in use.
    pub fn store(&mut self, params: &Params, vehicle: u32) -> Result<ParameterStatus, PilError> {
        let frames = frames(params);
        // The bus rounds to f32, which may be too far at the end of a range: the ECU's own judgement, before it is asked.
        let rounded = Params::from_values(&params.to_values().map(|value| f64::from(value as f32)));
        if Config::new(&rounded).is_err() {
            let message = "a parameter is at the end of its range, and beyond it as the bus's 32-bit number";
            return Err(PilError::Failed(message.into()));
        }
        let (mut before, mode) = self.status_and_mode()?;
        if mode != Mode::Standby {
            return Err(PilError::Failed(format!(
                "the ECU is in {mode:?}; it takes parameters in Standby only, or where it is locked for want of them"
            )));
        }
        let mut attempts = 0;
        loop {
            attempts += 1;
            self.send_set(&unlock(before.sequence, vehicle), &frames)?;
            match self.outcome(&before)? {
                Ok(now) => return Ok(now),
                // Our own speeds were too old when the set came: this computer was busy with something else.
                Err((now, _))
                    if now.outcome == WriteOutcome::NotStanding
                        && !self.hears_speed
                        && attempts < ATTEMPTS =>
                {
                    before = now;
                }
                // An ECU lets a sender prove a message from its second frame on.
                Err((now, _)) if self.port.proves() && attempts == 1 => before = now,
                Err((_, why)) => return Err(PilError::Failed(why)),
            }
        }
    }

    /// A set on its way, with speeds of zero where nobody else sends any.
    fn send_set(&mut self, unlock: &Frame, frames: &[Frame]) -> Result<(), PilError> {
        let mut standstill = None;
        if !self.hears_speed {
            standstill = Some(self.send_standstill()?);
        }
        for frame in [unlock].into_iter().chain(frames) {
            let speed = standstill.as_mut().map(standing);
            let together: Vec<Frame> = speed.into_iter().chain([*frame]).collect();
            self.port.send(&together)?;
            self.wait()?;
        }
        Ok(())
    }

    /// Lets a period pass, by the ECU's own frames.
    fn wait(&mut self) -> Result<(), PilError> {
        let begun = Instant::now();
        let until = begun + REPLY_TIMEOUT;
        // Frames that waited here while this computer was busy are counted at once: then its own clock says how long to wait.
        let period = Duration::from_millis(PERIOD.into());
        let mut left = PERIOD;
        while (left > 0 || begun.elapsed() < period) && Instant::now() < until {
            let frame = self.port.frame()?;
            left = left.saturating_sub(frame.is_some_and(|frame| frame.id() == Guidance::ID).into());
        }
        Ok(())
    }

    /// What became of a set: the status that has it in use, or the last one and why not.
    pub(super) fn outcome(
        &mut self,
        before: &ParameterStatus,
    ) -> Result<Result<ParameterStatus, (ParameterStatus, String)>, PilError> {
        let mut now = *before;
        for since in 0..STATUSES {
            now = self.status()?;
            if let Some(verdict) = verdict(before, &now, since) {
                return Ok(verdict.map_err(|why| (now, why.into())));
            }
        }
        let why = format!(
            "after {STATUSES} s the ECU still has set {} in use: its flash takes no other, it has keys (--keys), or frames were lost",
            before.sequence
        );
        Ok(Err((now, why)))
    }

    /// Speeds of zero, for an ECU on a bench: nobody else sends any. Returns the counter of the next.
    pub(super) fn send_standstill(&mut self) -> Result<u8, PilError> {
        let mut counter = 0;
        for _ in 0..SPEEDS {
            self.port.send(&[standing(&mut counter)])?;
            self.wait()?;
        }
        Ok(counter)
    }

    /// What the stored set is bound to.
    ///
    /// # Errors
    /// The ECU does not say so.
    pub fn identity(&mut self) -> Result<Identity, PilError> {
        let until = Instant::now() + REPLY_TIMEOUT;
        while Instant::now() < until {
            if let Some(frame) = self.port.frame()?.filter(|frame| frame.id() == Identity::ID)
                && let Ok(identity) = Identity::decode(&mut { ReceiverState::TRUSTED }, &frame)
            {
                return Ok(identity);
            }
        }
        Err(PilError::Failed(
            "the ECU does not say what its parameters are bound to: it runs an older image".into(),
        ))
    }

    /// The parameters in use, as the ECU tells them.
    ///
    /// # Errors
    /// It does not tell all of them: it is locked for want of a set, or is an older one.
    pub fn values(&mut self) -> Result<Params, PilError> {
        let mut values = [None; PARAMETERS.len()];
        for _ in 0..VALUES_WITHIN_ROUNDS * values.len() {
            let Some(value) = self.value()? else { break };
            if let Some(place) = values.get_mut(usize::from(value.index)) {
                *place = Some(f64::from(value.value));
            }
            if values.iter().all(Option::is_some) {
                return Ok(Params::from_values(&values.map(Option::unwrap_or_default)));
            }
        }
        Err(PilError::Failed(format!(
            "the ECU told {} of {} parameters in {VALUES_WITHIN_ROUNDS} rounds: it is locked for want of a set, or runs an \
             older image",
            values.iter().flatten().count(),
            PARAMETERS.len()
        )))
    }

    /// The next parameter that the ECU tells, if it tells any.
    fn value(&mut self) -> Result<Option<ParameterValue>, PilError> {
        let until = Instant::now() + REPLY_TIMEOUT;
        while Instant::now() < until {
            if let Some(frame) = self
                .port
                .frame()?
                .filter(|frame| frame.id() == ParameterValue::ID)
                && let Ok(value) = ParameterValue::decode(&mut { ReceiverState::TRUSTED }, &frame)
            {
                return Ok(Some(value));
            }
        }
        Ok(None)
    }

    /// The next status, and the mode of the last torque frame before it.
    fn status_and_mode(&mut self) -> Result<(ParameterStatus, Mode), PilError> {
        let until = Instant::now() + REPLY_TIMEOUT;
        let mut mode = None;
        while Instant::now() < until {
            let Some(frame) = self.port.frame()? else {
                continue;
            };
            // Two counters of one second tell nothing: each frame is judged by itself.
            let mut receiver = ReceiverState::TRUSTED;
            match frame.id() {
                Guidance::ID => {
                    mode = Guidance::decode(&mut receiver, &frame)
                        .ok()
                        .map(|guidance| mode_for_parameters(guidance.mode, guidance.faults))
                        .or(mode);
                }
                ParameterStatus::ID => {
                    let status = ParameterStatus::decode(&mut receiver, &frame).ok();
                    if let Some(found) = status.zip(mode) {
                        return Ok(found);
                    }
                }
                Vehicle::ID => self.hears_speed = true,
                _ => {}
            }
        }
        Err(PilError::Failed(format!(
            "no ECU told of its parameters for {} s: does it run steering-ecu, is the bus terminated, and do adapter \
             and ECU both run at 500 kbit/s?",
            REPLY_TIMEOUT.as_secs()
        )))
    }
}

/// The next frame of a vehicle that stands.
pub(super) fn standing(counter: &mut u8) -> Frame {
    let frame = Vehicle::default().encode(*counter);
    *counter = counter.wrapping_add(1);
    frame
}

/// What a status says of a set that was sent when the status was `before`; None: nothing yet. `since` counts the
/// statuses after it, of which the first may be older than the set.
fn verdict(
    before: &ParameterStatus,
    now: &ParameterStatus,
    since: usize,
) -> Option<Result<ParameterStatus, &'static str>> {
    if now.sequence != before.sequence {
        return Some(Ok(*now));
    }
    if since == 0 && now == before {
        return None;
    }
    Some(Err(match now.outcome {
        WriteOutcome::None | WriteOutcome::Receiving | WriteOutcome::Taken => return None,
        WriteOutcome::NotInStandby => "the ECU refused the set: it was no longer in Standby",
        WriteOutcome::OutOfOrder => {
            "the ECU refused the set: a frame was lost, or somebody else sends parameters too"
        }
        WriteOutcome::OutOfRange => "the ECU refused the set: its ranges are not this program's",
        WriteOutcome::NotStanding => {
            "the ECU refused the set: the vehicle moves, or the speeds on the bus are not usable"
        }
        WriteOutcome::NotUnlocked => "the ECU refused the set: frames were lost, or another set came between",
        WriteOutcome::TooSoon => {
            "the ECU refused the set: it takes one ten seconds after a reset at the earliest; try again then"
        }
        WriteOutcome::TooFast => "the ECU refused the set: its frames came in a burst, or are another's",
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn status(sequence: u32, outcome: WriteOutcome) -> ParameterStatus {
        ParameterStatus {
            stored: sequence > 0,
            damaged: false,
            outcome,
            sequence,
        }
    }

    #[test]
    fn another_number_is_a_set_in_use_and_the_wrap_is_one() {
        for (last, next) in [(0, 1), (7, 8), (u32::MAX, 0)] {
            let now = status(next, WriteOutcome::None);
            let before = status(last, WriteOutcome::None);
            assert_eq!(verdict(&before, &now, 0), Some(Ok(now)));
        }
    }

    #[test]
    fn a_refusal_counts_at_once_if_it_is_new_and_an_old_one_if_it_stays() {
        for refusal in [
            WriteOutcome::NotInStandby,
            WriteOutcome::OutOfOrder,
            WriteOutcome::OutOfRange,
        ] {
            let now = status(3, refusal);
            let fresh = verdict(&status(3, WriteOutcome::None), &now, 0);
            assert!(matches!(fresh, Some(Err(_))), "{refusal:?}");
            assert_eq!(verdict(&now, &now, 0), None, "may be older than the set");
            assert!(matches!(verdict(&now, &now, 1), Some(Err(_))), "{refusal:?}");
        }
    }

    #[test]
    fn a_set_under_way_is_waited_for() {
        for outcome in [WriteOutcome::None, WriteOutcome::Receiving, WriteOutcome::Taken] {
            for since in [0, 1] {
                let before = status(3, WriteOutcome::OutOfOrder);
                assert_eq!(verdict(&before, &status(3, outcome), since), None, "{outcome:?}");
            }
        }
    }
}
