//! Encode and decode against the DBC file, through a DBC parser and a bit extractor that know nothing of the
//! core's layout.
//!
//! Above 500 lines because it is one file format and all of its messages: split, a reader could not see which one lacks a check.

use can_dbc::{ByteOrder, Dbc, MessageId, MultiplexIndicator, ValueType};
use haptic_core::bus::e2e::{Protection, ReceiverState};
use haptic_core::bus::messages::{
    Column, FaultRecord, Guidance, Identity, LanePreview, MESSAGES, Message, ParameterStatus,
    ParameterUnlock, ParameterValue, ParameterWrite, Rejection, Request, ResetCause, Telemetry, VERSION,
    Vehicle, Warning, WriteOutcome,
};
use haptic_core::bus::{Frame, Reject};
use haptic_core::controller::params::PARAMETERS;
use haptic_core::estimator::Reading;
use haptic_core::quantity::{Metres, Micros, Radians, Ratio, Speed, Torque, TurningRate};
use haptic_core::safety::envelope::LimitReason;
use haptic_core::safety::faults::{Fault, FaultSet, Record};
use haptic_core::safety::modes::Mode;
use rand::rngs::SmallRng;
use rand::{RngExt, SeedableRng};

fn dbc() -> Dbc {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/haptic.dbc");
    Dbc::try_from(std::fs::read_to_string(path).unwrap().as_str()).unwrap()
}

/// Physical value of a signal, bit by bit, as the DBC file says.
fn signal(dbc: &Dbc, frame: &Frame, name: &str) -> f64 {
    let message = dbc
        .messages
        .iter()
        .find(|m| m.id == MessageId::Standard(frame.id()))
        .unwrap_or_else(|| panic!("{:#x} is not in the DBC file", frame.id()));
    let signal = message
        .signals
        .iter()
        .find(|s| s.name == format!("{}_{name}", message.name))
        .unwrap();
    assert_eq!(signal.byte_order, ByteOrder::LittleEndian);
    assert_eq!(signal.multiplexer_indicator, MultiplexIndicator::Plain);
    let mut raw: i64 = 0;
    for i in 0..signal.size {
        let bit = signal.start_bit + i;
        let set = frame.data()[bit as usize / 8] >> (bit % 8) & 1;
        raw |= i64::from(set) << i;
    }
    if signal.value_type == ValueType::Signed && raw >> (signal.size - 1) == 1 {
        raw -= 1 << signal.size;
    }
    raw as f64 * signal.factor + signal.offset
}

/// The message back out of a frame, past a receiver that trusts its sender.
fn decode<M: Message>(message: M) -> M {
    let mut state = ReceiverState::NEW;
    for counter in 0..2 {
        let _ = M::decode(&mut state, &message.encode(counter));
    }
    M::decode(&mut state, &message.encode(2)).unwrap()
}

/// Half an LSB, and the 2^-24 of the core's own format.
fn near(got: f64, wanted: f64, lsb: f64) {
    assert!(
        (got - wanted).abs() <= 0.5 * lsb + 1e-7,
        "got {got}, wanted {wanted}"
    );
}

#[test]
fn lane_preview() {
    let dbc = dbc();
    let mut rng = SmallRng::seed_from_u64(1);
    for i in 0..10_000 {
        let (y, theta) = (rng.random_range(-4.0..=4.0), rng.random_range(-0.5..=0.5));
        let (age_us, valid) = (rng.random_range(0..=51_100), rng.random());
        let sent = LanePreview {
            e_y: Metres::from_m(y),
            e_theta: Radians::from_rad(theta),
            age: Micros::from_us(age_us),
            valid,
        };
        let frame = sent.encode(i as u8);
        near(signal(&dbc, &frame, "LateralError"), y, 1.0 / 8192.0);
        near(signal(&dbc, &frame, "YawError"), theta, 1.0 / 65536.0);
        near(signal(&dbc, &frame, "Age"), f64::from(age_us) * 1e-3, 0.1);
        assert_eq!(signal(&dbc, &frame, "Valid"), f64::from(u8::from(valid)));
        assert_eq!(signal(&dbc, &frame, "Counter"), f64::from(i as u8 & 15));
        let got = decode(sent);
        assert_eq!(got.e_y.m(), signal(&dbc, &frame, "LateralError"));
        assert_eq!(got.e_theta.rad(), signal(&dbc, &frame, "YawError"));
        assert_eq!(got.valid, valid);
        assert_eq!(
            got.age.us(),
            (signal(&dbc, &frame, "Age") * 1000.0).round() as u32
        );
    }
}

#[test]
fn column() {
    let dbc = dbc();
    let mut rng = SmallRng::seed_from_u64(2);
    for i in 0..10_000 {
        let (torque, angle_deg) = (
            rng.random_range(-20.0..=20.0),
            rng.random_range(-720.0..=720.0_f64),
        );
        let sent = Column {
            driver_torque: Torque::from_nm(torque),
            wheel_angle: Radians::from_rad(angle_deg.to_radians()),
            motor_torque: Torque::from_nm(-torque / 4.0),
        };
        let frame = sent.encode(i as u8);
        near(signal(&dbc, &frame, "DriverTorque"), torque, 1.0 / 4096.0);
        near(signal(&dbc, &frame, "WheelAngle"), angle_deg, 0.01 + 1e-5);
        let got = decode(sent);
        assert_eq!(got.driver_torque.nm(), signal(&dbc, &frame, "DriverTorque"));
        near(
            got.wheel_angle.rad(),
            signal(&dbc, &frame, "WheelAngle").to_radians(),
            1e-7,
        );
    }
}

#[test]
fn vehicle_and_request() {
    let dbc = dbc();
    for raw in 0..=90 * 256 {
        let (a, b) = (f64::from(raw) / 256.0, f64::from(90 * 256 - raw) / 256.0);
        let sent = Vehicle {
            speeds: [Speed::from_m_per_s(a), Speed::from_m_per_s(b)],
            yaw_rate: None,
        };
        let frame = sent.encode(3);
        let names = ["Speed1", "Speed2", "YawRate", "YawRateValid"];
        assert_eq!(names.map(|name| signal(&dbc, &frame, name)), [a, b, 0.0, 0.0]);
        assert_eq!(decode(sent), sent);
    }
    for raw in -8191..=8191 {
        let rate = f64::from(raw) / 4096.0;
        let sent = Vehicle {
            speeds: [Speed::from_m_per_s(20.0); 2],
            yaw_rate: Some(TurningRate::from_rad_per_s(rate)),
        };
        let frame = sent.encode(3);
        let names = ["Speed1", "Speed2", "YawRate", "YawRateValid"];
        assert_eq!(
            names.map(|name| signal(&dbc, &frame, name)),
            [20.0, 20.0, rate, 1.0]
        );
        assert_eq!(decode(sent), sent);
    }
    for raw in 0..=128 {
        let sent = Request {
            engage: raw % 2 == 0,
            authority: Ratio::from_si(f64::from(raw) / 128.0),
            probe: raw % 3 == 0,
        };
        let frame = sent.encode(3);
        assert_eq!(signal(&dbc, &frame, "Authority"), f64::from(raw) / 128.0);
        assert_eq!(signal(&dbc, &frame, "Engage"), f64::from(u8::from(raw % 2 == 0)));
        assert_eq!(signal(&dbc, &frame, "Probe"), f64::from(u8::from(raw % 3 == 0)));
        assert_eq!(decode(sent), sent);
    }
}

#[test]
fn guidance() {
    let dbc = dbc();
    for raw in -20_480..=20_480_i32 {
        let torque = f64::from(raw) / 4096.0;
        let (code, bits) = (raw.rem_euclid(7), (raw & 0xF_FFFF) as u32);
        let sent = Guidance {
            torque: Torque::from_nm(torque),
            limit: LimitReason::from_code(i64::from(code)).unwrap(),
            mode: Mode::from_code(code as u32).unwrap(),
            warning: raw % 2 == 0,
            faults: FaultSet::from_bits(bits),
            reset: ResetCause::from_code(i64::from(code)).unwrap(),
        };
        let frame = sent.encode(0);
        assert_eq!(signal(&dbc, &frame, "Torque"), torque);
        assert_eq!(signal(&dbc, &frame, "Limit"), f64::from(code));
        assert_eq!(signal(&dbc, &frame, "Mode"), f64::from(code));
        assert_eq!(signal(&dbc, &frame, "Warning"), f64::from(u8::from(raw % 2 == 0)));
        assert_eq!(signal(&dbc, &frame, "Reset"), f64::from(code));
        let classes = [("ClassB", 0x7_80FF), ("ClassC", 0x1F00), ("ClassLocked", 0x6000)];
        for (name, mask) in classes {
            assert_eq!(
                signal(&dbc, &frame, name),
                f64::from(u8::from(bits & mask != 0)),
                "{name}"
            );
        }
        let told = Guidance::classes(&frame).unwrap();
        assert_eq!(
            [told.b, told.c, told.locked],
            classes.map(|(_, mask)| bits & mask != 0)
        );
        for (i, fault) in Fault::ALL.iter().enumerate() {
            let name = format!("Fault_{fault:?}");
            assert_eq!(signal(&dbc, &frame, &name), f64::from(bits >> i & 1), "{name}");
        }
        assert_eq!(decode(sent), sent);
    }
}

#[test]
fn warning_and_fault_record() {
    let dbc = dbc();
    for (i, fault) in Fault::ALL.into_iter().enumerate() {
        let mut faults = FaultSet::NONE;
        faults.insert(fault);
        let sent = Warning {
            mode: Mode::Handover,
            faults,
        };
        let frame = sent.encode(0);
        assert_eq!(signal(&dbc, &frame, "Mode"), 4.0);
        assert_eq!(signal(&dbc, &frame, &format!("Fault_{fault:?}")), 1.0);
        assert_eq!(decode(sent), sent);
        let record = Record {
            fault,
            count: 200,
            age_s: 54_321,
            present: i % 2 == 1,
        };
        let sent = FaultRecord {
            index: i as u8,
            total: 15,
            record,
        };
        let frame = sent.encode(0);
        let signals =
            ["Index", "Total", "Fault", "Present", "Count", "Age"].map(|name| signal(&dbc, &frame, name));
        assert_eq!(
            signals,
            [i as f64, 15.0, i as f64, (i % 2) as f64, 200.0, 54_321.0]
        );
        assert_eq!(decode(sent), sent);
    }
}

#[test]
fn telemetry() {
    let dbc = dbc();
    for raw in -4096..=4096_i32 {
        let probe = f64::from(raw.clamp(-2047, 2047)) / 4096.0;
        let (k_hg, deviation) = (f64::from(raw) / 1024.0, f64::from(raw & 2047) / 1024.0);
        let (probing, identified) = (raw % 2 == 0, raw % 3 == 0);
        let sent = Telemetry {
            probe: probing.then(|| Torque::from_nm(probe)),
            k_hg: identified.then(|| Reading {
                k_hg: Ratio::from_si(k_hg),
                deviation: Ratio::from_si(deviation),
            }),
        };
        let frame = sent.encode(0);
        let shown = |there: bool, value: f64| if there { value } else { 0.0 };
        let expected = [
            ("Probe", shown(probing, probe)),
            ("ProbeOn", shown(probing, 1.0)),
            ("Identified", shown(identified, 1.0)),
            ("K_hg", shown(identified, k_hg)),
            ("K_hg_Deviation", shown(identified, deviation)),
        ];
        for (name, value) in expected {
            assert_eq!(signal(&dbc, &frame, name), value, "{name} {raw}");
        }
        assert_eq!(decode(sent), sent);
    }
}

#[test]
fn parameters() {
    let dbc = dbc();
    let is_float = dbc
        .signal_extended_value_type_list
        .iter()
        .any(|v| v.signal_name == "ParameterWrite_Value");
    assert!(is_float);
    for (index, value) in [
        (0, 0.25_f32),
        (7, 5.0),
        (17, 0.001_753),
        (21, 0.0),
        (23, 0.3),
        (30, 100.0),
    ] {
        let sent = ParameterWrite { index, value };
        let frame = sent.encode(index);
        assert_eq!(signal(&dbc, &frame, "Index"), f64::from(index));
        // The bits of an IEEE 754 binary32, all positive.
        let raw = signal(&dbc, &frame, "Value") as u32;
        assert_eq!(f32::from_bits(raw), value);
        assert_eq!(decode(sent), sent);
    }
    let beyond = ParameterWrite {
        index: 31,
        value: 1.0,
    };
    let mut data = [0; 8];
    beyond.pack(&mut data);
    assert_eq!(ParameterWrite::unpack(&data), None);
    for code in 0..9 {
        let sent = ParameterStatus {
            stored: code % 2 == 0,
            damaged: code % 3 == 0,
            outcome: WriteOutcome::from_code(code).unwrap(),
            sequence: 0xFEDC_BA90 + code as u32,
        };
        let frame = sent.encode(0);
        let signals = ["Stored", "Damaged", "Outcome", "Sequence"].map(|name| signal(&dbc, &frame, name));
        let flag = |set| f64::from(u8::from(set));
        let sequence = f64::from(0xFEDC_BA90_u32) + code as f64;
        assert_eq!(
            signals,
            [flag(code % 2 == 0), flag(code % 3 == 0), code as f64, sequence]
        );
        assert_eq!(decode(sent), sent);
    }
}

#[test]
fn unlock_value_and_rejection() {
    let dbc = dbc();
    let sent = ParameterUnlock {
        vehicle: 1_048_575,
        sequence: 0xFEDC_BA98,
    };
    let signals = ["Vehicle", "Sequence"].map(|name| signal(&dbc, &sent.encode(0), name));
    assert_eq!(signals, [1_048_575.0, f64::from(0xFEDC_BA98_u32)]);
    assert_eq!(decode(sent), sent);
    let sent = Identity {
        vehicle: 654_321,
        hardware: 0xFEDC_BA98,
    };
    let signals = ["Vehicle", "Hardware"].map(|name| signal(&dbc, &sent.encode(0), name));
    assert_eq!(signals, [654_321.0, f64::from(0xFEDC_BA98_u32)]);
    assert_eq!(decode(sent), sent);
    for (index, value) in [(0, 0.25_f32), (20, 0.7)] {
        let sent = ParameterValue { index, value };
        let frame = sent.encode(index);
        assert_eq!(signal(&dbc, &frame, "Index"), f64::from(index));
        assert_eq!(f32::from_bits(signal(&dbc, &frame, "Value") as u32), value);
        assert_eq!(decode(sent), sent);
    }
    for (code, reason) in Reject::ALL.into_iter().enumerate() {
        let sent = Rejection {
            id: 0x7FF - code as u16,
            reason,
            count: 54_321,
        };
        let frame = sent.encode(0);
        let signals = ["Message", "Reason", "Count"].map(|name| signal(&dbc, &frame, name));
        assert_eq!(signals, [2047.0 - code as f64, code as f64, 54_321.0]);
        assert_eq!(decode(sent), sent);
    }
}

/// What a client needs to send a frame that is accepted: the data IDs as they are used, and the window of the counter.
#[test]
fn the_dbc_file_has_the_data_ids_of_every_message() {
    let text = include_str!("../haptic.dbc");
    let attribute = |name: &str, id: u16| {
        let begin = format!("BA_ \"{name}\" BO_ {id} ");
        let value = text.split_once(&begin).unwrap().1.split(';').next().unwrap();
        value.trim_matches('"').to_owned()
    };
    for message in MESSAGES {
        let ids = attribute("E2EDataIds", message.id);
        let ids: Vec<u8> = ids
            .split(' ')
            .map(|hex| u8::from_str_radix(hex, 16).unwrap())
            .collect();
        let by_file = Protection::with_list(ids.try_into().unwrap());
        for counter in 0..16 {
            let mut data = [0, 0, 1, 2, 3, 4, 5, 6];
            by_file.protect(&mut data, counter);
            assert!(message.protection.is_intact(&data), "{} {counter}", message.name);
        }
        let constant: u8 = attribute("E2EConstant", message.id).parse().unwrap();
        assert_eq!(Protection::new(constant), message.protection, "{}", message.name);
        let max_delta = attribute("E2EMaxDelta", message.id);
        assert_eq!(max_delta, message.max_delta.to_string(), "{}", message.name);
    }
}

/// A tool that shows one signal shows what it is, and names instead of codes; and no two things have one name.
#[test]
fn the_dbc_file_explains_every_signal() {
    let dbc = dbc();
    let text = include_str!("../haptic.dbc");
    for message in &dbc.messages {
        let MessageId::Standard(id) = message.id else {
            panic!("{} is extended", message.name)
        };
        assert!(text.contains(&format!("CM_ BO_ {id} \"")), "{}", message.name);
        for signal in &message.signals {
            let comment = format!("CM_ SG_ {id} {} \"", signal.name);
            assert_eq!(text.matches(&comment).count(), 1, "{}", signal.name);
            let values = format!("VAL_ {id} {} ", signal.name);
            let is_flag = signal.size == 1;
            assert!(!is_flag || text.matches(&values).count() == 1, "{}", signal.name);
        }
        assert!(
            dbc.nodes.iter().all(|node| node.0 != message.name),
            "{}",
            message.name
        );
    }
}

#[test]
fn values_beyond_the_range_saturate_when_sent() {
    let dbc = dbc();
    let lane = LanePreview {
        e_y: Metres::from_m(-100.0),
        e_theta: Radians::from_rad(100.0),
        age: Micros::from_ms(900),
        valid: true,
    }
    .encode(0);
    assert_eq!(signal(&dbc, &lane, "LateralError"), -4.0);
    assert_eq!(signal(&dbc, &lane, "YawError"), 0.5);
    near(signal(&dbc, &lane, "Age"), 51.1, 1e-9);
}

#[test]
fn one_lsb_beyond_the_range_is_rejected_when_received() {
    use haptic_core::bus::Reject::Range;
    // Raw values written here by hand: 4 m + 1 LSB, 0.5 rad + 1 LSB, and the same to the right.
    for (start, raw, beyond) in [(12, 32_768_i64, 32_769_i64), (29, 32_768, 32_769)] {
        for sign in [1, -1] {
            for (value, expected_ok) in [(raw, true), (beyond, false)] {
                let word = (((sign * value) as u64) & 0x1_FFFF) << start;
                let mut data = word.to_le_bytes();
                LanePreview::PROTECTION.protect(&mut data, 0);
                let frame = Frame::new(0x100, &data).unwrap();
                let decoded = LanePreview::decode(&mut { ReceiverState::TRUSTED }, &frame);
                assert_eq!(decoded.is_ok(), expected_ok, "{start} {value} {decoded:?}");
                assert!(expected_ok || decoded == Err(Range));
            }
        }
    }
}

/// Either speed: 0 and 90 m/s are in range, the counts beyond and -1 m/s are not.
#[test]
fn a_speed_is_in_range_from_0_to_90() {
    for start in [12, 28] {
        for (raw, is_in_range) in [
            (0, true),
            (23_040, true),
            (-1, false),
            (-256, false),
            (-32_768, false),
            (23_041, false),
            (32_767, false),
        ] {
            let word = (i64::from(raw) as u64 & 0xFFFF) << start;
            assert_eq!(
                Vehicle::unpack(&word.to_le_bytes()).is_some(),
                is_in_range,
                "{start} {raw}"
            );
        }
    }
}

/// The raw value -8192 of a yaw rate has no counterpart to the left, so it is no value; where the sender says that it has
/// no good one, nobody looks at it. Beyond the range a value saturates when it is sent.
#[test]
fn a_yaw_rate_counts_only_where_it_is_valid() {
    let unpack = |raw: i64, valid: u64| {
        Vehicle::unpack(&(((raw as u64) & 0x3FFF) << 44 | valid << 58).to_le_bytes())
            .map(|v| v.yaw_rate.map(|r| r.rad_per_s()))
    };
    assert_eq!(unpack(-8191, 1), Some(Some(-8191.0 / 4096.0)));
    assert_eq!(unpack(-8192, 1), None);
    assert_eq!(unpack(-8192, 0), Some(None));
    assert_eq!(unpack(100, 0), Some(None));
    let spinning = Vehicle {
        yaw_rate: Some(TurningRate::from_rad_per_s(-5.0)),
        ..Vehicle::default()
    };
    let sent = decode(spinning).yaw_rate.map(|rate| rate.rad_per_s());
    assert_eq!(sent, Some(-8191.0 / 4096.0));
}

/// By their lateral errors in 2^-13 m, 32,769 is beyond 4 m: a sender is trusted with its third good frame in a row,
/// and remains so after one that is not.
#[test]
fn a_frame_beyond_its_range_does_not_count_as_clean() {
    use haptic_core::bus::Reject::{NotTrusted, Range};
    let (good, beyond) = (0_u64, 32_769_u64);
    let mut state = ReceiverState::NEW;
    let mut hear = |counter: u8, e_y: u64| {
        let mut data = (e_y << 12).to_le_bytes();
        LanePreview::PROTECTION.protect(&mut data, counter);
        LanePreview::decode(&mut state, &Frame::new(0x100, &data).unwrap()).map(drop)
    };
    let heard = [good, good, beyond, good, good, good, beyond, good]
        .into_iter()
        .zip(0..)
        .map(|(e_y, counter)| hear(counter, e_y));
    let not_yet = Err(NotTrusted);
    assert_eq!(
        heard.collect::<Vec<_>>(),
        [
            not_yet,
            not_yet,
            Err(Range),
            not_yet,
            not_yet,
            Ok(()),
            Err(Range),
            Ok(())
        ]
    );
}

/// Names that the DBC file gives a signal's codes.
fn named(signal: &str) -> Vec<(i64, String)> {
    let dbc = dbc();
    let values = dbc.value_descriptions.iter().find_map(|v| match v {
        can_dbc::ValueDescription::Signal {
            name,
            value_descriptions,
            ..
        } if name == signal => Some(value_descriptions),
        _ => None,
    });
    values
        .unwrap()
        .iter()
        .map(|d| (d.id, d.description.clone()))
        .collect()
}

/// Names that the code gives them.
fn coded<T: core::fmt::Debug>(from_code: impl Fn(i64) -> Option<T>) -> Vec<(i64, String)> {
    (0..64)
        .filter_map(|code| from_code(code).map(|value| (code, format!("{value:?}"))))
        .collect()
}

#[test]
fn the_dbc_file_names_every_code() {
    assert_eq!(named("Guidance_Limit"), coded(LimitReason::from_code));
    assert_eq!(named("Guidance_Mode"), coded(|code| Mode::from_code(code as u32)));
    assert_eq!(named("Warning_Mode"), coded(|code| Mode::from_code(code as u32)));
    assert_eq!(named("Guidance_Reset"), coded(ResetCause::from_code));
    assert_eq!(named("ParameterStatus_Outcome"), coded(WriteOutcome::from_code));
    assert_eq!(named("FaultRecord_Fault"), coded(Fault::from_code));
    let parameters: Vec<_> = (0..)
        .zip(PARAMETERS.map(|parameter| parameter.name.to_owned()))
        .collect();
    assert_eq!(named("ParameterWrite_Index"), parameters);
    assert_eq!(named("ParameterValue_Index"), parameters);
    assert_eq!(named("Rejection_Reason"), coded(Reject::from_code));
    let messages = MESSAGES.map(|message| (i64::from(message.id), message.name.to_owned()));
    assert_eq!(named("Rejection_Message"), messages);
}

/// Names, identifiers, senders and periods: the DBC file, the table in docs/reference/bus.md and the list in the code.
#[test]
fn the_dbc_file_and_the_documents_list_every_message() {
    let dbc = dbc();
    assert_eq!(dbc.version.0, VERSION);
    let row = |id: &MessageId, name: &str| match id {
        MessageId::Standard(id) => (*id, name.to_owned()),
        MessageId::Extended(id) => panic!("{id:#x} is extended"),
    };
    let in_file: Vec<_> = dbc.messages.iter().map(|m| row(&m.id, &m.name)).collect();
    let in_code: Vec<_> = MESSAGES.iter().map(|m| (m.id, m.name.to_owned())).collect();
    assert_eq!(in_file, in_code);
    let document = include_str!("../../docs/reference/bus.md");
    let rows = document.lines().filter_map(|line| line.strip_prefix("| 0x"));
    let in_document: Vec<_> = rows
        .map(|row| {
            let (id, rest) = row.split_once(" | ").unwrap();
            let name = rest.split(':').next().unwrap();
            (u16::from_str_radix(id, 16).unwrap(), name.to_owned())
        })
        .collect();
    assert_eq!(in_document, in_code);
    for message in MESSAGES {
        let there = dbc.messages.iter().find(|m| m.name == message.name).unwrap();
        let sender = format!("{:?}", message.sender);
        assert_eq!(there.transmitter, Some(sender), "{}", message.name);
        let text = include_str!("../haptic.dbc");
        let attribute = format!("BA_ \"GenMsgCycleTime\" BO_ {} ", message.id);
        let value = text.split_once(&attribute).unwrap().1.split(';').next().unwrap();
        let period_ms: f64 = value.parse().unwrap();
        assert!((period_ms - message.period_ms).abs() < 1e-6, "{}", message.name);
    }
}

/// One bit of the word for each fault, in the order of the list, in the guidance frame and in the warning.
#[test]
fn the_dbc_file_has_a_bit_for_every_fault() {
    let dbc = dbc();
    for (message, start, room) in [("Guidance", 37, 21), ("Warning", 16, 32)] {
        let signals = &dbc.messages.iter().find(|m| m.name == message).unwrap().signals;
        let prefix = format!("{message}_Fault_");
        let bits: Vec<_> = signals
            .iter()
            .filter_map(|s| Some((s.start_bit, s.name.strip_prefix(&prefix)?.to_owned())))
            .collect();
        let faults = Fault::ALL.iter().take(room);
        let expected: Vec<_> = (start..).zip(faults.map(|fault| format!("{fault:?}"))).collect();
        assert_eq!(bits, expected);
    }
}

/// To whole counts of 2^-12 N.m toward zero, so that no bound is crossed by rounding, and no more than 5 N.m.
#[test]
fn a_torque_is_cut_to_what_its_frame_carries() {
    for (nm, counts) in [
        (0.0, 0.0),
        (0.9 / 4096.0, 0.0),
        (1.0 / 4096.0, 1.0),
        (2.99 / 4096.0, 2.0),
        (5.0, 20_480.0),
        (5.01, 20_480.0),
        (128.0, 20_480.0),
    ] {
        for sign in [1.0, -1.0] {
            let carried = Guidance::rounded(Torque::from_nm(sign * nm));
            assert_eq!(carried.nm(), sign * counts / 4096.0, "{nm}");
        }
    }
}
