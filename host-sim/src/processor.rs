//! Processor in the loop: a scenario on this host, every frame of it also to the ECU's image in QEMU or on a board,
//! and every answer compared. The image has the controller's parameters of the scenario.

use std::ops::ControlFlow;

use haptic_core::quantity::Instant;
use haptic_lockstep::{Start, StartState};

use haptic_pil::cost::Drive;
use haptic_pil::{Pil, PilError, Report, Target};
use haptic_sim::guidance::OverBus;
use haptic_sim::scenario::{Condition, Scenario, Sensors};
use haptic_sim::{Action, Simulation};

/// Why there is no comparison.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ProcessorError {
    /// The scenario cannot be run with a processor.
    Scenario(String),
    /// The image cannot be built, started or heard.
    Target(PilError),
    /// `progress` broke off.
    Interrupted,
}

/// Runs a scenario over the bus. `progress` is told each step's number, and may break off.
///
/// # Errors
/// A manual scenario, which has no controller to compare, or one past the bus, the image's only way in; as
/// [`Scenario::check_times`]; what is missing or fails on the way to a running image.
pub fn run(
    scenario: &Scenario,
    target: &Target,
    mut progress: impl FnMut(u32) -> ControlFlow<()>,
) -> Result<Report, ProcessorError> {
    check(scenario)?;
    let params = scenario.controller_params();
    let start = Start {
        state: StartState::Engaged,
        at: Instant::from_us(0),
    };
    let mut pil = Pil::on(target, &params, start).map_err(ProcessorError::Target)?;
    let mut simulation = Simulation::with(scenario, OverBus::new(scenario.setup()));
    // The host's loop needs no answer, so it simply runs on until the target is gone.
    while let Some(outcome) = simulation.step(&Action::default()) {
        pil.tick(outcome.observation.now(), outcome.frames_in, outcome.frames_out)
            .map_err(ProcessorError::Target)?;
        if progress(outcome.observation.step).is_break() {
            return Err(ProcessorError::Interrupted);
        }
    }
    pil.finish().map_err(ProcessorError::Target)
}

/// What the ECU of a scenario hears, tick by tick.
///
/// # Errors
/// What [`run`] finds wrong in a scenario.
pub fn record(scenario: &Scenario) -> Result<Drive, ProcessorError> {
    check(scenario)?;
    let mut ticks = Vec::new();
    let mut simulation = Simulation::with(scenario, OverBus::new(scenario.setup()));
    while let Some(outcome) = simulation.step(&Action::default()) {
        ticks.push((outcome.observation.now(), outcome.frames_in.to_vec()));
    }
    Ok(Drive {
        params: scenario.controller_params(),
        ticks,
    })
}

fn check(scenario: &Scenario) -> Result<(), ProcessorError> {
    scenario
        .check_times()
        .map_err(|e| ProcessorError::Scenario(e.to_string()))?;
    if scenario.condition() == Condition::Manual {
        return Err(ProcessorError::Scenario(
            "condition = \"manual\" has no controller whose frames could be compared; use high, mid or low"
                .into(),
        ));
    }
    if scenario.sensors() == Sensors::Exact {
        return Err(ProcessorError::Scenario(
            "sensors = \"exact\" goes past the bus, whose frames are to be compared; use sensors = \"paper\""
                .into(),
        ));
    }
    Ok(())
}
