//! Processor in the loop: a scenario on this host, every frame of it also to the ECU's image in QEMU or on a board,
//! and every answer compared. The image has the controller's parameters of the scenario.

use std::ops::ControlFlow;

use haptic_core::lockstep::{Start, StartState};
use haptic_core::quantity::Instant;

use haptic_sim::closed_loop::{Cycle, drive};
use haptic_sim::guidance::OverBus;
use haptic_sim::models::road::Centreline;
use haptic_sim::scenario::{Condition, Scenario, Sensors};
use haptic_target::{Pil, PilError, Report, Target};

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
/// [`Scenario::check`] and [`Scenario::check_times`]; what is missing or fails on the way to a running image.
pub fn run(
    scenario: &Scenario,
    target: &Target,
    mut progress: impl FnMut(u32) -> ControlFlow<()>,
) -> Result<Report, ProcessorError> {
    let checked = scenario.check().and_then(|()| scenario.check_times());
    checked.map_err(ProcessorError::Scenario)?;
    if scenario.condition == Condition::Manual {
        return Err(ProcessorError::Scenario(
            "condition = \"manual\" has no controller whose frames could be compared; use high, mid or low"
                .into(),
        ));
    }
    if scenario.sensors == Sensors::Exact {
        return Err(ProcessorError::Scenario(
            "sensors = \"exact\" goes past the bus, whose frames are to be compared; use sensors = \"paper\""
                .into(),
        ));
    }
    let params = scenario.controller_params();
    let setup = scenario.setup().map_err(ProcessorError::Scenario)?;
    let start = Start {
        state: StartState::Engaged,
        at: Instant::from_us(0),
    };
    let mut pil = Pil::on(target, &params, start).map_err(ProcessorError::Target)?;
    let mut guidance = OverBus::new(&setup);
    guidance.set_probe(scenario.guidance.probe);
    let mut broken = None;
    drive(
        scenario,
        &Centreline::new(&scenario.course),
        &mut guidance,
        &mut |cycle: &Cycle| {
            // The host's loop needs no answer, so it simply runs out when the target is gone.
            if broken.is_none() {
                let answered = pil.tick(cycle.view.now(), cycle.frames_in, cycle.frames_out);
                broken = answered.err().map(ProcessorError::Target);
                if progress(cycle.view.step).is_break() {
                    broken = Some(ProcessorError::Interrupted);
                }
            }
        },
    );
    match broken {
        Some(error) => Err(error),
        None => pil.finish().map_err(ProcessorError::Target),
    }
}
