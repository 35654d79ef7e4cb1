//! The plausibility checks in f64, as docs/explanation/plausibility.md has them.

use super::receivers::{Lane, follows};
use super::{Constants, down, exceeds, leak, per_second};
use std::collections::VecDeque;

/// How the vehicle turned, and where its line went: as much as the ECU keeps, newest first.
#[derive(Debug, Clone, Default)]
pub(crate) struct MotionHistory {
    headings: VecDeque<Heading>,
    lines: VecDeque<(i64, f64)>,
    /// Directions of another line that pictures show.
    others: VecDeque<(i64, f64)>,
}

#[derive(Debug, Clone, Copy)]
struct Heading {
    at: i64,
    psi: f64,
    rate: f64,
}

impl Heading {
    fn psi_at(&self, at: i64) -> f64 {
        self.psi + per_second(self.rate, at - self.at)
    }
}

impl MotionHistory {
    pub(crate) fn record_rate(&mut self, now: i64, rate: f64) {
        let psi = self.headings.front().map_or(0.0, |last| last.psi_at(now));
        self.headings.push_front(Heading { at: now, psi, rate });
        self.headings.truncate(32);
    }

    fn heading(&self, at: i64) -> Heading {
        let nothing = Heading {
            at,
            psi: 0.0,
            rate: 0.0,
        };
        let found = self.headings.iter().find(|heading| heading.at <= at).copied();
        let oldest = self.headings.get(31).map(|oldest| Heading {
            at,
            psi: oldest.psi - per_second(oldest.rate, oldest.at - at),
            ..*oldest
        });
        found.or(oldest).unwrap_or(nothing)
    }

    fn psi(&self, at: i64) -> f64 {
        self.heading(at).psi_at(at)
    }

    /// The angle turned since, and the rate over the 50 ms before.
    pub(crate) fn turned(&self, now: i64, from: i64) -> (f64, f64) {
        let then = self.psi(from);
        (self.psi(now) - then, (then - self.psi(from - 50_000)) * 20.0)
    }

    pub(crate) fn record_line(&mut self, at: i64, e_theta: f64) {
        let direction = self.psi(at) + e_theta;
        if self.lines.front().is_none_or(|(last, _)| at - last >= 20_000) {
            self.lines.push_front((at, direction));
            self.lines.truncate(32);
        }
    }

    pub(crate) fn forget_line(&mut self) {
        self.lines.clear();
    }

    fn swap(&mut self) {
        std::mem::swap(&mut self.lines, &mut self.others);
    }

    /// The line's direction `between` before, against the heading at `at`.
    fn line_direction(&self, at: i64, between: i64) -> Option<f64> {
        let wanted = at - between;
        let place = self.lines.iter().position(|(then, _)| *then <= wanted)?;
        let ((from, direction), (to, next)) = (self.lines[place], self.lines[place.saturating_sub(1)]);
        // In steps of 2^-10.
        let share = ((wanted - from) * 1024)
            .checked_div(to - from)
            .unwrap_or(0)
            .min(1024);
        Some(direction + (next - direction) * share as f64 / 1024.0 - self.psi(at))
    }

    /// Over the last 0.3 s the line bent so fast.
    fn bend(&self) -> f64 {
        let oldest = self.lines.get(self.lines.len().saturating_sub(1).min(15));
        match (self.lines.front(), oldest) {
            (Some((to, last)), Some((from, first))) if to > from => (last - first) * 1e6 / (to - from) as f64,
            _ => 0.0,
        }
    }
}

/// The yaw rate: believed or not.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Yaw {
    bias: f64,
    sum: f64,
    held: i64,
    distrust: i64,
}

impl Yaw {
    pub(crate) fn is_distrusted(&self) -> bool {
        self.distrust > 0
    }

    fn judge(&mut self, rate: f64, last: Option<f64>, by_wheel: f64, v: f64, passed: i64) -> Option<f64> {
        let is_impossible =
            last.is_some_and(|last| exceeds((rate - last).abs(), 0.15)) || exceeds((v * rate).abs(), 12.0);
        if is_impossible {
            self.held += passed;
            if last.is_some() && self.held <= 100_000 {
                return last;
            }
            self.distrust = 3_000_000;
            return None;
        }
        self.held = 0;
        if !exceeds((v * by_wheel).abs(), 3.0) {
            let differs = rate - by_wheel - self.bias;
            self.sum = leak(self.sum, per_second(differs, passed), passed);
            let learnt = per_second(down(differs / 16.0), passed);
            self.bias = (self.bias + learnt).clamp(-0.025, 0.025);
            let margin = 0.03 + rate.abs().max(by_wheel.abs()) / 4.0;
            if exceeds(self.sum.abs(), margin) {
                self.distrust = 3_000_000;
            }
            if !exceeds(self.sum.abs(), margin / 2.0) {
                self.distrust = (self.distrust - passed).max(0);
            }
        }
        (!self.is_distrusted()).then_some(rate)
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Moved {
    Consistent,
    ContradictsYawRate,
    Inconsistent,
}

#[derive(Debug, Clone, Default)]
pub(crate) struct Checks {
    pub(crate) v: f64,
    yaw_rate: Option<f64>,
    pub(crate) yaw: Yaw,
    apart: i64,
    lane: Option<Lane>,
    lane_is_known: bool,
    lane_is_alive: bool,
    other: Option<Lane>,
    is_doubted: bool,
    turned: f64,
    predicted: f64,
    seen: f64,
    lane_bias: f64,
    column_at: Option<i64>,
    pub(crate) wheel: f64,
    checked: f64,
    sum: f64,
    bias: f64,
}

impl Checks {
    fn by_wheel(&self, c: &Constants) -> f64 {
        self.v * c.curvature_gain / (1.0 + c.stability_factor * self.v * self.v) * self.wheel
    }

    pub(crate) fn turning(&self, c: &Constants) -> f64 {
        self.yaw_rate.unwrap_or(self.by_wheel(c) + self.yaw.bias)
    }

    /// Whether the two speeds agree, and whether they did within 0.3 s.
    pub(crate) fn speeds(&mut self, [a, b]: [f64; 2], passed: i64) -> (bool, bool) {
        let agree = (a - b).abs() < 2.0;
        self.apart = if agree { 0 } else { self.apart + passed };
        (agree, self.apart <= 300_000)
    }

    pub(crate) fn motion(&mut self, c: &Constants, v: f64, measured: Option<f64>, passed: i64) {
        let by_wheel = self.by_wheel(c);
        let last = self.yaw_rate;
        self.yaw_rate = measured.and_then(|rate| self.yaw.judge(rate, last, by_wheel, self.v, passed));
        self.v = v;
    }

    pub(crate) fn forget_lane(&mut self) {
        (self.lane_is_known, self.predicted, self.seen) = (false, 0.0, 0.0);
        (self.other, self.is_doubted) = (None, false);
    }

    pub(crate) fn is_doubted(&self) -> bool {
        self.is_doubted
    }

    pub(crate) fn forget_other(&mut self) {
        self.other = None;
    }

    /// The other line is followed, and what was summed up stays.
    pub(crate) fn adopt_other(&mut self, history: &mut MotionHistory) {
        history.swap();
        (self.lane_is_known, self.lane) = (self.other.is_some(), self.other.take());
        (self.is_doubted, self.turned) = (true, 0.0);
    }

    /// A picture of another line, whose movements count as those of the line itself.
    pub(crate) fn other_lane(&mut self, c: &Constants, history: &mut MotionHistory, picture: Lane) -> Moved {
        let followed = (self.lane_is_known, self.lane);
        history.swap();
        self.lane = self.other.filter(|last| follows(last, &picture));
        self.lane_is_known = self.lane.is_some();
        if self.lane.is_none() {
            history.forget_line();
        }
        let moved = self.lane(c, history, picture);
        history.swap();
        self.other = self.lane;
        (self.lane_is_known, self.lane) = followed;
        moved
    }

    /// Watched for as long as the vehicle needs from the near point to the far point, with half of the margin at most.
    pub(crate) fn other_follows(&self, c: &Constants, history: &mut MotionHistory) -> bool {
        history.swap();
        let is_watched = self
            .other
            .is_some_and(|last| history.line_direction(last.at, c.between).is_some());
        history.swap();
        let half = if self.yaw_rate.is_some() { 0.2 } else { 0.5 };
        is_watched && !exceeds(self.missing().abs(), half)
    }

    fn missing(&self) -> f64 {
        let sign = if self.predicted < 0.0 { -1.0 } else { 1.0 };
        sign * (self.predicted - self.seen)
    }

    pub(crate) fn forget_column(&mut self) {
        (self.column_at, self.sum) = (None, 0.0);
    }

    pub(crate) fn since_column(&self, now: i64) -> i64 {
        self.column_at.map_or(0, |at| now - at)
    }

    /// Whether driver torque, wheel and the torque applied belong together.
    pub(crate) fn column(&mut self, c: &Constants, now: i64, driver: f64, wheel: f64, applied: f64) -> bool {
        let moved = wheel - self.checked;
        let dt = self.column_at.map_or(0, |at| now - at);
        if self.column_at.is_some() {
            let aligning_at = |turning: f64| (self.v * turning * c.aligning_gain).clamp(-16.0, 16.0);
            let aligning = aligning_at(self.turning(c));
            let is_suspect = self.lane_is_alive && exceeds(self.yaw.sum.abs(), 0.0075);
            let pushed = if is_suspect { 16.0 } else { 0.3 };
            let by_wheel = aligning_at(self.by_wheel(c)).clamp(aligning - pushed, aligning + pushed);
            let driver = driver.clamp(-20.0, 20.0);
            let damped = (moved * c.column_damping).clamp(-60.0, 60.0);
            let least = applied + driver.min(5.0 * driver) - aligning.max(by_wheel);
            let most = applied + driver.max(5.0 * driver) - aligning.min(by_wheel);
            let [least, most] = [least, most].map(|torque| per_second(torque, dt) - damped);
            let lacking = nearest_to_zero(least, most) - per_second(self.bias, dt);
            self.bias = (self.bias + down(lacking / 16.0)).clamp(-0.5, 0.5);
            let tolerance = per_second(0.5 + aligning.abs() * 77.0 / 256.0, dt);
            let [least, most] = [-tolerance, tolerance].map(|more| leak(self.sum, lacking + more, dt));
            self.sum = nearest_to_zero(least, most);
        }
        (self.column_at, self.wheel, self.checked) = (Some(now), wheel, wheel);
        if !exceeds(self.sum.abs(), 0.6) {
            return true;
        }
        let above = self.sum.abs() - 0.6;
        let along = if self.sum < 0.0 { -moved } else { moved };
        !exceeds(per_second(above, dt), along / 8.0)
    }

    /// The lane goes on: nothing to compare.
    pub(crate) fn went_on(&mut self, history: &mut MotionHistory, lane: Lane) {
        history.record_line(lane.at, lane.e_theta);
        self.lane = Some(lane);
    }

    pub(crate) fn distrust_yaw_rate(&mut self) {
        (self.yaw.distrust, self.yaw_rate) = (3_000_000, None);
    }

    pub(crate) fn lane(&mut self, c: &Constants, history: &mut MotionHistory, lane: Lane) -> Moved {
        history.record_line(lane.at, lane.e_theta);
        let measured = self.yaw_rate.is_some();
        let (margin, unreal, most_bias) = if measured {
            (0.4, 0.8, 0.15)
        } else {
            (1.0, 2.0, 0.5)
        };
        let unreal = if self.is_doubted { unreal / 2.0 } else { unreal };
        let last = self.lane.filter(|last| self.lane_is_known && last.at != lane.at);
        if let Some(last) = last {
            let dt = lane.at - last.at;
            let seen = lane.e_y - last.e_y;
            let rate = self.line_rate(c, history, last.at);
            let predicted = rate.map_or(seen, |rate| per_second(rate, dt)) + per_second(self.lane_bias, dt);
            let learnt = down((seen - predicted) / 16.0);
            self.lane_bias = (self.lane_bias + learnt).clamp(-most_bias, most_bias);
            self.predicted = leak(self.predicted, predicted, dt);
            self.seen = leak(self.seen, seen, dt);
            self.lane_is_alive = lane.e_y != last.e_y || lane.e_theta != last.e_theta;
            if self.is_doubted {
                let turned = c.near_time * self.v * history.heading(lane.at).rate;
                self.turned = leak(self.turned, per_second(turned, dt), dt);
            }
        }
        (self.lane_is_known, self.lane) = (true, Some(lane));
        let missing = self.missing();
        if self.is_doubted {
            let moved = self.predicted.abs().max(self.turned.abs());
            self.is_doubted = exceeds(0.2, moved) || exceeds(missing.abs(), moved / 4.0);
        }
        let is_missing = exceeds(missing, margin) && exceeds(self.predicted.abs(), margin / 2.0);
        if !is_missing && !exceeds(missing.abs(), unreal) {
            return Moved::Consistent;
        }
        let less = c.far_time * self.v * self.yaw.sum;
        let explained = if self.predicted >= self.seen { -less } else { less };
        if measured && self.lane_is_alive && exceeds(explained, missing.abs() / 4.0) {
            (self.predicted, self.seen) = (0.0, 0.0);
            return Moved::ContradictsYawRate;
        }
        Moved::Inconsistent
    }

    fn line_rate(&self, c: &Constants, history: &MotionHistory, at: i64) -> Option<f64> {
        let near = history.line_direction(at, c.between)?;
        Some(self.v * near - c.near_time * self.v * history.heading(at).rate)
    }

    /// What a picture at an instant would show, that does not come.
    pub(crate) fn extrapolated(&self, c: &Constants, history: &MotionHistory, last: &Lane, at: i64) -> Lane {
        let bends = self.v * last.e_theta - c.far_time * self.v * self.turning(c);
        let rate = self.line_rate(c, history, last.at).unwrap_or(bends);
        let turned = history.psi(at) - history.psi(last.at);
        Lane {
            e_y: last.e_y + per_second(rate, at - last.at),
            e_theta: last.e_theta + per_second(history.bend(), at - last.at) - turned,
            at,
        }
    }
}

fn nearest_to_zero(least: f64, most: f64) -> f64 {
    least.max(0.0) + most.min(0.0)
}

/// A driver torque that is the same to the bit while the wheel turns.
#[derive(Debug, Clone, Default)]
pub(crate) struct Still {
    torque: f64,
    wheels: [f64; 2],
    lasted: i64,
    is_found: bool,
    is_tested: bool,
}

impl Still {
    pub(crate) fn is_alive(&mut self, torque: f64, wheel: f64, v: f64, passed: i64, is_tested: bool) -> bool {
        if torque != self.torque {
            *self = Self {
                torque,
                wheels: [wheel; 2],
                lasted: 0,
                is_found: false,
                is_tested,
            };
            return true;
        }
        if self.is_found {
            return false;
        }
        if self.lasted >= 2_000_000 || is_tested != self.is_tested {
            (self.wheels, self.lasted, self.is_tested) = ([wheel; 2], 0, is_tested);
        }
        self.lasted += passed;
        self.wheels = [self.wheels[0].min(wheel), self.wheels[1].max(wheel)];
        // 8 deg from 40 km/h on, below it so far that the lateral acceleration is as large.
        let most = if is_tested {
            0.0087
        } else {
            0.14 * (40.0 / 3.6 / v).powi(2).max(1.0)
        };
        self.is_found = self.lasted >= 1_000_000 && exceeds(self.wheels[1] - self.wheels[0], most);
        !self.is_found
    }
}
