//! Command line of the workbench.
fn main() {}
