//! Which road follows which: links between roads, and the ways through junctions.

use std::collections::{HashMap, HashSet};

use roxmltree::Node;

use super::error::{RoadError, refuse};
use super::xml::{child, children, text};

/// A road and the direction in which it is driven: along its s or against it.
pub(super) type Passage = (usize, bool);

/// The roads of a file by their links, their insides unread.
pub(super) struct Network<'a> {
    pub(super) roads: Vec<RoadNode<'a>>,
    by_id: HashMap<&'a str, usize>,
    junctions: HashMap<&'a str, Node<'a, 'a>>,
    /// Roads to take where a junction leaves a choice.
    turns: Vec<String>,
}

/// A road in the network.
pub(super) struct RoadNode<'a> {
    pub(super) id: &'a str,
    pub(super) node: Node<'a, 'a>,
    pub(super) left_hand: bool,
    pub(super) in_junction: bool,
}

/// What comes after a road.
#[derive(Debug)]
pub(super) enum Next<'a> {
    /// The road ends.
    End,
    /// A road or a junction that is not in the file: its id, and the sentence.
    Outside(&'a str, String),
    /// A road; the link of the lane says which lane.
    Road(Passage),
    /// A way through a junction, and which lane it gives to ours, if it says so.
    Connection(Passage, Option<i32>),
    /// A junction that leads on to none or to several roads.
    Junction(&'a str, Vec<Way<'a>>),
}

/// A way through a junction.
#[derive(Debug)]
pub(super) struct Way<'a> {
    /// The connecting road.
    road: &'a str,
    /// None if it is not in the file.
    passage: Option<Passage>,
    /// The road behind the junction.
    beyond: Option<&'a str>,
    lane: Option<i32>,
}

/// The ways in words: the connecting roads, and where they lead.
pub(super) fn listed(ways: &[Way]) -> String {
    let words = ways.iter().take(12).map(|way| match way.beyond {
        Some(beyond) => format!("{} (to {beyond})", way.road),
        None => way.road.to_owned(),
    });
    let more = if ways.len() > 12 { ", ..." } else { "" };
    words.collect::<Vec<_>>().join(", ") + more
}

impl<'a> Network<'a> {
    /// # Errors
    /// A road without an identifier, or two with the same one; no road at all.
    pub(super) fn read(root: Node<'a, 'a>, turns: &[String]) -> Result<Self, RoadError> {
        let (mut roads, mut by_id) = (Vec::new(), HashMap::new());
        for node in children(root, "road") {
            let id = text(node, "id").ok_or("a <road> has no `id`")?;
            if by_id.insert(id, roads.len()).is_some() {
                return refuse(format!("two roads have the id {id}"));
            }
            roads.push(RoadNode {
                id,
                node,
                left_hand: text(node, "rule") == Some("LHT"),
                in_junction: !matches!(text(node, "junction"), None | Some("-1" | "")),
            });
        }
        if roads.is_empty() {
            return refuse("it has no <road>");
        }
        let junctions = children(root, "junction").filter_map(|node| Some((text(node, "id")?, node)));
        Ok(Self {
            junctions: junctions.collect(),
            roads,
            by_id,
            turns: turns.to_vec(),
        })
    }

    pub(super) fn road(&self, id: &str) -> Result<usize, RoadError> {
        let listed = || {
            self.roads
                .iter()
                .map(|road| road.id)
                .take(20)
                .collect::<Vec<_>>()
                .join(", ")
        };
        let found = self.by_id.get(id).copied();
        found.ok_or_else(|| format!("it has no road {id}; it has {}", listed()).into())
    }

    /// What comes after a passage, for a lane of it if one is given.
    ///
    /// # Errors
    /// A link that names nothing, or no end of a road.
    pub(super) fn next(&self, (road, along): Passage, lane: Option<i32>) -> Result<Next<'a>, RoadError> {
        let RoadNode { id, node, .. } = self.roads[road];
        let side = if along { "successor" } else { "predecessor" };
        let Some(link) = child(node, "link").and_then(|link| child(link, side)) else {
            return Ok(Next::End);
        };
        let Some(target) = text(link, "elementId").filter(|target| !target.is_empty()) else {
            return refuse(format!("road {id}: its {side} has no `elementId`"));
        };
        if text(link, "elementType") == Some("junction") {
            return Ok(match self.junctions.get(target) {
                Some(junction) => self.through(target, *junction, (road, along), lane),
                None => Next::Outside(
                    target,
                    format!("its {side} is junction {target}, which is not in the file"),
                ),
            });
        }
        let Some(&target_road) = self.by_id.get(target) else {
            return Ok(Next::Outside(
                target,
                format!("its {side} is road {target}, which is not in the file"),
            ));
        };
        let at_start = match text(link, "contactPoint") {
            Some("start") => true,
            Some("end") => false,
            Some(other) => {
                return refuse(format!(
                    "road {id}: contactPoint=\"{other}\" of its {side} is neither start nor end"
                ));
            }
            // Left out: a road is met where its own link says that it meets this one, or as most are.
            None => match (
                self.links_to(target_road, "predecessor", id),
                self.links_to(target_road, "successor", id),
            ) {
                (false, true) => false,
                (true, false) => true,
                _ => along,
            },
        };
        Ok(Next::Road((target_road, at_start)))
    }

    fn links_to(&self, road: usize, side: &'static str, id: &str) -> bool {
        let link = child(self.roads[road].node, "link").and_then(|link| child(link, side));
        link.is_some_and(|link| text(link, "elementId") == Some(id))
    }

    /// The way through a junction: the only one, or the one of a turn.
    fn through(
        &self,
        junction: &'a str,
        node: Node<'a, 'a>,
        (road, along): Passage,
        lane: Option<i32>,
    ) -> Next<'a> {
        let id = self.roads[road].id;
        let mut ways: Vec<Way> = Vec::new();
        for connection in children(node, "connection").filter(|c| text(*c, "incomingRoad") == Some(id)) {
            // A direct junction links roads themselves.
            let to = text(connection, "connectingRoad").or(text(connection, "linkedRoad"));
            let Some(to) = to else { continue };
            let at_start = text(connection, "contactPoint") != Some("end");
            let pairs: Vec<[i32; 2]> = children(connection, "laneLink")
                .filter_map(|link| Some([text(link, "from")?.parse().ok()?, text(link, "to")?.parse().ok()?]))
                .collect();
            let ours = pairs
                .iter()
                .find(|[from, _]| Some(*from) == lane)
                .map(|[_, to]| *to);
            if lane.is_none() || pairs.is_empty() || ours.is_some() {
                let straight = lane.map(|lane| if at_start == along { lane } else { -lane });
                let passage = self.by_id.get(to).map(|&target| (target, at_start));
                ways.push(Way {
                    road: to,
                    passage,
                    beyond: passage.and_then(|passage| self.linked_road(passage)),
                    lane: ours.or(straight),
                });
            }
        }
        let turn = |turn: &String| {
            let leads = |way: &&Way| way.road == turn || way.beyond == Some(turn);
            ways.iter().find(leads)
        };
        let way = match &ways[..] {
            [only] => Some(only),
            _ => self.turns.iter().find_map(turn),
        };
        match way {
            Some(Way {
                passage: Some(passage),
                lane,
                ..
            }) => Next::Connection(*passage, *lane),
            Some(Way { road, .. }) => Next::Outside(
                road,
                format!("junction {junction} leads on to road {road}, which is not in the file"),
            ),
            None => Next::Junction(junction, ways),
        }
    }

    /// The road that a passage's own link names.
    fn linked_road(&self, (road, along): Passage) -> Option<&'a str> {
        let side = if along { "successor" } else { "predecessor" };
        let link = child(self.roads[road].node, "link").and_then(|link| child(link, side))?;
        text(link, "elementId").filter(|_| text(link, "elementType") != Some("junction"))
    }

    /// The passages from one on, for as long as there is one way only; a ring ends where it began.
    pub(super) fn chain(&self, start: Passage) -> Result<(Vec<Passage>, Option<Next<'a>>), RoadError> {
        let (mut passages, mut seen) = (vec![start], HashSet::from([start.0]));
        loop {
            let next = self.next(passages[passages.len() - 1], None)?;
            match next {
                Next::Road(passage) | Next::Connection(passage, _) if seen.insert(passage.0) => {
                    passages.push(passage)
                }
                Next::Junction(..) => return Ok((passages, Some(next))),
                Next::Outside(..) => return Ok((passages, Some(next))),
                Next::End | Next::Road(_) | Next::Connection(..) => return Ok((passages, None)),
            }
        }
    }
}
