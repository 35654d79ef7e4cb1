//! What happens to honest inputs on ordinary roads: between the world and the ECU, at instants that a segment's seed draws.
//!
//! Rates are those of a car at 100 km/h; `docs/how-to/measure-availability.md` has their sources.

use haptic_core::bus::Frame;
use haptic_sim::guidance::{Actuation, Guidance, Observation, OverBus, Status};
use haptic_sim::worlds::Happens;
use rand::rngs::Xoshiro256PlusPlus;
use rand::{RngExt, SeedableRng};

const STEPS_PER_HOUR: f64 = 3.6e6;
const LANE_M: f64 = 3.5;
/// How often in an hour.
const BLINKS: f64 = 12.0;
const SLIPS: f64 = 6.0;
const WORKS: f64 = 3.0;
const LANE_CHANGES: f64 = 22.0;
/// Before the first event the drive settles.
const CALM_STEPS: u32 = 5000;

/// From one step to another.
#[derive(Debug, Clone, Copy, Default)]
struct Span {
    from: u32,
    to: u32,
    size: f64,
}

impl Span {
    fn has(&self, step: u32) -> bool {
        (self.from..self.to).contains(&step)
    }
}

/// What happens, with the shipping ECU behind it.
pub(super) struct Eventful {
    ecu: OverBus,
    happens: Happens,
    rng: Xoshiro256PlusPlus,
    blink: Span,
    slip: Span,
    works: Span,
    /// The lane change on its way, and where the driver's line lies beside the first lane's, m to the right.
    change: Span,
    before_m: f64,
    after_m: f64,
    /// Where the camera's line lies, and how far from its line it takes the next, m.
    camera_m: f64,
    takes_m: f64,
}

impl Eventful {
    pub(super) fn new(ecu: OverBus, happens: Happens, seed: u64) -> Self {
        Self {
            ecu,
            happens,
            rng: Xoshiro256PlusPlus::seed_from_u64(seed),
            blink: Span::default(),
            slip: Span::default(),
            works: Span::default(),
            change: Span::default(),
            before_m: 0.0,
            after_m: 0.0,
            camera_m: 0.0,
            takes_m: 0.5 * LANE_M,
        }
    }

    /// Begins what happens so often in an hour, if it does now.
    fn begins(&mut self, step: u32, is_on: bool, per_hour: f64, busy: Span) -> bool {
        is_on && step >= CALM_STEPS.max(busy.to) && self.rng.random::<f64>() < per_hour / STEPS_PER_HOUR
    }

    fn span(&mut self, step: u32, ms: std::ops::Range<f64>, size: std::ops::Range<f64>) -> Span {
        let side = if self.rng.random() { 1.0 } else { -1.0 };
        Span {
            from: step,
            to: step + self.rng.random_range(ms) as u32,
            size: side * self.rng.random_range(size),
        }
    }

    fn advance(&mut self, step: u32) {
        let Happens {
            blinks,
            slips,
            works,
            lane_changes,
            ..
        } = self.happens;
        if self.begins(step, blinks, BLINKS, self.blink) {
            self.blink = self.span(step, 40.0..800.0, 1.0..1.1);
        }
        if self.begins(step, slips, SLIPS, self.slip) {
            self.slip = self.span(step, 30.0..250.0, 3.0..5.0);
        }
        if self.begins(step, works, WORKS, self.works) {
            self.works = self.span(step, 10e3..30e3, 0.35..0.75);
        }
        // Settled in the new lane before the next.
        let settled = Span {
            to: self.change.to + 10_000,
            ..self.change
        };
        if self.begins(step, lane_changes, LANE_CHANGES, settled) {
            self.change = self.span(step, 5e3..8e3, LANE_M..LANE_M + 1e-9);
            self.before_m = self.after_m;
            self.after_m = if self.before_m == 0.0 {
                self.change.size
            } else {
                0.0
            };
            self.takes_m = self.rng.random_range(1.3..1.9);
        }
    }

    /// Where the driver wants to be beside the first lane, m to the right: half a cosine from lane to lane.
    pub(super) fn beside_m(&self, step: u32) -> f64 {
        let Span { from, to, .. } = self.change;
        if step >= to {
            return self.after_m;
        }
        let share = f64::from(step.saturating_sub(from)) / f64::from((to - from).max(1));
        let done = 0.5 - 0.5 * (std::f64::consts::PI * share).cos();
        self.before_m + (self.after_m - self.before_m) * done
    }

    /// The line that the camera takes where the true one of the first lane is `e_y_m` to the left.
    fn line_m(&mut self, e_y_m: f64) -> f64 {
        let other_m = if self.camera_m == self.after_m {
            self.before_m
        } else {
            self.after_m
        };
        let (mine, other) = ((e_y_m - self.camera_m).abs(), (e_y_m - other_m).abs());
        if mine > self.takes_m && other < LANE_M {
            self.camera_m = other_m;
        }
        self.camera_m
    }
}

impl Guidance for Eventful {
    fn looks_at_road(&self, step: u32) -> bool {
        self.ecu.looks_at_road(step)
    }

    fn step(&mut self, observation: &Observation) -> Actuation {
        let step = observation.step;
        self.advance(step);
        let mut seen = *observation;
        if let Some(lane) = &mut seen.lane {
            lane.e_y_m -= self.line_m(lane.e_y_m);
            if self.works.has(step) {
                lane.e_y_m += self.works.size;
            }
        }
        if self.blink.has(step) {
            seen.lane = None;
        }
        if self.slip.has(step) {
            seen.speed_m_per_s -= self.slip.size.abs();
        }
        if self.happens.no_yaw_rate {
            seen.yaw_rate_rad_per_s = None;
        }
        self.ecu.step(&seen)
    }

    fn status(&self) -> Option<Status> {
        self.ecu.status()
    }

    fn frames_in(&self) -> &[Frame] {
        self.ecu.frames_in()
    }

    fn frames_out(&self) -> &[Frame] {
        self.ecu.frames_out()
    }
}
