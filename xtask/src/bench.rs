//! What the controller costs on the host: instructions counted by callgrind, the same on every machine. On a target:
//! `boards`. Wall-clock time is `speed`'s.

use anyhow::Result;

use crate::golden::{self, figure};
use crate::{callgrind, tool};

pub(crate) fn run(bless: bool) -> Result<()> {
    tool::ensure(&[("valgrind", "valgrind")])?;
    let host = callgrind::count()?;
    // The C library picks its memcpy, sine and cosine by the processor.
    let figure = |name: &str, value| figure(name, "instructions", value, 5);
    golden::check(
        &[
            figure("host_step_mean", host.per_step),
            figure("host_simulated_second", host.per_simulated_second),
        ],
        bless,
    )
}
