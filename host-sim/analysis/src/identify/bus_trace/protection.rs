//! The end-to-end protection of the frames of a trace (AUTOSAR E2E profile 2), as far as the DBC file says what it is:
//! frames with a wrong CRC are not used, and the counter tells how many were lost.
//!
//! The DBC's attributes are those of `core/haptic.dbc`: `E2EDataIds`, sixteen bytes in hexadecimal. Without them
//! nothing is checked, and the preflight says so.

use can_dbc::{AttributeValue, Dbc, Message, MessageId};
use crc::{CRC_8_AUTOSAR, Crc};
use haptic_log::bus::BusFrame;

static CRC: Crc<u8> = Crc::<u8>::new(&CRC_8_AUTOSAR);

/// A repeater between two buses sends the very same frame again, at once, s.
const AT_ONCE_S: f64 = 1e-3;

/// Tells which of a message's frames can be used, and counts the others.
pub(super) struct Auditor {
    name: String,
    /// The data IDs; without them nothing is checked.
    list: Option<[u8; 16]>,
    frames: usize,
    wrong_crc: usize,
    repeated: usize,
    last_s: f64,
    last: Vec<u8>,
    /// Of the frames that are used.
    counters: Vec<u8>,
}

impl Auditor {
    /// Of the frames of a message.
    pub(super) fn of(dbc: &Dbc, message: &Message) -> Self {
        Self {
            name: message.name.clone(),
            list: data_ids(dbc, message.id),
            frames: 0,
            wrong_crc: 0,
            repeated: 0,
            last_s: f64::NEG_INFINITY,
            last: Vec::new(),
            counters: Vec::new(),
        }
    }

    /// How many frames came.
    pub(super) const fn frames(&self) -> usize {
        self.frames
    }

    /// Whether the next frame can be used.
    pub(super) fn takes(&mut self, frame: &BusFrame) -> bool {
        self.frames += 1;
        let Some(list) = &self.list else {
            return true;
        };
        let is_intact = matches!(frame.data[..], [crc, b1, b2, b3, b4, b5, b6, b7]
            if crc == CRC.checksum(&[b1, b2, b3, b4, b5, b6, b7, list[usize::from(b1 & 15)]]));
        if !is_intact {
            self.wrong_crc += 1;
            return false;
        }
        if self.last == frame.data && frame.time_s - self.last_s < AT_ONCE_S {
            self.repeated += 1;
            return false;
        }
        self.last_s = frame.time_s;
        self.last.clone_from(&frame.data);
        self.counters.push(frame.data[1] & 15);
        true
    }

    /// In words: what, found, done; nothing for a message without fault. The times are those of the frames that are used.
    pub(super) fn finding(&self, time_s: &[f64]) -> Option<[String; 3]> {
        let Self {
            name,
            frames,
            wrong_crc,
            repeated,
            ..
        } = self;
        if self.list.is_none() {
            let found = format!("{frames} frames without known protection");
            return Some([name.clone(), found, "used unchecked".to_owned()]);
        }
        let lost = lost(time_s, &self.counters);
        (wrong_crc + repeated + lost > 0).then(|| {
            [
                name.clone(),
                format!("of {frames} frames {wrong_crc} with a wrong CRC, {repeated} repeated; {lost} lost"),
                "not used; pauses bridged if short, else cut".to_owned(),
            ]
        })
    }
}

fn data_ids(dbc: &Dbc, id: MessageId) -> Option<[u8; 16]> {
    let attribute = dbc
        .attribute_values_message
        .iter()
        .find(|a| a.name == "E2EDataIds" && a.message_id == id)?;
    let AttributeValue::String(text) = &attribute.value else {
        return None;
    };
    let bytes: Option<Vec<u8>> = text
        .split_whitespace()
        .map(|b| u8::from_str_radix(b, 16).ok())
        .collect();
    bytes?.try_into().ok()
}

/// Frames that are not there: the counter says how many modulo 16, the time says how often it went round.
fn lost(time_s: &[f64], counters: &[u8]) -> usize {
    let mut steps: Vec<f64> = time_s.windows(2).map(|w| w[1] - w[0]).collect();
    if steps.is_empty() {
        return 0;
    }
    let middle = steps.len() / 2;
    let (_, &mut period, _) = steps.select_nth_unstable_by(middle, f64::total_cmp);
    let pairs = time_s.windows(2).zip(counters.windows(2));
    let sum: f64 = pairs
        .map(|(t, n)| {
            let counted = f64::from(n[1].wrapping_sub(n[0]) & 15);
            let by_time = (t[1] - t[0]) / period.max(1e-6);
            let rounds = ((by_time - counted) / 16.0).round().max(0.0);
            (counted + 16.0 * rounds - 1.0).max(0.0)
        })
        .sum();
    sum as usize
}
