//! Randomised operation, checked in every cycle, across wraps of the microsecond clock. 300,000 cycles by
//! default, more by `HAPTIC_CYCLES`; the whole of it, 10^8 cycles and 24 wraps:
//!
//! ```text
//! HAPTIC_CYCLES=100000000 cargo test --release -p haptic-core endurance:: -- --nocapture
//! ```

use crate::rig::Rig;
use crate::rig::watch::Watch;
use haptic_core::controller::config::Setup;
use haptic_core::controller::params::Params;
use haptic_core::ecu::injection::{InjectedEcu, Region};
use haptic_core::ecu::{Boot, Ecu};
use haptic_core::quantity::{Metres, Torque};
use haptic_core::safety::faults::{Fault, FaultSet};
use haptic_core::safety::modes::Mode;
use rand::rngs::SmallRng;
use rand::{RngExt, SeedableRng};

/// What happens from outside; the rest of the time the bench is in a slowly changing curve.
struct Events {
    rng: SmallRng,
    /// Ticks until the silence or the driver's push ends.
    ends_at: u64,
    curve: f64,
    /// What the ECU has been given reason to report of itself.
    reasons: FaultSet,
}

impl Events {
    /// Before each tick. Returns the time to the tick.
    fn next(&mut self, rig: &mut Rig) -> u32 {
        if rig.ticks >= self.ends_at {
            rig.silent = [false; 4];
            rig.driver = None;
        }
        if rig.ticks.is_multiple_of(8) {
            self.curve = (self.curve + self.rng.random_range(-0.02..0.02)).clamp(-3.0, 3.0);
            rig.curve(self.curve);
            let noise = self.rng.random_range(-0.02..0.02);
            rig.lane.e_y = Metres::from_m(rig.lane.e_y.m() + noise);
        }
        // Whoever drives asks anew every 1.2 s.
        match rig.ticks % 1200 {
            0 if !rig.engage || self.rng.random_bool(0.5) => rig.engage = false,
            100 => rig.engage = true,
            _ => {}
        }
        match self.rng.random_range(0..40_000) {
            0..10 => {
                rig.silent[self.rng.random_range(0..4)] = true;
                self.ends_at = rig.ticks + self.rng.random_range(1..200);
            }
            10..15 => rig.engage = !rig.engage,
            60..90 => {
                rig.driver = Some(self.rng.random_range(-4.0..4.0));
                self.ends_at = rig.ticks + self.rng.random_range(1..200);
            }
            90..100 => rig.authority = self.rng.random_range(0.0..1.0),
            100..103 => rig.lane.valid = !rig.lane.valid,
            103..160 => rig.lane.valid = true,
            160..260 => {
                // A frame with a flipped bit, or one of nobody.
                let sender = self.rng.random_range(0..4);
                let frame = rig.frame(sender);
                let mut bytes: [u8; 8] = frame.data().try_into().unwrap();
                bytes[self.rng.random_range(0..8)] ^= 1 << self.rng.random_range(0..8);
                let id = if self.rng.random_bool(0.9) {
                    frame.id()
                } else {
                    self.rng.random_range(0..0x800)
                };
                let bad = haptic_core::bus::Frame::new(id, &bytes).unwrap();
                let _ = rig.send(&bad);
            }
            260 => {
                self.reasons.insert(Fault::Monitor);
                let lie = self.rng.random_range(-128.0..128.0);
                rig.ecu.force_law(Some(Torque::from_nm(lie)));
            }
            261 => {
                self.reasons.insert(Fault::Actuator);
                rig.motor = |t| t / 2.0;
            }
            262 => {
                self.reasons.insert(Fault::Memory);
                // Damaged limits of the monitor.
                self.reasons.insert(Fault::Monitor);
                let region = Region::ALL[self.rng.random_range(0..4)];
                let bit = self.rng.random_range(0..rig.ecu.redundant_bits(region));
                rig.ecu.flip_bit(region, bit);
            }
            265..300 => {
                self.reasons.insert(Fault::Deadline);
                return self.rng.random_range(0..2_500);
            }
            300..303 => {
                self.reasons.insert(Fault::Deadline);
                return self.rng.random_range(2_500..12_000);
            }
            _ => {}
        }
        1000
    }
}

/// Operates an ECU for so many cycles, restarting it some time after each latched fault. `start_us` is what the
/// microsecond clock shows at first.
fn operate(seed: u64, cycles: u64, start_us: u32) -> (Watch, u64, [u32; Fault::COUNT]) {
    let mut events = Events {
        rng: SmallRng::seed_from_u64(seed),
        ends_at: 0,
        curve: 0.0,
        reasons: FaultSet::NONE,
    };
    let limit = [5.0, 3.0][(seed % 2) as usize];
    let params = Params {
        torque_limit_nm: limit,
        ..Params::PAPER
    };
    let setup = Setup::new(&params).unwrap();
    let mut rig = Rig::new(Some(&setup), Boot::default());
    rig.clock_start_us = start_us;
    rig.ecu = InjectedEcu::new(Ecu::new(Some(&setup), Boot::default(), rig.now()));
    let mut watch = Watch::new(limit);
    let mut faults = [0; Fault::COUNT];
    let mut before = FaultSet::NONE;
    let mut dead = 0;
    for _ in 0..cycles {
        let us = events.next(&mut rig);
        let step = rig.tick_after(us);
        rig.rejects.clear();
        watch.check(&rig, &step);
        let own = step.command.faults.common(FaultSet::CRITICAL);
        assert_eq!(
            own.difference(events.reasons),
            FaultSet::NONE,
            "{:?}: no reason for it",
            step.command
        );
        for fault in Fault::ALL {
            let appeared = step.command.faults.contains(fault) && !before.contains(fault);
            faults[fault as usize] += u32::from(appeared);
        }
        before = step.command.faults;
        dead = if step.command.mode == Mode::Fault {
            dead + 1
        } else {
            0
        };
        if dead > 1000 {
            rig.ecu = InjectedEcu::new(Ecu::new(Some(&setup), Boot::default(), rig.now()));
            (rig.motor, rig.heard) = (|t| t, crate::rig::Heard::default());
            (dead, rig.engage) = (0, false);
            watch.restart(&rig);
            (events.reasons, before) = (FaultSet::NONE, FaultSet::NONE);
        }
    }
    (watch, (u64::from(start_us) + rig.t_us) >> 32, faults)
}

#[test]
fn randomised_operation_across_wraps_of_the_clock() {
    let cycles: u64 = std::env::var("HAPTIC_CYCLES").map_or(300_000, |text| {
        text.parse().expect("HAPTIC_CYCLES: a number of cycles")
    });
    // Three runs, each starting half a minute before a wrap, so that a short test crosses three.
    let (mut steps, mut wraps, mut modes, mut limits, mut faults) = (0, 0, [0; 7], [0; 8], [0; Fault::COUNT]);
    for seed in 0..3 {
        let (watch, wrapped, found) = operate(seed, cycles / 3, u32::MAX - 30_000_000);
        (steps, wraps) = (steps + watch.steps, wraps + wrapped);
        (0..7).for_each(|i| modes[i] += watch.by_mode[i]);
        (0..8).for_each(|i| limits[i] += watch.by_limit[i]);
        (0..Fault::COUNT).for_each(|i| faults[i] += found[i]);
    }
    println!("{steps} cycles, {wraps} wraps; by mode {modes:?}, by limit {limits:?}, faults {faults:?}");
    assert_eq!(steps, cycles / 3 * 3);
    assert!(wraps >= 3);
    // The run has been everywhere it may go: all modes but Boot and Locked, and a good part of the time guiding.
    assert!(modes[1..6].iter().all(|count| *count > 0) && modes[Mode::Active as usize] > steps / 10);
}
