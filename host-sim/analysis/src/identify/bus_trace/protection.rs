//! The end-to-end protection of the frames of a trace (AUTOSAR E2E profile 2), as far as the DBC file says what it is:
//! frames with a wrong CRC are not used, and the counter tells how many were lost.
//!
//! The DBC's attributes are those of `core/haptic.dbc`: `E2EDataIds`, sixteen bytes in hexadecimal. Without them
//! nothing is checked, and the preflight says so.

use can_dbc::{AttributeValue, Dbc, MessageId};
use crc::{CRC_8_AUTOSAR, Crc};
use haptic_log::candump::CandumpFrame;

static CRC: Crc<u8> = Crc::<u8>::new(&CRC_8_AUTOSAR);

/// What became of one message's frames.
#[derive(Debug, Clone, Default)]
pub(super) struct Audit {
    pub name: String,
    pub frames: usize,
    pub wrong_crc: usize,
    pub repeated: usize,
    pub lost: usize,
    pub checked: bool,
}

impl Audit {
    /// In words: what, found, done; nothing for a message without fault.
    pub(super) fn finding(&self) -> Option<[String; 3]> {
        let Self {
            name,
            frames,
            wrong_crc,
            repeated,
            lost,
            checked,
        } = self;
        if !checked {
            let found = format!("{frames} frames without known protection");
            return Some([name.clone(), found, "used unchecked".to_owned()]);
        }
        (wrong_crc + repeated + lost > 0).then(|| {
            [
                name.clone(),
                format!("of {frames} frames {wrong_crc} with a wrong CRC, {repeated} repeated; {lost} lost"),
                "not used; pauses bridged if short, else cut".to_owned(),
            ]
        })
    }
}

/// The frames of the message that can be used, and what became of the others.
pub(super) fn audited<'a>(
    dbc: &Dbc,
    id: MessageId,
    name: &str,
    frames: impl Iterator<Item = &'a CandumpFrame>,
) -> (Vec<&'a CandumpFrame>, Audit) {
    let list = data_ids(dbc, id);
    let mut audit = Audit {
        name: name.to_owned(),
        checked: list.is_some(),
        ..Audit::default()
    };
    let mut good: Vec<&CandumpFrame> = Vec::new();
    for frame in frames {
        audit.frames += 1;
        if let Some(list) = &list {
            let intact = matches!(frame.data[..], [crc, b1, b2, b3, b4, b5, b6, b7]
                if crc == CRC.checksum(&[b1, b2, b3, b4, b5, b6, b7, list[usize::from(b1 & 15)]]));
            if !intact {
                audit.wrong_crc += 1;
                continue;
            }
            // A repeater between two buses sends the very same frame again, at once.
            if good
                .last()
                .is_some_and(|last| last.data == frame.data && frame.time_s - last.time_s < 1e-3)
            {
                audit.repeated += 1;
                continue;
            }
        }
        good.push(frame);
    }
    if list.is_some() {
        audit.lost = lost(&good);
    }
    (good, audit)
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
fn lost(frames: &[&CandumpFrame]) -> usize {
    let mut steps: Vec<f64> = frames.windows(2).map(|w| w[1].time_s - w[0].time_s).collect();
    if steps.is_empty() {
        return 0;
    }
    let middle = steps.len() / 2;
    let (_, &mut period, _) = steps.select_nth_unstable_by(middle, f64::total_cmp);
    let sum: f64 = frames
        .windows(2)
        .map(|w| {
            let counted = f64::from((w[1].data[1].wrapping_sub(w[0].data[1])) & 15);
            let by_time = (w[1].time_s - w[0].time_s) / period.max(1e-6);
            let rounds = ((by_time - counted) / 16.0).round().max(0.0);
            (counted + 16.0 * rounds - 1.0).max(0.0)
        })
        .sum();
    sum as usize
}
