//! A whole run, and what a step and a run leave behind.

use haptic_core::bus::Frame;
use haptic_log::trace::{Sample, Trace};

use super::{SAMPLE_RATE_HZ, Simulation};
use crate::action::Action;
use crate::guidance::{Actuation, AnyGuidance, Guidance, LaneErrors, Observation, Status};
use crate::models::STEP_S;
use crate::parts::DriverVehicle;
use crate::scenario::{Failure, Scenario};
use crate::unguided::Cause;

/// How a run ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Ending {
    /// At the end of the course.
    CourseEnd,
    /// Diverged, after this arc length.
    Diverged {
        /// Last arc length on record, m.
        s_m: f64,
    },
}

/// What a run leaves behind.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Its samples.
    pub trace: Trace,
    /// How it ended.
    pub ending: Ending,
    /// Steps simulated; one is 1 ms.
    pub steps: u32,
}

impl Run {
    /// Whether the run was stopped because it diverged.
    pub fn diverged(&self) -> bool {
        self.ending != Ending::CourseEnd
    }
}

/// What came of one step, after the guidance has decided.
#[derive(Debug, Clone, Copy)]
pub struct Outcome<'a> {
    /// Lane errors at the driver's points.
    pub preview: LaneErrors,
    /// What the guidance could look at.
    pub observation: Observation,
    /// The torque that it decided.
    pub decided: Actuation,
    /// The torque really applied, N.m: zero while the torque is lost.
    pub applied_torque_nm: f64,
    /// What the ECU says of itself; `None` without guidance.
    pub status: Option<Status>,
    /// Why the guidance is away, if it is.
    pub unguided: Option<Cause>,
    /// The truth of this instant, 200 times a second.
    pub sample: Option<Sample>,
    /// The frames that went to the ECU, in order of sending.
    pub frames_in: &'a [Frame],
    /// The frames that came from it, the guidance frame first.
    pub frames_out: &'a [Frame],
}

impl Outcome<'_> {
    /// Time since the start of the run, s.
    pub fn time_s(&self) -> f64 {
        f64::from(self.observation.step) * STEP_S
    }
}

impl<G: Guidance, S: DriverVehicle> Simulation<G, S> {
    /// Drives to the end as the scenario has it.
    pub fn run(self) -> Run {
        self.run_observed(|_| ())
    }

    /// Drives to the end as the scenario has it; `observe` sees every step.
    pub fn run_observed(mut self, mut observe: impl FnMut(&Outcome)) -> Run {
        let left_s = self.plan.duration_s - f64::from(self.step) * STEP_S;
        let samples = left_s * f64::from(SAMPLE_RATE_HZ);
        let mut trace = Trace {
            sample_rate_hz: f64::from(SAMPLE_RATE_HZ),
            samples: Vec::with_capacity(samples as usize + 2),
        };
        while let Some(outcome) = self.step(&Action::default()) {
            observe(&outcome);
            if let Some(sample) = outcome.sample {
                trace.samples.push(sample);
            }
        }
        Run {
            trace,
            ending: self.ending.unwrap_or(Ending::CourseEnd),
            steps: self.step,
        }
    }

    /// A clone that fails as `failure` has it in the place of what the scenario plans, if this is the step in which it
    /// fails (it then differs from here on) or nothing fails; `None` in any other step.
    pub fn fork_at(&self, failure: Failure) -> Option<Self>
    where
        Self: Clone,
    {
        let steps = failure.steps();
        let is_now = failure.at_s().is_none() || self.step == steps[0];
        is_now.then(|| {
            let mut fork = self.clone();
            (fork.plan.failure, fork.plan.failure_steps) = (failure.kind, steps);
            fork
        })
    }
}

/// Simulates a scenario.
pub fn simulate(scenario: &Scenario) -> Run {
    observe(scenario, |_| ())
}

/// Simulates a scenario, like [`simulate`]; `watch` sees every step.
pub fn observe(scenario: &Scenario, watch: impl FnMut(&Outcome)) -> Run {
    // Each kind compiled for itself: a step then chooses nothing.
    match AnyGuidance::new(scenario) {
        AnyGuidance::None(guidance) => Simulation::with(scenario, guidance).run_observed(watch),
        AnyGuidance::Direct(guidance) => Simulation::with(scenario, *guidance).run_observed(watch),
        AnyGuidance::OverBus(guidance) => Simulation::with(scenario, *guidance).run_observed(watch),
    }
}
