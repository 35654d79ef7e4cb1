//! What is kept of a measurement: a file of lines, each a JSON object. The first says where the numbers come from.

use std::path::Path;

use anyhow::{Context, Result};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::list::{Keeps, Rule};

pub(super) struct Kept {
    pub(super) origin: Origin,
    pub(super) numbers: Numbers,
}

/// Where numbers come from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Origin {
    pub(super) command: String,
    pub(super) commit: String,
    /// The date of the commit.
    pub(super) date: String,
    /// The rule that was fixed before.
    pub(super) rule: Rule,
    /// How much was run in fact.
    pub(super) count: Rule,
    pub(super) first_seed: u64,
    /// Whether nothing was tuned on its seeds.
    pub(super) held_out: bool,
    /// Earlier uses of held-out seeds.
    #[serde(default)]
    pub(super) earlier: Vec<Earlier>,
    /// The last other code that was seen to give the same.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) same: Option<Same>,
}

/// Code that gave the same results, to nine digits, in the first of the runs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Same {
    pub(super) commit: String,
    pub(super) count: Rule,
}

impl Origin {
    /// The last commit whose code is known to give these numbers.
    pub(super) fn holds_at(&self) -> &str {
        self.same.as_ref().map_or(&self.commit, |same| &same.commit)
    }
}

/// An earlier use of held-out seeds, and why there was another one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Earlier {
    pub(super) commit: String,
    pub(super) count: Rule,
    pub(super) again: String,
}

pub(super) enum Numbers {
    Campaign(Campaign),
    Availability(Vec<Cell>),
}

/// Sums of a campaign, and its rows.
pub(super) struct Campaign {
    pub(super) sums: Sums,
    pub(super) rows: Vec<Row>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Sums {
    pub(super) rows: u64,
    pub(super) runs: u64,
    pub(super) cycles: u64,
    pub(super) failed: u64,
    pub(super) rows_beyond_share: u64,
    /// The largest share of a row's runs that may leave the lane; none where it is not judged.
    pub(super) share_limit: Option<f64>,
}

/// A row, as `cargo xtask faults --json` has it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Row {
    pub(super) name: String,
    pub(super) class: String,
    pub(super) runs: u64,
    #[serde(skip_serializing, default)]
    pub(super) cycles: u64,
    pub(super) may_leave: bool,
    pub(super) is_limited: bool,
    pub(super) worst_reaction_ms: Option<u32>,
    pub(super) peak_torque_nm: f64,
    pub(super) noticed: u64,
    pub(super) noticed_interval: [f64; 2],
    pub(super) noticed_after_ms: [Option<u32>; 2],
    pub(super) unnoticed_deviation_m: Option<f64>,
    pub(super) unnoticed_torque_nm: Option<f64>,
    pub(super) left: u64,
    pub(super) left_after_ms: Option<[u32; 2]>,
    pub(super) deviation_m: f64,
    pub(super) excess_m: Option<f64>,
    pub(super) pushed_m: Option<f64>,
    pub(super) beyond_drop: u64,
    pub(super) beyond_limit: u64,
    pub(super) left_lane: u64,
    pub(super) leaves_too_often: bool,
    #[serde(default)]
    pub(super) failed: u64,
    /// The first ones.
    pub(super) failures: Vec<Failure>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Failure {
    pub(super) seed: u64,
    pub(super) what: String,
}

/// A world on a road, or on all of them, as `cargo xtask availability --json` has it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Cell {
    pub(super) world: String,
    pub(super) road: String,
    pub(super) hours: f64,
    pub(super) declarations: Rate,
    pub(super) causes: Vec<Cause>,
    pub(super) diverged: u64,
    pub(super) lost_by_hand: Lost,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Rate {
    pub(super) count: u64,
    /// None where nothing was driven.
    pub(super) upper_95: Option<f64>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Cause {
    pub(super) faults: String,
    pub(super) rate: Rate,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Lost {
    pub(super) segments: u64,
}

impl Campaign {
    /// A campaign with all its rows.
    pub(super) fn new(mut rows: Vec<Row>, share_limit: Option<f64>, keeps: Keeps) -> Self {
        let sum = |of: fn(&Row) -> u64| rows.iter().map(of).sum();
        let sums = Sums {
            rows: rows.len() as u64,
            runs: sum(|row| row.runs),
            cycles: sum(|row| row.cycles),
            failed: sum(|row| row.failures.len() as u64),
            rows_beyond_share: sum(|row| u64::from(row.leaves_too_often)),
            share_limit,
        };
        let shows = |row: &Row| !row.failures.is_empty() || row.leaves_too_often || row.ended();
        rows.retain(|row| keeps == Keeps::EveryRow || shows(row));
        rows.iter_mut().for_each(Row::shorten);
        Self { sums, rows }
    }

    pub(super) fn row(&self, name: &str) -> Option<&Row> {
        self.rows.iter().find(|row| row.name == name)
    }
}

impl Row {
    /// Whether guidance ended that should have gone on: nothing is wrong, or it is bridged.
    pub(super) fn ended(&self) -> bool {
        !self.may_leave && self.left > 0 && ["L", "R"].contains(&self.class.as_str())
    }

    /// To more digits and failures than any table shows.
    fn shorten(&mut self) {
        self.failed = self.failures.len() as u64;
        self.failures.truncate(5);
        let thousandths = |value: &mut f64| *value = (*value * 1000.0).round() / 1000.0;
        let [low, high] = &mut self.noticed_interval;
        let own = [low, high, &mut self.deviation_m, &mut self.peak_torque_nm];
        let others = [
            &mut self.excess_m,
            &mut self.pushed_m,
            &mut self.unnoticed_deviation_m,
            &mut self.unnoticed_torque_nm,
        ];
        let others = others.into_iter().flatten();
        own.into_iter().chain(others).for_each(thousandths);
    }
}

impl Kept {
    pub(super) fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
        Self::parse(&text).with_context(|| path.display().to_string())
    }

    pub(super) fn parse(text: &str) -> Result<Self> {
        let mut lines = text.lines().enumerate();
        let origin: Origin = next(&mut lines)?;
        let numbers = match origin.rule {
            Rule::Seeds(_) => Numbers::Campaign(Campaign {
                sums: next(&mut lines)?,
                rows: lines.map(read).collect::<Result<_>>()?,
            }),
            Rule::Hours(_) => Numbers::Availability(lines.map(read).collect::<Result<_>>()?),
        };
        Ok(Self { origin, numbers })
    }

    pub(super) fn to_text(&self) -> Result<String> {
        let mut lines = vec![serde_json::to_string(&self.origin)?];
        match &self.numbers {
            Numbers::Campaign(campaign) => {
                lines.push(serde_json::to_string(&campaign.sums)?);
                for row in &campaign.rows {
                    lines.push(serde_json::to_string(row)?);
                }
            }
            Numbers::Availability(cells) => {
                for cell in cells {
                    lines.push(serde_json::to_string(cell)?);
                }
            }
        }
        Ok(lines.join("\n") + "\n")
    }

    pub(super) fn campaign(&self) -> Option<&Campaign> {
        match &self.numbers {
            Numbers::Campaign(campaign) => Some(campaign),
            Numbers::Availability(_) => None,
        }
    }

    pub(super) fn cells(&self) -> &[Cell] {
        match &self.numbers {
            Numbers::Campaign(_) => &[],
            Numbers::Availability(cells) => cells,
        }
    }
}

fn next<'a, T: DeserializeOwned>(lines: &mut impl Iterator<Item = (usize, &'a str)>) -> Result<T> {
    read(lines.next().context("it ends too early")?)
}

fn read<T: DeserializeOwned>((number, line): (usize, &str)) -> Result<T> {
    serde_json::from_str(line).with_context(|| format!("line {}", number + 1))
}
