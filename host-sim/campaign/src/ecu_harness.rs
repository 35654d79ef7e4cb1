//! The harness of the ECU in the loop, with everything that can be wrong around it: senders, bus, clock, the ECU,
//! the motor, a hand on the wheel, and the invariant checker that watches every cycle.

use haptic_core::bus::Frame;
use haptic_core::bus::messages::ResetCause;
use haptic_core::config::Setup;
use haptic_core::ecu::injection::InjectedEcu;
use haptic_core::ecu::{Boot, Ecu};
use haptic_core::params::Params;
use haptic_core::quantity::{Instant, Torque};
use rand::RngExt;
use rand::rngs::Xoshiro256PlusPlus;

use super::bytes::Status;
use super::injection::{Clock, Hand, Injection, Inside, Motor};
use super::invariants::{ACTIVE, FAULT, InvariantChecker, Violation};
use super::residual::{Residual, Seen};
use super::senders::{Senders, SensorReadings};
use super::start_up::{is_engaged, start_up};
use super::table::FaultCase;
use super::wire::{Arrival, Bus};
use haptic_sim::ecu_events::EcuEvents;
use haptic_sim::guidance::{Actuation, Guidance, Observation};
use haptic_sim::models::sensors;
use haptic_sim::scenario::Scenario;

/// Code of the limit that acts for the driver's sake.
const DRIVER_OVERRIDE: u64 = 5;
/// A new random law every so many ms.
const LAW_HELD_MS: i64 = 200;
/// A hand taps five times a second, 40 ms each.
const TAP_EVERY_MS: i64 = 200;
const TAP_MS: i64 = 40;

/// What a run leaves for the verdict. Steps are of the world, 1 ms.
#[derive(Debug, Clone, Default)]
pub(super) struct TrialRecord {
    /// Every mode with the step in which it began.
    pub(super) modes: Vec<(u32, u64)>,
    /// When the fault could first be seen.
    pub(super) seen_at: Option<u32>,
    /// Largest share of the margin used, up to the first change of mode after the onset.
    pub(super) used: f64,
    /// The same of the margins that a contradiction uses, whatever the row looks at.
    pub(super) contradicted: f64,
    /// First step from the onset on with no torque in Active.
    pub(super) yielded_at: Option<u32>,
    /// Whether a limit acted for the driver's sake from the onset on.
    pub(super) overridden: bool,
    /// Largest torque from the onset on, N.m.
    pub(super) peak_nm: f64,
    /// Tampered frames that the ECU rejected.
    pub(super) rejected: u32,
    /// The first that it accepted.
    pub(super) accepted_bad_at: Option<u32>,
    /// Cause of the last reset, as the status frame has it.
    pub(super) reset: u64,
    pub(super) cycles: u64,
    /// Last step.
    pub(super) steps: u32,
    pub(super) violation: Option<Violation>,
    /// What the ECU said.
    pub(super) ecu: EcuEvents,
}

/// The harness.
#[derive(Debug)]
pub(super) struct EcuHarness<'a> {
    row: &'a FaultCase,
    onset: u32,
    /// No ECU runs from this step on.
    end: u32,
    senders: Senders,
    bus: Bus,
    ecu: InjectedEcu,
    setup: Setup,
    checker: InvariantChecker,
    residual: Residual,
    rng: Xoshiro256PlusPlus,
    /// Left or right, for what has a side.
    side: f64,
    clock_base_us: u32,
    commanded_nm: f64,
    delivered_nm: f64,
    /// Torque of the motor at the onset.
    stuck_nm: f64,
    sent: Vec<Frame>,
    /// What has arrived and was not yet received: a step that is lost or late leaves it to the next.
    arrivals: Vec<Arrival>,
    record: TrialRecord,
    start: (Params, haptic_lockstep::Start),
    trace: Option<EcuTrace>,
}

/// Everything that went into an ECU and came out of it, so that another can be put in its place.
#[derive(Debug, Clone)]
pub(super) struct EcuTrace {
    pub(super) params: Params,
    pub(super) start: haptic_lockstep::Start,
    pub(super) ticks: Vec<Tick>,
}

/// One run of the ECU.
#[derive(Debug, Clone)]
pub(super) struct Tick {
    /// In the world, ms.
    pub(super) step: u32,
    /// On the ECU's clock.
    pub(super) now: Instant,
    /// What it received before, and whether it accepted it.
    pub(super) frames: Vec<(Frame, bool)>,
    /// What it sent: guidance first.
    pub(super) answer: Vec<Frame>,
}

impl<'a> EcuHarness<'a> {
    pub(super) fn new(
        row: &'a FaultCase,
        scenario: &Scenario,
        onset: u32,
        end: u32,
        mut rng: Xoshiro256PlusPlus,
    ) -> Self {
        let wraps = row.injections.contains(&Injection::Clock(Clock::Wraps));
        let clock_base_us = if wraps {
            0_u32.wrapping_sub(onset * 1000)
        } else {
            0
        };
        let now = Instant::from_us(clock_base_us);
        let (params, start) = start_up(row.start, scenario, now, &mut rng);
        let ecu = InjectedEcu::new(start.ecu(&params).expect("a checked scenario"));
        Self {
            row,
            onset,
            end,
            // One run in four has the probe on.
            senders: Senders::new(rng.random_ratio(1, 4)),
            bus: Bus::new(row.injections),
            ecu,
            setup: Setup::new(&params).expect("a checked scenario"),
            checker: InvariantChecker::new(is_engaged(row.start), clock_base_us),
            residual: Residual::new(&scenario.vehicle(), scenario.speed_m_per_s()),
            side: if rng.random_bool(0.5) { 1.0 } else { -1.0 },
            rng,
            clock_base_us,
            commanded_nm: 0.0,
            delivered_nm: 0.0,
            stuck_nm: 0.0,
            sent: Vec::new(),
            arrivals: Vec::new(),
            record: TrialRecord::default(),
            trace: None,
            start: (params, start),
        }
    }

    /// Keeps a trace from here on.
    pub(super) fn keep_trace(&mut self) {
        let (params, start) = self.start;
        self.trace = Some(EcuTrace {
            params,
            start,
            ticks: Vec::new(),
        });
    }

    /// The trace, if one was kept.
    pub(super) fn take_trace(&mut self) -> Option<EcuTrace> {
        self.trace.take()
    }

    pub(super) fn into_record(self) -> TrialRecord {
        TrialRecord {
            cycles: self.checker.cycles,
            violation: self.checker.violation,
            ..self.record
        }
    }

    /// Steps since the onset.
    fn since(&self, step: u32) -> i64 {
        i64::from(step) - i64::from(self.onset)
    }

    fn acts(&self, step: u32) -> bool {
        let since = self.since(step);
        since >= 0 && self.row.lasts_ms.is_none_or(|ms| since < i64::from(ms))
    }

    fn has(&self, injection: Injection) -> bool {
        self.row.injections.contains(&injection)
    }

    /// Instants of the ECU's clock at which it runs in this step.
    fn ticks(&self, step: u32) -> ([u32; 5], usize) {
        let clock = self.row.injections.iter().find_map(|injection| match injection {
            Injection::Clock(clock) => Some(*clock),
            _ => None,
        });
        let rate = if let Some(Clock::Rate(rate)) = clock {
            rate
        } else {
            1.0
        };
        let us = (f64::from(step) * 1000.0 * rate) as u32;
        let now = self.clock_base_us.wrapping_add(us);
        let once = ([now, now, 0, 0, 0], 1);
        let since = self.since(step);
        if since < 0 {
            return once;
        }
        match clock {
            Some(Clock::Late(ms)) if since < i64::from(ms) => (once.0, 0),
            Some(Clock::Missing { steps, every_ms }) if since % i64::from(every_ms) < i64::from(steps) => {
                (once.0, 0)
            }
            Some(Clock::TwoRuns) if since == 0 => (once.0, 2),
            Some(Clock::Runaway) => ([0, 200, 400, 600, 800].map(|us| now.wrapping_add(us)), 5),
            _ => once,
        }
    }

    fn send(&mut self, observation: &Observation) {
        let (step, acts) = (observation.step, self.acts(observation.step));
        let since_s = acts.then(|| self.since(step) as f64 * 1e-3);
        let readings = self
            .senders
            .read(observation, self.row.injections, since_s, &mut self.rng);
        self.watch_contradictions(observation, &readings);
        self.sent.clear();
        let requested = is_engaged(self.row.start) || step >= self.onset;
        self.senders.send(
            observation,
            &readings,
            requested,
            self.row.injections,
            acts,
            &mut self.sent,
        );
        if let Some(times) = Bus::burst(self.row.injections, acts) {
            for frame in &self.sent {
                self.senders.skip_counts(frame.id(), times - 1);
            }
        }
        self.bus.carry(
            step,
            &self.sent,
            self.row.injections,
            acts,
            &mut self.rng,
            &mut self.arrivals,
        );
        if acts && self.has(Injection::Inside(Inside::ReceiverSkipped)) {
            self.arrivals.clear();
        }
    }

    /// Hands the ECU what has arrived.
    fn receive(&mut self, step: u32, now_us: u32) -> Vec<(Frame, bool)> {
        let mut received = Vec::new();
        for arrival in self.arrivals.drain(..) {
            let accepted = self.ecu.receive(&arrival.frame, Instant::from_us(now_us)).is_ok();
            received.push((arrival.frame, accepted));
            if accepted {
                self.checker.accepted(&arrival.frame, now_us);
            }
            match (arrival.bad, accepted) {
                (true, true) => {
                    self.record.accepted_bad_at.get_or_insert(step);
                }
                (true, false) => self.record.rejected += 1,
                (false, _) => {}
            }
        }
        received
    }

    fn watch_contradictions(&mut self, observation: &Observation, readings: &SensorReadings) {
        let time_s = f64::from(observation.step) * 1e-3;
        self.residual.at(time_s);
        if let Some(speeds) = readings.speeds_m_per_s {
            self.residual.speeds(speeds);
        }
        if let Some((driver_nm, wheel_rad)) = readings.column {
            self.residual
                .column(time_s, driver_nm, wheel_rad, self.commanded_nm);
        }
        if let Some((e_y_m, e_theta_rad)) = readings.lane {
            self.residual.lane(time_s, e_y_m, e_theta_rad);
        }
        self.residual.motor(self.commanded_nm, self.delivered_nm);
        if observation.step < self.onset {
            return;
        }
        let used = self.residual.used(self.row.seen);
        if self.record.modes.last().is_some_and(|(_, mode)| *mode == ACTIVE) {
            self.record.used = self.record.used.max(used);
            let contradicted = self.residual.used(Seen::Contradiction);
            self.record.contradicted = self.record.contradicted.max(contradicted);
        }
        let since = self.residual.seen_since(self.row.seen, observation.step);
        // A motor that came back within the ECU's patience has not been astray.
        let returned =
            self.row.seen == Seen::Motor && self.record.modes.last().is_some_and(|(_, m)| *m != FAULT);
        self.record.seen_at = if returned {
            since
        } else {
            self.record.seen_at.or(since)
        };
    }

    fn disturb_inside(&mut self, step: u32, now_us: u32) {
        let since = self.since(step);
        if since < 0 {
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

    fn record_status(&mut self, step: u32, status: &Status) {
        let record = &mut self.record;
        if record.modes.last().is_none_or(|(_, mode)| *mode != status.mode) {
            record.modes.push((step, status.mode));
        }
        record.reset = status.reset;
        if step >= self.onset {
            record.peak_nm = record.peak_nm.max(status.torque_nm.abs());
            record.overridden |= status.limit == DRIVER_OVERRIDE;
            if status.torque_nm == 0.0 && status.mode == ACTIVE {
                record.yielded_at.get_or_insert(step);
            }
        }
    }

    fn motor(&self, step: u32) -> f64 {
        let motor = self.row.injections.iter().find_map(|injection| match injection {
            Injection::Motor(motor) if self.acts(step) => Some(*motor),
            _ => None,
        });
        match motor {
            None => self.commanded_nm,
            Some(Motor::Times(share)) => share * self.commanded_nm,
            Some(Motor::Stuck) => self.stuck_nm,
        }
    }
}

impl EcuHarness<'_> {
    /// Torque of a hand on the wheel, N.m, beside that of the driver's arm.
    pub(super) fn hand_torque_nm(&self, step: u32, arm_torque_nm: f64) -> f64 {
        let since = self.since(step);
        let against = if self.commanded_nm == 0.0 {
            -self.side
        } else {
            -self.commanded_nm.signum()
        };
        let hand = self.row.injections.iter().find_map(|injection| match injection {
            Injection::Hand(hand) => Some(*hand),
            _ => None,
        });
        match hand {
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

impl Guidance for EcuHarness<'_> {
    fn looks_at_road(&self, step: u32) -> bool {
        sensors::camera_looks(step)
    }

    fn step(&mut self, observation: &Observation) -> Actuation {
        let step = observation.step;
        if step >= self.end {
            return Actuation::default();
        }
        self.record.steps = step;
        let (ticks, count) = self.ticks(step);
        self.disturb_inside(step, ticks[0]);
        self.send(observation);
        for now_us in ticks.into_iter().take(count) {
            let now = Instant::from_us(now_us);
            let frames = self.receive(step, now_us);
            let out = self.ecu.step(now);
            let background = self.ecu.background_step();
            if let Some(trace) = &mut self.trace {
                trace.ticks.push(Tick {
                    step,
                    now,
                    frames,
                    answer: std::iter::once(out.guidance)
                        .chain(out.others.iter().copied())
                        .chain(background)
                        .collect(),
                });
            }
            let world_us = u64::from(step) * 1000;
            self.checker
                .cycle(step, world_us, now_us, &out.guidance, &out.others);
            let status = Status::of(&out.guidance);
            self.commanded_nm = status.torque_nm;
            self.record_status(step, &status);
            self.record.ecu.take_frame(step, &out.guidance);
        }
        if self.since(step) == 0 {
            self.stuck_nm = self.commanded_nm;
        }
        self.delivered_nm = self.motor(step);
        Actuation {
            torque_nm: self.delivered_nm,
            limited: false,
        }
    }
}
