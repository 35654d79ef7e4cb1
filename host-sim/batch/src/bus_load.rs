//! How full the bus is at worst: every message at its period, every stuff bit that can occur.
//!
//! A classic frame with an 11-bit identifier and n data bytes is at most `47 + 8n + (34 + 8n - 1)/4` bits long,
//! interframe space included (Davis, Burns, Bril, Lukkien 2007: *Controller Area Network schedulability
//! analysis: refuted, revisited and revised*, Real-Time Systems 35, equation 1).

use haptic_core::bus::messages::{MESSAGES, Message, ParameterUnlock, ParameterWrite};
use haptic_secoc::messages::{OFFER_ID, PROVEN, Place, STATUS_ID};
use serde::Serialize;

/// Bit rate of the bus.
pub const BIT_RATE: f64 = 500_000.0;
/// Largest load that leaves room for what else a vehicle's bus carries.
pub const MAX_LOAD: f64 = 0.6;

/// One message of the bus.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MessageLoad {
    /// Name in the DBC file.
    pub message: String,
    /// CAN identifier.
    pub id: u16,
    /// Shortest time between two frames, ms.
    pub period_ms: f64,
    /// Longest frame, bits.
    pub bits: u32,
    /// Share of the bus.
    pub load: f64,
    /// It writes parameters, which is done in Standby alone.
    pub in_standby: bool,
}

/// Longest classic frame with an 11-bit identifier, bits, interframe space included.
#[must_use]
pub fn worst_case_bits(data_bytes: u32) -> u32 {
    47 + 8 * data_bytes + (34 + 8 * data_bytes - 1) / 4
}

/// Milliseconds between two questions of a sender: it is told every so often that it is waited for, as often as the ECU's status comes.
const QUESTION_MS: f64 = 100.0;
/// Milliseconds between two offers.
const OFFER_MS: f64 = 50.0;

fn row(name: String, id: u16, period_ms: f64, bytes: u32, in_standby: bool) -> MessageLoad {
    let bits = worst_case_bits(bytes);
    MessageLoad {
        message: name,
        id,
        period_ms,
        bits,
        load: f64::from(bits) / (period_ms * 1e-3 * BIT_RATE),
        in_standby,
    }
}

fn writes(id: u16) -> bool {
    [ParameterWrite::ID, ParameterUnlock::ID].contains(&id)
}

/// Every message of a vehicle's bus, most urgent first.
#[must_use]
pub fn table() -> Vec<MessageLoad> {
    let messages = MESSAGES.iter();
    messages
        .map(|message| {
            row(
                message.name.into(),
                message.id,
                message.period_ms,
                8,
                writes(message.id),
            )
        })
        .collect()
}

/// Messages with what authentication adds (`core/secoc/authentication.dbc`), every sender asking for an epoch all the time.
#[must_use]
pub fn table_with_proofs() -> Vec<MessageLoad> {
    let mut rows = table();
    for proven in PROVEN {
        let (name, writes) = (proven.info.name, writes(proven.info.id));
        if let Place::Behind(id) = proven.place {
            rows.push(row(format!("{name}Proof"), id, proven.info.period_ms, 4, writes));
        }
        rows.push(row(
            format!("{name}Question"),
            proven.question,
            QUESTION_MS,
            4,
            writes,
        ));
    }
    rows.push(row("Offer".into(), OFFER_ID, OFFER_MS, 8, false));
    rows.push(row("Authentication".into(), STATUS_ID, QUESTION_MS, 8, false));
    rows.sort_by_key(|row| row.id);
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_frame_has_at_most_135_bits_and_the_bus_is_no_fuller_than_it_may_be() {
        // 135 for eight bytes and 55 for none are the published figures.
        assert_eq!((worst_case_bits(8), worst_case_bits(0)), (135, 55));
        let load: f64 = table().iter().map(|row| row.load).sum();
        assert!(load <= MAX_LOAD, "{load}");
        // By hand: (1000 + 10 + 120 + 500 + 100 + 100 + 100 + 1 + 10 + 50 + 1 + 10 + 10 + 1) * 135 / 500,000.
        assert!((load - 0.54351).abs() < 1e-9, "{load}");
    }
    /// By the lengths that the DBC file says, and by hand: while nobody writes parameters there are a lane's and a vehicle's proofs, three
    /// questions, an offer and a status beside all other messages.
    #[test]
    fn proofs_leave_the_room_that_the_bus_has_to_have_while_it_drives() {
        let file = include_str!("../../../core/secoc/authentication.dbc");
        let described = file.lines().filter_map(|line| {
            let words: Vec<_> = line.strip_prefix("BO_ ")?.split([' ', ':']).collect();
            let [id, name, "", bytes, _] = words[..] else {
                return None;
            };
            Some((
                name.to_owned(),
                id.parse::<u16>().unwrap(),
                worst_case_bits(bytes.parse().unwrap()),
            ))
        });
        let mut described: Vec<_> = described.filter(|(name, ..)| name != "Request").collect();
        described.sort();
        let rows = table_with_proofs();
        let own = table();
        let added = rows.iter().filter(|row| !own.iter().any(|own| own.id == row.id));
        let mut added: Vec<_> = added.map(|row| (row.message.clone(), row.id, row.bits)).collect();
        added.sort();
        assert_eq!(added, described);
        let driving: f64 = rows
            .iter()
            .filter(|row| !row.in_standby)
            .map(|row| row.load)
            .sum();
        assert!(driving <= MAX_LOAD, "{driving}");
        let by_hand = 0.54351 - 101.0 * 135.0 / 5e5 + (220.0 + 30.0) * 95.0 / 5e5 + 30.0 * 135.0 / 5e5;
        assert!((driving - by_hand).abs() < 1e-9, "{driving}, {by_hand}");
        let all: f64 = rows.iter().map(|row| row.load).sum();
        let by_hand = by_hand + 101.0 * (135.0 + 95.0) / 5e5 + 20.0 * 95.0 / 5e5;
        assert!((all - by_hand).abs() < 1e-9, "{all}, {by_hand}");
    }
}
