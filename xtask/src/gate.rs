//! The gate: no panic and no float reachable from `Ecu::receive` and `Ecu::step`, shown on linked images.
//!
//! 1. No panic: the gate image's panic handler calls a function that does not exist, so it links only if no
//!    panic is reachable. Its symbols are searched once more for the panic machinery.
//! 2. No float: built for a core without floating-point hardware, a float operation would be a call of a
//!    library function, and its symbol is searched for.
//! 3. Both bite: with a panic behind the step the image must not link, with a float operation the search must
//!    find it. A gate that cannot fail proves nothing.

use std::path::Path;

use anyhow::{Result, bail, ensure};

use crate::image::{BOARD, M3, M4F, build_command, elf_of};
use crate::tool;

/// The function that does not exist (`firmware/src/bin/gate.rs`).
const UNDEFINED: &str = "a_panic_is_reachable_from_the_controller";

pub(crate) fn run() -> Result<()> {
    for target in [M4F, M3] {
        let elf = match elf_of(&mut gate("gate", target)) {
            Ok(elf) => elf,
            Err(error) => bail!("{error}: is a panic reachable from the controller's step?"),
        };
        let symbols = symbols(&elf)?;
        ensure!(symbols.len() > 20, "{target}: the gate image has hardly a symbol");
        let panics: Vec<_> = symbols.iter().filter(|name| is_panic(name)).collect();
        ensure!(
            panics.is_empty(),
            "{target}: panic machinery in the gate image: {panics:?}"
        );
        if target == M3 {
            let floats: Vec<_> = symbols.iter().filter(|name| is_float(name)).collect();
            ensure!(
                floats.is_empty(),
                "float operations in the gate image: {floats:?}"
            );
        }
    }
    println!("gate: no panic and no float is reachable from the controller's step");

    let output = gate("gate-with-panic", M4F).output()?;
    let text = String::from_utf8_lossy(&output.stderr);
    ensure!(
        !output.status.success() && text.contains(UNDEFINED),
        "the gate does not see a panic that is there:\n{text}"
    );
    let symbols = symbols(&elf_of(&mut gate("gate-with-float", M3))?)?;
    ensure!(
        symbols.iter().any(|name| is_float(name)),
        "the gate does not see a float operation that is there"
    );
    println!("gate: it finds a panic and a float operation that were put there");
    Ok(())
}

fn gate(feature: &str, target: &str) -> std::process::Command {
    build_command("gate", target, &format!("{BOARD},{feature}"))
}

fn symbols(elf: &Path) -> Result<Vec<String>> {
    let text = tool::output(tool::llvm("llvm-nm")?.arg("--format=just-symbols").arg(elf))?;
    Ok(text.lines().map(str::to_owned).collect())
}

fn is_panic(symbol: &str) -> bool {
    symbol.contains("panicking") || symbol.contains("panic_fmt") || symbol.contains("unwrap_failed")
}

/// Names of the run-time ABI for ARM (`__aeabi_dadd`, `__aeabi_i2f`) and of compiler-rt (`__adddf3`,
/// `__fixdfsi`).
fn is_float(symbol: &str) -> bool {
    let is_aeabi = symbol.strip_prefix("__aeabi_").is_some_and(|name| {
        let converts_to = ["i2f", "i2d", "ui2f", "ui2d", "l2f", "l2d", "ul2f", "ul2d"];
        name.starts_with(['f', 'd'])
            || name.starts_with("cf")
            || name.starts_with("cd")
            || converts_to.contains(&name)
    });
    let is_compiler_rt = symbol.starts_with("__")
        && [
            "sf2", "df2", "sf3", "df3", "sfsi", "dfsi", "sfdi", "dfdi", "sisf", "sidf", "disf", "didf",
        ]
        .iter()
        .any(|end| symbol.ends_with(end));
    is_aeabi || is_compiler_rt
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Names as the ABI's document (IHI 0043) lists them.
    #[test]
    fn float_calls_are_told_from_integer_calls() {
        for name in [
            "__aeabi_dadd",
            "__aeabi_fmul",
            "__aeabi_d2iz",
            "__aeabi_ul2d",
            "__aeabi_cfcmple",
            "__adddf3",
        ] {
            assert!(is_float(name), "{name}");
        }
        for name in [
            "__aeabi_ldivmod",
            "__aeabi_uidiv",
            "__aeabi_memcpy4",
            "__aeabi_lmul",
            "__divmoddi4",
        ] {
            assert!(!is_float(name), "{name}");
        }
    }
}
