//! Variables of a model: the one list that both standards' descriptions and every access follow from.

/// What a variable is to FMI.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Set by others at every step.
    Input,
    /// Read after it.
    Output,
    /// Set before the start.
    Parameter,
    /// Set before the start, and between steps where the model takes it.
    Tunable,
}

/// The type of a variable; all are kept as numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A quantity.
    Real,
    /// A code or a word of bits.
    Integer,
    /// 0 or 1.
    Boolean,
}

/// One variable; its value reference is its place in the model's list.
#[derive(Debug, Clone, Copy)]
pub struct Variable {
    /// Name, with its unit.
    pub name: &'static str,
    /// Type.
    pub kind: Kind,
    /// Role.
    pub role: Role,
    /// SI unit, empty if it has none.
    pub unit: &'static str,
    /// Value at the start.
    pub start: f64,
    /// Least and largest value, if there are such.
    pub range: Option<[f64; 2]>,
    /// What it is.
    pub meaning: &'static str,
}

/// A variable that starts at zero and has no range.
#[must_use]
pub const fn variable(
    name: &'static str,
    kind: Kind,
    role: Role,
    unit: &'static str,
    meaning: &'static str,
) -> Variable {
    Variable {
        name,
        kind,
        role,
        unit,
        start: 0.0,
        range: None,
        meaning,
    }
}

/// A parameter with its start and range.
#[must_use]
pub const fn parameter(
    name: &'static str,
    unit: &'static str,
    start: f64,
    range: [f64; 2],
    meaning: &'static str,
) -> Variable {
    Variable {
        start,
        range: Some(range),
        ..variable(name, Kind::Real, Role::Parameter, unit, meaning)
    }
}

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

/// A model under way, moved in steps of 1 ms. The values are those of [`About::variables`].
pub trait Model: Send {
    /// Begins with the parameters that were set, and gives the outputs of the start.
    ///
    /// # Errors
    /// A parameter that cannot be, with its name.
    fn begin(&mut self, values: &mut [f64]) -> Result<(), String>;

    /// One step of 1 ms under the inputs; writes the outputs.
    ///
    /// # Errors
    /// Why there is no next step.
    fn step(&mut self, values: &mut [f64]) -> Result<(), String>;

    /// Takes tunable parameters that were set since the start.
    ///
    /// # Errors
    /// Why they cannot be, or not now.
    fn tune(&mut self, _values: &[f64]) -> Result<(), String> {
        Err("it cannot be set now".into())
    }

    /// The same again, for a state that is taken.
    fn copy(&self) -> Box<dyn Model>;
}
