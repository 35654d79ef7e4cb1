//! The end-to-end protection of recorded frames (AUTOSAR E2E profile 2), as far as the DBC file says what it is:
//! frames with a wrong CRC are not used, and the counter tells how many were lost.
//!
//! The DBC's attributes are those of `core/haptic.dbc`: `E2EDataIds`, sixteen bytes in hexadecimal. Without them
//! nothing is checked, and the preflight says so.

use can_dbc::{AttributeValue, Dbc, Message, MessageId};
use crc::{CRC_8_AUTOSAR, Crc};

use crate::bus::BusFrame;

static CRC: Crc<u8> = Crc::<u8>::new(&CRC_8_AUTOSAR);

/// A repeater between two buses sends the very same frame again, at once, s.
const AT_ONCE_S: f64 = 1e-3;

/// Tells which of a message's frames can be used, and counts the others.
pub struct Auditor {
    name: String,
    /// The data IDs; without them nothing is checked.
    list: Option<[u8; 16]>,
    frames: usize,
    wrong_crc: usize,
    repeated: usize,
    last_s: f64,
    last: Vec<u8>,
    lost: Lost,
}

impl Auditor {
    /// Checks the frames of a message.
    #[must_use]
    pub fn of(dbc: &Dbc, message: &Message) -> Self {
        Self {
            name: message.name.clone(),
            list: data_ids(dbc, message.id),
            frames: 0,
            wrong_crc: 0,
            repeated: 0,
            last_s: f64::NEG_INFINITY,
            last: Vec::new(),
            lost: Lost::default(),
        }
    }

    /// How many frames came.
    #[must_use]
    pub const fn frames(&self) -> usize {
        self.frames
    }

    /// Whether the next frame can be used.
    pub fn takes(&mut self, frame: &BusFrame) -> bool {
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
        self.lost.take(frame.time_s, frame.data[1] & 15);
        true
    }

    /// In words: what, found, done; nothing for a message without fault.
    #[must_use]
    pub fn finding(&self) -> Option<[String; 3]> {
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
        let lost = self.lost.count();
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

/// Frames that tell how far apart they usually are.
const TELLING: usize = 1000;

/// Frames that are not there: the counter says how many modulo 16, the time says how often it went round.
#[derive(Default)]
struct Lost {
    /// The latest frames: time, s, and counter.
    frames: Vec<(f64, u8)>,
    /// Usual time between two frames, once it is known, s.
    period_s: Option<f64>,
    /// Before the latest frames.
    count: f64,
}

impl Lost {
    fn take(&mut self, time_s: f64, counter: u8) {
        self.frames.push((time_s, counter));
        if self.frames.len() > TELLING {
            let period_s = self.period_s();
            self.count += self.among_the_latest(period_s);
            self.period_s = Some(period_s);
            self.frames.drain(..TELLING);
        }
    }

    fn count(&self) -> usize {
        (self.count + self.among_the_latest(self.period_s())) as usize
    }

    fn period_s(&self) -> f64 {
        let mut steps: Vec<f64> = self.frames.windows(2).map(|w| w[1].0 - w[0].0).collect();
        let middle = steps.len() / 2;
        match self.period_s {
            None if !steps.is_empty() => *steps.select_nth_unstable_by(middle, f64::total_cmp).1,
            known => known.unwrap_or_default(),
        }
    }

    fn among_the_latest(&self, period_s: f64) -> f64 {
        let lost = |w: &[(f64, u8)]| {
            let counted = f64::from(w[1].1.wrapping_sub(w[0].1) & 15);
            // No period is shorter: stamps may be equal.
            let by_time = (w[1].0 - w[0].0) / period_s.max(1e-6);
            let rounds = ((by_time - counted) / 16.0).round().max(0.0);
            (counted + 16.0 * rounds - 1.0).max(0.0)
        };
        self.frames.windows(2).map(lost).sum()
    }
}
