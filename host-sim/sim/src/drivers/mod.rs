//! Drivers of others and of ours, for comparison, and habits that any of them may have. The paper's driver in a car is
//! [`PaperDriver`](crate::parts::PaperDriver). `docs/reference/laws-and-drivers.md` has every equation with its source.
//!
//! A scenario's look-ahead, muscle (t_nms, K_nms) and remnant are those of every driver here, unless its own equation has others.

mod cybernetic;
mod habits;
mod paper;
mod relay;
#[cfg(test)]
mod tests;
mod two_point;

use crate::kind::{Kind, Make};
use crate::models::driver::Remnant;
use crate::parts::{Driver, DriverView};
use crate::scenario::Scenario;
use crate::seeds::Stream;

/// A driver behind a pointer that can be copied; every driver that is `Clone` is one.
pub trait AnyDriver: Driver + Send + Sync {
    /// The copy.
    fn boxed(&self) -> Box<dyn AnyDriver>;
}

impl<T: Driver + Clone + Send + Sync + 'static> AnyDriver for T {
    fn boxed(&self) -> Box<dyn AnyDriver> {
        Box::new(self.clone())
    }
}

impl Clone for Box<dyn AnyDriver> {
    fn clone(&self) -> Self {
        self.as_ref().boxed()
    }
}

impl Driver for Box<dyn AnyDriver> {
    fn look_ahead_s(&self) -> [f64; 2] {
        self.as_ref().look_ahead_s()
    }

    fn step(&mut self, view: &DriverView) -> f64 {
        self.as_mut().step(view)
    }

    fn k_hg(&self) -> Option<f64> {
        self.as_ref().k_hg()
    }
}

/// Every driver here.
pub const DRIVERS: [Kind<dyn AnyDriver>; 7] = [
    paper::KIND,
    paper::PARTICIPANT,
    paper::ADAPTING,
    cybernetic::KIND,
    cybernetic::CURVATURE,
    two_point::KIND,
    relay::KIND,
];

/// Every habit: what may be put around any driver.
pub const HABITS: [Kind<dyn AnyDriver>; 6] = habits::KINDS;

/// A driver with the remnant that its scenario asks for added.
#[derive(Debug, Clone)]
struct WithRemnant<D>(D, Remnant);

impl<D: Driver> Driver for WithRemnant<D> {
    fn look_ahead_s(&self) -> [f64; 2] {
        self.0.look_ahead_s()
    }

    fn step(&mut self, view: &DriverView) -> f64 {
        self.0.step(view) + self.1.step()
    }

    fn k_hg(&self) -> Option<f64> {
        self.0.k_hg()
    }
}

/// The speed by which a driver looks ahead, m/s: a standing car has no lines of sight by time.
fn walking(view: &DriverView) -> f64 {
    view.speed_m_per_s.max(1.0)
}

/// Angles to the near and to the far point of the road, rad. On an arc the line of sight turns by half of what the road does.
fn angles_of_sight(view: &DriverView, near_s: f64) -> [f64; 2] {
    let near = view.lane.e_y_m / (walking(view) * near_s);
    [near, 0.5 * view.lane.e_theta_rad]
}

/// A driver, also one of one's own, with the remnant that a scenario asks for; [`PaperDriver`](crate::parts::PaperDriver) has it already.
pub fn with_remnant(
    scenario: &Scenario,
    driver: impl Driver + Clone + Send + Sync + 'static,
) -> Box<dyn AnyDriver> {
    let remnant = Remnant::new(scenario.driver(), Stream::Remnant.seed(scenario.seed()));
    Box::new(WithRemnant(driver, remnant))
}
