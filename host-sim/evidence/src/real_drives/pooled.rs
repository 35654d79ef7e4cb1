//! The segments of one vehicle together: each model is fitted to all of them but one, and judged on that one.
//!
//! Signals are about their means in the segment, in the one left out too: an offset belongs to the segment, the driver to all of
//! them. First come models of the torque of now: the column's equation of motion, which holds whoever steers, and drivers who see road and
//! lane alone. Then come predictions from what is known some time before.

use std::collections::BTreeMap;
use std::ops::Range;

use serde::Serialize;

use super::accounted;
use super::box_jenkins::{BoxJenkins, Series};
use super::linear::{dot, weights};
use super::rows::Rows;

/// Shorter segments, and stretches without a gap, are left out, s.
const LEAST_S: f64 = 10.0;
const STRETCH_S: f64 = 3.0;
/// Fewer segments are not pooled: the sign test has no interval then.
const FEWEST: usize = 6;
/// A wheel that is turned further turns a corner, rad.
const TURNED_RAD: f64 = 2.0;
/// The friction is reached at about this speed of the wheel, rad/s: a step of the angle's sensor in 10 Hz is 0.01.
const SLIDES_RAD_PER_S: f64 = 0.05;
/// Steps of the lags, s.
const STEP_S: f64 = 0.1;
/// Lags of the torque's own past, of the road beside it, of a driver, and of the inputs of the Box-Jenkins model, in steps.
const PAST: [usize; 6] = [0, 1, 2, 3, 4, 5];
const ROAD: [usize; 3] = [0, 2, 4];
const DRIVER: [usize; 3] = [0, 3, 6];
const INPUTS: [usize; 3] = [0, 1, 3];
/// Steps that every model may look back: what it predicts is the same for all.
const HISTORY: usize = 15;
/// How far ahead the torque is predicted, s.
const AHEAD_S: [f64; 3] = [0.3, 0.5, 1.0];

/// What says the torque.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Model {
    /// The column's equation of motion: wheel angle, times v^2 too, its rate and acceleration, friction, lateral acceleration, roll;
    /// shared, the guidance.
    Column,
    /// The column first, then a driver who sees planned curvature and lane in what it leaves.
    ColumnThenDriver,
    /// A driver who sees planned curvature and lane, now and before, and never the wheel.
    Driver,
    /// The torque stays as it is.
    Persistence,
    /// A regression on the torque's own past.
    OwnPast,
    /// A regression on the torque's own past, planned curvature and lane.
    Road,
    /// A Box-Jenkins model with planned curvature, lane, wheel angle and, shared, the guidance.
    BoxJenkins,
    /// A regression on the past of the torque and of all these, fitted to all segments, the judged one among them.
    Ceiling,
}

/// How well a model says the torque of the segments.
#[derive(Debug, Clone, Serialize)]
pub struct Judged {
    /// The model.
    pub model: Model,
    /// How far ahead, s; none: now.
    pub ahead_s: Option<f64>,
    /// Variance accounted for, by segment.
    pub accounted: Vec<f64>,
}

/// What the segments of a vehicle say together.
#[derive(Debug, Clone, Serialize)]
pub struct Pooled {
    /// The vehicle: the name of a folder.
    pub vehicle: String,
    /// By hand, or shared with an automation.
    pub by_hand: bool,
    /// Their files.
    pub segments: Vec<String>,
    /// How long they are, s.
    pub seconds: f64,
    /// The models.
    pub models: Vec<Judged>,
}

/// Rows without a gap, with what models take from each.
struct Stretch {
    torque: Vec<f64>,
    column: Vec<Vec<f64>>,
    road: Vec<[f64; 2]>,
    wheel: Vec<Vec<f64>>,
}

/// A part of a recording that is driven in one way.
pub(super) struct Segment {
    file: String,
    by_hand: bool,
    step_s: f64,
    stretches: Vec<Stretch>,
}

/// A regression's rows: regressors, and the torque.
type Samples = Vec<(Vec<f64>, f64)>;

impl Segment {
    /// The parts of a recording, by hand and shared; none where it has no road.
    pub(super) fn of(rows: &Rows, file: &str) -> Vec<Self> {
        let mut steps: Vec<f64> = rows.time_s.windows(2).map(|w| w[1] - w[0]).collect();
        steps.sort_by(f64::total_cmp);
        let Some((road, &step_s)) = rows.road.as_ref().zip(steps.get(steps.len() / 2)) else {
            return Vec::new();
        };
        let gapless = |part: Range<usize>| -> Vec<Range<usize>> {
            let usable = |k: usize| {
                let sum = rows.driver_nm[k] + rows.guidance_nm[k] + rows.roll_rad[k];
                let sum = sum + road.iter().map(|signal| signal[k]).sum::<f64>() + rows.driven_1pm[k];
                sum.is_finite() && rows.wheel_rad[k].abs() < TURNED_RAD
            };
            let next = |a: usize, b: usize| rows.time_s[b] - rows.time_s[a] < 1.5 * step_s;
            let all: Vec<usize> = part.filter(|k| usable(*k)).collect();
            all.chunk_by(|a, b| next(*a, *b))
                .map(|chunk| chunk[0]..chunk[chunk.len() - 1] + 1)
                .filter(|part| part.len() as f64 * step_s >= STRETCH_S)
                .collect()
        };
        let segment = |by_hand: bool| {
            let parts = rows.stretches().filter(|part| rows.shared[part.start] != by_hand);
            let stretches = parts.flat_map(gapless);
            let stretches: Vec<Stretch> = stretches
                .map(|part| Stretch::new(rows, road, part, step_s))
                .collect();
            Self {
                file: file.into(),
                by_hand,
                step_s,
                stretches,
            }
        };
        let long = |segment: &Self| segment.seconds() >= LEAST_S;
        [true, false].map(segment).into_iter().filter(long).collect()
    }

    fn seconds(&self) -> f64 {
        self.step_s * self.stretches.iter().map(|s| s.torque.len()).sum::<usize>() as f64
    }

    /// So many steps, in rows.
    fn rows(&self, steps: usize) -> usize {
        ((STEP_S / self.step_s).round() as usize).max(1) * steps
    }

    /// The torque so many rows ahead of each row that has its history, on what `of` takes from that row.
    fn samples(&self, ahead: usize, of: impl Fn(&Self, &Stretch, usize) -> Vec<f64>) -> Samples {
        let from = self.rows(HISTORY);
        let rows = self.stretches.iter().flat_map(|stretch| {
            let until = stretch.torque.len().saturating_sub(ahead);
            (from..until).map(|k| (of(self, stretch, k), stretch.torque[k + ahead]))
        });
        centred(rows.collect())
    }

    /// Inputs that are known so many rows before the torque.
    fn series(&self, ahead: usize) -> Vec<Series> {
        let lags = INPUTS.map(|steps| ahead + self.rows(steps));
        let from = lags[INPUTS.len() - 1];
        let row = |stretch: &Stretch, k: usize| {
            let x = lags.into_iter().flat_map(|lag| stretch.inputs(k - lag));
            (x.collect(), stretch.torque[k])
        };
        let long = self.stretches.iter().map(|s| s.torque.len().saturating_sub(from));
        let lengths: Vec<usize> = long.collect();
        let rows = self
            .stretches
            .iter()
            .flat_map(|s| (from..s.torque.len()).map(|k| row(s, k)));
        let mut rows = centred(rows.collect()).into_iter();
        lengths
            .into_iter()
            .map(|n| rows.by_ref().take(n).collect())
            .collect()
    }

    /// The variance that a Box-Jenkins model accounts for, where the regressions are judged.
    fn by(&self, model: &BoxJenkins, series: &[Series], ahead: usize) -> f64 {
        let first = self.rows(HISTORY) - self.rows(INPUTS[INPUTS.len() - 1]);
        let of = |series: &Series| {
            let predicted = model.ahead(series, ahead);
            let judged = predicted.len().min(series.len().saturating_sub(first));
            let measured = series[series.len() - judged..].iter().map(|row| row.1);
            let skipped = predicted.len() - judged;
            measured
                .zip(predicted.into_iter().skip(skipped))
                .collect::<Vec<_>>()
        };
        let (measured, predicted): (Vec<f64>, Vec<f64>) = series.iter().flat_map(of).unzip();
        accounted(&measured, &predicted)
    }
}

impl Stretch {
    /// What a row tells beside the torque and the wheel's motion.
    fn inputs(&self, k: usize) -> impl Iterator<Item = f64> {
        self.road[k].iter().chain(&self.wheel[k]).copied()
    }

    fn new(rows: &Rows, road: &[Vec<f64>; 2], part: Range<usize>, step_s: f64) -> Self {
        let phi = &rows.wheel_rad;
        let inner = part.start + 1..part.end - 1;
        let guidance = |k: usize| rows.shared[k].then_some(rows.guidance_nm[k]);
        let square = |k: usize| rows.speed_m_per_s[k].powi(2);
        let column = |k: usize| {
            let rate = (phi[k + 1] - phi[k - 1]) / (2.0 * step_s);
            let acceleration = (phi[k + 1] - 2.0 * phi[k] + phi[k - 1]) / (step_s * step_s);
            let friction = (rate / SLIDES_RAD_PER_S).tanh();
            let lateral = square(k) * rows.driven_1pm[k];
            let own = [
                phi[k],
                square(k) * phi[k],
                rate,
                acceleration,
                friction,
                lateral,
                rows.roll_rad[k],
            ];
            own.into_iter().chain(guidance(k)).collect()
        };
        Self {
            torque: rows.driver_nm[inner.clone()].into(),
            column: inner.clone().map(column).collect(),
            road: inner
                .clone()
                .map(|k| [square(k) * road[0][k], road[1][k]])
                .collect(),
            wheel: inner
                .map(|k| std::iter::once(phi[k]).chain(guidance(k)).collect())
                .collect(),
        }
    }
}

/// Without the means.
fn centred(mut samples: Samples) -> Samples {
    let n = samples.len() as f64;
    let regressors = samples.first().map_or(0, |row| row.0.len());
    let torque = samples.iter().map(|row| row.1).sum::<f64>() / n;
    let means: Vec<f64> = (0..regressors)
        .map(|i| samples.iter().map(|row| row.0[i]).sum::<f64>() / n)
        .collect();
    for (x, y) in &mut samples {
        *y -= torque;
        x.iter_mut().zip(&means).for_each(|(x, mean)| *x -= mean);
    }
    samples
}

/// All but one.
fn others<T>(of: &[T], one: usize) -> impl Iterator<Item = &T> {
    of.iter()
        .enumerate()
        .filter(move |(k, _)| *k != one)
        .map(|(_, item)| item)
}

/// What a regression on the other segments predicts of each.
fn left_out(segments: &[Samples]) -> Option<Vec<Vec<f64>>> {
    let of = |one: usize| {
        let rows: Vec<(&[f64], f64)> = others(segments, one)
            .flat_map(|rows| rows.iter().map(|(x, y)| (&x[..], *y)))
            .collect();
        let weights = weights(&rows)?;
        Some(segments[one].iter().map(|(x, _)| dot(x, &weights)).collect())
    };
    (0..segments.len()).map(of).collect()
}

fn judged(model: Model, ahead_s: Option<f64>, segments: &[Samples], predicted: &[Vec<f64>]) -> Judged {
    let of = |(rows, predicted): (&Samples, &Vec<f64>)| {
        let measured: Vec<f64> = rows.iter().map(|row| row.1).collect();
        accounted(&measured, predicted)
    };
    Judged {
        model,
        ahead_s,
        accounted: segments.iter().zip(predicted).map(of).collect(),
    }
}

/// Models of the torque of now.
fn now(segments: &[Segment]) -> Option<Vec<Judged>> {
    let samples = |of: &dyn Fn(&Segment, &Stretch, usize) -> Vec<f64>| -> Vec<Samples> {
        segments.iter().map(|s| s.samples(0, of)).collect()
    };
    let column = samples(&|_, stretch, k| stretch.column[k].clone());
    let driver = samples(&|s, stretch, k| DRIVER.map(|steps| stretch.road[k - s.rows(steps)]).concat());
    let by_column = left_out(&column)?;
    let by_driver = left_out(&driver)?;
    // The column once more for each segment that is left out: what it leaves in the others is what a driver is fitted to.
    let both = |one: usize| -> Option<Vec<f64>> {
        let rows: Vec<_> = others(&column, one)
            .flatten()
            .map(|(x, y)| (&x[..], *y))
            .collect();
        let first = weights(&rows)?;
        let seen = others(&driver, one).flatten();
        let left = rows
            .iter()
            .zip(seen)
            .map(|((x, y), (seen, _))| (&seen[..], y - dot(x, &first)));
        let then = weights(&left.collect::<Vec<_>>())?;
        let sum = |(column, (seen, _)): (&f64, &(Vec<f64>, f64))| column + dot(seen, &then);
        Some(by_column[one].iter().zip(&driver[one]).map(sum).collect())
    };
    let both: Vec<Vec<f64>> = (0..segments.len()).map(both).collect::<Option<_>>()?;
    Some(vec![
        judged(Model::Column, None, &column, &by_column),
        judged(Model::ColumnThenDriver, None, &column, &both),
        judged(Model::Driver, None, &driver, &by_driver),
    ])
}

/// Predictions of the torque so far ahead.
fn ahead(segments: &[Segment], ahead_s: f64) -> Option<Vec<Judged>> {
    let far = |s: &Segment| (ahead_s / s.step_s).round() as usize;
    let past = |s: &Segment, stretch: &Stretch, k: usize, lags: &[usize]| -> Vec<f64> {
        lags.iter()
            .map(|steps| stretch.torque[k - s.rows(*steps)])
            .collect()
    };
    let samples = |of: &dyn Fn(&Segment, &Stretch, usize) -> Vec<f64>| -> Vec<Samples> {
        segments.iter().map(|s| s.samples(far(s), of)).collect()
    };
    let last = samples(&|s, stretch, k| past(s, stretch, k, &[0]));
    let own = samples(&|s, stretch, k| past(s, stretch, k, &PAST));
    let road = samples(&|s, stretch, k| {
        let seen = ROAD.map(|steps| stretch.road[k - s.rows(steps)]).concat();
        [past(s, stretch, k, &PAST), seen].concat()
    });
    let stays: Vec<Vec<f64>> = last
        .iter()
        .map(|rows| rows.iter().map(|row| row.0[0]).collect())
        .collect();
    let series: Vec<Vec<Series>> = segments.iter().map(|s| s.series(far(s))).collect();
    let box_jenkins = |one: usize| {
        let model = BoxJenkins::fitted(&others(&series, one).flatten().collect::<Vec<_>>())?;
        Some(segments[one].by(&model, &series[one], far(&segments[one])))
    };
    let all = samples(&|s, stretch, k| {
        let inputs = INPUTS.map(|steps| stretch.inputs(k - s.rows(steps)).collect::<Vec<f64>>());
        [past(s, stretch, k, &PAST), inputs.concat()].concat()
    });
    let rows: Vec<(&[f64], f64)> = all.iter().flatten().map(|(x, y)| (&x[..], *y)).collect();
    let there = weights(&rows)?;
    let there = all
        .iter()
        .map(|rows| rows.iter().map(|(x, _)| dot(x, &there)).collect::<Vec<f64>>());
    Some(vec![
        judged(Model::Persistence, Some(ahead_s), &last, &stays),
        judged(Model::OwnPast, Some(ahead_s), &own, &left_out(&own)?),
        judged(Model::Road, Some(ahead_s), &road, &left_out(&road)?),
        Judged {
            model: Model::BoxJenkins,
            ahead_s: Some(ahead_s),
            accounted: (0..segments.len()).map(box_jenkins).collect::<Option<_>>()?,
        },
        judged(Model::Ceiling, Some(ahead_s), &all, &there.collect::<Vec<_>>()),
    ])
}

/// Every vehicle with enough segments, by hand and shared.
pub(super) fn pooled(found: Vec<(String, Segment)>) -> Vec<Pooled> {
    let mut vehicles: BTreeMap<(String, bool), Vec<Segment>> = BTreeMap::new();
    for (vehicle, segment) in found {
        vehicles
            .entry((vehicle, !segment.by_hand))
            .or_default()
            .push(segment);
    }
    let vehicles = vehicles
        .into_iter()
        .filter(|(_, segments)| segments.len() >= FEWEST);
    let of = |((vehicle, shared), segments): ((String, bool), Vec<Segment>)| {
        let mut models = now(&segments)?;
        for ahead_s in AHEAD_S {
            models.extend(ahead(&segments, ahead_s)?);
        }
        Some(Pooled {
            vehicle,
            by_hand: !shared,
            seconds: segments.iter().map(Segment::seconds).sum(),
            segments: segments.into_iter().map(|s| s.file).collect(),
            models,
        })
    };
    vehicles.filter_map(of).collect()
}
