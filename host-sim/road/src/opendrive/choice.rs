//! Where a course begins in an OpenDRIVE file: the road and the lane that a person chose, or sensible ones.

use std::collections::HashSet;

use super::error::{RoadError, refuse};
use super::network::{Network, Next, Passage, listed};
use super::road::{Lane, Road};
use haptic_input::InputError;

/// Lane types that vehicles drive on beside `driving`, for roads that have no lane of that type.
const OTHER_DRIVEN: [&str; 9] = [
    "entry",
    "exit",
    "onRamp",
    "offRamp",
    "connectingRamp",
    "slipLane",
    "bidirectional",
    "shared",
    "taxi",
];

/// Which road of an OpenDRIVE file a course begins on, and in which lane.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct LaneChoice {
    /// Id of the road; the first of the only chain if not given.
    pub road: Option<String>,
    /// Id of the lane where the course begins; the rightmost driving lane in the direction of travel if not given.
    pub lane: Option<i32>,
    /// Where a junction leads on to several roads, the one to take: by the id of the road through the junction, or of the one
    /// behind it.
    pub turns: Vec<String>,
}

impl LaneChoice {
    /// Only files of OpenDRIVE have roads and lanes to choose from.
    ///
    /// # Errors
    /// A road or a lane is chosen.
    pub fn check_none(&self, name: &str) -> Result<(), InputError> {
        if *self == Self::default() {
            return Ok(());
        }
        Err(InputError::new(
            name,
            "a road, a lane and turns can only be chosen of an OpenDRIVE file (.xodr)",
        ))
    }
}

/// The first passage and its lane.
///
/// # Errors
/// A road or lane that is not there, or a file that leaves the choice open.
pub(super) fn start(
    network: &Network,
    choice: &LaneChoice,
    notes: &mut Vec<String>,
) -> Result<(Passage, i32), RoadError> {
    if choice.lane == Some(0) {
        return refuse("lane 0 is the centre lane, which has no width");
    }
    let candidates = match &choice.road {
        Some(id) => {
            let road = network.road(id)?;
            vec![(road, true), (road, false)]
        }
        None => chain_ends(network)?,
    };
    let mut refusals = Vec::new();
    for passage in candidates {
        match lane_on(network, passage, choice.lane) {
            Ok(lane) => {
                if choice.road.is_none() || choice.lane.is_none() {
                    let road = network.roads[passage.0].id;
                    notes.push(format!("the course begins on road {road} in lane {lane}"));
                }
                return Ok((passage, lane));
            }
            Err(refusal) => refusals.push(refusal),
        }
    }
    // The candidate in the direction of the road says it best.
    Err(refusals.swap_remove(0))
}

/// The passages from which all roads of the file can be driven in one go, those along the road's s first.
fn chain_ends(network: &Network) -> Result<Vec<Passage>, RoadError> {
    let passages = [true, false].map(|along| (0..network.roads.len()).map(move |index| (index, along)));
    let passages: Vec<Passage> = passages.into_iter().flatten().collect();
    let mut followers = HashSet::new();
    for passage in &passages {
        if let Next::Road(next) | Next::Connection(next, _) = network.next(*passage, None)? {
            followers.insert(next);
        }
    }
    // A chain begins where nothing leads to; a ring begins with the first road of the file, either way.
    let mut ends: Vec<Passage> = passages
        .into_iter()
        .filter(|passage| !followers.contains(passage))
        .collect();
    ends.extend([(0, true), (0, false)]);
    let mut whole = Vec::new();
    for end in ends {
        let (passages, _) = network.chain(end)?;
        if passages.len() == network.roads.len() && !whole.contains(&end) {
            whole.push(end);
        }
    }
    if whole.is_empty() {
        let (passages, stuck) = network.chain((0, true))?;
        return refuse(not_one_chain(network, &passages, stuck));
    }
    Ok(whole)
}

fn not_one_chain(network: &Network, chain: &[Passage], stuck: Option<Next>) -> String {
    let list = |ids: Vec<&str>| {
        let more = if ids.len() > 12 { ", ..." } else { "" };
        format!("{}{more}", ids[..ids.len().min(12)].join(", "))
    };
    let first = network.roads[chain[0].0].id;
    match stuck {
        Some(Next::Junction(junction, ways)) => {
            let ways = match &ways[..] {
                [] => "no road".into(),
                ways => format!("roads {}", listed(ways)),
            };
            return format!(
                "its roads are not one chain: junction {junction} leads on to {ways}; choose the road to begin on with \
                 --road"
            );
        }
        Some(Next::Outside(_, what)) => {
            let last = network.roads[chain[chain.len() - 1].0].id;
            return format!(
                "its roads are not one chain: road {last}: {what}; choose the road to begin on with --road"
            );
        }
        _ => {}
    }
    let outside = network.roads.iter().enumerate();
    let outside = outside.filter(|(i, road)| !road.in_junction && chain.iter().all(|(on, _)| on != i));
    let outside: Vec<&str> = outside.map(|(_, road)| road.id).collect();
    format!(
        "its {} roads are not one chain: road {first} has no link to roads {}; choose the road to begin on with \
         --road",
        network.roads.len(),
        list(outside)
    )
}

/// The lane to begin in on a passage: the one asked for, if it is driven in that direction, or the rightmost.
fn lane_on(network: &Network, (index, along): Passage, lane: Option<i32>) -> Result<i32, RoadError> {
    let node = &network.roads[index];
    let road = Road::read(node.id, node.node)?;
    // The side that is driven along s.
    let along_side = if node.left_hand { 1 } else { -1 };
    let is_driven_so = |lane: &Lane| (lane.id.signum() == along_side) != lane.is_reversed();
    let sections = road.sections(lane.unwrap_or(if along { along_side } else { -along_side }))?;
    let section = if along {
        &sections[0]
    } else {
        &sections[sections.len() - 1]
    };
    if let Some(id) = lane {
        let found = section.need(node.id, id)?;
        if is_driven_so(&found) == along {
            return Ok(id);
        }
        let against = if along { "against" } else { "along" };
        return refuse(format!(
            "road {}: lane {id} is driven {against} the road's s there",
            node.id
        ));
    }
    let of_types = |types: &[&str]| {
        let lanes = section.lanes();
        let lanes = lanes.filter(|lane| types.contains(&lane.kind()) && is_driven_so(lane) == along);
        // To the right is a smaller id, seen along s.
        lanes
            .map(|lane| lane.id)
            .min_by_key(|id| if along { *id } else { -*id })
    };
    of_types(&["driving"])
        .or_else(|| of_types(&OTHER_DRIVEN))
        .ok_or_else(|| {
            let direction = if along { "along" } else { "against" };
            format!(
                "road {}: it has no driving lane {direction} its s; choose one with --lane",
                node.id
            )
            .into()
        })
}
