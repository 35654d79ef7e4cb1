//! The drives of segments: with guidance and by hand, side by side where that can be.

use haptic_core::safety::modes::Mode;
use haptic_log::trace::{Sample, Trace};
use haptic_sim::guidance::{NoGuidance, OverBus};
use haptic_sim::models::driver::ArmGains;
use haptic_sim::scenario::Condition;
use haptic_sim::simulation::{Ending, Run, SAMPLE_RATE_HZ};
use haptic_sim::worlds::Happens;
use haptic_sim::{Action, Scenario, Simulation};
use haptic_vectorised::Options;

use super::events::Eventful;
use super::{ByHand, DriveSegment, SEGMENT_S, SegmentNumber};
use crate::declared::{Listener, Reported};
use haptic_batch::StudyError;
use haptic_batch::engine::Part;

const LEG_STEPS: u32 = (SEGMENT_S * 1e3) as u32;

/// Drives segments, side by side where that can be, both with guidance and by hand. A run that is vectorised with guidance is one in
/// which the ECU leaves nothing.
///
/// # Errors
/// As [`SegmentNumber::scenario`]; a drive that differs from the shipping ECU's; what the part says.
pub(super) fn side_by_side(
    part: &Part<'_, SegmentNumber, DriveSegment>,
    root: u64,
) -> Result<Vec<DriveSegment>, StudyError> {
    let segments = part.cases;
    // Vectorised runs know of nothing that happens.
    if segments
        .iter()
        .any(|segment| segment.world.happens() != Happens::default())
    {
        return part.one_by_one(|segment| segment.drive(root));
    }
    let guided = part.scenarios(|segment| segment.scenario(root))?;
    let manual: Vec<Scenario> = guided.iter().map(manual).collect::<Result<_, _>>()?;
    let options = Options {
        most_s: Some(SEGMENT_S as u32),
        ..Options::default()
    };
    let hands = part
        .group(&manual)
        .measured(options, by_hand, |_, run| Ok(ByHand::new(run)))?;
    let hands: Vec<ByHand> = (hands.into_iter().zip(&manual))
        .map(|(found, scenario)| found.unwrap_or_else(|| ByHand::new(&by_hand(scenario))))
        .collect();
    let judge = |place: usize, run: &Run, reported| -> Result<DriveSegment, StudyError> {
        let segment = segments[place].segment(&guided[place], run, reported, hands[place]);
        part.done(place, &segment)?;
        Ok(segment)
    };
    let ecu = |scenario: &Scenario| with_ecu(scenario, Happens::default());
    let judged = part.group(&guided).measured(
        options,
        |scenario| ecu(scenario).0,
        |place, run| {
            let reported = Reported {
                active: run.steps,
                ..Reported::new()
            };
            judge(place, run, reported)
        },
    )?;
    let judged = judged
        .into_iter()
        .enumerate()
        .map(|(place, judged)| match judged {
            Some(segment) => Ok(segment),
            None => {
                let (run, reported) = ecu(&guided[place]);
                judge(place, &run, reported)
            }
        });
    judged.collect()
}

/// The segment's driver by hand, whose K_hg is 0: there is no guidance to work against, and a motor's ripple, which is there
/// all the same, is none.
pub(super) fn manual(scenario: &Scenario) -> Result<Scenario, StudyError> {
    let gains = ArmGains {
        k_hg: 0.0,
        ..scenario.gains()
    };
    let manual = scenario.to_builder().condition(Condition::Manual).gains(gains);
    Ok(manual.build()?)
}

/// A segment's drive by hand, of what [`manual`] makes of its scenario.
pub(super) fn by_hand(scenario: &Scenario) -> Run {
    let mut simulation = Simulation::with(scenario, NoGuidance);
    let mut samples = empty_samples();
    while simulation.steps() < LEG_STEPS {
        let Some(outcome) = simulation.step(&Action::default()) else {
            break;
        };
        samples.extend(outcome.sample);
    }
    run_of(samples, simulation.ending(), simulation.steps())
}

/// A segment's drive with the shipping ECU, and what it reported.
pub(super) fn with_ecu(scenario: &Scenario, happens: Happens) -> (Run, Reported) {
    let ecu = Eventful::new(OverBus::new(scenario.setup()), happens, scenario.seed());
    let mut simulation = Simulation::with(scenario, ecu);
    let (mut listener, mut samples) = (Listener::new(), empty_samples());
    while listener.steps < LEG_STEPS && listener.reported.mode != Mode::Fault {
        let action = Action {
            beside_m: simulation.guidance().beside_m(listener.steps),
            ..listener.action()
        };
        let Some(outcome) = simulation.step(&action) else {
            break;
        };
        samples.extend(outcome.sample);
        listener.observe(&outcome);
    }
    (
        run_of(samples, simulation.ending(), listener.steps),
        listener.reported,
    )
}

/// For the samples of a segment.
fn empty_samples() -> Vec<Sample> {
    Vec::with_capacity((SEGMENT_S * f64::from(SAMPLE_RATE_HZ)) as usize + 1)
}

fn run_of(samples: Vec<Sample>, ending: Option<Ending>, steps: u32) -> Run {
    Run {
        trace: Trace {
            sample_rate_hz: f64::from(SAMPLE_RATE_HZ),
            samples,
        },
        ending: ending.unwrap_or(Ending::CourseEnd),
        steps,
    }
}
