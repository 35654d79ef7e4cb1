//! Every bit of the redundant memory flipped, one at a time, in each mode with a torque and in Standby: Fault and no
//! torque in the next step. And the guard itself, on a value of its own.

use crate::rig::Rig;
use haptic_core::controller::config::Setup;
use haptic_core::controller::params::Params;
use haptic_core::ecu::Boot;
use haptic_core::ecu::injection::Region;
use haptic_core::quantity::Torque;
use haptic_core::safety::faults::Fault;
use haptic_core::safety::modes::Mode;
use haptic_core::safety::redundant::{Redundant, Words};

fn rigs() -> Vec<Rig> {
    let bar = Params {
        torque_sensor: 1.0,
        ..Params::PAPER
    };
    let through_bar = Rig::new(Some(&Setup::new(&bar).unwrap()), Boot::default());
    let standby = Rig::paper();
    let active = Rig::active_in_curve(1.0);
    let mut fade = active.clone();
    fade.engage = false;
    let mut handover = active.clone();
    handover.silent[0] = true;
    let coasting = handover.clone();
    handover.run(1000);
    let mut rigs = vec![through_bar, standby, active, coasting, fade, handover];
    for rig in &mut rigs {
        rig.run(50);
    }
    rigs
}

#[test]
fn every_flip_ends_in_fault_within_a_step() {
    let mut flips = 0;
    for (rig, mode) in rigs().into_iter().zip([
        Mode::Standby,
        Mode::Standby,
        Mode::Active,
        Mode::Active,
        Mode::Fade,
        Mode::Handover,
    ]) {
        assert_eq!(rig.clone().tick().command.mode, mode);
        for region in Region::ALL {
            let bits = rig.ecu.redundant_bits(region);
            // Both copies of at least six words.
            assert!(
                bits >= 2 * 6 * 32 && bits.is_multiple_of(64),
                "{region:?}: {bits}"
            );
            for bit in 0..bits {
                let mut rig = rig.clone();
                rig.ecu.flip_bit(region, bit);
                let step = rig.tick();
                let at = format!("{mode:?} {region:?} {bit}");
                assert_eq!(
                    (step.command.mode, step.command.torque),
                    (Mode::Fault, Torque::ZERO),
                    "{at}"
                );
                assert!(
                    step.command.faults.contains(Fault::Memory) && step.command.warning,
                    "{at}"
                );
                // Latched, whatever comes.
                assert_eq!(rig.tick().command.mode, Mode::Fault, "{at}");
                flips += 1;
            }
            // A bit that is not there changes nothing.
            let mut rig = rig.clone();
            rig.ecu.flip_bit(region, bits);
            assert_eq!(rig.tick().command.mode, mode);
        }
    }
    println!("{flips} flips");
}

/// Angle and torque of the observer have two words each, rate, bar, friction and *known* one, and all have a second copy.
#[test]
fn what_observes_the_hands_is_compared_where_a_bar_is() {
    let rigs = rigs();
    let [through_bar, standby] = [&rigs[0], &rigs[1]].map(|rig| rig.ecu.redundant_bits(Region::Controller));
    assert_eq!(through_bar, standby + 2 * 8 * 32);
}

/// Two flips do not hide each other, unless they hit the same bit of both copies.
#[test]
fn two_flips_end_in_fault_too() {
    let standby = Rig::paper();
    let words = standby.ecu.redundant_bits(Region::Monitor) / 32;
    for (i, j) in (0..words).flat_map(|i| (0..i).map(move |j| (i, j))) {
        let mut rig = standby.clone();
        rig.ecu.flip_bit(Region::Monitor, 32 * i);
        rig.ecu.flip_bit(Region::Monitor, 32 * j);
        let expected = if i - j == words / 2 {
            Mode::Standby
        } else {
            Mode::Fault
        };
        assert_eq!(rig.tick().command.mode, expected, "words {i} and {j}");
    }
}

#[test]
fn a_flip_before_a_frame_arrives_is_found_too() {
    let mut rig = Rig::active_in_curve(1.0);
    rig.ecu.flip_bit(Region::Ecu, 3);
    let frame = rig.frame(0);
    assert_eq!(rig.send(&frame), Ok(()));
    assert_eq!(rig.tick().command.mode, Mode::Fault);
}

/// A frame changes a part of its receiver only: a flip is neither sealed in nor written over, whichever frame comes first.
#[test]
fn every_flip_before_any_frame_is_found_too() {
    for sender in 0..4 {
        let rig = Rig::active_in_curve(1.0);
        for bit in 0..rig.ecu.redundant_bits(Region::Ecu) {
            let mut rig = rig.clone();
            rig.ecu.flip_bit(Region::Ecu, bit);
            let frame = rig.frame(sender);
            assert_eq!(rig.send(&frame), Ok(()), "{sender} {bit}");
            let command = rig.tick().command;
            assert_eq!(command.mode, Mode::Fault, "{sender} {bit}");
            assert!(command.faults.contains(Fault::Memory), "{sender} {bit}");
        }
    }
}

#[test]
fn the_guard_holds_a_value_and_its_inverse() {
    for word in [0_u32, 1, 0xDEAD_BEEF, u32::MAX] {
        assert_eq!([word, 7].complement(), [!word, !7]);
        let mut guarded = Redundant::new(word);
        assert_eq!(guarded.get(), Some(&word));
        guarded.set(!word);
        assert_eq!(guarded.get(), Some(&!word));
    }
    assert_eq!((-1_i32).complement(), 0);
    // 1 N.m is 2^24; its inverse is -2^24 - 1.
    let inverse = Torque::from_nm(1.0).complement();
    assert_eq!(inverse.nm(), -1.0 - 1.0 / 16_777_216.0);
}
