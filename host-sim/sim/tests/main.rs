//! The closed loop through its public interface.

mod changing_speed;
mod driver_limit;
mod fdca;
mod own_law;
mod shipped_laws;
mod slow_and_tight;
mod unguided;
