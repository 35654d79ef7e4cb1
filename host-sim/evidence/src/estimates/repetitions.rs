//! Are the standard errors right? The guided drives many times over, each with another remnant.
//!
//! Terms: *coverage*, the share of repetitions whose 95 % interval contains the truth; *error*, estimate minus
//! truth, over the repetitions in which the parameter is identified.

use serde::Serialize;

use haptic_analysis::identify::{DriveLog, Identification, Options, identify_with_noise_model, information};
use haptic_batch::StudyError;
use haptic_batch::engine::{Watch, logs};
use haptic_batch::experiment::{
    COMPARED, Compared, ExperimentPlan, compared, guided, scenario_of_drive, truth_of,
};
use haptic_batch::statistics::{mean, rms};
use haptic_sim::participants::PublishedDriver;

/// What the repetitions found.
#[derive(Debug, Clone, Serialize)]
pub struct Repetitions {
    /// Amplitude of the probe, N.m.
    pub probe_nm: f64,
    /// Seed of the first repetition; the others count on from it.
    pub seed: u64,
    /// Drives of each participant.
    pub repetitions: u32,
    /// By participant and parameter.
    pub participants: Vec<Repeated>,
    /// All participants together, by parameter.
    pub pooled: Vec<Repeated>,
}

/// One parameter over the repetitions.
#[derive(Debug, Clone, Serialize)]
pub struct Repeated {
    /// Number of the participant; none for all together.
    pub participant: Option<u32>,
    /// Key of the parameter.
    pub parameter: &'static str,
    /// Drives.
    pub drives: usize,
    /// Share of drives in which the parameter was identified.
    pub identified: f64,
    /// Coverage of the 95 % interval.
    pub coverage: f64,
    /// Coverage of the narrower interval that is given for t_nms as assumed, which it is in these drives.
    pub coverage_at_t_nms: f64,
    /// Mean error; none if never identified.
    pub bias: Option<f64>,
    /// Standard deviation of the error about zero; none if never identified.
    pub rms: Option<f64>,
    /// Largest error in size; none if never identified.
    pub largest: Option<f64>,
    /// Mean of the standard errors that the method gives; none where it gave none.
    pub standard_error: Option<f64>,
    /// Least RMS error of an unbiased estimator: the information bound of these drives.
    pub bound: f64,
}

/// Repeats the guided drives of `plan` and identifies each by the default method.
///
/// # Errors
/// An unknown participant; a probe that the controller refuses; a drive that differs from the shipping ECU's.
pub fn repeat(plan: &ExperimentPlan, repetitions: u32, watch: &Watch<'_>) -> Result<Repetitions, StudyError> {
    let jobs = guided(plan, repetitions)?;
    let found: Vec<DriveResult> = logs(
        &jobs,
        plan.seed,
        watch,
        |(number, truth, repetition)| {
            let plan = plan.repetition(*repetition);
            scenario_of_drive(&plan, *number, truth, truth.parameters())
        },
        |(_, truth, _), _, _, log| {
            let identification = identify_with_noise_model(&log, &Options::default());
            Ok(DriveResult::new(truth, &identification, bound_of(&log, truth)))
        },
    )?;
    let lines = |participant: Option<u32>, drives: &[DriveResult]| {
        (0..COMPARED)
            .filter(|_| !drives.is_empty())
            .map(|i| Repeated::new(participant, i, drives))
            .collect::<Vec<_>>()
    };
    let each = plan
        .participants
        .iter()
        .zip(found.chunks(repetitions.max(1) as usize));
    Ok(Repetitions {
        probe_nm: plan.probe_nm,
        seed: plan.seed,
        repetitions,
        participants: each
            .flat_map(|(&number, drives)| lines(Some(number), drives))
            .collect(),
        pooled: lines(None, &found),
    })
}

/// What was made of one drive.
struct DriveResult {
    values: [Compared; COMPARED],
    bound: [f64; COMPARED],
    held_at_t_nms: [bool; COMPARED],
}

impl DriveResult {
    fn new(truth: &PublishedDriver, found: &Identification, bound: [f64; COMPARED]) -> Self {
        let values = compared(truth, &found.parameters);
        let held = |(name, p, truth): Compared| {
            let narrow = found.at_t_nms.as_ref().and_then(|at| {
                let of = at.intervals_95.iter().find(|(n, _)| *n == name);
                of.map(|(_, interval)| *interval)
            });
            let interval = narrow.filter(|_| p.interval_95.is_some()).or(p.interval_95);
            interval.is_none_or(|[low, high]| low <= truth && truth <= high)
        };
        Self {
            values,
            bound,
            held_at_t_nms: values.map(held),
        }
    }
}

/// The information bound of a guided drive: gain_1, gain_2, gain_3, t_p and K_hg, with t_nms known.
pub(super) fn bound_of(log: &DriveLog, truth: &PublishedDriver) -> [f64; COMPARED] {
    let least = information(log, &Options::default(), &truth_of(truth));
    // The bound has K_hg before t_p, and t_nms last; what is compared has t_p before K_hg.
    let [gain_1, gain_2, gain_3, k_hg, t_p, _] = least.standard_errors(true);
    [gain_1, gain_2, gain_3, t_p, k_hg]
}

impl Repeated {
    /// What at least one drive shows.
    fn new(participant: Option<u32>, i: usize, judged: &[DriveResult]) -> Self {
        let drives: Vec<Compared> = judged.iter().map(|j| j.values[i]).collect();
        let at_t_nms = judged.iter().filter(|j| j.held_at_t_nms[i]).count();
        let errors = || {
            drives
                .iter()
                .filter_map(|(_, found, truth)| Some(found.estimate? - truth))
        };
        let covered = drives.iter().filter(|(_, found, truth)| {
            // An interval that the data do not bound holds everything.
            found
                .interval_95
                .is_none_or(|[low, high]| low <= *truth && *truth <= high)
        });
        let share = |count: usize| count as f64 / drives.len() as f64;
        Self {
            participant,
            parameter: drives[0].0,
            drives: drives.len(),
            identified: share(drives.iter().filter(|d| d.1.identified).count()),
            coverage: share(covered.count()),
            bias: mean(errors()),
            rms: rms(errors()),
            largest: errors().map(f64::abs).reduce(f64::max),
            standard_error: mean(drives.iter().filter_map(|d| d.1.standard_error)),
            bound: rms(judged.iter().map(|j| j.bound[i])).unwrap_or(f64::NAN),
            coverage_at_t_nms: share(at_t_nms),
        }
    }
}
