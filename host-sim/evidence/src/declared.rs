//! What the ECU declares while it guides: who asks for guidance, and asks again after it has left, and what took it away.

use haptic_core::bus::Frame;
use haptic_core::bus::e2e::ReceiverState;
use haptic_core::bus::messages::{Guidance as GuidanceMessage, Message};
use haptic_core::safety::faults::{Fault, FaultSet};
use haptic_core::safety::modes::Mode;
use haptic_sim::{Action, Outcome};
use serde::{Deserialize, Serialize};

/// The driver asks for guidance again so long after it has left, ms.
const AGAIN_MS: u32 = 5000;
/// A request that was not granted is taken back for 100 ms in every second.
const ASKS_EVERY_MS: u32 = 1000;
const LOW_MS: u32 = 100;

/// In place of faults where the ECU named none.
pub const UNNAMED: &str = "none named";

/// Guidance left although nothing was wrong.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Declaration {
    /// When, s after the start of the segment.
    pub time_s: f64,
    /// The faults that the ECU named, joined by a plus.
    pub faults: String,
    /// Lateral acceleration of the road there, m/s2, left positive.
    pub lateral_m_per_s2: f64,
}

/// Driver and host, who ask for guidance, and who listens to what the ECU says.
pub struct Listener {
    receiver: ReceiverState,
    /// What the ECU did so far.
    pub reported: Reported,
    /// The last frame of the ECU.
    pub said: Option<GuidanceMessage>,
    faults: FaultSet,
    /// Steps since guidance left; none while it is there.
    away: Option<u32>,
    /// Steps so far.
    pub steps: u32,
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
    pub(crate) fn new() -> Self {
        Self {
            mode: Mode::Active,
            active: 0,
            declarations: Vec::new(),
        }
    }
}

impl Listener {
    /// Before the first step: guidance is there, and nothing was said.
    #[must_use]
    #[allow(clippy::new_without_default, reason = "a listener begins, it is not empty")]
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
    pub fn action(&self) -> Action {
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

    /// Takes what came of a step.
    pub fn observe(&mut self, outcome: &Outcome) {
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
                // What was named before took nothing away.
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
