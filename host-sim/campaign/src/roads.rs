//! The roads of the campaign: a straight, a curve, and if it ends a straight, each piece as long as a vehicle takes so many
//! seconds for.

use haptic_sim::models::road::{Course, DEFAULT_LANE_WIDTH_M, Segment};
use haptic_sim::worlds::Surface;

use super::speed_change::SpeedChange;
use super::table::PlaceOnRoad;

/// Lateral acceleration in the arc, m/s2: the paper course's first curve at 60 km/h.
const LATERAL_M_PER_S2: f64 = 0.926;
/// Where the heading has to pass pi the curve is tighter, or a run would take a minute.
pub(super) const TURN_KMH: f64 = 40.0;
const TURN_M_PER_S2: f64 = 2.0;
/// To where the road goes on behind the end of a run, s: far enough for who looks ahead.
const BEYOND_S: f64 = 2.0;

/// The straight before the arc and the arc, s, for a place.
fn lengths_s(place: PlaceOnRoad) -> [f64; 2] {
    match place {
        PlaceOnRoad::In => [0.5, f64::INFINITY],
        // The curve begins 0.2 to 1.7 s after the onset.
        PlaceOnRoad::Before => [3.2, f64::INFINITY],
        // It ends 0.3 to 1.8 s before it.
        PlaceOnRoad::After => [0.5, 1.2],
    }
}

/// A road for a run of so many ms: the lengths of its pieces, the curvature of its arc, and how far the vehicle goes from an
/// instant on within a time, m.
struct CurvePlan<'a> {
    lengths_s: [f64; 2],
    curvature_1pm: f64,
    run_ms: u32,
    surface: Surface,
    way_m: &'a dyn Fn(f64, f64) -> f64,
}

impl CurvePlan<'_> {
    /// A straight of so long, a clothoid of 1 s, an arc, and if the arc ends a clothoid and a straight; on to the end of a
    /// run.
    fn course(&self) -> Course {
        let (curvature_1pm, way_m) = (self.curvature_1pm, self.way_m);
        let [straight_s, arc_s] = self.lengths_s;
        let [level, banked] = [
            self.surface.straight_rad(),
            self.surface.curve_rad(0.6_f64.copysign(curvature_1pm)),
        ];
        let piece = |segment: Segment, bank_rad| segment.with_surface(bank_rad, [0.0; 2]);
        let rest_s = f64::from(self.run_ms) * 1e-3 + BEYOND_S;
        let (enters_s, arc_at_s) = (straight_s, straight_s + 1.0);
        let mut segments = vec![
            piece(Segment::straight(way_m(0.0, straight_s)), [level; 2]),
            piece(
                Segment::clothoid(way_m(enters_s, 1.0), 0.0, curvature_1pm),
                [level, banked],
            ),
            piece(
                Segment::arc(way_m(arc_at_s, arc_s.min(rest_s)), curvature_1pm),
                [banked; 2],
            ),
        ];
        if arc_s < rest_s {
            let leaves_s = arc_at_s + arc_s;
            segments.push(piece(
                Segment::clothoid(way_m(leaves_s, 1.0), curvature_1pm, 0.0),
                [banked, level],
            ));
            segments.push(piece(
                Segment::straight(way_m(leaves_s + 1.0, rest_s)),
                [level; 2],
            ));
        }
        Course::new("curve of the fault campaign", DEFAULT_LANE_WIDTH_M, segments)
            .expect("in range at these speeds")
    }
}

/// Curving left and right, for a run at one speed.
fn at_one_speed(
    kmh: f64,
    lateral_m_per_s2: f64,
    lengths_s: [f64; 2],
    run_ms: u32,
    surface: Surface,
) -> [Course; 2] {
    let v = kmh / 3.6;
    [1.0, -1.0].map(|side| {
        CurvePlan {
            lengths_s,
            curvature_1pm: side * lateral_m_per_s2 / (v * v),
            run_ms,
            surface,
            way_m: &|_, lasts_s| lasts_s * v,
        }
        .course()
    })
}

/// Curving left and right, with a place for the onset.
pub(super) fn curve(kmh: f64, place: PlaceOnRoad, run_ms: u32, surface: Surface) -> [Course; 2] {
    at_one_speed(kmh, LATERAL_M_PER_S2, lengths_s(place), run_ms, surface)
}

/// On which the heading passes +-pi, with so much time behind that.
pub(super) fn turning(after_ms: u32, surface: Surface) -> [Course; 2] {
    let lengths_s = lengths_s(PlaceOnRoad::In);
    at_one_speed(
        TURN_KMH,
        TURN_M_PER_S2,
        lengths_s,
        turned_ms() + after_ms,
        surface,
    )
}

/// When the heading of the turning road passes pi.
pub(super) fn turned_ms() -> u32 {
    let rad_per_s = TURN_M_PER_S2 / (TURN_KMH / 3.6);
    // The clothoid turns half as fast for 1 s, after the straight.
    ((1.0 + std::f64::consts::PI / rad_per_s) * 1e3) as u32
}

/// Where the vehicle of a run whose speed changes meets the pieces at the same instants. The arc has the campaign's lateral
/// acceleration where the vehicle is fastest in it, and less elsewhere.
#[derive(Debug, Clone, Copy)]
pub(super) struct ChangingRoad {
    pub(super) change: SpeedChange,
    /// What lies behind the onset, ms.
    pub(super) after_ms: u32,
    /// 1 to the left, -1 to the right.
    pub(super) side: f64,
    pub(super) surface: Surface,
}

impl ChangingRoad {
    fn curvature_1pm(&self, lateral_m_per_s2: f64) -> f64 {
        let v = self.change.fastest_m_per_s(f64::from(self.after_ms) * 1e-3);
        self.side * lateral_m_per_s2 / (v * v)
    }

    fn course(&self, onset_ms: u32, lengths_s: [f64; 2], curvature_1pm: f64) -> Course {
        let onset_s = f64::from(onset_ms) * 1e-3;
        let way_m = |from_s: f64, lasts_s: f64| {
            let at = |time_s: f64| self.change.way_m(time_s - onset_s);
            at(from_s + lasts_s) - at(from_s)
        };
        CurvePlan {
            lengths_s,
            curvature_1pm,
            run_ms: onset_ms + self.after_ms,
            surface: self.surface,
            way_m: &way_m,
        }
        .course()
    }

    /// A road of this world with a place for an onset.
    pub(super) fn curve(&self, place: PlaceOnRoad, onset_ms: u32) -> Course {
        self.course(onset_ms, lengths_s(place), self.curvature_1pm(LATERAL_M_PER_S2))
    }

    /// On which the heading passes +-pi at the onset, and that onset, ms.
    pub(super) fn turning(&self) -> (Course, u32) {
        let curvature_1pm = self.curvature_1pm(TURN_M_PER_S2);
        let lengths_s = lengths_s(PlaceOnRoad::In);
        let v = self.change.first_m_per_s();
        // Straight and clothoid lie long before the change; the clothoid turns half as much as an arc.
        let turned_m = v * (lengths_s[0] + 0.5) + std::f64::consts::PI / curvature_1pm.abs();
        let onset_s = self.change.time_s_of(turned_m);
        let onset_ms = (onset_s * 1e3).round() as u32;
        (self.course(onset_ms, lengths_s, curvature_1pm), onset_ms)
    }
}
