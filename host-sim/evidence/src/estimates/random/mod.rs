//! Drives that are composed by chance: a participant, and two or three conditions at once, of areas that differ.
//!
//! Every second drive is *honest* (all its conditions are); in the others one condition is wrong and the rest is honest. A drive follows
//! from the seed and its number alone, so that a list of them can be driven in any order and in many sittings.
//!
//! Terms: a value is *wrong* if it is called identified and lies more than four of its standard errors and more than 10 % (15 ms of
//! t_p, 0.05 of K_hg) from the truth, and of a driver who changes from the truth at both ends. An honest log is *accused* if the model is
//! refuted for it, or if it is not read. A drive is *lost* if the car leaves its lane by 3 m: it tells nothing, and does not count.

mod conditions;
mod draft;
mod rows;
mod summary;

use haptic_analysis::identify::{Identification, Options, Parameter, Torques, identify_with_noise_model};
use haptic_batch::StudyError;
use haptic_batch::engine::{Part, Plan, Resumed, Store, Study};
use haptic_batch::experiment::{ExperimentPlan, REMNANT_GUIDED_NM, chosen};
use haptic_sim::models::driver::DriverParameters;
use rand::rngs::Xoshiro256PlusPlus;
use rand::{RngExt, SeedableRng};
use serde::{Deserialize, Serialize};

use conditions::{HONEST, RandomCondition, WRONG};
use draft::Draft;
use rows::Rows;
pub use summary::{ConditionLine, RandomDrives, Said, Share, Tally};

use super::corruptions::tolerance;

/// Farther beside the target line than this, m, the car is not in its lane.
const LOST_M: f64 = 3.0;
/// Names of the values, in the order of a drive's truth.
const PARAMETERS: [&str; 5] = ["gain_1", "gain_2", "gain_3", "t_p", "k_hg"];

/// What to drive.
#[derive(Debug, Clone)]
pub struct RandomPlan {
    /// Who may drive, with which probe, from which seed.
    pub plan: ExperimentPlan,
    /// Numbers of the drives.
    pub numbers: Vec<u32>,
}

/// A value that was called identified.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RandomValue {
    /// Its key.
    pub parameter: String,
    /// The estimate, with its standard error.
    pub estimate: [f64; 2],
    /// What it is; of a driver who changes the nearer end.
    pub truth: f64,
    /// Whether the 95 % interval holds the truth.
    pub held: bool,
    /// Whether it is wrong.
    pub wrong: bool,
}

/// What became of a drive.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RandomDrive {
    /// Its number.
    pub number: u32,
    /// Whether all its conditions are honest.
    pub honest: bool,
    /// Number of the participant.
    pub participant: u32,
    /// Its conditions, by place in the list of the honest ones and behind it of the wrong ones, and with their values in words.
    pub conditions: Vec<(usize, String)>,
    /// Whether the car left its lane.
    pub lost: bool,
    /// What the model is refuted for, or why the log is not read; the cause behind the assumption.
    pub refuted: Vec<String>,
    /// Whether the torques of its log could be weighed: else its values are identified if the torques are right.
    pub weighed: bool,
    /// Values that are called identified.
    pub identified: Vec<RandomValue>,
}

impl Study for RandomPlan {
    type Case = u32;
    type Row = RandomDrive;
    type Results = RandomDrives;

    fn plan(&self) -> Result<Plan<u32>, StudyError> {
        Ok(Plan::one_by_one(self.numbers.clone()))
    }

    fn drive(&self, part: &Part<'_, u32, RandomDrive>) -> Result<Vec<RandomDrive>, StudyError> {
        part.one_by_one(|number| Ok(self.drive_of(*number)?.1))
    }

    fn summarise(&self, _: Vec<u32>, drives: Vec<RandomDrive>) -> Result<RandomDrives, StudyError> {
        Ok(RandomDrives::new(&self.plan, &drives))
    }
}

/// Drives of an earlier run, and what takes each new one.
pub fn resumed_random<K>(on_record: &[RandomDrive], keep: K) -> impl Store<u32, RandomDrive>
where
    K: Fn(&RandomDrive) -> Result<(), StudyError> + Sync,
{
    Resumed {
        rows: on_record,
        is_of: |number: &u32, drive: &RandomDrive| drive.number == *number,
        keep,
    }
}

/// Each condition by its place.
fn condition(place: usize) -> &'static RandomCondition {
    HONEST.get(place).unwrap_or_else(|| &WRONG[place - HONEST.len()])
}

/// Places of the conditions of a drive: with one that is wrong, or with honest ones alone.
fn drawn(honest: bool, random: &mut Xoshiro256PlusPlus) -> Vec<usize> {
    let mut places: Vec<usize> = Vec::new();
    if !honest {
        places.push(HONEST.len() + random.random_range(0..WRONG.len()));
    }
    let count = random.random_range(2..4);
    while places.len() < count {
        let place = random.random_range(0..HONEST.len());
        if places
            .iter()
            .all(|other| condition(*other).area != condition(place).area)
        {
            places.push(place);
        }
    }
    places
}

impl RandomPlan {
    /// The log of a drive as a file has it, as CSV, for whoever wants to look at it.
    ///
    /// # Errors
    /// A value that no scenario takes.
    pub fn log_of(&self, number: u32) -> Result<String, StudyError> {
        let (rows, _) = self.drive_of(number)?;
        Ok(rows.to_csv())
    }

    /// The rows of a drive, and what became of it.
    fn drive_of(&self, number: u32) -> Result<(Rows, RandomDrive), StudyError> {
        let seed = self
            .plan
            .seed
            .wrapping_mul(1_000_003)
            .wrapping_add(u64::from(number));
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
        let participants = chosen(&self.plan.participants)?;
        let who = participants[random.random_range(0..participants.len())];
        let driver = DriverParameters {
            remnant_sd_nm: REMNANT_GUIDED_NM,
            ..who.guided.parameters()
        };
        let mut draft = Draft::new(who.guided, driver, self.plan.probe_nm, seed);
        let honest = number.is_multiple_of(2);
        let mut conditions = Vec::new();
        for place in drawn(honest, &mut random) {
            let RandomCondition {
                area,
                name,
                unit,
                range: [low, high],
                put,
                ..
            } = condition(place);
            let value = random.random_range(*low..*high);
            put(&mut draft, value);
            let value = match *unit {
                "-" => String::new(),
                unit => format!(" {} {unit}", rounded(value)),
            };
            conditions.push((place, format!("{area}: {name}{value}").trim_end().to_owned()));
        }
        let log = draft.drive(&mut random)?;
        let lost = log.e_y_m.iter().any(|y| y.abs() > LOST_M);
        let rows = draft.recorded(&log, &mut random);
        let mut drive = RandomDrive {
            number,
            honest,
            participant: who.number,
            conditions,
            lost,
            refuted: Vec::new(),
            weighed: false,
            identified: Vec::new(),
        };
        if !lost {
            drive.judge(&draft, rows.clone());
        }
        Ok((rows, drive))
    }
}

/// Three digits.
fn rounded(value: f64) -> f64 {
    let scale = 10.0_f64.powf(2.0 - value.abs().log10().floor());
    (value * scale).round() / scale
}

impl RandomDrive {
    fn judge(&mut self, draft: &Draft, rows: Rows) {
        let log = match rows.log(draft.called_manual) {
            Ok(log) => log,
            Err(error) => {
                self.refuted.push(format!("not read: {error}"));
                return;
            }
        };
        let options = Options {
            manual: draft.called_manual,
            assisted: draft.assisted,
            ..Options::default()
        };
        let found = identify_with_noise_model(&log, &options);
        self.refuted = found
            .refuted
            .iter()
            .map(|r| format!("{}: {}", r.assumption, r.cause))
            .collect();
        self.weighed = found.torques == Some(Torques::Weighed);
        let truths = draft.ends().map(|end| draft.truth(&end));
        self.identified = identified(&found)
            .into_iter()
            .zip(PARAMETERS)
            .enumerate()
            .filter_map(|(i, (parameter, name))| value(name, parameter, truths.map(|truth| truth[i])))
            .collect();
    }
}

/// In the order of [`PARAMETERS`].
fn identified(found: &Identification) -> [Parameter; 5] {
    let p = &found.parameters;
    [p.gain_1, p.gain_2, p.gain_3, p.t_p, p.k_hg]
}

/// A value that is called identified, beside the nearer of two truths.
fn value(name: &str, found: Parameter, truths: [f64; 2]) -> Option<RandomValue> {
    let estimate = found.estimate.filter(|_| found.identified)?;
    let error = found.standard_error.unwrap_or(0.0);
    let miss = |truth: &f64| (estimate - truth).abs();
    let [a, b] = truths;
    let truth = if miss(&b) < miss(&a) { b } else { a };
    let miss = miss(&truth);
    Some(RandomValue {
        parameter: name.to_owned(),
        estimate: [estimate, error],
        truth,
        held: found
            .interval_95
            .is_some_and(|[low, high]| (low..=high).contains(&truth)),
        wrong: miss > 4.0 * error && miss > tolerance(name, truth),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(numbers: Vec<u32>) -> RandomPlan {
        let plan = ExperimentPlan {
            participants: vec![2, 9],
            probe_nm: 0.2,
            seed: 5,
        };
        RandomPlan { plan, numbers }
    }

    /// Two or three conditions of areas that differ; with a wrong one exactly where the drive is not honest.
    #[test]
    fn conditions_are_of_areas_that_differ() {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(1);
        let mut seen = vec![0; HONEST.len() + WRONG.len()];
        for i in 0..4000 {
            let places = drawn(i % 2 == 0, &mut random);
            assert!((2..=3).contains(&places.len()));
            for (k, a) in places.iter().enumerate() {
                seen[*a] += 1;
                let others = &places[k + 1..];
                assert!(others.iter().all(|b| condition(*b).area != condition(*a).area));
            }
            let wrong = places.iter().filter(|p| !condition(**p).honest).count();
            assert_eq!(wrong, i % 2);
        }
        assert!(seen.iter().all(|count| *count > 10), "{seen:?}");
    }

    /// 2.0 by 0.06 is 3 % and 5 standard errors off, so not wrong; by 0.3 it is 15 %, and wrong unless its standard error is more
    /// than 0.075. K_hg may be off by 0.05.
    #[test]
    fn a_value_is_wrong_by_both_measures() {
        let found = |estimate, error| Parameter {
            estimate: Some(estimate),
            optimum: Some(estimate),
            standard_error: Some(error),
            identified: true,
            interval_95: Some([estimate - 2.0 * error, estimate + 2.0 * error]),
            on_bound: false,
            fixed: false,
            errors: None,
        };
        let of = |name, estimate, error| value(name, found(estimate, error), [2.0, 9.0]).unwrap();
        assert!(!of("gain_1", 2.06, 0.012).wrong && !of("gain_1", 2.06, 0.012).held);
        assert!(of("gain_1", 2.3, 0.07).wrong && of("gain_1", 1.7, 0.07).wrong);
        assert!(!of("gain_1", 2.3, 0.08).wrong);
        assert!(of("k_hg", 2.06, 0.01).wrong && !of("k_hg", 2.04, 0.001).wrong);
        assert_eq!(of("gain_1", 8.0, 0.1).truth, 9.0);
        let unknown = Parameter {
            identified: false,
            ..found(2.0, 0.1)
        };
        assert!(value("gain_1", unknown, [2.0, 9.0]).is_none());
    }

    /// A drive follows from seed and number: alone it is what it is among others.
    #[test]
    fn a_drive_does_not_depend_on_the_others() {
        let watch = haptic_batch::engine::Watch::nobody();
        let alone = plan(vec![3]).drive_of(3).unwrap().1;
        let all = plan(vec![2, 3]).run(&watch).unwrap();
        assert_eq!(all.honest.drives + all.wrong.drives, 2);
        assert_eq!(all.wrong.drives, 1);
        assert_eq!(plan(vec![3]).drive_of(3).unwrap().1, alone);
        assert!(!alone.honest && alone.conditions.iter().any(|c| !condition(c.0).honest));
    }
}
