//! Closed loops side by side, for environments that train an agent: many are moved in one call, on every core, without
//! the interpreter's lock.

use haptic_log::trace::{CHANNELS, Sample};
use haptic_sim::Action;
use haptic_sim::simulation::{Ending, STEPS_PER_SAMPLE};
use numpy::{PyArray1, PyArray2, PyReadonlyArray1};
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
        let ending = self.look(action);
        (costs.map(|sum| sum / f64::max(samples, 1.0)), ending)
    }

    /// The truth of this instant, which is that at the start of the next step: a clone takes it.
    fn look(&mut self, action: &Action) -> u8 {
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

    fn seen(&self) -> impl Iterator<Item = f64> {
        CHANNELS.iter().map(|channel| (channel.value)(&self.seen))
    }
}

type Stepped<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<u8>>,
);

#[pymethods]
impl Simulations {
    #[new]
    fn new(py: Python<'_>, count: i64) -> PyResult<Self> {
        within(py, "num_envs", count as f64, [1.0, 65_536.0], "")?;
        Ok(Self {
            loops: (0..count).map(|_| None).collect(),
        })
    }

    /// Names of the columns of what is seen.
    #[staticmethod]
    fn channels() -> Vec<&'static str> {
        CHANNELS.iter().map(|channel| channel.name).collect()
    }

    /// Begins loop `index` anew with a seed of its own; what is seen.
    fn begin<'py>(
        &mut self,
        py: Python<'py>,
        index: usize,
        scenario: &Scenario,
        seed: u64,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
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
        begun.look(&Action::default());
        let seen = begun.seen().collect();
        *place = Some(begun);
        Ok(PyArray1::from_vec(py, seen))
    }

    /// Moves those loops that are `active` by `steps` milliseconds, each under its hand and its authority; what is seen
    /// of all, means of their costs, and how they ended.
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
        if steps == 0 || !steps.is_multiple_of(STEPS_PER_SAMPLE) {
            return Err(errors::input(
                py,
                format!("steps = {steps} is no multiple of {STEPS_PER_SAMPLE}"),
            ));
        }
        let mut actions = Vec::with_capacity(count);
        for (index, place) in self.loops.iter().enumerate() {
            if active[index] && place.is_none() {
                return Err(errors::input(py, format!("loop {index} was not begun")));
            }
            let action = Action {
                hand_torque_nm: finite(py, "hand_torque_nm", hand[index], "N.m")?,
                authority: Some(within(py, "authority", authority[index], [0.0, 1.0], "")?),
                ..Action::default()
            };
            actions.push(active[index].then_some(action));
        }
        let one = |(place, action): (&mut Option<Loop>, &Option<Action>)| match (place, action) {
            (Some(under_way), Some(action)) => under_way.step(action, steps),
            _ => ([0.0; COSTS], 0),
        };
        let loops = &mut self.loops;
        // A single one is quicker without other threads.
        let moved: Vec<([f64; COSTS], u8)> = py.detach(|| match loops.len() {
            1 => loops.iter_mut().zip(&actions).map(one).collect(),
            _ => loops.par_iter_mut().zip(&actions).map(one).collect(),
        });
        let nothing = || vec![f64::NAN; CHANNELS.len()];
        let seen: Vec<Vec<f64>> = self
            .loops
            .iter()
            .map(|place| {
                place
                    .as_ref()
                    .map_or_else(nothing, |under_way| under_way.seen().collect())
            })
            .collect();
        let costs: Vec<Vec<f64>> = moved.iter().map(|(costs, _)| costs.to_vec()).collect();
        let endings = moved.iter().map(|(_, ending)| *ending).collect();
        let table =
            |rows: &[Vec<f64>]| PyArray2::from_vec2(py, rows).map_err(|error| errors::input(py, error));
        Ok((table(&seen)?, table(&costs)?, PyArray1::from_vec(py, endings)))
    }
}
