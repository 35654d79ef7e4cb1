//! The torque: what the law asks for, what the probe adds, the way to zero where guidance ends, and what the limits leave.

use super::{Step, add_probe};
use crate::controller::injection::Injection;
use crate::controller::inputs::{Input, Request};
use crate::controller::memory::ChangedParts;
use crate::lane::LaneSample;
use crate::law::Law;
use crate::law::activity::Sample;
use crate::observer::Sensor;
use crate::quantity::{Micros, Ratio, Torque, share_of};
use crate::safety::envelope::{LimitReason, Situation, Yielding};
use crate::safety::faults::{Fault, FaultSet};
use crate::safety::modes::Mode;
use crate::safety::ramp::{pace, smaller_of_same_sign};

impl<I: Injection> Step<'_, I> {
    /// The torque, the part of it that is the probe, and what limited it.
    pub(super) fn torque(&mut self, mode: Mode, faults: FaultSet) -> (Torque, Option<Torque>, LimitReason) {
        let (wanted, probe) = match mode {
            Mode::Active => {
                let demanded = self.guidance();
                let probe = self.probe();
                (add_probe(demanded, probe), probe)
            }
            Mode::Handover => (self.handover(faults), None),
            Mode::Fade => (self.ending(1), None),
            // These modes have no torque, from their first step on.
            Mode::Boot | Mode::Standby | Mode::Fault | Mode::Locked => {
                return (Torque::ZERO, None, LimitReason::Mode);
            }
        };
        // Without a column the override limit cannot act; the mode is not Active then either.
        let driver = self.hands.unwrap_or(Torque::ZERO);
        let situation = Situation {
            applied: self.applied,
            elapsed: self.elapsed,
            driver,
            yielding: match self.sensor {
                Sensor::Hands => Yielding::AtOnce,
                Sensor::Bar(_) => Yielding::Gradually,
            },
        };
        let distrusted;
        let envelope = if mode == Mode::Handover && faults.contains(Fault::LaneImplausible) {
            distrusted = self.config.envelope.distrusted();
            &distrusted
        } else {
            &self.config.envelope
        };
        let (torque, limit) = envelope.step(&mut self.memory.fast.envelope, self.now, wanted, &situation);
        match limit {
            LimitReason::None if mode != Mode::Active => (torque, probe, LimitReason::Mode),
            LimitReason::None => (torque, probe, limit),
            // Where a limit acts, the probe is at most as much of the torque as was left.
            _ => (torque, probe.map(|probe| common_part(probe, torque)), limit),
        }
    }

    /// The way to zero of a handover, which is faster the more reason there is.
    fn handover(&mut self, faults: FaultSet) -> Torque {
        let demanded = self.guidance();
        let is_plausible = !faults.contains(Fault::ColumnImplausible);
        let ending = self.ending(pace(self.applied, self.hands, is_plausible));
        // While the lane is known, no more than the law demands: a curve may end before the ramp does.
        if self.lane.value().is_some() {
            smaller_of_same_sign(ending, demanded)
        } else {
            ending
        }
    }

    /// The ramp to zero, so many times as fast as it was made.
    fn ending(&mut self, pace: u32) -> Torque {
        let passed = Micros::from_us(self.elapsed.us().saturating_mul(pace));
        self.changed.add(ChangedParts::RAMP);
        // Where the envelope or the driver has brought the torque below its ramp, it does not rise again.
        smaller_of_same_sign(self.memory.ramp.step(passed), self.applied)
    }

    /// The probe's torque, while it is wanted or on its way out.
    fn probe(&mut self) -> Option<Torque> {
        // The probe needs a lane that is fully trusted.
        let wanted = self.inputs.request.value().is_some_and(|r| r.probe) && self.memory.coast.is_idle();
        self.config
            .probe
            .step(&mut self.memory.fast.probe, self.elapsed, wanted)
    }

    /// The torque of (9) times four shares: the authority that the host asks for, that of the schedule at this speed, the trust in
    /// the lane, and what the law leaves. Without a request the authority is 1: the mode ends guidance then. Without a lane the
    /// torque is zero.
    #[inline(always)]
    fn guidance(&mut self) -> Torque {
        let demanded = self.lane.value().map_or(Torque::ZERO, |sample| {
            if !self.memory.law.is_latest(&sample) {
                self.changed.add(ChangedParts::LAW);
                self.law.coefficients().update(&mut self.memory.law, sample);
            }
            self.demanded_by_paper(sample, self.is_late)
        });
        let left = self.left_by_law(demanded);
        let demanded = self.injection.law(self.memory.coast.limited(demanded));
        // Clamped to 0 to 1: beyond that the host is wrong.
        let share = |request: Request| request.authority.max(Ratio::ZERO).min(Ratio::ONE);
        let authority = self.inputs.request.value().map_or(Ratio::ONE, share);
        // No factor exceeds 1, so the product cannot overflow.
        let share = share_of(authority.fixed(), self.memory.share.fixed());
        let share = share_of(share, self.memory.coast.trust.fixed());
        let share = share_of(share, left.fixed());
        Torque::from_fixed(share_of(share, demanded.fixed()))
    }

    /// What (9) demands for the sample that it took last.
    pub(super) fn demanded_by_paper(&self, sample: LaneSample, is_late: bool) -> Torque {
        let ego = is_late.then(|| self.ego_motion(sample));
        let coefficients = self.law.coefficients();
        coefficients.demanded(&self.memory.law, self.now, ego.as_ref())
    }

    /// The share of (9) that the law leaves where (9) asks for so much.
    fn left_by_law(&mut self, asked: Torque) -> Ratio {
        match self.law {
            Law::Paper(_) => Ratio::ONE,
            Law::DriverActivity {
                coefficients,
                least_share,
            } => {
                let sample = match &self.inputs.column {
                    Input::New(column) => Some(Sample {
                        at: self.now,
                        wheel: column.wheel_angle,
                        torques: [self.hands.unwrap_or(column.driver_torque), asked],
                    }),
                    Input::Held(_) | Input::Lost => None,
                };
                let activity = &mut self.once.activity;
                activity.step(coefficients, sample);
                activity.share(least_share)
            }
        }
    }
}

/// `part`, cut to what lies between zero and `whole`.
fn common_part(part: Torque, whole: Torque) -> Torque {
    part.max(whole.min(Torque::ZERO)).min(whole.max(Torque::ZERO))
}
