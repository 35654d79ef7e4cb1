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
/// A camera takes the next lane's line between the first wheel of a car 1.8 m wide on the marking and the last one off it.
const TAKES_FROM_M: f64 = 0.85;
const TAKES_TO_M: f64 = 2.65;
/// How often in an hour.
const BLINKS: f64 = 12.0;
const SLIPS: f64 = 6.0;
const WORKS: f64 = 3.0;
const LANE_CHANGES: f64 = 22.0;
const FADES: f64 = 6.0;
/// Beyond this a line that stays is another lane, and a speed another vehicle's: the ECU ends guidance after some time, as it has to.
const LASTING_LINE_M: f64 = 0.75;
const LASTING_SLIP_M_PER_S: f64 = 1.9;
/// How long the ECU rides out what is further, with some room.
const RIDDEN_OUT_MS: f64 = 250.0;
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

/// What comes and goes by ramps.
#[derive(Debug, Clone, Copy, Default)]
struct Swell {
    /// From the first step to the last.
    span: Span,
    into: f64,
    out: f64,
}

impl Swell {
    /// How much of it there is, 0 to 1.
    fn share(&self, step: u32) -> f64 {
        let Span { from, to, .. } = self.span;
        if !self.span.has(step) {
            return 0.0;
        }
        // A ramp of nothing is a step.
        let rises = f64::from(step - from) / self.into.max(1.0);
        let falls = f64::from(to - step) / self.out.max(1.0);
        rises.min(falls).min(1.0)
    }
}

/// Which source of the speed an event concerns.
#[derive(Debug, Clone, Copy, Default)]
enum Wheels {
    #[default]
    Both,
    First,
    Second,
}

impl Wheels {
    fn of(self, by: f64) -> [f64; 2] {
        match self {
            Self::Both => [by; 2],
            Self::First => [by, 0.0],
            Self::Second => [0.0, by],
        }
    }
}

/// What happens, with the shipping ECU behind it.
pub(super) struct Eventful {
    ecu: OverBus,
    happens: Happens,
    rng: Xoshiro256PlusPlus,
    blink: Span,
    slip: Swell,
    slips: Wheels,
    /// A yaw rate that dies, beside a speed that drifts.
    fade: Swell,
    drifts: Wheels,
    works: Span,
    /// The lane change on its way, and where the driver's line lies beside the first lane's, m to the right.
    change: Span,
    before_m: f64,
    after_m: f64,
    /// Where the camera's line lies, and how far from its line it takes the next, m.
    camera_m: f64,
    takes_m: f64,
    has_taken: bool,
}

impl Eventful {
    pub(super) fn new(ecu: OverBus, happens: Happens, seed: u64) -> Self {
        Self {
            ecu,
            happens,
            rng: Xoshiro256PlusPlus::seed_from_u64(seed),
            blink: Span::default(),
            slip: Swell::default(),
            slips: Wheels::default(),
            fade: Swell::default(),
            drifts: Wheels::default(),
            works: Span::default(),
            change: Span::default(),
            before_m: 0.0,
            after_m: 0.0,
            camera_m: 0.0,
            takes_m: 0.5 * LANE_M,
            has_taken: true,
        }
    }

    /// Begins what happens so often in an hour, if it does now.
    fn begins(&mut self, step: u32, is_on: bool, per_hour: f64, busy: Span) -> bool {
        // The draw comes last: what is switched off takes none from the others.
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
            fades,
            ..
        } = self.happens;
        if self.begins(step, blinks, BLINKS, self.blink) {
            // A blink has no size, but a range must not be empty.
            self.blink = self.span(step, 40.0..800.0, 1.0..1.1);
        }
        if self.begins(step, slips, SLIPS, self.slip.span) {
            (self.slip, self.slips) = self.slip_at(step);
        }
        if self.begins(step, fades, FADES, self.fade.span) {
            let (into, out) = (self.rng.random_range(1e3..10e3), self.rng.random_range(1e3..10e3));
            let mut span = self.span(step, 10e3..60e3, 0.5..LASTING_SLIP_M_PER_S);
            span.to += (into + out) as u32;
            (self.fade, self.drifts) = (Swell { span, into, out }, self.wheels());
        }
        if self.begins(step, works, WORKS, self.works) {
            self.works = self.span(step, 10e3..30e3, 0.2..LANE_M);
            if self.works.size.abs() > LASTING_LINE_M {
                self.works.to = step + self.rng.random_range(50.0..900.0) as u32;
            }
        }
        // Settled in the new lane before the next.
        let settled = Span {
            to: self.change.to + 10_000,
            ..self.change
        };
        if self.begins(step, lane_changes, LANE_CHANGES, settled) {
            // One lane; a range must not be empty.
            self.change = self.span(step, 5e3..8e3, LANE_M..LANE_M + 1e-9);
            self.before_m = self.after_m;
            self.after_m = if self.before_m == 0.0 {
                self.change.size
            } else {
                0.0
            };
            (self.takes_m, self.has_taken) = (self.rng.random_range(TAKES_FROM_M..TAKES_TO_M), false);
        }
    }

    /// A slip of both wheels or one: in and out by ramps of 0 to 1 s, often by none. One wheel that slips for long does so a little.
    fn slip_at(&mut self, step: u32) -> (Swell, Wheels) {
        let mut ramp = || {
            let is_step = self.rng.random_bool(0.25);
            if is_step {
                0.0
            } else {
                self.rng.random_range(0.0..1e3)
            }
        };
        let (into, out) = (ramp(), ramp());
        let wheels = self.wheels();
        let mut span = self.span(step, 30.0..250.0, 0.5..5.0);
        let lasts = f64::from(span.to - step);
        // For so long the two are 2 m/s apart.
        let apart = (1.0 - 2.0 / span.size.abs()).max(0.0) * (into + out) + lasts;
        if !matches!(wheels, Wheels::Both) && apart > RIDDEN_OUT_MS {
            span.size = span.size.clamp(-LASTING_SLIP_M_PER_S, LASTING_SLIP_M_PER_S);
        }
        span.to += (into + out) as u32;
        (Swell { span, into, out }, wheels)
    }

    fn wheels(&mut self) -> Wheels {
        [Wheels::Both, Wheels::First, Wheels::Second][self.rng.random_range(0..3)]
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
        let mine = (e_y_m - self.camera_m).abs();
        if !self.has_taken && mine > self.takes_m {
            (self.camera_m, self.has_taken) = (other_m, true);
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
        let by = self.slip.share(step) * self.slip.span.size;
        let drift = self.fade.share(step) * self.fade.span.size;
        let ([a, b], [c, d]) = (self.slips.of(by), self.drifts.of(drift));
        self.ecu.slip([a + c, b + d]);
        if let Some(rate) = &mut seen.yaw_rate_rad_per_s {
            *rate *= 1.0 - self.fade.share(step);
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
