//! A course as an OpenDRIVE file: one road with one driving lane whose centre is the reference line.

use std::fmt::Write;

use super::super::piece::Pose;
use super::super::{Centreline, Course};

/// An element of the plan view with what lies along it.
struct Element {
    length_m: f64,
    start: Pose,
    curvature_1pm: [f64; 2],
    bank_rad: [f64; 2],
    grade: [f64; 2],
    width_m: [f64; 2],
}

pub(crate) fn write(course: &Course) -> String {
    let elements = elements(course);
    let length_m: f64 = elements.iter().map(|element| element.length_m).sum();
    let (mut plan, mut superelevation, mut elevation) = (String::new(), String::new(), String::new());
    let (mut offset, mut width) = (String::new(), String::new());
    let (mut last_bank, mut last_grade, mut last_width) = (Linear::NONE, Linear::NONE, Linear::NONE);
    let (mut s, mut z) = (0.0, 0.0);
    for element in &elements {
        let l = &element.length_m;
        line(&mut plan, 3, &geometry(element, s));
        let slope = |[start, end]: [f64; 2]| (end - start) / l;
        if last_bank.changes(s, element.bank_rad, *l) {
            let [a, b] = [element.bank_rad[0], slope(element.bank_rad)];
            line(
                &mut superelevation,
                3,
                &record("superelevation", "s", s, [a, b, 0.0]),
            );
        }
        if last_grade.changes(s, element.grade, *l) {
            let [b, c] = [element.grade[0], 0.5 * slope(element.grade)];
            line(&mut elevation, 3, &record("elevation", "s", s, [z, b, c]));
        }
        if last_width.changes(s, element.width_m, *l) {
            let [a, b] = [element.width_m[0], slope(element.width_m)];
            line(
                &mut offset,
                3,
                &record("laneOffset", "s", s, [0.5 * a, 0.5 * b, 0.0]),
            );
            line(&mut width, 7, &record("width", "sOffset", s, [a, b, 0.0]));
        }
        z += 0.5 * (element.grade[0] + element.grade[1]) * l;
        s += l;
    }
    let name = escaped(course.name());
    format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<OpenDRIVE>
  <header revMajor="1" revMinor="7" name="{name}" vendor="host-sim"/>
  <road name="{name}" length="{length_m}" id="1" junction="-1" rule="RHT">
    <planView>
{plan}    </planView>
    <elevationProfile>
{elevation}    </elevationProfile>
    <lateralProfile>
{superelevation}    </lateralProfile>
    <lanes>
{offset}      <laneSection s="0">
        <center>
          <lane id="0" type="none" level="false"/>
        </center>
        <right>
          <lane id="-1" type="driving" level="false">
{width}          </lane>
        </right>
      </laneSection>
    </lanes>
  </road>
</OpenDRIVE>
"#
    )
}

/// The element of the plan view that begins at arc length `s`, m.
fn geometry(element: &Element, s: f64) -> String {
    let Element {
        length_m: l,
        start: Pose {
            x_m,
            y_m,
            heading_rad,
        },
        curvature_1pm: [k0, k1],
        ..
    } = element;
    let kind = match (k0 == k1, *k0 == 0.0) {
        (true, true) => "<line/>".into(),
        (true, false) => format!("<arc curvature=\"{k0:e}\"/>"),
        (false, _) => format!("<spiral curvStart=\"{k0:e}\" curvEnd=\"{k1:e}\"/>"),
    };
    format!(
        "<geometry s=\"{s}\" x=\"{x_m}\" y=\"{y_m}\" hdg=\"{heading_rad}\" length=\"{l}\">{kind}</geometry>"
    )
}

/// A quantity that goes on linearly needs no new record.
struct Linear {
    start_m: f64,
    value: f64,
    slope: f64,
}

impl Linear {
    const NONE: Self = Self {
        start_m: 0.0,
        value: f64::NAN,
        slope: 0.0,
    };

    /// Whether the ends of the stretch from `s_m` on are not on the line so far; then they are the line.
    fn changes(&mut self, s_m: f64, [start, end]: [f64; 2], length_m: f64) -> bool {
        let constant = self.slope == 0.0 && start == end && start == self.value;
        let at = |s: f64| self.value + self.slope * (s - self.start_m);
        let close = |a: f64, b: f64| (a - b).abs() < 1e-12;
        let goes_on =
            self.slope != 0.0 && start != end && close(at(s_m), start) && close(at(s_m + length_m), end);
        if constant || goes_on {
            return false;
        }
        *self = Self {
            start_m: s_m,
            value: start,
            slope: (end - start) / length_m,
        };
        true
    }
}

fn elements(course: &Course) -> Vec<Element> {
    let start = Centreline::new(course);
    match course.pieces() {
        Some(pieces) => {
            let element = |piece: &super::super::piece::Piece| {
                let half = 0.5 * piece.length_m;
                let ends = [-half, half].map(|s| piece.curvature_1pm + piece.curvature_slope_1pm2 * s);
                Element {
                    length_m: piece.length_m,
                    start: piece.pose_at(-half),
                    curvature_1pm: ends,
                    bank_rad: piece.bank_rad,
                    grade: piece.grade,
                    width_m: piece.width_m,
                }
            };
            pieces.iter().map(element).collect()
        }
        None => {
            let mut s_m = 0.0;
            let element = |segment: &super::super::Segment| {
                let (pose, ..) = start.at(s_m);
                s_m += segment.length_m;
                Element {
                    length_m: segment.length_m,
                    start: pose,
                    curvature_1pm: [segment.curvature_start_1pm, segment.curvature_end_1pm],
                    bank_rad: segment.bank_rad,
                    grade: segment.grade,
                    width_m: [course.lane_width_m(); 2],
                }
            };
            course.segments().iter().map(element).collect()
        }
    }
}

fn record(element: &str, start: &str, s: f64, [a, b, c]: [f64; 3]) -> String {
    format!("<{element} {start}=\"{s}\" a=\"{a:e}\" b=\"{b:e}\" c=\"{c:e}\" d=\"0\"/>")
}

fn line(text: &mut String, indent: usize, content: &str) {
    let _ = writeln!(text, "{:width$}{content}", "", width = 2 * indent);
}

fn escaped(text: &str) -> String {
    let text = text.replace('&', "&amp;").replace('<', "&lt;");
    text.replace('>', "&gt;").replace('"', "&quot;")
}
