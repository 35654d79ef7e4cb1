//! Where the vehicle of a run goes, judged by forks of the run: *fault-free* goes on without the fault from the onset, *dropped*
//! loses the torque in the step in which the ECU leaves, *cut* loses it at the onset. The *deviation* is the distance from the
//! fault-free vehicle across its direction at the same instant.

use haptic_sim::parts::DriverVehicle;
use haptic_sim::{Action, Simulation};

use super::drivers::{LANE_EDGE_M, OFF_ROAD_M};
use super::ecu_harness::EcuHarness;
use super::table::Class;

/// A driver who is warned drives as manually so much later, ms.
const NOTICES_MS: u32 = 1000;
/// Most that a handover may move the vehicle beyond what dropping the torque in the same step does, m.
pub(crate) const MOST_EXCESS_M: f64 = 0.1;

/// Where the vehicle of a run went.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Deviation {
    /// Largest deviation, m.
    pub faulted_m: f64,
    /// Largest deviation had the torque been dropped in the step in which the ECU left, m; `None` if it stayed.
    pub dropped_m: Option<f64>,
    /// Largest distance from the vehicle whose torque is cut at the onset, m: the effect of the torque after the onset. For class C only.
    pub pushed_m: Option<f64>,
    /// Whether the vehicle left its lane where the fault-free one did not.
    pub leaves_lane: bool,
    /// Whether the vehicle was off the road when the ECU left, and so was the fault-free one: its driver took it there.
    pub driven_off: bool,
}

impl Deviation {
    /// How much further the vehicle went than it would have if the torque had been dropped, m.
    pub fn excess_m(&self) -> Option<f64> {
        self.dropped_m.map(|dropped_m| self.faulted_m - dropped_m)
    }

    /// Whether the vehicle leaves the road with the torque dropped or without the fault as well: then no handover is judged.
    pub fn is_off_road(&self) -> bool {
        self.driven_off || self.dropped_m.is_some_and(|dropped_m| dropped_m > OFF_ROAD_M)
    }
}

type Trial<'a> = Simulation<EcuHarness<'a>>;

/// One step, with the hand on the wheel that the row has; whether there was one.
fn step(simulation: &mut Trial<'_>, takes_over: bool) -> bool {
    let (step, pair) = (simulation.steps(), simulation.driver_vehicle_mut());
    pair.take_over(takes_over);
    let arm_nm = pair.arm_torque_nm();
    let action = Action {
        hand_torque_nm: simulation.guidance().hand_torque_nm(step, arm_nm),
        ..Action::default()
    };
    simulation.step(&action).is_some()
}

/// Distance from another vehicle, across its direction, m.
fn apart_m(simulation: &Trial<'_>, from: &Trial<'_>) -> f64 {
    let there = simulation.driver_vehicle().motion();
    let here = from.driver_vehicle().motion();
    let [x, y] = [0, 1].map(|axis| there.position_m[axis] - here.position_m[axis]);
    (y * here.direction_rad.cos() - x * here.direction_rad.sin()).abs()
}

/// To the end, with the forks beside it if asked for. `right` is the fault-free run of a row whose fault is there from the start.
pub(super) fn drive<'a>(
    simulation: &mut Trial<'a>,
    right: Option<Trial<'a>>,
    onset: u32,
    end: u32,
    forks: bool,
) -> Deviation {
    let mut seen = Deviation::default();
    let mut healthy: Option<Trial<'a>> = None;
    let mut dropped: Option<Trial<'a>> = None;
    let mut cut: Option<Trial<'a>> = None;
    let mut edges = [false; 2];
    let mut right = right;
    loop {
        if forks && simulation.steps() == onset {
            let twin = healthy.insert(right.take().unwrap_or_else(|| simulation.clone()));
            twin.guidance_mut().end_faults();
            if simulation.guidance().class() == Class::C {
                cut.insert(twin.clone()).guidance_mut().drop_torque();
            }
        }
        if simulation.steps() == onset
            && let Some(fault) = simulation.guidance().column_fault()
        {
            simulation.driver_vehicle_mut().fail(fault);
        }
        if let Some(right) = &mut right {
            step(right, false);
        }
        let left_at = simulation.guidance().left_at();
        let takes_over = left_at.is_some_and(|at| simulation.steps() >= at + NOTICES_MS);
        let goes_on = simulation.steps() < end && step(simulation, takes_over);
        if !goes_on {
            break;
        }
        let Some(twin) = &mut healthy else { continue };
        if !step(twin, false) {
            break;
        }
        seen.faulted_m = seen.faulted_m.max(apart_m(simulation, twin));
        for (edge, one) in edges.iter_mut().zip([&*simulation, &*twin]) {
            *edge |= one
                .lateral_error_m()
                .is_some_and(|error_m| error_m.abs() > LANE_EDGE_M);
        }
        if let Some(cut) = &mut cut {
            step(cut, takes_over);
            let apart_m = apart_m(simulation, cut);
            seen.pushed_m = Some(seen.pushed_m.unwrap_or_default().max(apart_m));
        }
        match &mut dropped {
            Some(without) => {
                // Off the road it stays where it is.
                step(without, takes_over);
                let apart_m = apart_m(without, twin);
                seen.dropped_m = seen.dropped_m.map(|most_m| most_m.max(apart_m));
            }
            None if left_at.is_none() && simulation.guidance().left_at().is_some() => {
                let without = dropped.insert(simulation.clone());
                without.guidance_mut().drop_torque();
                seen.dropped_m = Some(seen.faulted_m);
                seen.driven_off = [&*simulation, &*twin].iter().all(|one| {
                    one.lateral_error_m()
                        .is_some_and(|error_m| error_m.abs() > OFF_ROAD_M)
                });
            }
            None => {}
        }
    }
    seen.leaves_lane = edges[0] && !edges[1];
    seen
}
