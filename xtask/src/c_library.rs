//! The C library: built for the host and for a Cortex-M4F, its header held to C99 and C++, its example run on both.

use std::path::{Path, PathBuf};
use std::process::Stdio;

use anyhow::{Context, Result, bail};

use crate::built::Built;
use crate::image::{self, M4F};
use crate::tool::{cargo, command, ensure, output, root, run};

const WARNINGS: [&str; 4] = ["-Wall", "-Wextra", "-Werror", "-pedantic"];
const CORTEX_M4F: [&str; 4] = [
    "-mcpu=cortex-m4",
    "-mthumb",
    "-mfloat-abi=hard",
    "-mfpu=fpv4-sp-d16",
];
/// What the host's standard library, which the archive holds, asks for.
pub(crate) const HOST_LIBRARIES: [&str; 4] = ["-lpthread", "-ldl", "-lm", "-lgcc_s"];

/// Builds everything into `target/dist/c`, and compares the example's words on host and target.
pub(crate) fn check(built: Built) -> Result<()> {
    ensure(&[
        ("gcc", "gcc"),
        ("g++", "g++"),
        ("arm-none-eabi-gcc", "gcc-arm-none-eabi"),
        ("arm-none-eabi-gcc", "libnewlib-arm-none-eabi"),
        ("qemu-system-arm", "qemu-system-arm"),
    ])?;
    let dist = root().join("target/dist/c");
    std::fs::create_dir_all(&dist).with_context(|| dist.display().to_string())?;
    std::fs::copy(
        root().join("bindings/c/include/haptic_guidance.h"),
        dist.join("haptic_guidance.h"),
    )?;
    let host = host_library(&dist, built)?;
    let target = target_library(&dist)?;
    header()?;
    parameters(&dist, &host)?;
    let native = output(&mut command(example(&dist, "main", &host)?))?;
    print!("{native}");
    let image = image(&dist, &target)?;
    let in_qemu = output(
        command("qemu-system-arm")
            .args("-M mps2-an386 -nographic -semihosting-config enable=on,target=native".split(' '))
            .arg("-kernel")
            .arg(&image)
            .stdin(Stdio::null()),
    )?;
    if in_qemu.replace('\r', "") != native {
        bail!("in QEMU the example says something else:\n{in_qemu}");
    }
    println!("The same in QEMU on a Cortex-M4F, linked without a panic handler of its own");
    Ok(())
}

/// The library's file.
pub(crate) const LIBRARY: &str = "libhaptic_guidance.a";

/// The library for this computer, beneath `dist`.
pub(crate) fn host_library(dist: &Path, built: Built) -> Result<PathBuf> {
    put(&built.package("haptic-c")?.join(LIBRARY), &dist.join("host"))
}

/// The library for a Cortex-M4F, beneath `dist`.
pub(crate) fn target_library(dist: &Path) -> Result<PathBuf> {
    run(cargo()
        .args(["build", "--profile", "dist", "-p", "haptic-c", "--target", M4F])
        .args(image::remapped()?))?;
    put(
        &root().join("target").join(M4F).join("dist").join(LIBRARY),
        &dist.join(M4F),
    )
}

/// A library where users look for it.
fn put(built: &Path, folder: &Path) -> Result<PathBuf> {
    std::fs::create_dir_all(folder)?;
    let library = folder.join(LIBRARY);
    std::fs::copy(built, &library).with_context(|| built.display().to_string())?;
    Ok(library)
}

/// The header alone, in both languages.
fn header() -> Result<()> {
    for (compiler, standard, language) in [("gcc", "-std=c99", "c"), ("g++", "-std=c++11", "c++")] {
        run(command(compiler)
            .args([standard, "-x", language, "-fsyntax-only"])
            .args(WARNINGS)
            .arg("bindings/c/include/haptic_guidance.h"))?;
    }
    println!("The header passes {} as C99 and as C++", WARNINGS.join(" "));
    Ok(())
}

/// A program that sets every parameter by the name in the header, and asks the library which one it was.
fn parameters(dist: &Path, library: &Path) -> Result<()> {
    let header = root().join("bindings/c/include/haptic_guidance.h");
    let header = std::fs::read_to_string(&header).with_context(|| header.display().to_string())?;
    let names = header.split_once("typedef enum hg_parameter {");
    let (names, _) = names
        .and_then(|(_, rest)| rest.split_once('}'))
        .context("the header has no enum hg_parameter")?;
    let checks = names
        .lines()
        .filter_map(|line| line.split_once(" = "))
        .map(|(name, _)| format!("CHECK({})\n", name.trim()));
    std::fs::write(dist.join("every_parameter.h"), checks.collect::<String>())?;
    let program = program(dist, "bindings/c/parameters.c", library)?;
    print!("{}", output(&mut command(program))?);
    Ok(())
}

/// An example of `examples/c`, for the host.
pub(crate) fn example(dist: &Path, name: &str, library: &Path) -> Result<PathBuf> {
    program(dist, &format!("examples/c/{name}.c"), library)
}

/// A program of one source, for the host.
fn program(dist: &Path, source: &str, library: &Path) -> Result<PathBuf> {
    let program = dist.join(Path::new(source).file_stem().context("a file's name")?);
    run(command("gcc")
        .args(["-std=c99", "-O2", "-Ibindings/c/include", "-I"])
        .arg(dist)
        .args(WARNINGS)
        .arg(source)
        .arg(library)
        .args(HOST_LIBRARIES)
        .arg("-o")
        .arg(&program))?;
    Ok(program)
}

/// The host's library and the replaying example.
pub(crate) fn replay(built: Built) -> Result<PathBuf> {
    let dist = root().join("target/dist/c");
    std::fs::create_dir_all(&dist)?;
    let library = host_library(&dist, built)?;
    example(&dist, "replay", &library)
}

/// The example for QEMU's board; what it prints goes through semihosting.
fn image(dist: &Path, library: &Path) -> Result<PathBuf> {
    let image = dist.join("main.elf");
    run(command("arm-none-eabi-gcc")
        .args(CORTEX_M4F)
        .args(["-std=c99", "-O2", "-Ibindings/c/include", "--specs=rdimon.specs"])
        .args(["-Wl,--gc-sections", "-Tbindings/c/mps2.ld"])
        .args(WARNINGS)
        .args(["examples/c/main.c", "bindings/c/mps2_start.c"])
        .arg(library)
        .arg("-o")
        .arg(&image))?;
    Ok(image)
}
