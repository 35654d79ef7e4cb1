//! Nothing that is honest ends guidance: from the slowest speed that a scenario has to the fastest, on bends from 30 m on.

use haptic_sim::Scenario;
use haptic_sim::models::driver::DriverParameters;
use haptic_sim::models::road::{Course, Segment};
use haptic_sim::population::LaneKeeper;
use haptic_sim::scenario::{Condition, ScenarioBuilder};
use haptic_sim::simulation::simulate;
use haptic_sim::unguided::stretches;
use haptic_sim::worlds::WORLDS;

/// Speeds, km/h, each with radii (m) that ask for 0.3 to 2.2 m/s2. The slowest is just above the 5.5 m/s of a scenario.
const BENDS: [(f64, &[f64]); 7] = [
    (19.9, &[30.0, 50.0, 100.0]),
    (25.0, &[30.0, 100.0]),
    (30.0, &[50.0, 150.0]),
    (40.0, &[60.0, 300.0]),
    (60.0, &[150.0, 600.0]),
    (90.0, &[300.0, 1000.0]),
    (130.0, &[600.0, 2000.0]),
];

/// A bend between straights, entered and left within so many seconds, and held for 4 s.
fn bend(radius_m: f64, side: f64, m_per_s: f64, entry_s: f64) -> Course {
    let curvature = side / radius_m;
    let segments = vec![
        Segment::straight(4.0 * m_per_s),
        Segment::clothoid(entry_s * m_per_s, 0.0, curvature),
        Segment::arc(4.0 * m_per_s, curvature),
        Segment::clothoid(entry_s * m_per_s, curvature, 0.0),
        Segment::straight(4.0 * m_per_s),
    ];
    Course::new("bend", 3.6, segments).unwrap()
}

/// Drives every bend to both sides with what `driver` makes of a scenario at a speed (m/s); the number counts the runs.
fn nothing_ends_guidance(driver: impl Fn(ScenarioBuilder, f64, usize) -> ScenarioBuilder) {
    let mut number = 0;
    for (kmh, radii) in BENDS {
        let m_per_s = kmh / 3.6;
        for (radius_m, side) in radii.iter().flat_map(|r| [(*r, 1.0), (*r, -1.0)]) {
            let course = bend(radius_m, side, m_per_s, [3.0, 5.0, 8.0][number % 3]);
            let scenario = Scenario::builder().course(course).speed_kmh(kmh);
            let run = simulate(&driver(scenario, m_per_s, number).build().unwrap());
            let left = stretches(&run.trace).expect("it is guided");
            let bend = side * radius_m;
            assert!(left.is_empty(), "{kmh} km/h, {bend} m, run {number}: {left:?}");
            number += 1;
        }
    }
}

/// The paper's drivers, who have no noise, in its car: their torque stays on one count of its sensor for more than a second.
#[test]
fn the_papers_drivers_keep_their_guidance_at_every_speed() {
    for condition in [Condition::High, Condition::Mid, Condition::Low] {
        nothing_ends_guidance(|scenario, _, number| {
            let driver = DriverParameters {
                t_p: [0.1, 0.3][number % 2],
                ..DriverParameters::default()
            };
            scenario.condition(condition).driver(driver)
        });
    }
}

/// Drivers who keep the lane in other cars: dry friction, tyres that saturate, tolerances, bank and wind; beside that a power
/// assist, a motor that lags, a late camera.
#[test]
fn every_car_keeps_its_guidance_at_every_speed() {
    for name in ["everything", "assist", "motor", "camera"] {
        let kind = WORLDS.iter().find(|world| world.name == name).unwrap();
        nothing_ends_guidance(|scenario, m_per_s, number| {
            let driver = LaneKeeper {
                t_p: 0.1 + 0.05 * (number % 4) as f64,
                reliance: [1.0, 0.5, 0.25][number % 3],
                remnant_sd_nm: 0.0,
            };
            let car = number as u64;
            let scenario = scenario.seed(car).world(kind.parameters());
            let scenario = scenario
                .tolerances(kind.tolerances(car))
                .sensor_errors(kind.sensor_errors());
            driver.drives(scenario, m_per_s)
        });
    }
}
