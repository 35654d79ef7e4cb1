//! A band with hysteresis: (9) beyond an outer lateral error, until the error is within an inner one. Source: Petermeijer et al. 2015
//! and 2020, of which descriptions were seen: 0.5 m in a car; 0.4 m and 0.15 m in a truck, whose ratio the inner default has.

use super::{Gains, Kind, Law, LawView, Make, boxed};
use crate::kind::{Origin, Parameter};

#[derive(Debug, Clone)]
struct Band {
    law: Gains,
    outer_m: f64,
    inner_m: f64,
    guides: bool,
}

impl Law for Band {
    fn ask(&mut self, view: &LawView) -> f64 {
        let error_m = view.e_y_m.abs();
        self.guides = error_m > self.outer_m || (self.guides && error_m > self.inner_m);
        if self.guides { self.law.ask(view) } else { 0.0 }
    }
}

pub(super) const KIND: Kind<dyn Law> = Kind {
    name: "band",
    source: "Petermeijer et al. 2015, 2020 (descriptions)",
    origin: Origin::After,
    parameters: &[
        Parameter::published("outer_m", 0.5, [0.0, 2.0]).tuned(0.1, 0.5),
        Parameter::ours("inner_m", 0.19, [0.0, 2.0]),
        Parameter::published("k_1", 0.25, [0.0, 4.0]).tuned(0.25, 0.45),
    ],
    make: Make::Part(|_, v| {
        boxed(Band {
            law: Gains {
                k_1: v[2],
                ..Gains::PAPER
            },
            outer_m: v[0],
            inner_m: v[1],
            guides: false,
        })
    }),
};
