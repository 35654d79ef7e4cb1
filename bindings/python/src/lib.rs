//! The native part of the Python package `haptic_guidance`. No model and no maths: every call goes to the crate that
//! the command line uses too. What only arranges results is Python (`python/haptic_guidance`).

mod bus;
mod compare;
mod driver_view;
mod ecu;
mod errors;
mod experiment;
mod history;
mod identify;
mod interrupt;
mod pickle;
mod run;
mod scenario;
mod side_by_side;
mod simulation;
mod sweep;

use pyo3::pymodule;

#[pymodule]
mod _native {
    use haptic_core::bus::messages::{MESSAGES, is_input};
    use pyo3::prelude::*;
    use pyo3::types::PyFrozenSet;

    #[pymodule_export]
    use crate::bus::{Bus, Frame};
    #[pymodule_export]
    use crate::compare::{LawView, compare};
    #[pymodule_export]
    use crate::driver_view::DriverView;
    #[pymodule_export]
    use crate::ecu::{Ecu, Step, parameters};
    #[pymodule_export]
    use crate::experiment::experiment;
    #[pymodule_export]
    use crate::identify::identify;
    #[pymodule_export]
    use crate::run::{evaluate, metric_definitions, simulate};
    #[pymodule_export]
    use crate::scenario::Scenario;
    #[pymodule_export]
    use crate::side_by_side::Simulations;
    #[pymodule_export]
    use crate::simulation::{Action, Outcome, Simulation};
    #[pymodule_export]
    use crate::sweep::Sweep;

    /// The package's version, and identifiers of what the ECU hears, from the one list of messages.
    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        let ids = MESSAGES
            .iter()
            .map(|message| message.id)
            .filter(|id| is_input(*id));
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        module.add("INPUT_IDS", PyFrozenSet::new(module.py(), ids)?)
    }
}
