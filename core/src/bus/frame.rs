//! A classic CAN data frame with an 11-bit identifier: all this bus carries.

use embedded_can::{Id, StandardId};

/// Up to eight bytes under an 11-bit identifier.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame {
    id: u16,
    len: u8,
    data: [u8; 8],
}

impl Frame {
    /// Largest identifier.
    pub const MAX_ID: u16 = 0x7FF;

    /// A frame, or `None` for an identifier above 0x7FF or more than eight bytes.
    #[must_use]
    #[expect(clippy::as_conversions, reason = "at most eight bytes")]
    pub fn new(id: u16, bytes: &[u8]) -> Option<Self> {
        if id > Self::MAX_ID {
            return None;
        }
        let mut data = [0; 8];
        data.get_mut(..bytes.len())?.copy_from_slice(bytes);
        Some(Self {
            id,
            // At most eight, or there would have been no place for them.
            len: bytes.len() as u8,
            data,
        })
    }

    /// A full frame. `id` is a message's own identifier, at most 0x7FF; higher bits are dropped.
    #[must_use]
    pub const fn full(id: u16, data: [u8; 8]) -> Self {
        Self {
            id: id & Self::MAX_ID,
            len: 8,
            data,
        }
    }

    /// The 11-bit identifier.
    #[must_use]
    pub const fn id(&self) -> u16 {
        self.id
    }

    /// The payload, 0 to 8 bytes.
    #[must_use]
    pub fn data(&self) -> &[u8] {
        self.data.get(..usize::from(self.len)).unwrap_or(&[])
    }

    /// All eight bytes, those beyond the length zero.
    pub(crate) const fn bytes(&self) -> &[u8; 8] {
        &self.data
    }

    /// Whether all eight bytes are payload.
    pub(crate) const fn is_full(&self) -> bool {
        self.len == 8
    }

    /// All eight bytes, if the frame is full.
    #[must_use]
    pub fn full_data(&self) -> Option<[u8; 8]> {
        (self.len == 8).then_some(self.data)
    }
}

impl embedded_can::Frame for Frame {
    fn new(id: impl Into<Id>, data: &[u8]) -> Option<Self> {
        match id.into() {
            Id::Standard(id) => Self::new(id.as_raw(), data),
            Id::Extended(_) => None,
        }
    }

    /// Remote frames are not used on this bus.
    fn new_remote(_id: impl Into<Id>, _dlc: usize) -> Option<Self> {
        None
    }

    fn is_extended(&self) -> bool {
        false
    }

    fn is_remote_frame(&self) -> bool {
        false
    }

    fn id(&self) -> Id {
        Id::Standard(StandardId::new(self.id).unwrap_or(StandardId::ZERO))
    }

    fn dlc(&self) -> usize {
        usize::from(self.len)
    }

    fn data(&self) -> &[u8] {
        self.data()
    }
}
