//! A guidance law of one's own, in the loop in place of the shipping one (docs/tutorials/own-guidance-law.md):
//! `cargo run --release -p host-sim --example own_guidance_law`.

use haptic_sim::guidance::{Actuation, Guidance, Observation};
use haptic_sim::models::driver::DriverParameters;
use haptic_sim::scenario::{Condition, Scenario};
use haptic_sim::{Simulation, simulate};

/// A spring that pulls the steering wheel to the angle that the lane ahead asks for.
#[derive(Debug, Clone)]
struct Spring {
    /// Wheel angle per lateral error at the near point, rad/m.
    per_e_y: f64,
    /// Wheel angle per yaw error at the far point, rad/rad.
    per_e_theta: f64,
    /// Torque per wheel angle that is missing, N.m/rad.
    stiffness_nm_per_rad: f64,
    /// Largest torque, N.m: the driver can always override it.
    limit_nm: f64,
}

impl Guidance for Spring {
    // The lane errors are asked for in every step, as an ideal camera would give them.
    fn looks_at_road(&self, _step: u32) -> bool {
        true
    }

    fn step(&mut self, observation: &Observation) -> Actuation {
        // No lane, no torque.
        let Some(lane) = observation.lane else {
            return Actuation::default();
        };
        let target_rad = self.per_e_y * lane.e_y_m + self.per_e_theta * lane.e_theta_rad;
        let wanted_nm = self.stiffness_nm_per_rad * (target_rad - observation.wheel_angle_rad);
        Actuation {
            torque_nm: wanted_nm.clamp(-self.limit_nm, self.limit_nm),
            limited: wanted_nm.abs() > self.limit_nm,
        }
    }
}

/// Largest lateral error in the first curve of the course, m.
fn peak_m(run: &haptic_sim::simulation::Run) -> f64 {
    let curve = run
        .trace
        .samples
        .iter()
        .filter(|s| (1080.0..=1740.0).contains(&s.s_m));
    curve.map(|s| s.lateral_error_m.abs()).fold(0.0, f64::max)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Driver 3 of the paper: a processing delay of 0.5 s.
    let slow = DriverParameters {
        t_p: 0.5,
        ..DriverParameters::default()
    };
    let manual = Scenario::builder()
        .driver(slow)
        .condition(Condition::Manual)
        .build()?;
    let relying = Scenario::builder()
        .driver(slow)
        .condition(Condition::High)
        .build()?;
    let spring = Spring {
        per_e_y: 0.5,
        per_e_theta: 12.0,
        stiffness_nm_per_rad: 2.0,
        limit_nm: 5.0,
    };
    println!("peak lateral error in the first curve, driver with t_p = 0.5 s");
    println!("  no guidance         {:.3} m", peak_m(&simulate(&manual)));
    println!("  the shipping law    {:.3} m", peak_m(&simulate(&relying)));
    println!(
        "  the spring          {:.3} m",
        peak_m(&Simulation::with(&relying, spring).run())
    );
    Ok(())
}
