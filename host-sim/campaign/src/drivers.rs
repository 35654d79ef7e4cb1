//! Who drives in the campaign: the participants of tables 5 and 6 and the nine drivers of tables 7 and 8.

use haptic_sim::models::driver::{ArmGains, DriverParameters};
use haptic_sim::participants::participants;
use haptic_sim::scenario::Condition;

/// A driver, by origin.
#[derive(Debug, Clone, PartialEq)]
pub struct Driver {
    /// Table and participant, or delay and condition.
    pub name: String,
    /// Vision and delay.
    pub parameters: DriverParameters,
    /// Arm.
    pub gains: ArmGains,
}

/// Everyone: 28 participants, then t_p 0.1, 0.3, 0.5 with high, mid, low reliance.
pub fn everyone() -> Vec<Driver> {
    let all = participants();
    let manual = all.iter().map(|p| (5, p.number, p.manual));
    let guided = all.iter().map(|p| (6, p.number, p.guided));
    let published = manual.chain(guided).map(|(table, number, driver)| Driver {
        name: format!("table {table}, participant {number}"),
        parameters: driver.parameters(),
        gains: driver.gains(),
    });
    let drivers = [0.1, 0.3, 0.5].into_iter().flat_map(|t_p| {
        [Condition::High, Condition::Mid, Condition::Low].map(|condition| Driver {
            name: format!("t_p {t_p} s, {condition} reliance"),
            parameters: DriverParameters {
                t_p,
                ..Default::default()
            },
            gains: condition.gains(),
        })
    });
    published.chain(drivers).collect()
}
