//! What must hold in every step, whatever comes in. Computed from what was sent and what came out, in f64.

use super::{Heard, Rig};
use haptic_core::bus::messages::{Guidance, Message};
use haptic_core::ecu::Step;
use haptic_core::safety::faults::{Fault, FaultSet};
use haptic_core::safety::modes::Mode;
use std::collections::VecDeque;

/// The resolution of the torque on the bus, N.m.
const BUS_LSB: f64 = 1.0 / 4096.0;
/// For how long a fault of an implausible input may have been there before it was declared, us.
const UNSEEN: [(Fault, u64); 3] = [
    (Fault::LaneImplausible, 2_000_000),
    (Fault::ColumnImplausible, 1_500_000),
    (Fault::SpeedImplausible, 800_000),
];
/// For how long outputs are kept here: the longest of these, with 40 ms between two outputs that the ECU keeps, and late
/// steps, us.
const KEPT_US: u64 = 2_100_000;
/// A frame may have come so long before the step that took it, us.
const LATEST_STEP_US: u64 = 13_000;
/// The resolution inside the core, for the roundings of its bounds, N.m.
const LSB: f64 = 1.0 / 16_777_216.0;

/// The last step, and counts.
#[derive(Debug, Clone)]
pub(crate) struct Watch {
    limit: f64,
    torque: f64,
    t_us: u64,
    mode: Mode,
    standby_since_us: u64,
    /// The request has been low since the last time it was high.
    was_low: bool,
    anchor: f64,
    anchor_t_us: u64,
    /// Time and magnitude of the outputs of the last while, without the probe.
    outputs: VecDeque<(u64, f64)>,
    /// For how long pictures have been missing in Active.
    dark_us: u64,
    /// Where the handover's line begins, and when.
    line: (f64, u64),
    pub(crate) steps: u64,
    pub(crate) by_mode: [u64; 7],
    pub(crate) by_limit: [u64; 8],
}

impl Watch {
    pub(crate) fn new(limit: f64) -> Self {
        Self {
            limit,
            torque: 0.0,
            t_us: 0,
            mode: Mode::Boot,
            standby_since_us: 0,
            was_low: false,
            anchor: 0.0,
            anchor_t_us: 0,
            outputs: VecDeque::new(),
            dark_us: 0,
            line: (0.0, 0),
            steps: 0,
            by_mode: [0; 7],
            by_limit: [0; 8],
        }
    }

    /// Watches a bench that is guiding already.
    pub(crate) fn engaged(rig: &Rig) -> Self {
        Self {
            torque: rig.applied,
            anchor: rig.applied,
            t_us: rig.t_us,
            anchor_t_us: rig.t_us,
            mode: Mode::Active,
            ..Self::new(5.0)
        }
    }

    /// The ECU was started anew.
    pub(crate) fn restart(&mut self, rig: &Rig) {
        let (steps, by_mode, by_limit) = (self.steps, self.by_mode, self.by_limit);
        *self = Self {
            t_us: rig.t_us,
            anchor_t_us: rig.t_us,
            steps,
            by_mode,
            by_limit,
            ..Self::new(self.limit)
        };
    }

    /// Judges a step.
    #[expect(
        clippy::too_many_lines,
        reason = "every rule of every cycle, one after the other"
    )]
    pub(crate) fn check(&mut self, rig: &Rig, step: &Step) {
        let (torque, mode) = (step.command.torque.nm(), step.command.mode);
        // Without a picture from 0.2 s on, give or take a few steps.
        let is_dark = [Fault::LaneTimeout, Fault::LaneInvalid, Fault::LaneStep]
            .into_iter()
            .any(|fault| step.command.faults.contains(fault));
        self.dark_us = if mode == Mode::Active && is_dark {
            self.dark_us + rig.t_us - self.t_us
        } else {
            0
        };
        let context = || format!("t = {} us, {:?}, was {self:?}", rig.t_us, step.command);
        let dt_s = (rig.t_us - self.t_us).min(2000) as f64 * 1e-6;

        assert!(torque.abs() <= self.limit, "limit: {}", context());
        let grown = torque.abs() - self.torque.abs();
        assert!(grown <= 4.0 * dt_s + 2.0 * LSB, "wind-up: {}", context());
        assert!(
            torque.abs() <= self.anchor.abs() + 1.2 + LSB,
            "window: {}",
            context()
        );
        // In the frame in which the torque was positive, the most that the driver leaves.
        let mut left = f64::INFINITY;
        if let Some((driver, _)) = rig.heard.driver.filter(|(_, t)| rig.t_us - t <= 30_000) {
            let bound = |toward: f64| (self.limit + 3.0 * (toward + 0.8)).clamp(0.0, self.limit) + 8.0 * LSB;
            assert!(
                torque <= bound(driver) && torque >= -bound(-driver),
                "driver {driver}: {}",
                context()
            );
            left = if self.torque < 0.0 {
                bound(-driver)
            } else {
                bound(driver)
            };
        }
        let same_way = if self.torque < 0.0 { -torque } else { torque };
        let is_lie = mode == Mode::Handover && step.command.faults.contains(Fault::LaneImplausible);
        let per_s = if is_lie { 32.0 } else { 8.0 };
        let (fallen, most) = (self.torque.abs() - same_way, per_s * dt_s + 2.0 * LSB);
        assert!(
            fallen <= most
                // Across zero it grows from there.
                || (self.torque.abs() <= most && -same_way <= 4.0 * dt_s + 2.0 * LSB)
                || same_way >= left - BUS_LSB - 8.0 * LSB
                || mode == Mode::Fault,
            "reduction: {}",
            context()
        );
        let has_torque = matches!(mode, Mode::Active | Mode::Fade | Mode::Handover);
        assert!(has_torque || torque == 0.0, "mode: {}", context());
        assert!(
            !matches!(mode, Mode::Fade | Mode::Handover) || grown <= 0.0,
            "ending: {}",
            context()
        );
        if mode == Mode::Active {
            assert!(
                self.is_fresh(&rig.heard, rig.t_us),
                "age: {:?}, {}",
                rig.heard,
                context()
            );
        }
        let line = if mode == Mode::Handover && self.mode != Mode::Handover {
            let trusted = self.trusted(&rig.heard, rig.t_us, step.command.faults);
            (trusted.min(self.torque.abs()), self.t_us)
        } else {
            self.line
        };
        if mode == Mode::Handover {
            let passed_s = (rig.t_us - line.1) as f64 * 1e-6;
            let most = line.0 * (1.0 - passed_s / 2.0).max(0.0);
            // The ECU remembers its outputs finer than the bus shows them.
            assert!(
                torque.abs() <= most + BUS_LSB + LSB || fallen >= per_s * dt_s - BUS_LSB - LSB,
                "line {line:?}, {most} N.m: {}",
                context()
            );
        }
        let latched = matches!(self.mode, Mode::Fault | Mode::Locked);
        assert!(!latched || mode == self.mode, "latch: {}", context());
        let request = rig
            .heard
            .engage
            .filter(|(_, t)| rig.t_us - t <= 30_000)
            .map(|(high, _)| high);
        if mode == Mode::Active && self.mode != Mode::Active {
            assert!(request == Some(true) && self.was_low, "edge: {}", context());
            assert!(
                self.mode == Mode::Standby && rig.t_us - self.standby_since_us >= 500_000,
                "ready: {}",
                context()
            );
        }
        let may_warn = (180_000..220_000).contains(&self.dark_us) && step.command.warning;
        let must_warn = matches!(mode, Mode::Handover | Mode::Fault | Mode::Locked)
            || (mode == Mode::Active && step.command.faults.contains(Fault::LaneStep))
            || self.dark_us >= 220_000
            || may_warn
            || step.command.faults.contains(Fault::HandsOff);
        assert_eq!(step.command.warning, must_warn, "warning: {}", context());
        if must_warn && mode != self.mode && !matches!(self.mode, Mode::Handover | Mode::Fault | Mode::Locked)
        {
            assert!(
                step.others.iter().any(|frame| frame.id() == 0x0D0),
                "warning: {}",
                context()
            );
        }
        assert!(step.permitted || mode == Mode::Fault, "permission: {}", context());
        let bytes: [u8; 8] = step.guidance.data().try_into().unwrap();
        let sent = Guidance::unpack(&bytes).unwrap();
        assert!(
            Guidance::PROTECTION.is_intact(&bytes)
                && (sent.torque, sent.mode) == (step.command.torque, mode)
                && sent.faults == step.command.faults,
            "frame: {}",
            context()
        );

        match request {
            Some(false) => self.was_low = true,
            Some(true) => self.was_low = false,
            None => {}
        }
        if mode == Mode::Standby && self.mode != Mode::Standby {
            self.standby_since_us = rig.t_us;
        }
        if rig.t_us - self.anchor_t_us >= 250_000 {
            (self.anchor, self.anchor_t_us) = (torque, rig.t_us);
        }
        (self.torque, self.t_us, self.mode, self.line) = (torque, rig.t_us, mode, line);
        let probe = step.command.probe.map_or(0.0, |probe| probe.nm());
        self.outputs.push_back((rig.t_us, (torque - probe).abs()));
        let oldest = rig.t_us.saturating_sub(KEPT_US);
        while self.outputs.front().is_some_and(|(t, _)| *t < oldest) {
            self.outputs.pop_front();
        }
        self.steps += 1;
        self.by_mode[mode as usize] += 1;
        self.by_limit[step.command.limit as usize] += 1;
    }

    /// Whether every input is one that the slowest sender may leave behind: three of its periods, for a lane a second more,
    /// and a lane sample that was at most 150 ms old when it came. That each sender is waited for no longer than its own period asks, tests of their
    /// own show.
    fn is_fresh(&self, heard: &Heard, t_us: u64) -> bool {
        let lane = heard
            .lane
            .is_some_and(|(age, t)| t_us - t <= 1_201_001 && age <= 150_000);
        let others = [heard.driver.map(|d| d.1), heard.engage.map(|e| e.1), heard.speeds];
        lane && others.iter().all(|t| t.is_some_and(|t| t_us - t <= 75_000))
    }

    /// The largest output that may be trusted: of before the silence that the faults tell of, or of 250 ms ago.
    fn trusted(&self, heard: &Heard, t_us: u64, faults: FaultSet) -> f64 {
        let silences = [
            (Fault::LaneTimeout, heard.lane.map(|l| l.1)),
            (Fault::LaneStep, heard.lane.map(|l| l.1)),
            (Fault::SpeedStep, heard.speeds),
            (Fault::ColumnTimeout, heard.driver.map(|d| d.1)),
            (Fault::SpeedTimeout, heard.speeds),
            (Fault::RequestTimeout, heard.engage.map(|e| e.1)),
        ];
        let silence = silences
            .iter()
            .filter(|(fault, _)| faults.contains(*fault))
            .map(|(_, heard_at)| t_us - heard_at.unwrap_or(t_us));
        let unseen = UNSEEN.iter().filter(|(fault, _)| faults.contains(*fault));
        let suspect = unseen.map(|(_, us)| *us).chain(silence).max().unwrap_or(0);
        let youngest = (t_us + LATEST_STEP_US).saturating_sub(suspect);
        // A bench that was guiding before it was watched has outputs that are not known.
        let known = self.outputs.front().is_some_and(|(t, _)| t_us - t >= suspect);
        let outputs = self.outputs.iter().filter(|(t, _)| *t <= youngest);
        if known {
            outputs.map(|(_, torque)| *torque).fold(0.0, f64::max)
        } else {
            f64::INFINITY
        }
    }
}
