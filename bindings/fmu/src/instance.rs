//! A running instance of a model, for both FMI standards: values by reference, steps of whole milliseconds, saved
//! states. A call that is refused leaves the instance as it was.
//!
//! A state is saved as the list of all inputs since the start. Reading it drives another unit through the same
//! inputs, to the same bits.

use std::path::PathBuf;

use crate::error::FmuError;
use haptic_sim::input::in_range;

use crate::MODELS;
use crate::history::{Group, History, MOST_STEPS as MOST_STEPS_OF_A_STATE, Reader};
use crate::model::{About, Model, Texts};
use crate::variable::{Kind, Role};

/// Longest communication step, ms: an hour.
const MOST_STEPS: f64 = 3_600_000.0;

/// First line of a saved state; the token of its model and the version of the program follow.
const FORM: &str = "haptic-guidance FMU state 1";

/// Everything that changes during a run.
pub(crate) struct State {
    values: Vec<f64>,
    texts: Texts,
    model: Box<dyn Model>,
    /// Steps so far, 1 ms each. Time is counted in whole steps, so that rounding errors in a master's sum of step
    /// sizes do not matter.
    steps: u64,
    /// The values at the start, once it has started.
    begun: Option<Vec<f64>>,
    /// Values of the step before.
    held: Vec<f64>,
    history: History,
}

impl Clone for State {
    fn clone(&self) -> Self {
        Self {
            values: self.values.clone(),
            texts: self.texts.clone(),
            model: self.model.copy(),
            steps: self.steps,
            begun: self.begun.clone(),
            held: self.held.clone(),
            history: self.history.clone(),
        }
    }
}

impl State {
    fn new(about: &'static About, resources: PathBuf) -> Self {
        let values: Vec<f64> = about.variables.iter().map(|variable| variable.start).collect();
        let texts = about.variables.iter().map(|variable| variable.text.into());
        Self {
            held: values.clone(),
            values,
            texts: Texts {
                texts: texts.collect(),
                resources,
            },
            model: (about.make)(),
            steps: 0,
            begun: None,
            history: History::default(),
        }
    }

    /// Starts the model with the parameters as they are set.
    fn begin(&mut self) -> Result<(), FmuError> {
        let begun = self.values.clone();
        self.model.begin(&mut self.values, &self.texts)?;
        self.held.clone_from(&begun);
        self.begun = Some(begun);
        Ok(())
    }

    /// One step, or none.
    fn step(&mut self, about: &About) -> Result<(), FmuError> {
        let before = self.values.clone();
        if let Err(why) = self.model.step(&mut self.values) {
            self.values = before;
            return Err(why);
        }
        let differs = |reference: &usize| {
            about.variables[*reference].role == Role::Input
                && before[*reference].to_bits() != self.held[*reference].to_bits()
        };
        let changed = (0..before.len()).filter(differs);
        self.history.add(
            self.steps,
            changed.map(|reference| (reference, before[reference])),
        );
        self.held = before;
        self.steps += 1;
        Ok(())
    }

    /// Takes tunable parameters that were set: the model starts anew. History keeps them even if their values are the
    /// same.
    fn tune(&mut self, references: &[usize]) -> Result<(), FmuError> {
        self.model.tune(&self.values)?;
        let tuned = references
            .iter()
            .map(|&reference| (reference, self.values[reference]));
        self.history.add(self.steps, tuned);
        Ok(())
    }

    /// Drives to the step at which a group of values was set, and sets them.
    fn take(&mut self, about: &About, group: &Group) -> Result<(), FmuError> {
        while self.steps < group.step {
            self.step(about)?;
        }
        let mut tuned = Vec::new();
        for &(reference, value) in &group.values {
            let variable = about
                .variables
                .get(reference)
                .ok_or(FmuError::UnknownVariable(reference))?;
            self.values[reference] = value;
            if variable.role == Role::Tunable {
                tuned.push(reference);
            }
        }
        if tuned.is_empty() {
            Ok(())
        } else {
            self.tune(&tuned)
        }
    }
}

/// A model with its state.
pub(crate) struct Instance {
    about: &'static About,
    pub(crate) state: State,
}

impl Instance {
    /// The model of a token, with the folder of its resources.
    pub(crate) fn new(token: &str, resources: PathBuf) -> Option<Self> {
        let about = *MODELS.iter().find(|about| about.token == token)?;
        Some(Self {
            about,
            state: State::new(about, resources),
        })
    }

    pub(crate) fn reset(&mut self) {
        self.state = State::new(self.about, self.state.texts.resources.clone());
    }

    /// The values of text variables; an error for one gives none.
    pub(crate) fn texts(&self, references: &[u32]) -> Result<Vec<&str>, FmuError> {
        let text = |&reference: &u32| {
            let place = self.place(reference, Kind::Text)?;
            Ok(self.state.texts.texts[place].as_str())
        };
        references.iter().map(text).collect()
    }

    /// Sets text variables; an error for one sets none.
    pub(crate) fn set_texts(&mut self, given: Vec<(u32, String)>) -> Result<(), FmuError> {
        let mut texts = self.state.texts.texts.clone();
        for (reference, text) in given {
            let place = self.place(reference, Kind::Text)?;
            if self.state.begun.is_some() {
                return Err(FmuError::NotNow(self.about.variables[place].name));
            }
            texts[place] = text;
        }
        self.state.texts.texts = texts;
        Ok(())
    }

    /// The index of a variable that has this type.
    fn place(&self, reference: u32, kind: Kind) -> Result<usize, FmuError> {
        let found = self.about.variables.get(reference as usize);
        found
            .filter(|variable| variable.kind == kind)
            .map(|_| reference as usize)
            .ok_or(FmuError::Reference(reference, kind))
    }

    /// The values of variables of one type. The reference after the last variable's is the time.
    pub(crate) fn get(
        &self,
        references: &[u32],
        kind: Kind,
        mut put: impl FnMut(usize, f64),
    ) -> Result<(), FmuError> {
        for (i, &reference) in references.iter().enumerate() {
            if reference as usize == self.about.variables.len() && kind == Kind::Real {
                put(i, self.time_s());
            } else {
                put(i, self.state.values[self.place(reference, kind)?]);
            }
        }
        Ok(())
    }

    /// Sets all values; an error for one sets none. Tunable parameters that are set together take effect together.
    pub(crate) fn set(
        &mut self,
        references: &[u32],
        kind: Kind,
        value: impl Fn(usize) -> f64,
    ) -> Result<(), FmuError> {
        let mut values = self.state.values.clone();
        let (mut tuned, started) = (Vec::new(), self.state.begun.is_some());
        for (i, &reference) in references.iter().enumerate() {
            let place = self.place(reference, kind)?;
            let (variable, value) = (&self.about.variables[place], value(i));
            let name = variable.name;
            if variable.role == Role::Output || (variable.role == Role::Parameter && started) {
                return Err(FmuError::NotNow(name));
            }
            if !value.is_finite() {
                return Err(FmuError::NotFinite(name, value));
            }
            if let Some([min, max]) = variable.range {
                in_range(name, value, min..=max, variable.unit)?;
            }
            values[place] = value;
            if variable.role == Role::Tunable && started {
                tuned.push(place);
            }
        }
        let before = std::mem::replace(&mut self.state.values, values);
        if let Some(&first) = tuned.first() {
            // A model that refuses stays as it was.
            let model = self.state.model.copy();
            if let Err(why) = self.state.tune(&tuned) {
                (self.state.model, self.state.values) = (model, before);
                return Err(FmuError::Variable(
                    self.about.variables[first].name,
                    Box::new(why),
                ));
            }
        }
        Ok(())
    }

    /// The parameters take hold.
    pub(crate) fn begin(&mut self) -> Result<(), FmuError> {
        let mut state = self.state.clone();
        state.begin()?;
        self.state = state;
        Ok(())
    }

    /// Advances by a whole number of milliseconds with constant inputs; an error leaves everything as it was.
    pub(crate) fn advance(&mut self, step_s: f64) -> Result<(), FmuError> {
        let steps = (step_s * 1e3).round();
        if !(1.0..=MOST_STEPS).contains(&steps) || (step_s * 1e3 - steps).abs() > 1e-6 {
            return Err(FmuError::StepSize(step_s));
        }
        if self.state.begun.is_none() {
            return Err(FmuError::NotStarted);
        }
        // A single step that fails changes nothing; before several steps the state is saved to return to.
        let before = (steps > 1.0).then(|| self.state.clone());
        for _ in 0..steps as u32 {
            if let Err(why) = self.state.step(self.about) {
                if let Some(before) = before {
                    self.state = before;
                }
                return Err(why);
            }
        }
        Ok(())
    }

    /// A state as bytes, to be saved.
    pub(crate) fn written(&self, state: &State) -> Result<Vec<u8>, FmuError> {
        let history = state.history.to_bytes().ok_or(FmuError::TooLongToSave)?;
        let head = format!("{FORM}\n{}\n{}\n", self.about.token, env!("CARGO_PKG_VERSION"));
        let mut bytes = head.into_bytes();
        bytes.push(state.begun.is_some().into());
        bytes.extend(state.steps.to_le_bytes());
        for value in state
            .begun
            .as_ref()
            .unwrap_or(&state.values)
            .iter()
            .chain(&state.values)
        {
            bytes.extend(value.to_le_bytes());
        }
        for text in &state.texts.texts {
            bytes.extend((text.len() as u32).to_le_bytes());
            bytes.extend(text.as_bytes());
        }
        bytes.extend(history);
        Ok(bytes)
    }

    /// Reads a state that this version of this model has saved.
    pub(crate) fn read(&self, bytes: &[u8]) -> Result<State, FmuError> {
        let head = format!("{FORM}\n{}\n{}\n", self.about.token, env!("CARGO_PKG_VERSION"));
        let body = bytes.strip_prefix(head.as_bytes()).ok_or(FmuError::NotAState)?;
        self.driven(body)
            .ok_or(FmuError::CutShort)?
            .map_err(|why| FmuError::State(Box::new(why)))
    }

    /// Drives a new unit to a saved state; `None` if the bytes are not one.
    fn driven(&self, body: &[u8]) -> Option<Result<State, FmuError>> {
        let mut from = Reader(body);
        let [started] = from.number()?;
        let steps = u64::from_le_bytes(from.number()?);
        let count = self.about.variables.len();
        let (begun, values) = (from.values(count)?, from.values(count)?);
        let mut state = State::new(self.about, self.state.texts.resources.clone());
        for text in &mut state.texts.texts {
            *text = from.text()?;
        }
        if steps > MOST_STEPS_OF_A_STATE {
            return None;
        }
        state.values = begun;
        if started == 0 {
            return (steps == 0 && from.0.is_empty()).then_some(Ok(state));
        }
        if let Err(why) = state.begin() {
            return Some(Err(why));
        }
        let mut at = 0;
        while !from.0.is_empty() {
            let group = from.group(at).filter(|group| group.step <= steps)?;
            at = group.step;
            if let Err(why) = state.take(self.about, &group) {
                return Some(Err(why));
            }
        }
        let nothing = Group {
            step: steps,
            values: Vec::new(),
        };
        if let Err(why) = state.take(self.about, &nothing) {
            return Some(Err(why));
        }
        // Values that were set after the last step; outputs have to be those of that time.
        for (place, variable) in self.about.variables.iter().enumerate() {
            if variable.role != Role::Output {
                state.values[place] = values[place];
            } else if state.values[place].to_bits() != values[place].to_bits() {
                let [then, now] = [values[place], state.values[place]];
                return Some(Err(FmuError::Differs(variable.name, now, then)));
            }
        }
        Some(Ok(state))
    }

    /// Simulated time, s.
    pub(crate) fn time_s(&self) -> f64 {
        self.state.steps as f64 * 1e-3
    }
}
