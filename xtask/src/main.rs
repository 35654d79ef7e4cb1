//! The one door for builds, tests, QEMU, sizes and benchmarks.
fn main() {}
