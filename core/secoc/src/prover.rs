//! The side of camera and host: a proof for each frame, and an epoch to count in whenever the ECU says that it waits.

use haptic_core::bus::Frame;
use heapless::Vec;

use crate::fresh::Chosen;
use crate::messages::{COUNT, PROVEN, Place, ProofSender, Proven, Status, bytes_of_proof, offer_of_frame};
use crate::{Keys, mac_of};

/// Proofs for the messages of one node, or of several.
pub struct Prover {
    senders: [Line; COUNT],
}

struct Line {
    sender: ProofSender<Chosen>,
    /// It sent since the ECU last said what it waits for: a message that nobody sends needs no epoch.
    is_in_use: bool,
}

impl Prover {
    /// Proofs under these keys. Those of messages that another node sends do not matter.
    #[must_use]
    pub fn new(keys: &Keys) -> Self {
        let macs = keys.macs();
        Self {
            senders: PROVEN.map(|proven| Line {
                sender: ProofSender::new(mac_of(&macs, proven.info.sender).clone(), proven.info.id),
                is_in_use: false,
            }),
        }
    }

    /// What to send in place of a frame, in this order. A frame of another message is sent as it is, and so is one for which the ECU
    /// has given no epoch yet.
    pub fn prove(&mut self, frame: &Frame) -> Vec<Frame, 2> {
        let mut frames = Vec::new();
        let (mut first, mut second) = (*frame, None);
        let line = PROVEN.iter().zip(&mut self.senders);
        if let Some((proven, line)) = line.into_iter().find(|(proven, _)| proven.info.id == frame.id()) {
            line.is_in_use = true;
            (first, second) = proven_by(proven, &mut line.sender, frame).unwrap_or((first, second));
        }
        // Two frames have two places.
        let _ = frames.push(first);
        if let Some(second) = second {
            let _ = frames.push(second);
        }
        frames
    }

    /// Takes a frame of the ECU's; the questions that it gives rise to. `number` gives numbers that were not given before, by chance.
    pub fn hear(&mut self, frame: &Frame, mut number: impl FnMut() -> u32) -> Vec<Frame, COUNT> {
        let mut questions = Vec::new();
        if let Some(status) = Status::decode(frame) {
            let lines = PROVEN.iter().zip(&mut self.senders).zip(status.waiting);
            for ((proven, line), is_waiting) in lines {
                if is_waiting && line.is_in_use {
                    let question = line.sender.ask(number()).to_le_bytes();
                    // A place for each message.
                    let _ = questions.extend_from_slice(Frame::new(proven.question, &question).as_slice());
                }
                line.is_in_use = false;
            }
        } else if frame.id() == crate::messages::OFFER_ID
            && let Some((place, offer)) = offer_of_frame(frame)
            && let Some(line) = self.senders.get_mut(place)
        {
            line.sender.take(&offer);
        }
        questions
    }
}

/// A frame with its proof, and what follows it.
fn proven_by(
    proven: &Proven,
    sender: &mut ProofSender<Chosen>,
    frame: &Frame,
) -> Option<(Frame, Option<Frame>)> {
    let proof = bytes_of_proof(&sender.prove(proven.text(frame)?)?);
    match proven.place {
        Place::Behind(id) => Some((*frame, Some(Frame::new(id, &proof)?))),
        Place::Within => {
            let mut data = frame.full_data()?;
            let [_, counter, _, _, room @ ..] = &mut data;
            let counter = *counter & 0x0F;
            *room = proof;
            proven.info.protection.protect(&mut data, counter);
            Some((Frame::full(proven.info.id, data), None))
        }
    }
}
