//! The figures that a run is judged by: lane keeping, steering, effort, guidance, conflict, recovery.
//!
//! [`measure`] takes a run's [`Trace`] and a window of road and gives [`Metrics`]; what each one means, with
//! unit and source, is in [`DEFINITIONS`]. Terms: e is the lateral error, T_d the driver's torque, T_h the
//! guidance's, v the speed, r the yaw rate. All are of the truth, not of the sensors.
//!
//! A window that holds no sample, or a sample that is not finite (a run that diverged), has no metrics: every
//! field is `None`. Comparing runs, choosing windows and calling a run diverged is NOT done here.

mod definitions;
mod filters;
mod lane_crossing;
mod moments;
mod reversals;

pub use definitions::{DEFINITIONS, Definition, Metrics};
pub use filters::{zero_phase_low_pass, zero_phase_notch};
pub use lane_crossing::{Placement, distance_to_lane_crossing_m};
pub use reversals::count_reversals;

use std::ops::Range;

use haptic_log::trace::{Sample, Trace};
use moments::Moments;

/// Width of the vehicle for all lane metrics, m.
pub const VEHICLE_WIDTH_M: f64 = 1.7;
/// Torques of at most this size have no sign in the conflict metrics, N.m: the torque sensor's resolution.
pub const CONFLICT_DEAD_BAND_NM: f64 = 0.005;
/// Gap, deg, and cut-off, Hz, of the two steering reversal rates (Markkula and Engstroem 2006).
const VISUAL_REVERSALS: (f64, f64) = (3.0, 0.6);
const COGNITIVE_REVERSALS: (f64, f64) = (0.1, 2.0);
/// Width of the notch that takes the probe out, Hz: the driver's own movements beside it stay.
const PROBE_WIDTH_HZ: f64 = 0.5;

/// A stretch of road by arc length, ends included.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Window {
    /// Start, m along the course.
    pub from_m: f64,
    /// End, m along the course.
    pub to_m: f64,
}

/// The failure that a run is measured against.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Failure {
    /// Instant of the failure, s since the start of the run.
    pub time_s: f64,
    /// Peak lateral error of the same run without the failure, m, over the window and, if the failure comes
    /// before it, from then on: recovered means at or below it. `None`: not known, and no time to recover is
    /// given.
    pub nominal_peak_lateral_error_m: Option<f64>,
}

/// What a trace alone does not tell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Circumstances {
    /// Speed, m/s, above zero, wherever a sample has none: a trace of an earlier version.
    pub speed_m_s: f64,
    /// Width of the lane, m.
    pub lane_width_m: f64,
    /// Stretch to measure; `None` is the whole run.
    pub window: Option<Window>,
    /// Failure during the run, if any.
    pub failure: Option<Failure>,
    /// Frequency of the probe, if it was on: reversals and conflict are the driver's without it.
    pub probe_hz: Option<f64>,
}

/// The metrics that take most of the time of measuring a run: those that are not asked for have no value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Asked {
    /// Times to lane crossing.
    pub crossings: bool,
    /// Steering reversals.
    pub reversals: bool,
}

impl Asked {
    /// All of them.
    pub const ALL: Self = Self {
        crossings: true,
        reversals: true,
    };

    /// What some definitions ask for.
    #[must_use]
    pub fn among(definitions: &[&Definition]) -> Self {
        let any = |part: &str| definitions.iter().any(|d| d.name.contains(part));
        Self {
            crossings: any("time_to_lane_crossing"),
            reversals: any("reversals"),
        }
    }
}

/// Measures a run.
pub fn measure(trace: &Trace, circumstances: &Circumstances) -> Metrics {
    measure_asked(trace, circumstances, Asked::ALL)
}

/// Measures of a run what is asked for, and whatever takes little time.
pub fn measure_asked(trace: &Trace, circumstances: &Circumstances, asked: Asked) -> Metrics {
    let range = samples_in(&trace.samples, circumstances.window);
    let samples = &trace.samples[range.clone()];
    let count = samples.len() as f64;
    let half_room_m = (circumstances.lane_width_m - VEHICLE_WIDTH_M) / 2.0;

    let [
        mut lateral,
        mut wheel,
        mut driver,
        mut guidance,
        mut driver_in_conflict,
    ] = [Moments::default(); 5];
    let [mut out_of_lane, mut limited, mut in_conflict] = [0.0; 3];
    let [mut speeds, mut slowest, mut fastest] = [0.0, f64::INFINITY, 0.0_f64];
    let torques = torques_beside_probe(trace, circumstances.probe_hz);
    let mut times_to_crossing_s = Vec::new();
    let mut are_finite = true;
    // A long trace does not fit into a cache: one pass reads it once.
    for (place, sample) in range.clone().zip(samples) {
        are_finite &= is_finite(sample);
        let speed = speed_m_s(sample, circumstances);
        speeds += speed;
        (slowest, fastest) = (slowest.min(speed), fastest.max(speed));
        let (t_d, t_h) = (sample.driver_torque_nm, sample.guidance_torque_nm);
        lateral.add(sample.lateral_error_m);
        wheel.add(sample.wheel_angle_rad);
        driver.add(t_d);
        guidance.add(t_h);
        out_of_lane += f64::from(sample.lateral_error_m.abs() > half_room_m);
        limited += f64::from(sample.guidance_limited);
        let [t_d, t_h] = torques.as_ref().map_or([t_d, t_h], |torques| torques[place]);
        if t_d * t_h < 0.0 && t_d.abs().min(t_h.abs()) > CONFLICT_DEAD_BAND_NM {
            in_conflict += 1.0;
            driver_in_conflict.add(t_d);
        }
        if asked.crossings {
            times_to_crossing_s.push(time_to_crossing_s(sample, speed, half_room_m));
        }
    }
    if samples.is_empty() || !are_finite {
        return Metrics::default();
    }
    let to_the_end = &trace.samples[..range.end];
    let recovery = circumstances
        .failure
        .map(|failure| recovery(to_the_end, &failure));
    let recovery = recovery.unwrap_or_default();
    // Where no guidance ever was, none met a limit and none was in conflict: that is no share of zero.
    let is_guided = trace.samples.iter().any(|s| s.guidance_torque_nm != 0.0);
    let of_guidance = |share: f64| finite(share / count).filter(|_| is_guided);
    let angle_deg = asked
        .reversals
        .then(|| without_probe(trace, circumstances.probe_hz, |s| s.wheel_angle_rad.to_degrees()));
    let reversals_per_min =
        |kind| reversals_per_min(angle_deg.as_ref()?, trace.sample_rate_hz, range.clone(), kind);

    Metrics {
        duration_s: finite(count / trace.sample_rate_hz),
        peak_lateral_error_m: finite(lateral.peak_abs()),
        mean_abs_lateral_error_m: finite(lateral.mean_abs(count)),
        sdlp_m: finite(lateral.standard_deviation(count)),
        time_out_of_lane_s: finite(out_of_lane / trace.sample_rate_hz),
        min_time_to_lane_crossing_s: percentile(&mut times_to_crossing_s, 0.0),
        p15_time_to_lane_crossing_s: percentile(&mut times_to_crossing_s, 0.15),
        reversals_3deg_per_min: reversals_per_min(VISUAL_REVERSALS),
        reversals_0p1deg_per_min: reversals_per_min(COGNITIVE_REVERSALS),
        sd_wheel_angle_rad: finite(wheel.standard_deviation(count)),
        mean_abs_driver_torque_nm: finite(driver.mean_abs(count)),
        rms_driver_torque_nm: finite(driver.rms(count)),
        peak_driver_torque_nm: finite(driver.peak_abs()),
        integral_squared_driver_torque_nm2s: finite(driver.sum_of_squares() / trace.sample_rate_hz),
        mean_abs_guidance_torque_nm: finite(guidance.mean_abs(count)),
        rms_guidance_torque_nm: finite(guidance.rms(count)),
        peak_guidance_torque_nm: finite(guidance.peak_abs()),
        limited_time_share: of_guidance(limited),
        conflict_time_share: of_guidance(in_conflict),
        mean_abs_driver_torque_in_conflict_nm: finite(driver_in_conflict.mean_abs(in_conflict)),
        guidance_authority: finite(guidance.sum_abs() / (guidance.sum_abs() + driver.sum_abs())),
        peak_lateral_error_after_failure_m: recovery.peak_lateral_error_m,
        time_to_recover_s: recovery.time_to_recover_s,
        mean_speed_m_per_s: finite(speeds / count),
        min_speed_m_per_s: Some(slowest),
        max_speed_m_per_s: Some(fastest),
    }
}

/// Reversals a minute of an angle in a range of its samples, by their least size, deg, after a low-pass, Hz.
fn reversals_per_min(
    angle_deg: &[f64],
    sample_rate_hz: f64,
    range: Range<usize>,
    (gap_deg, cut_off_hz): (f64, f64),
) -> Option<f64> {
    let filtered = zero_phase_low_pass(angle_deg, sample_rate_hz, cut_off_hz)?;
    let filtered = &filtered[range];
    let known = filtered.iter().all(|x| x.is_finite());
    let duration_s = filtered.len() as f64 / sample_rate_hz;
    known.then(|| count_reversals(filtered, gap_deg) as f64 * 60.0 / duration_s)
}

/// A quantity over the whole run, so that the ends of a window carry no transient of the filter; as it is where there is no
/// probe, or the run is too short to filter.
pub fn without_probe(trace: &Trace, probe_hz: Option<f64>, value: fn(&Sample) -> f64) -> Vec<f64> {
    let record: Vec<f64> = trace.samples.iter().map(value).collect();
    let notched = |hz| zero_phase_notch(&record, trace.sample_rate_hz, hz, PROBE_WIDTH_HZ);
    probe_hz.and_then(notched).unwrap_or(record)
}

/// The driver's torque and the guidance's without the probe, where there is one.
fn torques_beside_probe(trace: &Trace, probe_hz: Option<f64>) -> Option<Vec<[f64; 2]>> {
    probe_hz?;
    let driver = without_probe(trace, probe_hz, |s| s.driver_torque_nm);
    let guidance = without_probe(trace, probe_hz, |s| s.guidance_torque_nm);
    Some(driver.into_iter().zip(guidance).map(Into::into).collect())
}

/// Speed of a sample, m/s.
fn speed_m_s(sample: &Sample, circumstances: &Circumstances) -> f64 {
    if sample.speed_m_per_s > 0.0 {
        sample.speed_m_per_s
    } else {
        circumstances.speed_m_s
    }
}

fn time_to_crossing_s(sample: &Sample, v: f64, half_room_m: f64) -> f64 {
    let placement = Placement {
        offset_m: sample.lateral_error_m,
        heading_error_rad: sample.heading_error_rad,
        path_curvature_1pm: sample.yaw_rate_rad_per_s / v,
        road_curvature_1pm: sample.curvature_1pm,
    };
    distance_to_lane_crossing_m(&placement, half_room_m) / v
}

/// The samples from the first in the window to the last before the run first leaves it.
fn samples_in(samples: &[Sample], window: Option<Window>) -> std::ops::Range<usize> {
    let Some(Window { from_m, to_m }) = window else {
        return 0..samples.len();
    };
    let start = samples
        .iter()
        .position(|s| s.s_m >= from_m)
        .unwrap_or(samples.len());
    let inside = samples[start..].iter().take_while(|s| s.s_m <= to_m).count();
    start..start + inside
}

/// Whether every quantity that the metrics use is a number.
fn is_finite(sample: &Sample) -> bool {
    [
        sample.lateral_error_m,
        sample.heading_error_rad,
        sample.curvature_1pm,
        sample.wheel_angle_rad,
        sample.yaw_rate_rad_per_s,
        sample.driver_torque_nm,
        sample.guidance_torque_nm,
    ]
    .iter()
    .all(|x| x.is_finite())
}

fn finite(x: f64) -> Option<f64> {
    x.is_finite().then_some(x)
}

/// The value below which the share `p` (0..1) of `values` lies, linear between ranks (the default of NumPy);
/// reorders `values`, which hold no NaN.
fn percentile(values: &mut [f64], p: f64) -> Option<f64> {
    let rank = p * (values.len().checked_sub(1)?) as f64;
    let (below, share) = (rank.floor() as usize, rank.fract());
    let (_, &mut low, above) = values.select_nth_unstable_by(below, f64::total_cmp);
    if share == 0.0 {
        return finite(low);
    }
    // The next rank is the least of those above: they are not sorted.
    let high = above.iter().copied().fold(f64::INFINITY, f64::min);
    // Between two that are infinite this is no number, which is no value either.
    finite(low + share * (high - low))
}

#[derive(Debug, Default, PartialEq)]
struct Recovery {
    peak_lateral_error_m: Option<f64>,
    time_to_recover_s: Option<f64>,
}

/// The recovery in the samples up to the end of the window. What happens between a failure and a window that begins
/// later counts: it is what the driver has to recover from.
fn recovery(samples: &[Sample], failure: &Failure) -> Recovery {
    let start = samples.partition_point(|s| s.time_s < failure.time_s);
    let after = &samples[start..];
    let (mut are_finite, mut peak_m) = (true, 0.0_f64);
    for sample in after {
        are_finite &= is_finite(sample);
        peak_m = peak_m.max(sample.lateral_error_m.abs());
    }
    if !are_finite {
        return Recovery::default();
    }
    let peak_lateral_error_m = (!after.is_empty()).then_some(peak_m);
    let time_to_recover_s = failure.nominal_peak_lateral_error_m.and_then(|threshold| {
        match after.iter().rposition(|s| s.lateral_error_m.abs() > threshold) {
            None => peak_lateral_error_m.map(|_| 0.0),
            Some(last_above) => after.get(last_above + 1).map(|s| s.time_s - failure.time_s),
        }
    });
    Recovery {
        peak_lateral_error_m,
        time_to_recover_s,
    }
}

#[cfg(test)]
mod tests;
