//! Quantities as counts of 2^-24 of their unit, as `haptic-core` has them.

use haptic_core::quantity::Micros;
use haptic_sim::scenario::Scenario;

pub(super) const ONE: f64 = (1 << 24) as f64;
/// A millisecond as a share of a second in 2^-32, as core has it.
pub(super) const MS: i64 = 1000 * 4295;
/// What the bus carries of a speed, m/s.
const FASTEST: i32 = 90;

/// The bits that core makes of an SI value; saturates.
#[inline(always)]
pub(super) const fn bits(si: f64) -> i32 {
    let scaled = si * ONE;
    (if scaled >= 0.0 { scaled + 0.5 } else { scaled - 0.5 }) as i32
}

/// The bits of a value that is no larger than 100, in steps that every machine has for several lanes at once: a
/// conversion that saturates is made one by one.
#[inline(always)]
pub(super) fn small_bits(si: f64) -> i32 {
    let scaled = si * ONE;
    truncated(scaled + 0.5_f64.copysign(scaled))
}

/// Toward zero; of less than 2^31.
#[inline(always)]
pub(super) fn truncated(value: f64) -> i32 {
    // 1.5 * 2^52: what is added to it stands in its lowest bits.
    const AT_THE_END: f64 = 6_755_399_441_055_744.0;
    (value.trunc() + AT_THE_END).to_bits() as i32
}

#[inline(always)]
pub(super) fn per_second(bits: i32, share: i64) -> i32 {
    (i64::from(bits).wrapping_mul(share).wrapping_add(1 << 31) >> 32) as i32
}

/// Rounded to a count of 2^-(24 - `cut`), in 2^-24.
#[inline(always)]
pub(super) fn on_the_bus(bits: i32, cut: u32) -> i32 {
    (bits.wrapping_add(1 << (cut - 1)) >> cut) << cut
}

/// Whole milliseconds.
pub(super) const fn ms(span: Micros) -> u32 {
    span.us() / 1000
}

/// Counts as SI values.
#[inline(always)]
pub(super) fn si<const N: usize>(counts: &[i32; N]) -> [f64; N] {
    let mut si = [0.0; N];
    for l in 0..N {
        si[l] = f64::from(counts[l]) * (1.0 / ONE);
    }
    si
}

#[inline(always)]
pub(super) fn flag(holds: bool) -> i32 {
    if holds { -1 } else { 0 }
}

/// The first where the mask is -1, the second where it is 0, without a masked store ([`super::either`]).
#[inline(always)]
pub(super) fn chosen(mask: i32, a: i32, b: i32) -> i32 {
    (a & mask) | (b & !mask)
}

/// The speed at the start as its sensor has it, in counts as the bus carries it.
pub(super) fn speed_heard(scenario: &Scenario) -> i32 {
    heard(scenario.car().sensor_errors.speed_gain * scenario.speed_m_per_s())
}

/// A sensed speed, m/s, in such counts.
pub(super) fn heard(sensed_m_per_s: f64) -> i32 {
    on_the_bus(bits(sensed_m_per_s), 16).min(FASTEST << 24)
}

#[cfg(test)]
mod tests {
    use haptic_core::quantity::Torque;

    use super::*;
    #[test]
    fn si_values_are_the_bits_that_core_has() {
        let of = |nm: f64| (Torque::from_nm(nm).nm() * ONE) as i32;
        for nm in [
            0.0,
            1e-9,
            3.3e-8,
            -3.3e-8,
            1.2345,
            -4.321,
            127.9,
            -200.0,
            f64::NAN,
        ] {
            assert_eq!(bits(nm), of(nm), "{nm}");
        }
        // 60 km/h are 16 + 2/3 m/s, and 4266.67 LSB.
        let drive = Scenario::default();
        assert_eq!((drive.speed_kmh(), speed_heard(&drive)), (60.0, 4267 << 16));
    }
}
