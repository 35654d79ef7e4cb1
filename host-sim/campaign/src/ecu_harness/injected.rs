//! What is wrong inside the ECU, at the motor and at the wheel.

use haptic_core::bus::messages::ResetCause;
use haptic_core::ecu::injection::InjectedEcu;
use haptic_core::ecu::{Boot, Ecu};
use haptic_core::quantity::{Instant, Torque};
use rand::RngExt;

use super::EcuHarness;
use crate::injection::{Hand, Injection, Inside, Motor, first_of};

/// A new random law every so many ms.
const LAW_HELD_MS: i64 = 200;
/// A hand taps five times a second, 40 ms each.
const TAP_EVERY_MS: i64 = 200;
const TAP_MS: i64 = 40;

impl EcuHarness<'_> {
    /// What goes wrong in the ECU in this step.
    pub(super) fn disturb_inside(&mut self, step: u32, now_us: u32) {
        let since = self.timing.since(step);
        if since < 0 || self.timing.healthy {
            return;
        }
        for injection in self.row.injections {
            let Injection::Inside(inside) = injection else {
                continue;
            };
            match inside {
                Inside::Flip(region) if since == 0 => {
                    let bit = self.rng.random_range(0..self.ecu.redundant_bits(*region));
                    self.ecu.flip_bit(*region, bit);
                }
                Inside::LawForced if since == 0 => {
                    let away = if self.commanded_nm > 0.0 { -5.0 } else { 5.0 };
                    self.ecu.force_law(Some(Torque::from_nm(away)));
                }
                Inside::LawInterrupted => {
                    let torque_nm = if since % 16 == 0 { 0.0 } else { 5.0 };
                    self.ecu.force_law(Some(Torque::from_nm(torque_nm)));
                }
                Inside::LawRandom if since % LAW_HELD_MS == 0 => {
                    let torque_nm = self.rng.random_range(-5.0..5.0);
                    self.ecu.force_law(Some(Torque::from_nm(torque_nm)));
                }
                Inside::MonitorAgrees if since == 0 => self.ecu.blind_monitor(|_| true),
                Inside::BrownOut if since == 0 => {
                    let boot = Boot {
                        reset: ResetCause::BrownOut,
                        recent_resets: 1,
                        ..Boot::default()
                    };
                    self.ecu = InjectedEcu::new(Ecu::new(Some(&self.setup), boot, Instant::from_us(now_us)));
                    self.checker.reset(now_us);
                }
                _ => {}
            }
        }
    }

    /// Torque that the motor delivers, N.m.
    pub(super) fn motor(&self, step: u32) -> f64 {
        match first_of!(self.timing.acting(step), Injection::Motor(motor) => *motor) {
            None => self.commanded_nm,
            Some(Motor::Times(share)) => share * self.commanded_nm,
            Some(Motor::Stuck) => self.stuck_nm,
        }
    }

    /// Torque of a hand on the wheel, N.m, beside that of the driver's arm.
    pub(crate) fn hand_torque_nm(&self, step: u32, arm_torque_nm: f64) -> f64 {
        let since = self.timing.since(step);
        let against = if self.commanded_nm == 0.0 {
            -self.side
        } else {
            -self.commanded_nm.signum()
        };
        match first_of!(self.row.injections, Injection::Hand(hand) => *hand) {
            Some(Hand::Jerk {
                peak_nm,
                ms,
                before_ms,
            }) => {
                let phase = (since + i64::from(before_ms)) as f64 / f64::from(ms);
                if (0.0..1.0).contains(&phase) {
                    self.side * peak_nm * (std::f64::consts::PI * phase).sin()
                } else {
                    0.0
                }
            }
            // The hand makes the driver torque what it says, whatever the arm does.
            Some(Hand::Opposes { torque_nm, ms }) if (0..i64::from(ms)).contains(&since) => {
                against * torque_nm - arm_torque_nm
            }
            Some(Hand::Taps { torque_nm }) if since >= 0 && since % TAP_EVERY_MS < TAP_MS => {
                against * torque_nm - arm_torque_nm
            }
            _ => 0.0,
        }
    }
}
