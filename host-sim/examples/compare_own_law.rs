//! A law of one's own in a comparison, beside those that are there: `cargo run --release -p host-sim --example compare_own_law`.
//!
//! A driver joins in the same way: a `Kind<dyn AnyDriver>` in `Kinds::drivers`.

use std::path::Path;

use haptic_batch::compare::{Compare, Kinds};
use haptic_batch::engine::Watch;
use haptic_report::studies::compare::report;
use haptic_sim::kind::{Kind, Make, Origin, Parameter};
use haptic_sim::laws::{Law, LawView};

/// A spring that pulls the wheel to the angle that the lane ahead asks for.
#[derive(Clone)]
struct Spring {
    per_e_y: f64,
    stiffness_nm_per_rad: f64,
}

impl Law for Spring {
    fn ask(&mut self, view: &LawView) -> f64 {
        let target_rad = self.per_e_y * view.e_y_m + 12.0 * view.e_theta_rad;
        self.stiffness_nm_per_rad * (target_rad - view.wheel_angle_rad)
    }
}

const SPRING: Kind<dyn Law> = Kind {
    name: "spring",
    source: "this file",
    origin: Origin::Ours,
    parameters: &[
        Parameter::ours("per_e_y_rad_per_m", 0.5, [0.0, 10.0]),
        Parameter::ours("stiffness_nm_per_rad", 2.0, [0.0, 20.0]).tuned(0.5, 4.0),
    ],
    make: Make::Part(|_, values| {
        Ok(Box::new(Spring {
            per_e_y: values[0],
            stiffness_nm_per_rad: values[1],
        }))
    }),
};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut kinds = Kinds::default();
    kinds.laws.push(SPRING);
    let file = std::env::args().nth(1).unwrap_or("spring.toml".into());
    let compare = Compare::load(Path::new(&file), &kinds)?;
    let results = compare.run(&Watch::nobody())?;
    println!("{}", report(&results).to_text(None));
    Ok(())
}
