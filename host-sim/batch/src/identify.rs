//! One recorded drive, identified: what was found, and on request how the identified driver drives a course.

use serde::Serialize;

use super::RunRecord;
use super::record::default_window;
pub use crate::drivers::Intervals;
use crate::drivers::{identified_driver, intervals};
use crate::engine::{StudyError, Watch, each};
use crate::several::{Difference, Population, differences, population};
use crate::statistics::Confidence;
use haptic_analysis::identify::{
    DriveLog, FixError, Identification, Options, Piece, Pieces, SingleTrack, Tracking, identify_and_track,
    identify_as_published, identify_in_pieces, identify_together_and_track, identify_with_noise_model, track,
};
use haptic_sim::models::road::Course;
use haptic_sim::scenario::{Condition, Scenario};
use haptic_sim::simulation::simulate;

/// The vehicle of a scenario, as far as it decides how the vehicle turns: what a recording of the bus does not hold.
#[must_use]
pub fn single_track(scenario: &Scenario) -> SingleTrack {
    let v = scenario.vehicle();
    SingleTrack {
        m: v.m,
        i: v.i,
        l_f: v.l_f,
        l_r: v.l_r,
        k_f: v.k_f,
        k_r: v.k_r,
        k_t: v.k_t,
    }
}

/// How to identify.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// Prediction errors with a disturbance model.
    #[default]
    NoiseModel,
    /// The published method.
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
    /// The driver of each piece, if they were asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pieces: Option<Pieces>,
    /// The identified driver on the course asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drives_again: Option<RunRecord>,
    /// How often the intervals of the report hold their parameters.
    #[serde(skip_serializing_if = "Confidence::is_usual")]
    pub level: Confidence,
    /// Intervals of that level: of the drive, then of each piece. Those of 95 % stand beside each parameter.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub intervals: Vec<Intervals>,
}

/// None of 95 %.
fn all_intervals<'a>(all: impl Iterator<Item = &'a Identification>, level: Confidence) -> Vec<Intervals> {
    let all = all.filter(|_| !level.is_usual());
    all.map(|found| intervals(found, level)).collect()
}

fn drive_of(name: &str, identification: Identification, tracking: Tracking) -> IdentifiedDrive {
    IdentifiedDrive {
        name: name.into(),
        tracking,
        results: IdentificationResults {
            identification,
            pieces: None,
            drives_again: None,
            level: Confidence::USUAL,
            intervals: Vec::new(),
        },
    }
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
    let (identification, tracking) = match method {
        Method::NoiseModel => {
            options.check(log)?;
            identify_and_track(log, options)
        }
        Method::Paper => (identify_as_published(log, options)?, track(log, options)),
    };
    Ok(drive_of(name, identification, tracking))
}

/// Identifies the driver of `log` as of one driver, and of each piece between two changes.
///
/// # Errors
/// As [`identify`].
pub fn identify_pieces(name: &str, log: &DriveLog, options: &Options) -> Result<IdentifiedDrive, FixError> {
    let mut drive = identify(name, log, options, Method::NoiseModel)?;
    drive.results.pieces = Some(identify_in_pieces(log, options));
    Ok(drive)
}

/// One driver in several drives, in one fit.
///
/// # Errors
/// As [`identify`]; drives of different rates.
pub fn identify_several(
    name: &str,
    logs: &[DriveLog],
    options: &Options,
) -> Result<IdentifiedDrive, StudyError> {
    for log in logs {
        options.check(log)?;
    }
    let (identification, tracking) = identify_together_and_track(logs, options)?;
    Ok(drive_of(name, identification, tracking))
}

/// Several drivers beside each other.
#[derive(Debug, Clone, Serialize)]
pub struct Drivers {
    /// Name of the drive and what was made of it.
    pub drivers: Vec<(String, Identification)>,
    /// How often intervals hold.
    #[serde(skip_serializing_if = "Confidence::is_usual")]
    pub level: Confidence,
    /// The intervals of each drive, where they are not those of 95 %, which stand beside each parameter.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub intervals: Vec<Intervals>,
    /// Names of the two who are compared: those of two whose models are not refuted, where there are just two; empty otherwise.
    pub compared: Vec<String>,
    /// Their differences, the first less the second; empty otherwise.
    pub differences: Vec<Difference>,
    /// What a group of three drivers or more is like; empty of fewer whose models are not refuted.
    pub population: Vec<Population>,
}

/// Identifies the driver of each log, and compares them. With `pieces` a driver who changes is every piece, and the longest one is
/// compared.
///
/// # Errors
/// That whoever watches ended it.
pub fn compare_drivers(
    logs: &[(String, DriveLog)],
    options: &Options,
    pieces: bool,
    level: Confidence,
    watch: &Watch<'_>,
) -> Result<Drivers, StudyError> {
    let found = each(logs, watch, |(name, log)| {
        Ok(if pieces {
            in_pieces(name, log, options)
        } else {
            vec![(name.clone(), identify_with_noise_model(log, options))]
        })
    })?;
    let longest = |of: &'_ Vec<(String, Identification)>| {
        let each = of.iter().enumerate();
        each.max_by_key(|(_, d)| d.1.rows).map_or(0, |(i, _)| i)
    };
    let all: Vec<&(String, Identification)> = found.iter().filter_map(|d| d.get(longest(d))).collect();
    let stands = |d: &&&(String, Identification)| d.1.refuted.is_empty();
    let pair: Vec<_> = all.iter().filter(stands).copied().collect();
    let (compared, differences, population) = match pair[..] {
        [first, second] => {
            let names = vec![first.0.clone(), second.0.clone()];
            (names, differences(&first.1, &second.1, level), Vec::new())
        }
        _ => {
            let fits: Vec<&Identification> = all.iter().map(|d| &d.1).collect();
            (Vec::new(), Vec::new(), population(&fits, level))
        }
    };
    let drivers: Vec<(String, Identification)> = found.into_iter().flatten().collect();
    Ok(Drivers {
        level,
        intervals: all_intervals(drivers.iter().map(|driver| &driver.1), level),
        compared,
        drivers,
        differences,
        population,
    })
}

/// A driver of each piece; of a drive without one, the whole of it.
fn in_pieces(name: &str, log: &DriveLog, options: &Options) -> Vec<(String, Identification)> {
    let pieces = identify_in_pieces(log, options).pieces;
    if pieces.len() < 2 {
        return vec![(name.to_owned(), identify_with_noise_model(log, options))];
    }
    let named = |p: Piece| {
        (
            format!("{name}, {:.0} to {:.0} s", p.from_s, p.to_s),
            p.identification,
        )
    };
    pieces.into_iter().map(named).collect()
}

impl IdentifiedDrive {
    /// Takes intervals of another level. What is called identified stays so: that is a matter of 95 %.
    pub fn hold_at(&mut self, level: Confidence) {
        let results = &mut self.results;
        let pieces = results.pieces.iter().flat_map(|found| &found.pieces);
        let all = std::iter::once(&results.identification).chain(pieces.map(|piece| &piece.identification));
        results.intervals = all_intervals(all, level);
        results.level = level;
    }

    /// Lets the identified driver, without remnant, drive `course` under the default guidance, or manually.
    ///
    /// # Errors
    /// As [`haptic_sim::scenario::ScenarioBuilder::build`]: the course is too short, say.
    pub fn drive_again(
        &mut self,
        course: Course,
        speed_kmh: f64,
        options: &Options,
    ) -> Result<(), StudyError> {
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
        let scenario = identified_driver(
            &base,
            &self.results.identification,
            self.results.identification.muscle(options.muscle),
        )?;
        let run = simulate(&scenario);
        let window = default_window(scenario.course());
        self.results.drives_again = Some(RunRecord::new(&scenario, &run, window, None));
        Ok(())
    }
}
