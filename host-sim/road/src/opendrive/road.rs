//! A road of an OpenDRIVE file: its reference line, its profiles and its lane sections.

use std::fmt::Write;

use roxmltree::Node;

use super::error::{RoadError, refuse};
use super::geometry::{self, Geometry};
use super::profile::{Cubic, Profile};
use super::xml::{child, children, number, text};

/// Lane sections closer than this to the end of a road hold nothing, m.
const LEAST_SECTION_M: f64 = 1e-6;

/// A road.
#[derive(Debug)]
pub(super) struct Road<'a> {
    pub(super) id: &'a str,
    pub(super) line: Vec<Geometry>,
    /// The length that the road states.
    pub(super) stated_m: f64,
    /// The length that its geometry has.
    pub(super) length_m: f64,
    pub(super) lane_offset: Profile,
    pub(super) superelevation: Profile,
    pub(super) elevation: Profile,
    /// Crossfall of the left and of the right side, rad, positive falling outwards (1.4 and 1.5 have it).
    pub(super) crossfall: [Profile; 2],
    /// Cross sections of the surface: s, and cubics over t.
    pub(super) shapes: Vec<(f64, Profile)>,
    sections: Vec<Node<'a, 'a>>,
}

/// A lane section as one side of the road sees it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Section<'a> {
    pub(super) start_m: f64,
    pub(super) end_m: f64,
    node: Node<'a, 'a>,
}

/// A lane in a lane section.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lane<'a> {
    pub(super) id: i32,
    node: Node<'a, 'a>,
}

impl<'a> Road<'a> {
    /// # Errors
    /// What is broken or not supported.
    pub(super) fn read(id: &'a str, node: Node<'a, 'a>) -> Result<Self, RoadError> {
        let place = format!("road {id}");
        let stated_m = number(node, "length", &place)?;
        if stated_m < 0.0 {
            return refuse(format!("{place}: length = {stated_m} m is negative"));
        }
        let need = |parent, name| child(parent, name).ok_or_else(|| format!("{place}: it has no <{name}>"));
        let line = geometry::read(id, need(node, "planView")?)?;
        let last = &line[line.len() - 1];
        let length_m = last.start_m + last.length_m;
        let lanes = need(node, "lanes")?;
        let lateral = child(node, "lateralProfile");
        let of_lateral = |name| lateral.into_iter().flat_map(move |l| children(l, name));
        let within = |name: &str| format!("{place}: {name}");
        let crossfall = |side: &str| {
            let on_side = |n: &Node| matches!(text(*n, "side"), Some(s) if s == side || s == "both");
            Profile::read(
                of_lateral("crossfall").filter(on_side),
                "s",
                0.0,
                &within("lateralProfile"),
            )
        };
        let elevations = child(node, "elevationProfile").into_iter();
        let elevations = elevations.flat_map(|e| children(e, "elevation"));
        let road = Self {
            id,
            stated_m,
            length_m,
            lane_offset: Profile::read(children(lanes, "laneOffset"), "s", 0.0, &within("lanes"))?,
            superelevation: Profile::read(of_lateral("superelevation"), "s", 0.0, &within("lateralProfile"))?,
            elevation: Profile::read(elevations, "s", 0.0, &within("elevationProfile"))?,
            crossfall: [crossfall("left")?, crossfall("right")?],
            shapes: shapes(of_lateral("shape"), &within("lateralProfile"))?,
            sections: children(lanes, "laneSection").collect(),
            line,
        };
        if road.sections.is_empty() {
            return refuse(format!("{place}: it has no <laneSection>"));
        }
        Ok(road)
    }

    /// The lane sections that hold for the side of a lane (negative: right), in order of s.
    ///
    /// # Errors
    /// A section without a place, sections that do not ascend.
    pub(super) fn sections(&self, lane: i32) -> Result<Vec<Section<'a>>, RoadError> {
        let place = format!("road {}: laneSection", self.id);
        let side = if lane < 0 { "right" } else { "left" };
        let mut sections: Vec<Section> = Vec::new();
        for node in &self.sections {
            let start_m = number(*node, "s", &place)?;
            let single = matches!(text(*node, "singleSide"), Some("true" | "1"));
            if single && child(*node, side).is_none() {
                continue;
            }
            if let Some(last) = sections.last_mut() {
                if start_m < last.start_m {
                    return refuse(format!("{place}: the sections are not in ascending order of s"));
                }
                last.end_m = start_m.min(self.length_m);
            } else if start_m > 0.01 {
                return refuse(format!(
                    "{place}: the first section has to begin at s = 0, not at {start_m} m"
                ));
            }
            sections.push(Section {
                start_m,
                end_m: self.length_m,
                node: *node,
            });
        }
        sections.retain(|section| section.end_m - section.start_m > LEAST_SECTION_M);
        if sections.is_empty() {
            return refuse(format!("{place}: no section is longer than nothing"));
        }
        Ok(sections)
    }

    /// Slope of the surface across the road beside the superelevation, rad, positive where left is higher.
    pub(super) fn cross_slope(&self, s_m: f64, middle_m: f64, t_m: f64) -> f64 {
        let side = usize::from(t_m < 0.0);
        let fall = self.crossfall[side].piece_at(middle_m).at(s_m)[0];
        let outward = if t_m < 0.0 { fall } else { -fall };
        let after = self.shapes.partition_point(|(s, _)| *s <= middle_m);
        let Some(index) = after.checked_sub(1) else {
            return outward;
        };
        let slope = |index: usize| self.shapes[index].1.piece_at(t_m).at(t_m)[1];
        let here = slope(index);
        let shaped = match self.shapes.get(index + 1) {
            Some((next_m, _)) => {
                let share = (s_m - self.shapes[index].0) / (next_m - self.shapes[index].0);
                here + share * (slope(index + 1) - here)
            }
            None => here,
        };
        outward + shaped.atan()
    }
}

fn shapes<'a>(
    nodes: impl Iterator<Item = Node<'a, 'a>>,
    place: &str,
) -> Result<Vec<(f64, Profile)>, RoadError> {
    let mut shapes: Vec<(f64, Profile)> = Vec::new();
    for node in nodes {
        let s_m = number(node, "s", place)?;
        let Profile(mut cubic) = Profile::read(std::iter::once(node), "t", 0.0, place)?;
        match shapes.last_mut() {
            Some((last_m, cubics)) if *last_m == s_m => cubics.0.append(&mut cubic),
            Some((last_m, _)) if *last_m > s_m => {
                return refuse(format!(
                    "{place}: the <shape> elements are not in ascending order of s"
                ));
            }
            _ => shapes.push((s_m, Profile(cubic))),
        }
    }
    for (_, Profile(cubics)) in &mut shapes {
        cubics.sort_by(|a, b| a.start_m.total_cmp(&b.start_m));
    }
    Ok(shapes)
}

impl<'a> Section<'a> {
    /// All lanes but the centre's, in the order of the file.
    pub(super) fn lanes(&self) -> impl Iterator<Item = Lane<'a>> + use<'a> {
        let sides = ["left", "right"].map(|side| children(self.node, side));
        let nodes = sides
            .into_iter()
            .flatten()
            .flat_map(|side| children(side, "lane"));
        nodes.filter_map(|node| {
            let id: i16 = text(node, "id")?.parse().ok().filter(|id| *id != 0)?;
            Some(Lane { id: id.into(), node })
        })
    }

    pub(super) fn lane(&self, id: i32) -> Option<Lane<'a>> {
        self.lanes().find(|lane| lane.id == id)
    }

    /// The lane, or what is there instead.
    pub(super) fn need(&self, road: &str, id: i32) -> Result<Lane<'a>, RoadError> {
        self.lane(id).ok_or_else(|| {
            let mut there = String::new();
            for lane in self.lanes() {
                let comma = if there.is_empty() { "" } else { ", " };
                let _ = write!(there, "{comma}{}", lane.id);
            }
            let there = if there.is_empty() { "none".into() } else { there };
            let start_m = self.start_m;
            format!("road {road}: the lane section at s = {start_m} m has no lane {id}; it has {there}")
                .into()
        })
    }
}

impl<'a> Lane<'a> {
    /// `driving`, `shoulder`, ...
    pub(super) fn kind(&self) -> &'a str {
        text(self.node, "type").unwrap_or("none")
    }

    /// Whether traffic runs against what side and rule say (1.8).
    pub(super) fn is_reversed(&self) -> bool {
        text(self.node, "direction") == Some("reversed")
    }

    /// Whether the superelevation leaves the lane level.
    pub(super) fn is_level(&self) -> bool {
        matches!(text(self.node, "level"), Some("true" | "1"))
    }

    /// The lanes that this one is linked to, at the end of its section or at its start.
    pub(super) fn links(&self, forwards: bool) -> Vec<i32> {
        let name = if forwards { "successor" } else { "predecessor" };
        let links = child(self.node, "link")
            .into_iter()
            .flat_map(|link| children(link, name));
        links.filter_map(|link| text(link, "id")?.parse().ok()).collect()
    }

    /// The widths in terms of the road's s.
    ///
    /// # Errors
    /// None given, or one that is broken.
    pub(super) fn widths(&self, road: &str, section: &Section) -> Result<Profile, RoadError> {
        let (id, start_m) = (self.id, section.start_m);
        let place = format!("road {road}: lane {id} of the section at s = {start_m} m");
        let widths = Profile::read(children(self.node, "width"), "sOffset", start_m, &place)?;
        match widths.0.first() {
            None if child(self.node, "border").is_some() => {
                refuse(format!("{place}: <border> is not supported, only <width>"))
            }
            None => refuse(format!("{place}: it has no <width>")),
            Some(Cubic { start_m: first_m, .. }) if *first_m > start_m + 0.01 => refuse(format!(
                "{place}: its first <width> has sOffset = {} m, not 0",
                first_m - start_m
            )),
            Some(_) => Ok(widths),
        }
    }
}
