//! What is read, the codes of faults, and security access.

use automotive_diag::uds::UdsError;
use haptic_core::bus::messages::VERSION;
use haptic_core::safety::faults::Fault;

use super::{Lock, Now, Reply, Server, none, one_of};
use crate::data::{Datum, Entry, Heard, Value, parameter_of};
use crate::security::{BYTES, MOST_WRONG, is_answer, mac};
use crate::trouble::{
    ALL, AVAILABLE, Attempts, Cells, Record, Snapshot, code_of, fault_of, keep_attempts, record,
};

/// So many data can be asked for at once.
pub const MOST_DATA: usize = 8;
/// The number of the one snapshot, and of the one record of extended data, which is the count.
const RECORD: u8 = 1;
const ALL_RECORDS: u8 = 0xFF;
/// The format of the codes: ISO 14229-1.
const CODE_FORMAT: u8 = 1;
/// The layout of stored parameters: `haptic_core::service::stored` begins with it, as tests/server.rs checks.
pub const STORED_LAYOUT: u32 = 5;

impl Server {
    /// 0x22. What is not known is left out, unless nothing is.
    pub(super) fn read_data(&self, rest: &[u8], now: &Now<'_>, reply: &mut Reply) -> Result<(), UdsError> {
        let (ids, left) = rest.as_chunks::<2>();
        if ids.is_empty() || ids.len() > MOST_DATA || !left.is_empty() {
            return Err(UdsError::IncorrectMessageLengthOrInvalidFormat);
        }
        let mut is_any = false;
        for id in ids {
            let value = match u16::from_be_bytes(*id) {
                id if parameter_of(id).is_some() => Some(parameter(id, now)?),
                id => Datum::of(id).map(|datum| self.value(datum, now)),
            };
            if let Some(value) = value {
                reply.put(id)?;
                reply.put(&value.bytes())?;
                is_any = true;
            }
        }
        is_any.then_some(()).ok_or(UdsError::RequestOutOfRange)
    }

    #[expect(clippy::as_conversions, reason = "the code of a variant")]
    fn value(&self, datum: Datum, now: &Now<'_>) -> Value {
        let Now {
            command,
            now_ms,
            situation,
        } = now;
        let stored = situation.stored;
        match datum {
            Datum::Layout => Value::Word(STORED_LAYOUT),
            Datum::Sequence => Value::Word(stored.map_or(0, |stored| stored.sequence)),
            Datum::VehicleNumber => {
                Value::Word(stored.and_then(|stored| stored.set.vehicle).map_or(0, u32::from))
            }
            Datum::Copies => Value::Byte(situation.is_damaged.into()),
            Datum::Outcome => Value::Byte(situation.outcome as u8),
            Datum::Mode => Value::Byte(command.mode as u8),
            Datum::Faults => Value::Word(command.faults.bits()),
            Datum::Torque => Value::Float(crate::trouble::nm(command)),
            Datum::Reset => Value::Byte(situation.reset as u8),
            Datum::Uptime => Value::Word(*now_ms),
            Datum::Rejected => Value::Word(situation.rejected),
            Datum::DriverTorque => Value::Float(self.ear.heard().driver_torque_nm),
            Datum::WheelAngle => Value::Float(self.ear.heard().wheel_angle_rad),
            Datum::Speed => Value::Float(self.ear.heard().speed_m_per_s),
            Datum::LateralError => Value::Float(self.ear.heard().lateral_error_m),
            Datum::Session => Value::Byte(self.session.into()),
            Datum::Commit => Value::Text(situation.commit),
            Datum::Software => Value::Text(situation.software),
            Datum::Hardware => Value::Word(situation.hardware),
            Datum::Bus => Value::Text(VERSION),
        }
    }

    /// 0x19.
    pub(super) fn read_troubles(
        &self,
        cells: &Cells,
        code: u8,
        rest: &[u8],
        reply: &mut Reply,
    ) -> Result<(), UdsError> {
        let of_mask = |mask: u8| {
            let faults = Fault::ALL
                .into_iter()
                .map(|fault| (fault, self.troubles.status(fault)));
            faults.filter(move |(_, status)| mask == ALL_RECORDS || status & mask != 0)
        };
        match (code, rest) {
            (0x01, [mask]) => {
                let count = of_mask(mask & AVAILABLE).count();
                // At most 32 faults.
                let count = u8::try_from(count).unwrap_or(u8::MAX);
                reply.put(&[AVAILABLE, CODE_FORMAT, 0, count])
            }
            (0x02, [mask]) => list(of_mask(mask & AVAILABLE), reply),
            (0x0A, []) => list(of_mask(ALL_RECORDS), reply),
            (0x04, [a, b, c, number]) => {
                let fault = self.head(*a, *b, *c, *number, reply)?;
                record(cells, fault).map_or(Ok(()), |record| snapshot(&record.snapshot, reply))
            }
            (0x06, [a, b, c, number]) => {
                let fault = self.head(*a, *b, *c, *number, reply)?;
                let count = |Record { count, .. }| reply.put(&[RECORD, count]);
                record(cells, fault).map_or(Ok(()), count)
            }
            (0x01 | 0x02 | 0x0A | 0x04 | 0x06, _) => Err(UdsError::IncorrectMessageLengthOrInvalidFormat),
            _ => Err(UdsError::SubFunctionNotSupported),
        }
    }

    /// A code and its status before a record of that number.
    fn head(&self, a: u8, b: u8, c: u8, number: u8, reply: &mut Reply) -> Result<Fault, UdsError> {
        let fault = fault_of(u32::from_be_bytes([0, a, b, c])).ok_or(UdsError::RequestOutOfRange)?;
        if ![RECORD, ALL_RECORDS].contains(&number) {
            return Err(UdsError::RequestOutOfRange);
        }
        reply.put(&[a, b, c, self.troubles.status(fault)])?;
        Ok(fault)
    }

    /// 0x14.
    pub(super) fn clear(&mut self, cells: &mut Cells, rest: &[u8]) -> Result<(), UdsError> {
        let [a, b, c] = *rest else {
            return Err(UdsError::IncorrectMessageLengthOrInvalidFormat);
        };
        let group = u32::from_be_bytes([0, a, b, c]);
        if group == ALL {
            for fault in Fault::ALL {
                self.troubles.clear(cells, fault);
            }
            return Ok(());
        }
        let fault = fault_of(group).ok_or(UdsError::RequestOutOfRange)?;
        self.troubles.clear(cells, fault);
        Ok(())
    }

    /// 0x27, of one level: 1 asks for a challenge, 2 answers it.
    pub(super) fn security_access(
        &mut self,
        cells: &mut Cells,
        code: u8,
        rest: &[u8],
        now: &Now<'_>,
        reply: &mut Reply,
    ) -> Result<(), UdsError> {
        one_of(&[1, 2], code)?;
        if code == 1 {
            none(rest)?;
        } else if rest.len() != BYTES {
            return Err(UdsError::IncorrectMessageLengthOrInvalidFormat);
        }
        let key = self.key.ok_or(UdsError::ConditionsNotCorrect)?;
        if code == 1 && self.lock == Lock::Open {
            // As the standard has it for what is open already.
            return reply.put(&[0; BYTES]);
        }
        if self.is_delayed(now.now_ms) {
            return Err(UdsError::RequiredTimeDelayNotExpired);
        }
        if code == 1 {
            self.attempts.challenges = self.attempts.challenges.wrapping_add(1);
            keep_attempts(cells, self.attempts);
            // Longer than a challenge, so that no answer of a tester's is ever this.
            let mut text = [0; BYTES + 4];
            let words = [
                self.attempts.challenges,
                now.situation.cycles,
                now.now_ms,
                now.situation.hardware,
                u32::from_be_bytes(*b"ask?"),
            ];
            let bytes = words.into_iter().flat_map(u32::to_be_bytes);
            text.iter_mut().zip(bytes).for_each(|(to, from)| *to = from);
            let challenge = mac(&key, &text);
            self.lock = Lock::Challenged(challenge);
            return reply.put(&challenge);
        }
        let Lock::Challenged(challenge) = self.lock else {
            return Err(UdsError::RequestSequenceError);
        };
        let is_right = is_answer(&key, &challenge, rest);
        (self.lock, self.attempts) = if is_right {
            (
                Lock::Open,
                Attempts {
                    wrong: 0,
                    ..self.attempts
                },
            )
        } else {
            self.wrong_ms = now.now_ms;
            let wrong = self.attempts.wrong.saturating_add(1);
            (
                Lock::Closed,
                Attempts {
                    wrong,
                    ..self.attempts
                },
            )
        };
        keep_attempts(cells, self.attempts);
        match is_right {
            true => Ok(()),
            false if self.attempts.wrong >= MOST_WRONG => Err(UdsError::ExceedNumberOfAttempts),
            false => Err(UdsError::InvalidKey),
        }
    }
}

/// A parameter in use.
#[expect(clippy::as_conversions, reason = "a tester reads a binary32")]
fn parameter(id: u16, now: &Now<'_>) -> Result<Value, UdsError> {
    let (place, _) = parameter_of(id).ok_or(UdsError::RequestOutOfRange)?;
    let params = now.situation.in_use.ok_or(UdsError::ConditionsNotCorrect)?;
    let value = params.to_values().get(place).copied();
    value
        .map(|value| Value::Float(value as f32))
        .ok_or(UdsError::RequestOutOfRange)
}

fn list(faults: impl Iterator<Item = (Fault, u8)>, reply: &mut Reply) -> Result<(), UdsError> {
    reply.put(&[AVAILABLE])?;
    for (fault, status) in faults {
        let [_, a, b, c] = code_of(fault).to_be_bytes();
        reply.put(&[a, b, c, status])?;
    }
    Ok(())
}

/// A snapshot, as data of the list.
#[expect(clippy::as_conversions, reason = "the code of a variant")]
fn snapshot(snapshot: &Snapshot, reply: &mut Reply) -> Result<(), UdsError> {
    let Heard {
        driver_torque_nm,
        wheel_angle_rad,
        speed_m_per_s,
        lateral_error_m,
    } = snapshot.heard;
    let data = [
        (Datum::Mode, Value::Byte(snapshot.mode as u8)),
        (Datum::Faults, Value::Word(snapshot.faults.bits())),
        (Datum::Torque, Value::Float(snapshot.torque_nm)),
        (Datum::Uptime, Value::Word(snapshot.at_ms)),
        (Datum::DriverTorque, Value::Float(driver_torque_nm)),
        (Datum::WheelAngle, Value::Float(wheel_angle_rad)),
        (Datum::Speed, Value::Float(speed_m_per_s)),
        (Datum::LateralError, Value::Float(lateral_error_m)),
    ];
    reply.put(&[RECORD, data.len() as u8])?;
    for (datum, value) in data {
        let Entry { id, .. } = datum.entry();
        reply.put(&id.to_be_bytes())?;
        reply.put(&value.bytes())?;
    }
    Ok(())
}
