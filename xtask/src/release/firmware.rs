//! Images of the boards, in the formats that flashers and debuggers read.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use clap::ValueEnum;

use super::archive::Entry;
use super::{Part, Release};
use crate::boards::Board;
use crate::built::Built;
use crate::image::Image;
use crate::tool::{self, command, llvm, root, run};

/// Every board; in a dry run QEMU's alone, whose libraries are small.
pub(super) fn images(release: &Release) -> Result<()> {
    tool::ensure(&[("arm-none-eabi-objcopy", "binutils-arm-none-eabi")])?;
    let place = release.try_in(Part::Firmware)?;
    let mut entries = vec![Entry::read(
        &root().join("xtask/src/release/firmware.txt"),
        "README.txt",
    )?];
    let wanted = |board: &&Board| release.built == Built::ToShip || board.chip().is_none();
    for board in Board::value_variants().iter().filter(wanted) {
        for image in [Image::SteeringEcu, Image::Lockstep] {
            let stem = format!("{}/{}", board.feature(), image.bin());
            let elf = place.join(format!("{}-{}.elf", board.feature(), image.bin()));
            let map = board.build_to_ship(image, &elf)?;
            entries.push(Entry::new(&format!("{stem}.map"), map));
            for (ending, format) in [("hex", "ihex"), ("s19", "srec")] {
                let file = elf.with_extension(ending);
                // By names without a folder: an S-record's header holds the file's.
                let names = [&elf, &file].map(|file| file.file_name().unwrap_or_default());
                run(llvm("llvm-objcopy")?
                    .current_dir(&place)
                    .args(["-O", format])
                    .args(names))?;
                ensure!(
                    flat(&elf, "elf32-littlearm")? == flat(&file, format)?,
                    "{} holds other bytes than its ELF",
                    file.display()
                );
                entries.push(Entry::read(&file, &format!("{stem}.{ending}"))?);
            }
            entries.push(Entry::read(&elf, &format!("{stem}.elf"))?);
        }
    }
    release.pack(
        Part::Firmware,
        &format!("haptic-firmware-{}", release.version),
        entries,
    )?;
    Ok(())
}

/// What GNU's tool, none of those that wrote the file, reads in it: the bytes of the flash.
fn flat(file: &Path, format: &str) -> Result<Vec<u8>> {
    let flat = file.with_extension("bin");
    run(command("arm-none-eabi-objcopy")
        .args(["-I", format, "-O", "binary"])
        .arg(file)
        .arg(&flat))?;
    fs::read(&flat).with_context(|| flat.display().to_string())
}
