//! What frames mean: a DBC file's signals as channels, one group for each message.

use std::collections::HashMap;

use can_dbc::{
    ByteOrder, Dbc, Message, MessageId, MultiplexIndicator, Signal, SignalExtendedValueType, ValueType,
};

use crate::candump::CandumpFrame;
use crate::recording::{Group, Recording, RecordingError, Series};

/// Identifier of a message, and whether it has 29 bits.
#[must_use]
pub const fn identifier(id: MessageId) -> (u32, bool) {
    match id {
        MessageId::Standard(id) => (id as u32, false),
        MessageId::Extended(id) => (id, true),
    }
}

/// The bits of a signal with its sign; none if the frame is too short.
#[must_use]
pub fn raw(signal: &Signal, data: &[u8]) -> Option<i64> {
    let size = u32::try_from(signal.size)
        .ok()
        .filter(|size| (1..=64).contains(size))?;
    let start = u32::try_from(signal.start_bit).ok().filter(|start| *start < 64)?;
    let mut bytes = [0; 8];
    bytes.get_mut(..data.len())?.copy_from_slice(data);
    // To the top, and back down with or without the sign.
    let top = match signal.byte_order {
        ByteOrder::LittleEndian => {
            let end = start + size;
            if end > 64 || end as usize > 8 * data.len() {
                return None;
            }
            u64::from_le_bytes(bytes) << (64 - end)
        }
        // The start is the highest bit: byte and place in it, counted from the top of the frame.
        ByteOrder::BigEndian => {
            let first = start / 8 * 8 + (7 - start % 8);
            if first + size > 64 || (first + size) as usize > 8 * data.len() {
                return None;
            }
            u64::from_be_bytes(bytes) << first
        }
    };
    Some(match signal.value_type {
        ValueType::Signed => (top as i64) >> (64 - size),
        ValueType::Unsigned => (top >> (64 - size)) as i64,
    })
}

/// Every message of the DBC file that is among the frames, its signals in the file's units. A signal that a frame does not
/// carry (multiplexed) is NaN there.
///
/// # Errors
/// A DBC file that cannot be read; a frame that is too short for its signals, with its line; no message that is known.
pub fn channels(frames: &[CandumpFrame], dbc: &str) -> Result<Recording, RecordingError> {
    let dbc =
        Dbc::try_from(dbc).map_err(|e| RecordingError(format!("the DBC file is not understood: {e}")))?;
    let mut heard: HashMap<(u32, bool), Vec<&CandumpFrame>> = HashMap::new();
    for frame in frames {
        heard.entry((frame.id, frame.extended)).or_default().push(frame);
    }
    let mut groups = Vec::new();
    for message in &dbc.messages {
        let Some(frames) = heard.get(&identifier(message.id)) else {
            continue;
        };
        let signals = message.signals.iter();
        let channels = signals.map(|signal| series(&dbc, message, signal, frames));
        groups.push(Group {
            name: message.name.clone(),
            time_s: frames.iter().map(|frame| frame.time_s).collect(),
            channels: channels.collect::<Result<_, _>>()?,
            ..Group::default()
        });
    }
    if groups.is_empty() {
        let count = frames.len();
        return Err(format!("none of the {count} frames is a message of the DBC file").into());
    }
    Ok(groups.into())
}

fn series(
    dbc: &Dbc,
    message: &Message,
    signal: &Signal,
    frames: &[&CandumpFrame],
) -> Result<Series, RecordingError> {
    let mut kinds = dbc.signal_extended_value_type_list.iter();
    let kind = kinds.find(|entry| entry.message_id == message.id && entry.signal_name == signal.name);
    let float = kind.map(|entry| &entry.signal_extended_value_type);
    let mut signals = message.signals.iter();
    let switch = signals.find(|s| s.multiplexer_indicator == MultiplexIndicator::Multiplexor);
    let wanted = match signal.multiplexer_indicator {
        MultiplexIndicator::MultiplexedSignal(wanted)
        | MultiplexIndicator::MultiplexorAndMultiplexedSignal(wanted) => Some(wanted),
        _ => None,
    };
    let value = |frame: &CandumpFrame| -> Result<f64, RecordingError> {
        if let (Some(wanted), Some(switch)) = (wanted, switch)
            && raw(switch, &frame.data).is_none_or(|now| now as u64 != wanted)
        {
            return Ok(f64::NAN);
        }
        let bits = raw(signal, &frame.data).ok_or_else(|| {
            let (line, id, length, name) = (frame.line, frame.id, frame.data.len(), &signal.name);
            format!("line {line}: frame {id:03X} has {length} bytes, too few for {name}")
        })?;
        let number = match float {
            Some(SignalExtendedValueType::IEEEfloat32Bit) => f64::from(f32::from_bits(bits as u32)),
            Some(SignalExtendedValueType::IEEEdouble64bit) => f64::from_bits(bits as u64),
            _ if signal.value_type == ValueType::Unsigned => bits as u64 as f64,
            _ => bits as f64,
        };
        Ok(number * signal.factor + signal.offset)
    };
    let values = frames.iter().map(|frame| value(frame));
    Ok(Series {
        name: signal.name.clone(),
        unit: signal.unit.clone(),
        source: message.transmitter.clone().unwrap_or_default(),
        values: values.collect::<Result<_, _>>()?,
    })
}
