//! Bus logging in MDF 4: groups of the structure `CAN_DataFrame`, a row a frame, as ASAM names their fields.
//!
//! Read are frames whose bytes stand in the record. Bytes of varying length, which stand elsewhere, are left out by name.

use crate::bus::{BusFrame, Form};
use crate::notes::{Fate, Notes, Part};
use crate::recording::{Group, Recording};

/// The structure of a data frame, and its bytes, of which each is read as a channel of its own: `CAN_DataFrame.DataBytes.0`.
pub(super) const FRAME: &str = "CAN_DataFrame.";
pub(super) const BYTES: &str = "CAN_DataFrame.DataBytes";
/// Other structures of a bus, and what they are called.
const OTHERS: [(&str, &str); 3] = [
    ("CAN_ErrorFrame.", "error frame"),
    ("CAN_RemoteFrame.", "remote frame"),
    ("CAN_OverloadFrame.", "overload frame"),
];

/// The frames of a file and what else it holds, if it is a log of a bus.
pub(super) fn frames(recording: &Recording) -> Option<(Vec<BusFrame>, Notes)> {
    let begins = |group: &Group, name: &str| group.channels.iter().any(|c| c.name.starts_with(name));
    if !recording.groups.iter().any(|group| begins(group, BYTES)) {
        return None;
    }
    let (mut frames, mut notes) = (Vec::new(), recording.notes.clone());
    for group in &recording.groups {
        if begins(group, BYTES) {
            of_group(group, &mut frames, &mut notes);
        } else if let Some((_, why)) = OTHERS.iter().find(|(name, _)| begins(group, name)) {
            let count = group.time_s.len() as u64;
            notes.count_many(Fate::LeftOut, Part::Frame, why, count, "the file");
        } else {
            for channel in &group.channels {
                notes.channel(Fate::LeftOut, &channel.name, "beside the frames of a bus");
            }
        }
    }
    // Groups are those of a bus each: one clock orders them.
    frames.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    Some((frames, notes))
}

fn of_group(group: &Group, frames: &mut Vec<BusFrame>, notes: &mut Notes) {
    let field = |name: &str| {
        let whole = format!("{FRAME}{name}");
        let found = group.channels.iter().find(|channel| channel.name == whole);
        found.map(|channel| &channel.values[..])
    };
    let [id, bus, extended, length, sent, fd, switched, passive] = [
        "ID",
        "BusChannel",
        "IDE",
        "DataLength",
        "Dir",
        "EDL",
        "BRS",
        "ESI",
    ]
    .map(field);
    let bytes = group
        .channels
        .iter()
        .filter(|channel| channel.name.starts_with(BYTES));
    let bytes: Vec<&[f64]> = bytes.map(|channel| &channel.values[..]).collect();
    for (row, time_s) in group.time_s.iter().enumerate() {
        let number = |field: Option<&[f64]>| field.and_then(|values| values.get(row)).map_or(0.0, |v| *v);
        let is_set = |field| number(field) == 1.0;
        let wide = number(id) as u32;
        // Some writers leave the flag of 29 bits in the identifier instead.
        let frame = BusFrame {
            line: row + 1,
            time_s: *time_s,
            bus: format!("{}", number(bus) as u16),
            id: wide & 0x1FFF_FFFF,
            extended: is_set(extended) || wide >> 31 == 1,
            form: match is_set(fd) {
                true => Form::Fd {
                    switched: is_set(switched),
                    passive: is_set(passive),
                },
                false => Form::Classic,
            },
            sent: is_set(sent),
            data: bytes
                .iter()
                .take(number(length) as usize)
                .map(|values| values[row] as u8)
                .collect(),
        };
        let is_one = frame.data.len() == number(length) as usize
            && frame.data.len() <= frame.form.most_bytes()
            && (frame.extended || frame.id <= 0x7FF)
            && time_s.is_finite();
        if is_one {
            frames.push(frame);
        } else {
            notes.count(
                Fate::LeftOut,
                Part::Row,
                "no frame",
                format_args!("row {}", row + 1),
            );
        }
    }
}
