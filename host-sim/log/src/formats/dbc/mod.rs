//! What frames mean: a DBC file's signals as channels, one group for each message of a bus.

mod decode;
mod signals;
mod statements;

use std::borrow::Cow;
use std::collections::HashSet;
use std::ops::RangeInclusive;

use can_dbc::{
    ByteOrder, Dbc, Message, MessageId, MultiplexIndicator, Signal, SignalExtendedValueType, ValueType,
};

use super::numbered;
use crate::notes::{Fate, Notes};
use crate::recording::RecordingError;
pub use signals::{Signals, channels};

/// Identifier of a message, and whether it has 29 bits.
#[must_use]
pub const fn identifier(id: MessageId) -> (u32, bool) {
    match id {
        MessageId::Standard(id) => (id as u32, false),
        MessageId::Extended(id) => (id, true),
    }
}

/// Words behind which an identifier stands.
const BEFORE_AN_IDENTIFIER: [&str; 7] = [
    "BO_",
    "SG_",
    "VAL_",
    "SIG_VALTYPE_",
    "SG_MUL_VAL_",
    "BO_TX_BU_",
    "SIG_GROUP_",
];
/// The bit of an identifier that says that it has 29 bits.
const IS_EXTENDED: u32 = 1 << 31;
/// The message of signals that are in none.
const NO_MESSAGE: &str = "VECTOR__INDEPENDENT_SIG_MSG";

/// Reads a DBC file, in UTF-8 or in the encoding of Windows. Identifiers above 7FF are taken as 29 bits even without their
/// bit 31. A statement that is not understood is left out, and a signal with it whose value it decides.
///
/// # Errors
/// No message is understood.
pub fn parse(bytes: &[u8]) -> Result<(Dbc, Notes), RecordingError> {
    let mut notes = Notes::default();
    let text = str::from_utf8(bytes).map(Cow::Borrowed).ok();
    let text = text.or_else(|| can_dbc::decode_cp1252(bytes)).unwrap_or_default();
    let text = text.trim_start_matches('\u{feff}');
    let (mut whole, mut before, mut named) = (String::with_capacity(text.len()), "", None);
    let mut beyond = HashSet::new();
    for word in text.split_inclusive(char::is_whitespace) {
        let bare = word.trim_end();
        let id = bare
            .parse::<u32>()
            .ok()
            .filter(|_| BEFORE_AN_IDENTIFIER.contains(&before));
        match id {
            // can-dbc cuts them to 16 bits.
            Some(id @ 0x800..IS_EXTENDED) => {
                whole += &(id | IS_EXTENDED).to_string();
                whole += &word[bare.len()..];
            }
            _ => whole += word,
        }
        if let Some(id) = id.filter(|_| before == "BO_") {
            named = Some(id);
        } else if let Some(id) = named.take_if(|_| !bare.is_empty()) {
            let name = bare.trim_end_matches(':');
            if id & !IS_EXTENDED > 0x1FFF_FFFF && name != NO_MESSAGE {
                notes.channel(Fate::LeftOut, name, "an identifier of more than 29 bits");
                beyond.insert(name.to_owned());
            } else if (0x800..IS_EXTENDED).contains(&id) {
                let why = "an identifier above 7FF without bit 31 has 29 bits";
                notes.channel(Fate::Guessed, name, why);
            }
        }
        before = if bare.is_empty() { before } else { bare };
    }
    let mut dbc = statements::understood(&whole, &mut notes)?;
    let mut known = HashSet::new();
    dbc.messages.retain(|message| {
        let why = match message.id {
            _ if message.name == NO_MESSAGE || beyond.contains(&message.name) => None,
            id if known.insert(identifier(id)) => return true,
            _ => Some("another message has its identifier"),
        };
        if let Some(why) = why {
            notes.channel(Fate::LeftOut, &message.name, why);
        }
        false
    });
    for message in &mut dbc.messages {
        message.signals.retain(|signal| {
            let is_finite = signal.factor.is_finite() && signal.offset.is_finite();
            if !is_finite {
                let why = "its factor or offset is beyond all numbers";
                notes.channel(Fate::LeftOut, &signal.name, why);
            }
            is_finite
        });
        tell_apart(message, &mut notes);
    }
    Ok((dbc, notes))
}

/// Gives signals of one name in one message a number each.
fn tell_apart(message: &mut Message, notes: &mut Notes) {
    let names: Vec<String> = message.signals.iter().map(|signal| signal.name.clone()).collect();
    let mut taken: HashSet<String> = names.iter().cloned().collect();
    if taken.len() == names.len() {
        return;
    }
    for (i, name) in names.iter().enumerate() {
        if names.iter().filter(|other| *other == name).count() > 1 {
            let before = names[..i].iter().filter(|other| *other == name).count();
            let own = numbered(name, before + 1, &mut taken);
            let why = "another signal of the message has its name";
            notes.channel(Fate::Converted, format!("{name} to {own}"), why);
            message.signals[i].name = own;
        }
    }
}

/// The bits of a signal with its sign; none if the frame is too short.
#[must_use]
pub fn raw(signal: &Signal, data: &[u8]) -> Option<i64> {
    let size = usize::try_from(signal.size)
        .ok()
        .filter(|size| (1..=64).contains(size))?;
    let start = usize::try_from(signal.start_bit)
        .ok()
        .filter(|start| *start < 8 * data.len())?;
    // Nine bytes hold 64 bits from any bit on.
    let mut bytes = [0; 16];
    let mut copy = |from: usize| {
        let part = &data[from..data.len().min(from + 9)];
        bytes[..part.len()].copy_from_slice(part);
        bytes
    };
    // To the top, and back down with or without the sign.
    let top = match signal.byte_order {
        ByteOrder::LittleEndian => {
            if start + size > 8 * data.len() {
                return None;
            }
            let bits = (u128::from_le_bytes(copy(start / 8)) >> (start % 8)) as u64;
            bits << (64 - size)
        }
        // The start is the highest bit: byte and place in it, counted from the top of the frame.
        ByteOrder::BigEndian => {
            let first = 7 - start % 8;
            if start / 8 * 8 + first + size > 8 * data.len() {
                return None;
            }
            ((u128::from_be_bytes(copy(start / 8)) << first) >> 64) as u64
        }
    };
    Some(match signal.value_type {
        ValueType::Signed => (top as i64) >> (64 - size),
        ValueType::Unsigned => (top >> (64 - size)) as i64,
    })
}

/// A signal with what decides its value.
struct Meaning<'a> {
    signal: &'a Signal,
    float: Option<&'a SignalExtendedValueType>,
    /// The signal that switches it on, by its place in the message, and the values with which it does.
    switch: Option<(usize, Vec<RangeInclusive<u64>>)>,
}

/// The signals of a message.
fn meanings<'a>(dbc: &'a Dbc, message: &'a Message) -> Vec<Meaning<'a>> {
    let place = |name: &str| message.signals.iter().position(|signal| signal.name == name);
    let plain = |s: &Signal| s.multiplexer_indicator == MultiplexIndicator::Multiplexor;
    let first = message.signals.iter().position(plain);
    let meaning = |signal: &'a Signal| {
        let of_signal = |id: MessageId, name: &str| id == message.id && name == signal.name;
        let mut kinds = dbc.signal_extended_value_type_list.iter();
        let kind = kinds.find(|entry| of_signal(entry.message_id, &entry.signal_name));
        let mut extended = dbc.extended_multiplex.iter();
        let extended = extended.find(|entry| of_signal(entry.message_id, &entry.signal_name));
        let switch = match (extended, signal.multiplexer_indicator) {
            (Some(entry), _) => place(&entry.multiplexor_signal_name).map(|switch| {
                let ranges = entry.mappings.iter();
                (
                    switch,
                    ranges.map(|range| range.min_value..=range.max_value).collect(),
                )
            }),
            (None, MultiplexIndicator::MultiplexedSignal(value))
            | (None, MultiplexIndicator::MultiplexorAndMultiplexedSignal(value)) => {
                first.map(|switch| (switch, vec![value..=value]))
            }
            _ => None,
        };
        Meaning {
            signal,
            float: kind.map(|entry| &entry.signal_extended_value_type),
            switch,
        }
    };
    message.signals.iter().map(meaning).collect()
}

/// Whether a frame carries a signal: its switch is there and has a value with which it is. A switch may be switched itself.
fn is_carried(meanings: &[Meaning<'_>], place: usize, data: &[u8]) -> bool {
    let mut place = place;
    // A file whose switches wait for each other carries nothing.
    for _ in 0..=meanings.len() {
        let Some((switch, values)) = &meanings[place].switch else {
            return true;
        };
        let now = raw(meanings[*switch].signal, data).map(|now| now as u64);
        if !now.is_some_and(|now| values.iter().any(|range| range.contains(&now))) {
            return false;
        }
        place = *switch;
    }
    false
}

impl Meaning<'_> {
    fn value(&self, bits: i64) -> f64 {
        let number = match self.float {
            Some(SignalExtendedValueType::IEEEfloat32Bit) => f64::from(f32::from_bits(bits as u32)),
            Some(SignalExtendedValueType::IEEEdouble64bit) => f64::from_bits(bits as u64),
            _ if self.signal.value_type == ValueType::Unsigned => bits as u64 as f64,
            _ => bits as f64,
        };
        number * self.signal.factor + self.signal.offset
    }
}
