//! Which experiment tells a driver's parameters: probe, course and length for a given error, before anybody drives.
//!
//! The drivers asked about drive each course once with each probe, in the simulator; Fisher's information of the record,
//! at the truth, says how small the standard errors of an unbiased estimator can be. Information grows with the length of the
//! drive, which gives the length for an error. Two probes one after the other share the drive. The best design is then
//! driven and identified over and over, and the error that comes of it stands beside the one that was predicted.
//!
//! Terms: a *form* of the probe is none, one sine, or one sine in the first half and another in the second.

use haptic_analysis::identify::{DriveLog, INFORMED, Information, Options, identify_together, information};
use haptic_sim::models::road::Course;
use haptic_sim::participants::{PublishedDriver, participant};
use rayon::prelude::*;
use serde::Serialize;

use crate::error::{StudyError, refuse};
use crate::experiment::{Probe, guided_drive, log_each, recorded, truth_of};

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
    /// Share of the 95 % intervals that hold the truth.
    pub coverage: f64,
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
}

/// Longest drive that is worth proposing, s: two hours.
const LONGEST_S: f64 = 7200.0;
/// Shortest record that an identification takes, s, with some room.
const SHORTEST_S: f64 = 20.0;

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
    done: impl Fn() + Sync,
) -> Result<Vec<Cell>, StudyError> {
    let mut jobs = Vec::new();
    for course in 0..request.courses.len() {
        for &probe in probes {
            for &(number, driver) in drivers {
                jobs.push((course, probe, number, driver));
            }
        }
    }
    log_each(
        &jobs,
        request.seed,
        |&(course, probe, number, driver)| {
            let seed = request.seed.wrapping_mul(1000).wrapping_add(u64::from(number));
            guided_drive(&driver, Some(&request.courses[course]), probe, seed)
        },
        |driven, &(course, probe, _, driver)| {
            done();
            Cell {
                course,
                probe,
                information: information(&driven.log, &Options::default(), &truth_of(&driver)),
                left_by_itself: driven.away.is_by_itself(),
            }
        },
    )
}

/// Computes the designs of `request`; `done` is called after each drive.
///
/// # Errors
/// An unknown participant or parameter; a course that cannot be driven.
pub fn design(request: &DesignRequest, done: impl Fn() + Sync) -> Result<DesignResult, StudyError> {
    let Some(place) = INFORMED[..5].iter().position(|&n| n == request.parameter) else {
        return refuse(format!(
            "parameter {:?} is unknown, one of {} is wanted",
            request.parameter,
            INFORMED[..5].join(", ")
        ));
    };
    let drivers = drivers(&request.participants)?;
    let probes = probes(request);
    let cells = cells(request, &drivers, &probes, &done)?;
    let mut designs = Vec::new();
    for (course, road) in request.courses.iter().enumerate() {
        let of = |probe: Option<Probe>| -> Vec<&Information> {
            let here = cells.iter().filter(|c| c.course == course && c.probe == probe);
            here.map(|c| &c.information).collect()
        };
        let left = |probes: &[Option<Probe>]| {
            let here = cells
                .iter()
                .filter(|c| c.course == course && probes.contains(&c.probe));
            here.filter(|c| c.left_by_itself).count()
        };
        for &probe in &probes {
            let all: Vec<Information> = of(probe).into_iter().cloned().collect();
            let frequencies = probe.map(|p| p.frequency_hz).into_iter().collect();
            designs.push(Design {
                left_by_itself: left(&[probe]),
                ..Design::new(request, place, road, probe, frequencies, &all)
            });
        }
        // The slowest and the fastest of each amplitude, half the drive each.
        for &amplitude_nm in &request.amplitudes_nm {
            let same: Vec<Probe> = probes
                .iter()
                .flatten()
                .filter(|p| p.amplitude_nm == amplitude_nm)
                .copied()
                .collect();
            let (Some(&slow), Some(&fast)) = (same.first(), same.last()) else {
                continue;
            };
            if slow == fast {
                continue;
            }
            let halves = of(Some(slow)).into_iter().zip(of(Some(fast)));
            let all: Vec<Information> = halves
                .map(|(a, b)| a.lasting(0.5 * a.span_s).and(&b.lasting(0.5 * b.span_s)))
                .collect();
            let frequencies = vec![slow.frequency_hz, fast.frequency_hz];
            designs.push(Design {
                left_by_itself: left(&[Some(slow), Some(fast)]),
                ..Design::new(request, place, road, Some(slow), frequencies, &all)
            });
        }
    }
    let length = |d: &Design| d.needed_s.unwrap_or(f64::INFINITY);
    let best = (0..designs.len())
        .filter(|&i| length(&designs[i]) <= LONGEST_S)
        .min_by(|&a, &b| length(&designs[a]).total_cmp(&length(&designs[b])));
    let confirmation = match best {
        Some(best) if request.confirmations > 0 => {
            Some(confirm(request, place, &designs[best], &drivers, &done)?)
        }
        _ => None,
    };
    Ok(DesignResult {
        parameter: request.parameter.clone(),
        error: request.error,
        designs,
        best,
        confirmation,
    })
}

/// Drives that `design` will call back for.
pub fn drives(request: &DesignRequest) -> u64 {
    let each = request.courses.len() * probes(request).len() * request.participants.len();
    each as u64
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

impl Design {
    fn new(
        request: &DesignRequest,
        place: usize,
        course: &Course,
        probe: Option<Probe>,
        frequencies_hz: Vec<f64>,
        all: &[Information],
    ) -> Self {
        let errors: Vec<[f64; 6]> = all
            .iter()
            .map(|i| i.standard_errors(request.t_nms_known))
            .collect();
        let rms = |i: usize| (errors.iter().map(|e| e[i] * e[i]).sum::<f64>() / errors.len() as f64).sqrt();
        let span_s = all.iter().map(|i| i.span_s).sum::<f64>() / all.len() as f64;
        Self {
            course: course.name().into(),
            amplitude_nm: probe.map_or(0.0, |p| p.amplitude_nm),
            frequencies_hz,
            span_s,
            standard_errors: std::array::from_fn(rms),
            needed_s: needed(request, place, all),
            left_by_itself: 0,
        }
    }

    /// The standard errors of a drive of another length, over the participants' information.
    fn probes(&self) -> Vec<Option<Probe>> {
        if self.frequencies_hz.is_empty() {
            return vec![None];
        }
        let of = |&frequency_hz: &f64| {
            Some(Probe {
                amplitude_nm: self.amplitude_nm,
                frequency_hz,
            })
        };
        self.frequencies_hz.iter().map(of).collect()
    }
}

/// The length at which the root mean square of the errors is the one asked for, by bisection: what is known of t_nms
/// beforehand does not grow with the drive.
fn needed(request: &DesignRequest, place: usize, all: &[Information]) -> Option<f64> {
    let error = |span_s: f64| {
        let squares = all.iter().map(|i| {
            let lasting = i.lasting(span_s);
            lasting.standard_errors(request.t_nms_known)[place].powi(2)
        });
        (squares.sum::<f64>() / all.len() as f64).sqrt()
    };
    let (mut low, mut high) = (1.0, 1e6);
    if error(high).is_nan() || error(high) > request.error {
        return None;
    }
    for _ in 0..60 {
        let middle = f64::sqrt(low * high);
        if error(middle) > request.error {
            low = middle;
        } else {
            high = middle;
        }
    }
    Some(high)
}

/// Drives the design and identifies.
fn confirm(
    request: &DesignRequest,
    place: usize,
    design: &Design,
    drivers: &[(u32, PublishedDriver)],
    done: &(impl Fn() + Sync),
) -> Result<Confirmation, StudyError> {
    let course = request.courses.iter().find(|c| c.name() == design.course);
    let length_s = design.needed_s.unwrap_or(design.span_s).max(SHORTEST_S);
    let probes = design.probes();
    let jobs: Vec<(u32, PublishedDriver, u64)> = drivers
        .iter()
        .flat_map(|&(number, driver)| (0..u64::from(request.confirmations)).map(move |r| (number, driver, r)))
        .collect();
    let options = Options {
        t_nms_known: request.t_nms_known,
        ..Options::default()
    };
    let found = jobs
        .into_par_iter()
        .map(|(number, driver, repetition)| {
            let mut logs = Vec::new();
            let each_s = length_s / probes.len() as f64;
            let mut predicted: Option<Information> = None;
            for (half, &probe) in probes.iter().enumerate() {
                let mut left_s = each_s;
                let mut turn = 0;
                while left_s > 0.0 && turn < 100 {
                    let seed = 1_000_000
                        + request.seed.wrapping_mul(10_000)
                        + u64::from(number) * 101
                        + repetition * 7919
                        + (half as u64) * 131
                        + turn * 17;
                    let log = recorded(&driver, course, probe, seed)?;
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
            done();
            let (_, _, p) = fit.parameters.list()[place_in_list(place)];
            let truth = truth_of(&driver);
            let truth = [
                truth.gain[0],
                truth.gain[1],
                truth.gain[2],
                truth.k_hg,
                truth.t_p_s,
            ][place];
            let promised = predicted.map_or(f64::NAN, |p| p.standard_errors(request.t_nms_known)[place]);
            let off = p.optimum.map_or(f64::NAN, |x| x - truth);
            let held = p
                .interval_95
                .is_none_or(|[low, high]| low <= truth && truth <= high);
            Ok((off, held, promised))
        })
        .collect::<Result<Vec<_>, StudyError>>()?;
    let count = found.len() as f64;
    let rms = |f: &dyn Fn(&(f64, bool, f64)) -> f64| {
        (found.iter().map(|x| f(x).powi(2)).sum::<f64>() / count).sqrt()
    };
    Ok(Confirmation {
        fits: found.len(),
        length_s,
        predicted: rms(&|x| x.2),
        rms: rms(&|x| x.0),
        coverage: found.iter().filter(|x| x.1).count() as f64 / count,
    })
}

/// The list of parameters has t_p before k_hg.
fn place_in_list(place: usize) -> usize {
    match place {
        3 => 4,
        4 => 3,
        other => other,
    }
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
