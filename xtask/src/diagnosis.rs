//! Diagnosis and authentication as other tools meet them: their tester and their MACs against an image in QEMU, and their reader of descriptions.

use anyhow::Result;

use crate::boards::Board;
use crate::built::Built;
use crate::image::Image;
use crate::tool::{self, command, run};
use crate::venv;

/// An error is that of the check, which said itself what was wrong.
pub(crate) fn check(built: Built) -> Result<()> {
    tool::ensure(&[("qemu-system-arm", "qemu-system-arm")])?;
    let (host_sim, python) = (built.host_sim()?, venv::environment()?);
    for check in ["check_pdx.py", "check_diagnosis.py"] {
        run(command(&python)
            .arg(format!("tests/tools/{check}"))
            .arg(&host_sim))?;
    }
    run(command(&python).arg("tests/tools/check_authentication.py"))?;
    let product = Board::Mps2An386.build(Image::SteeringEcu)?;
    run(command(&python)
        .args(["tests/tools/check_diagnosis.py", "--power"])
        .arg(product))
}
