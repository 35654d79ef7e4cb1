//! A bus as it comes: what the ECU says and hears, frame by frame, and what changed.
//!
//! [`View::take`] is fed frames with their times and keeps the latest of every signal; what changed with a frame it
//! returns in words. [`Listener`] feeds it from an adapter and sends nothing. Frames of the inputs are shown as far as they
//! are intact, whether the ECU used them or not: its own reasons come as `Rejection`.
//!
//! Not here: how it is printed or recorded.

use std::collections::BTreeMap;

use haptic_core::bus::Frame;
use haptic_core::bus::e2e::{ReceiverState, Reject};
use haptic_core::bus::messages::{
    Column, FaultRecord, Guidance, Info, LanePreview, MESSAGES, Message, Rejection, ResetCause, Telemetry,
    Vehicle, Warning,
};
use haptic_core::safety::envelope::LimitReason;
use haptic_core::safety::faults::{Fault, FaultSet};
use haptic_core::safety::modes::Mode;
use haptic_secoc::messages::{OFFER_ID, STATUS_ID};
use serde::Serialize;

use super::PilError;
use super::parameters::Product;
use super::port::Port;

pub use super::link::Unread;

/// Torque frames come every millisecond; without one for so long the ECU is silent.
const SILENT_AFTER_S: f64 = 0.1;

/// The latest of every signal; `None`: not heard yet. Units in the names.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Status {
    /// s since the first frame.
    pub time_s: f64,
    /// The mode, named as in the DBC file.
    pub mode: Option<String>,
    /// T_h, N.m.
    pub torque_nm: Option<f64>,
    /// The limit that acted last, and none if none did.
    pub limit: Option<String>,
    /// T_d, N.m.
    pub driver_torque_nm: Option<f64>,
    /// The motor's torque, N.m.
    pub motor_torque_nm: Option<f64>,
    /// phi, rad.
    pub wheel_angle_rad: Option<f64>,
    /// e_y', m.
    pub e_y_m: Option<f64>,
    /// e_theta', rad.
    pub e_theta_rad: Option<f64>,
    /// The lesser of the two speeds, m/s.
    pub speed_m_per_s: Option<f64>,
    /// The part of T_h that is the probe, N.m; `None` without one.
    pub probe_nm: Option<f64>,
    /// K_hg; `None` while it is not identified.
    pub k_hg: Option<f64>,
    /// Its standard deviation.
    pub k_hg_deviation: Option<f64>,
    /// Whether the driver has to take over.
    pub warning: bool,
    /// Every fault that is present.
    pub faults: Vec<String>,
}

/// How many frames came.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Frames of each message, by its name.
    pub frames: BTreeMap<String, u64>,
    /// Frames with a length, CRC or signal that cannot be.
    pub damaged: u64,
    /// Missing by their counters, as far as these can tell: they count to 16.
    pub lost: u64,
    /// Under an identifier that is none of the bus.
    pub foreign: u64,
}

/// What is known of the bus.
#[derive(Debug, Default)]
pub struct View {
    status: Status,
    counts: Counts,
    counters: BTreeMap<u16, u8>,
    mode: Option<Mode>,
    reset: Option<ResetCause>,
    faults: FaultSet,
    rejections: BTreeMap<(u16, u8), u16>,
    first_s: Option<f64>,
    torque_at_s: f64,
    silent: bool,
    identified: bool,
}

impl View {
    /// The latest of every signal.
    #[must_use]
    pub const fn status(&self) -> &Status {
        &self.status
    }

    /// How many frames came so far.
    #[must_use]
    pub const fn counts(&self) -> &Counts {
        &self.counts
    }

    /// Counts a frame that is none of this bus: of 29 bits, or of CAN FD.
    pub const fn take_foreign(&mut self) {
        self.counts.foreign += 1;
    }

    /// Takes a frame; says what changed with it.
    pub fn take(&mut self, time_s: f64, frame: &Frame) -> Vec<String> {
        let first_s = *self.first_s.get_or_insert(time_s);
        self.status.time_s = time_s - first_s;
        let Some(info) = MESSAGES.iter().find(|info| info.id == frame.id()) else {
            // What belongs to proofs is of this bus, and says nothing that is shown here.
            let is_of_proofs = [STATUS_ID, OFFER_ID].contains(&frame.id());
            self.counts.foreign += u64::from(!is_of_proofs);
            return Vec::new();
        };
        *self.counts.frames.entry(info.name.into()).or_default() += 1;
        let Some(data) = frame.full_data().filter(|data| info.protection.is_intact(data)) else {
            self.counts.damaged += 1;
            return Vec::new();
        };
        self.count_lost(info, data[1] & 0x0F);
        let mut changes = Vec::new();
        if self.signals(frame, &mut changes).is_none() {
            self.counts.damaged += 1;
        }
        changes
    }

    /// Says that no torque frame came up to a time, once.
    pub fn wait(&mut self, time_s: f64) -> Option<String> {
        let since_s = time_s - self.first_s?;
        self.status.time_s = since_s;
        let silent = since_s - self.torque_at_s > SILENT_AFTER_S && self.mode.is_some();
        if silent == self.silent {
            return None;
        }
        self.silent = silent;
        silent.then(|| format!("no torque frame since {:.3} s", self.torque_at_s))
    }

    fn count_lost(&mut self, info: &Info, counter: u8) {
        if let Some(last) = self.counters.insert(info.id, counter) {
            let step = counter.wrapping_sub(last) & 0x0F;
            self.counts.lost += u64::from(step.saturating_sub(1));
        }
    }

    /// `None`: a signal outside its range.
    fn signals(&mut self, frame: &Frame, changes: &mut Vec<String>) -> Option<()> {
        match frame.id() {
            Guidance::ID => self.guidance(&decoded(frame)?, changes),
            Warning::ID => {
                let told = decoded::<Warning>(frame)?.faults.difference(in_torque_frame());
                self.faults(self.faults.common(in_torque_frame()).union(told), changes);
            }
            LanePreview::ID => {
                let lane: LanePreview = decoded(frame)?;
                self.status.e_y_m = lane.valid.then(|| lane.e_y.m());
                self.status.e_theta_rad = lane.valid.then(|| lane.e_theta.rad());
            }
            Column::ID => {
                let column: Column = decoded(frame)?;
                self.status.driver_torque_nm = Some(column.driver_torque.nm());
                self.status.motor_torque_nm = Some(column.motor_torque.nm());
                self.status.wheel_angle_rad = Some(column.wheel_angle.rad());
            }
            Vehicle::ID => {
                let [a, b] = decoded::<Vehicle>(frame)?.speeds.map(|speed| speed.m_per_s());
                self.status.speed_m_per_s = Some(a.min(b));
            }
            Telemetry::ID => self.telemetry(&decoded(frame)?, changes),
            FaultRecord::ID => {
                let record = decoded::<FaultRecord>(frame)?.record;
                if !in_torque_frame().contains(record.fault) {
                    let mut faults = self.faults;
                    faults.set(record.present, record.fault);
                    self.faults(faults, changes);
                }
            }
            Rejection::ID => self.rejection(&decoded(frame)?, changes),
            // Parameters are `host-sim ecu parameters`'s.
            _ => {}
        }
        Some(())
    }

    fn guidance(&mut self, guidance: &Guidance, changes: &mut Vec<String>) {
        self.torque_at_s = self.status.time_s;
        self.status.torque_nm = Some(guidance.torque.nm());
        self.status.limit = (guidance.limit != LimitReason::None).then(|| format!("{:?}", guidance.limit));
        if self.reset.is_some_and(|before| before != guidance.reset) {
            changes.push(format!("the ECU started anew: {:?}", guidance.reset));
        }
        self.reset = Some(guidance.reset);
        if self.mode != Some(guidance.mode) {
            changes.push(match self.mode {
                Some(before) => format!("mode {before:?} -> {:?}", guidance.mode),
                None => format!("mode {:?}, last start: {:?}", guidance.mode, guidance.reset),
            });
            self.mode = Some(guidance.mode);
            self.status.mode = Some(format!("{:?}", guidance.mode));
        }
        if self.status.warning != guidance.warning {
            self.status.warning = guidance.warning;
            let now = if guidance.warning {
                "take over"
            } else {
                "no longer"
            };
            changes.push(format!("driver warning: {now}"));
        }
        let faults = self.faults.difference(in_torque_frame()).union(guidance.faults);
        self.faults(faults, changes);
    }

    fn faults(&mut self, now: FaultSet, changes: &mut Vec<String>) {
        for fault in Fault::ALL {
            match (self.faults.contains(fault), now.contains(fault)) {
                (false, true) => changes.push(format!("fault {fault:?} (class {:?})", fault.class())),
                (true, false) => changes.push(format!("fault {fault:?} is gone")),
                _ => {}
            }
        }
        if now != self.faults {
            let present = Fault::ALL.into_iter().filter(|fault| now.contains(*fault));
            self.status.faults = present.map(|fault| format!("{fault:?}")).collect();
            self.faults = now;
        }
    }

    fn telemetry(&mut self, telemetry: &Telemetry, changes: &mut Vec<String>) {
        self.status.probe_nm = telemetry.probe.map(|torque| torque.nm());
        self.status.k_hg = telemetry.k_hg.map(|reading| reading.k_hg.si());
        self.status.k_hg_deviation = telemetry.k_hg.map(|reading| reading.deviation.si());
        if self.identified != telemetry.k_hg.is_some() {
            self.identified = !self.identified;
            changes.push(match self.status.k_hg {
                Some(k_hg) => format!("K_hg identified: {k_hg:.2}"),
                None => "K_hg no longer identified".into(),
            });
        }
    }

    fn rejection(&mut self, rejection: &Rejection, changes: &mut Vec<String>) {
        let reason = Reject::ALL.iter().position(|reason| *reason == rejection.reason);
        let key = (rejection.id, reason.unwrap_or_default() as u8);
        let before = self.rejections.insert(key, rejection.count);
        if before != Some(rejection.count) {
            let info = MESSAGES.iter().find(|info| info.id == rejection.id);
            let name = info.map_or_else(|| format!("0x{:03X}", rejection.id), |info| info.name.into());
            changes.push(format!(
                "{name} not used, {:?}: {} since its start",
                rejection.reason, rejection.count
            ));
        }
    }
}

/// The torque frame has room for the first faults of the word; it is the latest word on these.
const fn in_torque_frame() -> FaultSet {
    FaultSet::from_bits((1 << Guidance::FAULTS) - 1)
}

/// A frame by itself: its counter is judged apart, and no sender has to be trusted to be shown.
fn decoded<M: Message>(frame: &Frame) -> Option<M> {
    M::decode(&mut { ReceiverState::TRUSTED }, frame).ok()
}

/// An adapter that is listened to.
pub struct Listener {
    port: Port,
}

impl Listener {
    /// Opens the way to a bus, named as for [`super::Target::Board`].
    ///
    /// # Errors
    /// What is missing on the way.
    pub fn on(adapter: &str) -> Result<Self, PilError> {
        Ok(Self {
            port: Port::open(adapter)?,
        })
    }

    /// Over a way that is open already: a serial port opens once.
    #[must_use]
    pub fn after(product: Product) -> Self {
        Self { port: product.port }
    }

    /// What the adapter wrote beside frames of this bus.
    #[must_use]
    pub fn unread(&self) -> Unread {
        self.port.unread()
    }

    /// The next frame; `None` when none came for a tenth of a second.
    ///
    /// # Errors
    /// The adapter is gone, or speaks something else.
    pub fn frame(&mut self) -> Result<Option<Frame>, PilError> {
        self.port.frame()
    }
}
