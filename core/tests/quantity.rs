//! Quantities as counts of a converter and back, by hand.

use haptic_core::quantity::{Radians, Torque};

#[test]
fn counts_become_quantities_and_saturate() {
    let count = Torque::from_nm(0.25);
    assert_eq!(count.times(6).nm(), 1.5);
    assert_eq!(count.times(-6).nm(), -1.5);
    assert_eq!(count.times(i32::MAX), Torque::MAX);
    assert_eq!(count.times(i32::MIN), Torque::MIN);
    assert_eq!(Radians::from_rad(-0.5).times(3).rad(), -1.5);
}

#[test]
fn quantities_are_shown_by_name_and_in_si() {
    assert_eq!(format!("{:?}", Torque::from_nm(-0.25)), "Torque(-0.25)");
    assert_eq!(format!("{:?}", Radians::from_rad(0.5)), "Radians(0.5)");
}

#[test]
fn quantities_become_counts_toward_zero() {
    let count = Torque::from_nm(0.3);
    for (nm, counts) in [
        (0.0, 0),
        (0.95, 3),
        (1.0, 3),
        (1.19, 3),
        (-1.0, -3),
        (-128.0, -426),
    ] {
        assert_eq!(Torque::from_nm(nm).count_of(count), counts, "{nm} N.m");
    }
    // A count of nothing is taken for the least there is, 2^-24.
    assert_eq!(Torque::from_nm(1.0).count_of(Torque::ZERO), 1 << 24);
}
