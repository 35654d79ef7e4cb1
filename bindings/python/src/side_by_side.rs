//! Closed loops side by side, for environments that train an agent: many are moved in one call, on every core, without
//! the interpreter's lock.

use haptic_log::trace::{CHANNELS, Channel, Sample};
use haptic_sim::Action;
use haptic_sim::simulation::{Ending, STEPS_PER_SAMPLE};
use numpy::{FromVecError, PyArray1, PyArray2, PyReadonlyArray1};
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::errors::{self, finite, within};
use crate::scenario::Scenario;

/// What `step` sums up: how far off the lane's middle, how much effort, how much the two work against each other.
const COSTS: usize = 3;

/// Closed loops side by side. Loop `i` gives the bits of a `Simulation` of the same scenario under the same actions.
#[pyclass(module = "haptic_guidance._native")]
pub(crate) struct Simulations {
    loops: Vec<Option<Loop>>,
    /// What an agent sees, each with the largest magnitude.
    seen: Vec<(Channel, f64)>,
    /// What is told beside it.
    told: Vec<Channel>,
}

struct Loop {
    simulation: haptic_sim::Simulation,
    /// The last truth that there was: what is seen of a loop that has ended.
    seen: Sample,
}

impl Loop {
    /// Moves; means of the costs over the samples, and how it ended: 0 not, 1 at the end of the course, 2 diverged.
    fn step(&mut self, action: &Action, steps: u32) -> ([f64; COSTS], u8) {
        let (mut costs, mut samples) = ([0.0; COSTS], 0.0);
        for _ in 0..steps {
            let Some(outcome) = self.simulation.step(action) else {
                break;
            };
            let Some(sample) = outcome.sample else { continue };
            let (driver, guidance) = (sample.driver_torque_nm, sample.guidance_torque_nm);
            costs[0] += sample.lateral_error_m.powi(2);
            costs[1] += driver.powi(2);
            costs[2] += (-driver * guidance).max(0.0);
            samples += 1.0;
            self.seen = sample;
        }
        let ending = self.observe(action);
        (costs.map(|sum| sum / f64::max(samples, 1.0)), ending)
    }

    /// The truth of this instant, which is that at the start of the next step: a clone takes it.
    fn observe(&mut self, action: &Action) -> u8 {
        let mut ahead = self.simulation.clone();
        if let Some(sample) = ahead.step(action).and_then(|outcome| outcome.sample) {
            self.seen = sample;
        }
        match self.simulation.ending().or(ahead.ending()) {
            None => 0,
            Some(Ending::CourseEnd) => 1,
            Some(Ending::Diverged { .. }) => 2,
        }
    }
}

/// What a step of many loops gives: what is seen, what is told beside it, means of the costs, how each ended.
type Stepped<'py> = (
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<u8>>,
);
/// What a step of one loop gives, in that order.
type SteppedOne<'py> = (Bound<'py, PyArray1<f32>>, Vec<f64>, [f64; COSTS], u8);

impl Simulations {
    fn observed(&self, of: &Sample) -> Vec<f32> {
        let cut = |(channel, most): &(Channel, f64)| (channel.value)(of).clamp(-most, *most) as f32;
        self.seen.iter().map(cut).collect()
    }

    fn told(&self, of: &Sample) -> Vec<f64> {
        self.told.iter().map(|channel| (channel.value)(of)).collect()
    }

    fn under_way(&mut self, py: Python<'_>, index: usize) -> PyResult<&mut Loop> {
        let place = self.loops.get_mut(index).and_then(Option::as_mut);
        place.ok_or_else(|| errors::input(py, format!("loop {index} was not begun")))
    }
}

/// A channel by its name.
fn channel(py: Python<'_>, name: &str) -> PyResult<Channel> {
    let found = CHANNELS.into_iter().find(|channel| channel.name == name);
    found.ok_or_else(|| errors::unknown(py, "channels", name, &CHANNELS.each_ref().map(|c| c.name)))
}

fn action(py: Python<'_>, hand_torque_nm: f64, authority: f64) -> PyResult<Action> {
    Ok(Action {
        hand_torque_nm: finite(py, "hand_torque_nm", hand_torque_nm, "N.m")?,
        authority: Some(within(py, "authority", authority, [0.0, 1.0], "")?),
        ..Action::default()
    })
}

fn check_steps(py: Python<'_>, steps: u32) -> PyResult<()> {
    if steps > 0 && steps.is_multiple_of(STEPS_PER_SAMPLE) {
        return Ok(());
    }
    let message = format!("steps = {steps} is no multiple of {STEPS_PER_SAMPLE}");
    Err(errors::input(py, message))
}

#[pymethods]
impl Simulations {
    #[new]
    fn new(py: Python<'_>, count: i64, seen: Vec<(String, f64)>, told: Vec<String>) -> PyResult<Self> {
        within(py, "num_envs", count as f64, [1.0, 65_536.0], "")?;
        let seen = seen.iter().map(|(name, most)| Ok((channel(py, name)?, *most)));
        let told = told.iter().map(|name| channel(py, name));
        Ok(Self {
            loops: (0..count).map(|_| None).collect(),
            seen: seen.collect::<PyResult<_>>()?,
            told: told.collect::<PyResult<_>>()?,
        })
    }

    /// Begins loop `index` anew with a seed of its own; what is seen, and what is told beside it.
    fn begin<'py>(
        &mut self,
        py: Python<'py>,
        index: usize,
        scenario: &Scenario,
        seed: u64,
    ) -> PyResult<(Bound<'py, PyArray1<f32>>, Vec<f64>)> {
        let built = scenario.inner.to_builder().seed(seed).build();
        let scenario = built.map_err(|error| errors::scenario(py, &error))?;
        scenario
            .check_times()
            .map_err(|error| errors::scenario(py, &error))?;
        let count = self.loops.len();
        let Some(place) = self.loops.get_mut(index) else {
            return Err(errors::input(py, format!("there is no loop {index} of {count}")));
        };
        let mut begun = Loop {
            simulation: haptic_sim::Simulation::new(&scenario),
            seen: Sample::default(),
        };
        begun.observe(&Action::default());
        let sample = begun.seen;
        *place = Some(begun);
        Ok((PyArray1::from_vec(py, self.observed(&sample)), self.told(&sample)))
    }

    /// Moves one loop by `steps` milliseconds, as `step` moves all.
    fn step_one<'py>(
        &mut self,
        py: Python<'py>,
        index: usize,
        hand_torque_nm: f64,
        authority: f64,
        steps: u32,
    ) -> PyResult<SteppedOne<'py>> {
        let action = action(py, hand_torque_nm, authority)?;
        check_steps(py, steps)?;
        let moved = self.under_way(py, index)?;
        let (costs, ending) = py.detach(|| moved.step(&action, steps));
        let sample = moved.seen;
        let observed = PyArray1::from_vec(py, self.observed(&sample));
        Ok((observed, self.told(&sample), costs, ending))
    }

    /// Moves those loops that are `active` by `steps` milliseconds, each under its hand and its authority; what is seen of all
    /// and told beside it, means of their costs, and how they ended.
    fn step<'py>(
        &mut self,
        py: Python<'py>,
        hand_torque_nm: PyReadonlyArray1<'py, f64>,
        authority: PyReadonlyArray1<'py, f64>,
        active: PyReadonlyArray1<'py, bool>,
        steps: u32,
    ) -> PyResult<Stepped<'py>> {
        let (hand, authority, active) = (hand_torque_nm.as_array(), authority.as_array(), active.as_array());
        let count = self.loops.len();
        if [hand.len(), authority.len(), active.len()] != [count; 3] {
            return Err(errors::input(py, format!("{count} actions are wanted")));
        }
        check_steps(py, steps)?;
        let mut actions = Vec::with_capacity(count);
        for index in 0..count {
            let wanted = action(py, hand[index], authority[index])?;
            if active[index] {
                self.under_way(py, index)?;
            }
            actions.push(active[index].then_some(wanted));
        }
        let one = |(place, action): (&mut Option<Loop>, &Option<Action>)| match (place, action) {
            (Some(under_way), Some(action)) => under_way.step(action, steps),
            _ => ([0.0; COSTS], 0),
        };
        let loops = &mut self.loops;
        let moved: Vec<_> = py.detach(|| loops.par_iter_mut().zip(&actions).map(one).collect());
        // What is seen of a loop that was never begun does not count.
        let samples = self
            .loops
            .iter()
            .map(|place| place.as_ref().map_or_else(Sample::default, |at| at.seen));
        let (seen, told): (Vec<_>, Vec<_>) = samples.map(|of| (self.observed(&of), self.told(&of))).unzip();
        let costs: Vec<Vec<f64>> = moved.iter().map(|(costs, _)| costs.to_vec()).collect();
        let endings = moved.iter().map(|(_, ending)| *ending).collect();
        let ragged = |error: FromVecError| errors::input(py, error);
        Ok((
            PyArray2::from_vec2(py, &seen).map_err(ragged)?,
            PyArray2::from_vec2(py, &told).map_err(ragged)?,
            PyArray2::from_vec2(py, &costs).map_err(ragged)?,
            PyArray1::from_vec(py, endings),
        ))
    }
}
