//! How well the ECU reads the driver's reliance from its probe, against the truth of the driver model.
//!
//! Each guided participant of table 6 drives the course over the bus with a remnant, in two ways:
//!
//! - *steady*: always the same driver. The probe is on for 44 s and off for one, so that a drive has four
//!   *sessions*, on the straight and in the curves; the ECU starts anew with each.
//! - *changing*: the probe stays on, and the driver takes over another participant's K_d and K_hg in
//!   mid-drive.
//!
//! Terms: *after 10 s*, 10 s after the start of a session; *deviation*, the standard deviation that the ECU
//! itself reports; *coverage*, the share of truths within 1.96 deviations of the estimate.
//!
//! Not here: the estimator (`haptic_core::estimator`), options and tables (the command line).

use serde::Serialize;

pub use haptic_batch::readings::{Reading, Readings};

use haptic_batch::engine::{Watch, each};
use haptic_batch::{StudyError, refuse};
use haptic_sim::guidance::OverBus;
use haptic_sim::models::STEP_S;
use haptic_sim::models::driver::DriverParameters;
use haptic_sim::participants::{Participant, participant, participants};
use haptic_sim::scenario::{DriverChange, GuidanceParameters, Scenario};
use haptic_sim::simulation::Ending;
use haptic_sim::{Action, Simulation};

/// Remnant of every driver: standard deviation, N.m, and corner, Hz.
pub const REMNANT: (f64, f64) = (0.1, 0.5);
/// Times after the start of a session at which the estimate is held against the truth, s.
pub const TIMES_S: [f64; 3] = [10.0, 30.0, 40.0];
/// A session, with the second of pause that ends it, s.
const SESSION_S: f64 = 45.0;
const PAUSE_S: f64 = 1.0;
/// Sessions of a drive of 186 s.
const SESSIONS: usize = 4;
/// How long after a change the estimate must be near the new truth, s, and how near.
pub const SETTLING_S: f64 = 15.0;
/// See [`SETTLING_S`].
pub const NEAR: f64 = 0.15;

/// What to do.
#[derive(Debug, Clone, PartialEq)]
pub struct ReliancePlan {
    /// Numbers of the participants, 1 to 14.
    pub participants: Vec<u32>,
    /// Drives of each participant, each with a seed of its own.
    pub seeds: u32,
    /// Amplitude of the probe, N.m.
    pub amplitude_nm: f64,
    /// Frequency of the probe, Hz.
    pub frequency_hz: f64,
    /// The drivers' t_nms, s: the ECU assumes what its parameters say.
    pub t_nms_s: f64,
}

/// Estimates at one time of a session against the truth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Accuracy {
    /// Time after the start of the session, s.
    pub after_s: f64,
    /// How many estimates there are.
    pub count: usize,
    /// Mean error.
    pub bias: f64,
    /// Root of the mean squared error.
    pub rms: f64,
    /// Mean of the deviations reported.
    pub deviation: f64,
    /// Share of truths within 1.96 deviations.
    pub coverage: f64,
    /// Share of truths within one deviation.
    pub within_one: f64,
}

/// One participant's line.
#[derive(Debug, Clone, Serialize)]
pub struct ParticipantResult {
    /// Number.
    pub participant: u32,
    /// True K_hg.
    pub truth: f64,
    /// Mean of the estimates after 30 s.
    pub estimate: f64,
    /// Against the truth, at each of [`TIMES_S`].
    pub accuracy: Vec<Accuracy>,
}

/// After a change of the driver.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Settling {
    /// Changes.
    pub count: usize,
    /// Share of estimates within [`NEAR`] of the new truth after [`SETTLING_S`].
    pub near: f64,
    /// Share of estimates within [`NEAR`] after changes by more than 0.3.
    pub near_after_large: f64,
    /// Root of the mean squared error then.
    pub rms: f64,
}

/// What came of it.
#[derive(Debug, Clone, Serialize)]
pub struct RelianceResults {
    /// Amplitude of the probe, N.m.
    pub amplitude_nm: f64,
    /// Its frequency, Hz.
    pub frequency_hz: f64,
    /// Drives of each participant.
    pub seeds: u32,
    /// Each participant.
    pub participants: Vec<ParticipantResult>,
    /// All of them pooled, at each of [`TIMES_S`].
    pub pooled: Vec<Accuracy>,
    /// After changes.
    pub settling: Settling,
    /// Steps in which a limit held guidance and probe back, and all steps of all drives.
    pub limited_steps: [u64; 2],
    /// Runs that diverged and are not counted.
    pub diverged: u32,
    /// Runs in which the ECU ended guidance by itself; what it read until then counts.
    pub left_by_itself: u32,
    /// Examples, for the figure.
    #[serde(skip)]
    pub examples: Vec<Example>,
}

/// A changing drive to look at.
#[derive(Debug, Clone)]
pub struct Example {
    /// The participant at the start.
    pub participant: u32,
    /// Time of the change, s, true K_hg before and after it.
    pub truth: (f64, [f64; 2]),
    /// What the ECU reported.
    pub readings: Vec<Reading>,
}

/// An estimate with its deviation and the truth.
type EstimateAndTruth = ([f64; 2], f64);

/// A drive's contribution.
#[derive(Default)]
struct Drive {
    /// Estimates of a steady drive at each of [`TIMES_S`].
    steady: [Vec<EstimateAndTruth>; TIMES_S.len()],
    /// Estimate of a changing drive, and by how much the truth changed.
    changed: Option<(EstimateAndTruth, f64)>,
    limited_steps: [u64; 2],
    diverged: u32,
    left_by_itself: u32,
    example: Option<Example>,
}

/// Drives and evaluates: a pair of drives for each participant and seed.
///
/// # Errors
/// A participant or a parameter of the probe that is out of range.
pub fn study(plan: &ReliancePlan, watch: &Watch<'_>) -> Result<RelianceResults, StudyError> {
    let all = participants();
    let chosen: Vec<usize> = plan
        .participants
        .iter()
        .map(|&number| participant("participant", number).map(|found| found.number as usize - 1))
        .collect::<Result<_, _>>()?;
    if chosen.is_empty() || plan.seeds == 0 {
        return refuse("participants and seeds: at least one of each is needed");
    }
    scenario(plan, &all[chosen[0]], 0)?;
    let jobs: Vec<(usize, u32)> = chosen
        .iter()
        .flat_map(|&place| (0..plan.seeds).map(move |seed| (place, seed)))
        .collect();
    let drives = each(&jobs, watch, |&(place, seed)| {
        both_drives(plan, &all, place, seed)
    })?;
    let accuracy = |drives: &[Drive]| -> Vec<Accuracy> {
        let at = |(i, &after_s): (usize, &f64)| {
            let points: Vec<EstimateAndTruth> =
                drives.iter().flat_map(|d| d.steady[i].iter().copied()).collect();
            Accuracy::new(after_s, &points)
        };
        TIMES_S.iter().enumerate().filter_map(at).collect()
    };
    let lines = chosen.iter().zip(drives.chunks(plan.seeds as usize));
    let lines = lines.map(|(&place, drives)| {
        let truth = all[place].guided.gains().k_hg;
        let accuracy = accuracy(drives);
        ParticipantResult {
            participant: all[place].number,
            truth,
            estimate: truth
                + accuracy
                    .iter()
                    .find(|a| a.after_s == 30.0)
                    .map_or(f64::NAN, |a| a.bias),
            accuracy,
        }
    });
    Ok(RelianceResults {
        amplitude_nm: plan.amplitude_nm,
        frequency_hz: plan.frequency_hz,
        seeds: plan.seeds,
        participants: lines.collect(),
        pooled: accuracy(&drives),
        settling: Settling::new(&drives),
        limited_steps: drives.iter().fold([0; 2], |[a, b], d| {
            [a + d.limited_steps[0], b + d.limited_steps[1]]
        }),
        diverged: drives.iter().map(|d| d.diverged).sum(),
        left_by_itself: drives.iter().map(|d| d.left_by_itself).sum(),
        examples: drives.iter().filter_map(|d| d.example.clone()).collect(),
    })
}

/// One steady and one changing drive of a participant.
fn both_drives(
    plan: &ReliancePlan,
    all: &[Participant],
    place: usize,
    seed: u32,
) -> Result<Drive, StudyError> {
    let mut result = Drive::default();
    let truth = all[place].guided.gains();
    let steady = scenario(plan, &all[place], seed)?;
    let readings = run(&steady, SESSION_S, &mut result);
    if result.diverged == 0 {
        for (i, after_s) in TIMES_S.iter().enumerate() {
            for session in 0..SESSIONS {
                let time_s = session as f64 * SESSION_S + after_s;
                let estimate = readings.at(time_s).and_then(|r| r.estimate);
                result.steady[i].extend(estimate.map(|estimate| (estimate, truth.k_hg)));
            }
        }
    }

    // Every other participant in turn, and the change on the straight, in the curves and between them.
    let count = all.len();
    let other = all[(place + 1 + (seed as usize * 3) % (count - 1)) % count]
        .guided
        .gains();
    // 37 shares no divisor with 100, so a hundred seeds change at every second of the range.
    let time_s = 40.0 + f64::from(seed * 37 % 100);
    // Noise that no steady drive of fewer than a thousand seeds has.
    let changing = scenario(plan, &all[place], seed + 1000)?
        .to_builder()
        .driver_change(Some(DriverChange {
            time_s,
            k_d: other.k_d,
            k_hg: other.k_hg,
        }))
        .build()?;
    let diverged = result.diverged;
    let readings = run(&changing, f64::INFINITY, &mut result);
    if result.diverged == diverged {
        let estimate = readings.at(time_s + SETTLING_S).and_then(|r| r.estimate);
        let change = other.k_hg - truth.k_hg;
        result.changed = estimate.map(|estimate| ((estimate, other.k_hg), change));
        result.example = (seed == 0).then(|| Example {
            participant: all[place].number,
            truth: (time_s, [truth.k_hg, other.k_hg]),
            readings: readings.readings,
        });
    }
    Ok(result)
}

/// Drives a scenario over the bus, the probe asked for in sessions of a length, and counts what was limited.
fn run(scenario: &Scenario, session_s: f64, result: &mut Drive) -> Readings {
    let mut simulation = Simulation::with(scenario, OverBus::new(scenario.setup()));
    let (mut readings, mut left) = (Readings::default(), false);
    loop {
        let into_s = f64::from(simulation.steps()) * STEP_S % session_s;
        let action = Action {
            probe: Some(into_s < session_s - PAUSE_S),
            ..Action::default()
        };
        let Some(outcome) = simulation.step(&action) else {
            break;
        };
        readings.observe(&outcome);
        left |= outcome.unguided.is_some_and(|why| !why.is_asked_for());
    }
    result.left_by_itself += u32::from(left);
    result.limited_steps[0] += u64::from(readings.limited_steps);
    result.limited_steps[1] += u64::from(simulation.steps());
    result.diverged += u32::from(simulation.ending() != Some(Ending::CourseEnd));
    readings
}

fn scenario(plan: &ReliancePlan, participant: &Participant, seed: u32) -> Result<Scenario, StudyError> {
    let driver = participant.guided;
    let mut guidance = GuidanceParameters::default();
    guidance.controller.probe_amplitude_nm = plan.amplitude_nm;
    guidance.controller.probe_frequency_hz = plan.frequency_hz;
    let scenario = Scenario::builder()
        .gains(driver.gains())
        .driver(DriverParameters {
            remnant_sd_nm: REMNANT.0,
            remnant_corner_hz: REMNANT.1,
            t_nms: plan.t_nms_s,
            ..driver.parameters()
        })
        .guidance(guidance)
        .seed(u64::from(participant.number) * 10_000 + u64::from(seed));
    Ok(scenario.build()?)
}

impl Accuracy {
    /// None without any estimate.
    fn new(after_s: f64, points: &[EstimateAndTruth]) -> Option<Self> {
        let count = points.len();
        let mean = |f: &dyn Fn(&EstimateAndTruth) -> f64| points.iter().map(f).sum::<f64>() / count as f64;
        let within = |deviations: f64| {
            mean(&|([estimate, deviation], truth)| {
                f64::from(u8::from((estimate - truth).abs() <= deviations * deviation))
            })
        };
        (count > 0).then(|| Self {
            after_s,
            count,
            bias: mean(&|([estimate, _], truth)| estimate - truth),
            rms: mean(&|([estimate, _], truth)| (estimate - truth).powi(2)).sqrt(),
            deviation: mean(&|([_, deviation], _)| *deviation),
            coverage: within(1.96),
            within_one: within(1.0),
        })
    }
}

impl Settling {
    fn new(drives: &[Drive]) -> Self {
        let changes: Vec<_> = drives.iter().filter_map(|d| d.changed).collect();
        let error = |(([estimate, _], truth), _): &(EstimateAndTruth, f64)| (estimate - truth).abs();
        let near = |large: bool| {
            let of = changes.iter().filter(|c| !large || c.1.abs() > 0.3);
            let all = of.clone().count();
            let near = of.filter(|c| error(c) <= NEAR).count();
            near as f64 / all.max(1) as f64
        };
        let squares: f64 = changes.iter().map(|c| error(c).powi(2)).sum();
        Self {
            count: changes.len(),
            near: near(false),
            near_after_large: near(true),
            rms: (squares / changes.len().max(1) as f64).sqrt(),
        }
    }
}
