//! The paper's participants on the command line: how many, or which ones.

use clap::Args;
use haptic_batch::experiment::ExperimentPlan;
use haptic_core::controller::params::PARAMETERS;
use haptic_sim::input::{RangeError, in_range};
use haptic_sim::participants::participants;

/// Refuses a probe that the ECU refuses, by the name of the option.
///
/// # Errors
/// Its amplitude and the range.
pub fn check_probe(option: &str, amplitude_nm: f64) -> Result<(), RangeError> {
    let own = PARAMETERS
        .iter()
        .find(|parameter| parameter.name == "probe_amplitude_nm");
    own.map_or(Ok(()), |own| {
        in_range(option, amplitude_nm, own.min..=own.max, own.unit)
    })
}

/// The drives of an experiment with participants.
#[derive(Debug, Args)]
pub struct Drives {
    #[command(flatten)]
    participants: Participants,
    /// Amplitude of the probe in the guided drives, N.m (0: none). The probe is a small torque added to the guidance;
    /// the driver's answer to it tells K_hg
    #[arg(long, value_name = "AMPLITUDE", default_value_t = 0.0)]
    probe: f64,
    /// Seed of the remnants of the first drive of each participant; further drives count on from it
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

impl Drives {
    /// What is asked for.
    ///
    /// # Errors
    /// A probe that the ECU refuses.
    pub fn plan(&self) -> Result<ExperimentPlan, RangeError> {
        check_probe("--probe", self.probe)?;
        Ok(ExperimentPlan {
            participants: self.participants.numbers(),
            probe_nm: self.probe,
            seed: self.seed,
        })
    }
}

/// Which of the paper's participants drive.
#[derive(Debug, Args)]
pub struct Participants {
    /// How many of the paper's participants drive, from the first on (1 to 14)
    #[arg(long, value_name = "N", value_parser = how_many, conflicts_with = "participant")]
    participants: Option<u32>,
    /// Which of them drive: numbers and ranges such as 3 or 1,3..5
    #[arg(long, value_name = "LIST", default_value = "1..14")]
    participant: List,
}

impl Participants {
    /// Their numbers, in the order given.
    pub fn numbers(&self) -> Vec<u32> {
        match self.participants {
            Some(count) => (1..=count).collect(),
            None => self.participant.0.clone(),
        }
    }
}

fn how_many(text: &str) -> Result<u32, String> {
    let all = participants().len() as u32;
    match text.parse() {
        Ok(count) if (1..=all).contains(&count) => Ok(count),
        Ok(_) => Err(format!("1 to {all} drive")),
        Err(_) => Err(format!(
            "a count is wanted, 1 to {all}; `--participant {text}` says which ones"
        )),
    }
}

#[derive(Debug, Clone, PartialEq, Eq)]
struct List(Vec<u32>);

impl std::str::FromStr for List {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let last = participants().len() as u32;
        let number = |s: &str| match s.trim().parse::<u32>() {
            Ok(number) if (1..=last).contains(&number) => Ok(number),
            Ok(number) => Err(format!("{number} is outside 1 to {last}")),
            Err(_) => Err(format!("{s:?} is not a participant's number, as in 1,3..5")),
        };
        let mut all = Vec::new();
        for part in text.split(',') {
            match part.split_once("..") {
                Some((from, to)) => {
                    let (from, to) = (number(from)?, number(to.trim_start_matches('='))?);
                    if from > to {
                        return Err(format!("{part:?} is no range of participants, as in 1,3..5"));
                    }
                    all.extend(from..=to);
                }
                None => all.push(number(part)?),
            }
        }
        Ok(Self(all))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_and_ranges() {
        for (text, numbers) in [
            ("3", &[3][..]),
            ("1, 5,9", &[1, 5, 9]),
            ("1,3..5", &[1, 3, 4, 5]),
            ("2..=3", &[2, 3]),
        ] {
            assert_eq!(text.parse(), Ok(List(numbers.to_vec())), "{text}");
        }
        for bad in ["", "a", "2..x", "5..3", "0", "15", "1..99999999"] {
            assert!(bad.parse::<List>().is_err(), "{bad}");
        }
    }

    #[test]
    fn so_many_are_the_first_ones() {
        let some = |participants| Participants {
            participants,
            participant: List(vec![3]),
        };
        assert_eq!(some(Some(3)).numbers(), [1, 2, 3]);
        assert_eq!(some(None).numbers(), [3]);
        for bad in ["0", "15", "1,3", "-1"] {
            assert!(how_many(bad).is_err(), "{bad}");
        }
    }
}
