//! Why a unit refuses: what the importing tool then prints.

use haptic_core::controller::params::ParamError;
use haptic_core::safety::modes::Mode;
use haptic_sim::input::{InputError, RangeError};
use haptic_sim::scenario::ScenarioError;

use crate::variable::Kind;

/// Why a unit refuses. It stays as it was.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FmuError {
    /// A value outside its range.
    #[error(transparent)]
    Range(#[from] RangeError),
    /// Parameters of the controller that cannot be.
    #[error("{0}")]
    Setup(ParamError),
    /// Numbers that are no table of a scenario.
    #[error(transparent)]
    Fields(#[from] haptic_sim::fields::NotATable),
    /// Parameters of the vehicle that cannot be.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// A road or a column that cannot be.
    #[error("{0} = {1}")]
    Text(&'static str, InputError),
    /// A value that is not finite: name and value.
    #[error("{0} = {1} is no finite number")]
    NotFinite(&'static str, f64),
    /// A variable that others than the importing tool set, or that is set before the start.
    #[error("{0} cannot be set now")]
    NotNow(&'static str),
    /// What the model says of a variable that was set.
    #[error("{0}: {1}")]
    Variable(&'static str, Box<Self>),
    /// No variable of this type has this value reference.
    #[error("value reference {0} is no {1:?} variable")]
    Reference(u32, Kind),
    /// Fewer places than variables: variables, places.
    #[error("{0} variables for {1} values")]
    Places(usize, usize),
    /// Another step than whole milliseconds, s.
    #[error("communicationStepSize = {0} s is no multiple of 0.001 s")]
    StepSize(f64),
    /// The mode in which the ECU takes no parameters.
    #[error("the ECU takes parameters in Boot and in Standby, and is in {0:?}")]
    Mode(Mode),
    /// Where the vehicle left the road, m.
    #[error("the vehicle has left the road, at {0:.1} m")]
    LeftRoad(f64),
    /// An output that is not what it was when a state was written: name, value now, value then.
    #[error("{0} is {1}, and was {2}")]
    Differs(&'static str, f64, f64),
    /// Why a state that was written cannot be reached again.
    #[error("the state cannot be driven to again: {0}")]
    State(Box<Self>),
    /// A text whose bytes are not UTF-8: value reference.
    #[error("value reference {0}: the text is not UTF-8")]
    NotUtf8(u32),
    /// A parameter that this model takes before the start only.
    #[error("it cannot be set after the start")]
    NotTunable,
    /// A step before the start.
    #[error("a step before the end of the initialization")]
    NotStarted,
    /// A step beyond the end of the course.
    #[error("the course has ended")]
    Ended,
    /// Fewer values than the model has variables: their number.
    #[error("{0} values are too few for the model's variables")]
    MissingValues(usize),
    /// A variable that a saved state names and the model does not have: its index.
    #[error("the state sets variable {0}, which this model does not have")]
    UnknownVariable(usize),
    /// A state after a drive that is too long to be saved.
    #[error("the drive is too long for its state to be saved as bytes; it can still be taken and given back")]
    TooLongToSave,
    /// Bytes that are not a state of this version of this model.
    #[error("these bytes are not a state that this version of this model has saved")]
    NotAState,
    /// A saved state that is not complete.
    #[error("the state is cut short, or of another kind")]
    CutShort,
}
