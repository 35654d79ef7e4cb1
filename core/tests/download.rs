//! A set of parameters over the bus: taken only whole, in order, in Standby and within its ranges.
//!
//! Above 500 lines because one transfer has many rules, which the last test states together: split, a reader could not see
//! which rule lacks its own test.

use std::cell::RefCell;
use std::num::NonZeroU32;

use crate::cases::cases;
use haptic_core::bus::e2e::ReceiverState;
use haptic_core::bus::messages::{Message, ParameterStatus, WriteOutcome};
use haptic_core::bus::{Frame, Reject};
use haptic_core::controller::params::Params;
use haptic_core::safety::faults::{Fault, FaultSet};
use haptic_core::safety::modes::Mode;
use haptic_core::service::download::{
    Conditions, Download, UNLOCK_MS, frames, mode_for_parameters, unlock, value,
};
use haptic_core::service::stored::{Set, Stored};
use proptest::bool::weighted;
use proptest::prelude::*;

/// Every value is a binary32, so that the bus rounds nothing.
const SET: Params = Params {
    k_1: 0.5,
    a_1: 1.5,
    a_2: 0.25,
    a_3: 20.0,
    torque_limit_nm: 3.0,
    probe_amplitude_nm: 0.125,
    t_nms_s: 0.25,
    vehicle: haptic_core::controller::params::VehicleParams {
        curvature_gain_per_m: 0.015625,
        stability_factor_s2_per_m2: 0.001953125,
        aligning_gain_nm_s2_per_m: 1.25,
        column_damping_nm_s: 0.5,
        far_time_s: 0.75,
        near_time_s: 0.375,
    },
    activity_lambda_min: 0.25,
    torque_sensor: 2.0,
    wheel_inertia_kg_m2: 0.03125,
    wheel_damping_nm_s: 0.0625,
    wheel_friction_nm: 0.25,
    bar_stiffness_nm_per_rad: 90.0,
    column_period_s: 0.00390625,
    observer_bandwidth_rad_per_s: 60.0,
    ..Params::PAPER
};

/// The vehicle that it is for.
const VEHICLE: u32 = 654_321;

/// What comes of it.
const TAKEN: Set = Set {
    params: SET,
    vehicle: NonZeroU32::new(VEHICLE),
};

/// Where a set is taken.
const READY: Conditions = Conditions {
    mode: Mode::Standby,
    stands: true,
    settled: true,
    in_use: Some(7),
    now_ms: 0,
};

const MOVING: Conditions = Conditions {
    stands: false,
    ..READY
};

const UNSETTLED: Conditions = Conditions {
    settled: false,
    ..READY
};

const fn in_mode(mode: Mode) -> Conditions {
    Conditions { mode, ..READY }
}

/// When a client sends its frame of that number, ms after the unlock.
fn due_ms(frame: usize) -> u32 {
    4 * frame as u32
}

/// A receiver that was unlocked.
fn unlocked() -> Download {
    let mut download = Download::NEW;
    assert_eq!(download.receive(&unlock(7, VEHICLE), &READY), None);
    download
}

/// What such a receiver makes of frames.
fn receive(frames: &[Frame], mode: Mode) -> (Option<Set>, WriteOutcome) {
    let mut download = unlocked();
    let at = |index| Conditions {
        now_ms: due_ms(index),
        ..in_mode(mode)
    };
    let taken = frames
        .iter()
        .enumerate()
        .filter_map(|(index, frame)| download.receive(frame, &at(index)))
        .last();
    (taken, download.status(None, false).outcome)
}

#[test]
fn a_whole_set_in_standby_is_taken() {
    assert_eq!(
        receive(&frames(&SET), Mode::Standby),
        (Some(TAKEN), WriteOutcome::Taken)
    );
}

/// By hand: identifier 0x140, field 4 (a_4 = 1.0 = 0x3F800000), counter 4, CRC over bytes 1..7 and data ID
/// 0x75 ^ 0x55.
#[test]
fn a_field_lies_on_the_bus_as_documented() {
    let frame = frames(&SET)[4];
    assert_eq!(frame.id(), 0x140);
    assert_eq!(frame.data()[1..], [0x44, 0, 0, 0, 0, 0x80, 0x3F]);
    let crc = [0x44, 0, 0, 0, 0, 0x80, 0x3F, 0x75 ^ 0x55]
        .iter()
        .fold(0xFF_u8, |crc, byte| {
            (0..8).fold(crc ^ byte, |crc, _| {
                if crc & 0x80 == 0 {
                    crc << 1
                } else {
                    (crc << 1) ^ 0x2F
                }
            })
        });
    assert_eq!(frame.data()[0], !crc);
}

#[test]
fn no_other_mode_takes_anything() {
    for mode in [
        Mode::Boot,
        Mode::Active,
        Mode::Fade,
        Mode::Handover,
        Mode::Fault,
        Mode::Locked,
    ] {
        assert_eq!(
            receive(&frames(&SET), mode),
            (None, WriteOutcome::NotInStandby),
            "{mode:?}"
        );
        // Nor does one frame of a set that comes in another mode.
        let mut download = unlocked();
        for (i, frame) in frames(&SET).iter().enumerate() {
            let now = if i == 9 { mode } else { Mode::Standby };
            assert_eq!(download.receive(frame, &in_mode(now)), None, "{mode:?}");
        }
    }
}

#[test]
fn other_messages_between_the_fields_do_no_harm() {
    let other = Frame::new(0x141, &[0; 8]).unwrap();
    let mixed: Vec<Frame> = frames(&SET)
        .into_iter()
        .flat_map(|frame| [other, frame])
        .collect();
    assert_eq!(receive(&mixed, Mode::Standby), (Some(TAKEN), WriteOutcome::Taken));
}

/// Each frame lost, sent twice, or swapped with its neighbour.
#[test]
fn a_set_with_a_gap_is_refused() {
    let good = frames(&SET);
    for i in 0..good.len() {
        let mut lost = good.to_vec();
        lost.remove(i);
        let mut twice = good.to_vec();
        twice.insert(i, good[i]);
        let mut swapped = good.to_vec();
        swapped.swap(i, (i + 1) % good.len());
        assert_eq!(receive(&lost, Mode::Standby).0, None, "frame {i} lost");
        // A first field sent again only begins anew, and before a last one came again the set was whole.
        if i != 0 && i != 30 {
            assert_eq!(receive(&twice, Mode::Standby).0, None, "frame {i} twice");
        }
        assert_eq!(receive(&swapped, Mode::Standby).0, None, "frame {i} swapped");
    }
    assert_eq!(
        receive(&good[..18], Mode::Standby),
        (None, WriteOutcome::Receiving)
    );
    assert_eq!(
        receive(&good[1..], Mode::Standby),
        (None, WriteOutcome::OutOfOrder)
    );
}

/// Every bit of every frame flipped: never taken, whole or as another set.
#[test]
fn a_damaged_frame_spoils_the_set() {
    let good = frames(&SET);
    for i in 0..good.len() {
        for bit in 0..64 {
            let mut data = good[i].data().to_vec();
            data[bit / 8] ^= 1 << (bit % 8);
            let mut spoilt = good;
            spoilt[i] = Frame::new(good[i].id(), &data).unwrap();
            assert_eq!(receive(&spoilt, Mode::Standby).0, None, "bit {bit} of frame {i}");
        }
    }
}

#[test]
fn a_value_out_of_its_range_spoils_the_set() {
    for bad in [
        Params {
            torque_limit_nm: 5.25,
            ..SET
        },
        Params { k_1: -0.25, ..SET },
        Params {
            k_nms: f64::NAN,
            ..SET
        },
        Params {
            a_3: f64::INFINITY,
            ..SET
        },
        // Each in its range, their product beyond.
        Params {
            k_1: 4.0,
            a_3: 100.0,
            ..SET
        },
        // Gains of 32, and a slow filter: the monitor's band would be wider than its limit, and the next start refuses it.
        Params {
            k_1: 4.0,
            a_1: 8.0,
            a_2: 8.0,
            a_3: 8.0,
            a_4: 8.0,
            rate_corner_hz: 0.5,
            ..SET
        },
    ] {
        assert_eq!(
            receive(&frames(&bad), Mode::Standby),
            (None, WriteOutcome::OutOfRange)
        );
    }
}

/// The ends of every range as `params.rs` documents them, of which a binary32 does not hold all. Nothing is changed on
/// the way but by that rounding, of at most 6e-8 of the value.
#[test]
fn the_ends_of_every_range_are_taken() {
    type Field = fn(&mut Params) -> &mut f64;
    let fields: [(Field, f64, f64); 31] = [
        (|p| &mut p.k_1, 0.0, 4.0),
        (|p| &mut p.a_1, 0.0, 100.0),
        (|p| &mut p.a_2, 0.0, 100.0),
        (|p| &mut p.a_3, 0.0, 100.0),
        (|p| &mut p.a_4, 0.0, 100.0),
        (|p| &mut p.rate_corner_hz, 0.5, 60.0),
        (|p| &mut p.torque_limit_nm, 0.1, 5.0),
        (|p| &mut p.wind_up_nm_per_s, 0.5, 4.0),
        (|p| &mut p.reduction_nm_per_s, 4.0, 8.0),
        (|p| &mut p.least_speed_m_per_s, 0.5, 30.0),
        (|p| &mut p.probe_amplitude_nm, 0.0, 0.3),
        (|p| &mut p.probe_frequency_hz, 1.0, 5.0),
        (|p| &mut p.t_nms_s, 0.01, 1.0),
        (|p| &mut p.k_nms, 0.0, 10.0),
        (|p| &mut p.low_speed_share, 0.0, 1.0),
        (|p| &mut p.high_speed_share, 0.0, 1.0),
        (|p| &mut p.vehicle.curvature_gain_per_m, 0.001, 0.1),
        (|p| &mut p.vehicle.stability_factor_s2_per_m2, 0.0, 0.01),
        (|p| &mut p.vehicle.aligning_gain_nm_s2_per_m, 0.0, 20.0),
        (|p| &mut p.vehicle.column_damping_nm_s, 0.0, 10.0),
        (|p| &mut p.vehicle.far_time_s, 0.1, 3.0),
        (|p| &mut p.vehicle.near_time_s, 0.0, 5.0),
        (|p| &mut p.law, 0.0, 1.0),
        (|p| &mut p.activity_lambda_min, 0.05, 1.0),
        (|p| &mut p.torque_sensor, 0.0, 2.0),
        (|p| &mut p.wheel_inertia_kg_m2, 0.005, 0.5),
        (|p| &mut p.wheel_damping_nm_s, 0.0, 5.0),
        (|p| &mut p.wheel_friction_nm, 0.0, 5.0),
        (|p| &mut p.bar_stiffness_nm_per_rad, 5.0, 1000.0),
        (|p| &mut p.column_period_s, 0.001, 0.02),
        (|p| &mut p.observer_bandwidth_rad_per_s, 5.0, 400.0),
    ];
    for (i, (field, min, max)) in fields.into_iter().enumerate() {
        for end in [min, max] {
            // Others so small that no product is beyond its own range.
            let mut sent = Params {
                k_1: 0.02,
                a_3: 1.0,
                probe_amplitude_nm: 0.1,
                probe_frequency_hz: 1.5,
                torque_sensor: 0.0,
                ..SET
            };
            *field(&mut sent) = end;
            let (taken, outcome) = receive(&frames(&sent), Mode::Standby);
            assert_eq!(outcome, WriteOutcome::Taken, "field {i} = {end}");
            let got = *field(&mut taken.unwrap().params);
            assert!((got - end).abs() <= 6e-8 * end, "field {i}: {got} for {end}");
            for (beyond, by) in [(min, -1e-6), (max, 1e-6)] {
                *field(&mut sent) = beyond + by * max;
                let (_, outcome) = receive(&frames(&sent), Mode::Standby);
                assert_eq!(outcome, WriteOutcome::OutOfRange, "field {i} beyond {beyond}");
            }
        }
    }
}

#[test]
fn a_refused_set_can_be_sent_again() {
    let mut download = unlocked();
    for frame in &frames(&SET)[1..] {
        assert_eq!(download.receive(frame, &READY), None);
    }
    let at = |now_ms| Conditions { now_ms, ..READY };
    let again = |download: &mut Download| {
        let sent = frames(&SET);
        let sent = sent.iter().enumerate();
        sent.filter_map(|(index, frame)| download.receive(frame, &at(400 + due_ms(index))))
            .last()
    };
    // An unlock is for one attempt.
    assert_eq!(again(&mut download), None);
    assert_eq!(download.status(None, false).outcome, WriteOutcome::NotUnlocked);
    download.receive(&unlock(7, VEHICLE), &at(400));
    assert_eq!(again(&mut download), Some(TAKEN));
    assert_eq!(again(&mut download), None, "and for one set");
}

#[test]
fn the_status_names_the_set_in_use() {
    let stored = Stored {
        set: TAKEN,
        sequence: 7,
        copy: 1,
    };
    let status = Download::NEW.status(Some(&stored), true);
    assert_eq!((status.stored, status.damaged, status.sequence), (true, true, 7));
    let status = Download::NEW.status(None, false);
    assert_eq!(
        (status.stored, status.damaged, status.sequence),
        (false, false, 0)
    );
}

/// Four bits have room for sixteen outcomes; there are ten.
#[test]
fn a_status_with_an_outcome_that_is_none_is_refused() {
    let status = |code: u8| {
        let mut data = [0, 0, code, 0, 0, 0, 0, 0];
        ParameterStatus::PROTECTION.protect(&mut data, 1);
        ParameterStatus::decode(
            &mut { ReceiverState::TRUSTED },
            &Frame::new(0x320, &data).unwrap(),
        )
    };
    assert_eq!(status(5).map(|status| status.outcome), Ok(WriteOutcome::Taken));
    assert_eq!(status(8).map(|status| status.outcome), Ok(WriteOutcome::TooSoon));
    assert_eq!(status(9).map(|status| status.outcome), Ok(WriteOutcome::TooFast));
    for code in 10..16 {
        assert_eq!(status(code), Err(Reject::Range));
    }
}

/// Each condition by itself, at the first frame and at one in the middle.
#[test]
fn a_set_is_refused_in_traffic_too_soon_and_without_an_unlock() {
    let moving = Conditions {
        stands: false,
        ..READY
    };
    let fresh = Conditions {
        settled: false,
        ..READY
    };
    let late = Conditions {
        now_ms: UNLOCK_MS + 1,
        ..READY
    };
    for (conditions, outcome) in [
        (moving, WriteOutcome::NotStanding),
        (fresh, WriteOutcome::TooSoon),
        (late, WriteOutcome::NotUnlocked),
    ] {
        for at in [0, 9, 18] {
            let mut download = unlocked();
            let taken = frames(&SET).iter().enumerate().any(|(i, frame)| {
                let mut now = if i == at { conditions } else { READY };
                now.now_ms += due_ms(i);
                download.receive(frame, &now).is_some()
            });
            assert!(!taken, "{outcome:?} at {at}");
            if at == 18 {
                assert_eq!(download.status(None, false).outcome, outcome);
            }
        }
    }
    // At its very end the unlock still holds, and not a millisecond longer, across a wrap of the clock too.
    let mut download = Download::NEW;
    let begin = Conditions {
        now_ms: u32::MAX - 5,
        ..READY
    };
    download.receive(&unlock(7, VEHICLE), &begin);
    // The last field comes at that time.
    let taken_at = |now_ms: u32| {
        let (mut download, sent) = (download.clone(), frames(&SET));
        let at = |index| Conditions {
            now_ms: now_ms.wrapping_sub(due_ms(sent.len() - 1 - index)),
            ..READY
        };
        let mut sent = sent.iter().enumerate();
        sent.any(|(index, frame)| download.receive(frame, &at(index)).is_some())
    };
    assert!(taken_at(UNLOCK_MS - 6) && !taken_at(UNLOCK_MS - 5));
}

/// A set in one burst, as whoever slips one in behind another's unlock sends it: a field takes 4 ms but for the first twelve.
#[test]
fn a_set_takes_its_time() {
    let sent = frames(&SET);
    let outcome = |ms_of: fn(usize) -> u32| {
        let mut download = unlocked();
        for (index, frame) in sent.iter().enumerate() {
            let now_ms = ms_of(index);
            download.receive(frame, &Conditions { now_ms, ..READY });
        }
        download.status(None, false).outcome
    };
    assert_eq!(outcome(|_| 0), WriteOutcome::TooFast);
    assert_eq!(outcome(|index| 10 * index as u32), WriteOutcome::Taken);
    assert_eq!(
        outcome(|index| 4 * index.saturating_sub(12) as u32),
        WriteOutcome::Taken
    );
    assert_eq!(
        outcome(|index| (4 * index.saturating_sub(12)).saturating_sub(1) as u32),
        WriteOutcome::TooFast
    );
}

/// Two unlocks within 0.4 s are of two senders: neither unlocks.
#[test]
fn two_unlocks_at_once_unlock_nothing() {
    for (apart_ms, is_taken) in [(0, false), (399, false), (400, true)] {
        let mut download = unlocked();
        let at = |ms| Conditions {
            now_ms: apart_ms + ms,
            ..READY
        };
        download.receive(&unlock(7, VEHICLE), &at(0));
        let sent = frames(&SET);
        let mut sent = sent.iter().enumerate();
        let taken = sent.any(|(index, frame)| download.receive(frame, &at(due_ms(index))).is_some());
        assert_eq!(taken, is_taken, "{apart_ms} ms");
    }
}

/// A download that was recorded unlocks with the number of a set that is no longer in use.
#[test]
fn a_recorded_download_is_none() {
    let recorded: Vec<Frame> = [unlock(7, VEHICLE)].into_iter().chain(frames(&SET)).collect();
    for in_use in [Some(8), Some(6), None] {
        let mut download = Download::NEW;
        let conditions = Conditions { in_use, ..READY };
        let taken = recorded
            .iter()
            .any(|frame| download.receive(frame, &conditions).is_some());
        assert!(!taken, "{in_use:?}");
        assert_eq!(download.status(None, false).outcome, WriteOutcome::NotUnlocked);
    }
}

/// Repair: what is locked because both copies are gone takes a set, what is locked because it resets does not.
#[test]
fn an_ecu_that_is_locked_for_want_of_parameters_alone_takes_some() {
    let [parameters, resets, lane] = [Fault::Parameters, Fault::ResetLoop, Fault::LaneTimeout].map(|fault| {
        let mut faults = FaultSet::NONE;
        faults.insert(fault);
        faults
    });
    for (faults, mode) in [
        (parameters, Mode::Standby),
        (parameters.union(lane), Mode::Standby),
        (resets, Mode::Locked),
        (parameters.union(resets), Mode::Locked),
    ] {
        assert_eq!(mode_for_parameters(Mode::Locked, faults), mode, "{faults:?}");
    }
    assert_eq!(mode_for_parameters(Mode::Fault, parameters), Mode::Fault);
    assert_eq!(mode_for_parameters(Mode::Active, FaultSet::NONE), Mode::Active);
}

#[test]
fn the_values_in_use_go_round_in_their_order() {
    let expected = [0.5, 1.5, 0.25, 20.0];
    for (turn, expected) in (0..).zip(expected) {
        for round in [0, 31, 310] {
            let told = value(&SET, turn + round).unwrap();
            assert_eq!((u32::from(told.index), told.value), (turn, expected));
        }
    }
    assert_eq!(value(&SET, 21).map(|told| told.value), Some(0.375));
}

/// A refusal takes the permission to write with it, whatever it is for.
#[test]
fn an_unlock_is_for_one_attempt() {
    for refusing in [MOVING, UNSETTLED, in_mode(Mode::Active)] {
        let mut download = unlocked();
        let first = frames(&SET)[0];
        assert_eq!(download.receive(&first, &refusing), None);
        assert_eq!(download.receive(&first, &READY), None);
        assert_eq!(download.status(None, false).outcome, WriteOutcome::NotUnlocked);
    }
}

/// An unlock for another set takes the permission to write this one. It lasts for two seconds.
#[test]
fn a_wrong_unlock_locks() {
    assert_eq!(UNLOCK_MS, 2000);
    let mut download = unlocked();
    assert_eq!(download.receive(&unlock(8, VEHICLE), &READY), None);
    assert_eq!(download.receive(&frames(&SET)[0], &READY), None);
    assert_eq!(download.status(None, false).outcome, WriteOutcome::NotUnlocked);
}

/// What may come in any order, against the rules of docs/explanation/monitor-and-memory.md told a second time.
#[test]
fn whatever_comes_a_set_is_taken_only_as_the_rules_say() {
    let [good, bad] = [SET, Params { k_1: 9.0, ..SET }].map(|params| frames(&params));
    // Between two sets there is time, within one there may be too little.
    let passes = (0..800_u32, prop_oneof![249 => 0..18_u32, 1 => 1900..2100_u32]);
    let others = [Mode::ALL.map(in_mode), [MOVING; 7], [UNSETTLED; 7]].concat();
    let here = prop_oneof![266 => Just(READY), 1 => prop::sample::select(others)];
    // Where a set ends, and within one where the second is true as well.
    let unlocks = (weighted(0.5), weighted(0.004), weighted(0.2), 0..1_u32 << 20);
    let field = (prop::option::weighted(0.003, 0..good.len()), weighted(0.2));
    let heard = prop::collection::vec((passes, here, unlocks, field), 0..=4000);
    let counts = RefCell::new([0; 10]);
    cases(1, 100, &heard, |heard| {
        let mut download = Download::NEW;
        // The field that comes next, none after a refusal; until when it is unlocked; the values of k_1 of this set.
        let (mut next, mut until, mut is_bad, mut outcome) = (Some(0), None, false, WriteOutcome::None);
        let (mut now_ms, mut vehicle, mut in_order) = (u32::MAX - 20_000, 0, 0);
        let (mut asked, mut began) = (None, 0);
        for ((between, within), here, (is_unlock, anywhere, is_other, unlocks), (elsewhere, spoils)) in heard
        {
            now_ms = now_ms.wrapping_add(match within {
                _ if in_order == 0 => between,
                0..18 => within % [2, 9][vehicle as usize % 2],
                _ => within,
            });
            let here = Conditions { now_ms, ..here };
            if is_unlock && (in_order == 0 || anywhere) {
                vehicle = unlocks;
                prop_assert_eq!(
                    download.receive(&unlock(7 + u32::from(is_other), vehicle), &here),
                    None
                );
                let is_alone = asked.is_none_or(|at| now_ms.wrapping_sub(at) >= 400);
                asked = Some(now_ms);
                until = (!is_other && is_alone).then(|| now_ms.wrapping_add(UNLOCK_MS));
                continue;
            }
            let index = elsewhere.unwrap_or(in_order);
            in_order = (index + 1) % good.len();
            let sends_bad = index == 0 && spoils;
            let taken = download.receive(&[good[index], bad[index]][usize::from(sends_bad)], &here);
            let mut expected = None;
            if index == 0 {
                (next, is_bad, began) = (Some(0), sends_bad, now_ms);
            }
            if let Some(due) = next {
                let is_unlocked = until.is_some_and(|until: u32| until.wrapping_sub(now_ms) <= UNLOCK_MS);
                outcome = match () {
                    () if here.mode != Mode::Standby => WriteOutcome::NotInStandby,
                    () if !here.stands => WriteOutcome::NotStanding,
                    () if !here.settled => WriteOutcome::TooSoon,
                    () if !is_unlocked => WriteOutcome::NotUnlocked,
                    () if index as u32 > now_ms.wrapping_sub(began) / 4 + 12 => WriteOutcome::TooFast,
                    () if index != due => WriteOutcome::OutOfOrder,
                    () if due + 1 < good.len() => WriteOutcome::Receiving,
                    () if is_bad => WriteOutcome::OutOfRange,
                    () => WriteOutcome::Taken,
                };
                expected = (outcome == WriteOutcome::Taken).then_some(Set {
                    params: SET,
                    vehicle: NonZeroU32::new(vehicle),
                });
                let is_whole = matches!(outcome, WriteOutcome::Taken | WriteOutcome::OutOfRange);
                let goes_on = outcome == WriteOutcome::Receiving;
                until = until.filter(|_| goes_on);
                next = (goes_on || is_whole).then_some(index + 1);
                counts.borrow_mut()[outcome as usize] += 1;
            }
            prop_assert_eq!((taken, download.status(None, false).outcome), (expected, outcome));
        }
        Ok(())
    });
    assert!(counts.borrow()[1..].iter().all(|count| *count > 20), "{counts:?}");
}
