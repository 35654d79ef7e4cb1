//! The receivers, as docs/reference/bus.md and the time-outs of docs/explanation/plausibility.md have them: frames decoded and
//! checked here a second time, time in microseconds that do not wrap.

use haptic_core::bus::{Frame, Reject};
use haptic_core::controller::inputs::Input;
use haptic_core::safety::faults::{Fault, FaultSet};

use super::motor::MotorCheck;
use super::{exceeds, per_second};

/// docs/reference/bus.md and core/haptic.dbc: the list of data IDs; each message XORs it with a constant.
const DATA_IDS: [u8; 16] = [
    0xD9, 0xAD, 0xC1, 0x0B, 0x75, 0xF8, 0xE0, 0x7C, 0x7A, 0xE6, 0xAE, 0x92, 0x9B, 0x3E, 0xEA, 0x5E,
];
const OWN: [u16; 8] = [0x0C0, 0x0D0, 0x300, 0x310, 0x320, 0x330, 0x340, 0x350];

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Lane {
    pub(crate) e_y: f64,
    pub(crate) e_theta: f64,
    pub(crate) at: i64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Column {
    pub(crate) driver: f64,
    pub(crate) wheel: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Motion {
    pub(crate) speeds: [f64; 2],
    pub(crate) yaw_rate: Option<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Request {
    pub(crate) engage: bool,
    pub(crate) authority: f64,
    pub(crate) probe: bool,
}

/// The CRC of profile 2, bit by bit.
fn crc8(bytes: impl Iterator<Item = u8>) -> u8 {
    let step = |crc: u8, byte: u8| {
        (0..8).fold(crc ^ byte, |crc, _| {
            if crc & 0x80 != 0 {
                crc << 1 ^ 0x2F
            } else {
                crc << 1
            }
        })
    };
    !bytes.fold(0xFF, step)
}

/// A word with CRC and counter.
pub(crate) fn protected(word: u64, constant: u8, counter: u32) -> [u8; 8] {
    let counter = counter as u8 & 15;
    let mut bytes = (word | u64::from(counter) << 8).to_le_bytes();
    let id = DATA_IDS[usize::from(counter)] ^ constant;
    bytes[0] = crc8(bytes[1..].iter().copied().chain([id]));
    bytes
}

fn unsigned(word: u64, start: u32, bits: u32) -> i64 {
    (word >> start & ((1 << bits) - 1)) as i64
}

fn signed(word: u64, start: u32, bits: u32) -> i64 {
    (word << (64 - start - bits)) as i64 >> (64 - bits)
}

/// How a sender counts: the time that it has left for counts, its mean time between two, and what speaks for a second one.
#[derive(Debug, Clone, Default)]
struct Counting {
    at: i64,
    left_us: i64,
    pace_us: i64,
    last: [u8; 8],
    skipped: bool,
    against: i64,
    distrust: i64,
}

impl Counting {
    /// So many counts on; `false` where there is no time for them.
    fn count(&mut self, ahead: i64, now: i64, [fastest_us, slowest_us]: [i64; 2]) -> bool {
        let each_us = fastest_us.max(self.pace_us / 2);
        let left_us = self.left_us + (now - self.at) - ahead * each_us;
        if left_us < 0 {
            return false;
        }
        self.left_us = left_us.min(12 * each_us);
        let apart_us = ((now - self.at) / ahead).min(slowest_us);
        self.pace_us = self.pace_us - self.pace_us / 32 + apart_us / 32;
        self.at = now;
        true
    }
}

/// One sender.
#[derive(Debug, Clone)]
struct Sender<T> {
    constant: u8,
    fastest_us: i64,
    slowest_us: i64,
    counting: Counting,
    counter: Option<u8>,
    clean: u32,
    value: Option<T>,
    is_new: bool,
    at: i64,
    period_us: i64,
    /// What is not well: the last lane was not valid (1), or a step (2); or how many speeds stepped in a row.
    doubt: i64,
}

impl<T: Copy> Sender<T> {
    fn new(constant: u8, [fastest_us, slowest_us]: [i64; 2], now: i64) -> Self {
        Self {
            constant,
            fastest_us,
            slowest_us,
            counting: Counting::default(),
            counter: None,
            clean: 0,
            value: None,
            is_new: false,
            at: now,
            period_us: 0,
            doubt: 0,
        }
    }

    fn accept(
        &mut self,
        frame: &Frame,
        now: i64,
        is_in_range: impl Fn(u64) -> bool,
        most: i64,
    ) -> Result<u64, Reject> {
        let data: [u8; 8] = frame.data().try_into().map_err(|_| Reject::Length)?;
        let word = u64::from_le_bytes(data);
        let is_trusted = self.clean >= 3;
        if !is_in_range(word) && !is_trusted {
            return Err(Reject::Range);
        }
        let counter = data[1] & 15;
        if data != protected(word & !0xFFF, self.constant, counter.into()) {
            return Err(Reject::Crc);
        }
        let ahead = self.counter.map(|last| i64::from((counter + 16 - last) % 16));
        let periods_us = [self.fastest_us, self.slowest_us];
        let counting = &mut self.counting;
        let mut is_one_too_many = false;
        match ahead {
            None => {
                (counting.at, counting.pace_us) = (now, self.fastest_us);
                (counting.left_us, counting.last, counting.skipped) = (12 * self.fastest_us, data, false);
            }
            Some(ahead) if 0 < ahead && ahead <= most => {
                if !counting.count(ahead, now, periods_us) {
                    counting.distrust = if counting.distrust > 0 { 128 } else { 0 };
                    return Err(Reject::TooFast);
                }
                (counting.last, counting.skipped) = (data, ahead > 1);
                counting.against = (counting.against - 1).max(0);
                counting.distrust = (counting.distrust - 1).max(0);
            }
            Some(0) if data == counting.last => counting.skipped = false,
            Some(15) if counting.skipped => counting.skipped = false,
            Some(ahead)
                if ahead > 0 && ahead * self.fastest_us.max(counting.pace_us / 2) <= now - counting.at =>
            {
                counting.skipped = false;
            }
            Some(_) => {
                counting.against += 8;
                is_one_too_many = counting.against >= 128;
                if is_one_too_many {
                    counting.against = 0;
                }
                if is_one_too_many || counting.distrust > 0 {
                    counting.distrust = 128;
                }
            }
        }
        let is_distrusted = counting.distrust > 0;
        if is_one_too_many {
            (self.value, self.doubt) = (None, 0);
        }
        let judged = if is_trusted {
            match ahead {
                Some(0) => Err(Reject::Repeated),
                Some(ahead) if ahead > most => Err(Reject::Jump),
                _ => Ok(()),
            }
        } else {
            self.clean = if ahead == Some(1) { self.clean + 1 } else { 1 };
            if self.clean < 3 {
                Err(Reject::NotTrusted)
            } else {
                Ok(())
            }
        };
        if !is_trusted || judged.is_ok() {
            self.counter = Some(counter);
        }
        if is_one_too_many {
            (self.clean, self.counter) = (0, None);
        }
        judged?;
        if !is_in_range(word) {
            Err(Reject::Range)
        } else if is_distrusted {
            Err(Reject::TwoSenders)
        } else {
            Ok(word)
        }
    }

    fn put(&mut self, value: T, now: i64) {
        let apart = (now - self.at).min(self.slowest_us);
        let period = if self.value.is_none() {
            self.slowest_us
        } else if self.period_us >= self.slowest_us {
            apart.max(self.slowest_us / 4)
        } else if apart > self.period_us {
            apart
        } else {
            self.period_us - (self.period_us - apart) / 64
        };
        self.period_us = period.max(10_000);
        (self.value, self.is_new, self.at) = (Some(value), true, now);
    }

    fn take(&mut self, now: i64) -> Input<T> {
        let Some(value) = self.value else {
            return Input::Lost;
        };
        if now - self.at > 3 * self.period_us {
            (self.value, self.clean, self.counter) = (None, 0, None);
            Input::Lost
        } else if core::mem::take(&mut self.is_new) {
            Input::New(value)
        } else {
            Input::Held(value)
        }
    }
}

#[derive(Debug, Clone)]
pub(crate) struct Receivers {
    lane: Sender<Lane>,
    column: Sender<Column>,
    motion: Sender<Motion>,
    request: Sender<Request>,
    pub(crate) motor: MotorCheck,
    foreign: u32,
    at_most: f64,
    used_in_a_row: u32,
}

/// What a step reads.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Seen {
    pub(crate) lane: Input<Lane>,
    pub(crate) column: Input<Column>,
    pub(crate) motion: Input<Motion>,
    pub(crate) request: Input<Request>,
    pub(crate) faults: FaultSet,
}

impl Receivers {
    pub(crate) fn new(now: i64) -> Self {
        Self {
            lane: Sender::new(0x11, [4000, 66_667], now),
            column: Sender::new(0x22, [800, 20_000], now),
            motion: Sender::new(0x33, [4000, 25_000], now),
            request: Sender::new(0x44, [4000, 25_000], now),
            motor: MotorCheck::default(),
            foreign: 0,
            at_most: 0.0,
            used_in_a_row: 0,
        }
    }

    /// Every sender is trusted from its first frame on.
    pub(crate) fn trust_all(&mut self) {
        (self.lane.clean, self.column.clean) = (3, 3);
        (self.motion.clean, self.request.clean) = (3, 3);
    }

    pub(crate) fn receive(&mut self, frame: &Frame, now: i64) -> Result<(), Reject> {
        match frame.id() {
            0x100 => self.receive_lane(frame, now),
            0x110 => {
                let silence = self.column.value.map_or(0, |_| now - self.column.at);
                let fields = |word| (signed(word, 12, 18), signed(word, 30, 18), signed(word, 48, 16));
                let in_range = |word| {
                    let (driver, wheel, motor) = fields(word);
                    driver.abs() <= 20 * 4096 && wheel.abs() <= 72_000 && motor.abs() <= 32_767
                };
                let word = self
                    .column
                    .accept(frame, now, in_range, (silence / 2000 + 3).min(14))?;
                let (driver, wheel, motor) = fields(word);
                let column = Column {
                    driver: driver as f64 / 4096.0,
                    wheel: (wheel as f64 / 100.0).to_radians(),
                };
                self.column.put(column, now);
                self.motor.deliver(motor as f64 / 4096.0);
                Ok(())
            }
            0x120 => {
                let heard = self.receive_motion(frame, now);
                if heard.is_err() {
                    self.used_in_a_row = 0;
                }
                heard
            }
            0x130 => {
                let in_range = |word| unsigned(word, 13, 8) <= 128;
                let word = self.request.accept(frame, now, in_range, 3)?;
                let request = Request {
                    engage: unsigned(word, 12, 1) == 1,
                    authority: unsigned(word, 13, 8) as f64 / 128.0,
                    probe: unsigned(word, 21, 1) == 1,
                };
                self.request.put(request, now);
                Ok(())
            }
            id if OWN.contains(&id) => {
                self.foreign = 1000;
                Err(Reject::OwnIdentifier)
            }
            _ => Ok(()),
        }
    }

    fn receive_lane(&mut self, frame: &Frame, now: i64) -> Result<(), Reject> {
        let in_range = |word| signed(word, 12, 17).abs() <= 32_768 && signed(word, 29, 17).abs() <= 32_768;
        let word = self.lane.accept(frame, now, in_range, 3)?;
        self.lane.doubt = i64::from(unsigned(word, 55, 1) == 0);
        if self.lane.doubt == 1 {
            return Ok(());
        }
        let age_us = 100 * (unsigned(word, 46, 9) + 512 * unsigned(word, 56, 2));
        let lane = Lane {
            e_y: signed(word, 12, 17) as f64 / 8192.0,
            e_theta: signed(word, 29, 17) as f64 / 65_536.0,
            at: now - age_us,
        };
        if let Some(last) = self.lane.value {
            if lane.at < last.at {
                return Err(Reject::Older);
            }
            if !follows(&last, &lane) {
                self.lane.doubt = 2;
                return Err(Reject::Step);
            }
        }
        if age_us > 150_000 {
            return Err(Reject::Older);
        }
        self.lane.put(lane, now);
        Ok(())
    }

    fn receive_motion(&mut self, frame: &Frame, now: i64) -> Result<(), Reject> {
        let is_measured = |word| unsigned(word, 58, 1) == 1;
        let in_range = |word| {
            let speeds = [signed(word, 12, 16), signed(word, 28, 16)];
            speeds.iter().all(|v| (0..=90 * 256).contains(v))
                && (!is_measured(word) || signed(word, 44, 14).abs() <= 8191)
        };
        let word = self.motion.accept(frame, now, in_range, 3)?;
        let speeds = [12, 28].map(|start| signed(word, start, 16) as f64 / 256.0);
        let speeds = self.followed(speeds).ok_or(Reject::Step)?;
        let braked = per_second(12.0, now - self.motion.at);
        self.at_most = speeds[0].max(speeds[1]).max(self.at_most - braked);
        self.used_in_a_row += 1;
        let yaw_rate = is_measured(word).then(|| signed(word, 44, 14) as f64 / 4096.0);
        self.motion.put(Motion { speeds, yaw_rate }, now);
        Ok(())
    }

    /// A speed that steps by more than 1 m/s goes with the other, unless both are now within 2 m/s; two are held, and may then be
    /// left behind by 12 m/s2.
    fn followed(&mut self, speeds: [f64; 2]) -> Option<[f64; 2]> {
        let Some(Motion { speeds: last, .. }) = self.motion.value else {
            self.motion.doubt = 0;
            return Some(speeds);
        };
        let moved = [speeds[0] - last[0], speeds[1] - last[1]];
        let held_us = self.motion.doubt * self.motion.period_us;
        let steps = |most: f64| moved.map(|moved| exceeds(moved.abs(), most));
        let agree = exceeds(2.0, (speeds[0] - speeds[1]).abs());
        let steps = match steps(1.0) {
            [true, true] => steps(1.0 + per_second(12.0, held_us)),
            one => one,
        };
        let both_step = steps == [true; 2];
        if steps == [false; 2] || (agree && !both_step) {
            self.motion.doubt = 0;
            return Some(speeds);
        }
        let followed = match steps {
            _ if both_step => last,
            [false, _] => [speeds[0], last[1] + moved[0]],
            _ => [last[0] + moved[1], speeds[1]],
        };
        self.motion.doubt += 1;
        (self.motion.doubt * self.motion.period_us <= 300_000).then_some(followed)
    }

    /// Both speeds at most 0.25 m/s, as slow as brakes allow, and a hundred messages in a row used.
    pub(crate) fn stands(&self) -> bool {
        self.motion.value.is_some() && !exceeds(self.at_most, 0.25) && self.used_in_a_row >= 100
    }

    pub(crate) fn take(&mut self, now: i64) -> Seen {
        let mut seen = Seen {
            lane: self.lane.take(now),
            column: self.column.take(now),
            motion: self.motion.take(now),
            request: self.request.take(now),
            faults: FaultSet::NONE,
        };
        if matches!(seen.lane, Input::Lost) {
            seen.faults.insert_if(self.lane.doubt == 1, Fault::LaneInvalid);
            seen.faults.insert_if(self.lane.doubt == 2, Fault::LaneStep);
        }
        let is_lost = matches!(seen.motion, Input::Lost);
        seen.faults
            .insert_if(is_lost && self.motion.doubt > 0, Fault::SpeedStep);
        seen.faults.insert_if(self.foreign > 0, Fault::OwnIdentifier);
        self.foreign = self.foreign.saturating_sub(1);
        seen
    }
}

/// Whether a picture is within 0.3 m and 0.1 rad of another.
pub(crate) fn follows(last: &Lane, new: &Lane) -> bool {
    !exceeds((new.e_y - last.e_y).abs(), 0.3) && !exceeds((new.e_theta - last.e_theta).abs(), 0.1)
}
