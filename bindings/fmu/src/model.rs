//! What a model is to the importing tool, and what the unit asks of it.

use std::path::PathBuf;

use crate::error::FmuError;
use crate::variable::Variable;

/// A model as an importing tool sees it.
pub struct About {
    /// Name of the model and of its binary.
    pub name: &'static str,
    /// Identifies model and variables; another list of variables is another token.
    pub token: &'static str,
    /// What it is.
    pub meaning: &'static str,
    /// Every variable.
    pub variables: &'static [Variable],
    /// One that was not started.
    pub make: fn() -> Box<dyn Model>,
}

/// The texts that were set.
#[derive(Debug, Clone)]
pub struct Texts {
    /// One for each of [`About::variables`], empty if that is none.
    pub texts: Vec<String>,
    /// The folder `resources` of the unpacked unit.
    pub resources: PathBuf,
}

/// A model under way, moved in steps of 1 ms. The values are those of [`About::variables`].
pub trait Model: Send {
    /// Begins with the parameters that were set, and gives the outputs of the start.
    ///
    /// # Errors
    /// A parameter that cannot be, with its name.
    fn begin(&mut self, values: &mut [f64], texts: &Texts) -> Result<(), FmuError>;

    /// One step of 1 ms under the inputs; writes the outputs.
    ///
    /// # Errors
    /// Why there is no next step.
    fn step(&mut self, values: &mut [f64]) -> Result<(), FmuError>;

    /// Takes tunable parameters that were set since the start.
    ///
    /// # Errors
    /// Why they cannot be, or not now.
    fn tune(&mut self, _values: &[f64]) -> Result<(), FmuError> {
        Err(FmuError::NotTunable)
    }

    /// A copy of the model, for a state that is taken.
    fn copy(&self) -> Box<dyn Model>;
}
