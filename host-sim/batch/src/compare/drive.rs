//! One drive with its failures, and what is measured of it.

use haptic_analysis::metrics::{Circumstances, Metrics, measure};
use haptic_log::trace::Trace;
use haptic_sim::drivers::AnyDriver;
use haptic_sim::guidance::OwnLaw;
use haptic_sim::laws::Law;
use haptic_sim::models::STEPS_PER_SECOND;
use haptic_sim::parts::{PaperVehicle, Parts};
use haptic_sim::scenario::{Failure, FailureKind, Scenario};
use haptic_sim::simulation::{DIVERGED_M, Ending, SAMPLE_RATE_HZ};
use haptic_sim::{Action, Simulation};
use serde::Serialize;

use super::Faults;
use crate::Away;
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
}

const fn metric(name: &'static str, label: &'static str, unit: &'static str) -> Metric {
    Metric {
        name,
        label,
        unit,
        more_is_better: false,
    }
}

/// Every figure, in the order of [`Driven::values`]. What has an entry in the list of metrics is that metric.
pub const METRICS: [Metric; 11] = [
    metric("peak_lateral_error_m", "Peak lateral error", "m"),
    metric("mean_abs_lateral_error_m", "Mean lateral error", "m"),
    metric("sdlp_m", "SDLP", "m"),
    Metric {
        more_is_better: true,
        ..metric("min_time_to_lane_crossing_s", "Minimum TLC", "s")
    },
    metric("mean_abs_driver_torque_nm", "Mean driver torque", "N.m"),
    metric("conflict_time_share", "Conflict", "1"),
    metric("conflict_torque_nm", "Driver torque against guidance", "N.m"),
    metric("worst_peak_after_loss_m", "Worst peak after a sudden loss", "m"),
    metric("mean_peak_after_loss_m", "Mean peak after a sudden loss", "m"),
    metric("worst_peak_silent_lane_m", "Worst peak after a silent lane", "m"),
    metric(
        "after_effect_m",
        "Mean lateral error from 5 s after a loss on",
        "m",
    ),
];

/// From when on behind a loss the after-effect counts, s: what comes before is the loss itself.
const AFTER_S: u32 = 5;

/// What came of a drive and its failures.
#[derive(Debug, Clone, PartialEq)]
pub struct Driven {
    /// In the order of [`METRICS`]; a drive that leaves the road has a peak of 10 m, where runs end, and no more.
    pub values: [Option<f64>; METRICS.len()],
    /// Whether it left the road.
    pub off_road: bool,
    /// Whether the ECU ended guidance by its own decision.
    pub left_by_itself: bool,
    /// Failed drives that left the road.
    pub failed_off_road: u32,
}

type Loop = Simulation<OwnLaw<Box<dyn Law>>, Parts<Box<dyn AnyDriver>, PaperVehicle>>;

/// Drives to the end of the course, and so long from each failure.
pub(super) fn drive(
    scenario: &Scenario,
    law: Box<dyn Law>,
    driver: Box<dyn AnyDriver>,
    faults: Faults,
) -> Driven {
    let vehicle = PaperVehicle::new(scenario);
    let mut trunk: Loop = Simulation::of_parts(scenario, driver, vehicle, OwnLaw::new(scenario, law));
    let planned = failures(scenario, faults);
    let mut next = planned.iter().peekable();
    let (mut failed, mut failed_off_road) = ([Vec::new(), Vec::new()], 0);
    let mut samples = Vec::new();
    loop {
        while let Some((_, failure)) = next.next_if(|(step, _)| *step == trunk.steps()) {
            if let Some(fork) = trunk.fork_at(*failure) {
                let found = driven_after(fork, faults.lasts_s);
                failed_off_road += u32::from(found.peak_m >= DIVERGED_M);
                failed[usize::from(failure.kind == FailureKind::Input)].push(found);
            }
        }
        let Some(outcome) = trunk.step(&Action::default()) else {
            break;
        };
        samples.extend(outcome.sample);
    }
    let trace = Trace {
        sample_rate_hz: f64::from(SAMPLE_RATE_HZ),
        samples,
    };
    let off_road = trunk.ending() != Some(Ending::CourseEnd);
    Driven {
        values: measured(scenario, &trace, off_road, &failed),
        off_road,
        left_by_itself: Away::new(scenario, &trace).is_by_itself(),
        failed_off_road,
    }
}

/// What is measured of a drive; `failed` is what came after its losses and its silences.
pub(crate) fn measured(
    scenario: &Scenario,
    trace: &Trace,
    off_road: bool,
    failed: &[Vec<After>; 2],
) -> [Option<f64>; METRICS.len()] {
    let guidance = scenario.guidance();
    let circumstances = Circumstances {
        speed_m_s: scenario.speed_m_per_s(),
        lane_width_m: scenario.course().lane_width_m(),
        window: None,
        failure: None,
        probe_hz: guidance.probe.then_some(guidance.controller.probe_frequency_hz),
    };
    values(&measure(trace, &circumstances), off_road, failed)
}

/// The failures with their steps, in time: evenly over what of the drive leaves time to go on.
pub(crate) fn failures(scenario: &Scenario, faults: Faults) -> Vec<(u32, Failure)> {
    let span_s = (scenario.duration_s() - faults.lasts_s).max(0.0);
    let of_kind = |kind, count: u32| {
        (0..count).map(move |place| {
            let step =
                ((f64::from(place) + 0.5) / f64::from(count) * span_s * f64::from(STEPS_PER_SECOND)) as u32;
            let time_s = f64::from(step) / f64::from(STEPS_PER_SECOND);
            let failure = Failure {
                kind,
                time_s,
                duration_s: None,
            };
            (step, failure)
        })
    };
    let mut all: Vec<_> = of_kind(FailureKind::Torque, faults.sudden_loss).collect();
    all.extend(of_kind(FailureKind::Input, faults.silent_lane));
    all.sort_by_key(|(step, _)| *step);
    all
}

/// Lateral errors behind a failure, m.
pub(crate) struct After {
    peak_m: f64,
    /// The mean from [`AFTER_S`] on; none if the drive ends before.
    mean_m: Option<f64>,
}

/// What comes from here on.
fn driven_after(mut fork: Loop, lasts_s: f64) -> After {
    let (mut peak_m, mut sum_m, mut count) = (0.0_f64, 0.0, 0_u32);
    for step in 0..(lasts_s * f64::from(STEPS_PER_SECOND)) as u32 {
        let Some(outcome) = fork.step(&Action::default()) else {
            break;
        };
        if let Some(sample) = outcome.sample {
            let error_m = sample.lateral_error_m.abs();
            peak_m = peak_m.max(error_m);
            if step >= AFTER_S * STEPS_PER_SECOND {
                (sum_m, count) = (sum_m + error_m, count + 1);
            }
        }
    }
    match fork.ending() {
        Some(Ending::Diverged { .. }) => After {
            peak_m: DIVERGED_M,
            mean_m: Some(DIVERGED_M),
        },
        _ => After {
            peak_m,
            mean_m: (count > 0).then(|| sum_m / f64::from(count)),
        },
    }
}

fn values(metrics: &Metrics, off_road: bool, failed: &[Vec<After>; 2]) -> [Option<f64>; METRICS.len()] {
    if off_road {
        let mut values = [None; METRICS.len()];
        values[0] = Some(DIVERGED_M);
        return values;
    }
    let worst = |failed: &[After]| failed.iter().map(|after| after.peak_m).reduce(f64::max);
    let [losses, silences] = failed;
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
        worst(losses),
        mean(losses.iter().map(|after| after.peak_m)),
        worst(silences),
        mean(losses.iter().filter_map(|after| after.mean_m)),
    ]
}
