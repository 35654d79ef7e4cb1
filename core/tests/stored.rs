//! Parameter blocks against a CRC and a layout written a second time, and every way a copy can be spoilt.

use std::num::NonZeroU32;

use haptic_core::controller::config::Setup;
use haptic_core::controller::params::{Params, VehicleParams};
use haptic_core::service::stored::{BYTES, Set, Stored};

/// CRC-32 bit by bit (ISO-HDLC).
fn crc32(bytes: &[u8]) -> u32 {
    let mut crc = u32::MAX;
    for byte in bytes {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = (crc >> 1) ^ if crc & 1 == 1 { 0xEDB8_8320 } else { 0 };
        }
    }
    !crc
}

/// The processor that writes and reads, and the vehicle.
const HARDWARE: u32 = 0x0506_0708;
const VEHICLE: u32 = 654_321;

const fn set(params: Params) -> Set {
    Set {
        params,
        vehicle: NonZeroU32::new(VEHICLE),
    }
}

fn save(params: &Params, sequence: u32) -> [u8; BYTES] {
    haptic_core::service::stored::save(&set(*params), sequence, HARDWARE)
}

fn load(copies: [&[u8]; 2]) -> Option<Stored> {
    haptic_core::service::stored::load(copies, HARDWARE)
}

/// A block by the table in `stored.rs`.
fn block(version: u32, sequence: u32, values: &[f64]) -> Vec<u8> {
    let head = [version, sequence, HARDWARE, VEHICLE];
    let mut bytes = head.map(u32::to_le_bytes).concat();
    bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    bytes.extend(crc32(&bytes).to_le_bytes());
    bytes
}

/// A different value in each field.
const VALUES: [f64; 31] = [
    0.5, 1.5, 0.25, 20.0, 2.0, 9.0, 3.0, 3.5, 7.0, 6.0, 0.1, 2.0, 0.2, 1.5, 0.75, 0.25, 0.02, 0.001, 1.25,
    0.5, 0.75, 0.375, 1.0, 0.625, 2.0, 0.03, 0.125, 0.3, 80.0, 0.004, 60.0,
];

fn params() -> Params {
    Params {
        k_1: 0.5,
        a_1: 1.5,
        a_2: 0.25,
        a_3: 20.0,
        a_4: 2.0,
        rate_corner_hz: 9.0,
        torque_limit_nm: 3.0,
        wind_up_nm_per_s: 3.5,
        reduction_nm_per_s: 7.0,
        least_speed_m_per_s: 6.0,
        probe_amplitude_nm: 0.1,
        probe_frequency_hz: 2.0,
        t_nms_s: 0.2,
        k_nms: 1.5,
        low_speed_share: 0.75,
        high_speed_share: 0.25,
        vehicle: VehicleParams {
            curvature_gain_per_m: 0.02,
            stability_factor_s2_per_m2: 0.001,
            aligning_gain_nm_s2_per_m: 1.25,
            column_damping_nm_s: 0.5,
            far_time_s: 0.75,
            near_time_s: 0.375,
        },
        law: 1.0,
        activity_lambda_min: 0.625,
        torque_sensor: 2.0,
        wheel_inertia_kg_m2: 0.03,
        wheel_damping_nm_s: 0.125,
        wheel_friction_nm: 0.3,
        bar_stiffness_nm_per_rad: 80.0,
        column_period_s: 0.004,
        observer_bandwidth_rad_per_s: 60.0,
    }
}

fn found(params: Params, sequence: u32, copy: usize) -> Option<Stored> {
    Some(Stored {
        set: set(params),
        sequence,
        copy,
    })
}

#[test]
fn the_layout_is_the_documented_one() {
    assert_eq!(crc32(b"123456789"), 0xCBF4_3926);
    let bytes = save(&params(), 0x0102_0304);
    assert_eq!(bytes.to_vec(), block(5, 0x0102_0304, &VALUES));
    assert_eq!(bytes.len(), 268);
    assert_eq!(load([&bytes, &[]]), found(params(), 0x0102_0304, 0));
}

#[test]
fn the_newer_good_copy_counts() {
    let (old, new) = (Params::PAPER, params());
    for (first, second) in [(1, 2), (u32::MAX, 0), (u32::MAX - 5, 7)] {
        let (a, b) = (save(&old, first), save(&new, second));
        assert_eq!(load([&a, &b]), found(new, second, 1));
        assert_eq!(load([&b, &a]), found(new, second, 0));
        assert_eq!(load([&a, &[0xFF; BYTES]]), found(old, first, 0));
        assert_eq!(load([&[0; BYTES], &a]), found(old, first, 1));
    }
    // The same number twice: the first.
    assert_eq!(load([&save(&old, 9), &save(&new, 9)]), found(old, 9, 0));
}

#[test]
fn every_flipped_bit_and_every_truncation_falls_back_on_the_other_copy() {
    let (old, new) = (save(&Params::PAPER, 1), save(&params(), 2));
    let falls_back = |spoilt: &[u8]| {
        assert_eq!(load([&old, spoilt]), found(Params::PAPER, 1, 0));
        assert_eq!(load([spoilt, &old]), found(Params::PAPER, 1, 1));
        assert_eq!(load([spoilt, spoilt]), None);
    };
    for bit in 0..8 * BYTES {
        let mut spoilt = new;
        spoilt[bit / 8] ^= 1 << (bit % 8);
        falls_back(&spoilt);
    }
    for length in 0..BYTES {
        falls_back(&new[..length]);
        // Erased flash behind what was written.
        let mut cut = [0xFF; BYTES];
        cut[..length].copy_from_slice(&new[..length]);
        falls_back(&cut);
    }
    falls_back(&[&new[..], &[0]].concat());
}

#[test]
fn a_write_over_the_oldest_copy_cut_short_at_any_byte() {
    // Copy 0 holds set 1, copy 1 set 2; set 3 goes over set 1.
    let (one, two, three) = (save(&params(), 1), save(&Params::PAPER, 2), save(&params(), 3));
    for written in 0..=BYTES {
        let mut copy = one;
        copy[..written].copy_from_slice(&three[..written]);
        let expected = if copy == three {
            found(params(), 3, 0)
        } else {
            found(Params::PAPER, 2, 1)
        };
        assert_eq!(load([&copy, &two]), expected, "{written}");
    }
}

#[test]
fn other_versions_and_values_out_of_range_are_no_good() {
    assert_eq!(load([&block(4, 1, &VALUES), &[]]), None);
    assert_eq!(load([&block(6, 1, &VALUES), &[]]), None);
    assert_eq!(load([&block(5, 1, &VALUES[..30]), &[]]), None);
    let ranges_end = [
        (0, 4.1),
        (5, 0.4),
        (6, 5.01),
        (7, 4.01),
        (8, 3.99),
        (9, 0.49),
        (10, 0.31),
        (11, 0.9),
        (12, 1.1),
        (13, -0.1),
        (14, 1.1),
        (15, -0.1),
        (16, 0.2),
        (17, -0.1),
        (18, 21.0),
        (19, 10.1),
        (20, 3.1),
        (21, f64::NAN),
        (22, 0.5),
        (23, 1.1),
        (24, 1.5),
        (25, 0.004),
        (26, 5.1),
        (27, -0.1),
        (28, 4.9),
        (29, 0.021),
        (30, 401.0),
    ];
    for (index, value) in ranges_end {
        let mut values = VALUES;
        values[index] = value;
        assert_eq!(load([&block(5, 1, &values), &[]]), None, "value {index}");
    }
}

/// The memory of one ECU in another: its limits may be those of another vehicle.
#[test]
fn what_another_processor_wrote_is_no_good() {
    let copy = save(&params(), 1);
    for other in [0, HARDWARE + 1, HARDWARE ^ 1 << 31] {
        assert_eq!(haptic_core::service::stored::load([&copy, &copy], other), None);
    }
}

#[test]
fn absurd_values_within_range_are_accepted() {
    let mut values = VALUES;
    values[..5].fill(0.0);
    values[6] = 0.1;
    let stored = load([&block(5, 1, &values), &[]]).unwrap();
    assert_eq!(stored.set.params.torque_limit_nm, 0.1);
    assert!(Setup::new(&stored.set.params).is_ok());
}
