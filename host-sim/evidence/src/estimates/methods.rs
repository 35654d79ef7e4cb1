//! What each way to treat noise on the lane signals is worth: the participants' drives under more and more camera noise,
//! identified in four ways, beside the information bound.
//!
//! *None* takes the lane signals as they are. The *plain smoother* takes each as a smooth course under white noise. The
//! *default* takes the vehicle's answer to the wheel angle out of that course. *Published* is the paper's.

use haptic_analysis::identify::{Identification, Options, identify_as_published, identify_with_noise_model};
use serde::Serialize;

use super::corruption::{Corruption, POPULATION, corrupted_log};
use super::repetitions::bound_of;
use haptic_batch::StudyError;
use haptic_batch::engine::{Watch, each};
use haptic_batch::experiment::{COMPARED, ExperimentPlan, compared, driven, guided};
use haptic_batch::statistics::rms;

/// The ways.
pub const METHODS: [&str; 4] = ["none", "plain smoother", "default", "published"];

/// One way on one level of noise.
#[derive(Debug, Clone, Serialize)]
pub struct MethodLine {
    /// The noise.
    pub noise: &'static str,
    /// One of [`METHODS`].
    pub method: &'static str,
    /// Drives.
    pub drives: usize,
    /// Root mean square error of gain_1, gain_2, gain_3, t_p and K_hg.
    pub rms: [f64; COMPARED],
    /// Least RMS error of an unbiased estimator from exact lane signals.
    pub bound: [f64; COMPARED],
    /// Share of the 95 % intervals that hold the truth, of those that there are.
    pub coverage: Option<f64>,
}

/// All ways on all levels of noise.
#[derive(Debug, Clone, Serialize)]
pub struct Methods {
    /// Who drove, with which probe; its seed is that of the first drive of each participant, from which the others count on.
    #[serde(flatten)]
    pub plan: ExperimentPlan,
    /// Drives of each participant.
    pub seeds: u32,
    /// By noise and way.
    pub lines: Vec<MethodLine>,
}

/// Identifies `seeds` guided drives of each participant of `plan` in all ways.
///
/// # Errors
/// An unknown participant; a probe that the controller refuses; a drive that differs from the shipping ECU's.
pub fn methods(plan: &ExperimentPlan, seeds: u32, watch: &Watch<'_>) -> Result<Methods, StudyError> {
    let jobs = guided(plan, seeds)?;
    let noises: Vec<(&'static str, &[Corruption])> = POPULATION
        .iter()
        .filter(|(_, ways)| matches!(ways, [] | [Corruption::LaneNoise(..)]))
        .copied()
        .collect();
    let found = each(&jobs, watch, |&(number, truth, seed)| {
        let plan = plan.repetition(seed);
        let log = driven(&plan, number, &truth)?.log;
        let bound = bound_of(&log, &truth);
        let values: Vec<_> = noises
            .iter()
            .flat_map(|(_, ways)| {
                let log = corrupted_log(&log, ways, &plan, number);
                let none = Options {
                    lane_noise: false,
                    ..Options::default()
                };
                let plain = Options {
                    plain_smoother: true,
                    ..Options::default()
                };
                let ours = |o: &Options| Some(identify_with_noise_model(&log, o));
                [
                    ours(&none),
                    ours(&plain),
                    ours(&Options::default()),
                    identify_as_published(&log, &Options::default()).ok(),
                ]
            })
            .map(|f: Option<Identification>| f.map(|f| compared(&truth, &f.parameters)))
            .collect();
        Ok((bound, values))
    })?;
    let mut lines = Vec::new();
    for (n, (noise, _)) in noises.iter().enumerate() {
        for (m, method) in METHODS.iter().enumerate() {
            let place = n * METHODS.len() + m;
            let here: Vec<_> = found.iter().filter_map(|f| f.1[place].as_ref()).collect();
            let (mut held, mut all) = (0, 0);
            for (p, truth) in here.iter().flat_map(|h| h.iter().map(|c| (c.1, c.2))) {
                if let Some([low, high]) = p.interval_95 {
                    all += 1;
                    held += usize::from(low <= truth && truth <= high);
                }
            }
            lines.push(MethodLine {
                noise,
                method,
                drives: here.len(),
                rms: std::array::from_fn(|i| {
                    let errors = here.iter().filter_map(|h| Some(h[i].1.optimum? - h[i].2));
                    rms(errors).unwrap_or(0.0)
                }),
                bound: std::array::from_fn(|i| rms(found.iter().map(|f| f.0[i])).unwrap_or(0.0)),
                coverage: (all > 0).then(|| f64::from(held as u32) / f64::from(all)),
            });
        }
    }
    Ok(Methods {
        plan: plan.clone(),
        seeds,
        lines,
    })
}
