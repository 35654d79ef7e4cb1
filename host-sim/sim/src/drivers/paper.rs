//! The paper's driver, (7) and (8), with parameters of a file's own, or those of a participant of table 6. Source: Wang, Zheng,
//! Nacpil and Nakano 2022.
//!
//! *Adapting*: every value between those of a participant by hand (table 5, share 0) and with guidance (table 6, share 1). A comparison moves
//! the share over days; in a drive it stays. Ours: that the way between the two is straight, and how many days it takes.

use super::{AnyDriver, Kind, Make};
use crate::kind::{Origin, Parameter};
use crate::models::driver::{ArmGains, DriverParameters};
use crate::participants::participants;
use crate::parts::PaperDriver;
use crate::scenario::{Scenario, ScenarioError};

fn boxed(
    scenario: &Scenario,
    seen: DriverParameters,
    gains: ArmGains,
) -> Result<Box<dyn AnyDriver>, ScenarioError> {
    let given = *scenario.driver();
    let driver = DriverParameters {
        a_1: seen.a_1,
        a_2: seen.a_2,
        a_3: seen.a_3,
        t_p: seen.t_p,
        ..given
    };
    let own = scenario.to_builder().driver(driver).gains(gains).build()?;
    Ok(Box::new(PaperDriver::new(&own)))
}

pub(super) const KIND: Kind<dyn AnyDriver> = Kind {
    name: "paper",
    source: "Wang et al. 2022, (7) (8), table 7",
    origin: Origin::Published,
    parameters: &[
        Parameter::published("a_1", 0.1, [0.0, 10.0]),
        Parameter::published("a_2", 0.05, [0.0, 10.0]),
        Parameter::published("a_3", 3.7, [0.0, 100.0]),
        Parameter::published("t_p_s", 0.1, [0.001, 2.0]),
        Parameter::published("k_d_nm_per_rad", 3.0, [0.0, 50.0]),
        Parameter::published("k_hg", 0.5, [0.0, 10.0]),
    ],
    make: Make::Part(|scenario, v| {
        let seen = DriverParameters {
            a_1: v[0],
            a_2: v[1],
            a_3: v[2],
            t_p: v[3],
            ..DriverParameters::default()
        };
        boxed(
            scenario,
            seen,
            ArmGains {
                k_d: v[4],
                k_hg: v[5],
            },
        )
    }),
};

pub(super) const PARTICIPANT: Kind<dyn AnyDriver> = Kind {
    name: "participant",
    source: "Wang et al. 2022, table 6",
    origin: Origin::Published,
    parameters: &[NUMBER],
    make: Make::Part(|scenario, v| participant(scenario, v[0], 1.0)),
};

pub(super) const ADAPTING: Kind<dyn AnyDriver> = Kind {
    name: "adapting",
    source: "Wang et al. 2022, tables 5 and 6",
    origin: Origin::After,
    parameters: &[
        NUMBER,
        Parameter::ours("share", 1.0, [0.0, 1.0]),
        Parameter::ours("days", 3.0, [0.1, 1000.0]),
    ],
    make: Make::Part(|scenario, v| participant(scenario, v[0], v[1])),
};

const NUMBER: Parameter = Parameter::published("number", 1.0, [1.0, 14.0]);

fn participant(scenario: &Scenario, number: f64, share: f64) -> Result<Box<dyn AnyDriver>, ScenarioError> {
    let all = participants();
    let number = (number.round() as usize).clamp(1, all.len());
    let own = all[number - 1].between(share);
    boxed(scenario, own.parameters(), own.gains())
}
