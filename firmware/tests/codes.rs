//! Codes of faults in flash, on a model of it: found again after a loss of supply, cleared for good, whole after a cut at any step.

use haptic_core::bus::messages::{Column, LanePreview, Message, Vehicle};
use haptic_core::controller::Command;
use haptic_core::quantity::Torque;
use haptic_core::safety::envelope::LimitReason;
use haptic_core::safety::faults::{Fault, FaultSet};
use haptic_core::safety::modes::Mode;
use haptic_diag::data::Ear;
use haptic_diag::trouble::Attempts;
use haptic_diag::trouble::{CELLS, Cells, EMPTY, Record, Troubles, attempts, keep_attempts, record};
use haptic_firmware::codes::Codes;
use haptic_firmware::nor::{Nor, PAGE};

const PAGES: usize = 9;
/// Entries of 40 bytes in a page behind its head of 16.
const ENTRIES: usize = 50;

/// What a loss of supply leaves in memory.
const NOISE: Cells = [[0xA5C3_0F69; 9]; CELLS];

fn blank() -> Vec<u8> {
    vec![0xFF; PAGES * PAGE]
}

/// A fault appears, at a time that tells it from its other appearances.
fn appears(cells: &mut Cells, fault: Fault, at_ms: u32) {
    let command = Command {
        torque: Torque::ZERO,
        probe: None,
        limit: LimitReason::None,
        mode: Mode::Standby,
        faults: FaultSet::NONE.with(fault),
        warning: false,
        hands: None,
    };
    // With every number known: of those that are not, none equals itself.
    let mut ear = Ear::default();
    let lane = LanePreview {
        valid: true,
        ..LanePreview::default()
    };
    for frame in [
        lane.encode(0),
        Column::default().encode(0),
        Vehicle::default().encode(0),
    ] {
        ear.hear(&frame);
    }
    Troubles::new(cells).step(cells, &command, || ear.heard(), at_ms);
}

fn clear(cells: &mut Cells, fault: Fault) {
    Troubles::new(cells).clear(cells, fault);
}

/// A start: what it makes of flash and memory, and the codes, if the flash takes any.
fn start(flash: &mut Nor<Vec<u8>>, cells: &mut Cells) -> Option<Codes> {
    let mut codes = Codes::begin(flash, cells)?;
    while codes.keep(flash, cells) {}
    Some(codes)
}

/// What is found after a loss of supply.
fn after_loss(memory: &[u8]) -> Cells {
    let mut cells = NOISE;
    Codes::begin(&mut Nor::new(memory.to_vec()), &mut cells);
    cells
}

fn at_ms(record: Option<Record>) -> Option<u32> {
    record.map(|record| record.snapshot.at_ms)
}

#[test]
fn codes_are_found_again_after_a_loss_of_supply_until_they_are_cleared() {
    let (mut flash, mut cells) = (Nor::new(blank()), EMPTY);
    let mut codes = start(&mut flash, &mut cells).unwrap();
    appears(&mut cells, Fault::Actuator, 7);
    appears(&mut cells, Fault::OwnIdentifier, 8);
    appears(&mut cells, Fault::OwnIdentifier, 9);
    keep_attempts(
        &mut cells,
        Attempts {
            challenges: 5,
            wrong: 2,
        },
    );
    let memory = flash.into_memory();
    // Not before they are stored.
    assert!(
        Fault::ALL
            .iter()
            .all(|fault| record(&after_loss(&memory), *fault).is_none())
    );
    let mut flash = Nor::new(memory);
    let stored = (0..10).take_while(|_| codes.keep(&mut flash, &cells)).count();
    assert_eq!(stored, 3, "each cell that changed, once");
    let memory = flash.into_memory();
    let mut found = after_loss(&memory);
    for fault in Fault::ALL {
        assert_eq!(record(&found, fault), record(&cells, fault), "{fault:?}");
    }
    assert_eq!(
        record(&found, Fault::OwnIdentifier).map(|record| record.count),
        Some(2)
    );
    assert_eq!(
        attempts(&found),
        Attempts {
            challenges: 5,
            wrong: 2
        }
    );
    // Cleared, and the supply lost before that is stored: the code is there again.
    clear(&mut found, Fault::Actuator);
    assert!(record(&found, Fault::Actuator).is_none());
    assert!(record(&after_loss(&memory), Fault::Actuator).is_some());
    // A reset alone leaves memory, which is newer than the flash, alone; and its start stores it.
    let mut flash = Nor::new(memory);
    start(&mut flash, &mut found).unwrap();
    assert!(record(&found, Fault::Actuator).is_none());
    let found = after_loss(&flash.into_memory());
    assert!(record(&found, Fault::Actuator).is_none() && record(&found, Fault::OwnIdentifier).is_some());
}

/// Two appearances of many faults, one behind the other, the supply cut after every number of operations: each fault has its old
/// or its new record, and no other.
#[test]
fn a_cut_at_any_step_leaves_each_code_as_it_was_or_as_it_is() {
    let faults = Fault::ALL;
    let (mut memory, mut cells) = (blank(), EMPTY);
    let (mut points, mut most) = (0, 0);
    for turn in 0..12_u32 {
        let before = cells;
        for (k, fault) in faults.iter().enumerate() {
            // Some change each time, others hardly ever.
            if turn == 0 || k % 3 == 0 {
                appears(&mut cells, *fault, 1000 * turn + k as u32);
            }
        }
        for operations in 1.. {
            let mut flash = Nor::new(memory.clone());
            flash.cut_after(operations);
            let mut now = cells;
            start(&mut flash, &mut now);
            let is_cut = flash.is_cut();
            let after = flash.into_memory();
            let found = after_loss(&after);
            for fault in faults {
                let allowed = [record(&before, fault), record(&cells, fault)];
                assert!(
                    allowed.contains(&record(&found, fault)),
                    "{fault:?}, turn {turn}, {operations}: {:?}",
                    at_ms(record(&found, fault))
                );
            }
            // And a start after that mends it.
            let mut flash = Nor::new(after);
            start(&mut flash, &mut { cells }).unwrap();
            let found = after_loss(&flash.into_memory());
            assert!(
                faults
                    .iter()
                    .all(|fault| record(&found, *fault) == record(&cells, *fault))
            );
            if !is_cut {
                most = most.max(operations);
                break;
            }
            points += 1;
        }
        let mut flash = Nor::new(memory);
        start(&mut flash, &mut cells).unwrap();
        memory = flash.into_memory();
    }
    // All cells, and the other page's erase and head.
    assert!(most > 21 * 5 + 2, "no page was turned: {most}");
    assert!(points > 500, "{points} points");
}

/// Between two starts words are programmed and nothing is erased, up to the end of the page; the next start makes room, and erases
/// one page.
#[test]
fn what_is_stored_between_two_starts_is_bounded_and_erases_nothing() {
    let (mut flash, mut cells) = (Nor::new(blank()), EMPTY);
    for fault in Fault::ALL {
        appears(&mut cells, fault, 0);
    }
    let mut codes = start(&mut flash, &mut cells).unwrap();
    let mut stored = Fault::COUNT;
    let mut turn = 0;
    loop {
        turn += 1;
        appears(&mut cells, Fault::LaneTimeout, turn);
        let before = flash.into_memory();
        flash = Nor::new(before.clone());
        let is_stored = codes.keep(&mut flash, &cells);
        let after = flash.into_memory();
        let is_only_programmed = before
            .iter()
            .zip(&after)
            .all(|(before, after)| before & after == *after);
        assert!(is_only_programmed, "turn {turn}");
        flash = Nor::new(after);
        if !is_stored {
            break;
        }
        stored += 1;
    }
    assert_eq!(stored, ENTRIES);
    let memory = flash.into_memory();
    assert_eq!(
        at_ms(record(&after_loss(&memory), Fault::LaneTimeout)),
        Some(turn - 1)
    );
    let mut flash = Nor::new(memory.clone());
    start(&mut flash, &mut cells).unwrap();
    let after = flash.into_memory();
    assert_eq!(at_ms(record(&after_loss(&after), Fault::LaneTimeout)), Some(turn));
    assert_eq!(memory[..PAGE], after[..PAGE], "the old page");
    assert_eq!(memory[2 * PAGE..], after[2 * PAGE..], "other pages");
}

#[test]
fn a_flash_without_room_or_supply_takes_none_and_memory_stays_as_it_is() {
    let mut cells = EMPTY;
    appears(&mut cells, Fault::Monitor, 3);
    let before = cells;
    assert!(Codes::begin(&mut Nor::new(vec![0xFF; 8 * PAGE]), &mut cells).is_none());
    let mut dead = Nor::new(blank());
    dead.cut_after(0);
    assert!(Codes::begin(&mut dead, &mut cells).is_none());
    assert_eq!(cells, before);
}
