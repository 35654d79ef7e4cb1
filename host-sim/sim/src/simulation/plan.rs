//! What a scenario decides for every step: speed, failures, and whether guidance is asked for.

use haptic_core::safety::modes::Mode;

use crate::action::{Action, Request, WorldFaults};
use crate::models::STEPS_PER_SECOND;
use crate::models::road::Centreline;
use crate::scenario::{FailureKind, Scenario, SpeedProfile};

/// So far below the least speed that is guided the driver stops asking, m/s: behind the ECU, which leaves there by itself.
const STOPS_ASKING_M_PER_S: f64 = 0.5;
/// So long without an obstacle the driver asks again, in steps: the ECU wants half a second of good inputs first.
const ASKS_AGAIN_STEPS: u32 = STEPS_PER_SECOND;

/// What the scenario decides for every step.
#[derive(Debug, Clone)]
pub struct Plan {
    /// How the speed changes, if it does.
    pub speed: Option<SpeedProfile>,
    /// How far ahead anybody looks, and the driver, s.
    ahead_s: [f64; 2],
    pub(super) duration_s: f64,
    /// Whether the road has a bank somewhere.
    pub(super) has_banks: bool,
    probe: bool,
    pub(super) failure: FailureKind,
    /// The first step of the failure, and the first behind it.
    pub failure_steps: [u32; 2],
}

impl Plan {
    /// The plan of a scenario, for a driver whose points are as far ahead as these times.
    pub fn new(scenario: &Scenario, driver_s: [f64; 2]) -> Self {
        let guidance = scenario.guidance();
        let [near_s, far_s] = driver_s;
        Self {
            speed: scenario.changes_speed().then(|| scenario.speed_profile().clone()),
            ahead_s: [near_s.max(far_s).max(guidance.t_n).max(guidance.t_f), far_s],
            duration_s: scenario.duration_s(),
            has_banks: !scenario.course().is_level(),
            probe: guidance.probe,
            failure: scenario.failure().kind,
            failure_steps: scenario.failure().steps(),
        }
    }

    /// Where the driver's far point is at a speed when the farthest that anybody looks at gets to the road's end, m.
    pub fn end_m(&self, road: &Centreline, v_m_per_s: f64) -> f64 {
        let [longest_s, driver_s] = self.ahead_s;
        road.length_m() - (v_m_per_s * longest_s - v_m_per_s * driver_s)
    }

    /// What the scenario lets go wrong.
    #[inline]
    pub fn faults(&self, step: u32) -> WorldFaults {
        let [first, behind] = self.failure_steps;
        let fails = (first..behind).contains(&step);
        WorldFaults {
            torque_lost: fails && self.failure == FailureKind::Torque,
            lane_lost: fails && self.failure == FailureKind::Input,
        }
    }

    #[inline]
    pub(super) fn request(&self, action: &Action, asks: bool) -> Request {
        Request {
            engage: action.engage.unwrap_or(asks),
            authority: action.authority.map_or(1.0, |share| {
                if share.is_nan() {
                    0.0
                } else {
                    share.clamp(0.0, 1.0)
                }
            }),
            probe: action.probe.unwrap_or(self.probe),
        }
    }
}

/// Who asks for guidance if the host does not say. The ECU takes only a request that rises: where a vehicle was too slow, or
/// what was lost is back behind a handover, somebody has to ask again.
#[derive(Debug, Clone)]
pub(super) struct AskingDriver {
    pub(super) least_m_per_s: f64,
    pub(super) asks: bool,
    /// Whether torque or lane preview was lost in the last step.
    was_lost: bool,
    /// Whether the request waits for an ECU in Standby.
    pub(super) waits: bool,
    /// Steps without an obstacle.
    clear: u32,
}

impl AskingDriver {
    pub(super) fn new(least_m_per_s: f64) -> Self {
        Self {
            least_m_per_s,
            asks: true,
            was_lost: false,
            waits: false,
            clear: ASKS_AGAIN_STEPS,
        }
    }

    /// The end of a step in which an ECU was in this mode.
    #[inline]
    pub(super) fn see(&mut self, is_lost: bool, mode: Mode) {
        let is_back = self.was_lost && !is_lost;
        self.was_lost = is_lost;
        if is_back && mode != Mode::Active {
            (self.waits, self.asks, self.clear) = (true, false, 0);
        }
        if self.waits && mode != Mode::Standby {
            self.clear = 0;
        }
    }

    /// The end of a step at this speed.
    #[inline]
    pub(super) fn step(&mut self, v_m_per_s: f64) {
        self.clear = if v_m_per_s < self.least_m_per_s {
            0
        } else {
            self.clear.saturating_add(1)
        };
        self.asks = if self.asks {
            v_m_per_s >= self.least_m_per_s - STOPS_ASKING_M_PER_S
        } else {
            self.clear >= ASKS_AGAIN_STEPS
        };
        self.waits &= !self.asks;
    }
}
