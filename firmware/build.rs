//! Linker arguments of the bare-metal images. A desktop build gets none.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=../memory.x");
    if std::env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    // cortex-m-rt's layout; it includes memory.x, which the linker finds in the workspace's root.
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    // Sections need not start on a page: the images are not loaded by an operating system.
    println!("cargo:rustc-link-arg-bins=--nmagic");
    for bin in ["steering-ecu", "lockstep"] {
        println!("cargo:rustc-link-arg-bin={bin}=-Tdefmt.x");
    }
}
