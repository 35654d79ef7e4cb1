//! One recorded drive, identified: what was found, and on request how the identified driver drives a course.

use serde::Serialize;

use super::RunRecord;
use super::experiment::identified_driver;
use super::record::default_window;
use haptic_analysis::identify::{
    DriveLog, FixError, Identification, Options, Tracking, identify_as_published, identify_with_noise_model,
    track,
};
use haptic_sim::models::road::Course;
use haptic_sim::scenario::{Condition, Scenario};
use haptic_sim::simulation::simulate;

/// How to identify.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// Prediction errors with a disturbance model.
    #[default]
    NoiseModel,
    /// As published.
    Paper,
}

/// A drive and what was made of it.
#[derive(Debug, Clone)]
pub struct IdentifiedDrive {
    /// Name of the log.
    pub name: String,
    /// The driver over time.
    pub tracking: Tracking,
    /// What is handed on.
    pub results: IdentificationResults,
}

/// The results, as JSON holds them.
#[derive(Debug, Clone, Serialize)]
pub struct IdentificationResults {
    /// The identification.
    #[serde(flatten)]
    pub identification: Identification,
    /// The identified driver on the course asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drives_again: Option<RunRecord>,
}

/// Identifies the driver of `log`.
///
/// # Errors
/// A fixed parameter that the method does not have.
pub fn identify(
    name: &str,
    log: &DriveLog,
    options: &Options,
    method: Method,
) -> Result<IdentifiedDrive, FixError> {
    let identification = match method {
        Method::NoiseModel => {
            options.check()?;
            identify_with_noise_model(log, options)
        }
        Method::Paper => identify_as_published(log, options)?,
    };
    Ok(IdentifiedDrive {
        name: name.into(),
        tracking: track(log, options),
        results: IdentificationResults {
            identification,
            drives_again: None,
        },
    })
}

impl IdentifiedDrive {
    /// Lets the identified driver, without remnant, drive `course` under the default guidance, or manually.
    ///
    /// # Errors
    /// As [`haptic_sim::scenario::ScenarioBuilder::build`]: the course is too short, say.
    pub fn drive_again(&mut self, course: Course, speed_kmh: f64, options: &Options) -> Result<(), String> {
        let condition = if options.manual {
            Condition::Manual
        } else {
            Condition::Custom
        };
        let base = Scenario::builder()
            .course(course)
            .speed_kmh(speed_kmh)
            .condition(condition)
            .build()?;
        let scenario = identified_driver(&base, &self.results.identification, options.muscle)?;
        let run = simulate(&scenario);
        let window = default_window(scenario.course());
        self.results.drives_again = Some(RunRecord::new(&scenario, &run, window, None));
        Ok(())
    }
}
