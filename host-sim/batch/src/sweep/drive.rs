//! One drive of a sweep: its scenario driven and measured.

use haptic_metrics::{Asked, Window};
use haptic_sim::fork::simulate_forked;
use haptic_sim::input::InputError;
use haptic_sim::scenario::Scenario;
use haptic_sim::simulation::{Run, simulate};

use super::{DesignPoint, Sweep};
use crate::record::{default_window, nominal_peak_m};
use crate::{Away, RunRecord};

/// What came of a drive.
#[derive(Debug, Clone, PartialEq)]
pub struct Driven {
    /// Whether it was stopped because it diverged. Its metrics end there.
    pub diverged: bool,
    /// Arc length of its last sample, m.
    pub end_m: f64,
    /// When the guidance was away.
    pub away: Away,
    /// A value for each of [`Sweep::metrics`], if it has one.
    pub metrics: Vec<Option<f64>>,
}

impl Sweep {
    /// Drives one point.
    ///
    /// # Errors
    /// As [`Sweep::scenario`].
    pub fn drive(&self, point: &DesignPoint) -> Result<Driven, InputError> {
        self.run_alone(&self.scenario(point)?)
    }

    /// Drives a scenario with the shipping ECU.
    pub(super) fn run_alone(&self, scenario: &Scenario) -> Result<Driven, InputError> {
        let Some(time_s) = self.recovers_from(scenario) else {
            return Ok(self.measured(scenario, &simulate(scenario), None));
        };
        // Until the failure the two are one.
        let forked = simulate_forked(scenario, &[scenario.failure()]);
        let (nominal, runs) = forked.map_err(|e| InputError::new(&self.name, e))?;
        let peak_m = nominal_peak_m(&nominal, self.window_of(scenario), time_s);
        Ok(self.measured(scenario, &runs[0], peak_m))
    }

    /// When a scenario fails, if a metric asks how the same drive goes without the failure, s.
    pub(super) fn recovers_from(&self, scenario: &Scenario) -> Option<f64> {
        let recovery = self.metrics.iter().any(|d| d.name == "time_to_recover_s");
        scenario.failure().at_s().filter(|_| recovery)
    }

    pub(super) fn window_of(&self, scenario: &Scenario) -> Window {
        self.window.unwrap_or_else(|| default_window(scenario.course()))
    }

    pub(super) fn measured(&self, scenario: &Scenario, run: &Run, nominal_peak_m: Option<f64>) -> Driven {
        let window = self.window_of(scenario);
        let record = RunRecord::asked(scenario, run, window, nominal_peak_m, Asked::among(&self.metrics));
        Driven {
            diverged: record.diverged,
            end_m: record.end_m,
            away: record.away,
            metrics: self.metrics.iter().map(|d| (d.value)(&record.metrics)).collect(),
        }
    }
}
