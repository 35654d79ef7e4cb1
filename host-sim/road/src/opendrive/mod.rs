//! A lane of an OpenDRIVE file (ASAM, 1.4 to 1.8) as a course, and a course as an OpenDRIVE file.
//!
//! `xml` looks into elements, `profile` holds cubic polynomials along a road, `geometry` and
//! `polynomial` are the reference line,
//! `road` the lanes, `lane_centre` the curve that is driven; `network` knows which road follows which, `choice`
//! where the course begins, and this file follows it from there. `write` is the way back.
//!
//! Signs in a course are those of the direction of travel: traffic keeps to the right unless the road says `LHT`,
//! so a lane with a positive id is driven against the road's s, its curvature and bank change sign. Followed are
//! planView, laneOffset, lane widths, superelevation, crossfall, shape, elevation, links of roads and lanes, and
//! junctions that leave one way only, or one that is chosen. Where the lane or the file ends, the way ends, and a note says so.
//! Not followed: `<border>` in place of widths, the height of lanes, OpenCRG
//! surfaces, `<include>`.

mod choice;
mod error;
mod geometry;
mod lane_centre;
mod network;
mod polynomial;
mod profile;
mod road;
mod segments;
mod write;
mod xml;

use roxmltree::{Document, ParsingOptions};
use serde::Serialize;

use self::error::{RoadError, refuse};
use self::lane_centre::{MOST_PIECES, Stretch, stretch};
use self::network::{Network, Next, Passage, listed};
use self::road::{Lane, Road};
use super::Course;
use super::piece::{Piece, Pose};

pub use self::choice::LaneChoice;
pub(super) use self::write::write;

/// Most that a lane's centre may jump, m: widths of some files have steps.
const GAP_M: f64 = 1.0;
/// A jump that the reader is told of, m.
const NOTED_M: f64 = 0.02;
/// Most that its heading may jump, rad.
const KINK_RAD: f64 = 0.2;

/// A road that a course runs on.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct RoadUsed {
    /// Its id in the file.
    pub road: String,
    /// The lane on entering it.
    pub lane: i32,
    /// Whether it is driven in the direction of its s.
    pub along_s: bool,
}

/// Reads a lane.
///
/// # Errors
/// A sentence without the file's name.
pub(super) fn read(name: &str, text: &str, choice: &LaneChoice) -> Result<Course, RoadError> {
    let options = ParsingOptions {
        allow_dtd: true,
        ..ParsingOptions::default()
    };
    let text = text.trim_start_matches('\u{feff}');
    let document =
        Document::parse_with_options(text, options).map_err(|e| format!("not well-formed XML: {e}"))?;
    let root = document.root_element();
    if root.tag_name().name() != "OpenDRIVE" {
        let found = root.tag_name().name();
        return refuse(format!(
            "not an OpenDRIVE file: its root is <{found}>, not <OpenDRIVE>"
        ));
    }
    let network = Network::read(root, &choice.turns)?;
    let mut drive = Drive::begin(&network, choice)?;
    drive.follow()?;
    let not_taken = |turn: &&String| {
        drive.outside != Some(turn.as_str()) && drive.roads.iter().all(|used| used.road != **turn)
    };
    if let Some(turn) = choice.turns.iter().find(not_taken) {
        let notes = drive.notes.join("; ");
        return refuse(format!(
            "turn {turn}: no junction on the way leads there ({notes})"
        ));
    }
    let Drive {
        pieces,
        segments,
        roads,
        notes,
        ..
    } = drive;
    let exact = segments::of_own(&network, &roads);
    let course = match exact {
        Some((lane_width_m, exact)) => Course::of_segments(name, lane_width_m, exact),
        None => Course::of_pieces(name, pieces, segments),
    };
    Ok(course.with_roads(roads, notes))
}

/// A course in the making: where it has come to.
struct Drive<'n, 'a> {
    network: &'n Network<'a>,
    passage: Passage,
    lane: i32,
    pieces: Vec<Piece>,
    segments: Vec<super::Segment>,
    roads: Vec<RoadUsed>,
    /// Where the way goes on to that is not in the file.
    outside: Option<&'a str>,
    notes: Vec<String>,
}

impl<'n, 'a> Drive<'n, 'a> {
    fn begin(network: &'n Network<'a>, choice: &LaneChoice) -> Result<Self, RoadError> {
        let mut notes = Vec::new();
        let (passage, lane) = choice::start(network, choice, &mut notes)?;
        Ok(Self {
            network,
            passage,
            lane,
            pieces: Vec::new(),
            segments: Vec::new(),
            roads: Vec::new(),
            outside: None,
            notes,
        })
    }

    /// Drives on from road to road until the way ends.
    fn follow(&mut self) -> Result<(), RoadError> {
        loop {
            let (index, along) = self.passage;
            let id = self.network.roads[index].id;
            let here = RoadUsed {
                road: id.into(),
                lane: self.lane,
                along_s: along,
            };
            if self.roads.contains(&here) {
                self.notes.push(format!(
                    "the way is a ring: it ends where it comes to road {id} again"
                ));
                return Ok(());
            }
            self.roads.push(here);
            let road = Road::read(id, self.network.roads[index].node)?;
            let Some(links) = self.through_sections(&road, along)? else {
                return Ok(());
            };
            let lane = self.lane;
            (self.passage, self.lane) = match self.network.next(self.passage, Some(lane))? {
                Next::End => return Ok(()),
                Next::Outside(target, what) => {
                    self.outside = Some(target);
                    self.notes.push(format!("the way ends with road {id}: {what}"));
                    return Ok(());
                }
                Next::Road(passage) => match one_link(lane, &links) {
                    Some(next) => (passage, next),
                    None => {
                        let next = self.network.roads[passage.0].id;
                        self.notes.push(format!(
                            "the way ends with road {id}: lane {lane} goes on to no lane of road {next}"
                        ));
                        return Ok(());
                    }
                },
                Next::Connection(passage, to) => (passage, to.unwrap_or(lane)),
                Next::Junction(junction, ways) => {
                    self.notes.push(match &ways[..] {
                        [] => format!("the way ends at junction {junction}: road {id} lane {lane} does not go on there"),
                        _ => format!(
                            "the way ends at junction {junction}: road {id} lane {lane} goes on there to roads {}; --turn ID \
                             takes one of them",
                            listed(&ways)
                        ),
                    });
                    return Ok(());
                }
            };
        }
    }

    /// Drives through the sections of a road; returns the links of its last lane onwards, or nothing if the way ends before.
    fn through_sections(&mut self, road: &Road, along: bool) -> Result<Option<Vec<i32>>, RoadError> {
        let (id, stated_m, length_m) = (road.id, road.stated_m, road.length_m);
        if (stated_m - length_m).abs() > NOTED_M {
            self.notes.push(format!(
                "road {id} says that it is {stated_m} m long, and its geometry is {length_m} m: the geometry is driven"
            ));
        }
        let mut sections = road.sections(self.lane)?;
        if !along {
            sections.reverse();
        }
        let mut links = Vec::new();
        for (i, section) in sections.iter().enumerate() {
            if i > 0 {
                let next = match section.lane(self.lane) {
                    // Files that link no lanes at all inside a road mean the same id.
                    Some(same) if links.is_empty() && same.links(!along).is_empty() => Some(same.id),
                    _ => one_link(self.lane, &links),
                };
                let Some(next) = next else {
                    let (id, lane) = (road.id, self.lane);
                    let s_m = if along { section.start_m } else { section.end_m };
                    self.notes.push(format!(
                        "the way ends in road {id} at s = {s_m} m: lane {lane} goes on to no lane there"
                    ));
                    return Ok(None);
                };
                self.lane = next;
            }
            let lane: Lane = section.need(road.id, self.lane)?;
            let piece = stretch(road, section, self.lane)?;
            self.append(
                if along { piece } else { piece.reversed() },
                road.id,
                section.start_m,
            )?;
            links = lane.links(along);
        }
        Ok(Some(links))
    }

    fn append(&mut self, mut stretch: Stretch, road: &str, s_m: f64) -> Result<(), RoadError> {
        let mut heading = self.pieces.last().map(|last| last.middle.heading_rad);
        for piece in &mut stretch.pieces {
            // Headings count full turns.
            if let Some(last) = heading {
                let turns = ((piece.middle.heading_rad - last) / std::f64::consts::TAU).round();
                piece.middle.heading_rad -= turns * std::f64::consts::TAU;
            }
            heading = Some(piece.middle.heading_rad);
        }
        if self.pieces.len() + stretch.pieces.len() > MOST_PIECES {
            return refuse(format!(
                "road {road}: in the section at s = {s_m} m the way has come to more than {MOST_PIECES} pieces; begin \
                 nearer to its end"
            ));
        }
        let joints = self.pieces.last().into_iter().chain(&stretch.pieces);
        let joints: Vec<&Piece> = joints.collect();
        for pair in joints.windows(2) {
            let [before, after] =
                [(pair[0], 0.5), (pair[1], -0.5)].map(|(p, end)| p.pose_at(end * p.length_m));
            let Pose {
                x_m,
                y_m,
                heading_rad,
            } = before.to_local(after);
            let (gap_m, lane, degrees) = (x_m.hypot(y_m), self.lane, heading_rad.to_degrees());
            if gap_m > GAP_M || heading_rad.abs() > KINK_RAD {
                return refuse(format!(
                    "road {road}: in the section at s = {s_m} m the centre of lane {lane} does not continue the way so \
                     far: it is {gap_m:.2} m beside it and turned by {degrees:.1} degrees"
                ));
            }
            if gap_m > NOTED_M {
                self.notes.push(format!(
                    "the centre of the lane jumps by {gap_m:.2} m in road {road}, lane {lane}, section at s = {s_m} m"
                ));
            }
        }
        self.pieces.append(&mut stretch.pieces);
        self.segments.append(&mut stretch.segments);
        Ok(())
    }
}

/// The one lane that a lane is linked to, if it is to any.
fn one_link(lane: i32, links: &[i32]) -> Option<i32> {
    let same = links.iter().find(|id| **id == lane);
    same.or(links.first()).copied()
}
