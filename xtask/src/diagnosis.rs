//! Diagnosis as other tools meet it: their tester against the product's image in QEMU, and their reader of descriptions.

use anyhow::Result;

use crate::boards::Board;
use crate::built::Built;
use crate::image::Image;
use crate::tool::{self, command, run};
use crate::venv;

/// An error is that of the check, which said itself what was wrong.
pub(crate) fn check(built: Built) -> Result<()> {
    tool::ensure(&[("qemu-system-arm", "qemu-system-arm")])?;
    let elf = Board::Mps2An386.build(Image::SteeringEcu)?;
    let python = venv::environment()?;
    run(command(&python.to_string_lossy())
        .arg("tests/tools/check_pdx.py")
        .arg(built.host_sim()?))?;
    run(command(&python.to_string_lossy())
        .arg("tests/tools/check_diagnosis.py")
        .arg(elf))
}
