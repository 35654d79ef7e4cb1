//! Power lost at every step of a parameter write, on a model of the flash: the last good set is never lost.
//!
//! A write is cut after every number of its operations, the one under way left half done; then the device starts
//! again, and must find the set before the write or the new one, whole. The same is then tried on top of what a
//! cut left behind, and while pages turn over.

use haptic_core::controller::params::Params;
use haptic_core::service::stored::Set;
use haptic_firmware::nor::{Nor, PAGE};
use haptic_firmware::storage::{Found, WriteFailed, load, repair, save};

type Memory = [u8; 4 * PAGE];

const BLANK: Memory = [0xFF; 4 * PAGE];

/// A set that its number tells apart.
fn set(number: u32) -> Set {
    let params = Params {
        k_1: 0.25 + f64::from(number) / 1024.0,
        ..Params::PAPER
    };
    Set {
        params,
        vehicle: std::num::NonZeroU32::new(7 * number),
    }
}

/// The processor whose flash it is.
const HARDWARE: u32 = 0x0102_0304;

fn found(memory: &Memory) -> Found {
    load(&mut Nor::new(*memory), HARDWARE)
}

/// Writes set `number`, with the supply cut after `operations`, and returns the memory afterwards and whether the
/// write was cut.
fn write(memory: &Memory, number: u32, operations: Option<u32>) -> (Memory, bool) {
    let last = found(memory).stored;
    let mut flash = Nor::new(*memory);
    if let Some(operations) = operations {
        flash.cut_after(operations);
    }
    let result = save(&mut flash, &set(number), last.as_ref(), HARDWARE);
    let is_cut = flash.is_cut();
    assert!(is_cut || result == Ok(()), "{result:?}");
    (flash.into_memory(), is_cut)
}

/// After a cut the device has the set `before` or the set `new`, with its own sequence number.
fn assert_one_of(memory: &Memory, before: u32, new: u32, what: &str) {
    let stored = found(memory)
        .stored
        .unwrap_or_else(|| panic!("{what}: no set is left"));
    let number = stored.sequence;
    assert!(number == before || number == new, "{what}: set {number}");
    assert_eq!(stored.set, set(number), "{what}");
}

/// Cuts one write everywhere, and returns how many points that were.
fn cut_everywhere(memory: &Memory, before: u32) -> u32 {
    // The number of a set is its sequence number.
    for operations in 1.. {
        let (after, is_cut) = write(memory, before + 1, Some(operations));
        if !is_cut {
            return operations - 1;
        }
        let what = format!("cut after {operations} operations of write {}", before + 1);
        assert_one_of(&after, before, before + 1, &what);
    }
    unreachable!("a write ends")
}

#[test]
fn a_write_cut_at_any_step_leaves_the_last_good_set() {
    let mut memory = BLANK;
    let (mut points, mut fewest, mut most) = (0, u32::MAX, 0);
    for number in 1..=60 {
        if number > 1 {
            let here = cut_everywhere(&memory, number - 1);
            points += here;
            (fewest, most) = (fewest.min(here), most.max(here));
        }
        memory = write(&memory, number, None).0;
        assert_eq!(found(&memory).stored.unwrap().set, set(number));
    }
    // A block is 165 bytes, 21 words, and is written twice.
    assert!(fewest >= 2 * 21, "a write of {fewest} operations");
    // 60 writes of 180 bytes and more fill pages of 2 KiB many times over: some of them had to turn a page.
    assert!(most > fewest, "no write turned a page");
    assert!(points > 2000, "{points} points");
}

/// Cuts on top of cuts: the supply fails again and again before a write succeeds.
#[test]
fn repeated_cuts_leave_the_last_good_set() {
    let mut memory = write(&BLANK, 1, None).0;
    let mut before = 1;
    let mut points = 0;
    // Steps that visit every remainder, so that no two rows of cuts are alike.
    for round in 0..400 {
        let operations = 1 + (round * 29) % 67;
        let (after, is_cut) = write(&memory, before + 1, Some(operations));
        memory = after;
        points += u32::from(is_cut);
        assert_one_of(&memory, before, before + 1, &format!("round {round}"));
        before = found(&memory).stored.unwrap().sequence;
    }
    assert!(points > 200, "{points} cuts");
    assert!(before > 50, "only {before} writes went through");
}

#[test]
fn the_first_write_of_all_may_be_cut_and_tried_again() {
    for operations in 1..60 {
        let (memory, _) = write(&BLANK, 1, Some(operations));
        let after = found(&memory);
        // Never both: so the device starts with its built-in set, and a next write is taken.
        assert!(
            after.stored.is_some() || !after.damaged[1],
            "{operations}: {after:?}"
        );
        let (memory, _) = write(&memory, 1 + after.stored.map_or(0, |s| s.sequence), None);
        assert!(found(&memory).stored.is_some());
    }
}

#[test]
fn a_blank_flash_has_no_set_and_no_damage() {
    assert_eq!(found(&BLANK), Found::default());
}

/// One bit of a copy rots: the other one, the same set, is used, and the damage is told.
#[test]
fn a_rotten_copy_is_told_and_the_other_one_used() {
    let memory = write(&BLANK, 1, None).0;
    let (mut told, mut bits) = (0, 0);
    for at in (0..memory.len()).filter(|at| memory[*at] != 0xFF) {
        let mut rotten = memory;
        rotten[at] ^= 0x10;
        let after = found(&rotten);
        assert_eq!(after.stored.map(|s| s.set), Some(set(1)), "byte {at}");
        assert!(after.damaged != [true, true], "byte {at}");
        told += u32::from(after.damaged != [false, false]);
        bits += 1;
    }
    // 2 x 164 bytes of which few are 0xFF; marks of pages are not part of a block.
    assert!(bits > 200 && told * 10 > bits * 8, "{told} of {bits}");
}

/// What a start makes of the memory, with the supply cut after `operations`, and whether it was.
fn repaired(memory: &Memory, operations: Option<u32>) -> (Memory, bool) {
    let mut flash = Nor::new(*memory);
    let found = load(&mut flash, HARDWARE);
    if let Some(operations) = operations {
        flash.cut_after(operations);
    }
    let result = repair(&mut flash, &found, HARDWARE);
    let is_cut = flash.is_cut();
    assert!(is_cut || result == Ok(()), "{result:?}");
    (flash.into_memory(), is_cut)
}

/// A copy rots, the start that finds it repairs it, and then the other one may rot: the set is still there.
#[test]
fn a_rotten_copy_is_repaired_at_once_and_power_may_go_meanwhile() {
    let memory = write(&BLANK, 1, None).0;
    let mut cuts = 0;
    for at in (0..memory.len()).filter(|at| memory[*at] != 0xFF) {
        let mut rotten = memory;
        rotten[at] ^= 0x10;
        let (after, _) = repaired(&rotten, None);
        assert_eq!(found(&after).damaged, [false, false], "byte {at}");
        assert_eq!(
            found(&after).stored.map(|s| (s.set, s.sequence)),
            Some((set(1), 1))
        );
        // Every byte of the copy that was good before.
        for other in (0..after.len()).filter(|other| after[*other] != 0xFF && at % 41 == 0) {
            let mut both = after;
            both[other] ^= 0x10;
            assert_eq!(
                found(&both).stored.map(|s| s.set),
                Some(set(1)),
                "bytes {at}, {other}"
            );
        }
        for operations in 1.. {
            let (cut, is_cut) = repaired(&rotten, Some(operations));
            if !is_cut {
                break;
            }
            assert_one_of(&cut, 1, 1, &format!("byte {at}, repair cut after {operations}"));
            let again = repaired(&cut, None).0;
            assert_eq!(found(&again).damaged, [false, false], "byte {at}, {operations}");
            cuts += 1;
        }
    }
    assert!(cuts > 2000, "{cuts} cuts");
}

/// A write that is cut after its first copy leaves an old set in the second: rotting later, it must not come back.
#[test]
fn a_copy_that_a_cut_left_behind_is_brought_up_to_the_new_set() {
    let mut memory = write(&BLANK, 1, None).0;
    let mut left_behind = 0;
    for number in 2..30 {
        for operations in 1.. {
            let (cut, is_cut) = write(&memory, number, Some(operations));
            if !is_cut {
                break;
            }
            let in_use = found(&cut).stored.unwrap().sequence;
            let (after, _) = repaired(&cut, None);
            let sequences: Vec<_> = [0, 1]
                .map(|copy| {
                    // The other copy gone: pages of 2 KiB, copy 1 first.
                    let mut alone = after;
                    let from = if copy == 0 { 0 } else { 2 * PAGE };
                    alone[from..from + 2 * PAGE].fill(0xFF);
                    found(&alone).stored.map(|s| s.sequence)
                })
                .into();
            assert_eq!(
                sequences,
                [Some(in_use); 2],
                "write {number} cut after {operations}"
            );
            left_behind += u32::from(in_use == number);
        }
        memory = write(&memory, number, None).0;
    }
    assert!(left_behind > 100, "{left_behind}");
}

#[test]
fn nothing_is_repaired_where_nothing_is_stored_or_wrong() {
    assert_eq!(repaired(&BLANK, Some(1)), (BLANK, false));
    let memory = write(&BLANK, 1, None).0;
    assert_eq!(repaired(&memory, Some(1)), (memory, false));
}

#[test]
fn a_set_in_both_copies_rotten_is_no_set() {
    let mut memory = write(&BLANK, 1, None).0;
    // k_1 of the set, 0.2509765625 = 0x3FD0_1000_0000_0000, in each copy.
    let k_1 = set(1).params.k_1.to_le_bytes();
    let places: Vec<usize> = (0..memory.len() - 8)
        .filter(|at| memory[*at..*at + 8] == k_1)
        .collect();
    assert_eq!(places.len(), 2);
    for at in places {
        memory[at + 6] ^= 1;
    }
    let after = found(&memory);
    assert_eq!((after.stored, after.damaged), (None, [true, true]));
}

/// A flash that takes nothing: the error is told, nothing is lost.
#[test]
fn a_flash_without_supply_fails_and_says_so() {
    let memory = write(&BLANK, 1, None).0;
    let mut flash = Nor::new(memory);
    flash.cut_after(0);
    assert_eq!(save(&mut flash, &set(2), None, HARDWARE), Err(WriteFailed));
    assert_eq!(flash.into_memory(), memory);
}

/// A flash that came from another board: what lies there is not this vehicle's.
#[test]
fn another_processor_s_copies_are_damaged_ones_and_are_replaced() {
    let memory = write(&BLANK, 1, None).0;
    let found = load(&mut Nor::new(memory), HARDWARE + 1);
    assert_eq!((found.stored, found.damaged), (None, [true, true]));
    let mut flash = Nor::new(memory);
    assert_eq!(save(&mut flash, &set(9), None, HARDWARE + 1), Ok(()));
    let stored = load(&mut flash, HARDWARE + 1).stored.unwrap();
    assert_eq!((stored.set, stored.sequence), (set(9), 1));
}
