//! One model under way, whatever the standard: values by reference, steps of whole milliseconds, states, and refusals that
//! leave everything as it was.

use crate::MODELS;
use crate::variable::{About, Kind, Model, Role};

/// Longest communication step, ms: an hour.
const MOST_STEPS: f64 = 3_600_000.0;

/// Everything that evolves.
pub(crate) struct State {
    values: Vec<f64>,
    model: Box<dyn Model>,
    /// Steps so far, 1 ms each: time is a whole number here, whatever a master adds up.
    steps: u64,
    started: bool,
}

impl Clone for State {
    fn clone(&self) -> Self {
        Self {
            values: self.values.clone(),
            model: self.model.copy(),
            ..*self
        }
    }
}

/// A model with its state.
pub(crate) struct Instance {
    about: &'static About,
    pub(crate) state: State,
}

impl Instance {
    /// The model of a token.
    pub(crate) fn new(token: &str) -> Option<Self> {
        let about = *MODELS.iter().find(|about| about.token == token)?;
        Some(Self {
            about,
            state: start(about),
        })
    }

    pub(crate) fn reset(&mut self) {
        self.state = start(self.about);
    }

    /// Values of one type; the reference behind the last one is the time.
    pub(crate) fn get(
        &self,
        references: &[u32],
        kind: Kind,
        mut put: impl FnMut(usize, f64),
    ) -> Result<(), String> {
        for (i, &reference) in references.iter().enumerate() {
            match self.about.variables.get(reference as usize) {
                Some(variable) if variable.kind == kind => put(i, self.state.values[reference as usize]),
                None if reference as usize == self.about.variables.len() && kind == Kind::Real => {
                    put(i, self.time_s());
                }
                _ => return Err(format!("value reference {reference} is no {kind:?} variable")),
            }
        }
        Ok(())
    }

    /// Sets all values, or none. Tunable parameters that are set together are taken together.
    pub(crate) fn set(
        &mut self,
        references: &[u32],
        kind: Kind,
        value: impl Fn(usize) -> f64,
    ) -> Result<(), String> {
        let mut values = self.state.values.clone();
        let mut tuned = None;
        for (i, &reference) in references.iter().enumerate() {
            let variable = self
                .about
                .variables
                .get(reference as usize)
                .filter(|v| v.kind == kind);
            let variable =
                variable.ok_or_else(|| format!("value reference {reference} is no {kind:?} variable"))?;
            let (name, value) = (variable.name, value(i));
            if variable.role == Role::Output || (variable.role == Role::Parameter && self.state.started) {
                return Err(format!("{name} cannot be set now"));
            }
            if !value.is_finite() {
                return Err(format!("{name} = {value} is no finite number"));
            }
            if let Some([min, max]) = variable.range
                && !(min..=max).contains(&value)
            {
                return Err(format!(
                    "{name} = {value} is outside {min} to {max} {}",
                    variable.unit
                ));
            }
            values[reference as usize] = value;
            if variable.role == Role::Tunable && self.state.started {
                tuned = Some(name);
            }
        }
        if let Some(name) = tuned {
            // A model that refuses stays as it was.
            let mut model = self.state.model.copy();
            model.tune(&values).map_err(|why| format!("{name}: {why}"))?;
            self.state.model = model;
        }
        self.state.values = values;
        Ok(())
    }

    /// The parameters take hold.
    pub(crate) fn begin(&mut self) -> Result<(), String> {
        let mut state = self.state.clone();
        state.model.begin(&mut state.values)?;
        state.started = true;
        self.state = state;
        Ok(())
    }

    /// Moves by a whole number of milliseconds, or not at all; inputs hold meanwhile.
    pub(crate) fn advance(&mut self, step_s: f64) -> Result<(), String> {
        let steps = (step_s * 1e3).round();
        if !(1.0..=MOST_STEPS).contains(&steps) || (step_s * 1e3 - steps).abs() > 1e-6 {
            return Err(format!(
                "communicationStepSize = {step_s} s is no multiple of 0.001 s"
            ));
        }
        if !self.state.started {
            return Err("a step before the end of the initialization".into());
        }
        // The step that could fail is the one to go back from; the controller's never fails.
        let before = (steps > 1.0).then(|| self.state.clone());
        for _ in 0..steps as u32 {
            let values = self.state.values.clone();
            if let Err(why) = self.state.model.step(&mut self.state.values) {
                self.state.values = values;
                if let Some(before) = before {
                    self.state = before;
                }
                return Err(why);
            }
            self.state.steps += 1;
        }
        Ok(())
    }

    /// Time that was simulated, s.
    pub(crate) fn time_s(&self) -> f64 {
        self.state.steps as f64 * 1e-3
    }
}

fn start(about: &'static About) -> State {
    State {
        values: about.variables.iter().map(|variable| variable.start).collect(),
        model: (about.make)(),
        steps: 0,
        started: false,
    }
}
