//! The guidance that a scenario names.

use haptic_core::bus::Frame;

use super::{Actuation, Direct, Guidance, NoGuidance, Observation, OverBus, Status};
use crate::scenario::{Condition, Scenario, Sensors};

/// The guidance that a scenario names.
#[derive(Debug, Clone)]
pub enum AnyGuidance {
    /// Manual driving.
    None(NoGuidance),
    /// The shipping controller, fed past the bus.
    Direct(Box<Direct>),
    /// The shipping ECU behind its bus.
    OverBus(Box<OverBus>),
}

impl AnyGuidance {
    /// None for a manual driver; else over the bus, or past it with exact sensors.
    pub fn new(scenario: &Scenario) -> Self {
        match (scenario.condition(), scenario.sensors()) {
            (Condition::Manual, _) => Self::None(NoGuidance),
            (_, Sensors::Exact) => Self::Direct(Box::new(Direct::new(scenario.setup()))),
            (_, Sensors::Paper) => Self::OverBus(Box::new(OverBus::new(scenario.setup()))),
        }
    }
}

impl Guidance for AnyGuidance {
    fn looks_at_road(&self, step: u32) -> bool {
        match self {
            Self::None(guidance) => guidance.looks_at_road(step),
            Self::Direct(guidance) => guidance.looks_at_road(step),
            Self::OverBus(guidance) => guidance.looks_at_road(step),
        }
    }

    #[inline]
    fn step(&mut self, observation: &Observation) -> Actuation {
        match self {
            Self::None(guidance) => guidance.step(observation),
            Self::Direct(guidance) => guidance.step(observation),
            Self::OverBus(guidance) => guidance.step(observation),
        }
    }

    fn status(&self) -> Option<Status> {
        match self {
            Self::None(guidance) => guidance.status(),
            Self::Direct(guidance) => guidance.status(),
            Self::OverBus(guidance) => guidance.status(),
        }
    }

    fn frames_in(&self) -> &[Frame] {
        match self {
            Self::OverBus(guidance) => guidance.frames_in(),
            Self::None(_) | Self::Direct(_) => &[],
        }
    }

    fn frames_out(&self) -> &[Frame] {
        match self {
            Self::OverBus(guidance) => guidance.frames_out(),
            Self::None(_) | Self::Direct(_) => &[],
        }
    }
}
