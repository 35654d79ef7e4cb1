//! A frame and what `embedded-can` sees of it.

use embedded_can::{ExtendedId, Frame as _, Id, StandardId};
use haptic_core::bus::{CanFrame, FdFrame, Frame};

#[test]
fn identifiers_and_lengths_at_their_edges() {
    for length in 0..=8 {
        let bytes = &[1, 2, 3, 4, 5, 6, 7, 8][..length];
        let frame = Frame::new(0x7FF, bytes).unwrap();
        assert_eq!((frame.id(), frame.data()), (0x7FF, bytes));
    }
    assert_eq!(Frame::new(0x800, &[]), None);
    assert_eq!(Frame::new(0, &[0; 9]), None);
}

/// The lengths of CAN FD and their codes, ISO 11898-1; a frame of up to 32 bytes has room for some.
#[test]
fn a_frame_of_can_fd_has_sixteen_lengths() {
    const BYTES: [u8; 65] = [0xA5; 65];
    let lengths = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];
    for length in 0..=65 {
        let frame = FdFrame::new(0x7FF, &BYTES[..length]);
        let code = lengths.iter().position(|one| *one == length);
        assert_eq!(frame.map(|frame| frame.dlc()), code, "{length}");
        if let Some(frame) = frame {
            assert_eq!((frame.id(), frame.data()), (0x7FF, &BYTES[..length]));
            assert_eq!(frame.payload::<12>().is_some(), length == 12);
            assert_eq!(frame.payload::<48>().is_some(), length == 48);
            assert_eq!(frame.full_data().is_some(), length == 64);
        }
        let shorter = CanFrame::<32>::new(0x7FF, &BYTES[..length]);
        assert_eq!(shorter.is_some(), code.is_some() && length <= 32, "{length}");
    }
    assert_eq!(FdFrame::new(0x800, &[]), None);
    assert_eq!(FdFrame::full(0x123, [7; 64]).data(), [7; 64]);
}

#[test]
fn as_embedded_can_sees_it() {
    let id = StandardId::new(0x123).unwrap();
    let frame = <Frame as embedded_can::Frame>::new(Id::Standard(id), &[9, 8]).unwrap();
    assert_eq!(Frame::new(0x123, &[9, 8]), Some(frame));
    assert_eq!(embedded_can::Frame::id(&frame), Id::Standard(id));
    assert_eq!(embedded_can::Frame::data(&frame), [9, 8]);
    assert_eq!(frame.dlc(), 2);
    assert!(frame.is_standard() && !frame.is_extended());
    assert!(frame.is_data_frame() && !frame.is_remote_frame());
    // This bus has neither extended nor remote frames.
    let extended = ExtendedId::new(0x123).unwrap();
    assert_eq!(
        <Frame as embedded_can::Frame>::new(Id::Extended(extended), &[]),
        None
    );
    assert_eq!(Frame::new_remote(id, 2), None);
}
