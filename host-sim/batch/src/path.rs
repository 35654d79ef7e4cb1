//! A guidance path beside the middle of the lane, around any law: the law's lateral error is that to a line `offset + cut*kappa` left of
//! the middle, kappa the road's curvature at the near point, as the habit *own line* has it for a driver. The curvature is that of a map:
//! drives of a comparison have one speed, so that the place is known by the time.

use std::sync::Arc;

use haptic_sim::kind::{Kind, Make, Origin, Parameter};
use haptic_sim::laws::{Law, LawView};
use haptic_sim::models::STEP_S;
use haptic_sim::models::road::Centreline;
use haptic_sim::scenario::Scenario;

fn path(scenario: &Scenario, v: &[f64], law: Box<dyn Law>) -> Box<dyn Law> {
    Box::new(Path {
        law,
        road: scenario.course().centreline(),
        near_s: scenario.guidance().t_n,
        offset_m: v[0],
        cut_m2: v[1],
    })
}

#[derive(Clone)]
struct Path {
    law: Box<dyn Law>,
    road: Arc<Centreline>,
    near_s: f64,
    offset_m: f64,
    cut_m2: f64,
}

impl Law for Path {
    fn ask(&mut self, view: &LawView) -> f64 {
        let near_s = f64::from(view.step) * STEP_S + self.near_s;
        let (_, curvature, _) = self.road.at(view.speed_m_per_s * near_s);
        let line_m = self.offset_m + self.cut_m2 * curvature;
        self.law.ask(&LawView {
            e_y_m: view.e_y_m + line_m,
            ..*view
        })
    }

    fn k_1(&self) -> Option<f64> {
        self.law.k_1()
    }
}

pub(crate) const KIND: Kind<dyn Law> = Kind {
    name: "path",
    source: "ours",
    origin: Origin::Ours,
    parameters: &[
        Parameter::ours("offset_m", 0.0, [-2.0, 2.0]),
        Parameter::ours("cut_m2", 0.0, [-200.0, 200.0]),
    ],
    make: Make::Around(path),
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parts::{Chosen, Kinds};

    /// The law that it is around tells what it is shown: beside a straight the offset, in an arc of 300 m to the left the cut too.
    #[test]
    fn a_law_is_shown_the_error_to_the_path() {
        let kinds = Kinds::default();
        let scenario = Scenario::builder()
            .course(crate::paper::stretched_curve(1.0).unwrap())
            .build()
            .unwrap();
        let v = scenario.speed_m_per_s();
        let own = Chosen {
            values: vec![Some(0.25), Some(2.0), Some(0.0), Some(0.0), Some(0.0)],
            ..Chosen::named(&kinds.laws, "paper").unwrap()
        };
        let around = |offset_m, cut_m2| {
            let inner = own.make(&scenario, &own.untuned()).unwrap();
            path(&scenario, &[offset_m, cut_m2], inner)
        };
        let road = scenario.course().centreline();
        let arc = (0..)
            .find(|step| road.at(v * (f64::from(*step) * STEP_S + 0.3)).1 > 0.003)
            .unwrap();
        let curvature = road.at(v * (f64::from(arc) * STEP_S + 0.3)).1;
        for (step, offset_m, cut_m2, shown_m) in [
            (0, 0.3, 60.0, 0.3),
            (0, -0.3, 60.0, -0.3),
            (arc, 0.3, 60.0, 0.3 + 60.0 * curvature),
            (arc, 0.3, -60.0, 0.3 - 60.0 * curvature),
        ] {
            let view = LawView {
                step,
                e_y_m: 0.1,
                speed_m_per_s: v,
                ..LawView::default()
            };
            let asked_nm = around(offset_m, cut_m2).ask(&view);
            // K_1 a_1 = 0.5 N.m/m.
            assert!(
                (asked_nm - 0.5 * (0.1 + shown_m)).abs() < 1e-12,
                "{step} {asked_nm}"
            );
        }
    }
}
