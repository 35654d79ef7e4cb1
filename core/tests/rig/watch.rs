//! What must hold in every step, whatever comes in. Computed from what was sent and what came out, in f64.

use super::Rig;
use haptic_core::bus::messages::{Guidance, Message};
use haptic_core::ecu::Step;
use haptic_core::modes::Mode;

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
            steps: 0,
            by_mode: [0; 7],
            by_limit: [0; 8],
        }
    }

    /// Of a bench that is guiding already.
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
    pub(crate) fn check(&mut self, rig: &Rig, step: &Step) {
        let (torque, mode) = (step.command.torque.nm(), step.command.mode);
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
        if let Some((driver, _)) = rig.heard_driver.filter(|(_, t)| rig.t_us - t <= 30_000) {
            let bound = |toward: f64| (self.limit + 3.0 * (toward + 0.8)).clamp(0.0, self.limit) + 8.0 * LSB;
            assert!(
                torque <= bound(driver) && torque >= -bound(-driver),
                "driver {driver}: {}",
                context()
            );
        }
        let has_torque = matches!(mode, Mode::Active | Mode::Fade | Mode::Handover);
        assert!(has_torque || torque == 0.0, "mode: {}", context());
        assert!(
            !matches!(mode, Mode::Fade | Mode::Handover) || grown <= 0.0,
            "ending: {}",
            context()
        );
        let latched = matches!(self.mode, Mode::Fault | Mode::Locked);
        assert!(!latched || mode == self.mode, "latch: {}", context());
        let request = rig
            .heard_engage
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
        let must_warn = matches!(mode, Mode::Handover | Mode::Fault | Mode::Locked);
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
        let sent = Guidance::unpack(u64::from_le_bytes(bytes)).unwrap();
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
        (self.torque, self.t_us, self.mode) = (torque, rig.t_us, mode);
        self.steps += 1;
        self.by_mode[mode as usize] += 1;
        self.by_limit[step.command.limit as usize] += 1;
    }
}
