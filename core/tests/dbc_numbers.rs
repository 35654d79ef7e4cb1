//! Every number of the DBC file beside the layout: ranges, attributes, and those in comments, held against the code's lists and
//! constants. A number that nothing holds fails.

use can_dbc::{AttributeValue, Comment, Dbc, Message, MessageId, NumericValue, ValueDescription};
use haptic_core::bus::Frame;
use haptic_core::bus::messages::{Guidance, MESSAGES, TIMEOUT};
use haptic_core::controller::config::Setup;
use haptic_core::controller::params::{PARAMETERS, Params};
use haptic_core::ecu::{Boot, Ecu};
use haptic_core::quantity::{Instant, Micros};
use haptic_core::safety::hands;
use haptic_core::service::download::UNLOCK_MS;

const TEXT: &str = include_str!("../haptic.dbc");

fn dbc() -> Dbc {
    Dbc::try_from(TEXT).unwrap()
}

fn number(value: NumericValue) -> f64 {
    value.to_string().parse().unwrap()
}

/// Messages that are sent only while there is something to say, and those that a host sends when it wants.
const IF_ACTIVE: [&str; 4] = ["Warning", "FaultRecord", "ParameterValue", "Rejection"];
const BY_HAND: [&str; 2] = ["ParameterWrite", "ParameterUnlock"];

/// Names that are no list from 0 on: identifiers.
const NO_LIST: &str = "Rejection_Message";

#[test]
fn a_range_holds_what_its_bits_and_its_names_say() {
    let dbc = dbc();
    for message in &dbc.messages {
        for signal in &message.signals {
            let (name, min, max) = (&signal.name, number(signal.min), number(signal.max));
            let is_float = name.ends_with("_Value") && signal.size == 32;
            let raw = |value: f64| (value - signal.offset) / signal.factor;
            let beyond = 2_f64.powi(signal.size as i32);
            let signed = signal.value_type == can_dbc::ValueType::Signed;
            let (least, most) = if signed {
                (-beyond / 2.0, beyond / 2.0)
            } else {
                (0.0, beyond)
            };
            let (low, high) = (raw(min), raw(max));
            assert!(is_float || (low - low.round()).abs() < 1e-6, "{name}: {low}");
            assert!(is_float || (high - high.round()).abs() < 1e-6, "{name}: {high}");
            assert!(
                is_float || (low >= least && high < most),
                "{name}: {low} to {high}"
            );
            let start = start_value(message, name);
            assert!(
                (low..=high).contains(&start),
                "{name}: {start} outside {low} to {high}"
            );
            let codes = dbc.value_descriptions.iter().find_map(|values| match values {
                ValueDescription::Signal {
                    name: own,
                    value_descriptions,
                    ..
                } if own == name => value_descriptions.iter().map(|value| value.id).max(),
                _ => None,
            });
            let last = codes.filter(|_| name != NO_LIST);
            assert!(
                last.is_none_or(|last| last as f64 == max),
                "{name}: {last:?} names, {max}"
            );
        }
    }
    let of = |name: &str| {
        let mut signals = dbc.messages.iter().flat_map(|message| &message.signals);
        let signal = signals.find(|signal| signal.name == name).unwrap();
        (number(signal.min), number(signal.max))
    };
    let least = PARAMETERS
        .iter()
        .map(|parameter| parameter.min)
        .fold(f64::INFINITY, f64::min);
    let most = PARAMETERS
        .iter()
        .map(|parameter| parameter.max)
        .fold(0.0, f64::max);
    for message in ["ParameterWrite", "ParameterValue"] {
        assert_eq!(
            of(&format!("{message}_Index")),
            (0.0, (PARAMETERS.len() - 1) as f64)
        );
        assert_eq!(of(&format!("{message}_Value")), (least, most));
    }
}

/// What a tool that plays or measures the bus needs: kind, bit rate, who sends when, and where signals start.
#[test]
fn the_attributes_say_how_the_bus_runs() {
    let dbc = dbc();
    let of_bus = |name: &str| {
        dbc.attribute_values_database
            .iter()
            .find(|a| a.name == name)
            .unwrap()
    };
    assert_eq!(of_bus("BusType").value, AttributeValue::String("CAN".into()));
    assert!(TEXT.contains("BA_ \"Baudrate\" 500000;") && TEXT.contains("classic CAN, 500 kbit/s"));
    let choices = TEXT
        .split_once("\"GenMsgSendType\" ENUM ")
        .unwrap()
        .1
        .split(';')
        .next()
        .unwrap();
    let choices: Vec<&str> = choices
        .split(',')
        .map(|choice| choice.trim_matches('"'))
        .collect();
    for message in MESSAGES {
        let begin = format!("BA_ \"GenMsgSendType\" BO_ {} ", message.id);
        let choice = TEXT
            .split_once(&begin)
            .map_or("0", |(_, rest)| rest.split(';').next().unwrap());
        let expected = match message.name {
            name if IF_ACTIVE.contains(&name) => "IfActive",
            name if BY_HAND.contains(&name) => "NoMsgSendType",
            _ => "Cyclic",
        };
        assert_eq!(
            choices[choice.parse::<usize>().unwrap()],
            expected,
            "{}",
            message.name
        );
    }
}

/// The bits that a signal starts with, as a tool that plays the bus takes them: of its attribute, or the attribute's default.
fn start_value(message: &Message, name: &str) -> f64 {
    let MessageId::Standard(id) = message.id else {
        panic!("{name}: 29 bits")
    };
    let own = format!("BA_ \"GenSigStartValue\" SG_ {id} {name} ");
    let value = TEXT
        .split_once(&own)
        .or_else(|| TEXT.split_once("BA_DEF_DEF_ \"GenSigStartValue\" "));
    let (_, rest) = value.unwrap();
    rest.split(';').next().unwrap().parse().unwrap()
}

/// The first frame of every cyclic message of an ECU that nobody sends anything to yet: all inputs are timed out.
#[test]
fn a_signal_starts_as_the_ecu_first_sends_it() {
    let dbc = dbc();
    let time = |ms: u32| Instant::from_us(1000 * ms);
    let mut ecu = Ecu::new(Some(&Setup::PAPER), Boot::default(), time(0));
    let mut first: Vec<Frame> = Vec::new();
    for ms in 1..=2000 {
        let step = ecu.step(time(ms));
        let sent = [step.guidance]
            .into_iter()
            .chain(step.others)
            .chain(ecu.background_step());
        for frame in sent {
            if first.iter().all(|known| known.id() != frame.id()) {
                first.push(frame);
            }
        }
    }
    let mut heard = Vec::new();
    for frame in &first {
        let id = MessageId::Standard(frame.id());
        let message = dbc.messages.iter().find(|message| message.id == id).unwrap();
        if IF_ACTIVE.contains(&message.name.as_str()) {
            continue;
        }
        heard.push(message.name.as_str());
        // A CRC is that of the frame, whatever is in it.
        let signals = message
            .signals
            .iter()
            .filter(|signal| !signal.name.ends_with("_Crc"));
        for signal in signals {
            let bits = (0..signal.size).map(|i| (i, signal.start_bit + i));
            let bits = bits.map(|(i, bit)| u64::from(frame.data()[bit as usize / 8] >> (bit % 8) & 1) << i);
            let bits: u64 = bits.sum();
            let start = start_value(message, &signal.name);
            assert_eq!(bits as f64, start, "{}", signal.name);
        }
    }
    assert_eq!(heard, ["Guidance", "Telemetry"]);
}

/// A number with the unit that the comments write.
fn ms(time: Micros) -> String {
    match time.us() / 1000 {
        ms if ms >= 1000 && ms % 1000 == 0 => format!("{} s", ms / 1000),
        ms => format!("{ms} ms"),
    }
}

/// The numbers of comments, written from the constants that they speak of.
fn known(period: Option<f64>) -> Vec<String> {
    let vehicle = Params::PAPER.vehicle;
    let mut known = vec![
        format!("for {}", ms(TIMEOUT)),
        format!("hand on the wheel for {} of", ms(hands::WARN)),
        format!("after {} the guidance ends", ms(hands::END)),
        format!("within {} of ParameterUnlock", ms(Micros::from_ms(UNLOCK_MS))),
        format!("for {}.", ms(Micros::from_ms(UNLOCK_MS))),
        format!("first {} of the {} bits", Guidance::FAULTS, u32::BITS),
        format!(
            "near {} s, far {} s ahead",
            vehicle.near_time_s, vehicle.far_time_s
        ),
    ];
    if let Some(period_ms) = period {
        known.push(format!("every {} s", period_ms / 1000.0));
        known.push(format!("every {} ms", (period_ms * 10.0).round() / 10.0));
    }
    // Of standards, of the layout, and of words that are no measure; the last three rest on constants that core keeps to itself.
    let other = "500 kbit/s|profile 2|CRC-8|polynomial 0x2F|xorout 0xFF|bytes 1 to 7|modulo 16|32-bit float|CRC-32|51.2 ms|\
                 version 2.2.0|version 2.3.0|0: nobody|0 gives way|1 resists|good yaw rate. 0|within 10 s, or ten|Beyond 150 ms|\
                 2 m/s|500 ms of valid inputs";
    known.extend(other.split('|').map(String::from));
    known
}

#[test]
fn a_number_in_a_comment_is_that_of_the_code() {
    for comment in &dbc().comments {
        let (text, period) = match comment {
            Comment::Message {
                id: MessageId::Standard(id),
                comment,
            } => {
                let message = MESSAGES.iter().find(|message| message.id == *id);
                (comment, message.map(|message| message.period_ms))
            }
            Comment::Signal { comment, .. } | Comment::Plain { comment } => (comment, None),
            _ => continue,
        };
        let mut rest = text.clone();
        for phrase in known(period) {
            rest = rest.replace(&phrase, "");
        }
        // Names of quantities and files end in digits.
        for name in ["E2E", "docs/"] {
            rest = rest.replace(name, "");
        }
        let digit = rest.find(|c: char| c.is_ascii_digit());
        assert!(digit.is_none(), "{text:?}: nothing holds the number in {rest:?}");
    }
}
