//! Quantities as counts of a converter and back, by hand.

use crate::cases::cases;
use haptic_core::quantity::{Instant, Metres, Micros, Radians, Torque};
use proptest::prelude::*;

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

/// All that quantities do, against whole numbers of 64 bits: sums, differences, magnitudes and products saturate on both sides.
#[test]
fn what_quantities_do_is_what_whole_numbers_do() {
    let of = |counts: i64| counts.clamp(i32::MIN.into(), i32::MAX.into());
    let counts = || {
        let edges = prop::sample::select(&[i32::MIN, i32::MIN + 1, -1, 0, 1, i32::MAX - 1, i32::MAX]);
        prop_oneof![1 => edges, 3 => (any::<i32>(), 0..31).prop_map(|(counts, less)| counts >> less)]
    };
    // Exact: a count is 2^-24.
    let quantity = |counts: i32| Metres::from_m(f64::from(counts) / 16_777_216.0);
    let in_counts = |quantity: Metres| (quantity.m() * 16_777_216.0) as i64;
    cases(1, 100_000, &(counts(), counts(), counts()), |(a, b, times)| {
        let (times, [x, y], [a, b]) = (times >> 16, [a, b].map(quantity), [a, b].map(i64::from));
        prop_assert_eq!(in_counts(x), a);
        prop_assert_eq!(in_counts(x.plus(y)), of(a + b));
        prop_assert_eq!(in_counts(x.minus(y)), of(a - b));
        prop_assert_eq!(in_counts(x.opposite()), of(-a));
        prop_assert_eq!(in_counts(x.abs()), of(a.abs()));
        prop_assert_eq!(in_counts(x.times(times)), of(a * i64::from(times)));
        let least = b.abs().clamp(1, i64::from(i32::MAX));
        prop_assert_eq!(i64::from(x.count_of(y.abs())), of(a / least));
        prop_assert_eq!(x.to_f32(), a as f32 / 16_777_216.0);
        Ok(())
    });
    assert_eq!(
        [Metres::MIN, Metres::MAX].map(in_counts),
        [i32::MIN, i32::MAX].map(i64::from)
    );
    assert_eq!(Metres::from_m(f64::NAN), Metres::ZERO);
    // To the nearest, on both sides of zero.
    for (counts, nearest) in [
        (0.49, 0),
        (0.51, 1),
        (1.49, 1),
        (-0.49, 0),
        (-0.51, -1),
        (-1.49, -1),
    ] {
        assert_eq!(
            in_counts(Metres::from_m(counts / 16_777_216.0)),
            nearest,
            "{counts}"
        );
    }
}

/// Across at most one wrap of the clock.
#[test]
fn instants_and_spans_are_counts_modulo_a_wrap() {
    for (at, span) in [
        (0, 0),
        (5, 3),
        (5, 7),
        (u32::MAX, 1),
        (1, u32::MAX),
        (1 << 31, 1 << 31),
    ] {
        let (at, span) = (Instant::from_us(at), Micros::from_us(span));
        assert_eq!(at.after(span).since(at), span);
        assert_eq!(at.since(at.before(span)), span);
        assert_eq!(at.after(span).us(), at.us().wrapping_add(span.us()));
    }
    assert_eq!(Micros::from_ms(7).us(), 7000);
    assert_eq!(Micros::from_ms(u32::MAX).us(), u32::MAX);
}
