//! What must hold in every cycle of every run, judged from the frames alone.
//!
//! The checker hears what the ECU hears and reads the guidance frame that it sends, both with `bytes`; its
//! arithmetic is f64, its limits are written down here a second time, and it shares no code with the core. It
//! trusts the ECU in one thing only: which frames it accepted, since a bound on the driver's torque is a bound
//! on the torque that the ECU has read.
//!
//! | rule | bound |
//! |---|---|
//! | frame | identifier, length, CRC, counter one ahead, codes that exist, spare bits zero, classes those of the faults |
//! | limit | abs(T) <= 5 N.m |
//! | wind-up | abs(T) grows by at most 4 N.m/s (2 ms at most count for one cycle) |
//! | reduction | abs(T) falls by at most 8 N.m/s, 32 in a handover from an implausible lane, but for an ECU fault and a driver who overrides; behind a bar, 64 |
//! | window | abs(T) grows by at most 1.2 N.m within any 250 ms |
//! | override | the bound that shrinks from 0.8 N.m of opposing driver torque; behind a bar of what its readings of 0.2 s leave of it |
//! | modes | T = 0 in Boot, Standby, Fault, Locked; Fault and Locked are never left |
//! | engaging | into Active only from 500 ms of Standby and by a request that rose |
//! | inputs | no input older than 30 ms in Active, no picture older than a second more, of a late camera 1.35 s |
//! | handover | never grows, keeps its sign, at or below its line or on the way there at 8 N.m/s, zero after 2 s; the line goes three times as fast while the driver opposes, twice without a column, four times beside one that contradicts itself, and starts from zero after an implausible lane |
//! | fade | never grows, falls by 4 N.m/s |
//! | warning | the bit and, when it appears, the warning frame, in Handover, Fault and Locked, beside LaneStep in Active, and there after 0.2 s without a picture |

mod broken;
mod frame;

use std::collections::VecDeque;

use haptic_core::bus::Frame;

use super::bytes::{self, ACTIVE, FADE, FAULT, HANDOVER, LANE_STEP, LOCKED, STANDBY, Status};
use broken::Broken;
use frame::{override_bounds, warned, well_formed};

const LIMIT_NM: f64 = 5.0;
const WIND_UP_NM_PER_S: f64 = 4.0;
const REDUCTION_NM_PER_S: f64 = 8.0;
/// Behind a bar guidance yields so fast to hands that nobody outside the ECU knows.
const YIELD_NM_PER_S: f64 = 64.0;
/// The reduction in a handover from an implausible lane.
const LIE_NM_PER_S: f64 = 32.0;
const WINDOW_NM: f64 = 1.2;
const WINDOW_US: u64 = 250_000;
const OVERRIDE_FROM_NM: f64 = 0.8;
const OVERRIDE_SLOPE: f64 = 3.0;
/// Behind a bar: after this time of an observer of 100 rad/s guidance has yielded. Meanwhile the hands may be as much less than passes
/// through the bar as the wheel's friction of 0.1 N.m takes, its damping of 0.05 N.m.s/rad at 3 rad/s and its inertia of 0.044 kg.m2 at 30 rad/s2;
/// and two frames may change what is known by 50 mN.m; torques that a monitor counts in mN.m, one of them three times, are 5 more.
const HANDS_KNOWN_US: u32 = 200_000;
const BAR_MARGIN_NM: f64 = 1.57;
const BAR_SLACK_NM: f64 = 0.055;
const TIMEOUT_US: u32 = 30_000;
/// What an ECU that waits for three periods of a sender may wait longer where frames come up to 25 ms apart from their time.
const LATE_US: u32 = 8_000;
/// Oldest sample of a camera that is late: 150 ms, and three of the longest times between two pictures.
const LATE_CAMERA_US: u32 = 350_000;
/// Without a picture guidance goes on for so long.
const BLIND_US: u32 = 1_000_000;
const READY_US: u32 = 500_000;
const FADE_NM_PER_S: f64 = 4.0;
const HANDOVER_S: f64 = 2.0;
/// How many times as fast a handover goes that the driver opposes, from what torque on, without a column, and with one that
/// contradicts itself.
const OPPOSED: f64 = 3.0;
const OPPOSES_NM: f64 = 0.1;
const BLIND: f64 = 2.0;
const LIED_TO: f64 = 4.0;
/// Bits of a lost and an implausible column, and of an implausible lane.
const COLUMN_LOST: u64 = 1 << 3;
const COLUMN_IMPLAUSIBLE: u64 = 1 << 4;
const LANE_IMPLAUSIBLE: u64 = 1 << 2;
/// Bits of LaneTimeout, LaneInvalid and LaneStep.
const PICTURE_FAULTS: u64 = 1 | 1 << 1 | LANE_STEP;
/// Most time that one cycle may use of a rate.
const MOST_S: f64 = 0.002;
/// One LSB of the torque on the bus: a torque is rounded, the bounds are not.
const LSB_NM: f64 = 1.0 / 4096.0;
/// Rounding of the rates in the core's fixed point.
const TINY_NM: f64 = 1e-6;

/// Bits of the faults of implausible inputs, with the time before which an output is trusted, us.
const UNSEEN_US: [(u64, u32); 2] = [(1 << 4, 1_500_000), (1 << 6, 800_000)];
/// What lies between two outputs that the ECU remembers, us, and to spare; and the most that the probe may have taken away.
const APART_US: u32 = 60_000;
const PROBE_NM: f64 = 0.2;
/// For how long outputs are kept here, us.
const KEPT_US: u32 = 2_100_000;
/// Bit of the fault that the two copies of a redundant state differ.
const MEMORY_FAULT: u64 = 1 << 10;

/// A rule that was broken.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Violation {
    /// Step of the run, ms.
    pub step: u32,
    /// Which rule, and by how much.
    pub what: String,
}

#[derive(Debug, Clone, Copy)]
struct Last {
    status: Status,
    at_us: u32,
}

/// Start of a fade or a handover: its largest torque, and how far along it is.
#[derive(Debug, Clone, Copy, Default)]
struct Ramp {
    from_nm: f64,
    passed_s: f64,
}

/// Judges one ECU.
#[derive(Debug, Clone, Default)]
pub(super) struct InvariantChecker {
    last: Option<Last>,
    /// Whether the ECU may be Active from its first cycle on.
    starts_active: bool,
    /// When the latest sample in use was true, by the ECU's clock: lane, column, vehicle, request.
    true_at_us: [Option<u32>; 4],
    /// Whether the camera is known to be late: its first picture then takes its time behind the sample that the ECU began with.
    camera_lags: bool,
    /// Whether that is so, or a lane preview was ever old when it came.
    camera_is_late: bool,
    driver_nm: f64,
    /// Behind a bar: its readings of the last [`HANDS_KNOWN_US`], by the ECU's clock; `None` where the sensor measures the hands.
    bar_nm: Option<VecDeque<(u32, f64)>>,
    request: Option<bool>,
    /// A request that rose and has not yet been used.
    rose: bool,
    standby_since_us: u32,
    ramp: Ramp,
    /// For how long pictures have been missing in Active, us.
    dark_us: u32,
    /// Magnitudes of the last 250 ms by the world's clock, rising: the first is the least.
    window: VecDeque<(u64, f64)>,
    /// Magnitudes for as long as one may be trusted, by the ECU's clock.
    outputs: VecDeque<(u32, f64)>,
    pub(super) cycles: u64,
    pub(super) violation: Option<Violation>,
}

impl InvariantChecker {
    /// For an ECU that starts at `now_us` of its clock, in Boot or, in studies, Active.
    pub(super) fn new(starts_active: bool, camera_lags: bool, now_us: u32) -> Self {
        Self {
            starts_active,
            camera_lags,
            camera_is_late: camera_lags,
            standby_since_us: now_us,
            ..Self::default()
        }
    }

    /// For an ECU that is told of a torsion bar.
    pub(super) fn behind_a_bar(self, is_bar: bool) -> Self {
        Self {
            bar_nm: is_bar.then(VecDeque::new),
            ..self
        }
    }

    /// The ECU was reset: what it knew is gone, and its torque with it.
    pub(super) fn reset(&mut self, now_us: u32) {
        let (cycles, violation) = (self.cycles, self.violation.take());
        *self = Self::new(false, self.camera_lags, now_us).behind_a_bar(self.bar_nm.is_some());
        (self.cycles, self.violation) = (cycles, violation);
    }

    /// A frame that the ECU accepted.
    pub(super) fn accepted(&mut self, frame: &Frame, now_us: u32) {
        match frame.id() {
            // Bit 55: the sender vouches for it.
            bytes::LANE if bytes::unsigned(frame, 55, 1) != 0 => {
                let age = bytes::unsigned(frame, 46, 9) | bytes::unsigned(frame, 56, 2) << 9;
                let age_us = age as u32 * 100;
                self.true_at_us[0] = Some(now_us.wrapping_sub(age_us));
                self.camera_is_late |= age_us > 0;
            }
            bytes::COLUMN => {
                self.true_at_us[1] = Some(now_us);
                self.driver_nm = bytes::signed(frame, 12, 18) as f64 / 4096.0;
                if let Some(readings) = &mut self.bar_nm {
                    readings.push_back((now_us, self.driver_nm));
                }
            }
            bytes::VEHICLE => self.true_at_us[2] = Some(now_us),
            bytes::REQUEST => {
                self.true_at_us[3] = Some(now_us);
                let engage = bytes::unsigned(frame, 12, 1) != 0;
                self.rose |= engage && self.request == Some(false);
                self.rose &= engage;
                self.request = Some(engage);
            }
            _ => {}
        }
    }

    /// A cycle of the ECU: `step` and `world_us` in the world, `now_us` on the ECU's clock.
    pub(super) fn cycle(&mut self, step: u32, world_us: u64, now_us: u32, frame: &Frame, others: &[Frame]) {
        self.cycles += 1;
        let status = Status::decode(frame);
        let verdict = self.judge(world_us, now_us, frame, &status, others);
        if let (Err(broken), None) = (verdict, &self.violation) {
            let what = broken.to_string();
            self.violation = Some(Violation { step, what });
        }
        self.last = Some(Last {
            status,
            at_us: now_us,
        });
        self.outputs.push_back((now_us, status.torque_nm.abs()));
        let is_old = |(at_us, _): &(u32, f64)| now_us.wrapping_sub(*at_us) > KEPT_US;
        while self.outputs.front().is_some_and(is_old) {
            self.outputs.pop_front();
        }
        if let Some(readings) = &mut self.bar_nm {
            let is_old = |(at_us, _): &(u32, f64)| now_us.wrapping_sub(*at_us) > HANDS_KNOWN_US;
            while readings.len() > 1 && readings.front().is_some_and(is_old) {
                readings.pop_front();
            }
        }
    }

    /// The largest torque that a handover may start from, beside the last one.
    fn trusted_nm(&self, status: &Status, now_us: u32) -> f64 {
        let age_us = |at_us: u32| now_us.wrapping_sub(at_us);
        // Nobody knows since when it lied.
        if status.mode == HANDOVER && status.faults & LANE_IMPLAUSIBLE != 0 {
            return 0.0;
        }
        let present = UNSEEN_US.iter().filter(|(fault, _)| status.faults & fault != 0);
        let unseen_us = present.map(|(_, us)| *us).max();
        let Some(unseen_us) = unseen_us.filter(|_| status.mode == HANDOVER) else {
            return f64::INFINITY;
        };
        let known = self
            .outputs
            .front()
            .is_some_and(|(at, _)| age_us(*at) >= unseen_us + APART_US);
        if !known {
            return f64::INFINITY;
        }
        let trusted = unseen_us.saturating_sub(10_000)..unseen_us + APART_US;
        let outputs = self
            .outputs
            .iter()
            .filter(|(at, _)| trusted.contains(&age_us(*at)));
        PROBE_NM + outputs.map(|(_, nm)| *nm).fold(0.0, f64::max)
    }

    fn judge(
        &mut self,
        world_us: u64,
        now_us: u32,
        frame: &Frame,
        status: &Status,
        others: &[Frame],
    ) -> Result<(), Broken> {
        let before = self.last.map(|last| last.status);
        well_formed(frame, status, before.as_ref())?;
        for other in others {
            if other.id() == bytes::WARNING && !bytes::is_intact(other) {
                return Err(Broken::WarningFrame);
            }
        }
        let elapsed_us = self.last.map_or(0, |last| now_us.wrapping_sub(last.at_us));
        let old_nm = before.map_or(0.0, |b| b.torque_nm);
        self.magnitude(world_us, status.torque_nm)?;
        self.rates(status, old_nm, f64::from(elapsed_us) * 1e-6, now_us)?;
        let old_mode = before.map_or(if self.starts_active { ACTIVE } else { 0 }, |b| b.mode);
        self.modes(status, old_mode, now_us)?;
        self.ramps(status, old_mode, old_nm, now_us)?;
        let is_dark = status.mode == ACTIVE && status.faults & PICTURE_FAULTS != 0;
        self.dark_us = if is_dark { self.dark_us + elapsed_us } else { 0 };
        warned(status, before.is_some_and(|b| b.warning), self.dark_us, others)
    }

    fn magnitude(&mut self, world_us: u64, torque_nm: f64) -> Result<(), Broken> {
        let magnitude = torque_nm.abs();
        if magnitude > LIMIT_NM {
            return Err(Broken::Limit(torque_nm));
        }
        while self
            .window
            .front()
            .is_some_and(|(at, _)| world_us - at > WINDOW_US)
        {
            self.window.pop_front();
        }
        while self.window.back().is_some_and(|(_, least)| *least >= magnitude) {
            self.window.pop_back();
        }
        self.window.push_back((world_us, magnitude));
        let grown = magnitude - self.window.front().map_or(0.0, |(_, least)| *least);
        if grown > WINDOW_NM {
            return Err(Broken::Window(grown));
        }
        Ok(())
    }

    /// The hands' torque that is certain, N.m: the sensor's reading, or, behind a bar, what its readings of late leave of it.
    fn hands_nm(&self) -> f64 {
        let Some(readings) = &self.bar_nm else {
            return self.driver_nm;
        };
        let nm = || readings.iter().map(|(_, nm)| *nm);
        let (least, most) = (
            nm().fold(f64::INFINITY, f64::min) - BAR_MARGIN_NM,
            nm().fold(f64::NEG_INFINITY, f64::max) + BAR_MARGIN_NM,
        );
        if least > most {
            0.0
        } else {
            least.max(0.0) + most.min(0.0)
        }
    }

    fn rates(&self, status: &Status, old_nm: f64, elapsed_s: f64, now_us: u32) -> Result<(), Broken> {
        let elapsed_s = elapsed_s.min(MOST_S);
        let growth = WIND_UP_NM_PER_S * elapsed_s;
        let fall = elapsed_s
            * match self.bar_nm {
                Some(_) => YIELD_NM_PER_S,
                None => reduction_nm_per_s(status),
            };
        // In the frame in which the old torque is positive.
        let sign = if old_nm < 0.0 { -1.0 } else { 1.0 };
        let (old, new) = (old_nm.abs(), sign * status.torque_nm);
        if new > old + growth + TINY_NM || new < -growth - TINY_NM {
            return Err(Broken::WindUp {
                old: old_nm,
                new: status.torque_nm,
                ms: elapsed_s * 1e3,
            });
        }
        let column_is_known = self.true_at_us[1].is_some_and(|at| now_us.wrapping_sub(at) <= TIMEOUT_US);
        let certain_nm = self.hands_nm();
        let (low, high) = if column_is_known {
            override_bounds(certain_nm)
        } else {
            (-LIMIT_NM, LIMIT_NM)
        };
        let tiny_nm = TINY_NM + if self.bar_nm.is_some() { BAR_SLACK_NM } else { 0.0 };
        if !(low - tiny_nm..=high + tiny_nm).contains(&status.torque_nm) {
            return Err(Broken::Override {
                torque: status.torque_nm,
                low,
                high,
                driver: certain_nm,
            });
        }
        let bound = if sign < 0.0 { -low } else { high };
        let by_driver = self.bar_nm.is_none() && new >= bound - LSB_NM - TINY_NM;
        let by_fault = matches!(status.mode, FAULT | LOCKED);
        // Across zero the old torque may fall all the way, and the new one grow from there.
        let low = if old > fall { old - fall } else { -growth };
        if new < low - TINY_NM && !by_driver && !by_fault {
            return Err(Broken::Reduction {
                old: old_nm,
                new: status.torque_nm,
                ms: elapsed_s * 1e3,
                mode: status.mode,
            });
        }
        Ok(())
    }

    fn modes(&mut self, status: &Status, old_mode: u64, now_us: u32) -> Result<(), Broken> {
        let mode = status.mode;
        if !matches!(mode, ACTIVE | FADE | HANDOVER) && status.torque_nm != 0.0 {
            let torque = status.torque_nm;
            return Err(Broken::Torque { mode, torque });
        }
        if matches!(old_mode, FAULT | LOCKED) && mode != old_mode {
            return Err(Broken::Left { left: old_mode, mode });
        }
        if mode == ACTIVE && old_mode != ACTIVE {
            let waited_us = now_us.wrapping_sub(self.standby_since_us);
            if old_mode != STANDBY || !self.rose || waited_us < READY_US {
                return Err(Broken::Engaged {
                    from: old_mode,
                    waited_us,
                    rose: self.rose,
                });
            }
            self.rose = false;
        }
        if mode == STANDBY && old_mode != STANDBY {
            self.standby_since_us = now_us;
        }
        if mode == ACTIVE {
            for (at, name) in self.true_at_us.iter().zip(["lane", "column", "speed", "request"]) {
                let age_us = at.map_or(u32::MAX, |at| now_us.wrapping_sub(at));
                let most_us = match name {
                    "lane" if self.camera_is_late => LATE_CAMERA_US + BLIND_US,
                    "lane" => TIMEOUT_US + LATE_US + BLIND_US,
                    _ => TIMEOUT_US + LATE_US,
                };
                if age_us > most_us {
                    return Err(Broken::Old { name, age_us });
                }
            }
        }
        Ok(())
    }

    fn ramps(&mut self, status: &Status, old_mode: u64, old_nm: f64, now_us: u32) -> Result<(), Broken> {
        if !matches!(status.mode, FADE | HANDOVER) {
            return Ok(());
        }
        if status.mode != old_mode {
            self.ramp = Ramp {
                from_nm: old_nm.abs().min(self.trusted_nm(status, now_us)),
                passed_s: 0.0,
            };
        }
        let elapsed_s = f64::from(self.last.map_or(0, |last| now_us.wrapping_sub(last.at_us))) * 1e-6;
        // The ramp has moved for one cycle already when it is first seen.
        self.ramp.passed_s += elapsed_s
            * match status.mode {
                HANDOVER if status.faults & COLUMN_IMPLAUSIBLE != 0 => LIED_TO,
                HANDOVER if status.faults & COLUMN_LOST != 0 => BLIND,
                // Behind a bar nobody outside the ECU knows whether the hands do.
                HANDOVER
                    if self.bar_nm.is_none()
                        && -self.driver_nm * old_nm.signum() > OPPOSES_NM
                        && old_nm != 0.0 =>
                {
                    OPPOSED
                }
                _ => 1.0,
            };
        let (torque, old) = (status.torque_nm, old_nm);
        if torque.abs() > old.abs() || torque * old < 0.0 {
            return Err(Broken::Grew {
                mode: status.mode,
                old,
                new: torque,
            });
        }
        let Ramp {
            from_nm: start,
            passed_s,
        } = self.ramp;
        let line = if status.mode == HANDOVER {
            start * (1.0 - passed_s / HANDOVER_S)
        } else {
            start - FADE_NM_PER_S * passed_s
        };
        // A reduction that is rounded away from zero, and the way to the line.
        let falling = old.abs() - reduction_nm_per_s(status) * elapsed_s.min(MOST_S);
        if torque.abs() > line.max(0.0).max(falling) + LSB_NM + TINY_NM {
            return Err(Broken::AboveLine {
                mode: status.mode,
                torque,
                line,
                passed_s,
            });
        }
        Ok(())
    }
}

/// How fast a torque may fall.
fn reduction_nm_per_s(status: &Status) -> f64 {
    if status.mode == HANDOVER && status.faults & LANE_IMPLAUSIBLE != 0 {
        LIE_NM_PER_S
    } else {
        REDUCTION_NM_PER_S
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sensor of the hands says what they do. Behind a bar 0.2 s of readings from 2.5 to 3 N.m leave a hand of 2.5 - 1.57 N.m
    /// for certain; readings of both signs, or of less than 1.57 N.m, leave none.
    #[test]
    fn readings_of_a_bar_leave_less_for_certain() {
        let of = |is_bar: bool, readings: &[f64]| {
            let mut checker = InvariantChecker::new(true, false, 0).behind_a_bar(is_bar);
            for nm in readings {
                checker.driver_nm = *nm;
                if let Some(kept) = &mut checker.bar_nm {
                    kept.push_back((0, *nm));
                }
            }
            checker
        };
        let close =
            |found: f64, expected: f64| assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        for sign in [1.0, -1.0] {
            close(of(false, &[-3.0 * sign]).hands_nm(), -3.0 * sign);
            close(of(true, &[-3.0 * sign, -2.5 * sign]).hands_nm(), -0.93 * sign);
            close(of(true, &[-3.0 * sign, 0.1 * sign]).hands_nm(), 0.0);
            close(of(true, &[-1.56 * sign]).hands_nm(), 0.0);
        }
    }
}
