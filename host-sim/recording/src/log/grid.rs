//! The time stamps of a log, and the even grid that its rows are put on.
//!
//! Three kinds of logs come: even ones; even ones of which rows are missing, whose rows keep their place on the grid; and
//! uneven ones, whose signals are read off at the grid's instants between their own. What is missing stays missing
//! here (no number): the preflight bridges it or cuts the drive there.

use haptic_log::recording::Lines;

use super::{GUIDANCE_COLUMN, LogError, SHORTEST_S, refuse, too_short};

/// A torque that changes faster than this, N.m/s, has switched: it is the fastest that the envelope allows.
pub const SWITCH_RATE_NM_S: f64 = 8.0;

/// Share of a sample period by which a time stamp may miss the even grid: rounding to a millisecond makes it 6 %
/// at 120 Hz and 12.5 % at 250 Hz.
const TIME_STAMP_TOLERANCE: f64 = 0.15;

/// Sample periods that are read, s: below 10 Hz the muscle's lag of 0.1 s is lost between two rows.
const SAMPLE_PERIOD_RANGE_S: (f64, f64) = (1e-4, 0.11);

/// Between uneven stamps that are farther apart than so many usual steps nothing is read off.
const LONGEST_STEP: f64 = 3.5;

/// Stamps that come in pairs, nearly at once, make no grid finer than this share of the usual step.
const LEAST_STEP: f64 = 0.5;

/// Share of the grid below which it does not count that lost rows are bridged.
const FEW: f64 = 0.15;

/// Values on the grid that are so many apart share no row.
const SHARED_LAGS: usize = 8;

/// An even grid and how the rows lie on it.
pub(super) struct Grid {
    pub start_s: f64,
    pub dt_s: f64,
    rows: usize,
    place: Place,
    /// What was found of the time stamps and done about it.
    pub finding: Option<[String; 3]>,
}

enum Place {
    /// Row k is at instant k.
    Even,
    /// Row k is at this instant.
    Slots(Vec<usize>),
    /// Instants lie between rows; steps longer than this are gaps.
    Between(f64),
}

impl Grid {
    /// The grid for rows at `time`, usually `usual` apart.
    ///
    /// # Errors
    /// A time that is too short.
    pub(super) fn new(time: &[f64], usual: f64) -> Result<Self, LogError> {
        let span = time[time.len() - 1] - time[0];
        if span < SHORTEST_S {
            return refuse(too_short(span));
        }
        let longest = time.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max);
        let all: Vec<usize> = (0..time.len()).collect();
        // A lost row makes a step of two.
        if longest <= 1.5 * usual
            && let Some((start_s, dt_s)) = fits(time, &all)
        {
            let (rows, place, finding) = (time.len(), Place::Even, None);
            return Ok(Self {
                start_s,
                dt_s,
                rows,
                place,
                finding,
            });
        }
        // Stamps rounded to a millisecond make a poor period each, but a good one all together.
        let short: Vec<f64> = time
            .windows(2)
            .map(|w| w[1] - w[0])
            .filter(|&d| d <= 1.5 * usual)
            .collect();
        let period = (short.iter().sum::<f64>() / short.len().max(1) as f64).max(LEAST_STEP * usual);
        let mut slots = vec![0];
        for w in time.windows(2) {
            let steps = ((w[1] - w[0]) / period).round().max(1.0) as usize;
            slots.push(slots[slots.len() - 1] + steps);
        }
        let rows = slots[slots.len() - 1] + 1;
        if let Some((start_s, dt_s)) = fits(time, &slots) {
            let gaps = slots.windows(2).filter(|w| w[1] - w[0] > 1).count();
            let most = slots.windows(2).map(|w| w[1] - w[0] - 1).max().unwrap_or(0);
            let finding = [
                "time_s".to_owned(),
                format!(
                    "{} rows lost in {gaps} gap{}, the longest of {:.2} s",
                    rows - time.len(),
                    if gaps == 1 { "" } else { "s" },
                    most as f64 * dt_s
                ),
                "bridged if short, else cut".to_owned(),
            ];
            let place = Place::Slots(slots);
            return Ok(Self {
                start_s,
                dt_s,
                rows,
                place,
                finding: Some(finding),
            });
        }
        let mut steps: Vec<f64> = time.windows(2).map(|w| w[1] - w[0]).collect();
        steps.retain(|&d| d <= LONGEST_STEP * usual);
        let dt_s = (steps.iter().sum::<f64>() / steps.len().max(1) as f64).max(LEAST_STEP * usual);
        let shortest = steps.iter().copied().fold(f64::INFINITY, f64::min);
        let gaps = time
            .windows(2)
            .filter(|w| w[1] - w[0] > LONGEST_STEP * usual)
            .count();
        let finding = [
            "time_s".to_owned(),
            format!("uneven: steps of {shortest:.4} to {longest:.4} s, {gaps} gaps"),
            format!("resampled at {:.2} Hz by the stamps", 1.0 / dt_s),
        ];
        // Stamps that limp about an even grid have that grid; others begin with their first.
        let (start_s, dt_s) = match line(time, &slots) {
            (start, dt, worst) if worst < 0.5 * dt => (start, dt),
            _ => (time[0], dt_s),
        };
        Ok(Self {
            start_s,
            dt_s,
            // Rounding must not push the last stamp off the grid.
            rows: ((time[time.len() - 1] - start_s) / dt_s + 1e-9) as usize + 1,
            place: Place::Between(LONGEST_STEP * usual),
            finding: Some(finding),
        })
    }

    /// Autocorrelation, from lag 1 on, that reading off between rows gives to noise that is white from row to row; empty
    /// where all rows, or nearly all beside a few lost ones, are taken as they are.
    pub(super) fn autocorrelation(&self, time: &[f64]) -> Vec<f64> {
        let (longest, is_cubic) = match &self.place {
            Place::Between(longest) => (*longest, true),
            // What is lost is bridged by lines.
            Place::Slots(_) => (LONGEST_STEP * self.dt_s, false),
            Place::Even => return Vec::new(),
        };
        // Across longer gaps nothing is read off, or the drive is cut.
        let near = self
            .places(time)
            .filter(|(k, _)| time[k + 1] - time[*k] <= longest);
        let weights: Vec<Weights> = near
            .map(|(k, t)| Weights::between(time, k, t, longest, |_| is_cubic))
            .collect();
        let read_off = weights
            .iter()
            .filter(|w| w.weight.iter().all(|w| *w < 1.0 - TIME_STAMP_TOLERANCE));
        if !is_cubic && (read_off.count() as f64) < FEW * weights.len() as f64 {
            return Vec::new();
        }
        let at = |lag: usize| -> f64 {
            weights
                .iter()
                .zip(&weights[lag.min(weights.len())..])
                .map(|(a, b)| a.shared(b))
                .sum()
        };
        let power = at(0);
        (1..=SHARED_LAGS).map(|lag| at(lag) / power).collect()
    }

    /// The instants of the grid, each with the row that it follows.
    fn places<'a>(&'a self, time: &'a [f64]) -> impl Iterator<Item = (usize, f64)> + 'a {
        let mut k = 0;
        (0..self.rows).map(move |row| {
            let t = self.start_s + row as f64 * self.dt_s;
            while k + 2 < time.len() && time[k + 1] <= t {
                k += 1;
            }
            (k, t)
        })
    }

    /// A column on the grid; no number where there is nothing to take it from.
    pub(super) fn put(&self, time: &[f64], column: Vec<f64>, c: usize) -> Vec<f64> {
        match &self.place {
            Place::Even => column,
            Place::Slots(slots) => {
                let mut out = vec![f64::NAN; self.rows];
                for (&slot, x) in slots.iter().zip(column) {
                    out[slot] = x;
                }
                out
            }
            Place::Between(longest) => self
                .places(time)
                .map(|(k, t)| {
                    if time[k + 1] - time[k] > *longest && t > time[k] && t < time[k + 1] {
                        return f64::NAN;
                    }
                    let step = column[k + 1] - column[k];
                    let switched =
                        c == GUIDANCE_COLUMN && step.abs() > SWITCH_RATE_NM_S * (time[k + 1] - time[k]);
                    if switched {
                        // It switched somewhere between the two.
                        let middle = 0.5 * (time[k] + time[k + 1]);
                        return if t < middle { column[k] } else { column[k + 1] };
                    }
                    Weights::between(time, k, t, *longest, |i| column[i].is_finite()).value(&column)
                })
                .collect(),
        }
    }
}

/// What rows add to a value between them.
struct Weights {
    first: usize,
    /// How much of each row from `first` on.
    weight: [f64; 4],
    count: usize,
}

impl Weights {
    /// Weights of the value at `t` between rows `k` and `k + 1`: on the cubic through four rows, or on the line where there
    /// are not four near each other.
    fn between(time: &[f64], k: usize, t: f64, longest: f64, known: impl Fn(usize) -> bool) -> Self {
        let whole = k >= 1
            && k + 2 < time.len()
            && time[k] - time[k - 1] <= longest
            && time[k + 2] - time[k + 1] <= longest
            && (k - 1..=k + 2).all(known);
        if !whole {
            let share = ((t - time[k]) / (time[k + 1] - time[k])).clamp(0.0, 1.0);
            let weight = [1.0 - share, share, 0.0, 0.0];
            return Self {
                first: k,
                weight,
                count: 2,
            };
        }
        // Lagrange's polynomial.
        let first = k - 1;
        let weight = std::array::from_fn(|i| {
            (0..4)
                .filter(|&j| j != i)
                .map(|j| (t - time[first + j]) / (time[first + i] - time[first + j]))
                .product()
        });
        Self {
            first,
            weight,
            count: 4,
        }
    }

    fn value(&self, u: &[f64]) -> f64 {
        let rows = &u[self.first..self.first + self.count];
        rows.iter().zip(&self.weight).map(|(u, w)| u * w).sum()
    }

    /// Covariance of two values if the rows' noise is white, over its variance.
    fn shared(&self, later: &Self) -> f64 {
        let rows = self.first.max(later.first)..(self.first + self.count).min(later.first + later.count);
        rows.map(|row| self.weight[row - self.first] * later.weight[row - later.first])
            .sum()
    }
}

/// The middle one of some values, whose order it changes; zero of none.
pub fn median(values: &mut [f64]) -> f64 {
    match values.len() {
        0 => 0.0,
        n => *values.select_nth_unstable_by(n / 2, f64::total_cmp).1,
    }
}

/// The median step of stamps that grow, in a range that can be.
///
/// # Errors
/// Time that does not grow, in another unit, of too few rows.
pub(super) fn usual_step(time: &[f64], lines: &Lines) -> Result<f64, LogError> {
    if time.len() < 3 {
        return refuse(format!("the log has {} rows, which is too few", time.len()));
    }
    let mut steps: Vec<f64> = time.windows(2).map(|w| w[1] - w[0]).collect();
    if let Some(k) = steps.iter().position(|&d| d.is_nan() || d <= 0.0) {
        return refuse(format!(
            "{}: time_s goes from {} to {}: it must grow",
            lines.place(k + 1),
            time[k],
            time[k + 1]
        ));
    }
    let usual = median(&mut steps);
    let (low, high) = SAMPLE_PERIOD_RANGE_S;
    if !(low..=high).contains(&usual) {
        return refuse(format!(
            "{}: the step of time_s is {usual}, outside {low} to {high} s: is it in ms?",
            lines.place(1)
        ));
    }
    Ok(usual)
}

/// Start and period of the even grid with `time` at its `slots`; none if a stamp misses it.
fn fits(time: &[f64], slots: &[usize]) -> Option<(f64, f64)> {
    let (start, dt, worst) = line(time, slots);
    (worst <= TIME_STAMP_TOLERANCE * dt).then_some((start, dt))
}

/// The line through `time` at its `slots` by least squares: start, period, and by how much a stamp misses it at most.
fn line(time: &[f64], slots: &[usize]) -> (f64, f64, f64) {
    let count = time.len() as f64;
    let middle = slots.iter().map(|&s| s as f64).sum::<f64>() / count;
    let (mut mean, mut product, mut square) = (0.0, 0.0, 0.0);
    for (&t, &slot) in time.iter().zip(slots) {
        let from_middle = slot as f64 - middle;
        mean += (t - time[0]) / count;
        product += from_middle * (t - time[0]);
        square += from_middle * from_middle;
    }
    let dt = product / square;
    let start = time[0] + mean - middle * dt;
    let missed = |(&t, &slot): (&f64, &usize)| (t - start - slot as f64 * dt).abs();
    let worst = time.iter().zip(slots).map(missed).fold(0.0, f64::max);
    (start, dt, worst)
}
