//! What an honest motor may deliver, as docs/explanation/behaviour.md has it: a dead time of 8 ms, a lag of 21 ms, an error of 0.1 N.m and
//! an eighth.

use super::exceeds;
use haptic_core::safety::actuator::Motor;
use std::collections::VecDeque;

#[derive(Debug, Clone)]
pub(crate) struct MotorCheck {
    /// Torques that were commanded in the last 8 ms, newest first.
    commands: VecDeque<f64>,
    low: f64,
    high: f64,
    delivered: f64,
    /// For how many steps the measurement still speaks; steps in a row with too much, and with too little.
    speaks_for: u32,
    astray: u32,
    weak: u32,
}

impl Default for MotorCheck {
    fn default() -> Self {
        Self {
            commands: [0.0; 8].into(),
            low: 0.0,
            high: 0.0,
            delivered: 0.0,
            speaks_for: 0,
            astray: 0,
            weak: 0,
        }
    }
}

impl MotorCheck {
    pub(crate) fn deliver(&mut self, torque: f64) {
        (self.delivered, self.speaks_for) = (torque, 4);
    }

    pub(crate) fn judge(&mut self, command: f64) -> Motor {
        let before = self.commands.pop_back().unwrap();
        self.commands.push_front(command);
        let (low, high) = (command.min(before), command.max(before));
        self.low = low.min(self.low + (low - self.low) * 3.0 / 64.0);
        self.high = high.max(self.high + (high - self.high) * 3.0 / 64.0);
        if self.speaks_for > 0 {
            self.speaks_for -= 1;
            let above = |t: f64| exceeds(self.delivered, t + t.abs() / 8.0 + 0.1);
            let below = |t: f64| exceeds(t - t.abs() / 8.0 - 0.1, self.delivered);
            let is_astray = above(self.high.max(0.0)) || below(self.low.min(0.0));
            let is_weak = !is_astray && (above(self.high) || below(self.low));
            self.astray = if is_astray { self.astray + 1 } else { 0 };
            self.weak = if is_weak { self.weak + 1 } else { 0 };
        }
        match (self.astray, self.weak) {
            (11.., _) => Motor::Astray,
            (_, 51..) => Motor::Weak,
            _ => Motor::Obeys,
        }
    }
}
