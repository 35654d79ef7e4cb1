//! How often the ECU hands over although nothing is wrong: many cars on many roads, for hours.
//!
//! A *leg* is five minutes of driving: a car of the population on a road of its own, with a driver who keeps the lane as
//! people do. It begins engaged. After every handover the driver drives alone, and asks for guidance again 5 s later. A
//! leg ends where the ECU latches a fault: only a standstill would end that. A *declaration* is what took guidance away; as
//! nothing is wrong in any leg, each is a false one. A *world* says what is real (`haptic_sim::worlds`).
//!
//! A driver who leaves the road with the same car by hand too is one whom no guidance keeps on it: what the ECU makes of a
//! vehicle that leaves the road is no false declaration. So every leg is driven a second time without guidance, whatever
//! the first time showed, and a leg that is *lost by hand* is counted apart, with its hours.
//!
//! Legs of one number and road share course, driver, car and noise in every world, so that worlds can be
//! compared. A leg depends on the seed and on its own number alone: in whatever order and in however many sittings legs
//! are driven, the results are the same.
//!
//! Not here: what is missed. `haptic-campaign` injects faults into the same world.

mod drive;
mod events;
mod leg;
mod roads;

use haptic_sim::worlds::WorldKind;
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};

pub(crate) use drive::{UNNAMED, Watch};
pub use leg::{ByHand, Declaration, Ended, Leg, LegNumber};
pub use roads::{ROADS, Road};

use crate::error::StudyError;
use crate::vectorised::in_groups;

/// Length of a leg, s.
pub const LEG_S: f64 = 300.0;
/// Cars of the population.
pub const CARS: u32 = 30;

/// What to drive.
#[derive(Debug, Clone)]
pub struct Plan {
    /// By name; all if empty.
    pub worlds: Vec<&'static WorldKind>,
    /// Roads to drive on.
    pub roads: Vec<&'static Road>,
    /// Hours in each world on each road.
    pub hours: f64,
    /// Root of all random numbers.
    pub seed: u64,
    /// These legs in place of hours of them; none: the hours.
    pub only: Vec<u32>,
}

impl Plan {
    /// Every leg, in order.
    pub fn legs(&self) -> Vec<LegNumber> {
        let legs = (self.hours * 3600.0 / LEG_S - 1e-9).ceil().max(1.0) as u32;
        let numbers = if self.only.is_empty() {
            (0..legs).collect()
        } else {
            self.only.clone()
        };
        let cells = self
            .worlds
            .iter()
            .flat_map(|world| self.roads.iter().map(move |road| (*world, *road)));
        cells
            .flat_map(|(world, road)| {
                let leg = move |number: &u32| LegNumber {
                    world,
                    road,
                    number: *number,
                };
                numbers.iter().map(leg)
            })
            .collect()
    }

    /// Whether a leg on record is one of these.
    fn has(&self, leg: &Leg) -> bool {
        self.legs().iter().any(|number| leg.is(number))
    }
}

/// Counts in a time, and what they say of the rate behind them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Rate {
    /// Events.
    pub count: u64,
    /// Events in an hour.
    pub per_hour: f64,
    /// The exact 95 % interval of the rate (Garwood 1936), 1/h.
    pub interval: [f64; 2],
    /// The rate that is not exceeded with 95 % confidence, 1/h: for zero events three in the time.
    pub upper_95: f64,
}

impl Rate {
    /// Of so many events of a Poisson process in so many hours.
    pub fn of(count: u64, hours: f64) -> Self {
        let quantile = |share: f64, degrees: u64| {
            let law = ChiSquared::new(degrees as f64).expect("positive");
            0.5 * quantile(&law, share)
        };
        let low = if count == 0 {
            0.0
        } else {
            quantile(0.025, 2 * count)
        };
        // In no time nothing is known.
        let per = |events: f64| if hours > 0.0 { events / hours } else { f64::NAN };
        Self {
            count,
            per_hour: per(count as f64),
            interval: [per(low), per(quantile(0.975, 2 * count + 2))],
            upper_95: per(quantile(0.95, 2 * count + 2)),
        }
    }
}

/// By halving: the library's own inverse stops early.
fn quantile(law: &ChiSquared, share: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    while law.cdf(high) < share {
        high *= 2.0;
    }
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if law.cdf(middle) < share {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

/// What driving in a world on a road showed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Cell {
    /// Name of the world.
    pub world: &'static str,
    /// Name of the road; `all` of them together.
    pub road: &'static str,
    /// Whether no declaration is to be expected: nothing in it is beyond what roads and cars are.
    pub judged: bool,
    /// Hours driven, without those lost by hand.
    pub hours: f64,
    /// Share of them with guidance.
    pub available: f64,
    /// False declarations.
    pub declarations: Rate,
    /// The same by the faults that the ECU named, the most frequent first.
    pub causes: Vec<Cause>,
    /// Cars that drove.
    pub cars: usize,
    /// Cars that had a false declaration.
    pub cars_with: usize,
    /// Legs that ended in a latched fault.
    pub latched: usize,
    /// Legs in which the vehicle left the road, and by hand does not.
    pub diverged: usize,
    /// Legs in which it leaves the road by hand too: nothing above counts them.
    pub lost_by_hand: Lost,
    /// Standard deviation of the lateral position (SDLP), m: mean over the legs.
    pub sdlp_m: f64,
    /// Largest lateral error, m.
    pub largest_error_m: f64,
}

/// Legs that say nothing of guidance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Lost {
    /// How many.
    pub legs: usize,
    /// How long they were driven with guidance at hand, h.
    pub hours: f64,
    /// What the ECU declared in them.
    pub declarations: usize,
}

/// Declarations of one cause.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Cause {
    /// The faults that the ECU named.
    pub faults: String,
    /// How often.
    pub rate: Rate,
}

/// What the study found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Availability {
    /// Root of all random numbers.
    pub seed: u64,
    /// Hours asked for in each world on each road.
    pub hours: f64,
    /// By world and road.
    pub cells: Vec<Cell>,
    /// Judged worlds, their roads together, if there are several.
    pub together: Vec<Cell>,
    /// Legs of judged worlds in which the ECU left, or the vehicle left the road, with guidance or by hand.
    pub legs: Vec<Leg>,
}

impl Availability {
    /// What is judged: each world in which nothing is to be expected, on all its roads.
    pub fn judged(&self) -> impl Iterator<Item = &Cell> {
        let cells = if self.together.is_empty() {
            &self.cells
        } else {
            &self.together
        };
        cells.iter().filter(|cell| cell.judged)
    }
}

/// Drives every leg of the plan that is not yet on record, on every core. `done` gets each new leg, from any thread.
///
/// # Errors
/// A world that is no scenario, the built-in ones are; what `done` says; a drive that differs from the shipping ECU's.
pub fn study(
    plan: &Plan,
    on_record: &[Leg],
    done: impl Fn(&Leg) -> Result<(), StudyError> + Sync,
) -> Result<Availability, StudyError> {
    let missing: Vec<LegNumber> = plan
        .legs()
        .into_iter()
        .filter(|number| !on_record.iter().any(|leg| leg.is(number)))
        .collect();
    let driven: Vec<Leg> = in_groups(&missing, |first, numbers| {
        let mut legs: Vec<Option<Leg>> = vec![None; numbers.len()];
        drive::side_by_side(numbers, plan.seed, [first, missing.len()], |place, leg| {
            done(&leg)?;
            legs[place] = Some(leg);
            Ok(())
        })?;
        Ok(legs.into_iter().flatten().collect())
    })?;
    let on_record = on_record.iter().filter(|leg| plan.has(leg));
    Ok(summary(plan, &on_record.chain(&driven).collect::<Vec<_>>()))
}

fn summary(plan: &Plan, legs: &[&Leg]) -> Availability {
    let of_cell = |world: &WorldKind, road: &Road| {
        let mut of_cell: Vec<&Leg> = legs
            .iter()
            .copied()
            .filter(|leg| leg.world == world.name && leg.road == road.name)
            .collect();
        // Sums are the same in whatever order the legs were driven.
        of_cell.sort_by_key(|leg| leg.number);
        of_cell
    };
    let of_cell = &of_cell;
    let cells = plan.worlds.iter().flat_map(|world| {
        let roads = plan.roads.iter();
        roads.map(move |road| cell(world, road.name, &of_cell(world, road)))
    });
    let cells = cells.collect();
    let several = plan
        .worlds
        .iter()
        .filter(|world| world.judged && plan.roads.len() > 1);
    let together = several.map(|world| {
        let on_all: Vec<&Leg> = plan.roads.iter().flat_map(|road| of_cell(world, road)).collect();
        cell(world, "all", &on_all)
    });
    let together = together.collect();
    let numbers = plan.legs();
    let happened = numbers.iter().filter_map(|number| {
        let mut of_number = legs.iter().filter(|leg| leg.is(number));
        let leg = of_number.next().copied()?;
        (number.world.judged && leg.shows_something()).then(|| leg.clone())
    });
    Availability {
        seed: plan.seed,
        hours: plan.hours,
        cells,
        together,
        legs: happened.collect(),
    }
}

fn cell(world: &WorldKind, road: &'static str, legs: &[&Leg]) -> Cell {
    let (lost, legs): (Vec<&Leg>, Vec<&Leg>) = legs.iter().copied().partition(|leg| leg.is_lost_by_hand());
    let lost_by_hand = Lost {
        legs: lost.len(),
        hours: lost.iter().map(|leg| leg.driven_s).sum::<f64>() / 3600.0,
        declarations: lost.iter().map(|leg| leg.declarations.len()).sum(),
    };
    let sum = |of: fn(&Leg) -> f64| legs.iter().map(|leg| of(leg)).sum::<f64>();
    let hours = sum(|leg| leg.driven_s) / 3600.0;
    let declared = || legs.iter().flat_map(|leg| &leg.declarations);
    let mut names: Vec<&str> = declared().map(|d| d.faults.as_str()).collect();
    names.sort_unstable();
    let mut causes: Vec<Cause> = names
        .chunk_by(|a, b| a == b)
        .map(|same| Cause {
            faults: same[0].into(),
            rate: Rate::of(same.len() as u64, hours),
        })
        .collect();
    causes.sort_by_key(|cause| std::cmp::Reverse(cause.rate.count));
    let cars = |with: bool| {
        let chosen = legs.iter().filter(|leg| !with || !leg.declarations.is_empty());
        chosen
            .map(|leg| leg.car)
            .collect::<std::collections::BTreeSet<_>>()
            .len()
    };
    Cell {
        world: world.name,
        road,
        judged: world.judged,
        hours,
        available: sum(|leg| leg.active_s) / (3600.0 * hours),
        declarations: Rate::of(declared().count() as u64, hours),
        causes,
        cars: cars(false),
        cars_with: cars(true),
        latched: legs.iter().filter(|leg| leg.ended == Ended::Latched).count(),
        diverged: legs.iter().filter(|leg| leg.ended == Ended::Diverged).count(),
        lost_by_hand,
        sdlp_m: sum(|leg| leg.sdlp_m) / legs.len() as f64,
        largest_error_m: legs.iter().map(|leg| leg.largest_error_m).fold(0.0, f64::max),
    }
}

#[cfg(test)]
mod tests;
