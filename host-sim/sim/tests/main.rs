//! The closed loop through its public interface.

mod changing_speed;
mod unguided;
