//! The fourteen participants of the paper, as its tables 5 and 6 describe them. They are written down once, in
//! `data/participants.toml`, and whoever needs a published driver takes it from here.

use serde::{Deserialize, Serialize};

use crate::input::{RangeError, in_range};
use crate::models::driver::{ArmGains, DriverParameters};

/// A driver as the paper identified it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PublishedDriver {
    /// Gain on e_y, 1/m.
    pub a_1: f64,
    /// Gain on the integral of e_y, 1/(m.s).
    pub a_2: f64,
    /// Gain on e_theta.
    pub a_3: f64,
    /// Processing delay, s.
    pub t_p: f64,
    /// Gain from target angle to torque, N.m/rad.
    pub k_d: f64,
    /// Reaction to the guidance torque; none when driving manually.
    pub k_hg: Option<f64>,
    /// Fitness that the paper reached, %.
    pub fitness: f64,
}

impl PublishedDriver {
    /// Vision and delay; what the paper did not identify has its default.
    #[must_use]
    pub fn parameters(&self) -> DriverParameters {
        DriverParameters {
            a_1: self.a_1,
            a_2: self.a_2,
            a_3: self.a_3,
            t_p: self.t_p,
            ..DriverParameters::default()
        }
    }

    /// Gains of the arm. Without guidance there was no K_hg to identify: zero.
    #[must_use]
    pub fn gains(&self) -> ArmGains {
        ArmGains {
            k_d: self.k_d,
            k_hg: self.k_hg.unwrap_or(0.0),
        }
    }
}

/// One participant, without and with guidance.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Participant {
    /// 1 to 14.
    pub number: u32,
    /// Table 5.
    pub manual: PublishedDriver,
    /// Table 6.
    pub guided: PublishedDriver,
}

impl Participant {
    /// The driver between the manual one (share 0) and the guided one (1), each value on the straight line between both. The fitness, which is
    /// of fits, is the guided one's.
    #[must_use]
    pub fn between(&self, share: f64) -> PublishedDriver {
        let value =
            |of: fn(&PublishedDriver) -> f64| (1.0 - share) * of(&self.manual) + share * of(&self.guided);
        PublishedDriver {
            a_1: value(|own| own.a_1),
            a_2: value(|own| own.a_2),
            a_3: value(|own| own.a_3),
            t_p: value(|own| own.t_p),
            k_d: value(|own| own.k_d),
            k_hg: Some(value(|own| own.gains().k_hg)),
            fitness: self.guided.fitness,
        }
    }
}

#[derive(Deserialize)]
struct File {
    participant: Vec<Participant>,
}

/// All participants, in order of their numbers.
#[must_use]
pub fn participants() -> Vec<Participant> {
    let file: File = toml::from_str(include_str!("../data/participants.toml"))
        .expect("the built-in table is valid: a test reads it");
    file.participant
}

/// The participant of a number that `field` holds.
///
/// # Errors
/// There is no such number.
pub fn participant(field: &str, number: u32) -> Result<Participant, RangeError> {
    let all = participants();
    in_range(field, f64::from(number), 1.0..=all.len() as f64, "")?;
    Ok(all[number as usize - 1])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The paper's text says 76 % manual and 69 % guided; the mean of its table 5 is 77. And its claim that K_d is lower
    /// with guidance on average.
    #[test]
    fn the_tables_have_the_means_that_the_paper_states_but_for_one_percent() {
        let all = participants();
        assert_eq!(
            all.iter().map(|p| p.number).collect::<Vec<_>>(),
            (1..=14).collect::<Vec<_>>()
        );
        let mean = |f: &dyn Fn(&Participant) -> f64| all.iter().map(f).sum::<f64>() / 14.0;
        assert_eq!(mean(&|p| p.manual.fitness).round(), 77.0);
        assert_eq!(mean(&|p| p.guided.fitness).round(), 69.0);
        assert!(mean(&|p| p.guided.k_d) < mean(&|p| p.manual.k_d));
        assert!(
            all.iter()
                .all(|p| p.manual.k_hg.is_none() && p.guided.k_hg.is_some())
        );
    }
}
