//! The harness of the ECU in the loop, with everything that can be wrong around it: senders, bus, clock, the ECU,
//! the motor, a hand on the wheel, and the invariant checker that watches every cycle.

mod injected;

use haptic_core::bus::Frame;
use haptic_core::controller::config::Setup;
use haptic_core::controller::params::Params;
use haptic_core::ecu::injection::InjectedEcu;
use haptic_core::quantity::Instant;
use rand::RngExt;
use rand::rngs::Xoshiro256PlusPlus;

use super::bytes::Status;
use super::bytes::{ACTIVE, FADE, FAULT, HANDOVER, LANE_STEP};
use super::injection::{Clock, Injection, Inside};
use super::invariants::InvariantChecker;
use super::residual::{Detectability, Residual};
use super::senders::{Senders, SensorReadings};
use super::start_up::{is_engaged, start_up};
use super::table::{Class, FaultCase};
use super::trial_record::{EcuTrace, Tick, TrialRecord};
use super::wire::{Arrival, Bus};
use haptic_sim::guidance::{Actuation, Guidance, Observation};
use haptic_sim::models::sensors;
use haptic_sim::scenario::Scenario;

/// Code of the limit that acts for the driver's sake.
const DRIVER_OVERRIDE: u64 = 5;

/// The ECU with everything around it, in the place of the guidance.
#[derive(Debug, Clone)]
pub(super) struct EcuHarness<'a> {
    row: &'a FaultCase,
    /// Nothing of the row goes wrong here; what the driver's hand does stays.
    healthy: bool,
    /// The torque is gone, whatever the ECU says.
    dropped: bool,
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

/// What the column's model takes for the aligning torque, N.m.s2/m.
fn aligning_gain(scenario: &Scenario) -> f64 {
    scenario.controller_params().vehicle.aligning_gain_nm_s2_per_m
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
            healthy: false,
            dropped: false,
            onset,
            end,
            // One run in four has the probe on.
            senders: Senders::new(rng.random_ratio(1, 4), aligning_gain(scenario)),
            bus: Bus::new(row.injections),
            ecu,
            setup: Setup::new(&params).expect("a checked scenario"),
            checker: InvariantChecker::new(
                is_engaged(row.start),
                scenario.sensor_errors().camera_latency_s > 0.0,
                clock_base_us,
            ),
            residual: Residual::new(scenario.vehicle(), scenario.speed_m_per_s()),
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

    /// Class of the case.
    pub(super) fn class(&self) -> Class {
        self.row.class
    }

    /// Ends every fault of the case.
    pub(super) fn end_faults(&mut self) {
        self.healthy = true;
        self.trace = None;
    }

    /// From here on there is no torque.
    pub(super) fn drop_torque(&mut self) {
        self.dropped = true;
        self.trace = None;
    }

    /// When the ECU left Active for good or for a handover, if it did since the onset.
    pub(super) fn left_at(&self) -> Option<u32> {
        let modes = self.record.modes.iter();
        let left =
            |(step, mode): &&(u32, u64)| *step >= self.onset && matches!(*mode, FADE | HANDOVER | FAULT);
        modes.clone().find(left).map(|(step, _)| *step)
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
        !self.healthy && since >= 0 && self.row.lasts_ms.is_none_or(|ms| since < i64::from(ms))
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
        if since < 0 || self.healthy {
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
            let yaw_rate = readings.yaw_rate_rad_per_s.unwrap_or(0.0);
            self.residual.motion(time_s, speeds, yaw_rate);
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
            let still = self.residual.still_used(self.senders.has_probe());
            let shown = if self.row.seen == Detectability::Contradiction {
                used.max(still)
            } else {
                used
            };
            self.record.used = self.record.used.max(shown);
            let contradicted = self.residual.used(Detectability::Contradiction).max(still);
            self.record.contradicted = self.record.contradicted.max(contradicted);
        }
        let since = |by| self.residual.detectable_since(by, observation.step);
        let (since, weak_since) = (since(self.row.seen), since(Detectability::MotorWeak));
        // A motor that came back within the ECU's patience has not been astray.
        let returned =
            self.row.seen.is_of_motor() && self.record.modes.last().is_some_and(|(_, m)| *m == ACTIVE);
        let kept = |before: Option<u32>, since| if returned { since } else { before.or(since) };
        self.record.seen_at = kept(self.record.seen_at, since);
        self.record.weak_at = kept(self.record.weak_at, weak_since);
    }

    fn record_status(&mut self, step: u32, status: &Status) {
        let record = &mut self.record;
        if record.modes.last().is_none_or(|(_, mode)| *mode != status.mode) {
            record.modes.push((step, status.mode));
        }
        record.reset = status.reset;
        if step >= self.onset {
            // Which line is gone on with, and which is taken, the second opinion does not know: nothing is too early then.
            if status.mode == ACTIVE && status.faults & LANE_STEP != 0 {
                record.used = f64::INFINITY;
            }
            record.peak_nm = record.peak_nm.max(status.torque_nm.abs());
            record.overridden |= status.limit == DRIVER_OVERRIDE;
            if status.torque_nm == 0.0 && status.mode == ACTIVE {
                record.yielded_at.get_or_insert(step);
            }
        }
    }
}

impl Guidance for EcuHarness<'_> {
    fn looks_at_road(&self, step: u32) -> bool {
        sensors::camera_looks(step)
    }

    fn step(&mut self, observation: &Observation) -> Actuation {
        let step = observation.step;
        if step >= self.end || self.dropped {
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
            let status = Status::decode(&out.guidance);
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

    fn status(&self) -> Option<haptic_sim::guidance::Status> {
        self.record.ecu.status()
    }
}
