//! The C library in an archive: header, libraries, a description for pkg-config, examples.

use std::path::Path;

use anyhow::{Context, Result, ensure};

use super::archive::{self, Entry};
use super::{Part, Release};
use crate::c_library::{self, HOST_LIBRARIES, LIBRARY};
use crate::image::M4F;
use crate::tool::{self, command, output, root, run};

/// Packs it, and builds and runs an example against what was unpacked.
pub(super) fn library(release: &Release) -> Result<()> {
    tool::ensure(&[("gcc", "gcc"), ("pkg-config", "pkg-config")])?;
    let dist = root().join("target/dist/c");
    let host = c_library::host_library(&dist, release.built)?;
    let target = c_library::target_library(&dist)?;
    let name = format!("haptic-guidance-c-{}-{}", release.version, release.host);
    let header = root().join("bindings/c/include/haptic_guidance.h");
    let mut entries = vec![
        Entry::read(&header, "include/haptic_guidance.h")?,
        Entry::read(&host, &format!("lib/{LIBRARY}"))?,
        Entry::read(&target, &format!("lib/{M4F}/{LIBRARY}"))?,
        Entry::new("lib/pkgconfig/haptic-guidance.pc", description(&release.version)),
    ];
    for example in ["main.c", "replay.c"] {
        let file = root().join("examples/c").join(example);
        entries.push(Entry::read(&file, &format!("examples/{example}"))?);
    }
    let archive = release.pack(Part::C, &name, entries)?;
    let place = release.try_in(Part::C)?;
    archive::unpack(&archive, &place)?;
    try_it(&place.join(name))
}

/// What pkg-config says to whoever links the host's library, wherever the archive was unpacked.
fn description(version: &str) -> String {
    format!(
        "prefix=${{pcfiledir}}/../..\n\n\
         Name: haptic-guidance\n\
         Description: The shipping controller of haptic-guidance\n\
         Version: {version}\n\
         Cflags: -I${{prefix}}/include\n\
         Libs: -L${{prefix}}/lib -lhaptic_guidance {}\n",
        HOST_LIBRARIES.join(" ")
    )
}

fn try_it(unpacked: &Path) -> Result<()> {
    let flags = output(
        command("pkg-config")
            .env("PKG_CONFIG_PATH", unpacked.join("lib/pkgconfig"))
            .args(["--cflags", "--libs", "haptic-guidance"]),
    )?;
    let (compile, link): (Vec<&str>, Vec<&str>) =
        flags.split_whitespace().partition(|flag| flag.starts_with("-I"));
    let example = unpacked.join("example");
    run(command("gcc")
        .args(["-std=c99", "-O2"])
        .args(compile)
        .arg(unpacked.join("examples/main.c"))
        .args(link)
        .arg("-o")
        .arg(&example))?;
    let said = output(&mut command(example))?;
    let last = said.lines().last().context("the example says nothing")?;
    ensure!(!last.is_empty(), "the example ends with an empty line");
    println!("an example built by pkg-config says {last:?}");
    Ok(())
}
