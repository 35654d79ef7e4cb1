//! The closed loop through its public interface.

mod changing_speed;
mod own_law;
mod unguided;
