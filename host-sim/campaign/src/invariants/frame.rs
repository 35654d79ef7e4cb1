//! The rules that one frame shows, and the bound that leaves the driver in charge.

use haptic_core::bus::Frame;

use super::broken::Broken;
use super::{LIMIT_NM, MEMORY_FAULT, OVERRIDE_FROM_NM, OVERRIDE_SLOPE};
use crate::bytes::{self, ACTIVE, FAULT, HANDOVER, LANE_STEP, LOCKED, Status};

/// Bits of the faults of class B, of class C, and of class Locked. A copy of the core's list on purpose: a test compares
/// them, so that a new fault is classed here by a person too.
const CLASSES: [u64; 3] = [0x7_80FF, 0x1F00, 0x6000];

/// The time without a picture after which a warning comes in Active, with some steps to spare, us.
const WARN_DARK_US: std::ops::RangeInclusive<u32> = 180_000..=220_000;

/// Bit of the fault that no hand is on the wheel: a warning, whatever the mode.
const HANDS_OFF: u64 = 1 << 19;

/// The classes that a guidance frame must name with these faults.
fn classes_of(faults: u64) -> u64 {
    let present = CLASSES.map(|mask| u64::from(faults & mask != 0));
    present[0] | present[1] << 1 | present[2] << 2
}

pub(super) fn well_formed(frame: &Frame, status: &Status, before: Option<&Status>) -> Result<(), Broken> {
    if frame.id() != bytes::GUIDANCE || !bytes::is_intact(frame) {
        return Err(Broken::Frame { id: frame.id() });
    }
    if status.limit > 7
        || status.mode > LOCKED
        || status.reset > 6
        || status.classes != classes_of(status.faults)
    {
        return Err(Broken::Code(*status));
    }
    match before {
        // An ECU that lost its memory counts anew.
        Some(before)
            if status.counter != (before.counter + 1) % 16
                && (status.faults & !before.faults) & MEMORY_FAULT == 0 =>
        {
            Err(Broken::Counter {
                found: status.counter,
                before: before.counter,
            })
        }
        _ => Ok(()),
    }
}

/// `dark_us` is the time for which pictures have been missing in Active.
pub(super) fn warned(status: &Status, before: bool, dark_us: u32, others: &[Frame]) -> Result<(), Broken> {
    let must_warn = matches!(status.mode, HANDOVER | FAULT | LOCKED)
        || status.faults & HANDS_OFF != 0
        || (status.mode == ACTIVE && status.faults & LANE_STEP != 0)
        || dark_us > *WARN_DARK_US.end();
    let may_warn = WARN_DARK_US.contains(&dark_us);
    if !may_warn && status.warning != must_warn {
        return Err(Broken::WarningBit {
            warning: status.warning,
            mode: status.mode,
        });
    }
    if status.warning && !before && !others.iter().any(|frame| frame.id() == bytes::WARNING) {
        return Err(Broken::NoWarningFrame);
    }
    Ok(())
}

/// Least and largest torque that leave the driver in charge.
pub(super) fn override_bounds(driver_nm: f64) -> (f64, f64) {
    let bound = |toward: f64| (LIMIT_NM + OVERRIDE_SLOPE * (toward + OVERRIDE_FROM_NM)).clamp(0.0, LIMIT_NM);
    (-bound(-driver_nm), bound(driver_nm))
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptic_core::safety::faults::{Class, Fault};

    /// Bits of the fault word in a guidance frame.
    const FAULT_BITS: i64 = 21;

    #[test]
    fn every_fault_of_the_core_has_its_class_here_and_every_other_bit_has_none() {
        for code in 0..FAULT_BITS {
            let expected = match Fault::from_code(code).map(Fault::class) {
                Some(Class::B) => 1,
                Some(Class::C) => 2,
                Some(Class::Locked) => 4,
                _ => 0,
            };
            assert_eq!(classes_of(1 << code), expected, "bit {code}");
        }
    }

    #[test]
    fn every_bit_of_the_fault_word_has_a_fault() {
        for code in 0..FAULT_BITS {
            let word = 1_u64 << (37 + code);
            let frame = Frame::new(bytes::GUIDANCE, &word.to_le_bytes()).unwrap();
            assert_eq!(Status::decode(&frame).faults, 1 << code);
            assert!(Fault::from_code(code).is_some(), "bit {code}");
        }
    }
}
