//! The fourteen participants, as tables 5 and 6 describe them.

use serde::{Deserialize, Serialize};

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

#[derive(Deserialize)]
struct File {
    participant: Vec<Participant>,
}

/// All participants, in order of their numbers.
pub fn participants() -> Vec<Participant> {
    let file: File = toml::from_str(include_str!("../../data/participants.toml"))
        .expect("the built-in table is valid: a test reads it");
    file.participant
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Means that the paper's text gives: fitness 76 % manual, 69 % guided; and its claim that K_d is lower with
    /// guidance on average.
    #[test]
    fn the_tables_have_the_means_that_the_paper_states() {
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
