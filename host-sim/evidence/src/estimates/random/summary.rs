//! What many random drives say together.

use haptic_batch::experiment::ExperimentPlan;
use haptic_sim::share::wilson;
use serde::Serialize;

use super::{HONEST, RandomDrive, WRONG, condition};

/// Most of a thousand identified values that may be wrong, and most of a hundred honest logs that may be accused.
const WRONG_OF_1000: f64 = 1.0;
const ACCUSED_OF_100: f64 = 2.0;

/// So many of so many.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Share {
    /// How many.
    pub count: usize,
    /// How many there are in all.
    pub of: usize,
    /// Wilson's 95 % interval of the share behind it; none of none.
    pub interval: Option<[f64; 2]>,
}

impl Share {
    /// So many of so many.
    #[must_use]
    pub fn new(count: usize, of: usize) -> Self {
        let interval = (of > 0).then(|| wilson(count as f64 / of as f64, of as f64));
        Self { count, of, interval }
    }
}

/// What some drives came to.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Tally {
    /// Drives, without those that were lost.
    pub drives: usize,
    /// Drives in which the car left its lane.
    pub lost: usize,
    /// Drives whose model was refuted, or whose log was not read: of honest ones, accused.
    pub refuted: Share,
    /// Wrong ones of the values that are called identified.
    pub wrong: Share,
    /// Wrong ones of the values that are called identified if the torques are right.
    pub wrong_if_right: Share,
    /// Values of both that have an estimate whose 95 % interval holds the truth.
    pub held: Share,
}

impl Tally {
    fn new<'a>(drives: impl Iterator<Item = &'a RandomDrive> + Clone) -> Self {
        let there = drives.clone().filter(|d| !d.lost);
        let values = there.clone().flat_map(|d| &d.identified);
        let count = there.clone().count();
        let wrong = |weighed: bool| {
            let values = there
                .clone()
                .filter(move |d| d.weighed == weighed)
                .flat_map(|d| &d.identified);
            Share::new(values.clone().filter(|v| v.wrong).count(), values.count())
        };
        Self {
            drives: count,
            lost: drives.count() - count,
            refuted: Share::new(there.clone().filter(|d| !d.refuted.is_empty()).count(), count),
            wrong: wrong(true),
            wrong_if_right: wrong(false),
            held: Share::new(values.clone().filter(|v| v.held).count(), values.count()),
        }
    }
}

/// What one condition came to, among whatever was beside it.
#[derive(Debug, Clone, Serialize)]
pub struct ConditionLine {
    /// Its area and name.
    pub condition: String,
    /// Whether it is honest.
    pub honest: bool,
    /// In honest drives; of a wrong condition in the others.
    #[serde(flatten)]
    pub tally: Tally,
}

/// Something that was said, and of which drive.
#[derive(Debug, Clone, Serialize)]
pub struct Said {
    /// What.
    pub what: String,
    /// Number of the drive.
    pub drive: u32,
    /// Number of the participant.
    pub participant: u32,
    /// What the drive was like.
    pub conditions: String,
}

/// All together.
#[derive(Debug, Clone, Serialize)]
pub struct RandomDrives {
    /// Who drove, with which probe, from which seed.
    #[serde(flatten)]
    pub plan: ExperimentPlan,
    /// Drives with honest conditions alone.
    pub honest: Tally,
    /// Drives with a wrong one.
    pub wrong: Tally,
    /// Both.
    pub all: Tally,
    /// By condition.
    pub lines: Vec<ConditionLine>,
    /// Every wrong value.
    pub wrong_values: Vec<Said>,
    /// Every accusation of an honest log.
    pub accusations: Vec<Said>,
    /// What was promised and is not kept.
    pub broken: Vec<String>,
}

impl RandomDrives {
    pub(super) fn new(plan: &ExperimentPlan, drives: &[RandomDrive]) -> Self {
        let of = |honest: bool| drives.iter().filter(move |d| d.honest == honest);
        let line = |place: usize| {
            let kind = condition(place);
            let with = of(kind.honest).filter(move |d| d.conditions.iter().any(|c| c.0 == place));
            ConditionLine {
                condition: format!("{}: {}", kind.area, kind.name),
                honest: kind.honest,
                tally: Tally::new(with),
            }
        };
        let said = |drive: &RandomDrive, what: String| Said {
            what,
            drive: drive.number,
            participant: drive.participant,
            conditions: drive
                .conditions
                .iter()
                .map(|c| c.1.as_str())
                .collect::<Vec<_>>()
                .join("; "),
        };
        let wrong_values = drives.iter().flat_map(|d| {
            let wrong = d.identified.iter().filter(|v| v.wrong);
            wrong.map(move |v| {
                let [estimate, error] = v.estimate;
                said(
                    d,
                    format!(
                        "{} {estimate:.4} +- {error:.4}, truth {:.4}{}",
                        v.parameter,
                        v.truth,
                        if d.weighed { "" } else { " (if torques are right)" }
                    ),
                )
            })
        });
        let accused = of(true).filter(|d| !d.lost);
        let accusations = accused.flat_map(|d| d.refuted.iter().map(move |what| said(d, what.clone())));
        let lines = (0..HONEST.len() + WRONG.len())
            .map(line)
            .filter(|l| l.tally.drives > 0);
        let mut found = Self {
            plan: plan.clone(),
            honest: Tally::new(of(true)),
            wrong: Tally::new(of(false)),
            all: Tally::new(drives.iter()),
            lines: lines.collect(),
            wrong_values: wrong_values.collect(),
            accusations: accusations.collect(),
            broken: Vec::new(),
        };
        found.broken = found.not_kept();
        found
    }

    fn not_kept(&self) -> Vec<String> {
        let mut broken = Vec::new();
        let Share { count, of, .. } = self.all.wrong;
        if 1e3 * count as f64 > WRONG_OF_1000 * of as f64 {
            broken.push(format!(
                "{count} of {of} identified values are wrong: more than {WRONG_OF_1000} of 1,000"
            ));
        }
        let Share { count, of, .. } = self.honest.refuted;
        if 1e2 * count as f64 > ACCUSED_OF_100 * of as f64 {
            broken.push(format!(
                "{count} of {of} honest logs are accused: more than {ACCUSED_OF_100} of 100"
            ));
        }
        broken
    }
}
