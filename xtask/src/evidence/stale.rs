//! Whether the code that a measurement judges is still that of its commit.

use std::fmt;

use anyhow::Result;

use super::PROGRAM;
use super::kept::Kept;
use super::list::{Measurement, Rule};
use crate::tool::{command, output, root};

pub(super) enum State {
    Missing,
    /// At a commit that this repository does not have.
    Unknown(String),
    /// Since then these files changed.
    Changed(String, Vec<String>),
    /// The list has another command or rule now.
    Differs(&'static str),
    /// The code is that of the commit; fewer seeds or hours than the rule has are told, and no age.
    Fresh {
        commit: String,
        less: Option<Rule>,
    },
}

impl State {
    pub(super) fn is_fresh(&self) -> bool {
        matches!(self, Self::Fresh { .. })
    }
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing => f.write_str("not measured"),
            Self::Unknown(commit) => write!(f, "measured at {commit}, which is not in this repository"),
            Self::Changed(commit, files) => {
                let (named, more) = files.split_at(files.len().min(3));
                write!(f, "stale: changed since {commit}: {}", named.join(", "))?;
                match more.len() {
                    0 => Ok(()),
                    more => write!(f, " and {more} more"),
                }
            }
            Self::Differs(what) => write!(f, "stale: the list has another {what} now"),
            Self::Fresh { commit, less: None } => write!(f, "measured at {commit}"),
            Self::Fresh {
                commit,
                less: Some(count),
            } => write!(f, "measured at {commit} with {count} only"),
        }
    }
}

/// The state of a measurement, with what is kept of it.
pub(super) fn state(measurement: &Measurement, kept: Option<&Kept>) -> Result<State> {
    let Some(Kept { origin, .. }) = kept else {
        return Ok(State::Missing);
    };
    let holds_at = origin.holds_at();
    let commit = holds_at[..12.min(holds_at.len())].to_owned();
    if !is_known(holds_at) {
        return Ok(State::Unknown(commit));
    }
    let command = measurement.arguments(origin.count, origin.first_seed);
    if origin.command != format!("{PROGRAM} {command}") {
        return Ok(State::Differs("command"));
    }
    if origin.rule != measurement.rule {
        return Ok(State::Differs("rule"));
    }
    let files = changed(holds_at, &measurement.judged)?;
    Ok(match files.is_empty() {
        true => State::Fresh {
            commit,
            less: (origin.count != origin.rule).then_some(origin.count),
        },
        false => State::Changed(commit, files),
    })
}

/// Whether this repository has a commit.
pub(super) fn is_known(commit: &str) -> bool {
    let found = command("git").args(["cat-file", "-e", commit]).output();
    found.is_ok_and(|found| found.status.success())
}

/// Files below these paths whose code is not that of a commit. Comments and empty lines are no code.
pub(super) fn changed(commit: &str, paths: &[String]) -> Result<Vec<String>> {
    let mut git = command("git");
    let names = output(git.args(["diff", "--name-only", commit, "--"]).args(paths))?;
    let differs = |name: &&str| {
        let then = command("git")
            .args(["show", &format!("{commit}:{name}")])
            .output();
        let then = then.ok().filter(|then| then.status.success());
        let now = std::fs::read_to_string(root().join(name)).ok();
        match (then, now) {
            (Some(then), Some(now)) => code(&String::from_utf8_lossy(&then.stdout)) != code(&now),
            _ => true,
        }
    };
    Ok(names.lines().filter(differs).map(str::to_owned).collect())
}

/// Lines that say something to the compiler.
fn code(text: &str) -> Vec<&str> {
    let lines = text.lines().map(str::trim);
    lines
        .filter(|line| !line.is_empty() && !line.starts_with("//"))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::{changed, code};

    #[test]
    fn comments_and_empty_lines_are_no_code() {
        let text = "//! A.\n\n/// B.\nfn a() {\n    // C\n    1 // D\n}\n";
        assert_eq!(code(text), ["fn a() {", "1 // D", "}"]);
        assert_ne!(code("let a = 1;"), code("let a = 2;"));
    }

    #[test]
    fn a_commit_does_not_differ_from_itself_where_nothing_is_there() {
        assert!(changed("HEAD", &["no/such/path".into()]).unwrap().is_empty());
    }
}
