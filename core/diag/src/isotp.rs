//! ISO-TP (ISO 15765-2:2016) on classic CAN, normal addressing: one message at a time in each direction.
//!
//! The caller owns the bus. It hands in what comes under the peer's identifier ([`Link::receive`]), asks for the frame that is
//! due ([`Link::frame`]) and says when that found a place ([`Link::sent`]); nothing here waits. That is why it is no crate:
//! those that there are own the controller, whose frames this loop shares.
//!
//! A message longer than its buffer is received to its end and counted, not kept ([`Message::length`]): its sender then hears
//! from the server what is wrong with it.

use heapless::Vec;

/// Data bytes of a frame.
pub type Bytes = [u8; 8];

/// The longest message.
pub const LONGEST: u16 = 4095;
/// Between two frames of a message, before flow control, and until a frame has left, ms (N_Cr, N_Bs, N_As).
pub const TIMEOUT_MS: u32 = 1000;
/// So many consecutive frames come before the next flow control.
pub const BLOCK_SIZE: u8 = 8;
/// The peer leaves so many ms between two consecutive frames.
pub const SEPARATION_MS: u8 = 2;
/// Flow control may ask for patience so often in a row (N_WFTmax).
pub const MOST_WAITS: u8 = 10;
/// Fills a frame (ISO 15765-2, 10.4.2.1).
const PADDING: u8 = 0xCC;
/// Data bytes of a first and of a consecutive frame.
const IN_FIRST: u16 = 6;
const IN_CONSECUTIVE: u16 = 7;
/// The largest separation, which a reserved value stands for (ISO 15765-2, table 20).
const LONGEST_SEPARATION_MS: u8 = 127;

/// A message that has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Message<'a> {
    /// Its bytes, or the first of them that have a place.
    pub bytes: &'a [u8],
    /// How many there were.
    pub length: u16,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Reception {
    Idle,
    /// Some of `length` bytes are there; the consecutive frame of number `next` is due.
    Under {
        length: u16,
        got: u16,
        next: u8,
        left_in_block: u8,
        since_ms: u32,
    },
    Complete {
        length: u16,
    },
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Sending {
    Idle,
    /// The single or the first frame is due.
    First,
    /// Flow control is due.
    Waiting {
        since_ms: u32,
        waits: u8,
    },
    /// Consecutive frames are due, `left` of them before the next flow control; None: all.
    Block {
        left: Option<u8>,
        separation_ms: u8,
        since_ms: Option<u32>,
    },
}

/// The answer that a first frame, or the last of a block, waits for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Flow {
    Go = 0,
    Overflow = 2,
}

/// One end of a conversation: `R` bytes are kept of what comes, `S` bytes can be sent.
#[derive(Debug, Clone)]
pub struct Link<const R: usize, const S: usize> {
    received: [u8; R],
    reception: Reception,
    flow: Option<Flow>,
    message: Vec<u8, S>,
    sending: Sending,
    /// Bytes of the message that have left, and the number of the next consecutive frame.
    sent: u16,
    number: u8,
    /// Since when a frame is due that found no place.
    due_ms: Option<u32>,
}

impl<const R: usize, const S: usize> Default for Link<R, S> {
    fn default() -> Self {
        Self::NEW
    }
}

impl<const R: usize, const S: usize> Link<R, S> {
    /// Nothing under way.
    pub const NEW: Self = Self {
        received: [0; R],
        reception: Reception::Idle,
        flow: None,
        message: Vec::new(),
        sending: Sending::Idle,
        sent: 0,
        number: 0,
        due_ms: None,
    };

    /// Takes the data of a frame under the peer's identifier. What is not of the protocol, or not due, is ignored.
    pub fn receive(&mut self, data: &[u8], now_ms: u32) {
        let Some((head, rest)) = data.split_first() else {
            return;
        };
        match (head >> 4, rest) {
            (0, rest) => self.single(u16::from(head & 0xF), rest),
            (1, [low, rest @ ..]) if rest.len() == usize::from(IN_FIRST) => {
                self.first((u16::from(head & 0xF) << 8) | u16::from(*low), rest, now_ms);
            }
            (2, rest) => self.consecutive(head & 0xF, rest, now_ms),
            (3, [block, separation, ..]) => self.flow_control(head & 0xF, *block, *separation, now_ms),
            _ => {}
        }
    }

    fn single(&mut self, length: u16, rest: &[u8]) {
        let Some(bytes) = rest.get(..usize::from(length)).filter(|bytes| !bytes.is_empty()) else {
            return;
        };
        // One that was not yet taken stays: who asks waits for the answer.
        if !matches!(self.reception, Reception::Complete { .. }) {
            self.keep(0, bytes);
            self.reception = Reception::Complete { length };
        }
    }

    fn first(&mut self, length: u16, rest: &[u8], now_ms: u32) {
        if matches!(self.reception, Reception::Complete { .. }) {
            return;
        }
        match length {
            // A length of more than twelve bits follows, which is longer than any message here.
            0 => (self.reception, self.flow) = (Reception::Idle, Some(Flow::Overflow)),
            // It would have been a single frame.
            1..=7 => {}
            _ => {
                self.keep(0, rest);
                self.reception = Reception::Under {
                    length,
                    got: IN_FIRST,
                    next: 1,
                    left_in_block: BLOCK_SIZE,
                    since_ms: now_ms,
                };
                self.flow = Some(Flow::Go);
            }
        }
    }

    fn consecutive(&mut self, number: u8, rest: &[u8], now_ms: u32) {
        let Reception::Under {
            length,
            got,
            next,
            left_in_block,
            since_ms,
        } = self.reception
        else {
            return;
        };
        let count = length.saturating_sub(got).min(IN_CONSECUTIVE);
        let is_late = now_ms.wrapping_sub(since_ms) > TIMEOUT_MS;
        // A frame was lost, or somebody else's came between: the message is none.
        let bytes = rest
            .get(..usize::from(count))
            .filter(|_| number == next && !is_late);
        let Some(bytes) = bytes else {
            self.reception = Reception::Idle;
            return;
        };
        self.keep(got, bytes);
        let got = got.saturating_add(count);
        let is_block_over = left_in_block <= 1;
        self.reception = if got >= length {
            Reception::Complete { length }
        } else {
            if is_block_over {
                self.flow = Some(Flow::Go);
            }
            Reception::Under {
                length,
                got,
                next: next.wrapping_add(1) & 0xF,
                left_in_block: if is_block_over {
                    BLOCK_SIZE
                } else {
                    left_in_block.saturating_sub(1)
                },
                since_ms: now_ms,
            }
        };
    }

    /// Keeps what has a place.
    fn keep(&mut self, at: u16, bytes: &[u8]) {
        let places = self.received.iter_mut().skip(usize::from(at));
        places.zip(bytes).for_each(|(place, byte)| *place = *byte);
    }

    fn flow_control(&mut self, status: u8, block: u8, separation: u8, now_ms: u32) {
        let Sending::Waiting { waits, .. } = self.sending else {
            return;
        };
        self.sending = match status {
            0 => Sending::Block {
                left: (block > 0).then_some(block),
                separation_ms: match separation {
                    0..=LONGEST_SEPARATION_MS => separation,
                    // Tenths of a millisecond.
                    0xF1..=0xF9 => 1,
                    _ => LONGEST_SEPARATION_MS,
                },
                since_ms: None,
            },
            1 if waits < MOST_WAITS => Sending::Waiting {
                since_ms: now_ms,
                waits: waits.saturating_add(1),
            },
            // The peer has no room, waits for ever, or says what nobody knows.
            _ => Sending::Idle,
        };
    }

    /// The message that has come, until [`Link::done`].
    #[must_use]
    pub fn message(&self) -> Option<Message<'_>> {
        match self.reception {
            Reception::Complete { length } => {
                let kept = usize::from(length).min(R);
                let bytes = self.received.get(..kept)?;
                Some(Message { bytes, length })
            }
            _ => None,
        }
    }

    /// The message is dealt with: the next may come.
    pub fn done(&mut self) {
        if matches!(self.reception, Reception::Complete { .. }) {
            self.reception = Reception::Idle;
        }
    }

    /// Whether a message or a part of one still has to leave.
    #[must_use]
    pub fn is_sending(&self) -> bool {
        self.sending != Sending::Idle
    }

    /// Begins to send a message, in place of one that is under way. False: it is empty or has no place.
    pub fn send(&mut self, bytes: &[u8]) -> bool {
        self.message.clear();
        self.sending = Sending::Idle;
        let is_good = !bytes.is_empty()
            && bytes.len() <= usize::from(LONGEST)
            && self.message.extend_from_slice(bytes).is_ok();
        if is_good {
            (self.sending, self.sent, self.number) = (Sending::First, 0, 1);
        }
        is_good
    }

    /// Gives up what did not go on in time. To be called in every step.
    pub fn age(&mut self, now_ms: u32) {
        let is_late = |since_ms: u32| now_ms.wrapping_sub(since_ms) > TIMEOUT_MS;
        if let Reception::Under { since_ms, .. } = self.reception
            && is_late(since_ms)
        {
            self.reception = Reception::Idle;
        }
        if let Sending::Waiting { since_ms, .. } = self.sending
            && is_late(since_ms)
        {
            self.sending = Sending::Idle;
        }
        if self.frame(now_ms).is_none() {
            self.due_ms = None;
        } else if is_late(*self.due_ms.get_or_insert(now_ms)) {
            (self.sending, self.flow, self.due_ms) = (Sending::Idle, None, None);
        }
    }

    /// The frame that is due: flow control before what is sent.
    #[must_use]
    pub fn frame(&self, now_ms: u32) -> Option<Bytes> {
        if let Some(flow) = self.flow {
            let status = match flow {
                Flow::Go => 0x30,
                Flow::Overflow => 0x32,
            };
            return Some(filled(&[status, BLOCK_SIZE, SEPARATION_MS], &[]));
        }
        let [high, length] = u16::try_from(self.message.len()).ok()?.to_be_bytes();
        let rest = self.message.get(usize::from(self.sent)..)?;
        match self.sending {
            Sending::First if self.message.len() <= usize::from(IN_CONSECUTIVE) => {
                Some(filled(&[length], rest))
            }
            Sending::First => Some(filled(&[0x10 | high, length], rest)),
            Sending::Block {
                separation_ms,
                since_ms,
                ..
            } => {
                let is_due = since_ms.is_none_or(|at| now_ms.wrapping_sub(at) >= u32::from(separation_ms));
                is_due.then(|| filled(&[0x20 | self.number], rest))
            }
            Sending::Idle | Sending::Waiting { .. } => None,
        }
    }

    /// The frame that was due has left.
    pub fn sent(&mut self, now_ms: u32) {
        self.due_ms = None;
        if self.flow.take().is_some() {
            return;
        }
        let wait = Sending::Waiting {
            since_ms: now_ms,
            waits: 0,
        };
        match self.sending {
            Sending::First if self.message.len() <= usize::from(IN_CONSECUTIVE) => {
                self.sending = Sending::Idle
            }
            Sending::First => (self.sending, self.sent) = (wait, IN_FIRST),
            Sending::Block {
                left, separation_ms, ..
            } => {
                self.sent = self.sent.saturating_add(IN_CONSECUTIVE);
                self.number = self.number.wrapping_add(1) & 0xF;
                let left = left.map(|left| left.saturating_sub(1));
                self.sending = if usize::from(self.sent) >= self.message.len() {
                    Sending::Idle
                } else if left == Some(0) {
                    wait
                } else {
                    Sending::Block {
                        left,
                        separation_ms,
                        since_ms: Some(now_ms),
                    }
                };
            }
            Sending::Idle | Sending::Waiting { .. } => {}
        }
    }
}

/// A full frame of a head and as much of the rest as has a place.
fn filled(head: &[u8], rest: &[u8]) -> Bytes {
    let mut bytes = [PADDING; 8];
    let places = bytes.iter_mut().zip(head.iter().chain(rest));
    places.for_each(|(place, byte)| *place = *byte);
    bytes
}
