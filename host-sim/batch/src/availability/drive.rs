//! The drives of segments: with guidance and by hand, side by side where that can be.

use haptic_core::bus::Frame;
use haptic_core::bus::e2e::ReceiverState;
use haptic_core::bus::messages::{Guidance as GuidanceMessage, Message};
use haptic_core::safety::faults::{Fault, FaultSet};
use haptic_core::safety::modes::Mode;
use haptic_log::trace::{Sample, Trace};
use haptic_sim::guidance::{NoGuidance, OverBus};
use haptic_sim::models::driver::ArmGains;
use haptic_sim::scenario::Condition;
use haptic_sim::simulation::{Ending, Run, SAMPLE_RATE_HZ};
use haptic_sim::worlds::Happens;
use haptic_sim::{Action, Outcome, Scenario, Simulation};
use haptic_vectorised::Options;

use super::events::Eventful;
use super::{ByHand, Declaration, DriveSegment, SEGMENT_S, SegmentNumber};
use crate::error::StudyError;
use crate::vectorised::{Checked, Group};

const LEG_STEPS: u32 = (SEGMENT_S * 1e3) as u32;
/// The driver asks for guidance again so long after it has left, ms.
const AGAIN_MS: u32 = 5000;
/// A request that was not granted is taken back for 100 ms in every second.
const ASKS_EVERY_MS: u32 = 1000;
const LOW_MS: u32 = 100;

/// In place of faults where the ECU named none.
pub const UNNAMED: &str = "none named";

/// Drives segments, side by side where that can be, both with guidance and by hand; `done` gets each with its place, in no order. A run
/// that is vectorised with guidance is one in which the ECU leaves nothing.
///
/// # Errors
/// As [`SegmentNumber::scenario`]; a drive that differs from the shipping ECU's; what `done` says.
pub(super) fn side_by_side(
    segments: &[SegmentNumber],
    root: u64,
    [first, of]: [usize; 2],
    mut done: impl FnMut(usize, DriveSegment) -> Result<(), StudyError>,
) -> Result<(), StudyError> {
    // Vectorised runs know of nothing that happens.
    if segments
        .iter()
        .any(|segment| segment.world.happens() != Happens::default())
    {
        let mut alone = segments.iter().enumerate();
        return alone.try_for_each(|(place, segment)| done(place, segment.drive(root)?));
    }
    let guided = segments.iter().map(|segment| segment.scenario(root));
    let guided: Vec<Scenario> = guided.collect::<Result<_, _>>()?;
    let manual: Vec<Scenario> = guided.iter().map(manual).collect::<Result<_, _>>()?;
    let options = Options {
        most_s: Some(SEGMENT_S as u32),
        ..Options::default()
    };
    let group = |scenarios| Group {
        scenarios,
        first: first as u64,
        checked: Checked::new(root, of as u64),
    };
    let hand = |place: usize| by_hand(&guided[place]);
    let hands = group(&manual).measured(options, hand, |_, run| Ok(ByHand::new(run)))?;
    let hands: Vec<ByHand> = (hands.into_iter().enumerate())
        .map(|(place, found)| found.unwrap_or_else(|| ByHand::new(&hand(place))))
        .collect();
    let mut judge = |place: usize, run: &Run, reported| {
        done(
            place,
            segments[place].segment(&guided[place], run, reported, hands[place]),
        )
    };
    let ecu = |place: usize| with_ecu(&guided[place], Happens::default());
    let judged = group(&guided).measured(
        options,
        |place| ecu(place).0,
        |place, run| {
            let reported = Reported {
                active: run.steps,
                ..Reported::new()
            };
            judge(place, run, reported)
        },
    )?;
    let rejected = (0..judged.len()).filter(|place| judged[*place].is_none());
    rejected.into_iter().try_for_each(|place| {
        let (run, reported) = ecu(place);
        judge(place, &run, reported)
    })
}

/// The same driver without guidance: what this driver would make of its torque does not matter where there is none.
fn manual(scenario: &Scenario) -> Result<Scenario, StudyError> {
    let gains = ArmGains {
        k_hg: 0.0,
        ..scenario.gains()
    };
    let manual = scenario.to_builder().condition(Condition::Manual).gains(gains);
    Ok(manual.build()?)
}

/// A segment's drive by hand.
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
    let (mut watch, mut samples) = (Watch::new(), empty_samples());
    while watch.steps < LEG_STEPS && watch.reported.mode != Mode::Fault {
        let action = Action {
            beside_m: simulation.guidance().beside_m(watch.steps),
            ..watch.action()
        };
        let Some(outcome) = simulation.step(&action) else {
            break;
        };
        samples.extend(outcome.sample);
        watch.observe(&outcome);
    }
    (run_of(samples, simulation.ending(), watch.steps), watch.reported)
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

/// Driver, host and listener of a segment.
pub struct Watch {
    receiver: ReceiverState,
    /// What the ECU did so far.
    pub reported: Reported,
    /// The last frame of the ECU.
    pub said: Option<GuidanceMessage>,
    faults: FaultSet,
    /// Steps since guidance left; none while it is there.
    away: Option<u32>,
    steps: u32,
    /// Lateral acceleration of the road, left positive.
    lateral_m_per_s2: f64,
}

/// What the ECU did in a segment.
pub struct Reported {
    /// At its end.
    pub mode: Mode,
    /// Steps with guidance.
    pub active: u32,
    /// What took guidance away.
    pub declarations: Vec<Declaration>,
}

impl Reported {
    fn new() -> Self {
        Self {
            mode: Mode::Active,
            active: 0,
            declarations: Vec::new(),
        }
    }
}

impl Watch {
    /// Before the first step: guidance is there, and nothing was said.
    #[must_use]
    #[allow(clippy::new_without_default, reason = "a watch begins, it is not empty")]
    pub fn new() -> Self {
        Self {
            receiver: ReceiverState::TRUSTED,
            said: None,
            reported: Reported::new(),
            faults: FaultSet::NONE,
            away: None,
            steps: 0,
            lateral_m_per_s2: 0.0,
        }
    }

    /// What driver and host do next.
    fn action(&self) -> Action {
        Action {
            engage: Some(self.engages()),
            ..Action::default()
        }
    }

    /// Whether guidance is asked for.
    pub fn engages(&self) -> bool {
        match self.away {
            None => true,
            // A handover goes on while the request stays.
            Some(_) if self.reported.mode != Mode::Standby => true,
            Some(away) => away >= AGAIN_MS && away % ASKS_EVERY_MS >= LOW_MS,
        }
    }

    fn observe(&mut self, outcome: &Outcome) {
        if let Some(sample) = outcome.sample {
            let v = sample.speed_m_per_s;
            self.lateral_m_per_s2 = sample.curvature_1pm * v * v;
        }
        self.take_frame(outcome.time_s(), outcome.frames_out.first());
    }

    /// Takes the guidance frame of a step.
    pub fn take_frame(&mut self, time_s: f64, frame: Option<&Frame>) {
        self.steps += 1;
        let guidance = frame.and_then(|frame| GuidanceMessage::decode(&mut self.receiver, frame).ok());
        if let Some(guidance) = guidance {
            if self.reported.mode == Mode::Active && guidance.mode != Mode::Active {
                let named = guidance.faults.difference(self.faults);
                self.reported.declarations.push(Declaration {
                    time_s,
                    faults: names(if named == FaultSet::NONE {
                        guidance.faults
                    } else {
                        named
                    }),
                    lateral_m_per_s2: self.lateral_m_per_s2,
                });
            }
            (self.reported.mode, self.faults) = (guidance.mode, guidance.faults);
            self.said = Some(guidance);
        }
        if self.reported.mode == Mode::Active {
            (self.reported.active, self.away) = (self.reported.active + 1, None);
        } else {
            self.away = Some(self.away.map_or(0, |away| away + 1));
        }
    }
}

fn names(faults: FaultSet) -> String {
    let named: Vec<String> = Fault::ALL
        .into_iter()
        .filter(|fault| faults.contains(*fault))
        .map(|fault| format!("{fault:?}"))
        .collect();
    if named.is_empty() {
        return UNNAMED.into();
    }
    named.join("+")
}
