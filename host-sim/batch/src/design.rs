//! Which experiment tells a driver's parameters: probe, course and length for a given error, before anybody drives.
//!
//! The drivers asked about drive each course once with each probe, in the simulator; Fisher's information of the record,
//! at the truth, says how small the standard errors of an unbiased estimator can be. Information grows with the length of the
//! drive, which gives the length for an error. Two probes one after the other share the drive. The best design is then
//! driven and identified over and over: the error that comes of it stands beside the one that was predicted, and the share of the
//! drives in which the parameter is called identified beside the length at which 95 % do.
//!
//! Terms: a *form* of the probe is none, one sine, or one sine in the first half and another in the second.

use haptic_analysis::identify::{DriveLog, INFORMED, Information, Options, identify_together, information};
use haptic_sim::models::road::Course;
use haptic_sim::participants::{PublishedDriver, participant};
use serde::Serialize;

use crate::Away;
use crate::drivers::{Probe, compared, guided_drive, truth_of};
use crate::engine::{StudyError, Watch, each, logs, recorded, refuse};
use crate::statistics::{Confidence, halved_by_ratio, mean, rms, wilson};

/// The drives, courses and probes to choose from, and the error to reach.
#[derive(Debug, Clone)]
pub struct DesignRequest {
    /// Numbers of the participants that stand for the drivers to come.
    pub participants: Vec<u32>,
    /// Courses to choose from.
    pub courses: Vec<Course>,
    /// Frequencies of the probe, Hz.
    pub frequencies_hz: Vec<f64>,
    /// Amplitudes of the probe, N.m.
    pub amplitudes_nm: Vec<f64>,
    /// Key of the parameter that is to be known, one of [`INFORMED`] but t_nms.
    pub parameter: String,
    /// To which standard error.
    pub error: f64,
    /// Whether t_nms is taken as known.
    pub t_nms_known: bool,
    /// Drives of each participant that the best design is confirmed with; zero for none.
    pub confirmations: u32,
    /// Seed of the remnants.
    pub seed: u64,
    /// How often intervals hold.
    pub level: Confidence,
}

/// One design.
#[derive(Debug, Clone, Serialize)]
pub struct Design {
    /// Name of the course.
    pub course: String,
    /// Amplitude of the probe, N.m; zero without.
    pub amplitude_nm: f64,
    /// Its frequency, Hz, and that of the second half.
    pub frequencies_hz: Vec<f64>,
    /// Length of the drive that the errors are for: once over the course, s.
    pub span_s: f64,
    /// Least standard errors in the order of [`INFORMED`], root mean square over the participants.
    pub standard_errors: [f64; 6],
    /// How long they would have to drive for the error asked for, s; none if no drive is long enough.
    pub needed_s: Option<f64>,
    /// Drives in which the ECU ended guidance by itself: from then on they tell what a drive without guidance does.
    pub left_by_itself: usize,
    /// Its probes, of which each has an equal part of the drive.
    #[serde(skip)]
    probes: Vec<Option<Probe>>,
}

/// The best design, tried.
#[derive(Debug, Clone, Serialize)]
pub struct Confirmation {
    /// Fits.
    pub fits: usize,
    /// Length of each record, s.
    pub length_s: f64,
    /// What the information promises for it.
    pub predicted: f64,
    /// Root mean square error.
    pub rms: f64,
    /// Share of the intervals that hold the truth.
    pub coverage: f64,
    /// Fits that call the parameter identified.
    pub identified: usize,
    /// Wilson's interval of the share of drives that do.
    pub identified_share: [f64; 2],
}

/// Every design with its errors, and the best one.
#[derive(Debug, Clone, Serialize)]
pub struct DesignResult {
    /// Key of the parameter.
    pub parameter: String,
    /// Error asked for.
    pub error: f64,
    /// Every design, by course, amplitude and frequency.
    pub designs: Vec<Design>,
    /// Place of the best one in `designs`; none if none will do.
    pub best: Option<usize>,
    /// What driving it gave.
    pub confirmation: Option<Confirmation>,
    /// The shortest length tried at which the parameter is identified in 95 % of the fits; none if none up to half an hour is.
    pub for_most: Option<Confirmation>,
    /// How often intervals hold.
    #[serde(skip_serializing_if = "Confidence::is_usual")]
    pub level: Confidence,
}

/// Longest drive that is worth proposing, s: two hours.
const LONGEST_S: f64 = 7200.0;
/// Shortest record that an identification takes, s, with some room.
const SHORTEST_S: f64 = 20.0;
/// Share of the drives that are to name a value, and the longest drive that is tried for it, s.
const MOST: f64 = 0.95;
const LONGEST_TRIED_S: f64 = 1800.0;
/// Factor from one length that is tried to the next.
const PACE: f64 = 1.5;

/// A participant's information on one course with one probe.
struct Cell {
    course: usize,
    probe: Option<Probe>,
    information: Information,
    left_by_itself: bool,
}

/// What the drives of each course, probe and driver tell.
fn cells(
    request: &DesignRequest,
    drivers: &[(u32, PublishedDriver)],
    probes: &[Option<Probe>],
    watch: &Watch<'_>,
) -> Result<Vec<Cell>, StudyError> {
    let mut jobs = Vec::new();
    for course in 0..request.courses.len() {
        for &probe in probes {
            for &(number, driver) in drivers {
                jobs.push((course, probe, number, driver));
            }
        }
    }
    logs(
        &jobs,
        request.seed,
        watch,
        |&(course, probe, number, driver)| {
            let seed = request.seed.wrapping_mul(1000).wrapping_add(u64::from(number));
            guided_drive(&driver, Some(&request.courses[course]), probe, seed)
        },
        |&(course, probe, _, driver), scenario, run, log| {
            Ok(Cell {
                course,
                probe,
                information: information(&log, &Options::default(), &truth_of(&driver)),
                left_by_itself: Away::new(scenario, &run.trace).is_by_itself(),
            })
        },
    )
}

/// Computes the designs of `request`.
///
/// # Errors
/// An unknown participant or parameter; a course that cannot be driven.
pub fn design(request: &DesignRequest, watch: &Watch<'_>) -> Result<DesignResult, StudyError> {
    let Some(place) = INFORMED[..5].iter().position(|&n| n == request.parameter) else {
        return refuse(format!(
            "parameter {:?} is unknown, one of {} is wanted",
            request.parameter,
            INFORMED[..5].join(", ")
        ));
    };
    let drivers = drivers(&request.participants)?;
    let probes = probes(request);
    let cells = cells(request, &drivers, &probes, watch)?;
    let forms = forms(request, &probes);
    let mut designs = Vec::new();
    for (course, road) in request.courses.iter().enumerate() {
        let here: Vec<&Cell> = cells.iter().filter(|c| c.course == course).collect();
        designs.extend(
            forms
                .iter()
                .map(|form| Design::new(request, place, road, form, &here)),
        );
    }
    let length = |d: &Design| d.needed_s.unwrap_or(f64::INFINITY);
    let best = (0..designs.len())
        .filter(|&i| length(&designs[i]) <= LONGEST_S)
        .min_by(|&a, &b| length(&designs[a]).total_cmp(&length(&designs[b])));
    let (mut confirmation, mut most) = (None, None);
    if let Some(best) = best.filter(|_| request.confirmations > 0) {
        let best = &designs[best];
        let length_s = best.needed_s.unwrap_or(best.span_s).max(SHORTEST_S);
        let tried = |length_s| confirm(request, place, (best, length_s), &drivers, watch);
        let first = tried(length_s)?;
        most = for_most(&first, tried)?;
        confirmation = Some(first);
    }
    Ok(DesignResult {
        parameter: request.parameter.clone(),
        error: request.error,
        designs,
        best,
        confirmation,
        for_most: most,
        level: request.level,
    })
}

/// The shortest of the lengths tried, from the first one down or up, that names a value in most drives.
fn for_most(
    first: &Confirmation,
    tried: impl Fn(f64) -> Result<Confirmation, StudyError>,
) -> Result<Option<Confirmation>, StudyError> {
    let does = |c: &Confirmation| c.identified as f64 >= MOST * c.fits as f64;
    let mut found = does(first).then(|| first.clone());
    let up = found.is_none();
    let mut length_s = first.length_s;
    loop {
        length_s = if up { length_s * PACE } else { length_s / PACE };
        if !(SHORTEST_S..=LONGEST_TRIED_S).contains(&length_s) {
            return Ok(found);
        }
        let next = tried(length_s)?;
        match (does(&next), up) {
            (true, true) => return Ok(Some(next)),
            (true, false) => found = Some(next),
            (false, true) => {}
            (false, false) => return Ok(found),
        }
    }
}

fn drivers(numbers: &[u32]) -> Result<Vec<(u32, PublishedDriver)>, StudyError> {
    let guided = |&number| Ok((number, participant("participant", number)?.guided));
    numbers.iter().map(guided).collect()
}

/// No probe, and all that the controller accepts.
fn probes(request: &DesignRequest) -> Vec<Option<Probe>> {
    let mut out = vec![None];
    for &amplitude_nm in &request.amplitudes_nm {
        for &frequency_hz in &request.frequencies_hz {
            let probe = Probe {
                amplitude_nm,
                frequency_hz,
            };
            if probe.is_accepted() {
                out.push(Some(probe));
            }
        }
    }
    out
}

/// Each probe alone, then of each amplitude the slowest and the fastest, which share the drive.
fn forms(request: &DesignRequest, probes: &[Option<Probe>]) -> Vec<Vec<Option<Probe>>> {
    let mut forms: Vec<Vec<Option<Probe>>> = probes.iter().map(|probe| vec![*probe]).collect();
    for amplitude_nm in &request.amplitudes_nm {
        let mut same = probes
            .iter()
            .filter(|probe| probe.is_some_and(|p| p.amplitude_nm == *amplitude_nm));
        if let (Some(slow), Some(fast)) = (same.next(), same.next_back())
            && slow != fast
        {
            forms.push(vec![*slow, *fast]);
        }
    }
    forms
}

impl Design {
    /// A form on a course, of what the drives there tell.
    fn new(
        request: &DesignRequest,
        place: usize,
        course: &Course,
        form: &[Option<Probe>],
        here: &[&Cell],
    ) -> Self {
        // Each driver drives each part of the form.
        let parts: Vec<Vec<&Cell>> = form
            .iter()
            .map(|probe| here.iter().copied().filter(|c| c.probe == *probe).collect())
            .collect();
        let share = 1.0 / form.len() as f64;
        let of_driver = |driver: usize| {
            let parts = parts.iter().map(|part| &part[driver].information);
            let parts = parts.map(|part| part.lasting(share * part.span_s));
            parts.reduce(|before, part| before.and(&part))
        };
        let all: Vec<Information> = (0..parts[0].len()).filter_map(of_driver).collect();
        let errors: Vec<[f64; 6]> = all
            .iter()
            .map(|i| i.standard_errors(request.t_nms_known))
            .collect();
        Self {
            course: course.name().into(),
            amplitude_nm: form[0].map_or(0.0, |p| p.amplitude_nm),
            frequencies_hz: form.iter().flatten().map(|p| p.frequency_hz).collect(),
            span_s: mean(all.iter().map(|i| i.span_s)).unwrap_or(f64::NAN),
            standard_errors: std::array::from_fn(|i| rms(errors.iter().map(|e| e[i])).unwrap_or(f64::NAN)),
            needed_s: needed(request, place, &all),
            left_by_itself: parts.iter().flatten().filter(|c| c.left_by_itself).count(),
            probes: form.to_vec(),
        }
    }
}

/// The length at which the root mean square of the errors is the one asked for, by bisection: what is known of t_nms
/// beforehand does not grow with the drive.
fn needed(request: &DesignRequest, place: usize, all: &[Information]) -> Option<f64> {
    let error = |span_s: f64| {
        let lasting = all.iter().map(|i| i.lasting(span_s));
        let errors = lasting.map(|i| i.standard_errors(request.t_nms_known)[place]);
        rms(errors).unwrap_or(f64::NAN)
    };
    let ends = [1.0, 1e6];
    if error(ends[1]).is_nan() || error(ends[1]) > request.error {
        return None;
    }
    let [_, high] = halved_by_ratio(ends, 60, |span_s| error(span_s) > request.error);
    Some(high)
}

/// Drives the design for so long, s, and identifies.
fn confirm(
    request: &DesignRequest,
    place: usize,
    (design, length_s): (&Design, f64),
    drivers: &[(u32, PublishedDriver)],
    watch: &Watch<'_>,
) -> Result<Confirmation, StudyError> {
    let course = request.courses.iter().find(|c| c.name() == design.course);
    let jobs: Vec<(u32, PublishedDriver, u64)> = drivers
        .iter()
        .flat_map(|&(number, driver)| (0..u64::from(request.confirmations)).map(move |r| (number, driver, r)))
        .collect();
    let options = Options {
        t_nms_known: request.t_nms_known,
        ..Options::default()
    };
    let found = each(&jobs, watch, |&(number, driver, repetition)| {
        let mut logs = Vec::new();
        let each_s = length_s / design.probes.len() as f64;
        let mut predicted: Option<Information> = None;
        for (half, &probe) in design.probes.iter().enumerate() {
            let mut left_s = each_s;
            let mut turn = 0;
            while left_s > 0.0 && turn < 100 {
                let seed = 1_000_000
                    + request.seed.wrapping_mul(10_000)
                    + u64::from(number) * 101
                    + repetition * 7919
                    + (half as u64) * 131
                    + turn * 17;
                let (_, log) = recorded(&guided_drive(&driver, course, probe, seed)?);
                let log = first(log, left_s);
                left_s -= log.len() as f64 * log.dt_s;
                turn += 1;
                let here = information(&log, &Options::default(), &truth_of(&driver));
                predicted = Some(predicted.map_or_else(|| here.clone(), |p| p.and(&here)));
                logs.push(log);
                if left_s < SHORTEST_S {
                    break;
                }
            }
        }
        let fit = identify_together(&logs, &options)?;
        let all = compared(&driver, &fit.parameters);
        let Some((_, p, truth)) = all.into_iter().find(|(key, ..)| *key == request.parameter) else {
            unreachable!("each parameter of a design is compared")
        };
        let promised = predicted.map_or(f64::NAN, |p| p.standard_errors(request.t_nms_known)[place]);
        let off = p.optimum.map_or(f64::NAN, |x| x - truth);
        let held = p
            .interval(request.level.normal())
            .is_none_or(|[low, high]| low <= truth && truth <= high);
        Ok((off, held, promised, p.identified))
    })?;
    let count = found.len() as f64;
    let identified = found.iter().filter(|x| x.3).count();
    Ok(Confirmation {
        fits: found.len(),
        length_s,
        predicted: rms(found.iter().map(|x| x.2)).unwrap_or(f64::NAN),
        rms: rms(found.iter().map(|x| x.0)).unwrap_or(f64::NAN),
        coverage: found.iter().filter(|x| x.1).count() as f64 / count,
        identified,
        identified_share: wilson(identified as f64 / count, count, request.level),
    })
}

/// The beginning of a log.
fn first(mut log: DriveLog, span_s: f64) -> DriveLog {
    let rows = (span_s / log.dt_s).ceil() as usize;
    for signal in [
        &mut log.e_y_m,
        &mut log.e_theta_rad,
        &mut log.wheel_angle_rad,
        &mut log.guidance_torque_nm,
        &mut log.driver_torque_nm,
    ] {
        signal.truncate(rows);
    }
    log
}
