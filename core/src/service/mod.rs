//! What a workshop or a test bench asks of the ECU: a new set of parameters over the bus ([`download`]), the copies in
//! non-volatile memory ([`stored`]), counts of rejected frames ([`rejections`]).
//!
//! Nothing here takes part in a step.

pub mod download;
pub mod rejections;
pub mod stored;
