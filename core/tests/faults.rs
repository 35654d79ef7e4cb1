//! The list of faults against the table in docs/safety.md, and the sets that follow from their classes against masks
//! written here by hand.

use haptic_core::faults::{Class, Fault, FaultSet};

/// Every fault of the document's table, in its order, with the class of its row.
fn documented() -> Vec<(String, String)> {
    let document = include_str!("../../docs/safety.md");
    let (_, table) = document
        .split_once("| fault | class | declared after |\n|---|---|---|\n")
        .unwrap();
    let rows = table.lines().take_while(|line| line.starts_with('|'));
    let mut faults = Vec::new();
    for row in rows {
        let [names, class] = row.split('|').map(str::trim).collect::<Vec<_>>()[1..3] else {
            panic!("{row}")
        };
        faults.extend(names.split(", ").map(|name| (name.to_owned(), class.to_owned())));
    }
    faults
}

#[test]
fn the_document_names_every_fault_with_its_class() {
    let mut coded = Fault::ALL.map(|fault| (format!("{fault:?}"), format!("{:?}", fault.class())));
    let mut documented = documented();
    coded.sort();
    documented.sort();
    assert_eq!(documented, coded);
}

#[test]
fn sets_follow_from_the_classes() {
    let bits = [
        FaultSet::INPUT,
        FaultSet::CRITICAL,
        FaultSet::LOCKING,
        FaultSet::FADING,
    ]
    .map(FaultSet::bits);
    assert_eq!(bits, [0x7_80FF, 0x1F00, 0x6000, 0x8_0000]);
    assert_eq!(FaultSet::of(Class::C), FaultSet::CRITICAL);
}

#[test]
fn bits_without_a_fault_are_dropped() {
    assert_eq!(FaultSet::from_bits(u32::MAX).bits(), 0xF_FFFF);
    assert_eq!(Fault::from_code(17), Some(Fault::OwnIdentifier));
    assert_eq!(Fault::from_code(19), Some(Fault::HandsOff));
    assert_eq!(Fault::from_code(20), None);
}
