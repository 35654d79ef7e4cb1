//! The torque of a step, in f64: law (9), the probe, the ways to zero, the envelope.

use super::coast::Sight;
use super::receivers::{Lane, Request, Seen};
use super::{LSB, Reference, is_close, near, per_second, smaller};
use haptic_core::controller::inputs::Input;
use haptic_core::safety::envelope::LimitReason;
use haptic_core::safety::faults::{Fault, FaultSet};
use haptic_core::safety::modes::Mode;

impl Reference {
    /// The torque, the probe's part of it, and the limit that acted.
    pub(super) fn torque(
        &mut self,
        now: i64,
        elapsed: i64,
        seen: &Seen,
        lane: &Input<Lane>,
        faults: FaultSet,
    ) -> (f64, Option<f64>, LimitReason) {
        let demanded = match self.mode {
            Mode::Active | Mode::Handover => self.guidance(now, seen, lane),
            _ => 0.0,
        };
        let driver = seen.column.value().map(|column| column.driver);
        let (wanted, probe) = match self.mode {
            Mode::Active => {
                let is_wanted = seen.request.value().is_some_and(|request| request.probe);
                let probe = self.step_probe(elapsed, is_wanted && self.coast.is_idle());
                (demanded + probe.unwrap_or(0.0), probe)
            }
            Mode::Fade | Mode::Handover => {
                let against = driver.map(|driver| -driver * self.applied.signum());
                let pace = match against {
                    _ if self.mode == Mode::Fade => 1,
                    _ if faults.contains(Fault::ColumnImplausible) => 4,
                    None => 2,
                    Some(against) if self.applied != 0.0 && against > 0.1 => 3,
                    Some(_) => 1,
                };
                self.ramp.done += elapsed * pace;
                let left = (self.ramp.length - self.ramp.done).max(0) as f64;
                let ramp = self.ramp.from * left / self.ramp.length as f64;
                let ending = smaller(ramp, self.applied);
                if self.mode == Mode::Handover && lane.value().is_some() {
                    (smaller(ending, demanded), None)
                } else {
                    (ending, None)
                }
            }
            _ => return (0.0, None, LimitReason::Mode),
        };
        let is_lie = self.mode == Mode::Handover && faults.contains(Fault::LaneImplausible);
        let (torque, limit) = self.envelope(now, elapsed, wanted, driver.unwrap_or(0.0), is_lie);
        match limit {
            LimitReason::None if self.mode != Mode::Active => (torque, probe, LimitReason::Mode),
            LimitReason::None => (torque, probe, limit),
            _ => (
                torque,
                probe.map(|p| p.clamp(torque.min(0.0), torque.max(0.0))),
                limit,
            ),
        }
    }

    fn envelope(
        &mut self,
        now: i64,
        elapsed: i64,
        wanted: f64,
        driver: f64,
        is_lie: bool,
    ) -> (f64, LimitReason) {
        let p = &self.c.params;
        if now - self.anchor.1 >= 250_000 {
            self.anchor = (self.applied, now);
        }
        let mut command = (wanted, LimitReason::None);
        let mut hold = |low: f64, high: f64, reason| {
            let held = command.0.max(low).min(high);
            if command.0 != 0.0 {
                is_close(10.0 * (command.0 - low));
                is_close(10.0 * (command.0 - high));
            }
            if held != command.0 {
                command = (held, reason);
            }
        };
        let limit = near(p.torque_limit_nm);
        hold(-limit, limit, LimitReason::Absolute);
        let window = self.anchor.0.abs() + near(1.2);
        hold(-window, window, LimitReason::Window);
        let us = elapsed.min(2000);
        let growth = per_second(p.wind_up_nm_per_s, us);
        let times = if is_lie { 4.0 } else { 1.0 };
        let fall = (per_second(times * p.reduction_nm_per_s, us) - 1.0 / 4096.0).max(0.0);
        // In the frame in which the torque applied is to the left; across zero the new one winds up.
        let applied = self.applied.abs();
        let (low, by) = if applied > fall {
            (applied - fall, LimitReason::Reduction)
        } else {
            (-growth, LimitReason::WindUp)
        };
        let high = applied + growth;
        if self.applied < 0.0 {
            hold(-high, f64::INFINITY, LimitReason::WindUp);
            hold(f64::NEG_INFINITY, -low, by);
        } else {
            hold(f64::NEG_INFINITY, high, LimitReason::WindUp);
            hold(low, f64::INFINITY, by);
        }
        let bound = |toward: f64| (limit + 3.0 * (toward + near(0.8))).clamp(0.0, limit);
        hold(-bound(-driver), bound(driver), LimitReason::DriverOverride);
        command
    }

    /// Amplitude and phase grow together; the share falls in a period.
    fn step_probe(&mut self, elapsed: i64, is_wanted: bool) -> Option<f64> {
        let advance = self.c.phase_per_us.wrapping_mul(elapsed.min(2000) as u32);
        let [phase, gain] = &mut self.probe;
        *gain = if is_wanted {
            gain.saturating_add(advance)
        } else {
            gain.saturating_sub(advance)
        };
        if *gain == 0 || self.c.params.probe_amplitude_nm == 0.0 {
            self.probe = [0; 2];
            return None;
        }
        *phase = phase.wrapping_add(advance);
        let turn = f64::from(*phase) / 4_294_967_296.0;
        let share = f64::from(*gain) / 4_294_967_296.0;
        Some(self.c.params.probe_amplitude_nm * share * (turn * std::f64::consts::TAU).sin())
    }

    /// Or no probe: a sixteenth of a turn about each zero.
    pub(super) fn probe_passes_zero(&self) -> bool {
        let [phase, gain] = self.probe;
        let turns = f64::from(phase) / 4_294_967_296.0;
        gain == 0 || (2.0 * turns - (2.0 * turns).round()).abs() < 1.0 / 16.0
    }

    fn guidance(&mut self, now: i64, seen: &Seen, lane: &Input<Lane>) -> f64 {
        let demanded = lane.value().map_or(0.0, |sample| {
            if self.law.last != Some(sample) {
                self.take_sample(sample);
            }
            self.demanded(now, &sample)
        });
        let left = self.left_by_driver(now, seen, demanded);
        let demanded = if self.coast.sight == Sight::Sees {
            demanded
        } else {
            // 1 N.m/s away from what the last picture asked for.
            let away = 16.0 * LSB * self.coast.lost.min(1_000_000) as f64;
            demanded.clamp(self.coast.demanded - away, self.coast.demanded + away)
        };
        let authority = seen
            .request
            .value()
            .map_or(1.0, |Request { authority, .. }| authority);
        demanded * authority * self.share * self.coast.trust * left
    }

    /// The share of (9) that driver activity leaves, by docs/reference/laws-and-drivers.md; all of it with the paper's law.
    fn left_by_driver(&mut self, now: i64, seen: &Seen, asked: f64) -> f64 {
        let p = &self.c.params;
        if p.law == 0.0 {
            return 1.0;
        }
        let activity = &mut self.activity;
        if let Some((at, column, asked)) = activity.pending.take() {
            let tau = 1.0 / (std::f64::consts::TAU * p.rate_corner_hz);
            let passed = activity
                .last
                .map_or(0.1, |(_, last)| (at - last) as f64 * 1e-6)
                .min(0.1);
            activity.rate = match activity.last {
                Some((last, _)) if passed < 0.1 => {
                    (tau * activity.rate + column.wheel - last) / (tau + passed)
                }
                _ => 0.0,
            };
            activity.last = Some((column.wheel, at));
            let power = column.driver * asked * activity.rate.powi(2).min(64.0);
            activity.size += passed * (power.abs() - activity.size);
            let agreement = activity.agreement + passed / 0.5 * (power - activity.agreement);
            activity.agreement = agreement.clamp(-activity.size, activity.size);
        } else if let Input::New(column) = seen.column {
            activity.pending = Some((now, column, asked));
        }
        let against = (-activity.agreement / (activity.size + 0.5_f64.powi(20))).max(0.0);
        1.0 - (1.0 - p.activity_lambda_min) * against
    }

    fn take_sample(&mut self, sample: Lane) {
        let tau = 1.0 / (std::f64::consts::TAU * self.c.params.rate_corner_hz);
        match self.law.last {
            Some(last) if (0..=100_000).contains(&(sample.at - last.at)) => {
                let dt = (sample.at - last.at) as f64 * 1e-6;
                let moved = [sample.e_y - last.e_y, sample.e_theta - last.e_theta];
                if dt > 0.0 {
                    for (rate, moved) in self.law.rates.iter_mut().zip(moved) {
                        *rate = (tau * *rate + moved) / (tau + dt);
                    }
                }
            }
            _ => self.law.rates = [0.0; 2],
        }
        self.law.last = Some(sample);
    }

    /// Equation (9) from the last sample, which goes on at its rates; one that was old when it came is corrected by how the vehicle has
    /// turned since, against turning on as it did.
    pub(super) fn demanded(&self, now: i64, sample: &Lane) -> f64 {
        let Some(last) = self.law.last else { return 0.0 };
        let age = per_second(1.0, now - last.at);
        let (mut e_y, mut e_theta, [mut y_rate, mut theta_rate]) = (last.e_y, last.e_theta, self.law.rates);
        if (now - sample.at) - (now - self.times[0]) > 10_000 {
            let (v, near) = (self.checks.v, self.c.near_time * self.checks.v);
            let turned = self.turned - per_second(self.rate_then, now - sample.at);
            let turned = turned.clamp(-0.04, 0.04);
            let faster = (self.checks.turning(&self.c) - self.rate_then).clamp(-0.3, 0.3);
            let going = theta_rate * age;
            let slower = v * (turned - going) + near * faster;
            e_y += -near * turned - v * turned * age / 3.0 + v * going * age / 2.0 + slower * age;
            e_theta += faster * age - turned;
            (y_rate, theta_rate) = (y_rate - slower, theta_rate - faster);
        }
        let p = &self.c.params;
        p.k_1
            * (p.a_1 * (e_y + y_rate * age)
                + p.a_2 * y_rate
                + p.a_3 * (e_theta + theta_rate * age)
                + p.a_4 * theta_rate)
    }
}
