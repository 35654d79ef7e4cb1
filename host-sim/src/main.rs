//! Command line of the workbench.

mod cli;

fn main() -> std::process::ExitCode {
    haptic_log::guard::keep_guarded_panics_quiet();
    cli::main()
}
