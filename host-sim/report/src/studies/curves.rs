//! The curves of a course, and the stretches without guidance, as shaded stretches of a figure over the road.

use crate::plot::{Band, Shade};
use haptic_batch::statistics::extent;
use haptic_sim::models::road::{Centreline, Course};
use haptic_sim::unguided::Unguided;

/// Less is straight, 1/m: a bank that changes bends the middle of a lane by some millionths.
const STRAIGHT_1PM: f64 = 2e-5;
/// An arc's curvature stays within this share of itself: that of a lane at its side changes with the bank too.
const ARC: f64 = 0.02;

/// Where the curvature changes in the lighter shade, arcs in the darker; straights stay white.
pub(super) fn bands(course: &Course) -> Vec<Band> {
    let line = Centreline::new(course);
    // Where it changes linearly from one end to the other.
    let changing = if course.is_of_segments() {
        "clothoid"
    } else {
        "curvature changes"
    };
    let mut from = 0.0;
    let mut bands = Vec::new();
    for segment in course.segments() {
        let to = from + segment.length_m;
        // The ends alone would not tell a bend and its mirror image from a straight.
        let inside = [0.25, 0.5, 0.75].map(|share| line.at(from + share * segment.length_m).1);
        let curvatures = [segment.curvature_start_1pm, segment.curvature_end_1pm]
            .into_iter()
            .chain(inside);
        let [least, most] = extent(curvatures);
        let largest = most.max(-least);
        if largest > STRAIGHT_1PM {
            let dark = most - least <= ARC * largest;
            let (label, shade) = if dark {
                ("arc", Shade::Dark)
            } else {
                (changing, Shade::Light)
            };
            bands.push(Band::new(label, [from, to], shade));
        }
        from = to;
    }
    bands
}

/// Stretches of a run without guidance, with why.
pub(super) fn unguided(stretches: &[Unguided]) -> impl Iterator<Item = Band> {
    stretches.iter().map(|stretch| {
        let label = format!("no guidance: {}", stretch.why);
        Band::new(label, [stretch.from_m, stretch.to_m], Shade::Alert)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptic_sim::models::road::{LaneChoice, Segment};

    fn named(bands: &[Band]) -> Vec<(&str, bool)> {
        bands
            .iter()
            .map(|band| (band.label.as_str(), matches!(band.shade, Shade::Dark)))
            .collect()
    }

    #[test]
    fn clothoids_and_arcs_are_shaded_and_straights_are_not() {
        let segment = |from, to| Segment {
            curvature_start_1pm: from,
            curvature_end_1pm: to,
            ..Segment::straight(100.0)
        };
        let segments = vec![
            segment(0.0, 0.0),
            segment(0.0, 0.004),
            segment(0.004, 0.004),
            segment(0.004, -0.004),
        ];
        let bands = bands(&Course::new("c", 3.6, segments).unwrap());
        assert_eq!(
            named(&bands),
            [("clothoid", false), ("arc", true), ("clothoid", false)]
        );
        assert_eq!((bands[0].from, bands[1].from, bands[2].to), (100.0, 200.0, 400.0));
    }

    /// Three lines in a row; in the second the bank rises by 8 %, which bends the middle of the lane by 0.3 millionths.
    #[test]
    fn a_straight_whose_bank_changes_is_straight() {
        let line = |s: f64| {
            let (x, y) = (s * 0.3_f64.cos(), s * 0.3_f64.sin());
            format!("<geometry s=\"{s}\" x=\"{x}\" y=\"{y}\" hdg=\"0.3\" length=\"200\"><line/></geometry>")
        };
        let bank = |s: f64, a: f64, b: f64| {
            format!("<superelevation s=\"{s}\" a=\"{a}\" b=\"{b}\" c=\"0\" d=\"0\"/>")
        };
        let text = format!(
            "<OpenDRIVE><header/><road name=\"b\" length=\"600\" id=\"1\" junction=\"-1\"><planView>{}{}{}</planView>\
             <lateralProfile>{}{}{}</lateralProfile><lanes><laneSection s=\"0\"><center><lane id=\"0\" type=\"none\"/></center>\
             <right><lane id=\"-1\" type=\"driving\"><width sOffset=\"0\" a=\"3.5\" b=\"0\" c=\"0\" d=\"0\"/></lane></right>\
             </laneSection></lanes></road></OpenDRIVE>",
            line(0.0),
            line(200.0),
            line(400.0),
            bank(0.0, 0.0, 0.0),
            bank(200.0, 0.0, 0.0004),
            bank(400.0, 0.08, 0.0),
        );
        let course = Course::from_text("b.xodr", &text, &LaneChoice::default()).unwrap();
        assert!(!course.is_level());
        let bent = |s_m| Centreline::new(&course).at(s_m).1;
        assert!(bent(300.0) != 0.0 && bent(300.0).abs() < 1e-6, "{}", bent(300.0));
        assert_eq!(named(&bands(&course)), []);
    }
}
