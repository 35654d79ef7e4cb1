//! What is written: parameters are put down one by one, and the routine [`COMMIT`] hands the whole set to the download, frame
//! by frame, as a client on the bus would. So the download judges it: mode, standstill, pace, ranges, and that nobody comes between.

use automotive_diag::uds::UdsError;
use haptic_core::bus::Frame;
use haptic_core::bus::messages::{Identity, Message, ParameterWrite};
use haptic_core::controller::params::PARAMETERS;
use haptic_core::safety::faults::FaultSet;
use haptic_core::service::download;

use super::{Now, Reply, Server, Situation, one_of};
use crate::data::{Datum, parameter_of};

/// Stores what was written, and starts the ECU anew with it.
pub const COMMIT: u16 = 0x0200;
/// Looks at the image, the stored copies and the faults.
pub const SELF_TEST: u16 = 0x0201;
/// What the self-test found wrong, a bit each.
pub const FOUND: [(u8, &str); 4] = [
    (1 << 0, "the image is not as it was built, or nobody sealed it"),
    (1 << 1, "a copy of the parameters cannot be read"),
    (1 << 2, "no key for security access"),
    (1 << 3, "a fault of class C, or one that locks"),
];

/// Between two fields, ms: as fast as the download takes them.
const FIELD_MS: u32 = 10;
const VALUES: usize = PARAMETERS.len();

/// What was put down, and how far its way to the download is.
#[derive(Debug, Clone)]
pub(super) struct Writing {
    values: [Option<f32>; VALUES],
    vehicle: Option<u32>,
    /// The next frame, of which the first unlocks, and when it is due.
    next: Option<(usize, u32)>,
    /// A set was handed over since the session began.
    was_begun: bool,
}

impl Writing {
    pub(super) const NEW: Self = Self {
        values: [None; VALUES],
        vehicle: None,
        next: None,
        was_begun: false,
    };

    pub(super) fn forget(&mut self) {
        *self = Self::NEW;
    }

    fn is_empty(&self) -> bool {
        self.vehicle.is_none() && self.values.iter().all(Option::is_none)
    }

    pub(super) fn is_due(&self, now_ms: u32) -> bool {
        self.next
            .is_some_and(|(_, due_ms)| now_ms.wrapping_sub(due_ms).cast_signed() >= 0)
    }

    /// The next frame for the download, when it is due.
    #[expect(clippy::as_conversions, reason = "fewer than 256 fields; the bus carries f32")]
    pub(super) fn frame(&mut self, now_ms: u32, situation: &Situation<'_>) -> Option<Frame> {
        let (next, due_ms) = self.next.filter(|_| self.is_due(now_ms))?;
        self.next = (next < VALUES).then_some((next.saturating_add(1), due_ms.wrapping_add(FIELD_MS)));
        let Some(index) = next.checked_sub(1) else {
            let number =
                |stored: &haptic_core::service::stored::Stored| stored.set.vehicle.map_or(0, u32::from);
            let vehicle = self.vehicle.or(situation.stored.map(number)).unwrap_or(0);
            let in_use = situation.stored.map_or(0, |stored| stored.sequence);
            return Some(download::unlock(in_use, vehicle));
        };
        let used = || Some(*situation.in_use?.to_values().get(index)? as f32);
        let write = ParameterWrite {
            index: index as u8,
            value: self.values.get(index).copied().flatten().or_else(used)?,
        };
        Some(write.encode(write.index))
    }
}

impl Server {
    /// 0x2E.
    #[expect(
        clippy::as_conversions,
        reason = "the ends of a range, as the bus rounds them"
    )]
    pub(super) fn write_data(&mut self, rest: &[u8], reply: &mut Reply) -> Result<(), UdsError> {
        let (id, value) = rest
            .split_first_chunk::<2>()
            .filter(|(_, value)| !value.is_empty())
            .ok_or(UdsError::IncorrectMessageLengthOrInvalidFormat)?;
        let number = u16::from_be_bytes(*id);
        let parameter = parameter_of(number);
        let is_written = Datum::of(number).is_some_and(|datum| datum.entry().is_written);
        if parameter.is_none() && !is_written {
            return Err(UdsError::RequestOutOfRange);
        }
        self.ask_for_security()?;
        let value = value
            .try_into()
            .map_err(|_| UdsError::IncorrectMessageLengthOrInvalidFormat)?;
        if self.writing.next.is_some() {
            return Err(UdsError::ConditionsNotCorrect);
        }
        match parameter {
            Some((place, parameter)) => {
                let value = f32::from_be_bytes(value);
                let is_within = value >= parameter.min as f32 && value <= parameter.max as f32;
                let slot = self.writing.values.get_mut(place).filter(|_| is_within);
                *slot.ok_or(UdsError::RequestOutOfRange)? = Some(value);
            }
            None => {
                let number = u32::from_be_bytes(value);
                if number > Identity::VEHICLE_MAX {
                    return Err(UdsError::RequestOutOfRange);
                }
                self.writing.vehicle = Some(number);
            }
        }
        reply.put(id)
    }

    /// 0x31: 1 starts, 3 asks for the result.
    pub(super) fn routine(
        &mut self,
        code: u8,
        rest: &[u8],
        now: &Now<'_>,
        reply: &mut Reply,
    ) -> Result<(), UdsError> {
        one_of(&[1, 3], code)?;
        let id: [u8; 2] = rest
            .try_into()
            .map_err(|_| UdsError::IncorrectMessageLengthOrInvalidFormat)?;
        reply.put(&id)?;
        match u16::from_be_bytes(id) {
            COMMIT => self.commit(code, now, reply),
            SELF_TEST => reply.put(&[self.self_test(now)]),
            _ => Err(UdsError::RequestOutOfRange),
        }
    }

    #[expect(clippy::as_conversions, reason = "the code of a variant")]
    fn commit(&mut self, code: u8, now: &Now<'_>, reply: &mut Reply) -> Result<(), UdsError> {
        self.ask_for_security()?;
        if code == 3 {
            if !self.writing.was_begun {
                return Err(UdsError::RequestSequenceError);
            }
            let is_under_way = self.writing.next.is_some();
            return reply.put(&[is_under_way.into(), now.situation.outcome as u8]);
        }
        if self.writing.next.is_some() {
            return Err(UdsError::BusyRepeatRequest);
        }
        // An ECU without a set in use needs all of one.
        let is_whole = self.writing.values.iter().all(Option::is_some) || now.situation.in_use.is_some();
        if self.writing.is_empty() || !is_whole {
            return Err(UdsError::RequestSequenceError);
        }
        now.ask_for_standstill()?;
        if !now.situation.conditions.settled {
            return Err(UdsError::ConditionsNotCorrect);
        }
        self.writing.next = Some((0, now.now_ms));
        self.writing.was_begun = true;
        Ok(())
    }

    fn self_test(&self, now: &Now<'_>) -> u8 {
        let Situation {
            is_image_whole,
            is_damaged,
            ..
        } = now.situation;
        let severe = FaultSet::CRITICAL.union(FaultSet::LOCKING);
        let is_wrong = [
            !is_image_whole,
            *is_damaged,
            self.key.is_none(),
            now.command.faults.intersects(severe),
        ];
        let found = FOUND.iter().zip(is_wrong).filter(|(_, is_wrong)| *is_wrong);
        found.fold(0, |all, ((bit, _), _)| all | bit)
    }
}
