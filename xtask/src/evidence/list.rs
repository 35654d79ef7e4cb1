//! The list of measurements and tables, `docs/evidence.toml`.

use std::collections::BTreeMap;
use std::fmt;

use anyhow::{Context, Result, ensure};
use serde::{Deserialize, Serialize};

use super::LIST;
use crate::tool;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct List {
    /// The first of the seeds that nothing was tuned on.
    pub(super) held_out_from: u64,
    pub(super) latent: Latent,
    /// Paths of the code that a measurement judges, by a name.
    pub(super) code: BTreeMap<String, Vec<String>>,
    pub(super) measurement: BTreeMap<String, Measurement>,
    pub(super) table: BTreeMap<String, Table>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Measurement {
    /// What tables call it.
    pub(super) title: String,
    /// Arguments of the program, without those that follow from rule and seeds.
    pub(super) command: String,
    /// When it ends.
    pub(super) rule: Rule,
    #[serde(default)]
    pub(super) seeds: Seeds,
    /// A name in [`List::code`], and what it stands for.
    judges: String,
    #[serde(skip)]
    pub(super) judged: Vec<String>,
    #[serde(default)]
    pub(super) keeps: Keeps,
}

/// When a measurement ends, fixed before it begins.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Rule {
    /// Runs of each row of the campaign.
    Seeds(u64),
    /// Hours on each road.
    Hours(f64),
}

impl fmt::Display for Rule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Seeds(seeds) => write!(f, "{seeds} seeds"),
            Self::Hours(hours) => write!(f, "{hours} h a road"),
        }
    }
}

/// Which seeds, or which root of them.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Seeds {
    /// From the one that nothing was tuned on.
    HeldOut,
    /// From this one on.
    From(u64),
}

impl Default for Seeds {
    fn default() -> Self {
        Self::From(1)
    }
}

/// What is kept of a campaign beside its sums.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Keeps {
    /// Rows in which something failed, or guidance ended that should have gone on.
    #[default]
    Failures,
    /// All.
    EveryRow,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Table {
    /// From the repository's root.
    pub(super) document: String,
    pub(super) form: Form,
    /// Measurements, in the order of its rows or columns.
    pub(super) of: Vec<String>,
}

/// What a table shows of its measurements.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Form {
    /// Campaigns, a line each: how much ran, how much failed.
    Campaigns,
    /// Rows of campaigns in which runs failed.
    Failures,
    /// Rows of campaigns in which guidance ended that should have gone on.
    Ended,
    /// What campaigns sum up to, a column each.
    Sums,
    /// What campaigns sum up to by class.
    Classes,
    /// Rows of class C by how far their torque pushed the vehicle.
    Pushed,
    /// What the safety goals ask about.
    Goals,
    /// Rows of which a run stayed unnoticed.
    Latent,
    /// In how many runs of these rows the ECU left, and when.
    Left(Vec<String>),
    /// False declarations, a line for each world.
    Availability,
    /// False declarations, a line for each world and road.
    AvailabilityByRoad,
}

/// Which rows may be latent beside, and without, those in which guidance may end.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Latent {
    pub(super) also: Vec<String>,
    pub(super) except: Vec<String>,
}

impl List {
    pub(super) fn read() -> Result<Self> {
        let text = std::fs::read_to_string(tool::root().join(LIST)).context(LIST)?;
        Self::parse(&text).context(LIST)
    }

    /// Parses a list and looks up every name in it.
    pub(super) fn parse(text: &str) -> Result<Self> {
        let mut list: Self = toml::from_str(text)?;
        for (name, measurement) in &mut list.measurement {
            let judges = &measurement.judges;
            let paths = list.code.get(judges);
            let paths = paths.with_context(|| format!("measurement.{name}: judges: no code.{judges}"))?;
            measurement.judged = paths.clone();
            let command = match measurement.rule {
                Rule::Seeds(_) => "faults",
                Rule::Hours(_) => "availability",
            };
            ensure!(
                measurement.command.split(' ').next() == Some(command),
                "measurement.{name}: command: with a rule of {} it has to be {command}",
                measurement.rule
            );
        }
        for (name, table) in &list.table {
            let unknown = table.of.iter().find(|of| !list.measurement.contains_key(*of));
            ensure!(
                unknown.is_none(),
                "table.{name}: of: no measurement {}",
                unknown.map_or("", |of| of)
            );
        }
        Ok(list)
    }

    /// The first seed of a measurement.
    pub(super) fn first_seed(&self, measurement: &Measurement) -> u64 {
        match measurement.seeds {
            Seeds::HeldOut => self.held_out_from,
            Seeds::From(seed) => seed,
        }
    }
}

impl Measurement {
    /// Arguments of the program with so many seeds or hours.
    pub(super) fn arguments(&self, count: Rule, first: u64) -> String {
        let command = &self.command;
        match count {
            Rule::Seeds(seeds) if first == 1 => format!("{command} --seeds {seeds}"),
            Rule::Seeds(seeds) => format!("{command} --seeds {seeds} --first-seed {first}"),
            Rule::Hours(hours) => format!("{command} --hours {hours} --seed {first} --fault-seeds 0"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Form, List, Rule};
    use crate::tool;

    const TEXT: &str = r#"
held_out_from = 77
latent = { also = [], except = [] }
code.campaign = ["core/src"]
[measurement.flat]
title = "flat"
command = "faults"
rule = { seeds = 500 }
judges = "campaign"
[measurement.events]
title = "events"
command = "availability --worlds events"
rule = { hours = 52.0 }
seeds = "held-out"
judges = "campaign"
[table.latent]
document = "docs/x.md"
form = { left = ["jitter"] }
of = ["flat"]
"#;

    #[test]
    fn a_command_ends_by_its_rule_and_begins_at_its_seed() {
        let list = List::parse(TEXT).unwrap();
        let [flat, events] = ["flat", "events"].map(|name| &list.measurement[name]);
        assert_eq!(
            flat.arguments(Rule::Seeds(20), list.first_seed(flat)),
            "faults --seeds 20"
        );
        assert_eq!(
            events.arguments(events.rule, list.first_seed(events)),
            "availability --worlds events --hours 52 --seed 77 --fault-seeds 0"
        );
        assert!(matches!(&list.table["latent"].form, Form::Left(rows) if rows == &["jitter"]));
    }

    #[test]
    fn what_the_list_names_has_to_be_there() {
        for (from, to, says) in [
            (
                "of = [\"flat\"]",
                "of = [\"flut\"]",
                "table.latent: of: no measurement flut",
            ),
            ("judges = \"campaign\"", "judges = \"x\"", "judges: no code.x"),
            ("command = \"faults\"", "command = \"run\"", "it has to be faults"),
            ("title = \"flat\"", "titel = \"flat\"", "titel"),
        ] {
            let error = format!("{:#}", List::parse(&TEXT.replacen(from, to, 1)).unwrap_err());
            assert!(error.contains(says), "{error}");
        }
    }

    #[test]
    fn the_code_that_is_judged_is_there() {
        for path in List::read().unwrap().code.values().flatten() {
            assert!(tool::root().join(path).exists(), "{path}");
        }
    }
}
