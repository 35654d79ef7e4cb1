//! What an ECU has heard and when it was stepped, so that a pickle can drive another one there: its state has no
//! other form. About 11 kB a second on a whole bus; copies share it.

use std::sync::Arc;

use haptic_core::bus::Frame;
use haptic_core::ecu::Ecu;
use haptic_core::quantity::Instant;

/// The low half of an event's first byte: a step, or else a frame with so many bytes.
const STEP: u8 = 15;
/// Its high half: when, behind the event before.
const AT_ONCE: u8 = 0;
const A_MILLISECOND: u8 = 1;
const SAID: u8 = 2;
/// Bytes that copies share.
const CHUNK: usize = 16_384;

/// Events in order.
#[derive(Clone, Default)]
pub(crate) struct History {
    chunks: Vec<Arc<[u8]>>,
    last: Vec<u8>,
    t_us: u32,
}

impl History {
    /// From a clock's start on.
    pub(crate) fn new(t_us: u32) -> Self {
        Self {
            t_us,
            ..Self::default()
        }
    }

    fn event(&mut self, what: u8, t_us: u32) {
        if self.last.len() > CHUNK {
            self.chunks.push(std::mem::take(&mut self.last).into());
        }
        let elapsed_us = t_us.wrapping_sub(self.t_us);
        self.t_us = t_us;
        match elapsed_us {
            0 => self.last.push(what | AT_ONCE << 4),
            1000 => self.last.push(what | A_MILLISECOND << 4),
            _ => {
                self.last.push(what | SAID << 4);
                self.last.extend(elapsed_us.to_le_bytes());
            }
        }
    }

    /// The ECU was stepped.
    pub(crate) fn step(&mut self, t_us: u32) {
        self.event(STEP, t_us);
    }

    /// A frame came.
    pub(crate) fn frame(&mut self, frame: &Frame, t_us: u32) {
        self.event(frame.data().len() as u8, t_us);
        self.last.extend(frame.id().to_le_bytes());
        self.last.extend(frame.data());
    }

    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        let chunks = self.chunks.iter().map(AsRef::as_ref);
        chunks.chain([self.last.as_slice()]).collect::<Vec<_>>().concat()
    }

    /// Drives `ecu`, which was made at `t_us`, through events; `None` if these bytes are none.
    pub(crate) fn replay(mut bytes: &[u8], t_us: u32, ecu: &mut Ecu) -> Option<Self> {
        let mut history = Self::new(t_us);
        while let Some((&head, rest)) = bytes.split_first() {
            bytes = rest;
            let elapsed_us = match head >> 4 {
                AT_ONCE => 0,
                A_MILLISECOND => 1000,
                SAID => u32::from_le_bytes(*bytes.split_off(..4)?.first_chunk()?),
                _ => return None,
            };
            let t_us = history.t_us.wrapping_add(elapsed_us);
            if head & 15 == STEP {
                let _ = ecu.step(Instant::from_us(t_us));
                let _ = ecu.background_step();
                history.step(t_us);
            } else {
                let id = u16::from_le_bytes(*bytes.split_off(..2)?.first_chunk()?);
                let frame = Frame::new(id, bytes.split_off(..usize::from(head & 15))?)?;
                let _ = ecu.receive(&frame, Instant::from_us(t_us));
                history.frame(&frame, t_us);
            }
        }
        Some(history)
    }
}
