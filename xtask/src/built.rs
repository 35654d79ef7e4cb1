//! The builds that a check may ask for: with the tests, by itself, or as it is handed on.

use std::path::PathBuf;

use anyhow::Result;

use crate::dist;
use crate::tool::{EVIDENCE, HOST_SIM, SHAPE, cargo, root, run};

/// Which build of a binding is meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Built {
    /// Built with everything else, as [`SHAPE`] has it: in CI it is there already.
    ForTests,
    /// By itself, in the profile of the tests: as the README's first command builds it.
    Daily,
    /// By itself, in the profile `dist` and for an old glibc: what is handed on.
    ToShip,
}

impl Built {
    /// Builds a package for this computer; the directory of its libraries and programs.
    pub(crate) fn package(self, name: &str) -> Result<PathBuf> {
        let mut build = cargo();
        build.args(["build", "-q"]);
        match self {
            // With the tests, whose dependencies switch on features of what the rest depends on too.
            Self::ForTests => run(build.args(SHAPE).arg("--all-targets"))?,
            Self::Daily => run(build.args(["--release", "-p", name]))?,
            Self::ToShip => return dist::build(name, ""),
        }
        Ok(root().join("target/release"))
    }

    /// The command line to check others with: that of daily work, which computes the same bits as the one that is handed on.
    pub(crate) fn host_sim(self) -> Result<PathBuf> {
        Ok(self.daily().package("host-sim")?.join(HOST_SIM))
    }

    /// The program behind `cargo xtask faults`, likewise.
    pub(crate) fn evidence(self) -> Result<PathBuf> {
        Ok(self.daily().package("haptic-evidence")?.join(EVIDENCE))
    }

    /// The program that counts the steps of the fault campaign, likewise.
    pub(crate) fn worst_step(self) -> Result<PathBuf> {
        match self {
            Self::ForTests => drop(self.package("haptic-campaign")?),
            Self::Daily | Self::ToShip => {
                let build = "build -q --release -p haptic-campaign --example worst_step";
                run(cargo().args(build.split(' ')))?;
            }
        }
        Ok(root().join("target/release/examples/worst_step"))
    }

    fn daily(self) -> Self {
        match self {
            Self::ForTests => self,
            Self::Daily | Self::ToShip => Self::Daily,
        }
    }
}
