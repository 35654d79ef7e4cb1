//! A CAN data frame with an 11-bit identifier: classic, or of CAN FD.

use embedded_can::{Id, StandardId};

/// Up to `N` bytes under an 11-bit identifier, in one of the lengths that CAN FD has ([`is_can_length`]).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CanFrame<const N: usize> {
    id: u16,
    len: u8,
    data: [u8; N],
}

/// A classic frame of up to eight bytes: this bus carries no other.
pub type Frame = CanFrame<8>;

/// A frame of CAN FD, up to 64 bytes.
pub type FdFrame = CanFrame<64>;

/// Lengths beyond eight bytes, by their data length codes 9 to 15 (ISO 11898-1).
const LONG: [usize; 7] = [12, 16, 20, 24, 32, 48, 64];

/// Whether a frame can have so many bytes: 0 to 8, 12, 16, 20, 24, 32, 48 or 64. A sender pads what lies between.
#[must_use]
pub const fn is_can_length(bytes: usize) -> bool {
    bytes <= 8 || matches!(bytes, 12 | 16 | 20 | 24 | 32 | 48 | 64)
}

impl<const N: usize> CanFrame<N> {
    /// Largest identifier.
    pub const MAX_ID: u16 = 0x7FF;

    /// A frame, or `None` for an identifier above 0x7FF, more than `N` bytes, or a length that no frame has.
    #[must_use]
    #[expect(clippy::as_conversions, reason = "at most 64 bytes")]
    pub fn new(id: u16, bytes: &[u8]) -> Option<Self> {
        if id > Self::MAX_ID || !is_can_length(bytes.len()) {
            return None;
        }
        let mut data = [0; N];
        data.get_mut(..bytes.len())?.copy_from_slice(bytes);
        let len = bytes.len() as u8;
        Some(Self { id, len, data })
    }

    /// A full frame. `id` is a message's own identifier, at most 0x7FF; higher bits are dropped. That a frame can be `N` bytes
    /// long is checked when it is compiled.
    #[must_use]
    #[expect(clippy::as_conversions, reason = "at most 64 bytes")]
    pub const fn full(id: u16, data: [u8; N]) -> Self {
        const { assert!(is_can_length(N), "no CAN frame has this length") };
        Self {
            id: id & Self::MAX_ID,
            len: N as u8,
            data,
        }
    }

    /// The 11-bit identifier.
    #[must_use]
    pub const fn id(&self) -> u16 {
        self.id
    }

    /// The payload, 0 to `N` bytes.
    #[must_use]
    pub fn data(&self) -> &[u8] {
        self.data.get(..usize::from(self.len)).unwrap_or(&[])
    }

    /// The payload, if it is exactly `L` bytes long.
    #[must_use]
    pub fn payload<const L: usize>(&self) -> Option<&[u8; L]> {
        self.data.first_chunk().filter(|_| usize::from(self.len) == L)
    }

    /// The whole buffer; bytes beyond the length of the frame are zero.
    pub(crate) const fn bytes(&self) -> &[u8; N] {
        &self.data
    }

    /// The payload, if it fills the frame.
    #[must_use]
    pub fn full_data(&self) -> Option<[u8; N]> {
        self.payload().copied()
    }
}

impl<const N: usize> embedded_can::Frame for CanFrame<N> {
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

    /// The data length code: the length up to eight bytes, 9 to 15 beyond.
    fn dlc(&self) -> usize {
        let len = usize::from(self.len);
        let long = LONG.iter().position(|long| *long == len);
        long.map_or(len, |place| place.saturating_add(9))
    }

    fn data(&self) -> &[u8] {
        self.data()
    }
}
