//! What a run of the campaign is judged by: what the ECU did, and what it could have known.

use crate::bytes::{ACTIVE, FADE, FAULT, HANDOVER, LANE_STEP, Status};
use crate::residual::{Detectability, Residual};
use crate::senders::SensorReadings;
use crate::table::FaultCase;
use crate::trial_record::TrialRecord;

/// Code of the limit that acts for the driver's sake.
const DRIVER_OVERRIDE: u64 = 5;

/// Watches a run from outside the ECU.
#[derive(Debug, Clone)]
pub(super) struct Witness {
    /// How the case can be noticed.
    seen: Detectability,
    onset: u32,
    residual: Residual,
    pub(super) record: TrialRecord,
}

impl Witness {
    pub(super) fn new(row: &FaultCase, onset: u32, residual: Residual) -> Self {
        Self {
            seen: row.seen,
            onset,
            residual,
            record: TrialRecord::default(),
        }
    }

    /// When the ECU left Active for good or for a handover, if it did since the onset.
    pub(super) fn left_at(&self) -> Option<u32> {
        let modes = self.record.modes.iter();
        let left =
            |(step, mode): &&(u32, u64)| *step >= self.onset && matches!(*mode, FADE | HANDOVER | FAULT);
        modes.clone().find(left).map(|(step, _)| *step)
    }

    /// Takes what the sensors say in a step, beside the motor's torque as it was commanded and delivered.
    pub(super) fn readings(
        &mut self,
        step: u32,
        readings: &SensorReadings,
        [commanded_nm, delivered_nm]: [f64; 2],
        has_probe: bool,
    ) {
        let time_s = f64::from(step) * 1e-3;
        self.residual.at(time_s);
        if let Some(speeds) = readings.speeds_m_per_s {
            let yaw_rate = readings.yaw_rate_rad_per_s.unwrap_or(0.0);
            self.residual.motion(time_s, speeds, yaw_rate);
        }
        if let Some((driver_nm, wheel_rad)) = readings.column {
            self.residual.column(time_s, driver_nm, wheel_rad, commanded_nm);
        }
        if let Some((e_y_m, e_theta_rad)) = readings.lane {
            self.residual.lane(time_s, e_y_m, e_theta_rad);
        }
        self.residual.motor(commanded_nm, delivered_nm);
        if step < self.onset {
            return;
        }
        let used = self.residual.used(self.seen);
        if self.record.modes.last().is_some_and(|(_, mode)| *mode == ACTIVE) {
            let still = self.residual.still_used(has_probe);
            let shown = if self.seen == Detectability::Contradiction {
                used.max(still)
            } else {
                used
            };
            self.record.used = self.record.used.max(shown);
            let contradicted = self.residual.used(Detectability::Contradiction).max(still);
            self.record.contradicted = self.record.contradicted.max(contradicted);
        }
        let since = |by| self.residual.detectable_since(by, step);
        let (since, weak_since) = (since(self.seen), since(Detectability::MotorWeak));
        // A motor that came back within the ECU's patience has not been astray.
        let returned = self.seen.is_of_motor() && self.record.modes.last().is_some_and(|(_, m)| *m == ACTIVE);
        let kept = |before: Option<u32>, since| if returned { since } else { before.or(since) };
        self.record.seen_at = kept(self.record.seen_at, since);
        self.record.weak_at = kept(self.record.weak_at, weak_since);
    }

    /// Takes the ECU's answer in a step.
    pub(super) fn status(&mut self, step: u32, status: &Status) {
        let record = &mut self.record;
        if record.modes.last().is_none_or(|(_, mode)| *mode != status.mode) {
            record.modes.push((step, status.mode));
        }
        record.reset = status.reset;
        if step >= self.onset {
            // Which line is gone on with, and which is taken, the second opinion does not know: nothing is too early then.
            if status.mode == ACTIVE && status.faults & LANE_STEP != 0 {
                record.used = f64::INFINITY;
            }
            record.peak_nm = record.peak_nm.max(status.torque_nm.abs());
            record.overridden |= status.limit == DRIVER_OVERRIDE;
            if status.torque_nm == 0.0 && status.mode == ACTIVE {
                record.yielded_at.get_or_insert(step);
            }
        }
    }
}
