//! How often the ECU hands over although nothing is wrong: many cars on many roads, for hours.
//!
//! A *segment* is five minutes of driving: a car of the population on a road of its own, with a driver who keeps the lane as
//! people do. It begins engaged. After every handover the driver drives alone, and asks for guidance again 5 s later. A
//! segment ends where the ECU latches a fault: only a standstill would end that. A *declaration* is what took guidance away; as
//! nothing is wrong in any segment, each is a false one. A *world* says what is real (`haptic_sim::worlds`).
//!
//! A driver who leaves the road with the same car by hand too is one whom no guidance keeps on it: what the ECU makes of a
//! vehicle that leaves the road is no false declaration. So every segment is driven a second time without guidance, whatever
//! the first time showed, and a segment that is *lost by hand* is counted apart, with its hours.
//!
//! Segments of one number and road share course, driver, car and noise in every world, so that worlds can be
//! compared. A segment depends on the seed and on its own number alone: in whatever order and in however many sittings segments
//! are driven, the results are the same.
//!
//! Not here: what is missed. `haptic-campaign` injects faults into the same world.

mod drive;
pub mod eps;
mod events;
mod roads;
mod segment;

use haptic_sim::worlds::WorldKind;
use serde::Serialize;

pub use crate::declared::{Declaration, Listener, Reported, UNNAMED};
pub use haptic_batch::{Confidence, Rate};
pub use roads::{ROADS, Road};
pub use segment::{ByHand, DriveSegment, Ended, SegmentNumber};

use haptic_batch::StudyError;
use haptic_batch::engine::{Part, Plan, Resumed, Store, Study};

/// Length of a segment, s.
pub const SEGMENT_S: f64 = 300.0;
/// Cars of the population.
pub const CARS: u32 = 30;

/// What to drive.
#[derive(Debug, Clone)]
pub struct AvailabilityPlan {
    /// By name; all if empty.
    pub worlds: Vec<&'static WorldKind>,
    /// Roads to drive on.
    pub roads: Vec<&'static Road>,
    /// Hours in each world on each road.
    pub hours: f64,
    /// Root of all random numbers.
    pub seed: u64,
    /// These segments in place of hours of them; none: the hours.
    pub only: Vec<u32>,
    /// How often intervals hold the rate that they are of.
    pub level: Confidence,
}

impl AvailabilityPlan {
    /// Every segment, in order.
    fn segments(&self) -> Vec<SegmentNumber> {
        // Rounding must not begin one more segment.
        let segments = (self.hours * 3600.0 / SEGMENT_S - 1e-9).ceil().max(1.0) as u32;
        let numbers = if self.only.is_empty() {
            (0..segments).collect()
        } else {
            self.only.clone()
        };
        let cells = self
            .worlds
            .iter()
            .flat_map(|world| self.roads.iter().map(move |road| (*world, *road)));
        cells
            .flat_map(|(world, road)| {
                let segment = move |number: &u32| SegmentNumber {
                    world,
                    road,
                    number: *number,
                };
                numbers.iter().map(segment)
            })
            .collect()
    }
}

/// Segments that an earlier run drove, and what takes each new one.
pub fn resumed<K>(on_record: &[DriveSegment], keep: K) -> impl Store<SegmentNumber, DriveSegment>
where
    K: Fn(&DriveSegment) -> Result<(), StudyError> + Sync,
{
    Resumed {
        rows: on_record,
        is_of: |number: &SegmentNumber, segment: &DriveSegment| segment.is(number),
        keep,
    }
}

impl Study for AvailabilityPlan {
    type Case = SegmentNumber;
    type Row = DriveSegment;
    type Results = Availability;

    fn plan(&self) -> Result<Plan<SegmentNumber>, StudyError> {
        Ok(Plan::side_by_side(self.segments(), self.seed))
    }

    fn drive(&self, part: &Part<'_, SegmentNumber, DriveSegment>) -> Result<Vec<DriveSegment>, StudyError> {
        drive::side_by_side(part, self.seed)
    }

    fn summarise(
        &self,
        _: Vec<SegmentNumber>,
        segments: Vec<DriveSegment>,
    ) -> Result<Availability, StudyError> {
        Ok(summary(self, &segments.iter().collect::<Vec<_>>()))
    }
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
    /// False declarations by the faults that the ECU named, the most frequent first.
    pub causes: Vec<Cause>,
    /// Cars that drove.
    pub cars: usize,
    /// Cars that had a false declaration.
    pub cars_with: usize,
    /// Segments that ended in a latched fault.
    pub latched: usize,
    /// Segments in which the vehicle left the road, and by hand does not.
    pub diverged: usize,
    /// Segments in which it leaves the road by hand too: nothing above counts them.
    pub lost_by_hand: Lost,
    /// Standard deviation of the lateral position (SDLP), m: mean over the segments.
    pub sdlp_m: f64,
    /// Largest lateral error, m.
    pub largest_error_m: f64,
}

/// Segments that say nothing of guidance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Lost {
    /// How many.
    pub segments: usize,
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
    /// How often intervals hold the rate that they are of.
    #[serde(skip_serializing_if = "Confidence::is_usual")]
    pub level: Confidence,
    /// By world and road.
    pub cells: Vec<Cell>,
    /// Judged worlds, their roads together, if there are several.
    pub together: Vec<Cell>,
    /// Segments of judged worlds in which the ECU left, or the vehicle left the road, with guidance or by hand.
    pub segments: Vec<DriveSegment>,
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

fn summary(plan: &AvailabilityPlan, segments: &[&DriveSegment]) -> Availability {
    let of_cell = |world: &WorldKind, road: &Road| {
        let mut of_cell: Vec<&DriveSegment> = segments
            .iter()
            .copied()
            .filter(|segment| segment.world == world.name && segment.road == road.name)
            .collect();
        // Sums are the same in whatever order the segments were driven.
        of_cell.sort_by_key(|segment| segment.number);
        of_cell
    };
    let of_cell = &of_cell;
    let cells = plan.worlds.iter().flat_map(|world| {
        let roads = plan.roads.iter();
        roads.map(move |road| cell(world, road.name, &of_cell(world, road), plan.level))
    });
    let cells = cells.collect();
    let several = plan
        .worlds
        .iter()
        .filter(|world| world.judged && plan.roads.len() > 1);
    let together = several.map(|world| {
        let on_all: Vec<&DriveSegment> = plan.roads.iter().flat_map(|road| of_cell(world, road)).collect();
        cell(world, "all", &on_all, plan.level)
    });
    let together = together.collect();
    let numbers = plan.segments();
    let happened = numbers.iter().filter_map(|number| {
        let mut of_number = segments.iter().filter(|segment| segment.is(number));
        let segment = of_number.next().copied()?;
        (number.world.judged && segment.shows_something()).then(|| segment.clone())
    });
    Availability {
        seed: plan.seed,
        hours: plan.hours,
        level: plan.level,
        cells,
        together,
        segments: happened.collect(),
    }
}

fn cell(world: &WorldKind, road: &'static str, segments: &[&DriveSegment], level: Confidence) -> Cell {
    let (lost, segments): (Vec<&DriveSegment>, Vec<&DriveSegment>) = segments
        .iter()
        .copied()
        .partition(|segment| segment.is_lost_by_hand());
    let lost_by_hand = Lost {
        segments: lost.len(),
        hours: lost.iter().map(|segment| segment.driven_s).sum::<f64>() / 3600.0,
        declarations: lost.iter().map(|segment| segment.declarations.len()).sum(),
    };
    let sum = |of: fn(&DriveSegment) -> f64| segments.iter().map(|segment| of(segment)).sum::<f64>();
    let hours = sum(|segment| segment.driven_s) / 3600.0;
    let declared = || segments.iter().flat_map(|segment| &segment.declarations);
    let mut names: Vec<&str> = declared().map(|d| d.faults.as_str()).collect();
    names.sort_unstable();
    let mut causes: Vec<Cause> = names
        .chunk_by(|a, b| a == b)
        .map(|same| Cause {
            faults: same[0].into(),
            rate: Rate::new(same.len() as u64, hours, level),
        })
        .collect();
    causes.sort_by_key(|cause| std::cmp::Reverse(cause.rate.count));
    let cars = |with: bool| {
        let chosen = segments
            .iter()
            .filter(|segment| !with || !segment.declarations.is_empty());
        chosen
            .map(|segment| segment.car)
            .collect::<std::collections::BTreeSet<_>>()
            .len()
    };
    Cell {
        world: world.name,
        road,
        judged: world.judged,
        hours,
        available: sum(|segment| segment.active_s) / (3600.0 * hours),
        declarations: Rate::new(declared().count() as u64, hours, level),
        causes,
        cars: cars(false),
        cars_with: cars(true),
        latched: segments
            .iter()
            .filter(|segment| segment.ended == Ended::Latched)
            .count(),
        diverged: segments
            .iter()
            .filter(|segment| segment.ended == Ended::Diverged)
            .count(),
        lost_by_hand,
        sdlp_m: sum(|segment| segment.sdlp_m) / segments.len() as f64,
        largest_error_m: segments
            .iter()
            .map(|segment| segment.largest_error_m)
            .fold(0.0, f64::max),
    }
}

#[cfg(test)]
mod tests;
