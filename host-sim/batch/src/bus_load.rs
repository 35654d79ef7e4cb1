//! How full the bus is at worst: every message at its period, every stuff bit that can occur.
//!
//! A classic frame with an 11-bit identifier and n data bytes is at most `47 + 8n + (34 + 8n - 1)/4` bits long,
//! interframe space included (Davis, Burns, Bril, Lukkien 2007: *Controller Area Network schedulability
//! analysis: refuted, revisited and revised*, Real-Time Systems 35, equation 1).

use haptic_core::bus::messages::MESSAGES;
use serde::Serialize;

/// Bit rate of the bus.
pub const BIT_RATE: f64 = 500_000.0;
/// Largest load that leaves room for what else a vehicle's bus carries.
pub const MAX_LOAD: f64 = 0.6;

/// One message of the bus.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MessageLoad {
    /// Name in the DBC file.
    pub message: &'static str,
    /// CAN identifier.
    pub id: u16,
    /// Shortest time between two frames, ms.
    pub period_ms: f64,
    /// Longest frame, bits.
    pub bits: u32,
    /// Share of the bus.
    pub load: f64,
}

/// Longest classic frame with an 11-bit identifier, bits, interframe space included.
#[must_use]
pub fn worst_case_bits(data_bytes: u32) -> u32 {
    47 + 8 * data_bytes + (34 + 8 * data_bytes - 1) / 4
}

/// Every message of a vehicle's bus, most urgent first.
#[must_use]
pub fn table() -> Vec<MessageLoad> {
    let bits = worst_case_bits(8);
    MESSAGES
        .iter()
        .map(|message| MessageLoad {
            message: message.name,
            id: message.id,
            period_ms: message.period_ms,
            bits,
            load: f64::from(bits) / (message.period_ms * 1e-3 * BIT_RATE),
        })
        .collect()
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
}
