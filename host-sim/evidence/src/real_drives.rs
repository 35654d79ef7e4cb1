//! Recordings of real people: which are read, what is identified in them, and how well a driver that was fitted to one half of a
//! drive predicts the torque in the other, beside a plain linear regression. The segments of a vehicle are held together too
//! (`pooled`).
//!
//! The variance accounted for is 1 - var(T_d - prediction)/var(T_d): the mean of the half is free, for sensors have offsets. Our
//! driver's prediction is the simulated torque, without the disturbance model.

mod box_jenkins;
mod fed;
mod hands;
mod linear;
mod pooled;
mod reading;
mod rows;
#[cfg(test)]
mod tests;

use std::path::Path;

use haptic_analysis::identify::{
    DriveLog, Identification, Layout, Options, Parameter, Recording, identify_with_noise_model, open_mapped,
};
use haptic_batch::engine::{Watch, each};
use haptic_batch::{StudyError, refuse};
use haptic_log::formats::{self, Format, Reading};
use serde::Serialize;

use fed::fed;
pub use fed::{End, Ending, Fed, Feed};
use hands::Felt;
pub use hands::Hands;
use linear::linear;
pub use pooled::{Judged, Model, Pooled};
use pooled::{Segment, pooled};
pub use reading::Understood;
use reading::collect;
use rows::Rows;

/// Circular shifts of the guidance torque that K_hg is held against.
const SHIFTS: usize = 99;
/// Fewest rows of a half that is judged: 4 s at 10 Hz.
const LEAST_ROWS: usize = 40;

/// All recordings below a directory.
#[derive(Debug, Clone, Serialize)]
pub struct RealDrives {
    /// The layouts that were met.
    pub sources: Vec<Source>,
    /// Every recording, by hand and shared, or once if it was refused as a whole.
    pub drives: Vec<RealDrive>,
    /// Hands on the wheel, by the recordings with torque, lane and a sign of who steers; none without any.
    pub hands: Option<Hands>,
    /// The segments of each vehicle together.
    pub pooled: Vec<Pooled>,
}

/// Where recordings come from.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Source {
    /// Its layout.
    pub layout: String,
    /// Where it can be had.
    pub source: String,
    /// The commit that the layout was tried on.
    pub commit: Option<String>,
    /// Its licence.
    pub licence: String,
}

/// A recording, or the part of it that is driven by hand or shared.
#[derive(Debug, Clone, Serialize)]
pub struct RealDrive {
    /// Path below the directory.
    pub file: String,
    /// Its layout; empty if none fits.
    pub layout: String,
    /// By hand, or shared with an automation.
    pub by_hand: bool,
    /// Why nothing was identified.
    pub refused: Option<String>,
    /// What was found when it was read: what, found, done; empty if reading refused it.
    pub reading: Vec<[String; 3]>,
    /// What was converted or computed, in sentences.
    pub notes: Vec<String>,
    /// What was found, if it was not refused.
    pub found: Option<Found>,
}

/// What was found in a drive.
#[derive(Debug, Clone, Serialize)]
pub struct Found {
    /// Seconds that the fit rests on.
    pub used_s: f64,
    /// Assumptions that are refuted.
    pub refuted: Vec<&'static str>,
    /// Parameters that are identified.
    pub identified: Vec<&'static str>,
    /// Whether the residuals are white.
    pub white: bool,
    /// Their standard deviation, N.m.
    pub residual_nm: f64,
    /// The driver's weight on the guidance; none by hand.
    pub k_hg: Option<Parameter>,
    /// The share of circular shifts of the guidance torque that give at least this K_hg.
    pub k_hg_p: Option<f64>,
    /// Fitted on the first half and judged on the second, and the other way.
    pub halves: Vec<Half>,
}

/// Variance accounted for.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Half {
    /// Whether no assumption was refuted on the half that was fitted.
    pub accepted: bool,
    /// Our driver on the half that was fitted.
    pub own: f64,
    /// Our driver on the other half.
    pub ours: f64,
    /// That value without a delay, which is the two-point driver with a bias (Salvucci and Gray 2004), on the other half.
    pub two_point: f64,
    /// The linear regression on the other half.
    pub linear: f64,
}

/// Reads and judges every recording below `directory`.
///
/// # Errors
/// The directory cannot be read, or holds no recording.
pub fn real_drives(directory: &Path, how: &Understood, watch: &Watch<'_>) -> Result<RealDrives, StudyError> {
    let layouts = match &how.layout {
        Some(layout) => vec![layout.clone()],
        None => Layout::built_in()?,
    };
    let mut files = Vec::new();
    collect(directory, &mut files).map_err(|e| format!("{}: {e}", directory.display()))?;
    files.sort();
    if files.is_empty() {
        return refuse(format!(
            "{}: there is no .csv, .mat, .mf4 or .parquet file below it",
            directory.display()
        ));
    }
    let mut found: Vec<FileResult<'_>> =
        each(&files, watch, |path| Ok(of_file(directory, path, &layouts, how)))?;
    let mut sources: Vec<Source> = Vec::new();
    for layout in found.iter().filter_map(|file| file.layout) {
        let source = Source {
            layout: layout.name.clone(),
            source: layout.source.clone(),
            commit: layout.tried_on.clone(),
            licence: layout.licence.clone(),
        };
        if !sources.contains(&source) {
            sources.push(source);
        }
    }
    let segments = found
        .iter_mut()
        .flat_map(|file| std::mem::take(&mut file.segments));
    let pooled = pooled(segments.collect());
    let felt: Vec<&(Felt, Vec<Fed>)> = found.iter().filter_map(|file| file.hands.as_ref()).collect();
    Ok(RealDrives {
        sources,
        hands: Hands::new(&felt),
        pooled,
        drives: found.into_iter().flat_map(|file| file.drives).collect(),
    })
}

/// What a file showed.
struct FileResult<'a> {
    layout: Option<&'a Layout>,
    drives: Vec<RealDrive>,
    hands: Option<(Felt, Vec<Fed>)>,
    /// Stretches of driving, each with the vehicle that drove it.
    segments: Vec<(String, Segment)>,
}

fn of_file<'a>(
    directory: &Path,
    path: &Path,
    layouts: &'a [Layout],
    understood: &Understood,
) -> FileResult<'a> {
    let maps = &understood.maps[..];
    let refused = |drive| FileResult {
        layout: None,
        drives: vec![drive],
        hands: None,
        segments: Vec::new(),
    };
    let file = path.strip_prefix(directory).unwrap_or(path).display().to_string();
    let drive = |layout: &str, by_hand, why: Option<String>| RealDrive {
        file: file.clone(),
        layout: layout.into(),
        by_hand,
        refused: why,
        reading: Vec::new(),
        notes: Vec::new(),
        found: None,
    };
    let bytes = match std::fs::read(path) {
        Ok(bytes) => bytes,
        Err(error) => return refused(drive("", true, Some(error.to_string()))),
    };
    let format = Format::from_path(path).ok();
    let Some(layout) = layouts.iter().find(|layout| layout.fits(&bytes, format, maps)) else {
        // A file that is broken says where; of a whole one only the time is missed.
        let why = match formats::read_bytes(bytes, format.unwrap_or(Format::Csv), Reading::default()) {
            Err(error) if !error.to_string().contains("there is no channel time_s") => error.to_string(),
            _ => "it has the channels of no layout that needs no --map".to_owned(),
        };
        return refused(drive("", true, Some(why)));
    };
    let rows = Rows::read(layout, &bytes, format, maps);
    let vehicle = vehicle(path, layout.vehicle_folder);
    let segments = rows.iter().flat_map(|rows| Segment::of(rows, &file));
    let segments = segments.map(|segment| (vehicle.clone(), segment)).collect();
    let hands = rows.map(|rows| {
        (
            Felt::new(&rows),
            Feed::ALL.map(|feed| fed(&rows, feed, &file)).into(),
        )
    });
    let judged = |by_hand| {
        let how = Recording {
            manual: by_hand,
            stretches: &understood.stretches,
            ..Recording::default()
        };
        let (log, notes) = match open_mapped(path, Some(layout), maps, &how) {
            Ok(read) => read,
            Err(error) => {
                let why = error.to_string();
                let place = format!("{}: ", path.display());
                let why = why.strip_prefix(&place).map_or(why.clone(), str::to_owned);
                return drive(&layout.name, by_hand, Some(why));
            }
        };
        let judged = judge(&log, by_hand, understood);
        RealDrive {
            reading: log.findings,
            notes,
            refused: judged.as_ref().err().map(ToString::to_string),
            found: judged.ok(),
            ..drive(&layout.name, by_hand, None)
        }
    };
    let parts = [true, false].map(judged);
    let [hand, shared] = &parts;
    // What is wrong with the file as a whole is said once.
    let same = hand.refused.is_some() && hand.refused == shared.refused;
    let drives = parts.into_iter().take(if same { 1 } else { 2 }).collect();
    FileResult {
        layout: Some(layout),
        drives,
        hands,
        segments,
    }
}

/// The name of the folder so far up that is named after the vehicle.
fn vehicle(path: &Path, folders: Option<usize>) -> String {
    let path = std::path::absolute(path).unwrap_or_else(|_| path.into());
    let folder = path
        .ancestors()
        .nth(folders.unwrap_or(1))
        .and_then(Path::file_name);
    folder.unwrap_or_default().to_string_lossy().into_owned()
}

fn judge(log: &DriveLog, by_hand: bool, how: &Understood) -> Result<Found, StudyError> {
    let options = Options {
        manual: by_hand,
        stretches: how.stretches.clone(),
        bridge_s: how.bridge_s,
        ..Options::default()
    };
    let fit = identify_with_noise_model(log, &options);
    let used_s = fit.preflight.as_ref().map_or(0.0, |p| p.used_s);
    let time_s = &fit.traces.time_s;
    let Some(&middle_s) = time_s.get(time_s.len() / 2) else {
        return refuse("no row is left after hands off, pauses and lane changes");
    };
    let halves = half_against_half(log, &options, middle_s);
    let list = fit.parameters.list();
    let identified = list.iter().filter(|(.., p)| p.identified).map(|(name, ..)| *name);
    Ok(Found {
        used_s,
        refuted: fit.refuted.iter().map(|r| r.assumption).collect(),
        identified: identified.collect(),
        white: fit.whiteness.white,
        residual_nm: fit.remnant.as_ref().map_or(f64::NAN, |r| r.innovation_sd_nm),
        k_hg: (!by_hand).then_some(fit.parameters.k_hg),
        k_hg_p: (!by_hand).then(|| by_chance(log, &options, &fit)).flatten(),
        halves,
    })
}

/// Fitted before the middle and judged behind it, and the other way; nothing if a half is too short.
fn half_against_half(log: &DriveLog, options: &Options, middle_s: f64) -> Vec<Half> {
    let within = [(f64::NEG_INFINITY, middle_s), (middle_s, f64::INFINITY)].map(|half| Options {
        stretches: vec![half],
        ..options.clone()
    });
    let fits = within
        .each_ref()
        .map(|options| identify_with_noise_model(log, options));
    let rows = fits.each_ref().map(|fit| -> Vec<usize> {
        let row = |t: &f64| ((t - log.start_s) / log.dt_s).round() as usize;
        fit.traces.time_s.iter().map(row).collect()
    });
    if rows.iter().any(|rows| rows.len() < LEAST_ROWS) {
        return Vec::new();
    }
    let simulated = |fit: &Identification| accounted(&fit.traces.measured_nm, &fit.traces.simulated_nm);
    let elsewhere = |fit: &Identification, other: &Options| {
        let known = fixed(fit, other.clone());
        let there = known.map(|known| identify_with_noise_model(log, &known));
        there.as_ref().map_or(f64::NAN, simulated)
    };
    let judged = [0, 1].map(|own| {
        let other = 1 - own;
        let at_once = Options {
            t_p_s: Some(0.0),
            ..within[own].clone()
        };
        Half {
            accepted: fits[own].refuted.is_empty(),
            own: simulated(&fits[own]),
            ours: elsewhere(&fits[own], &within[other]),
            two_point: elsewhere(&identify_with_noise_model(log, &at_once), &within[other]),
            linear: linear(log, &rows[own], &rows[other]).unwrap_or(f64::NAN),
        }
    });
    judged.into()
}

/// The fitted driver as known in another stretch; none if the search found none.
fn fixed(fit: &Identification, options: Options) -> Option<Options> {
    let p = &fit.parameters;
    let gain = [&p.gain_1, &p.gain_2, &p.gain_3].map(|gain| gain.optimum);
    gain.iter().all(Option::is_some).then_some(())?;
    Some(Options {
        gain,
        t_p_s: Some(p.t_p.optimum?),
        k_hg: if options.manual {
            None
        } else {
            Some(p.k_hg.optimum?)
        },
        muscle: fit.muscle(options.muscle),
        t_nms_known: true,
        ..options
    })
}

fn variance(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let n = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / n;
    values.map(|v| (v - mean).powi(2)).sum::<f64>() / n
}

/// The variance accounted for.
fn accounted(measured: &[f64], predicted: &[f64]) -> f64 {
    let left = measured.iter().zip(predicted).map(|(m, p)| m - p);
    1.0 - variance(left) / variance(measured.iter().copied())
}

/// How often the same guidance torque at another time gives at least this K_hg.
fn by_chance(log: &DriveLog, options: &Options, fit: &Identification) -> Option<f64> {
    let k_hg = fit.parameters.k_hg.optimum?;
    let known: Vec<usize> = (0..log.len())
        .filter(|k| log.guidance_torque_nm[*k].is_finite())
        .collect();
    let at_least = (1..=SHIFTS).filter(|shift| {
        let by = shift * known.len() / (SHIFTS + 1);
        let mut shifted = log.clone();
        for (i, &k) in known.iter().enumerate() {
            shifted.guidance_torque_nm[k] = log.guidance_torque_nm[known[(i + by) % known.len()]];
        }
        let found = identify_with_noise_model(&shifted, options)
            .parameters
            .k_hg
            .optimum;
        found.is_some_and(|found| found >= k_hg)
    });
    // The drive as it is counts as one of them: no share is zero.
    Some((1 + at_least.count()) as f64 / (1 + SHIFTS) as f64)
}
