//! The figures that laws are compared by: of a drive, and of what comes behind its failures.

use haptic_log::trace::Trace;
use haptic_metrics::{Circumstances, Metrics, measure};
use haptic_sim::scenario::{FailureKind, Scenario};
use haptic_sim::simulation::DIVERGED_M;
use serde::Serialize;

use crate::engine::After;
use crate::record::probe_hz;
use crate::statistics::mean;

/// A figure that laws are compared by.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Metric {
    /// Its name in files and tables.
    pub name: &'static str,
    /// What it is, in words.
    pub label: &'static str,
    /// Its unit; `1` for a share.
    pub unit: &'static str,
    /// Whether more of it is better.
    pub more_is_better: bool,
    /// Whether laws are judged by it: the family of tests that are corrected together.
    #[serde(skip)]
    pub is_judged: bool,
}

const fn metric(name: &'static str, label: &'static str, unit: &'static str) -> Metric {
    Metric {
        name,
        label,
        unit,
        more_is_better: false,
        is_judged: false,
    }
}

const fn judged(name: &'static str, label: &'static str, unit: &'static str) -> Metric {
    Metric {
        is_judged: true,
        ..metric(name, label, unit)
    }
}

/// Peak, effort and conflict among the figures: what the trade-off is between.
pub(crate) const TRADED: [usize; 3] = [0, 4, 6];

/// Every figure, in the order of `measured`. What has an entry in the list of metrics is that metric.
pub const METRICS: [Metric; 11] = [
    judged("peak_lateral_error_m", "Peak lateral error", "m"),
    metric("mean_abs_lateral_error_m", "Mean lateral error", "m"),
    metric("sdlp_m", "SDLP", "m"),
    Metric {
        more_is_better: true,
        ..metric("min_time_to_lane_crossing_s", "Minimum TLC", "s")
    },
    judged("mean_abs_driver_torque_nm", "Mean driver torque", "N.m"),
    metric("conflict_time_share", "Conflict", "1"),
    judged("conflict_torque_nm", "Driver torque against guidance", "N.m"),
    judged("worst_peak_after_loss_m", "Worst peak after a sudden loss", "m"),
    metric("mean_peak_after_loss_m", "Mean peak after a sudden loss", "m"),
    metric("worst_peak_silent_lane_m", "Worst peak after a silent lane", "m"),
    metric(
        "after_effect_m",
        "Mean lateral error from 5 s after a loss on",
        "m",
    ),
];

/// What is measured of a drive and of what came behind its failures; a drive that leaves the road has a peak of 10 m, where runs end, and
/// no more.
pub(crate) fn measured(
    scenario: &Scenario,
    trace: &Trace,
    off_road: bool,
    failed: &[After],
) -> [Option<f64>; METRICS.len()] {
    let circumstances = Circumstances {
        speed_m_s: scenario.speed_m_per_s(),
        lane_width_m: scenario.course().lane_width_m(),
        window: None,
        failure: None,
        probe_hz: probe_hz(scenario),
    };
    values(&measure(trace, &circumstances), off_road, failed)
}

fn values(metrics: &Metrics, off_road: bool, failed: &[After]) -> [Option<f64>; METRICS.len()] {
    if off_road {
        let mut values = [None; METRICS.len()];
        values[0] = Some(DIVERGED_M);
        return values;
    }
    let peaks_m = |kind| {
        let of_kind = failed.iter().filter(move |after| after.kind == kind);
        of_kind.map(|after| after.peak_m)
    };
    let (losses_m, silences_m) = (peaks_m(FailureKind::Torque), peaks_m(FailureKind::Input));
    let behind_losses_m = failed.iter().filter(|after| after.kind == FailureKind::Torque);
    // A drive without conflict has no torque in conflict.
    let against_nm = metrics
        .conflict_time_share
        .map(|share| share * metrics.mean_abs_driver_torque_in_conflict_nm.unwrap_or(0.0));
    [
        metrics.peak_lateral_error_m,
        metrics.mean_abs_lateral_error_m,
        metrics.sdlp_m,
        metrics.min_time_to_lane_crossing_s,
        metrics.mean_abs_driver_torque_nm,
        metrics.conflict_time_share,
        against_nm,
        losses_m.clone().reduce(f64::max),
        mean(losses_m),
        silences_m.reduce(f64::max),
        mean(behind_losses_m.filter_map(|after| after.mean_m)),
    ]
}
