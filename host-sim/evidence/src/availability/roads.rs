//! Roads as they are built: straights and curves in turn, clothoids between them, a crossfall, superelevated curves.

use haptic_sim::models::road::{Course, DEFAULT_LANE_WIDTH_M, Segment};
use haptic_sim::scenario::Speed;
use haptic_sim::worlds::Surface;
use rand::RngExt;
use rand::rngs::Xoshiro256PlusPlus;

use super::SEGMENT_S;

/// A kind of road.
#[derive(Debug, PartialEq)]
pub struct Road {
    /// By which it is asked for.
    pub name: &'static str,
    /// Speeds, from and to, km/h.
    pub speed_kmh: [f64; 2],
    /// Most lateral acceleration in a curve, m/s2.
    pub lateral_m_per_s2: f64,
    /// Standard deviation of the driver's remnant, N.m: gives the SDLP of a competent driver.
    pub(super) remnant_sd_nm: f64,
}

/// The roads of the population.
pub const ROADS: [Road; 2] = [
    Road {
        name: "motorway",
        speed_kmh: [100.0, 130.0],
        lateral_m_per_s2: 1.5,
        remnant_sd_nm: 0.4,
    },
    Road {
        name: "country",
        speed_kmh: [60.0, 100.0],
        lateral_m_per_s2: 2.5,
        remnant_sd_nm: 0.36,
    },
];

/// Least lateral acceleration of a curve that is one, m/s2.
const LEAST_LATERAL_M_PER_S2: f64 = 0.3;
/// Room behind the segment for the points that are looked at, s.
const AHEAD_S: f64 = 3.0;

/// A speed that is held for some seconds, falls to as little as 60 % of the first, and rises again: never beyond the first,
/// for which the curves are built.
pub(super) fn falling_and_rising(first_kmh: f64, rng: &mut Xoshiro256PlusPlus) -> Speed {
    let (mut time, mut kmh) = (vec![0.0], vec![first_kmh]);
    let (mut now_s, mut now_kmh) = (0.0, first_kmh);
    while now_s < SEGMENT_S + AHEAD_S {
        now_s += rng.random_range(3.0..12.0);
        time.push(now_s);
        kmh.push(now_kmh);
        let next_kmh = first_kmh * rng.random_range(0.6..1.0);
        let m_per_s2 = rng.random_range(0.5..3.0);
        now_s += (f64::abs(next_kmh - now_kmh) / 3.6 / m_per_s2).max(0.001);
        now_kmh = next_kmh;
        time.push(now_s);
        kmh.push(now_kmh);
    }
    Speed::by_time_kmh(time, &kmh)
}

impl Road {
    /// A course for a segment: a curve about every 20 s, to either side, as sharp as is drawn.
    pub(super) fn course(
        &self,
        v_m_per_s: f64,
        lateral_m_per_s2: f64,
        surface: Surface,
        rng: &mut Xoshiro256PlusPlus,
    ) -> Course {
        let v = v_m_per_s;
        let mut segments = Vec::new();
        let mut driven_s = 0.0;
        let crossfall_rad = surface.straight_rad();
        while driven_s < SEGMENT_S + AHEAD_S {
            let straight_s = rng.random_range(4.0..10.0);
            let [into_s, arc_s] = [rng.random_range(2.0..3.5), rng.random_range(3.0..9.0)];
            let side = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
            let lateral = rng.random_range(LEAST_LATERAL_M_PER_S2..lateral_m_per_s2);
            let curvature_1pm = side * lateral / (v * v);
            let bank_rad = surface.curve_rad(side * lateral / lateral_m_per_s2);
            let no_grade = [0.0; 2];
            segments.extend([
                Segment::straight(v * straight_s).with_surface([crossfall_rad; 2], no_grade),
                Segment::clothoid(v * into_s, 0.0, curvature_1pm)
                    .with_surface([crossfall_rad, bank_rad], no_grade),
                Segment::arc(v * arc_s, curvature_1pm).with_surface([bank_rad; 2], no_grade),
                Segment::clothoid(v * into_s, curvature_1pm, 0.0)
                    .with_surface([bank_rad, crossfall_rad], no_grade),
            ]);
            driven_s += straight_s + 2.0 * into_s + arc_s;
        }
        Course::new(self.name, DEFAULT_LANE_WIDTH_M, segments).expect("curves in range at these speeds")
    }
}
