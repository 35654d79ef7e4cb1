//! The rows of the fault campaign that a target has to show as well, with one seed each; bits flip in its memory.
//! More of them: `cargo xtask faults --target --seeds 20`.

use haptic_campaign::table::{Class, FaultCase, Place, rows};
use haptic_campaign::{World, target};

#[test]
fn the_image_survives_what_the_host_survives() {
    let marked: Vec<&'static FaultCase> = rows().filter(|row| row.place == Place::Both).collect();
    let campaign = target::run(&World::new(None), &marked, 1..2, || ()).unwrap();
    let failed: Vec<_> = campaign.failures().collect();
    assert!(failed.is_empty(), "{failed:#?}");
    assert_eq!(campaign.runs, marked.len() as u64);
}

/// About half of the controller's memory is guarded state, and whatever flips there stops it at once.
#[test]
fn flipped_bits_of_the_image_stop_it() {
    let row = rows().find(|row| row.name == "flip-state").unwrap();
    let campaign = target::run(&World::new(None), &[row], 1..17, || ()).unwrap();
    let failed: Vec<_> = campaign.failures().collect();
    assert!(failed.is_empty(), "{failed:#?}");
    let [flips] = &campaign.rows[..] else {
        panic!("one row")
    };
    assert_eq!(flips.class, Class::C);
    // Most of the controller's memory is history and filters, whose flips end nothing; what is vital is kept twice.
    assert!(flips.seen >= 2, "{} of 16 flips were seen", flips.seen);
    assert!(
        flips.worst_reaction_ms <= Some(10),
        "{:?} ms",
        flips.worst_reaction_ms
    );
}
