//! How often guidance leaves for nothing, in small: nothing on paper, and nothing where cameras blink.

use haptic_batch::engine::{Study, Watch};
use haptic_evidence::availability::{AvailabilityPlan, Confidence, ROADS};
use haptic_sim::worlds::WORLDS;

fn drive(world: &str, hours: f64) -> haptic_evidence::availability::Availability {
    let plan = AvailabilityPlan {
        worlds: WORLDS.iter().filter(|kind| kind.name == world).collect(),
        roads: ROADS.iter().collect(),
        hours,
        seed: 1,
        only: Vec::new(),
        level: Confidence::USUAL,
    };
    plan.run(&Watch::nobody()).unwrap()
}

#[test]
fn nothing_is_declared_on_paper() {
    for cell in drive("calibrated", 0.16).cells {
        assert_eq!(cell.declarations.count, 0, "{cell:?}");
        assert!(
            (cell.hours - 1.0 / 6.0).abs() < 1e-9 && cell.available == 1.0,
            "{cell:?}"
        );
        // A driver who keeps the lane as people do, no better and no worse.
        assert!((0.08..0.4).contains(&cell.sdlp_m), "{cell:?}");
    }
}

/// A camera that is blind for 0.5 s, thirty times an hour, and all that happens on ordinary roads: guidance stays.
#[test]
fn what_happens_on_ordinary_roads_ends_nothing() {
    for world in ["blind", "events"] {
        for cell in drive(world, 0.16).cells {
            assert_eq!(cell.declarations.count, 0, "{cell:?}");
            assert_eq!(
                (cell.available, cell.latched, cell.diverged),
                (1.0, 0, 0),
                "{cell:?}"
            );
        }
    }
}
