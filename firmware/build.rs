//! Linker arguments and the memory map of the bare-metal images. A desktop build gets none.

use std::path::PathBuf;
use std::{env, fs};

/// Features that choose a board, and the board's memory map in `src/boards`.
const MAPS: [(&str, &str); 4] = [
    ("MPS2_AN386", "mps2.x"),
    ("MPS2_AN500", "mps2.x"),
    ("NUCLEO_G474RE", "nucleo_g474re.x"),
    ("SAM_E54_XPRO", "sam_e54_xpro.x"),
];

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=../memory.x");
    println!("cargo:rerun-if-changed=src/stack.x");
    println!("cargo:rerun-if-changed=src/boards");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    let source = PathBuf::from(env::var("CARGO_MANIFEST_DIR").expect("cargo sets it")).join("src");
    let out = PathBuf::from(env::var("OUT_DIR").expect("cargo sets it"));
    // Without a board there is nothing to link: the compiler says which there are (src/boards/mod.rs).
    if let Some((_, map)) = MAPS
        .iter()
        .find(|(board, _)| env::var_os(format!("CARGO_FEATURE_{board}")).is_some())
    {
        let map = source.join("boards").join(map);
        fs::copy(&map, out.join("board_memory.x")).unwrap_or_else(|e| panic!("{}: {e}", map.display()));
    }
    println!("cargo:rustc-link-search={}", out.display());
    // cortex-m-rt's layout; it includes memory.x, which the linker finds in the workspace's root.
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    println!("cargo:rustc-link-arg-bins=-T{}", source.join("stack.x").display());
    // Sections need not start on a page: the images are not loaded by an operating system.
    println!("cargo:rustc-link-arg-bins=--nmagic");
    for bin in ["steering-ecu", "lockstep", "broken", "power-loss"] {
        println!("cargo:rustc-link-arg-bin={bin}=-Tdefmt.x");
    }
}
