//! A frame and what `embedded-can` sees of it.

use embedded_can::{ExtendedId, Frame as _, Id, StandardId};
use haptic_core::bus::Frame;

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
