//! The way back from a file that `write` made: straights, arcs and clothoids whose lane lies on the reference line
//! are segments again, as exact as they were.

use super::RoadUsed;
use super::geometry::{Geometry, Kind};
use super::network::Network;
use super::profile::Profile;
use super::road::Road;
use crate::Segment;
use crate::piece::Pose;

/// Elements that follow one another as closely as this are one course from the origin on, m and rad.
const CHAINED: f64 = 1e-6;

/// Width of the lane and the segments, if the course is such a file's.
pub(super) fn of_own(network: &Network, used: &[RoadUsed]) -> Option<(f64, Vec<Segment>)> {
    let [only] = used else { return None };
    let node = network.roads.iter().find(|road| road.id == only.road)?;
    let road = Road::read(node.id, node.node).ok()?;
    let sections = road.sections(only.lane).ok()?;
    let ([section], true) = (&sections[..], only.along_s && only.lane.abs() == 1) else {
        return None;
    };
    let widths = section.lane(only.lane)?.widths(node.id, section).ok()?;
    let ([width], [offset]) = (&widths.0[..], &road.lane_offset.0[..]) else {
        return None;
    };
    let [width_m, 0.0, 0.0, 0.0] = width.factors else {
        return None;
    };
    let sides = [width_m * 0.5 * f64::from(-only.lane), 0.0, 0.0, 0.0];
    let plain = road.shapes.is_empty() && road.crossfall.iter().all(|profile| profile.0.is_empty());
    if offset.factors != sides || !plain {
        return None;
    }
    let mut end = Pose::default();
    let mut segments = Vec::with_capacity(road.line.len());
    for geometry in &road.line {
        let Kind::Clothoid { curvature_1pm, .. } = &geometry.kind else {
            return None;
        };
        let Pose {
            x_m,
            y_m,
            heading_rad,
        } = end.to_local(geometry.start);
        let wrapped = (heading_rad / std::f64::consts::TAU).round() * std::f64::consts::TAU;
        if x_m.hypot(y_m) > CHAINED || (heading_rad - wrapped).abs() > CHAINED {
            return None;
        }
        end = geometry.at(geometry.start_m + geometry.length_m).pose;
        let (superelevation, elevation) = (&road.superelevation, &road.elevation);
        segments.push(Segment {
            length_m: geometry.length_m,
            curvature_start_1pm: curvature_1pm[0],
            curvature_end_1pm: curvature_1pm[1],
            bank_rad: ends(superelevation, geometry, 0)?,
            grade: ends(elevation, geometry, 1)?,
        });
    }
    Some((width_m, segments))
}

/// A profile's value (`order` 0) or slope (1) at both ends of an element, if it is linear in between.
fn ends(profile: &Profile, geometry: &Geometry, order: usize) -> Option<[f64; 2]> {
    let (from_m, to_m) = (geometry.start_m, geometry.start_m + geometry.length_m);
    let inside = |s_m: f64| s_m > from_m + CHAINED && s_m < to_m - CHAINED;
    let cubic = profile.piece_at(0.5 * (from_m + to_m));
    let bent = cubic.factors[order + 2..].iter().any(|factor| *factor != 0.0);
    if bent || profile.starts_m().any(inside) {
        return None;
    }
    Some([from_m, to_m].map(|s_m| cubic.at(s_m)[order]))
}
