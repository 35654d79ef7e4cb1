//! The list of faults against the table in docs/reference/bus.md, and the sets that follow from their classes against
//! masks written here by hand.

use haptic_core::bus::messages::{Guidance, Message, ResetCause};
use haptic_core::quantity::{Instant, Micros, Torque};
use haptic_core::safety::envelope::LimitReason;
use haptic_core::safety::faults::{Class, Fault, FaultHistory, FaultSet};
use haptic_core::safety::modes::Mode;

/// Every row of the document's table: bit, name and class.
fn documented() -> Vec<String> {
    let document = include_str!("../../docs/reference/bus.md");
    let (_, table) = document
        .split_once("| bit | fault | class | declared after |\n|---|---|---|---|\n")
        .unwrap();
    let rows = table.lines().take_while(|line| line.starts_with('|'));
    rows.map(|row| row.split('|').map(str::trim).collect::<Vec<_>>()[1..4].join(" "))
        .collect()
}

#[test]
fn the_document_names_every_fault_with_its_bit_and_class() {
    let coded = (0..).zip(Fault::ALL);
    let coded: Vec<_> = coded
        .map(|(bit, fault): (u32, _)| format!("{bit} {fault:?} {:?}", fault.class()))
        .collect();
    assert_eq!(documented(), coded);
}

#[test]
fn sets_follow_from_the_classes() {
    let bits = [
        FaultSet::INPUT,
        FaultSet::CRITICAL,
        FaultSet::LOCKING,
        FaultSet::FADING,
        FaultSet::of_class(Class::L),
    ]
    .map(FaultSet::bits);
    assert_eq!(bits, [0x7_80FF, 0x1F00, 0x6000, 0x8_0000, 0x10_0000]);
    assert_eq!(FaultSet::of_class(Class::C), FaultSet::CRITICAL);
}

#[test]
fn bits_without_a_fault_are_dropped() {
    assert_eq!(FaultSet::from_bits(u32::MAX).bits(), 0x1F_FFFF);
    assert_eq!(Fault::from_code(17), Some(Fault::OwnIdentifier));
    assert_eq!(Fault::from_code(19), Some(Fault::HandsOff));
    assert_eq!(Fault::from_code(20), Some(Fault::YawRate));
    assert_eq!(Fault::from_code(21), None);
}

/// Bit 37 of the guidance frame and the 20 behind it.
#[test]
fn each_fault_has_its_bit_in_the_guidance_frame() {
    for (code, fault) in Fault::ALL.into_iter().enumerate() {
        let guidance = Guidance {
            torque: Torque::ZERO,
            limit: LimitReason::None,
            mode: Mode::Boot,
            warning: false,
            faults: FaultSet::NONE.with(fault),
            reset: ResetCause::PowerOn,
        };
        let mut data = [0; 8];
        guidance.pack(&mut data);
        let faults = u64::from_le_bytes(data) >> 37 & 0x1F_FFFF;
        assert_eq!(faults, 1 << code, "{fault:?}");
    }
}

#[test]
fn the_history_counts_to_255_and_no_further() {
    let (mut history, lane) = (
        FaultHistory::new(Instant::from_us(0)),
        FaultSet::NONE.with(Fault::LaneTimeout),
    );
    for k in 1..=300_u32 {
        history.step(Instant::from_us(2000 * k), lane);
        history.step(Instant::from_us(2000 * k + 1000), FaultSet::NONE);
        let counts = [0, 1].map(|index| history.record(index).map(|record| record.count));
        assert_eq!(counts, [Some(k.min(255) as u8), None]);
    }
}

/// Lines are those of the faults that appeared, in the order of their bits, of the first bit and the last.
#[test]
fn the_history_has_a_line_for_each_fault_that_appeared() {
    let last = Fault::ALL[Fault::COUNT - 1];
    for appeared in [
        &[][..],
        &[Fault::LaneTimeout],
        &[last],
        &[Fault::LaneTimeout, Fault::Memory, Fault::HandsOff, last],
        &Fault::ALL,
    ] {
        let mut history = FaultHistory::new(Instant::from_us(0));
        let faults = appeared
            .iter()
            .fold(FaultSet::NONE, |set, fault| set.with(*fault));
        history.step(Instant::from_us(1000), faults);
        let lines = (0..40).map_while(|index| history.record(index));
        let lines: Vec<Fault> = lines.map(|record| record.fault).collect();
        assert_eq!(lines, appeared);
        assert_eq!(history.record(u32::MAX), None);
    }
}

/// Seconds since it last appeared, however often the clock wraps meanwhile, and no more than 16 bits hold; whether it is there.
#[test]
fn the_history_knows_when_a_fault_last_appeared() {
    let mut now = Instant::from_us(u32::MAX - 10_000_000);
    let mut history = FaultHistory::new(now);
    let lane = FaultSet::NONE.with(Fault::LaneTimeout);
    for second in 0..70_000_u32 {
        let present = if second < 3 { lane } else { FaultSet::NONE };
        history.step(now, present);
        let record = history.record(0).unwrap();
        assert_eq!(
            (record.age_s, record.present),
            (second.min(65_535) as u16, second < 3)
        );
        now = now.after(Micros::from_ms(1000));
    }
    history.step(now, lane);
    let record = history.record(0).unwrap();
    assert_eq!((record.age_s, record.count), (0, 2));
}
