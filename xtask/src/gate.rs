//! The gate: no panic and no float reachable from `Ecu::receive` and `Ecu::step`, shown on linked images.
//!
//! `boards` follows the calls in the machine code of every board's own images. Here the same is shown by other means,
//! on an image that holds nothing but the torque path:
//!
//! 1. No panic: the gate image's panic handler calls a function that does not exist, so it links only if no
//!    panic is reachable. Its symbols are searched once more for the panic machinery.
//! 2. No float: built for a core without floating-point hardware, a float operation would be a call of a
//!    library function, and its symbol is searched for.
//! 3. No wrap: overflow checks are on in this image, so that a `+` or `*` that may wrap is a panic. (Not in a board's
//!    image: there it would only be code that never runs.)
//! 4. All bite: with a panic or a wrap behind the step the image must not link, with a float operation the search must
//!    find it. A gate that cannot fail proves nothing.
//!
//! Where it fails it says where: the same image with a panic handler that links is followed from the step to the panic.

use std::path::Path;

use anyhow::{Context, Result, bail, ensure};

use crate::code::{CONTROLLER, Code, is_soft_float};
use crate::image::{BOARD, M3, M4F, build_command, elf_of};
use crate::tool;

/// The function that does not exist (`firmware/src/bin/gate.rs`).
const UNDEFINED: &str = "a_panic_is_reachable_from_the_controller";

pub(crate) fn run() -> Result<()> {
    for target in [M4F, M3] {
        let elf = match elf_of(&mut gate("gate", target)) {
            Ok(elf) => elf,
            Err(error) => bail!("{error}: {}", calls_to_panic(target)),
        };
        let symbols = symbols(&elf)?;
        ensure!(symbols.len() > 20, "{target}: the gate image has hardly a symbol");
        let panics: Vec<_> = symbols.iter().filter(|name| is_panic(name)).collect();
        ensure!(
            panics.is_empty(),
            "{target}: panic machinery in the gate image: {panics:?}"
        );
        if target == M3 {
            let floats: Vec<_> = symbols.iter().filter(|name| is_soft_float(name)).collect();
            ensure!(
                floats.is_empty(),
                "float operations in the gate image: {floats:?}"
            );
        }
    }
    println!("gate: no panic, no wrap and no float is reachable from the controller's step");

    for seed in ["gate-with-panic", "gate-with-wrap"] {
        let output = gate(seed, M4F).output()?;
        let text = String::from_utf8_lossy(&output.stderr);
        ensure!(
            !output.status.success() && text.contains(UNDEFINED),
            "{seed}: the gate does not see what was put there:\n{text}"
        );
    }
    let symbols = symbols(&elf_of(&mut gate("gate-with-float", M3))?)?;
    ensure!(
        symbols.iter().any(|name| is_soft_float(name)),
        "the gate does not see a float operation that is there"
    );
    println!("gate: it finds a panic, a wrap and a float operation that were put there");
    injection_leaves_nothing()
}

/// An ECU that nothing is injected into is the product's, whether or not Cargo switches the feature on: as much memory,
/// as many functions on its torque path, no call through a pointer (which injected faults would need), and as much code,
/// but for what the compiler orders otherwise.
fn injection_leaves_nothing() -> Result<()> {
    let measure = |features| {
        let elf = elf_of(&mut gate(features, M4F))?;
        let functions = Code::from_image(&elf)?.torque_path(CONTROLLER)?.functions;
        let sections = tool::output(tool::llvm("llvm-size")?.arg("-A").arg(elf))?;
        let size = |name: &str| {
            let line = sections.lines().find(|line| line.starts_with(name));
            let bytes = line.and_then(|line| line.split_whitespace().nth(1)?.parse::<u64>().ok());
            bytes.with_context(|| format!("no section {name}:\n{sections}"))
        };
        let memory = [size(".rodata")?, size(".data")?, size(".bss")?];
        Ok::<_, anyhow::Error>((functions, memory, size(".text")?))
    };
    let (without, with) = (measure("gate")?, measure("gate,broken")?);
    ensure!(
        (without.0, without.1) == (with.0, with.1) && with.2 * 100 <= without.2 * 101,
        "fault injection leaves something in the product's ECU (functions, memory, code): {without:?} without the \
         feature, {with:?} with it"
    );
    println!("gate: the feature fault-injection adds nothing to an ECU without it");
    Ok(())
}

fn gate(feature: &str, target: &str) -> std::process::Command {
    let mut command = build_command("gate", target, &format!("{BOARD},{feature}"));
    command.args(["--config", "profile.firmware.overflow-checks=true"]);
    command
}

/// The calls from the step to a panic, in the image whose panic handler links.
fn calls_to_panic(target: &str) -> String {
    let path = elf_of(&mut gate("gate-that-links", target))
        .and_then(|elf| Code::from_image(&elf))
        .and_then(|code| code.torque_path(CONTROLLER));
    match path {
        Err(error) => format!("{error:#}"),
        Ok(_) => {
            "no call from the controller's step leads to a panic; what else does the image hold?".to_owned()
        }
    }
}

fn symbols(elf: &Path) -> Result<Vec<String>> {
    let text = tool::output(tool::llvm("llvm-nm")?.arg("--format=just-symbols").arg(elf))?;
    Ok(text.lines().map(str::to_owned).collect())
}

fn is_panic(symbol: &str) -> bool {
    symbol.contains("panicking") || symbol.contains("panic_fmt") || symbol.contains("unwrap_failed")
}
