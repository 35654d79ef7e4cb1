//! The speeds of several runs. One that changes moves the points that are looked at and the end of the course with every step,
//! and what the ECU makes of a speed with every message of the vehicle.

use std::sync::Arc;

use haptic_core::controller::params::Params;
use haptic_core::safety::plausibility;

use super::checks::Checks;
use super::counts::{ONE, bits, flag, heard, speed_heard};
use super::ecu::Ecus;
use super::lanes::lanes;
use super::rejected::Reason;
use super::world::Worlds;
use haptic_sim::models::STEP_S;
use haptic_sim::models::road::Centreline;
use haptic_sim::scenario::Scenario;
use haptic_sim::simulation::Plan;

/// Slower is not guided, but for a count of the bus; and a bit less than the largest honest step between two messages.
const SPEED_LSB: i32 = 1 << 16;
const SPEED_STEP: i32 = bits(0.9 * plausibility::SPEED_STEP.m_per_s());

lanes! {
    /// The speeds.
    pub(super) struct Speeds {
        /// Now, and at the end of the step, m/s.
        pub(super) now: f64 = 1.0,
        next: f64 = 1.0,
        place_m: f64 = 0.0,
    } beside {
        changing: [Option<Box<Changing>>; N] = [const { None }; N],
        is_any: bool = false,
    }
}

/// A run whose speed changes.
struct Changing {
    plan: Plan,
    params: Params,
    /// The sensor's.
    gain: f64,
    heard: i32,
    /// The least that is guided, as the ECU hears it, and as the driver knows it, who stops asking below.
    least: i32,
    least_m_per_s: f64,
}

impl<const N: usize> Speeds<N> {
    /// A new run begins in a lane.
    pub(super) fn begin(&mut self, lane: usize, scenario: &Scenario, plan: &Plan) {
        let v = scenario.speed_m_per_s();
        self.clear(lane);
        (self.now[lane], self.next[lane]) = (v, v);
        self.changing[lane] = plan.speed.is_some().then(|| {
            let params = scenario.controller_params();
            Box::new(Changing {
                plan: plan.clone(),
                gain: scenario.car().sensor_errors.speed_gain,
                heard: speed_heard(scenario),
                least: (params.least_speed_m_per_s * ONE) as i32 + SPEED_LSB,
                least_m_per_s: params.least_speed_m_per_s,
                params,
            })
        });
        self.is_any = self.changing.iter().any(Option::is_some);
    }

    /// Messages of the vehicles reach the ECUs.
    #[inline(always)]
    pub(super) fn receive(&mut self, ecus: &mut Ecus<N>, checks: &mut Checks<N>, matters: &[i32; N]) {
        if !self.is_any {
            return;
        }
        for (l, run) in self.changing.iter_mut().enumerate() {
            let Some(run) = run else { continue };
            let speed = heard(run.gain * self.now[l]);
            let is_fast = (speed >= run.least) & (self.now[l] >= run.least_m_per_s);
            let is_sound = is_fast & (speed.wrapping_sub(run.heard).wrapping_abs() < SPEED_STEP);
            ecus.suspect[l] |= !flag(is_sound) & matters[l] & Reason::Speed.bit();
            if speed != run.heard {
                run.heard = speed;
                ecus.hear_speed(l, &run.params, speed);
                checks.hear_speed(l, &run.params, speed);
            }
        }
    }

    /// The centres of gravity were found on their roads.
    #[inline(always)]
    pub(super) fn locate(&mut self, s_m: &[f64; N]) {
        if self.is_any {
            self.place_m = *s_m;
        }
    }

    /// The speeds at start and end of this step, whose number in each run is `own`.
    #[inline(always)]
    pub(super) fn of_step(&mut self, own: &[i32; N]) -> [&[f64; N]; 2] {
        if self.is_any {
            for (l, run) in self.changing.iter().enumerate() {
                if let Some(profile) = run.as_ref().and_then(|run| run.plan.speed.as_ref()) {
                    let time_s = f64::from(own[l].wrapping_add(1)) * STEP_S;
                    self.next[l] = profile.at(time_s, self.place_m[l] + self.now[l] * STEP_S);
                }
            }
        }
        [&self.now, &self.next]
    }

    /// The step is over.
    #[inline(always)]
    pub(super) fn advance(&mut self, worlds: &mut Worlds<N>, roads: &[Arc<Centreline>; N]) {
        if !self.is_any {
            return;
        }
        for (l, run) in self.changing.iter().enumerate() {
            let Some(run) = run else { continue };
            let (now, next) = (self.now[l], self.next[l]);
            if next != now {
                worlds.at_speed(l, next, run.plan.end_m(&roads[l], next));
            }
            self.place_m[l] += now * STEP_S;
            self.now[l] = next;
        }
    }
}
