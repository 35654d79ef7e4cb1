//! The harness of the ECU in the loop, with everything that can be wrong around it: senders, bus, clock, the ECU,
//! the motor, a hand on the wheel, and the invariant checker that watches every cycle.

mod injected;
mod timing;
mod witness;

use haptic_core::bus::Frame;
use haptic_core::controller::config::Setup;
use haptic_core::controller::params::Params;
use haptic_core::ecu::injection::InjectedEcu;
use haptic_core::quantity::Instant;
use rand::RngExt;
use rand::rngs::Xoshiro256PlusPlus;

use super::bytes::Status;
use super::injection::{Injection, Inside};
use super::invariants::InvariantChecker;
use super::residual::Residual;
use super::senders::Senders;
use super::start_up::{is_engaged, start_up};
use super::table::{Class, FaultCase};
use super::trial_record::{EcuTrace, Tick, TrialRecord};
use super::wire::{Arrival, Bus};
use haptic_sim::guidance::{Actuation, Guidance, Observation};
use haptic_sim::models::sensors;
use haptic_sim::models::torsion_bar::ColumnFault;
use haptic_sim::scenario::Scenario;
use timing::FaultTiming;
use witness::Witness;

/// The ECU with everything around it, in the place of the guidance.
#[derive(Debug, Clone)]
pub(super) struct EcuHarness<'a> {
    row: &'a FaultCase,
    timing: FaultTiming<'a>,
    /// The torque is gone, whatever the ECU says.
    dropped: bool,
    /// No ECU runs from this step on.
    end: u32,
    senders: Senders,
    bus: Bus,
    ecu: InjectedEcu,
    setup: Setup,
    checker: InvariantChecker,
    witness: Witness,
    rng: Xoshiro256PlusPlus,
    /// Left or right, for what has a side.
    side: f64,
    commanded_nm: f64,
    delivered_nm: f64,
    /// Torque of the motor at the onset.
    stuck_nm: f64,
    sent: Vec<Frame>,
    /// What has arrived and was not yet received: a step that is lost or late leaves it to the next.
    arrivals: Vec<Arrival>,
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
        let timing = FaultTiming::new(row, onset);
        let clock_base_us = timing.clock_base_us;
        let now = Instant::from_us(clock_base_us);
        let (params, start) = start_up(row.start, scenario, now, &mut rng);
        let ecu = InjectedEcu::new(start.ecu(&params).expect("a checked scenario"));
        Self {
            row,
            timing,
            dropped: false,
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
            )
            .behind_a_bar(params.has_bar()),
            witness: Witness::new(
                row,
                onset,
                Residual::new(scenario.vehicle(), scenario.speed_m_per_s()),
            ),
            side: if rng.random_bool(0.5) { 1.0 } else { -1.0 },
            rng,
            commanded_nm: 0.0,
            delivered_nm: 0.0,
            stuck_nm: 0.0,
            sent: Vec::new(),
            arrivals: Vec::new(),
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

    /// What of a column with a bar fails at the onset.
    pub(super) fn column_fault(&self) -> Option<ColumnFault> {
        self.row.column_fault()
    }

    /// Ends every fault of the case.
    pub(super) fn end_faults(&mut self) {
        self.timing.healthy = true;
        self.trace = None;
    }

    /// From here on there is no torque.
    pub(super) fn drop_torque(&mut self) {
        self.dropped = true;
        self.trace = None;
    }

    /// When the ECU left Active for good or for a handover, if it did since the onset.
    pub(super) fn left_at(&self) -> Option<u32> {
        self.witness.left_at()
    }

    pub(super) fn into_record(self) -> TrialRecord {
        TrialRecord {
            cycles: self.checker.cycles,
            violation: self.checker.violation,
            ..self.witness.record
        }
    }

    fn send(&mut self, observation: &Observation) {
        let step = observation.step;
        let (acting, since_s) = (self.timing.acting(step), self.timing.since(step) as f64 * 1e-3);
        let readings = self.senders.read(observation, acting, since_s, &mut self.rng);
        let torques_nm = [self.commanded_nm, self.delivered_nm];
        self.witness
            .readings(step, &readings, torques_nm, self.senders.probe);
        self.sent.clear();
        let requested = is_engaged(self.row.start) || step >= self.timing.onset;
        self.senders
            .send(observation, &readings, requested, acting, &mut self.sent);
        if let Some(times) = Bus::burst(acting) {
            for frame in &self.sent {
                self.senders.skip_counts(frame.id(), times - 1);
            }
        }
        self.bus
            .carry(step, &self.sent, acting, &mut self.rng, &mut self.arrivals);
        if acting.contains(&Injection::Inside(Inside::ReceiverSkipped)) {
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
                    self.witness.record.accepted_bad_at.get_or_insert(step);
                }
                (true, false) => self.witness.record.rejected += 1,
                (false, _) => {}
            }
        }
        received
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
        self.witness.record.steps = step;
        let (ticks, count) = self.timing.ticks(step);
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
            self.witness.status(step, &status);
            self.witness.record.ecu.take_frame(step, &out.guidance);
        }
        if self.timing.since(step) == 0 {
            self.stuck_nm = self.commanded_nm;
        }
        self.delivered_nm = self.motor(step);
        Actuation {
            torque_nm: self.delivered_nm,
            limited: false,
        }
    }

    fn status(&self) -> Option<haptic_sim::guidance::Status> {
        self.witness.record.ecu.status()
    }
}
